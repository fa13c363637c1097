"""Chains in motion against the connected components of the visibility graph, ways against shapely's."""

from __future__ import annotations

import networkx as nx
import numpy as np
import pytest
import shapely

import maps
from planning.environment import Environment
from planning.foresight import chain_holds, distance, head, length, tail, walk


@pytest.mark.parametrize("name", ["office", "room1"])
def test_chain_holds_where_first_and_last_are_in_one_component(name: str) -> None:
    environment = Environment.load(maps.path(name))
    random = np.random.default_rng(7)
    free = environment.inflated(0.2)
    points = random.uniform(free.bounds[:2], free.bounds[2:], (4000, 2))
    points = points[free.contains(points)]
    for members in (2, 3, 6):
        tracks = points[: len(points) // members * members].reshape(-1, members, 2)[:60]
        expected = [
            nx.has_path(nx.from_numpy_array(environment.visibility_matrix(team)), 0, members - 1) for team in tracks
        ]
        assert chain_holds(environment, tracks).tolist() == expected
        assert len(set(expected)) == 2


def test_walking_is_interpolation_along_the_line() -> None:
    way = [(0.0, 0.0), (3.0, 0.0), (3.0, 0.0), (3.0, 4.0), (-1.0, 4.0)]
    line = shapely.LineString(way)
    lengths = np.array([0.0, 1.0, 3.0, 5.5, 7.0, 10.9, 11.0, 50.0])
    expected = shapely.get_coordinates(shapely.line_interpolate_point(line, lengths))
    np.testing.assert_allclose(walk(way, lengths), expected, atol=1e-12)
    assert length(way) == pytest.approx(line.length)


def test_a_way_of_one_point_is_a_place() -> None:
    np.testing.assert_array_equal(walk([(2.0, 1.0)], np.array([0.0, 3.0])), [(2.0, 1.0), (2.0, 1.0)])
    assert length([(2.0, 1.0)]) == 0.0


@pytest.mark.parametrize("seed", range(5))
def test_parts_and_distances_are_those_of_shapely(seed: int) -> None:
    chance = np.random.default_rng(seed)
    way, places = chance.uniform(0.0, 10.0, (5, 2)), chance.uniform(0.0, 10.0, (7, 2))
    line = shapely.LineString(way)
    for cut in (0.0, 0.3 * line.length, line.length, 2.0 * line.length):
        first, rest = head(way, cut), tail(way, cut)
        assert length(first) == pytest.approx(min(cut, line.length))
        assert length(first) + length(rest) == pytest.approx(line.length)
        assert first[-1] == pytest.approx(rest[0])
        assert (first[0], rest[-1]) == (pytest.approx(way[0]), pytest.approx(way[-1]))
    assert distance(way, places) == pytest.approx(line.distance(shapely.MultiPoint(places)))
    assert distance(way[:1], places) == pytest.approx(shapely.Point(way[0]).distance(shapely.MultiPoint(places)))
    assert distance(way, []) == np.inf
