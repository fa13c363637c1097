"""The order of moves: against times and stages known by hand, and against the rule of progress."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from launcher.move_order import SHORT_S, order_moves
from planning.motion_plan import Schedule, TimedPath
from planning.schedule import schedule

ONE = TimedPath([(0, 0), (2, 0), (2, 0), (5, 0)], [0, 2, 6, 9])
OTHER = TimedPath([(0, 1), (6, 1), (6, 2)], [0, 6, 7])
STAGES = [[0, 1, 2, 3], [0, 1, 2, 2]]
"""The first one waits for the end of the other's first stage."""


def test_moves_say_who_waits_for_whom() -> None:
    moves = order_moves(
        Schedule(["one", "other", "post"], [ONE, OTHER, TimedPath.standing((9, 9))], 0.1, 1.0, [*STAGES, [0] * 4])
    )
    told = [(move.stages, move.member, move.from_m, move.length_m, move.begin_s, move.end_s) for move in moves]
    assert told == [((1, 1), 0, 0, 2, 0, 2), ((1, 2), 1, 0, 7, 0, 7), ((3, 3), 0, 2, 3, 6, 9)]
    assert [(move.waits_s, move.waits_for) for move in moves] == [(0, ()), (0, ()), (4, (1,))]


def test_a_schedule_on_the_clock_is_one_stage() -> None:
    moves = order_moves(Schedule(["one", "other"], [ONE, OTHER], 0.1))
    assert [(move.stages, move.length_m, move.begin_s, move.end_s) for move in moves] == [
        ((1, 1), 5, 0, 9),
        ((1, 1), 7, 0, 7),
    ]


def test_nobody_moves_in_a_schedule_of_those_who_stand() -> None:
    assert order_moves(Schedule(["one"], [TimedPath.standing((1, 1))], 0.1)) == []


def test_moves_cover_all_paths_and_waits_end_when_those_waited_for_arrive() -> None:
    rng = np.random.default_rng(7)
    paths = [rng.uniform(0, 10, (4, 2)) for _ in range(4)]
    found = schedule(paths, 0.3, links=[])
    moves = order_moves(found)
    for member, path in enumerate(found.paths):
        own = [move for move in moves if move.member == member]
        assert sum(move.length_m for move in own) == pytest.approx(path.length_m)
        assert np.allclose([move.from_m for move in own], np.cumsum([0, *(move.length_m for move in own)])[:-1])
        for before, after in pairwise(own):
            assert after.begin_s - before.end_s == pytest.approx(after.waits_s)
            assert after.waits_s >= SHORT_S
            assert after.stages[0] > before.stages[1]
    waiting = [move for move in moves if move.waits_s >= SHORT_S]
    assert waiting
    assert found.stages is not None
    for move in waiting:
        ended = [path.times_s[found.stages[row, move.stages[0] - 2]] for row, path in enumerate(found.paths)]
        assert move.begin_s == pytest.approx(max(ended))
        assert np.allclose([ended[row] for row in move.waits_for], max(ended))
