"""Placement graphs against shapely and a geodesic for each pair, and what points save in robots."""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise
from typing import Any

import networkx as nx
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

import maps
from planning import placement_points
from planning.decomposition import decompose
from planning.deployment import NO_CHAIN
from planning.environment import Environment
from planning.geodesic import GeodesicMap, NotInFreeSpace
from planning.geodesic_table import GeodesicTable
from planning.inflation import NothingLeft
from planning.mutual_visibility import mutual_visibility
from planning.placement_graph import PlacementGraph
from planning.placement_points import UnfitSpacing
from planning.tree import InvalidWeights
from tests.planning.polygons import covered_segments, environment_of, free_points

RADIUS_M = 0.2


@cache
def _cells(name: str) -> PlacementGraph:
    environment = Environment.load(maps.path(name))
    cells = decompose(environment, "inflection")
    return PlacementGraph.from_cells(cells, mutual_visibility(cells), environment, RADIUS_M)


@cache
def _points(name: str) -> PlacementGraph:
    return PlacementGraph.from_points(Environment.load(maps.path(name)), RADIUS_M)


def _check(graph: PlacementGraph, radius_m: float) -> None:
    """What both kinds promise."""
    size = len(graph)
    assert graph.positions.shape == (size, 2)
    clearance = shapely.distance(graph.environment.polygon.boundary, shapely.points(graph.positions))
    assert clearance.min() >= radius_m * (1.0 - 1e-9)
    assert graph.environment.contains(graph.positions).all()
    for array in (graph.visible, graph.weights, graph.distances):
        assert array.shape == (size, size)
        np.testing.assert_array_equal(array, array.T)
    assert graph.visible.diagonal().all()
    np.testing.assert_array_equal(np.isfinite(graph.weights), graph.visible)
    assert not graph.weights.diagonal().any()
    assert (graph.weights[~np.eye(size, dtype=np.bool_)] > 1.0).all()
    straight = np.linalg.norm(graph.positions[:, None] - graph.positions, axis=2)
    assert (graph.distances >= straight - 1e-9).all()


def _check_sight(graph: PlacementGraph) -> None:
    """Visible is what shapely finds free, and nothing that is not so within rounding."""
    pairs = np.array([(i, j) for i in range(len(graph)) for j in range(i)])
    visible = graph.visible[tuple(pairs.T)]
    segments = graph.positions[pairs]
    assert visible[covered_segments(graph.environment, segments)].all()
    wider = graph.environment.polygon.buffer(10.0 * graph.environment.tolerance_m, join_style="mitre")
    assert shapely.covers(wider, shapely.linestrings(segments[visible])).all()


@given(seed=st.integers(0, 10_000), radius_m=st.sampled_from([0.0, 0.1, 0.25]), spacing_m=st.floats(1.5, 4.0))
@settings(max_examples=15)
def test_points_stand_free_and_see_what_walls_allow(seed: int, radius_m: float, spacing_m: float) -> None:
    environment = environment_of(seed)
    try:
        graph = PlacementGraph.from_points(environment, radius_m, spacing_m)
    except NothingLeft:
        return
    _check(graph, radius_m)
    _check_sight(graph)
    assert nx.is_connected(nx.from_numpy_array(graph.visible))
    assert (graph.weights[np.isfinite(graph.weights)] <= 1.51).all()


@pytest.mark.parametrize("name", maps.names())
def test_packaged_maps_have_about_as_many_points_as_intended(name: str) -> None:
    graph = _points(name)
    _check(graph, RADIUS_M)
    assert 0.8 * placement_points.NUMBER < len(graph) < 1.2 * placement_points.NUMBER
    assert nx.is_connected(nx.from_numpy_array(graph.visible))


def test_cells_stand_free_and_see_what_cells_promise() -> None:
    graph = _cells("office")
    _check(graph, RADIUS_M)
    cells = decompose(graph.environment, "inflection")
    seen = mutual_visibility(cells).toarray()
    np.testing.assert_array_equal(graph.visible, seen[np.ix_(graph.cells, graph.cells)])
    first, second = np.nonzero(graph.visible)
    assert np.all(graph.environment.line_of_sight(graph.positions[first], graph.positions[second]))
    np.testing.assert_array_equal(cells.locate(graph.positions), graph.cells)


