"""Chains in motion against the connected components of the visibility graph, ways against shapely's."""

from __future__ import annotations

import networkx as nx
import numpy as np
import pytest
import shapely

import maps
from planning.environment import Environment
from planning.foresight import chain_holds, length, walk


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
