"""Shortened schedules: the same ways at the same times, and still what the certificate by progress says of them."""

from __future__ import annotations

import numpy as np
import pytest

from planning.certificate import certify
from planning.continuation import assemble
from planning.environment import Environment
from planning.motion_plan import InvalidSchedule, Schedule, TimedPath
from planning.short_stages import shorten

HALL = Environment([(0, 0), (20, 0), (20, 20), (0, 20)])


def random_schedule(seed: int) -> Schedule:
    rng = np.random.default_rng(seed)
    members, stages = int(rng.integers(2, 5)), int(rng.integers(1, 6))
    pieces = []
    for _ in range(members):
        place, own = rng.uniform(1.0, 19.0, 2), []
        for _ in range(stages):
            own.append(np.concatenate([place[None], rng.uniform(1.0, 19.0, (rng.integers(0, 3), 2))]))
            place = own[-1][-1]
        pieces.append(own)
    return assemble([f"robot{i}" for i in range(members)], pieces, 0.2, rng.uniform(0.5, 2.0, members))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("growth", [0.0, 0.2])
def test_everybody_is_where_it_was_at_every_time(seed: int, growth: float) -> None:
    given = random_schedule(seed)
    short = shorten(given, 0.5, growth)
    times = np.linspace(given.start_s, given.end_s, 200)
    assert short.positions(times) == pytest.approx(given.positions(times), abs=1e-7)
    assert short.end_s == pytest.approx(given.end_s)
    assert short.stages is not None
    for member, path in enumerate(short.paths):
        for stage, end in enumerate(path.times_s[short.stages[member, 1:]]):
            piece = short.piece(member, stage, stage)
            takes = np.hypot(*np.diff(piece, axis=0).T).sum() / short.speeds_m_s[member]
            assert takes <= max(0.5, growth * end) + 1e-6


@pytest.mark.parametrize("seed", range(16))
def test_what_was_certified_by_progress_still_is(seed: int) -> None:
    """Schedules in which robots may collide are as safe as before, or safer: never the other way round."""
    given = random_schedule(seed)
    if certify(given, HALL).valid:
        assert certify(shorten(given, 0.7), HALL).valid


def test_stages_that_take_no_time_are_left_out_and_waits_are_kept() -> None:
    places = [[[(1, 1)], [(1, 1), (4, 1)], [(4, 1)]], [[(1, 5), (2, 5)], [(2, 5)], [(2, 5), (9, 5)]]]
    given = assemble(["a", "b"], places, 0.2, 1.0, unscheduled={"c": TimedPath([(9, 9), (9, 8)], [0.0, 1.0])})
    short = shorten(given, 1.0)
    assert short.unscheduled == {"c"}
    assert certify(short, HALL).valid
    assert short.end_s == pytest.approx(given.end_s)


def test_nobody_that_moves_has_nothing_to_shorten() -> None:
    still = assemble(["a", "b"], [[[(1, 1)]], [[(3, 3)]]], 0.2, 1.0)
    assert shorten(still, 0.1) is still


def test_a_schedule_on_the_clock_is_refused() -> None:
    with pytest.raises(InvalidSchedule, match="bound to the clock"):
        shorten(Schedule(["a"], [TimedPath([(0, 0), (1, 0)], [0, 1])], 0.1), 0.2)
    with pytest.raises(ValueError, match="positive"):
        shorten(random_schedule(0), 0.0)