@pytest.mark.parametrize("graph", [_cells("room2"), _points("room2")], ids=["cells", "points"])
def test_distances_are_geodesics_in_the_inflated_map(graph: PlacementGraph) -> None:
    geodesics = GeodesicMap(graph.environment.inflated(RADIUS_M))
    some = np.random.default_rng(1).integers(0, len(graph), 12)
    for i in some:
        expected = [geodesics.length(graph.positions[i], place) for place in graph.positions]
        assert graph.distances[i] == pytest.approx(expected, abs=1e-9)
        assert graph.distances_from(graph.positions[i]) == pytest.approx(expected, abs=1e-9)
    via = graph.distances[:, :, None] + graph.distances
    assert (graph.distances <= via.min(axis=1) + 1e-9).all()
    with pytest.raises(NotInFreeSpace):
        graph.distances_from((-50.0, 0.0))


@given(seed=st.integers(0, 10_000))
@settings(max_examples=15)
def test_a_table_of_geodesics_equals_one_search_for_each_pair(seed: int) -> None:
    environment = environment_of(seed)
    rng = np.random.default_rng(seed)
    places = np.concatenate([free_points(environment, 8, rng), rng.permutation(environment.vertices)[:4]])
    geodesics = GeodesicMap(environment)
    table = GeodesicTable(geodesics, places)
    for i, place in enumerate(places):
        expected = [geodesics.length(place, other) for other in places]
        assert table.between[i] == pytest.approx(expected, abs=1e-9)
        assert table.lengths(place) == pytest.approx(expected, abs=1e-9)


def test_any_point_is_joined_to_the_points_that_see_it() -> None:
    graph = _points("office")
    places = free_points(graph.environment, 20, np.random.default_rng(2))
    sees = np.array([graph.sees(place) for place in places])
    for place, row in zip(places, sees, strict=True):
        pairs = np.stack([np.broadcast_to(place, graph.positions.shape), graph.positions], axis=1)
        np.testing.assert_array_equal(row, covered_segments(graph.environment, pairs))
    for i in range(20):
        together = [i, (i + 7) % 20]
        np.testing.assert_array_equal(graph.sees_all(places[together]), sees[together].all(axis=0))
    longest_m = max(math.dist(graph.positions[i], graph.positions[j]) for i, j in np.argwhere(graph.visible))
    weights = graph.link_weights(places[0])
    for v in np.flatnonzero(sees[0]):
        assert weights[v] == pytest.approx(1.01 + 0.5 * math.dist(places[0], graph.positions[v]) / longest_m)
    direct = graph.direct_weights(places[0], places)
    np.testing.assert_array_equal(np.isfinite(direct), graph.environment.line_of_sight(places[0], places))
    assert not graph.sees((-50.0, 0.0)).any()


def test_any_point_is_joined_to_the_cells_that_all_of_its_cell_sees() -> None:
    graph = _cells("office")
    cells = decompose(graph.environment, "inflection")
    seen = mutual_visibility(cells).toarray()
    places = free_points(graph.environment, 50, np.random.default_rng(3))
    located = cells.locate(places)
    sees = np.array([graph.sees(place) for place in places])
    np.testing.assert_array_equal(sees, seen[np.ix_(located, graph.cells)])
    np.testing.assert_array_equal(graph.sees_all(places[:2]), sees[:2].all(axis=0))
    assert not graph.sees_all([places[0], (-50.0, 0.0)]).any()
    np.testing.assert_array_equal(np.isfinite(graph.direct_weights(places[0], places)), seen[located[0]][located])
    assert not graph.sees((-50.0, 0.0)).any()
    assert np.isinf(graph.direct_weights((-50.0, 0.0), places)).all()
    assert np.isinf(graph.direct_weights(places[0], [(-50.0, 0.0)])).all()


@pytest.mark.parametrize("graph", [_cells("maze"), _points("maze")], ids=["cells", "points"])
def test_fewest_relays_are_those_of_networkx(graph: PlacementGraph) -> None:
    links = nx.from_numpy_array(graph.visible)
    for place in free_points(graph.environment, 5, np.random.default_rng(4)):
        links.add_edges_from(("end", int(v)) for v in np.flatnonzero(graph.sees(place)))
        hops = nx.single_source_shortest_path_length(links, "end")
        expected = [hops.get(v, NO_CHAIN) for v in range(len(graph))]
        assert graph.relays_from(place).tolist() == expected
        links.remove_node("end")


