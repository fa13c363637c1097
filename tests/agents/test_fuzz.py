"""Whatever is said to a peer with a real mind: it fails on nothing and lives. The campaign says the same at length."""

from __future__ import annotations

from collections import Counter
from functools import cache

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agents.casting import Casting
from protocol.bus import Received
from protocol.keys import ADDRESSED_KINDS, Address
from protocol.messages import BODIES
from protocol.schemas import example_payloads
from tests.campaigns.arbitrary_messages import BAD_KEYS
from tests.campaigns.fuzz import NAMES, Life, fuzz, make_castings


@cache
def castings() -> tuple[Casting, ...]:
    return make_castings()


@st.composite
def keys(draw: st.DrawFn) -> str:
    if draw(st.booleans()):
        return draw(st.sampled_from(BAD_KEYS) | st.text(max_size=40))
    kind = draw(st.sampled_from([*BODIES, "alive"]))
    to = draw(st.sampled_from(["", *NAMES])) if kind in ADDRESSED_KINDS else ""
    return Address("team", draw(st.sampled_from(NAMES)), kind, to=to).key


@st.composite
def payloads(draw: st.DrawFn) -> bytes:
    """Noise, or an example with a part of it replaced by anything."""
    example = draw(st.sampled_from(sorted(example_payloads().values())))
    begin = draw(st.integers(0, len(example)))
    end = draw(st.integers(begin, len(example)))
    noise = draw(st.binary(max_size=20) | st.sampled_from([b"null", b"1e9", b"-1", b"[]", b"{}", b'""', b"true"]))
    return draw(st.binary(max_size=200) | st.just(example[:begin] + noise + example[end:]))


@pytest.mark.parametrize("team", range(2))
@pytest.mark.parametrize("name", NAMES[:3])
@given(st.lists(st.tuples(keys(), payloads()), max_size=20))
@settings(max_examples=15, deadline=None)
def test_noise_is_counted_and_survived(name: str, team: int, said: list[tuple[str, bytes]]) -> None:
    life = Life(castings()[team], name)
    for key, payload in said:
        life.give(Received(key, payload))
    assert life.shell.traceback == ""
    assert life.complaint() == ""


def test_messages_that_make_no_sense_are_survived() -> None:
    """A short piece of the campaign: a life of each kind of peer in each kind of team, and no kind is left out."""
    heard: Counter[str] = Counter()
    assert fuzz(3000, 12, castings(), life=500, heard=heard) == []
    assert BODIES.keys() - heard.keys() == {"goal_reply"}, "which is for operators"
    assert frozenset().union(*(one.cast(name)[0].hears for one in castings() for name in NAMES)) == heard.keys()


def test_the_campaign_finds_a_peer_that_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    from agents.allegiance import Allegiance

    handle = Allegiance.handle

    def fail_at_times(self: Allegiance, event: object, now_s: float) -> object:
        if "VoteRequest" in repr(event) and "withdrawn=True" in repr(event):
            raise ZeroDivisionError("planted")
        return handle(self, event, now_s)  # type: ignore[arg-type]

    monkeypatch.setattr(Allegiance, "handle", fail_at_times)
    complaints = fuzz(2000, 0, castings(), names=("robot1",), life=500)
    assert complaints
    assert "planted" in complaints[0]
