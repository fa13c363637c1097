from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from itertools import combinations

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from scipy.sparse import csr_array

import maps
from planning.decomposition import Cells, Kind, decompose
from planning.environment import Environment
from planning.hull_obstacles import find_bridges, find_tangents, is_inside_hull
from planning.mutual_visibility import TooManyCells, mutual_visibility
from tests.planning.polygons import environment_of, shared_maps

module = import_module("planning.mutual_visibility")  # the package's attribute of that name is the function
KINDS: tuple[Kind, ...] = ("inflection", "aspect")
LARGE = ("cityblocks", "l457")
MAPS = [(name, kind) for name in maps.names() for kind in KINDS if kind == "inflection" or name not in LARGE]
Ints = NDArray[np.int64]


def hulls_are_free(cells: Cells, i: Ints, j: Ints, shrinkage: float) -> NDArray[np.bool_]:
    """Whether the hull of each pair of shrunk cells lies in free space, by shapely."""
    shrunk = [
        shapely.Polygon(c + (1.0 - shrinkage) * (p - c)) for p, c in ((p, p.mean(axis=0)) for p in cells.polygons)
    ]
    polygons = np.array(shrunk)
    hulls = shapely.convex_hull(shapely.geometrycollections(np.stack([polygons[i], polygons[j]], axis=1)))
    shapely.prepare(cells.environment.polygon)
    free: NDArray[np.bool_] = shapely.covers(cells.environment.polygon, hulls)
    return free


def check_pairs(cells: Cells, seen: csr_array, i: Ints, j: Ints) -> None:
    """Equal to shapely's answer where that is the same for a little more and a little less shrinkage."""
    more, less = hulls_are_free(cells, i, j, 1e-5), hulls_are_free(cells, i, j, 1e-7)
    sure = more == less
    assert sure.mean() > 0.99
    np.testing.assert_array_equal(seen.toarray()[i, j][sure], more[sure])


def check_graph(cells: Cells, seen: csr_array) -> None:
    n = len(cells)
    assert seen.shape == (n, n)
    assert seen.dtype == np.bool_
    assert seen.has_canonical_format
    assert (seen != seen.T).nnz == 0
    assert seen.diagonal().all()
    # Theorem 3.2.1: adjacent cells are mutually visible.
    assert cells.adjacency.multiply(seen).nnz == cells.adjacency.nnz


@pytest.mark.parametrize(("name", "kind"), MAPS)
def test_equals_hulls_on_the_maps(name: str, kind: Kind) -> None:
    cells = decompose(Environment.load(maps.path(name)), kind)
    seen = mutual_visibility(cells)
    check_graph(cells, seen)
    n = len(cells)
    rng = np.random.default_rng(11)
    if n < 100:
        i, j = np.triu_indices(n, 1)
    else:
        some, visible = rng.integers(0, n, (2, 800)), np.stack(seen.nonzero())
        i, j = np.concatenate([some, visible[:, rng.integers(0, visible.shape[1], 400)]], axis=1)
    check_pairs(cells, seen, i, j)


@pytest.mark.parametrize("seed", range(5))
def test_equals_hulls_on_random_maps(seed: int) -> None:
    for kind in KINDS:
        cells = decompose(environment_of(seed), kind)
        seen = mutual_visibility(cells)
        check_graph(cells, seen)
        i, j = np.triu_indices(len(cells), 1)
        chosen = np.random.default_rng(seed).permutation(len(i))[:3000]
        check_pairs(cells, seen, i[chosen], j[chosen])


def test_equals_hulls_on_hard_polygons() -> None:
    for file in shared_maps("polygons"):
        if file.stem in ("earcut_dude", "earcut_water3", "earcut_hilbert"):
            cells = decompose(Environment.load(file))
            seen = mutual_visibility(cells)
            check_graph(cells, seen)
            i, j = np.random.default_rng(5).integers(0, len(cells), (2, 3000))
            check_pairs(cells, seen, i, j)


@pytest.mark.parametrize("seed", range(6))
def test_points_of_cells_that_see_each_other_see_each_other(seed: int) -> None:
    environment = environment_of(seed)
    cells = decompose(environment, "aspect")
    i, j = np.stack(mutual_visibility(cells).nonzero())
    rng = np.random.default_rng(seed)
    chosen = rng.integers(0, len(i), 3000)

    def draw(k: int) -> NDArray[np.float64]:
        polygon = cells.polygons[k]
        return rng.dirichlet(np.full(len(polygon), 0.3)) @ polygon

    p, q = (np.array([draw(k) for k in side[chosen]]) for side in (i, j))
    blocked = ~environment.line_of_sight(p, q)
    assert not blocked.any(), f"seed {seed}: {p[blocked][:1]} and {q[blocked][:1]}"


@pytest.mark.parametrize("environment", [Environment.load(maps.path("room3")), *map(environment_of, range(8))])
def test_inherited_edges_are_those_found_without_parents(environment: Environment) -> None:
    cells = decompose(environment, "aspect")
    # The same cells as their own parents: every pair is then decided by its own bridges.
    assert (mutual_visibility(cells) != mutual_visibility(replace(cells, kind="inflection"))).nnz == 0