@pytest.mark.parametrize(("name", "over_cells", "over_points"), [("room3", 7, 4), ("cityblocks", 3, 2), ("maze", 3, 3)])
def test_points_need_fewer_relays_than_cells(name: str, over_cells: int, over_points: int) -> None:
    """Between the two placements that are worst; the figures of the policy prototype."""
    for graph, relays in ((_cells(name), over_cells), (_points(name), over_points)):
        assert nx.diameter(nx.from_numpy_array(graph.visible)) - 1 == relays


@pytest.mark.parametrize(("scale", "offset"), [(1e-3, 0.0), (1e3, 0.0), (1.0, 1e5)])
def test_points_move_with_the_map(scale: float, offset: float) -> None:
    environment = Environment.load(maps.path("room1"))
    moved = Environment(
        scale * environment.outer + offset, [scale * hole + offset for hole in environment.holes], "moved"
    )
    here, there = PlacementGraph.from_points(environment, 0.2), PlacementGraph.from_points(moved, 0.2 * scale)
    np.testing.assert_allclose(there.positions, scale * here.positions + offset, rtol=0.0, atol=1e-6 * scale)
    np.testing.assert_array_equal(there.visible, here.visible)
    np.testing.assert_allclose(there.distances, scale * here.distances, rtol=0.0, atol=1e-5 * scale)
    np.testing.assert_allclose(there.weights, here.weights, rtol=0.0, atol=1e-6)


def test_equal_maps_have_equal_graphs() -> None:
    environment = Environment.load(maps.path("office"))
    first, second = (PlacementGraph.from_points(environment, RADIUS_M) for _ in range(2))
    np.testing.assert_array_equal(first.positions, second.positions)
    np.testing.assert_array_equal(first.weights, second.weights)
    np.testing.assert_array_equal(first.distances, second.distances)


def test_a_denser_grid_has_more_points() -> None:
    environment = Environment.load(maps.path("room1"))
    sizes = [len(PlacementGraph.from_points(environment, 0.2, spacing_m)) for spacing_m in (4.0, 2.0, 1.0)]
    assert all(2.0 < more / fewer < 4.5 for fewer, more in pairwise(sizes))


def test_a_convex_room_smaller_than_the_spacing_has_one_point() -> None:
    graph = PlacementGraph.from_points(Environment([(0, 0), (3, 0), (3, 2), (0, 2)]), 0.2, 50.0)
    _check(graph, 0.2)
    assert graph.positions.tolist() == [[1.5, 1.0]]


@pytest.mark.parametrize(
    ("spacing_m", "said"),
    [("a", "is 'a': give a finite number"), (0.0, "above 0"), (math.nan, "above 0"), (0.05, "make it at least 0.")],
)
def test_a_spacing_of_no_use_is_refused(spacing_m: Any, said: str) -> None:
    with pytest.raises(UnfitSpacing, match=said):
        PlacementGraph.from_points(Environment.load(maps.path("office")), 0.2, spacing_m)


def test_weights_of_another_shape_are_refused() -> None:
    environment = Environment.load(maps.path("office"))
    cells = decompose(environment)
    seen = mutual_visibility(cells)
    with pytest.raises(InvalidWeights, match=f"weights are for 3 cells, but the map has {len(cells)}"):
        PlacementGraph.from_cells(cells, seen, environment, RADIUS_M, weights=np.ones((3, 3)))
    with pytest.raises(InvalidWeights, match=r"square matrix, not one of shape \(2, 3\)"):
        PlacementGraph.from_cells(cells, seen, environment, RADIUS_M, weights=np.ones((2, 3)))


def test_the_least_spacing_that_is_named_is_not_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(placement_points, "MOST", 400)
    environment = Environment.load(maps.path("room1"))
    with pytest.raises(UnfitSpacing) as refusal:
        PlacementGraph.from_points(environment, 0.2, 0.01)
    least_m = float(str(refusal.value).rsplit("at least ", 1)[1].removesuffix(" m"))
    assert 360 < len(PlacementGraph.from_points(environment, 0.2, least_m)) < 440


def test_zigzag_of_narrow_passages_stays_connected() -> None:
    """Where the middles of two arcs do not see each other, all corners are taken."""
    outline = [(0, 0), (4, 0), (4, 1), (1, 1), (1, 1.5), (5, 1.5), (5, 2.5), (2, 2.5), (2, 3), (6, 3), (6, 4), (0, 4)]
    environment = Environment(outline)
    graph = PlacementGraph.from_points(environment, 0.2, 3.0)
    assert nx.is_connected(nx.from_numpy_array(graph.visible))
