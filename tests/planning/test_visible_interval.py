"""Intervals of sight against dense sampling by the environment itself, and against motions known by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from planning import line_of_sight
from planning.environment import Environment
from planning.motion_plan import TimedPath
from planning.visible_interval import sees_throughout, visible_intervals, visible_times
from tests.planning.polygons import environment_of, free_points, rectilinear_environment, wall_points

Floats = NDArray[np.float64]
Points = list[tuple[float, float]]

PILLAR = Environment([(0, 0), (8, 0), (8, 8), (0, 8)], [[(3, 3), (5, 3), (5, 5), (3, 5)]])

# Two rooms and a door between them, its jambs in line.
DOOR = Environment([(0, 0), (4, 0), (4, 3), (5, 3), (5, 0), (9, 0), (9, 8), (5, 8), (5, 5), (4, 5), (4, 8), (0, 8)])


def check_by_sampling(environment: Environment, p: Floats, q: Floats, times: Floats) -> int:
    """Every time is judged as sampling does, but where a thousand tolerances decide; the number that was judged."""
    found = visible_intervals(environment, p, q)
    assert np.all(found[:, 0] <= found[:, 1])
    assert np.all(found[1:, 0] > found[:-1, 1])
    places = [points[0] + times[:, None] * (points[1] - points[0]) for points in (p, q)]
    inside = ((found[:, :1] <= times) & (times <= found[:, 1:])).any(axis=0)
    exact, wide = (
        line_of_sight.segments_are_visible(*places, environment.walls, factor * environment.tolerance_m)
        for factor in (1.0, 1000.0)
    )
    sure = exact == wide
    # Instants of sight are left out; so at a lone sample that sees, its neighbours close by must see too.
    wrong = np.flatnonzero(sure & (inside != exact))
    assert wrong.size == 0, f"{environment.name}: {p.tolist()}, {q.tolist()} at {times[wrong[:5]]}: {found.tolist()}"
    return int(sure.sum())


@given(seed=st.integers(0, 10_000))
@settings(max_examples=60)
def test_intervals_agree_with_dense_sampling_in_general_position(seed: int) -> None:
    environment = environment_of(seed)
    rng = np.random.default_rng(seed)
    ends = free_points(environment, 40, rng).reshape(-1, 2, 2)
    times = np.sort(rng.uniform(0.0, 1.0, 1000))
    for p, q in zip(ends[:10], ends[10:], strict=True):
        assert check_by_sampling(environment, p, q, times) > 950


@given(seed=st.integers(0, 10_000))
@settings(max_examples=40)
def test_intervals_agree_with_dense_sampling_where_most_motions_graze(seed: int) -> None:
    """Ends on the grid of the walls, some on walls: sight lines run along walls and through corners for a while."""
    environment = rectilinear_environment(2 * seed)
    rng = np.random.default_rng(seed)
    x_min, y_min, x_max, y_max = environment.bounds
    grid = np.stack(np.meshgrid(np.arange(x_min, x_max + 1), np.arange(y_min, y_max + 1)), axis=-1).reshape(-1, 2)
    ends = rng.permutation(np.concatenate([grid[environment.contains(grid)], wall_points(environment, 9, rng)]))
    times = np.sort(rng.uniform(0.0, 1.0, 400))
    for _ in range(60):
        p, q = ends[rng.integers(0, len(ends), (2, 2))]
        if rng.uniform() < 0.3:
            q = q[[0, 0]]
        if not environment.line_of_sight(np.stack([p[0], q[0]]), np.stack([p[1], q[1]])).all():
            continue
        found = visible_intervals(environment, p, q)
        inside = ((found[:, :1] <= times) & (times <= found[:, 1:])).any(axis=0)
        places = [points[0] + times[:, None] * (points[1] - points[0]) for points in (p, q)]
        assert np.array_equal(inside, environment.line_of_sight(*places)), (p.tolist(), q.tolist(), found.tolist())


@pytest.mark.parametrize(
    ("environment", "p", "q", "expected", "why"),
    [
        (PILLAR, [(1, 1), (7, 1)], [(1, 2), (7, 2)], [(0, 1)], "nothing between"),
        (PILLAR, [(1, 4), (1, 4)], [(7, 4), (7, 4)], [], "both stand behind the pillar"),
        (PILLAR, [(1, 0), (1, 8)], [(7, 0), (7, 8)], [(0, 0.375), (0.625, 1)], "side by side past the pillar"),
        (PILLAR, [(1, 3), (1, 3)], [(7, 3), (7, 3)], [(0, 1)], "along a wall for good"),
        (PILLAR, [(1, 3), (3, 3)], [(7, 3), (4, 3)], [(0, 1)], "towards each other along a wall"),
        (PILLAR, [(3, 3), (1, 3)], [(3, 3), (3, 1)], [(0, 1)], "parting from a corner"),
        (PILLAR, [(2, 2), (1, 1)], [(6, 6), (7, 7)], [], "through two corners of the pillar for good"),
        (PILLAR, [(3, 2), (1, 2)], [(2, 3), (2, 5)], [(0, 1)], "both leave a diagonal before the corner"),
        (PILLAR, [(2, 4), (4, 2)], [(2, 4), (4, 2)], [(0, 1)], "together, through the corner"),
        (DOOR, [(2, 4), (2, 4)], [(7, 1), (7, 7)], [(2 / 9, 7 / 9)], "from y = 7 / 3 to 17 / 3 past the far jambs"),
        (DOOR, [(4, 0), (4, 8)], [(5, 0), (5, 8)], [(0.375, 0.625)], "along the jambs of the door"),
    ],
)
def test_intervals_known_by_hand(environment: Environment, p: Points, q: Points, expected: Points, why: str) -> None:
    assert visible_intervals(environment, p, q) == pytest.approx(np.array(expected).reshape(-1, 2), abs=1e-9)
    assert visible_intervals(environment, q, p) == pytest.approx(np.array(expected).reshape(-1, 2), abs=1e-9)


def test_ends_of_intervals_are_critical_to_rounding() -> None:
    """Just inside of each end the two see each other, just outside they do not."""
    rng = np.random.default_rng(4)
    judged = 0
    for seed in range(1, 40, 2):
        environment = environment_of(seed)
        for p, q in free_points(environment, 40, rng).reshape(-1, 2, 2, 2):
            for interval in visible_intervals(environment, p, q):
                for end, inward in zip(interval, (1.0, -1.0), strict=True):
                    if 1e-3 < end < 1.0 - 1e-3 and interval[1] - interval[0] > 1e-3:
                        times = end + inward * np.array([[1e-5], [-1e-5]])
                        sees = environment.line_of_sight(*(x[0] + times * (x[1] - x[0]) for x in (p, q)))
                        assert list(sees) == [True, False]
                        judged += 1
    assert judged > 100


def test_times_of_two_paths_join_over_waypoints_and_stops() -> None:
    p = TimedPath([(1, 0), (1, 8), (1, 8), (1, 4)], [0.0, 8.0, 10.0, 14.0])
    q = TimedPath([(7, 0), (7, 4), (7, 8)], [0.0, 4.0, 8.0])
    assert visible_times(PILLAR, p, q) == pytest.approx(np.array([(0.0, 3.0), (5.0, 14.0)]))
    still = TimedPath.standing((1, 1)), TimedPath.standing((7, 7), 3.0), TimedPath.standing((1, 7))
    assert visible_times(PILLAR, still[0], still[1]).shape == (0, 2)
    assert visible_times(PILLAR, still[0], still[2]).tolist() == [[0.0, 0.0]]


@given(seed=st.integers(0, 10_000))
@settings(max_examples=40)
def test_all_of_a_diagram_is_visible_exactly_if_a_dense_grid_of_it_is(seed: int) -> None:
    environment = environment_of(seed)
    rng = np.random.default_rng(seed)
    shares = np.linspace(0.0, 1.0, 25)
    for _ in range(12):
        centre = free_points(environment, 1, rng)[0]
        segments = centre + rng.normal(0.0, rng.choice([0.3, 1.0, 3.0]), (2, 2, 2))
        p, q = (s[0] + shares[:, None] * (s[1] - s[0]) for s in segments)
        pairs = np.repeat(p, len(q), axis=0), np.tile(q, (len(p), 1))
        if sees_throughout(environment, *segments):
            assert environment.line_of_sight(*pairs).all()
        else:
            sampled = line_of_sight.segments_are_visible(*pairs, environment.walls, environment.tolerance_m)
            if sampled.all():  # a blocking corner narrower than the grid: it must be there
                assert _has_corner_between(environment, segments)


def _has_corner_between(environment: Environment, segments: Floats) -> bool:
    import shapely

    hull = shapely.MultiPoint(segments.reshape(-1, 2)).convex_hull
    return bool(hull.difference(environment.polygon).area > 0.0)


def test_a_pillar_between_all_sight_lines_of_the_ends_blocks() -> None:
    assert not sees_throughout(PILLAR, [(1, 0), (1, 8)], [(7, 0), (7, 8)])
    assert sees_throughout(PILLAR, [(1, 0), (1, 3)], [(7, 0), (7, 3)])
    assert sees_throughout(PILLAR, [(1, 3), (2, 3)], [(6, 3), (7, 3)])
    assert not sees_throughout(PILLAR, [(1, 0), (1, 3.01)], [(7, 0), (7, 3.01)])
    small = Environment([(0, 0), (9, 0), (9, 9), (0, 9)], [[(4.4, 3.8), (4.6, 3.8), (4.6, 4.0), (4.4, 4.0)]])
    assert not sees_throughout(small, [(1, 1), (1, 8)], [(8, 1), (8, 8)])
