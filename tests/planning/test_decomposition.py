from __future__ import annotations

import math
from collections import defaultdict

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

import maps
from planning.decomposition import Cells, DecompositionFailed, Kind, decompose, measure_cells
from planning.environment import Environment
from planning.polygon_validation import InvalidEnvironment
from tests.planning.exact_cells import count_exactly
from tests.planning.polygons import environment_of, oblique_environment, rectilinear_environment, shared_maps

KINDS: tuple[Kind, ...] = ("inflection", "aspect")
LARGE = ("cityblocks", "l457")

# cityblocks has 43,675 aspect cells and l457 16,965: too slow for shapely.
MAPS = [(name, kind) for name in maps.names() for kind in KINDS if kind == "inflection" or name not in LARGE]

# Table 1 (V, r, Lr, I, N), with the counts of the rebuilt maps where they differ from the thesis' own.
TABLE_1 = {
    ("room1", "inflection"): (28, 12, 20, 0, 49, 26),
    ("room1", "aspect"): (28, 12, 20, 48, 207, 200),
    ("room2", "inflection"): (34, 17, 28, 0, 76, 48),
    ("room2", "aspect"): (34, 17, 28, 54, 243, 233),
    ("room3", "inflection"): (64, 36, 56, 0, 148, 98),
    ("room3", "aspect"): (64, 36, 56, 129, 688, 681),
    ("cityblocks", "inflection"): (68, 64, 128, 0, 600, 517),
    ("maze", "inflection"): (82, 55, 110, 0, 369, 280),
    ("l457", "inflection"): (225, 116, 202, 0, 791, 594),
    ("l457mod", "aspect"): (18, 11, 18, 24, 72, 65),
}


def two_rooms(pillar: bool = True) -> Environment:
    """Two rooms and a doorway of 2 m, with a pillar in the left room."""
    outer = [(0, 0), (8, 0), (8, 3), (10, 3), (10, 0), (18, 0), (18, 8), (10, 8), (10, 5), (8, 5), (8, 8), (0, 8)]
    return Environment(outer, [[(3, 3), (4, 3), (4, 4), (3, 4)]] if pillar else [], "two rooms")


def move(environment: Environment, scale: float, angle: float, x: float, y: float) -> Environment:
    turn = scale * np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    outer, *holes = (ring @ turn + (x, y) for ring in environment.rings)
    return Environment(outer, holes, environment.name)


def check_cells(cells: Cells) -> None:
    """Convex, disjoint, tiling, and adjacent where an edge is shared; shapely and dictionaries are the judges."""
    environment = cells.environment
    assert len(cells) == len(cells.polygons) == cells.counts["N"]
    assert (cells.areas > 0.0).all()
    assert math.isclose(cells.areas.sum(), environment.area, rel_tol=1e-9)
    polygons = np.array([shapely.Polygon(polygon) for polygon in cells.polygons])
    np.testing.assert_allclose(shapely.area(polygons), cells.areas, rtol=1e-6, atol=1e-15 * environment.area)
    # Edge-matched polygons without overlap: no corner of one lies inside an edge of another.
    assert shapely.coverage_is_valid(polygons)
    union = shapely.coverage_union_all(polygons)
    assert shapely.symmetric_difference(union, environment.polygon).area <= 1e-9 * environment.area

    edges = defaultdict(list)
    for k, polygon in enumerate(cells.polygons):
        span = np.roll(polygon, -1, axis=0) - polygon
        turn = span[:, 0] * np.roll(span[:, 1], -1) - span[:, 1] * np.roll(span[:, 0], -1)
        assert (turn > -1e-9 * environment.area).all(), f"cell {k} of {environment.name} is not convex"
        for a, b in zip(map(tuple, polygon), map(tuple, np.roll(polygon, -1, axis=0)), strict=True):
            edges[frozenset((a, b))].append(k)
    expected = {(a, b) for pair in edges.values() if len(pair) == 2 for a, b in (pair, pair[::-1])}
    assert all(len(pair) <= 2 for pair in edges.values())
    assert set(zip(*map(np.ndarray.tolist, cells.adjacency.nonzero()), strict=True)) == expected
    assert cells.adjacency.dtype == np.bool_


