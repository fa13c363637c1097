"""Shortest paths against a visibility graph over all vertices, built by shapely and searched by networkx."""

from __future__ import annotations

import itertools
import math

import networkx
import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from planning.environment import Environment
from planning.geodesic import GeodesicMap, NotInFreeSpace
from planning.inflation import NothingLeft
from tests.planning.polygons import covered_segments, environment_of, free_points, shared_maps, wall_points

Floats = NDArray[np.float64]

L_ROOM = Environment([(0, 0), (6, 0), (6, 2), (2, 2), (2, 6), (0, 6)], name="L")


def polyline_length(path: Floats) -> float:
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def shortest_by_networkx(environment: Environment, points: Floats) -> Floats:
    """Lengths (n, n) between points over all vertices that shapely lets see each other; none of ours is used."""
    nodes = np.concatenate([points, environment.vertices])
    pairs = np.array(list(itertools.combinations(range(len(nodes)), 2)))
    graph: networkx.Graph[int] = networkx.Graph()
    graph.add_nodes_from(range(len(nodes)))
    for i, j in pairs[covered_segments(environment, nodes[pairs])].tolist():
        graph.add_edge(i, j, weight=math.dist(nodes[i], nodes[j]))
    lengths = np.full((len(points), len(points)), np.inf)
    for i in range(len(points)):
        for j, length in networkx.single_source_dijkstra_path_length(graph, i).items():
            if j < len(points):
                lengths[i, j] = length
    return lengths


def check_against_networkx(environment: Environment, points: Floats) -> None:
    geodesics = GeodesicMap(environment)
    expected = shortest_by_networkx(environment, points)
    wider = environment.polygon.buffer(1e-8 * np.ptp(environment.outer), join_style="mitre")
    for i, p in enumerate(points):
        found = geodesics.lengths(p, points)
        assert found == pytest.approx(expected[i], rel=1e-9, abs=1e-9), f"{environment.name}, from {p.tolist()}"
        q = points[(i + 1) % len(points)]
        path = geodesics.path(p, q)
        assert np.array_equal(path[[0, -1]], [p, q])
        assert polyline_length(path) == pytest.approx(geodesics.length(p, q), rel=1e-9, abs=1e-9)
        assert geodesics.length(p, q) == pytest.approx(geodesics.length(q, p), rel=1e-12)
        assert wider.covers(shapely.LineString(path)), f"{environment.name}, from {p.tolist()} to {q.tolist()}"


@given(seed=st.integers(0, 10_000))
@example(seed=20265)
@settings(deadline=None, max_examples=12)
def test_random_map_agrees_with_networkx(seed: int) -> None:
    environment = environment_of(seed)
    rng = np.random.default_rng(seed)
    vertices = rng.permutation(environment.vertices)[:4]
    check_against_networkx(environment, np.concatenate([free_points(environment, 8, rng), vertices]))


@given(seed=st.integers(0, 10_000))
@settings(deadline=None, max_examples=5)
def test_inflated_map_agrees_with_networkx(seed: int) -> None:
    try:
        environment = environment_of(seed).inflated(0.25)
    except NothingLeft:
        return
    check_against_networkx(environment, free_points(environment, 8, np.random.default_rng(seed)))


def test_shared_maps_agree_with_networkx() -> None:
    for path in shared_maps("thesis"):
        environment = Environment.load(path)
        check_against_networkx(environment, free_points(environment, 12, np.random.default_rng(5)))


@given(seed=st.integers(0, 10_000))
@settings(deadline=None, max_examples=20)
def test_lengths_are_a_metric(seed: int) -> None:
    """Points on walls too, where rounding decides; so close to the truth that the triangle inequality holds."""
    environment = environment_of(seed)
    rng = np.random.default_rng(seed)
    points = np.concatenate([free_points(environment, 6, rng), wall_points(environment, 6, rng)])
    geodesics = GeodesicMap(environment)
    lengths = np.array([geodesics.lengths(p, points) for p in points])
    straight = np.hypot(*(points[:, None] - points[None]).T)
    assert np.isfinite(lengths).all()
    assert lengths == pytest.approx(lengths.T, abs=1e-9)
    assert np.all(lengths >= straight - 1e-12)
    assert np.all(np.diag(lengths) == 0.0)
    assert np.all(lengths[:, None, :] <= lengths[:, :, None] + lengths[None, :, :] + 1e-7)
    sees = environment.visibility_matrix(points)
    assert np.allclose(lengths[sees], straight[sees], rtol=0.0, atol=1e-12)
    assert np.all(lengths[~sees] > straight[~sees])


