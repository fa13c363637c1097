"""What has to hold of cells and of the mutual visibility graph on every map, wherever and however large it is."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import maps
from planning.decomposition import Cells, Kind, decompose
from planning.environment import Environment
from planning.mutual_visibility import mutual_visibility
from planning.polygon_validation import InvalidEnvironment
from tests.planning.polygons import covered_segments, environment_of, free_points, rectilinear_environment, shared_maps

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

FAR_M = 1e5
MOVES = {
    "away": (1.0, 0.0, FAR_M),
    "smaller": (1e-3, 0.0, 0.0),
    "larger": (1e3, 0.0, 0.0),
    "turned": (1.0, 0.3, 0.0),
    "a quarter": (1.0, 0.5 * math.pi, 0.0),
    "all": (2.5, 1.234, -0.3 * FAR_M),
}
"""Scale, angle, and translation along both axes in metres."""

QUICK: list[tuple[str, Kind]] = [
    *((name, "inflection") for name in maps.names()),
    *((name, "aspect") for name in ("l457mod", "room1", "room2", "room3")),
]


def transformed(environment: Environment, points: Floats, scale: float, angle: float, shift: float) -> Floats:
    """Points scaled and turned about the middle of the map, and shifted."""
    middle = environment.vertices.mean(axis=0)
    turn = scale * np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    moved: Floats = (points - middle) @ turn + middle + shift
    return moved


def check_moves(cells: Cells, scale: float, angle: float, shift: float) -> None:
    """The same cells with the same neighbours, and the same graph, up to a decision on what is thinner than 1e-7."""
    environment = cells.environment
    outer, *holes = (transformed(environment, ring, scale, angle, shift) for ring in environment.rings)
    moved = decompose(Environment(outer, holes, environment.name), cells.kind)
    assert moved.counts == cells.counts
    names = moved.locate(transformed(environment, cells.centroids, scale, angle, shift))
    np.testing.assert_array_equal(np.sort(names), np.arange(len(cells)))
    size_m = max(np.ptp(environment.vertices, axis=0))
    assert np.abs(moved.areas[names] / scale**2 - cells.areas).max() < 1e-9 * size_m**2
    order = np.ix_(names, names)
    np.testing.assert_array_equal(moved.adjacency.toarray()[order], cells.adjacency.toarray())
    np.testing.assert_array_equal(mutual_visibility(moved).toarray()[order], mutual_visibility(cells).toarray())


@pytest.mark.parametrize(
    ("name", "kind", "move"),
    [(*drawn, move) for i, drawn in enumerate(QUICK) for j, move in enumerate(MOVES) if (i + j) % 2 == 0],
)
def test_cells_and_graphs_of_the_maps_move_with_them(name: str, kind: Kind, move: str) -> None:
    check_moves(decompose(Environment.load(maps.path(name)), kind), *MOVES[move])


@given(
    seed=st.integers(0, 10_000),
    scale=st.floats(-3.0, 3.0).map(lambda power: 10.0**power),
    angle=st.floats(0.0, 2.0 * math.pi),
    away=st.floats(-1.0, 1.0),
)
@settings(max_examples=30)
def test_cells_and_graphs_of_random_maps_move_with_them(seed: int, scale: float, angle: float, away: float) -> None:
    """Far from the origin as long as coordinates resolve a thousand-millionth of the map there."""
    environment = environment_of(seed)
    check_moves(decompose(environment), scale, angle, away * FAR_M * scale)
    if len(environment.vertices) < 30:
        check_moves(decompose(environment, "aspect"), scale, angle, away * FAR_M * scale)


@pytest.mark.parametrize("move", MOVES)
@pytest.mark.parametrize("seed", [67, 69])
def test_rays_of_very_short_walls_move_with_them(seed: int, move: str) -> None:
    """100 km away coordinates are rounded by 1e-11 m, which turns a wall of half a millimetre so far that its ray
    misses a wall in line with it, 10 m on, by 3e-7 m."""
    check_moves(decompose(environment_of(seed)), *MOVES[move])


def hard_polygons(most_vertices: int) -> Iterator[Environment]:
    """The shared polygons that are environments, up to a size."""
    for file in shared_maps("polygons"):
        try:
            environment = Environment.load(file)
        except InvalidEnvironment:  # rings that touch
            continue
        if len(environment.vertices) <= most_vertices:
            yield environment


def test_cells_and_graphs_of_hard_polygons_move_with_them() -> None:
    for environment in hard_polygons(150):
        for move in ("away", "smaller", "turned"):
            check_moves(decompose(environment), *MOVES[move])


def test_thousands_of_cells_tile_hard_polygons() -> None:
    """eberly-6 has 36,502 inflection cells: convex, of the right area in all, found by location, seen by neighbours."""
    for environment in hard_polygons(1500):
        cells = decompose(environment)
        assert math.isclose(cells.areas.sum(), environment.area, rel_tol=1e-9)
        assert turns(cells).min() > -1e-9
        points = free_points(environment, 500, np.random.default_rng(3))
        check_location(cells, points)
        first, second = cells.adjacency.nonzero()
        some = np.random.default_rng(4).permutation(len(first))[:300]
        pairs = (
            np.concatenate([cells.polygons[i], cells.polygons[j]])
            for i, j in zip(first[some], second[some], strict=True)
        )
        ends = np.concatenate([draw_pairs(corners, 3, np.random.default_rng(5)) for corners in pairs])
        assert covered_segments(environment, ends).all()


def turns(cells: Cells) -> Floats:
    """At each corner the sine of the turn to the left, in the frame of the geometry."""
    corners, starts = cells.unit_corners, cells.starts
    after = np.arange(1, len(corners) + 1)
    after[starts[1:] - 1] = starts[:-1]
    before = np.argsort(after)
    back, ahead = corners - corners[before], corners[after] - corners
    cross: Floats = back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0]
    return cross


def draw_pairs(corners: Floats, count: int, rng: np.random.Generator) -> Floats:
    """Pairs (count, 2, 2) of points that lie in the hull of corners, near its border rather than in its middle."""
    mixed: Floats = rng.dirichlet(np.full(len(corners), 0.3), (count, 2)) @ corners
    return mixed


def check_location(cells: Cells, points: Floats) -> None:
    """Each free point lies in the cell that is named, by shapely, up to the tolerance."""
    found = cells.locate(points)
    assert (found >= 0).all()
    named = np.array([shapely.Polygon(cells.polygons[k]) for k in found])
    assert shapely.distance(named, shapely.points(points)).max() <= 2.0 * cells.environment.tolerance_m


@pytest.mark.parametrize(("name", "kind"), [*QUICK, ("l457", "aspect"), ("maze", "aspect"), ("office", "aspect")])
def test_location_agrees_with_shapely_on_the_maps(name: str, kind: Kind) -> None:
    environment = Environment.load(maps.path(name))
    cells = decompose(environment, kind)
    rng = np.random.default_rng(8)
    check_location(cells, free_points(environment, 500, rng))
    low, high = np.subtract(environment.bounds[:2], 1.0), np.add(environment.bounds[2:], 1.0)
    anywhere = rng.uniform(low, high, (2000, 2))
    np.testing.assert_array_equal(cells.locate(anywhere) >= 0, shapely.intersects_xy(environment.polygon, anywhere))


@pytest.mark.parametrize(("name", "kind"), QUICK)
def test_points_of_mutually_visible_cells_see_each_other(name: str, kind: Kind) -> None:
    """Drawn near the cells' borders, and judged by shapely alone."""
    environment = Environment.load(maps.path(name))
    cells = decompose(environment, kind)
    first, second = mutual_visibility(cells).nonzero()
    rng = np.random.default_rng(9)
    some = rng.integers(0, len(first), 800)
    shares = (rng.dirichlet(np.full(len(cells.polygons[k]), 0.3)) for side in (first, second) for k in side[some])
    named = (k for side in (first, second) for k in side[some])
    drawn = np.array([share @ cells.polygons[k] for share, k in zip(shares, named, strict=True)])
    assert covered_segments(environment, np.stack(np.split(drawn, 2), axis=1)).all()


