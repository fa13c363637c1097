"""Timetables of faults read back as they were written, and what does not fit is said in one sentence."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from launcher.fault_timetable import (
    Fault,
    FaultyTimetable,
    Kill,
    Loss,
    Pause,
    Timetable,
    checked,
    describe,
    read_timetable,
    write_timetable,
)

PEERS = ("base", "agent", "robot1", "robot2")


def values(kind: type) -> st.SearchStrategy[Fault]:
    """Any fault of a kind, its fields chosen by their names."""
    shares = st.floats(0.0, 1.0)
    names = st.lists(st.sampled_from(PEERS), min_size=1, max_size=3, unique=True).map(tuple)
    known = {
        "at_s": st.floats(0.0, 1e3), "for_s": st.none() | st.floats(0.1, 1e3), "group": names,
        "disk": st.sampled_from(("kept", "lost")), "noticed_after_s": shares,
        "who": st.sampled_from(("agent", "leader")),
        "speakers": names | st.just(()), "hearers": names | st.just(()), "share": shares, "burst": st.floats(1.0, 9.0),
        "least_s": shares, "mean_s": shares, "tail": st.sampled_from(("uniform", "exponential", "log-normal")),
        "spikes": shares, "spike_s": shares, "overtaking": st.booleans(),
        "speaking": st.booleans(), "takes_s": shares, "full": st.booleans(),
        "rate": st.floats(0.9, 1.1), "offset_s": st.floats(-9.0, 9.0),
    }  # fmt: skip
    fields = {field: known[field] for field in kind.__struct_fields__}  # type: ignore[attr-defined]
    if kind is Pause:
        fields["for_s"] = st.floats(0.1, 1e3)
    return st.builds(kind, **fields)


@given(st.lists(st.one_of(*map(values, get_args(Fault))), max_size=6))
@settings(deadline=None, max_examples=60)
def test_what_is_written_reads_back(tmp_path_factory: pytest.TempPathFactory, faults: list[Fault]) -> None:
    file = tmp_path_factory.mktemp("faults") / "faults.toml"
    file.write_text(write_timetable(Timetable(faults=tuple(faults))), encoding="utf-8")
    assert read_timetable(file, PEERS).faults == tuple(sorted(faults, key=lambda fault: fault.at_s))
    for fault in faults:
        assert describe(fault)


def test_it_says_when_nothing_is_amiss_any_more() -> None:
    first, second = Kill(at_s=1.0, for_s=5.0, who="leader"), Loss(at_s=2.0, for_s=3.0, share=0.5)
    assert Timetable().ends_s == 0.0
    assert Timetable(faults=(first, second)).ends_s == 6.0
    assert Timetable(faults=(first, Loss(at_s=2.0, share=0.5))).ends_s == float("inf")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("faults = 3", "faults is a whole number; it must be a list"),
        ("x = 1", "unknown key 'x' in the file; the keys there are faults"),
        ("[[faults]]\nat_s = 1", r"faults\[0\].kind is missing; add it, one of kill, pause"),
        ('[[faults]]\nkind = "x"', r"faults\[0\].kind is 'x'; choose one of kill, pause"),
        ('[[faults]]\nkind = "kill"\nat_s = 1', r"faults\[0\].who is missing; add it"),
        (
            '[[faults]]\nkind = "kill"\nat_s = -1\nwho = "base"',
            r"faults\[0\].at_s is out of range; it must be at least 0",
        ),
        (
            '[[faults]]\nkind = "loss"\nat_s = 1\nshare = 2.0',
            r"faults\[0\].share is out of range; it must be at most 1",
        ),
        ('[[faults]]\nkind = "kill"\nat_s = 1\nwho = "base"\nx = 2', r"unknown key 'x' in faults\[0\]; .* who"),
        ('[[faults]]\nkind = "kill"\nat_s = 1\nwho = "bob"', r"names 'bob', who is not there; choose one of base"),
        ('[[faults]]\nkind = "cut"\nat_s = 1\nhearers = ["leader"]', r"faults\[0\].hearers names 'leader'"),
        ('[[faults]]\nkind = "pause"\nat_s = 1\nwho = "base"', "pauses base for ever; add for_s = 2.0, or kill it"),
        ('[[faults]]\nkind = "kill"\nat_s = "soon"\nwho = "base"', r"at_s is text in quotes; it must be a number"),
        (
            '[[faults]]\nkind = "kill"\nat_s = 1\nwho = "Base"',
            r"faults\[0\].who cannot be a peer's name; use one on the",
        ),
        ('[[faults]]\nkind = "partition"\nat_s = 1\ngroup = []', r"faults\[0\].group is empty; name at least one peer"),
        (
            '[[faults]]\nkind = "kill"\nat_s = nan\nwho = "base"',
            r"faults\[0\].at_s is out of range; it must be at least 0",
        ),
        ("faults = [", "is not valid TOML"),
    ],
)
def test_what_does_not_fit_is_one_sentence_with_place_and_remedy(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "faults.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(FaultyTimetable, match=says) as caught:
        read_timetable(file, PEERS)
    assert str(caught.value).startswith(f"{file}: ")
    assert "\n" not in str(caught.value)


def test_a_file_that_is_no_text_or_not_there_is_one_sentence(tmp_path: Path) -> None:
    file = tmp_path / "faults.toml"
    with pytest.raises(FaultyTimetable, match="cannot be read"):
        read_timetable(file, PEERS)
    file.write_bytes(b"\xff\xfe")
    with pytest.raises(FaultyTimetable, match="UTF-8"):
        read_timetable(file, PEERS)


def test_names_of_other_teams_are_refused_wherever_the_timetable_comes_from() -> None:
    with pytest.raises(FaultyTimetable, match="robot9"):
        checked(Timetable(faults=(Kill(at_s=0.0, who="robot9"),)), PEERS)
