"""The region in sight of a place, against lines of sight to points."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

import maps
from planning.environment import Environment
from planning.visible_region import visible_region


@pytest.mark.parametrize("name", ["office", "room3", "maze", "l457"])
def test_holds_exactly_the_points_in_line_of_sight(name: str) -> None:
    environment = Environment.load(maps.path(name))
    rng = np.random.default_rng(7)
    x0, y0, x1, y1 = environment.bounds
    points = rng.uniform((x0, y0), (x1, y1), (1500, 2))
    points = points[environment.contains(points)]
    # Corners are where sight changes; places on walls see along them.
    places = [*points[:12], *environment.vertices[:6], *environment.walls[:4].mean(axis=1)]
    for place in places:
        region = visible_region(environment, (float(place[0]), float(place[1])))
        assert region.is_valid and shapely.covers(shapely.buffer(environment.polygon, 1e-6), region)
        seen = np.asarray(environment.line_of_sight(place, points))
        clear = shapely.distance(region.boundary, shapely.points(points)) > 1e-6
        assert (shapely.contains_xy(region, points)[clear] == seen[clear]).all(), f"seen from {place}"
        assert seen.any() and not seen.all()


def test_a_convex_room_is_all_in_sight() -> None:
    room = Environment([(0, 0), (4, 0), (5, 3), (0, 3)])
    assert shapely.symmetric_difference(visible_region(room, (1.0, 1.0)), room.polygon).area < 1e-9
    assert visible_region(room, (0.0, 0.0)).area == pytest.approx(room.area)
