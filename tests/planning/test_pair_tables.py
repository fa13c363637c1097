"""Tables of elements against shapely's distances, the closed form of sight for segments, and sampling."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from planning import line_of_sight
from planning.environment import Environment
from planning.pair_tables import APART, SEES, make_tables
from planning.path_elements import PathElements, cut_path
from planning.visible_interval import sees_throughout
from tests.planning.polygons import environment_of, free_points, rectilinear_environment

Floats = NDArray[np.float64]


def segments(path: PathElements) -> Floats:
    """(2 n + 1, 2, 2): the ends of each element."""
    nodes = path.nodes
    found = np.empty((2 * path.pieces + 1, 2, 2))
    found[::2] = nodes[:, None]
    found[1::2] = np.stack([nodes[:-1], nodes[1:]], axis=1)
    return found


def free_path(environment: Environment, points: int, rng: np.random.Generator) -> Floats:
    """Through points that each see the next."""
    path = [free_points(environment, 1, rng)[0]]
    while len(path) < points:
        near = free_points(environment, 20, rng)
        seen = near[environment.line_of_sight(near, path[-1])]
        if len(seen) > 0:
            path.append(seen[0])
    return np.array(path)


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), min_size=1, max_size=5), st.floats(0.3, 3.0))
def test_paths_are_cut_at_their_corners_into_pieces_that_are_short_enough(
    points: list[tuple[int, int]], longest: float
) -> None:
    path = np.array(points, dtype=np.float64)
    cut = cut_path(path, longest)
    kept = path[np.append(True, np.any(np.diff(path, axis=0) != 0.0, axis=1))]
    assert np.array_equal(cut.nodes[cut.corners], kept)
    lengths = np.hypot(*np.diff(cut.nodes, axis=0).T)
    assert np.all(lengths <= longest * (1 + 1e-12))
    assert lengths.sum() == pytest.approx(np.hypot(*np.diff(path, axis=0).T).sum())
    halved = cut_path(path, longest, 1)
    assert halved.pieces == 2 * cut.pieces
    assert halved.nodes[::2] == pytest.approx(cut.nodes)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=20)
def test_elements_are_apart_as_their_distance_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    # On whole coordinates paths overlap, touch, and are exactly S apart.
    paths = [cut_path(rng.integers(0, 6, (rng.integers(1, 4), 2)).astype(np.float64), 0.7) for _ in range(3)]
    separations = np.full((3, 3), 1.0)
    separations[0, 2] = separations[2, 0] = 0.0
    tables = make_tables(paths, separations, [], None, 1e-9)
    lines = [shapely.linestrings(segments(path)) for path in paths]
    for i, j in ((0, 1), (1, 0), (1, 2)):
        distances = shapely.distance(lines[i][:, None], lines[j])
        assert np.array_equal(tables.table(i, j) & APART != 0, distances >= 1.0 - 1e-9)
    assert np.all(tables.table(0, 2) == APART)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=20)
def test_elements_see_each_other_as_their_hulls_say(seed: int) -> None:
    environment = environment_of(seed)
    rng = np.random.default_rng(seed)
    paths = [cut_path(free_path(environment, points, rng), 0.6) for points in (3, 2, 1)]
    tables = make_tables(paths, np.zeros((3, 3)), [], environment.walls, environment.tolerance_m)
    ends = [segments(path) for path in paths]
    for i in range(3):
        for j in range(i):
            expected = [[sees_throughout(environment, p, q) for q in ends[j]] for p in ends[i]]
            assert np.array_equal(tables.table(i, j) & SEES != 0, expected)
            assert np.array_equal(tables.table(j, i), tables.table(i, j).T)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=20)
def test_no_sight_line_between_elements_that_see_each_other_is_blocked(seed: int) -> None:
    """On the grid of the walls, where sight lines run along walls and through corners."""
    environment = rectilinear_environment(2 * seed)
    rng = np.random.default_rng(seed)
    x_min, y_min, x_max, y_max = environment.bounds
    grid = np.stack(np.meshgrid(np.arange(x_min, x_max + 1), np.arange(y_min, y_max + 1)), axis=-1).reshape(-1, 2)
    grid = grid[environment.contains(grid)]
    drawn = [grid[rng.integers(0, len(grid), 2)] for _ in range(8)]
    paths = [cut_path(points, 1.0) for points in drawn if environment.line_of_sight(*points)][:3]
    if len(paths) < 2:
        return
    tables = make_tables(paths, np.zeros((len(paths),) * 2), [], environment.walls, environment.tolerance_m)
    p, q = segments(paths[0]), segments(paths[1])
    for e, f in np.argwhere(tables.table(0, 1) & SEES):
        shares = rng.uniform(size=(2, 30, 1))
        places = [ends[0] + share * (ends[1] - ends[0]) for ends, share in ((p[e], shares[0]), (q[f], shares[1]))]
        assert line_of_sight.segments_are_visible(*places, environment.walls, 2.0 * environment.tolerance_m).all()


def test_who_may_be_anywhere_is_one_element_for_which_all_of_its_path_counts() -> None:
    environment = environment_of(3)
    rng = np.random.default_rng(0)
    paths = [cut_path(free_path(environment, 3, rng), 0.5) for _ in range(3)]
    args = (paths, np.full((3, 3), 0.4))
    walls = (environment.walls, environment.tolerance_m)
    one, all_nodes = make_tables(*args, [1], *walls), make_tables(*args, [], *walls)
    assert one.sizes.tolist() == [2 * paths[0].pieces + 1, 1, 2 * paths[2].pieces + 1]
    for i in (0, 2):
        assert np.array_equal(one.table(i, 1)[:, 0], np.bitwise_and.reduce(all_nodes.table(i, 1), axis=1))
    assert np.array_equal(one.table(0, 2), all_nodes.table(0, 2))