@pytest.mark.parametrize(("name", "kind"), TABLE_1)
def test_counts_are_those_of_table_1(name: str, kind: Kind) -> None:
    v, r, lr, la, i, n = TABLE_1[name, kind]
    cells = decompose(Environment.load(maps.path(name)), kind)
    assert cells.counts == {"V": v, "r": r, "Lb": v, "Lr": lr, "La": la, "I": i, "N": n}
    assert len(cells) == n


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(6))
def test_counts_equal_exact_arithmetic_on_maps_drawn_on_a_grid(seed: int, kind: Kind) -> None:
    environment = rectilinear_environment(seed)
    counts = decompose(environment, kind).counts
    exact = count_exactly(environment, kind)
    assert {name: counts[name] for name in exact} == exact


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [3, 5])
def test_counts_equal_exact_arithmetic_in_general_position(seed: int, kind: Kind) -> None:
    drawn = oblique_environment(seed)
    outer, *holes = (np.round(ring * 256.0) / 256.0 for ring in drawn.rings)
    environment = Environment(outer, holes, drawn.name)
    counts = decompose(environment, kind).counts
    exact = count_exactly(environment, kind)
    assert {name: counts[name] for name in exact} == exact


@pytest.mark.parametrize(("name", "kind"), MAPS)
def test_cells_of_the_maps_tile_them(name: str, kind: Kind) -> None:
    check_cells(decompose(Environment.load(maps.path(name)), kind))


@pytest.mark.parametrize("seed", range(10, 22))
def test_cells_of_random_maps_tile_them(seed: int) -> None:
    for kind in KINDS:
        check_cells(decompose(environment_of(seed), kind))


def test_cells_of_hard_polygons_tile_them() -> None:
    for file in shared_maps("polygons"):
        try:
            environment = Environment.load(file)
        except InvalidEnvironment:
            continue
        width = environment.bounds[2] - environment.bounds[0]
        if len(environment.vertices) < 500:
            check_cells(decompose(environment))
        if len(environment.vertices) < 200:
            check_cells(decompose(environment, "aspect", max_bitangent_m=width))


@given(
    seed=st.integers(0, 40),
    kind=st.sampled_from(KINDS),
    scale=st.floats(1e-3, 1e3),
    angle=st.floats(0.0, 7.0),
    x=st.floats(-1e5, 1e5),
    y=st.floats(-1e5, 1e5),
)
@settings(max_examples=40, deadline=None, derandomize=True)
def test_moved_and_scaled_maps_have_the_same_cells(
    seed: int, kind: Kind, scale: float, angle: float, x: float, y: float
) -> None:
    """Far from the origin too, as long as the tolerance is a thousand-millionth of the map and not coarser."""
    environment = environment_of(seed)
    moved = move(environment, scale, angle, x * scale, y * scale)
    cells, moved_cells = decompose(environment, kind), decompose(moved, kind)
    assert moved_cells.counts == cells.counts
    assert math.isclose(moved_cells.areas.sum(), scale * scale * cells.areas.sum(), rel_tol=1e-9)
    np.testing.assert_allclose(
        np.sort(moved_cells.areas), np.sort(cells.areas) * scale**2, rtol=0.0, atol=1e-9 * moved.area
    )


@pytest.mark.parametrize(
    ("pillars", "kind"), [(1, "aspect"), (2, "aspect"), (3, "aspect"), (2, "inflection"), (4, "inflection")]
)
def test_a_yard_of_pillars_is_as_symmetric_as_its_cells(pillars: int, kind: Kind) -> None:
    """Many lines through one point, rays from pillar to pillar, bitangents through several vertices."""
    side = 2 * pillars + 1
    squares = [[(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)] for x in range(1, side, 2) for y in range(1, side, 2)]
    yard = Environment([(0, 0), (side, 0), (side, side), (0, side)], squares, "yard")
    cells = decompose(yard, kind)
    check_cells(cells)
    if kind == "inflection":
        assert len(cells) == side * side - pillars * pillars
    if pillars < 4:
        exact = count_exactly(yard, kind)
        assert {name: cells.counts[name] for name in exact} == exact
    for turned in (cells.centroids[:, ::-1], side - cells.centroids):
        found = cells.locate(turned)
        np.testing.assert_allclose(cells.areas[found], cells.areas, rtol=1e-6)


