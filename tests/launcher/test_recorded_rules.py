"""A recording of a mission in which all went well breaks no rule, and the same with a few records changed does."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import TypeVar

import pytest
from msgspec import structs

from agents.records import Advance, AnyRecord, LogLine, Office, Taken, TopologyChange, TreeAnswer
from launcher.fault_timetable import LEADER, Kill, Timetable
from launcher.recorded_rules import RecordedRules
from launcher.reigns import find_reigns
from launcher.simulation import simulate
from launcher.spells import Spell
from tests.launcher.test_simulation import CORNER, around_the_corner

Entry = tuple[float, str, AnyRecord]
Records = list[Entry]
Change = Callable[[Records], Records]
Kind = TypeVar("Kind", bound=AnyRecord)

ENDS_S = 9.5


class Memory:
    """A recorder that remembers."""

    def __init__(self) -> None:
        self.records: Records = []

    def record(self, time_s: float, peer: str, record: AnyRecord) -> None:
        self.records.append((time_s, peer, record))

    def close(self) -> None:
        pass


@pytest.fixture(scope="module")
def honest() -> Records:
    """Two trees of the base station, which is killed then, and one of its successor."""
    memory = Memory()
    faults = Timetable(faults=(Kill(at_s=6.0, who=LEADER, for_s=2.0),))
    simulate(around_the_corner(), CORNER, recorder=memory, duration_s=ENDS_S, faults=faults)
    return memory.records


def broken(records: Records) -> tuple[str, ...]:
    return find_reigns(records, 0.0).broken


def all_of(records: Records, kind: type[Kind]) -> Iterator[tuple[float, str, Kind]]:
    return ((time_s, peer, record) for time_s, peer, record in records if isinstance(record, kind))


def second_tree(records: Records) -> tuple[float, str, TopologyChange]:
    """The one with new links between robots, of the first leader."""
    return next(entry for entry in all_of(records, TopologyChange) if entry[2].number == (1, 1))


def confirmation(records: Records, end: str) -> tuple[float, str, TreeAnswer]:
    """By an end of that tree's new links."""
    return next(
        entry for entry in all_of(records, TreeAnswer)
        if entry[1] == end and entry[2].proposal == (1, 1) and entry[2].confirmed
    )  # fmt: skip


def last_taken(records: Records) -> tuple[float, str, Taken]:
    """Orders of the first leader that a robot took last."""
    return [entry for entry in all_of(records, Taken) if entry[2].epoch == 1][-1]


def later(records: Records, entry: Entry, by_s: float) -> Records:
    return [(time_s + by_s * ((time_s, peer, what) == entry), peer, what) for time_s, peer, what in records]


def instead(records: Records, entry: Entry, **fields: object) -> Records:
    time_s, peer, record = entry
    changed = (time_s, peer, structs.replace(record, **fields))
    return [changed if one == entry else one for one in records]


def never_confirmed(records: Records) -> Records:
    return [one for one in records if one != confirmation(records, "robot1")]


def confirmed_late(records: Records) -> Records:
    return later(records, confirmation(records, "base"), 0.2)


def confirmed_another(records: Records) -> Records:
    return instead(records, confirmation(records, "robot1"), confirmed=("base",))


def not_spanning(records: Records) -> Records:
    _, _, change = entry = second_tree(records)
    return instead(records, entry, edges=change.edges[:-1])


def numbered_down(records: Records) -> Records:
    """The second tree bears the number of the first."""
    return instead(records, second_tree(records), number=(1, 0))


def said_too_often(records: Records) -> Records:
    return instead(records, second_tree(records), rounds=9)


def let_go_of_links_first(records: Records) -> Records:
    """A robot keeps the links of the second tree 0.1 s before they are confirmed."""
    at_s, _, _ = second_tree(records)
    answer = TreeAnswer(proposal=(1, 1), confirmed=(), kept=(1, 1))
    return sorted([*records, (at_s - 0.1, "robot2", answer)], key=lambda entry: entry[0])


def went_back(records: Records) -> Records:
    at_s, _, _ = second_tree(records)
    return [*records, (at_s + 0.5, "robot2", TreeAnswer(proposal=None, confirmed=(), kept=(1, 0)))]


def let_go_on_first(records: Records) -> Records:
    """The leader releases a stage more while the second tree is being negotiated."""
    at_s, leader, change = second_tree(records)
    assert change.motion is not None
    before = [advance for time_s, _, advance in all_of(records, Advance) if time_s < at_s][-1]
    advance = structs.replace(before, revision=change.motion[1], released=before.released + 1)
    return [*records, (at_s - 0.5 * change.duration_s, leader, advance)]


