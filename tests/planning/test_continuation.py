"""One schedule after another: the rule of progress played out event by event, and what the certificate says of both."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from planning.certificate import certify
from planning.continuation import assemble, follow
from planning.environment import Environment
from planning.motion_plan import InvalidSchedule, Schedule, TimedPath

Floats = NDArray[np.float64]
HALL = Environment([(0, 0), (20, 0), (20, 4), (0, 4)])


def random_pieces(rng: np.random.Generator, members: int, stages: int) -> list[list[Floats]]:
    pieces = []
    for _ in range(members):
        place, own = rng.uniform(0.0, 4.0, 2), []
        for _ in range(stages):
            piece = np.concatenate([place[None], rng.uniform(0.0, 4.0, (rng.integers(0, 4), 2))])
            own.append(piece)
            place = piece[-1]
        pieces.append(own)
    return pieces


def play(pieces: list[list[Floats]], speeds: Floats) -> Floats:
    """When everybody finishes every stage (k, n): all do what they may as soon as they may, until nothing changes."""
    members, stages = len(pieces), len(pieces[0])
    ended = np.full((members, stages), np.nan)
    while np.isnan(ended).any():
        for i in range(members):
            for n in range(stages):
                needed = [0.0]
                if n > 0:
                    needed.append(ended[i, n - 1])
                if n > 1:
                    needed += list(ended[:, n - 2])
                if np.isnan(ended[i, n]) and not np.isnan(needed).any():
                    steps = np.diff(pieces[i][n], axis=0)
                    ended[i, n] = max(needed) + np.sqrt((steps**2).sum(axis=1)).sum() / speeds[i]
    return ended


@pytest.mark.parametrize("seed", range(8))
def test_times_are_those_of_the_rule_at_full_speed(seed: int) -> None:
    rng = np.random.default_rng(seed)
    members, stages = int(rng.integers(1, 5)), int(rng.integers(1, 7))
    pieces = random_pieces(rng, members, stages)
    speeds = rng.uniform(0.5, 2.0, members)
    names = [f"robot_{i}" for i in range(members)]
    made = assemble(names, pieces, 0.1, speeds)
    assert made.stages is not None and made.stage_count == stages
    ended = play(pieces, speeds)
    for i, path in enumerate(made.paths):
        for n in range(stages):
            went = made.piece(i, n, n)
            moved = went[np.append(True, np.any(np.diff(went, axis=0) != 0.0, axis=1))]
            assert np.array_equal(moved, pieces[i][n])
            if len(moved) > 1:
                assert path.times_s[made.stages[i, n + 1]] == pytest.approx(ended[i, n])
    # Nobody is ever faster than it can be.
    assert not [v for v in certify(made, HALL, 0.0, links=[]).violations if v.kind == "speed"]


def one_by_one(names: str, *moves: tuple[str, float], start: tuple[float, ...]) -> Schedule:
    """Members on a line, y = 2, one moving in each stage."""
    places = dict(zip(names, start, strict=True))
    pieces: dict[str, list[list[tuple[float, float]]]] = {name: [] for name in names}
    for mover, x in moves:
        for name in names:
            here = (places[name], 2.0)
            pieces[name].append([here, (x, 2.0)] if name == mover else [here])
        places[mover] = x
    return assemble(list(names), list(pieces.values()), 0.3, 1.0)


def test_one_after_another_keeps_its_stages_apart() -> None:
    # a goes where b was, and b has left in the last stage before: side by side they would meet.
    first = one_by_one("ab", ("b", 9.0), start=(2.0, 5.0))
    second = one_by_one("ba", ("a", 5.0), start=(9.0, 2.0))
    joined = follow(first, second)
    assert joined.members == ("a", "b")
    assert joined.stage_count == 3
    assert joined.stages is not None
    assert np.array_equal(joined.stages[:, 1], joined.stages[:, 2])
    assert certify(joined, HALL).valid
    assert joined.end_s == pytest.approx(4.0 + 3.0)
    assert [p.waypoints[-1].tolist() for p in joined.paths] == [[5.0, 2.0], [9.0, 2.0]]


def test_no_barrier_where_nobody_moves_anyway() -> None:
    move = one_by_one("ab", ("b", 9.0), start=(2.0, 5.0))
    rest = one_by_one("ab", ("b", 9.0), start=(2.0, 9.0))
    assert rest.stage_count == 1 and len(rest.paths[1].waypoints) == 1
    assert follow(move, rest).stage_count == 2
    assert follow(follow(move, rest), one_by_one("ab", ("a", 3.0), start=(2.0, 9.0))).stage_count == 3


def test_an_unscheduled_member_has_the_newer_path() -> None:
    def leg(x: float, to: float, agent: TimedPath) -> Schedule:
        return assemble(["a"], [[[(x, 1.0), (to, 1.0)]]], [0.2, 0.0], 1.0, unscheduled={"agent": agent})

    first = leg(1.0, 2.0, TimedPath([(5, 2), (9, 2)], [0.0, 8.0]))
    second = leg(2.0, 3.0, TimedPath([(6, 2), (6, 3)], [0.5, 1.5]))
    joined = follow(first, second)
    assert joined.unscheduled == {"agent"}
    assert joined.piece(1, 0, 0).tolist() == [[6.0, 2.0], [6.0, 3.0]]
    assert joined.paths[1].times_s.tolist() == [0.0, 1.0]
    assert joined.end_s == pytest.approx(2.0)


def test_what_does_not_fit_is_refused() -> None:
    first = one_by_one("ab", ("b", 9.0), start=(2.0, 5.0))
    with pytest.raises(InvalidSchedule, match="b ends at \\(9, 2\\) and is to go on from \\(8, 2\\)"):
        follow(first, one_by_one("ab", ("a", 3.0), start=(2.0, 8.0)))
    with pytest.raises(InvalidSchedule, match="same members"):
        follow(first, one_by_one("ac", ("a", 3.0), start=(2.0, 9.0)))
    with pytest.raises(InvalidSchedule, match="bound to the clock"):
        follow(first, Schedule(["a", "b"], [TimedPath.standing((2, 2)), TimedPath.standing((9, 2))], 0.3, 1.0))
    other = assemble(["a", "b"], [[[(2.0, 2.0)]], [[(9.0, 2.0)]]], 0.2, 1.0)
    with pytest.raises(InvalidSchedule, match="radii"):
        follow(first, other)
    with pytest.raises(InvalidSchedule, match="a ends stage 0"):
        assemble(["a"], [[[(1.0, 1.0)], [(2.0, 1.0), (3.0, 1.0)]]], 0.2, 1.0)
    with pytest.raises(InvalidSchedule, match="2 members in \\[1, 2\\] stages"):
        assemble(["a", "b"], [[[(1.0, 1.0)]], [[(2.0, 1.0)], [(2.0, 1.0)]]], 0.2, 1.0)
    with pytest.raises(InvalidSchedule, match="a is to move at inf m/s"):
        assemble(["a"], [[[(1.0, 1.0), (2.0, 1.0)]]], 0.2, np.inf)
    with pytest.raises(InvalidSchedule, match="has no points"):
        assemble(["a"], [[[]]], 0.2, 1.0)