Point = tuple[int, int]


def enters_hull(hull: list[Point], a: Point, b: Point) -> bool:
    """Whether the segment from a to b meets the open interior of a counter-clockwise convex polygon. Exact."""
    low, high = Fraction(0), Fraction(1)
    for (px, py), (qx, qy) in zip(hull, [*hull[1:], hull[0]], strict=True):
        at_a = (qx - px) * (a[1] - py) - (qy - py) * (a[0] - px)
        at_b = (qx - px) * (b[1] - py) - (qy - py) * (b[0] - px)
        if at_a <= 0 and at_b <= 0:
            return False
        if at_a < 0 or at_b < 0:
            cut = Fraction(at_a, at_a - at_b)
            low, high = (max(low, cut), high) if at_a < 0 else (low, min(high, cut))
    return low < high


def hull_of(points: list[Point]) -> list[Point]:
    """Convex hull, counter-clockwise, by Andrew's monotone chain. Exact."""
    ordered = sorted(set(points))
    halves = []
    for sweep in (ordered, ordered[::-1]):
        half: list[Point] = []
        for p in sweep:
            while len(half) > 1 and (half[-1][0] - half[-2][0]) * (p[1] - half[-2][1]) <= (
                half[-1][1] - half[-2][1]
            ) * (p[0] - half[-2][0]):
                half.pop()
            half.append(p)
        halves += half[:-1]
    return halves


@pytest.mark.parametrize("seed", range(4))
def test_graphs_equal_exact_arithmetic_on_maps_drawn_on_a_grid(seed: int) -> None:
    """All pairs, hulls not shrunk: what enters the hull of cells with whole coordinates enters it by a lot, or not."""
    environment = rectilinear_environment(40 + seed)
    cells = decompose(environment)
    rounded = np.rint(cells.corners)
    assert np.abs(cells.corners - rounded).max() < 1e-9
    corners = [[(int(x), int(y)) for x, y in of] for of in np.split(rounded, cells.starts[1:-1])]
    walls = [[(int(x), int(y)) for x, y in wall] for wall in environment.walls]
    seen = mutual_visibility(cells).toarray()
    for i in range(len(cells)):
        for j in range(i):
            hull = hull_of(corners[i] + corners[j])
            assert seen[i, j] == (not any(enters_hull(hull, a, b) for a, b in walls)), (i, j)
