"""Trees that could not be agreed on rest for longer each time, each by itself."""

from __future__ import annotations

from itertools import pairwise
from math import inf

from agents.setbacks import FORGOTTEN_S, LONGEST_S, REST_S, Setbacks

CHAIN = (("base", "robot1"), ("robot1", "agent"))
SAME = (("agent", "robot1"), ("robot1", "base"))
OTHER = (("base", "robot2"), ("robot2", "agent"))


def test_each_rest_is_twice_as_long_up_to_the_longest() -> None:
    setbacks, now_s = Setbacks(), 0.0
    rests_s = []
    for _ in range(8):
        setbacks.note(CHAIN, now_s)
        assert not setbacks.may_try(SAME, now_s) and setbacks.may_try(OTHER, now_s)
        rests_s.append(setbacks.next_s - now_s)
        now_s = setbacks.next_s
        assert setbacks.may_try(CHAIN, now_s)
        assert setbacks.due(now_s) and not setbacks.due(now_s), "it is told once that a rest is over"
        assert setbacks.next_s == inf
    for before_s, after_s in pairwise(rests_s):
        assert abs(after_s - min(2 * before_s, LONGEST_S)) < 1e-9
    assert abs(rests_s[0] - REST_S) < 1e-9 and abs(rests_s[-1] - LONGEST_S) < 1e-9


def test_rests_of_several_trees_end_one_by_one() -> None:
    setbacks = Setbacks()
    for _ in range(4):
        setbacks.note(CHAIN, 0.0)
    setbacks.note(OTHER, 0.0)
    assert setbacks.due(0.5) and not setbacks.may_try(CHAIN, 0.5) and setbacks.may_try(OTHER, 0.5)
    assert setbacks.due(1.0) and setbacks.may_try(CHAIN, 1.0)


def test_what_is_in_force_or_long_past_begins_anew() -> None:
    setbacks = Setbacks()
    for _ in range(5):
        setbacks.note(CHAIN, 0.0)
        setbacks.note(OTHER, 0.0)
    setbacks.forget(SAME)
    assert setbacks.may_try(CHAIN, 0.0) and not setbacks.may_try(OTHER, 0.0)
    setbacks.note(OTHER, LONGEST_S + FORGOTTEN_S)
    assert setbacks.may_try(OTHER, LONGEST_S + FORGOTTEN_S + REST_S)
    setbacks.forget()
    assert setbacks.may_try(OTHER, LONGEST_S + FORGOTTEN_S)
