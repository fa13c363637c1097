"""Physical weights against what they are made from, one robot and place at a time."""

from __future__ import annotations

import math

import numpy as np
import pytest

import maps
from planning.adjacency_path import AdjacencyPaths
from planning.decomposition import decompose
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from planning.physical_weights import (
    adjacency_path_weights,
    arrival_times,
    bounded_weights,
    euclidean_weights,
    geodesic_weights,
)
from planning.placement import reachable_positions

OFFICE = Environment.load(maps.path("office"))
FREE = OFFICE.inflated(0.3)
CELLS = decompose(OFFICE, "inflection")
PLACES = reachable_positions(CELLS, FREE)
NOWHERE = np.isnan(PLACES[:, 0])


def test_the_map_has_places_that_no_robot_can_be_in() -> None:
    assert 0 < NOWHERE.sum() < len(PLACES)


def test_euclidean_weights_are_straight_distances() -> None:
    robots = PLACES[~NOWHERE][:3]
    weights = euclidean_weights(robots, PLACES)
    assert weights.shape == (3, len(PLACES))
    for row, robot in zip(weights, robots, strict=True):
        for weight, place in zip(row, PLACES, strict=True):
            assert weight == (np.inf if math.isnan(place[0]) else pytest.approx(math.dist(robot, place)))


def test_geodesic_weights_are_lengths_of_paths_where_there_are_any() -> None:
    geodesics = GeodesicMap(FREE)
    outside = np.array([FREE.bounds[0] - 5.0, 0.0])
    robots = np.array([PLACES[~NOWHERE][0], outside, PLACES[~NOWHERE][-1]])
    places = np.vstack([PLACES[::5], outside])
    weights = geodesic_weights(geodesics, robots, places)
    assert np.isinf(weights[1]).all()
    for robot in (0, 2):
        for weight, place in zip(weights[robot, :-1], places[:-1], strict=True):
            if math.isnan(place[0]):
                assert weight == np.inf
            else:
                assert weight == pytest.approx(geodesics.length(robots[robot], place))
    assert np.isinf(weights[:, -1]).all()
    assert geodesic_weights(geodesics, np.empty((0, 2)), places).shape == (0, len(places))


def test_straight_distances_are_never_longer_and_cell_paths_never_shorter_than_geodesics() -> None:
    """Between centroids, which a point reaches all of: both orders hold for every pair."""
    robots = CELLS.centroids[::30]
    straight = euclidean_weights(robots, CELLS.centroids)
    shortest = geodesic_weights(GeodesicMap(OFFICE), robots, CELLS.centroids)
    through = adjacency_path_weights(AdjacencyPaths(CELLS), robots)
    assert np.all(straight <= shortest + 1e-9)
    assert np.all(shortest <= through + 1e-9)


def test_adjacency_path_weights_count_from_the_cell_that_a_robot_is_in() -> None:
    paths = AdjacencyPaths(CELLS, FREE)
    start = int(np.flatnonzero(~NOWHERE)[4])
    corner = 0.9 * CELLS.polygons[start][0] + 0.1 * CELLS.centroids[start]
    robots = [CELLS.centroids[start], corner, (-100.0, 0.0)]
    weights = adjacency_path_weights(paths, robots)
    np.testing.assert_array_equal(weights[0], paths.lengths_from(start))
    np.testing.assert_array_equal(weights[1], weights[0])
    assert weights[0, start] == 0.0
    assert np.isinf(weights[:, NOWHERE]).all()
    assert np.isinf(weights[2]).all()


def test_too_late_is_never() -> None:
    lengths = np.array([[1.0, 2.0, 4.0], [3.0, np.inf, 0.5]])
    np.testing.assert_array_equal(arrival_times(lengths, 2.0), lengths / 2.0)
    times = arrival_times(lengths, np.array([[1.0], [0.5]]), deadline_s=np.array([1.0, 9.0, 3.0]))
    np.testing.assert_array_equal(times, [[1.0, 2.0, np.inf], [np.inf, np.inf, 1.0]])
    for speed in (0.0, np.nan, np.array([[1.0], [-1.0]])):
        with pytest.raises(ValueError, match="above 0 m/s"):
            arrival_times(lengths, speed)


def test_a_bound_on_motion_keeps_what_is_within() -> None:
    lengths = np.array([[1.0, 2.0], [3.0, np.inf]])
    np.testing.assert_array_equal(bounded_weights(lengths, 2.0), [[1.0, 2.0], [np.inf, np.inf]])
    np.testing.assert_array_equal(bounded_weights(lengths, [[1.0], [3.0]]), [[1.0, np.inf], [3.0, np.inf]])
