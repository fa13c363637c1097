"""A peer says where it is at one rate, and that it lives at another one, if nothing else shows it."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from agents.role import Publish
from agents.self_report import SelfReport
from protocol.messages import AnyBody, Heartbeat, State
from tests.agents.synthetic_mission import mission

STATE = State(position=(1.0, 1.0), velocity=(0.0, 0.0), mode="waiting")
RATES = st.sampled_from([0.5, 1.0, 2.0, 3.0, 4.0, 10.0])


def said(
    control_hz: float, heartbeat_hz: float, *, silent: bool, urgent_s: float = -1.0
) -> list[tuple[float, AnyBody]]:
    """What is said in ten seconds, and when; ``urgent_s``: when there is more to say than the rhythm asks for."""
    report = SelfReport(structs.replace(mission(), control_hz=control_hz, heartbeat_hz=heartbeat_hz), "robot", 0.2, 0.0)
    words: list[tuple[float, AnyBody]] = []
    now_s = 0.0
    while now_s <= 10.0:
        effects = report.due(now_s, STATE, silent=silent, urgent=now_s == urgent_s)
        words += [(now_s, effect.body) for effect in effects if isinstance(effect, Publish)]
        now_s = urgent_s if now_s < urgent_s < report.next_s else report.next_s
    return words


@given(RATES, RATES, st.booleans(), st.floats(-1.0, 10.0))
def test_something_is_said_in_time_and_nothing_twice(
    control_hz: float, heartbeat_hz: float, silent: bool, urgent_s: float
) -> None:
    words = said(control_hz, heartbeat_hz, silent=silent, urgent_s=urgent_s)
    period_s = 1.0 / heartbeat_hz
    assert words[0][0] == 0.0
    for (before_s, _), (after_s, word) in pairwise([*words, (10.0, STATE)]):
        assert after_s - before_s < 2.0 * period_s, "late by less than a period, as it may come just before a beat"
        assert after_s - before_s >= period_s - 1e-5 or not isinstance(word, Heartbeat)
    assert silent is not any(isinstance(word, State) for _, word in words)


@pytest.mark.parametrize(("control_hz", "silent", "beats"), [(10.0, False, 0), (2.0, False, 0), (10.0, True, 21)])
def test_who_says_where_it_is_often_enough_says_no_heartbeat(control_hz: float, silent: bool, beats: int) -> None:
    words = said(control_hz, 2.0, silent=silent)
    assert sum(isinstance(word, Heartbeat) for _, word in words) == beats