def took_twice(records: Records) -> Records:
    """The same orders are taken once more, as if they had overtaken others."""
    at_s, peer, _ = last_taken(records)
    first = next(entry for entry in all_of(records, Taken) if entry[1] == peer and entry[2].motion is not None)
    return [*records, (at_s + 0.1, peer, first[2])]


def took_an_older_plan(records: Records) -> Records:
    """A later order, with the motion of an earlier one."""
    _, _, taken = entry = last_taken(records)
    assert taken.motion is not None
    plan, revision = taken.motion
    return instead(records, entry, motion=(plan, revision - 2))


def took_late(records: Records) -> Records:
    _, _, taken = entry = last_taken(records)
    return instead(records, entry, sent_at_s=taken.sent_at_s - 1.0)


def took_what_it_did_not_obey(records: Records) -> Records:
    return instead(records, last_taken(records), leader="robot2")


def ordered_in_the_reign_of_another(records: Records) -> Records:
    at_s = next(time_s for time_s, _, office in all_of(records, Office) if office.leads and office.leads.epoch == 2)
    advance = Advance(epoch=1, plan=0, revision=0, released=0, finished={})
    return [*records, (at_s + 0.1, "base", advance)]


def test_a_recording_of_a_mission_without_mischief_breaks_no_rule(honest: Records) -> None:
    assert broken(honest) == ()
    assert {change.number[0] for _, _, change in all_of(honest, TopologyChange) if change.committed} == {1, 2}
    assert {peer for _, peer, _ in all_of(honest, Taken)} >= {"robot1", "robot2"}


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (never_confirmed, r"the tree 1\.1 of .* was in force before robot1 had confirmed its link with base"),
        (confirmed_late, r"the tree 1\.1 of .* was in force before base had confirmed its link with robot1"),
        (confirmed_another, r"the tree 1\.1 of .* before robot1 had confirmed its link with agent"),
        (not_spanning, r"the tree 1\.1 of .* is none: .* do not join"),
        (numbered_down, r"the tree 1\.0 of .* came into force after 1\.0"),
        (said_too_often, r"the tree 1\.1 of .* was proposed 9 times"),
        (let_go_of_links_first, r"robot2 kept the links of 1\.1 at .*, which was not in force"),
        (went_back, r"robot2 went back at .* to the tree 1\.0"),
        (
            let_go_on_first,
            r"base released stage \d+ of plan 1\.0 at .*, while the tree 1\.1 that it leads to was being",
        ),
        (took_twice, r"robot\d took order 1\.\d+ at .*, after 1\.\d+"),
        (took_an_older_plan, r"robot\d took order 1\.\d+ at .*, which is of an older plan than it had taken"),
        (took_late, r"robot\d took order 1\.\d+ at .*, 0\.\d\d s after the lease that it was given in"),
        (took_what_it_did_not_obey, r"robot\d took order 1\.\d+ of robot2 at .*, when it did not obey it"),
        (ordered_in_the_reign_of_another, r"base gave orders in epoch 1 at .*, when it did not lead"),
    ],
)
def test_a_record_that_was_tampered_with_is_found(honest: Records, change: Change, sentence: str) -> None:
    found = "\n".join(broken(change(honest)))
    assert re.search(sentence, found), found


def test_what_a_killed_process_has_not_written_is_not_missed(honest: Records) -> None:
    """A robot that confirmed a link, and was killed 0.1 s later with that still in hand."""
    at_s, _, _ = second_tree(honest)
    lost = [one for one in never_confirmed(honest) if not (one[1] == "robot1" and one[0] > at_s - 0.3)]
    assert broken(lost) == ()
    back = [(time_s, peer, what) for time_s, peer, what in honest if peer == "robot1" and time_s > at_s + 2.0]
    assert broken([*lost, *back]) == ()


def test_how_old_orders_were_is_not_judged_where_nobody_knows_when_the_mission_began(honest: Records) -> None:
    assert find_reigns(took_late(honest)).broken == ()
    assert broken([(1.0, "base", LogLine(level="info", text="alone"))]) == ()


@pytest.mark.parametrize(
    ("leader", "incarnation", "fault"), [("base", 0, False), ("base", 1, True), ("robot3", 0, True)]
)
def test_a_leader_may_move_to_a_higher_epoch_while_some_obey_it_in_the_one_before(
    leader: str, incarnation: int, fault: bool
) -> None:
    before = Spell(peer="robot1", leader="base", incarnation=0, epoch=1, from_s=0.0, until_s=2.0)
    after = Spell(peer="robot2", leader=leader, incarnation=incarnation, epoch=2, from_s=1.5, until_s=3.0)
    assert bool(list(RecordedRules([], [before, after], []).broken(None))) is fault
