"""Time in sight against closed forms, against ways on a dense grid, and against itself at many places."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from planning.environment import Environment
from planning.reach_in_sight import time_in_sight
from tests.planning.polygons import environment_of, free_points

Floats = NDArray[np.float64]

PILLAR = Environment([(0, 0), (8, 0), (8, 8), (0, 8)], [[(3, 3), (5, 3), (5, 5), (3, 5)]])
SPACING = 0.1


def test_behind_a_pillar_it_is_the_distance_to_the_nearest_ray_past_a_corner() -> None:
    aside = 6.0 / np.sqrt(5.0)  # of (7, 1) from the line through (1, 1) and (5, 3)
    assert time_in_sight(PILLAR, (1, 1), (7, 1), 1.0) == pytest.approx(aside)
    assert time_in_sight(PILLAR, (1, 1), (1, 7), 2.0) == pytest.approx(0.5 * aside)
    assert time_in_sight(PILLAR, (1, 1), (4, 1), 1.0) == pytest.approx(np.sqrt(5.0))  # the ray begins at the corner
    assert time_in_sight(PILLAR, (1, 1), (7, 7), 1.0) == 0.0  # hidden
    assert time_in_sight(PILLAR, (1, 1), (4, 4), 1.0) == 0.0  # in the wall
    assert time_in_sight(PILLAR, (1, 1), (7, 4), 1.0) == 0.0  # on the ray


def test_where_nothing_is_hidden_it_lasts() -> None:
    square = Environment(PILLAR.outer)
    assert time_in_sight(square, (1, 1), (7, 7), 1.0) == np.inf
    assert time_in_sight(square, [(1, 1), (7, 1), (7, 7)], [(2, 2), (6, 2), (6, 6)], 1.0, 5.0) == np.inf


def test_the_way_out_of_sight_bends_at_corners_that_hide_nothing() -> None:
    """A wedge points at the watcher: above it nothing is hidden, below it a part of an alcove is."""
    wedge = [(20, 0), (20, 10), (0, 10), (0, 6), (10, 5), (0, 4), (0, 0)]
    alcove = [(2, 0), (2, -3), (4, -3), (4, 0)]
    watcher, target, corner, lip = (19.5, 5.0), (2.0, 9.0), (10.0, 5.0), (4.0, 0.0)
    assert time_in_sight(Environment(wedge), watcher, target, 1.0) == np.inf
    assert time_in_sight(Environment([*wedge, *alcove]), watcher, target, 2.0) == pytest.approx(
        0.5 * (np.hypot(*np.subtract(corner, target)) + np.hypot(*np.subtract(lip, corner)))
    )


def test_watchers_that_move_are_as_good_as_the_worst_of_their_places() -> None:
    rng = np.random.default_rng(1)
    near = judged = 0
    for seed in range(5):
        environment = environment_of(seed)
        for start, end, target in free_points(environment, 60, rng).reshape(-1, 3, 2):
            way = np.array([start, start + min(1.0, 1.5 / np.hypot(*(end - start))) * (end - start)])
            if not environment.line_of_sight(*way):
                continue
            certain = time_in_sight(environment, way, target, 1.0)
            places = way[0] + np.linspace(0.0, 1.0, 25)[:, None] * (way[1] - way[0])
            worst = min(time_in_sight(environment, place, target, 1.0) for place in places)
            assert certain <= worst + 1e-9
            if worst > 0.0:
                judged += 1
                near += worst - certain < 0.1 or worst == certain
    assert judged > 20
    assert near >= 0.95 * judged


def test_sets_are_as_good_as_the_worst_of_their_places() -> None:
    rng = np.random.default_rng(2)
    judged = 0
    for seed in range(5):
        environment = environment_of(seed)
        for watcher, centre in free_points(environment, 24, rng).reshape(-1, 2, 2):
            radius = rng.uniform(0.05, 0.5)
            certain = time_in_sight(environment, watcher, centre, 1.0, radius)
            turns = rng.uniform(0.0, 2.0 * np.pi, (25, 1))
            places = centre + radius * np.hstack([np.cos(turns), np.sin(turns)])
            places = places[environment.contains(places)]
            worst = min((time_in_sight(environment, watcher, place, 1.0) for place in places), default=np.inf)
            assert certain <= worst + 1e-9
            if len(places) == 25 and worst > 0.0:
                judged += 1
                assert certain > worst - 0.2 * radius - 1e-9
            corners = centre + rng.normal(0.0, 0.3, (3, 2))
            inside = rng.dirichlet(np.ones(3), 10) @ corners
            inside = inside[environment.contains(inside)]
            certain = time_in_sight(environment, watcher, corners, 1.0)
            assert all(certain <= time_in_sight(environment, watcher, place, 1.0) + 1e-9 for place in inside)
    assert judged > 20


def walks(environment: Environment, target: Floats) -> tuple[Floats, Floats]:
    """Points of a grid in free space, and how far it is to them along the grid: never less than the truth."""
    x_min, y_min, x_max, y_max = environment.bounds
    grid = np.stack(np.meshgrid(np.arange(x_min, x_max, SPACING), np.arange(y_min, y_max, SPACING)), axis=-1)
    points = np.concatenate([[target], grid.reshape(-1, 2)[environment.contains(grid.reshape(-1, 2))]])
    pairs = cKDTree(points).query_pairs(2.3 * SPACING, output_type="ndarray")
    pairs = pairs[environment.line_of_sight(points[pairs[:, 0]], points[pairs[:, 1]])]
    lengths = np.hypot(*(points[pairs[:, 0]] - points[pairs[:, 1]]).T)
    graph = csr_array((lengths, pairs.T), shape=(len(points), len(points)))
    return points, dijkstra(graph, directed=False, indices=[0])[0]


@pytest.mark.parametrize("seed", range(3))
def test_nobody_walks_out_of_sight_sooner_and_somebody_does_hardly_later(seed: int) -> None:
    environment = environment_of(seed)
    rng = np.random.default_rng(seed)
    tight = judged = 0
    for target in free_points(environment, 4, rng):
        points, lengths = walks(environment, target)
        for watcher in free_points(environment, 12, rng):
            if not environment.line_of_sight(watcher, target):
                continue
            certain = time_in_sight(environment, watcher, target, 1.0)
            hidden = ~np.asarray(environment.line_of_sight(watcher, points))
            soonest = float(lengths[hidden].min(initial=np.inf))
            assert certain <= soonest + 1e-6
            judged += 1
            tight += soonest == certain or soonest < 1.05 * certain + 3.0 * SPACING
    assert judged > 2
    assert tight >= 0.9 * judged


def test_what_is_no_speed_or_radius_is_refused() -> None:
    with pytest.raises(ValueError, match="greatest speed is 0"):
        time_in_sight(PILLAR, (1, 1), (7, 1), 0.0)
    with pytest.raises(ValueError, match="within nan m"):
        time_in_sight(PILLAR, (1, 1), (7, 1), 1.0, np.nan)
    for nowhere in (np.empty((0, 2)), (1, np.nan)):
        with pytest.raises(ValueError, match="is nowhere"):
            time_in_sight(PILLAR, nowhere, (7, 1), 1.0)
        with pytest.raises(ValueError, match="is nowhere"):
            time_in_sight(PILLAR, (1, 1), nowhere, 1.0)