@pytest.mark.parametrize("size", [1.0, 1e-2, 1e-4])
def test_a_small_pillar_between_two_cells_hides_them(size: float) -> None:
    """It lies wholly between the bridges, which no wall crosses."""
    half = 0.5 * size
    pillar = [(5 - half, 5 - half), (5 + half, 5 - half), (5 + half, 5 + half), (5 - half, 5 + half)]
    cells = decompose(Environment([(0, 0), (10, 0), (10, 10), (0, 10)], [pillar]))
    seen = mutual_visibility(cells).toarray()
    corner = cells.locate([(1, 1), (9, 1), (9, 9), (1, 9)])
    side = cells.locate([(5, 1), (9, 5), (5, 9), (1, 5)])
    assert not seen[corner[0], corner[2]]
    assert not seen[corner[1], corner[3]]
    assert not seen[side[0], side[2]]
    assert not seen[side[1], side[3]]
    assert seen[corner, np.roll(corner, 1)].all()  # along the pillar's side: grazing is seeing


def test_cells_along_one_wall_see_each_other() -> None:
    """Bridges that run along walls and through vertices."""
    bays = Environment([(0, 0), (9, 0), (9, 3), (7, 3), (7, 5), (5, 5), (5, 3), (4, 3), (4, 5), (2, 5), (2, 3), (0, 3)])
    cells = decompose(bays)
    seen = mutual_visibility(cells).toarray()
    row = np.unique(cells.locate([(x, y) for x in np.linspace(0.1, 8.9, 30) for y in (0.5, 1.5, 2.5)]))
    assert seen[np.ix_(row, row)].all()
    assert not seen[cells.locate((3, 4))[0], cells.locate((6, 4))[0]]


def test_a_moved_map_has_the_same_graph() -> None:
    drawn = environment_of(3)
    outer, *holes = (ring * 3.0 + (1e5, -2e5) for ring in drawn.rings)
    cells, moved = decompose(drawn, "aspect"), decompose(Environment(outer, holes, drawn.name), "aspect")
    assert (mutual_visibility(cells) != mutual_visibility(moved)).nnz == 0


def test_too_many_cells_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_CELLS", 20)
    cells = decompose(Environment.load(maps.path("room1")))
    with pytest.raises(TooManyCells, match=r"^room1 has 26 inflection cells, more than the 20 .* use inflection cells"):
        mutual_visibility(cells)


def _draw_hulls(rng: np.random.Generator) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
    """Two disjoint convex polygons, and their corners one after the other."""
    drawn = [rng.uniform((x, 0.0), (x + 1.0, 1.0), (6, 2)) for x in (0.0, rng.uniform(1.0, 3.0))]
    hulls = [shapely.convex_hull(shapely.MultiPoint(points)) for points in drawn]
    polygons = [np.array(shapely.orient_polygons(hull).exterior.coords)[:-1] for hull in hulls]
    return polygons, np.ascontiguousarray(np.concatenate(polygons))


def test_bridges_are_the_outer_common_tangents() -> None:
    rng = np.random.default_rng(2)
    for _ in range(500):
        polygons, corners = _draw_hulls(rng)
        n, m = len(polygons[0]), len(corners)
        a, b, c, d = find_bridges(corners, 0, n, n, m)
        for start, end, side in ((a, b, 1.0), (c, d, -1.0)):
            assert start < n <= end < m
            span, offset = corners[end] - corners[start], corners - corners[start]
            assert (side * (span[0] * offset[:, 1] - span[1] * offset[:, 0]) <= 1e-12).all()


def test_points_inside_a_hull_are_told_by_their_tangents() -> None:
    rng = np.random.default_rng(3)
    for _ in range(100):
        polygons, corners = _draw_hulls(rng)
        shapes = [shapely.Polygon(polygon) for polygon in polygons]
        points = rng.uniform(corners.min(axis=0) - 0.2, corners.max(axis=0) + 0.2, (60, 2))
        points = points[~shapely.contains_xy(shapely.union_all(shapes), points)]
        starts = np.array([0, len(polygons[0]), len(corners)])
        right, left = find_tangents(corners, starts, np.concatenate([points, points], axis=1))
        hull = shapely.union_all(shapes).convex_hull
        for v, (x, y) in enumerate(points):
            ends = (right[0, v], left[0, v], right[1, v], left[1, v])
            assert is_inside_hull(corners, x, y, *ends) == shapely.contains_xy(hull, x, y)


def test_all_pairs_of_a_convex_room_see_each_other() -> None:
    cells = decompose(Environment([(0, 0), (4, 0), (4, 3), (0, 3)]), "aspect")
    assert mutual_visibility(cells).toarray().tolist() == [[True]]
    yard = decompose(Environment([(0, 0), (9, 0), (9, 9), (6, 9), (6, 8), (0, 8)]))
    seen = mutual_visibility(yard).toarray()
    for i, j in combinations(range(len(yard)), 2):
        corners = np.concatenate([yard.polygons[i], yard.polygons[j]])
        assert seen[i, j] == yard.environment.visibility_matrix(corners).all()
