"""Reachable positions against one shapely intersection per cell, and what standing there is good for."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

import maps
from planning.decomposition import Cells, decompose
from planning.environment import Environment
from planning.mutual_visibility import mutual_visibility
from planning.placement import reachable_positions

TOUCHING_M = 1e-6


def _cells(name: str) -> Cells:
    return decompose(Environment.load(maps.path(name)), "inflection")


@pytest.mark.parametrize(("name", "radius_m"), [("room1", 0.3), ("office", 0.2), ("office", 0.45), ("cityblocks", 0.3)])
def test_position_is_the_reachable_point_nearest_to_the_centroid(name: str, radius_m: float) -> None:
    cells = _cells(name)
    free = cells.environment.inflated(radius_m)
    positions = reachable_positions(cells, free)
    assert positions.shape == cells.centroids.shape
    for polygon, centroid, position in zip(cells.polygons, cells.centroids, positions, strict=True):
        cell = shapely.Polygon(polygon)
        part = cell.intersection(free.polygon)
        if math.isnan(position[0]):
            # A cell that only touches the free space may count either way.
            assert part.area < TOUCHING_M
            continue
        point = shapely.Point(position)
        assert cell.distance(point) < TOUCHING_M
        assert shapely.distance(part, shapely.Point(centroid)) == pytest.approx(
            math.dist(centroid, position), abs=TOUCHING_M
        )
    reachable = ~np.isnan(positions[:, 0])
    assert free.contains(positions[reachable]).all()


def test_positions_of_cells_that_see_each_other_see_each_other() -> None:
    cells = _cells("cityblocks")
    positions = reachable_positions(cells, cells.environment.inflated(0.3))
    first, second = mutual_visibility(cells).nonzero()
    exist = ~np.isnan(positions[first, 0]) & ~np.isnan(positions[second, 0])
    assert np.all(cells.environment.line_of_sight(positions[first[exist]], positions[second[exist]]))


def test_a_cell_out_of_reach_is_no_placement() -> None:
    """A closet behind a gap of 0.4 m is no place for a disc of 0.3 m."""
    outline = [
        (0, 0),
        (4, 0),
        (4, 1.3),
        (4.2, 1.3),
        (4.2, 0),
        (6, 0),
        (6, 3),
        (4.2, 3),
        (4.2, 1.7),
        (4, 1.7),
        (4, 3),
        (0, 3),
    ]
    rooms = Environment(outline)
    cells = decompose(rooms, "inflection")
    free = rooms.inflated(0.3, containing=(1.0, 1.5))
    positions = reachable_positions(cells, free)
    beyond = cells.centroids[:, 0] > 4.1
    assert np.isnan(positions[beyond]).all()
    assert not np.isnan(positions[cells.centroids[:, 0] < 3.5]).any()


def test_without_a_radius_everybody_stands_at_the_centroid() -> None:
    cells = _cells("room1")
    np.testing.assert_array_equal(reachable_positions(cells, cells.environment), cells.centroids)