def test_a_convex_room_is_one_cell() -> None:
    room = Environment([(0, 0), (4, 0), (5, 2), (4, 3), (0, 3)])
    for kind in KINDS:
        cells = decompose(room, kind)
        assert cells.counts == {"V": 5, "r": 0, "Lb": 5, "Lr": 0, "La": 0, "I": 5, "N": 1}
        assert cells.adjacency.nnz == 0
        np.testing.assert_allclose(cells.centroids[0], shapely.centroid(room.polygon).coords[0])


def test_rays_of_facing_door_jambs_count_once() -> None:
    """The doorway is 4 reflex vertices; the rays across it and along its walls coincide in pairs."""
    cells = decompose(two_rooms(pillar=False))
    assert cells.counts == {"V": 12, "r": 4, "Lb": 12, "Lr": 6, "La": 0, "I": 16, "N": 7}


def test_a_bitangent_adds_its_piece_and_two_extensions() -> None:
    """Two teeth of unequal height on one wall: one line over both tips, from wall to wall."""
    teeth = Environment([(0, 0), (2, 0), (3, 2), (4, 0), (6, 0), (7, 3), (8, 0), (10, 0), (10, 9), (0, 9)])
    plain, aspect = decompose(teeth), decompose(teeth, "aspect")
    assert aspect.counts["La"] == 3
    assert aspect.counts["I"] > plain.counts["I"]
    on_line = np.abs(aspect.corners @ (1.0, -4.0) + 5.0) < 1e-9  # x − 4 y + 5 = 0
    assert {(0.0, 1.25), (3.0, 2.0), (7.0, 3.0), (10.0, 3.75)} <= {(x, y) for x, y in aspect.corners[on_line].round(9)}


def test_short_bitangents_only_are_the_r_aspect_decomposition() -> None:
    environment = Environment.load(maps.path("room3"))
    sizes = [decompose(environment, "aspect", max_bitangent_m=reach) for reach in (1e-6, 4.0, 10.0, 1e6)]
    assert sizes[0].counts == decompose(environment, "inflection").counts
    assert sizes[-1].counts == decompose(environment, "aspect").counts
    assert sorted({cells.counts["La"] for cells in sizes}) == [cells.counts["La"] for cells in sizes]
    for cells in sizes[1:3]:
        check_cells(cells)


def test_corners_at_vertices_are_the_vertices() -> None:
    environment = move(two_rooms(), 1.0, 0.3, 1e5, -3e5)
    corners = set(map(tuple, decompose(environment, "aspect").corners))
    assert corners >= set(map(tuple, environment.vertices))


def test_unknown_kinds_and_lengths_are_refused() -> None:
    with pytest.raises(ValueError, match='no decomposition "voronoi": say "inflection" or "aspect"'):
        decompose(two_rooms(), "voronoi")  # type: ignore[arg-type]
    for kind, reach in (("inflection", 3.0), ("aspect", 0.0), ("aspect", math.nan)):
        with pytest.raises(ValueError, match="max_bitangent_m"):
            decompose(two_rooms(), kind, max_bitangent_m=reach)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("outer", "holes"),
    [
        ([(0, 0), (9, 0), (9, 9), (0, 9)], [[(2, 3), (5, 3), (5, 5), (2, 5)], [(4, 4), (7, 4), (7, 8), (4, 8)]]),
        ([(0, 0), (9, 9), (9, 0), (0, 5)], []),
    ],
)
def test_rings_that_cross_are_refused_with_a_place(outer: list[tuple[int, int]], holes: list[object]) -> None:
    crossing = Environment(outer, holes, "crossing", validate=False)  # type: ignore[arg-type]
    with pytest.raises(DecompositionFailed, match=r"^crossing: its cells do not tile .* near \(.*\) m: .* simplify"):
        decompose(crossing)


def test_areas_and_centroids_of_slivers_stay_inside() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        a, b = rng.uniform(-0.5, 0.5, (2, 2))
        across = np.array([a[1] - b[1], b[0] - a[0]]) * 10.0 ** rng.uniform(-15, -8)
        corners = np.stack([a, b, 0.5 * (a + b) + across])
        if shapely.Polygon(corners).exterior.is_ccw:
            areas, centroids = measure_cells(corners, np.array([0, 3]))
            assert areas[0] == pytest.approx(shapely.area(shapely.Polygon(corners)), abs=1e-16)
            assert np.linalg.norm(centroids[0] - 0.5 * (a + b)) < 0.5 * np.linalg.norm(a - b)