def test_around_a_corner() -> None:
    geodesics = GeodesicMap(L_ROOM)
    assert geodesics.path((5, 1), (1, 5)).tolist() == [[5, 1], [2, 2], [1, 5]]
    assert geodesics.length((5, 1), (1, 5)) == pytest.approx(2 * np.sqrt(10))
    assert geodesics.path((5, 1), (1, 1)).tolist() == [[5, 1], [1, 1]]
    assert geodesics.path((5, 2), (2, 5)).tolist() == [[5, 2], [2, 2], [2, 5]]
    assert geodesics.path((2, 2), (1, 5)).tolist() == [[2, 2], [1, 5]]
    assert geodesics.path((1, 5), (2, 2)).tolist() == [[1, 5], [2, 2]]
    assert geodesics.path((1, 1), (1, 1)).tolist() == [[1, 1], [1, 1]]
    assert geodesics.lengths((1, 1), np.empty((0, 2))).shape == (0,)


def test_start_a_hair_from_a_bend() -> None:
    geodesics = GeodesicMap(L_ROOM)
    for hair in (1e-4, 1e-7, 1e-8, 3e-9, 1e-10, 1e-13):
        for p in ((2 + hair, 2), (2, 2 + hair), (2 - hair, 2 - hair), (2 + hair, 2 - hair)):
            for q in ((1, 5), (2, 5), (5, 1), (5, 2), (0, 0)):
                from_corner = float(np.hypot(q[0] - 2.0, q[1] - 2.0))
                assert geodesics.length(p, q) == pytest.approx(from_corner, abs=1.5 * hair + 1e-12)
                path = geodesics.path(p, q)
                assert polyline_length(path) == pytest.approx(geodesics.length(p, q), abs=1e-8)


def test_convex_room_has_no_bends() -> None:
    geodesics = GeodesicMap(Environment([(0, 0), (4, 0), (4, 3), (0, 3)]))
    assert geodesics.length((0, 0), (4, 3)) == 5.0
    assert geodesics.lengths((0, 0), [(4, 0), (0, 3)]).tolist() == [4.0, 3.0]


def test_point_in_a_wall_is_named() -> None:
    geodesics = GeodesicMap(L_ROOM)
    sentence = r"^\(4.000, 4.000\) m is not in the free space of the map 'L': move it away from the walls$"
    for ask in (
        lambda: geodesics.path((4, 4), (1, 1)),
        lambda: geodesics.length((1, 1), (4, 4)),
        lambda: geodesics.lengths((1, 1), [(1, 2), (4, 4)]),
        lambda: geodesics.lengths((4, 4), [(1, 2)]),
    ):
        with pytest.raises(NotInFreeSpace, match=sentence):
            ask()


@given(seed=st.integers(0, 10_000))
@settings(deadline=None, max_examples=20)
def test_nearest_point_agrees_with_shapely(seed: int) -> None:
    environment = environment_of(seed)
    geodesics = GeodesicMap(environment)
    rng = np.random.default_rng(seed)
    for point in rng.uniform(-3.0, 15.0, (20, 2)):
        found = geodesics.nearest(point)
        assert environment.contains(found).all()
        assert np.hypot(*(found - point)) == pytest.approx(environment.polygon.distance(shapely.Point(point)), abs=1e-9)
    inside = free_points(environment, 1, rng)[0]
    assert np.array_equal(geodesics.nearest(inside), inside)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_lengths_scale_with_the_map(scale: float) -> None:
    for seed in range(4):
        environment = environment_of(seed)
        points = free_points(environment, 8, np.random.default_rng(seed))
        expected = [GeodesicMap(environment).lengths(p, points) for p in points]
        offset = np.array([1e5, -1e5]) * min(scale, 1.0)
        moved = GeodesicMap(
            Environment(environment.outer * scale + offset, [hole * scale + offset for hole in environment.holes])
        )
        found = [moved.lengths(p, points * scale + offset) for p in points * scale + offset]
        assert np.array(found) / scale == pytest.approx(np.array(expected), rel=1e-7)
