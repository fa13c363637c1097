from __future__ import annotations

import numpy as np
import pytest
import shapely

import maps
from planning.decomposition import Kind, decompose
from planning.environment import Environment
from tests.planning.polygons import environment_of, free_points, wall_points


@pytest.mark.parametrize("kind", ["inflection", "aspect"])
@pytest.mark.parametrize("name", ["room3", "maze", "office"])
def test_random_points_lie_in_the_cell_that_is_named(name: str, kind: Kind) -> None:
    environment = Environment.load(maps.path(name))
    cells = decompose(environment, kind)
    rng = np.random.default_rng(7)
    low, high = environment.bounds[:2], environment.bounds[2:]
    points = rng.uniform(np.subtract(low, 1.0), np.add(high, 1.0), (5000, 2))
    found = cells.locate(points)
    assert found.dtype == np.int64
    np.testing.assert_array_equal(found >= 0, shapely.contains_xy(environment.polygon, points))
    inside = found >= 0
    polygons = np.array([shapely.Polygon(polygon) for polygon in cells.polygons])
    assert shapely.contains_xy(polygons[found[inside]], points[inside]).all()


@pytest.mark.parametrize("seed", range(6))
def test_borders_belong_to_a_cell_that_touches_them(seed: int) -> None:
    environment = environment_of(seed)
    cells = decompose(environment, "aspect")
    rng = np.random.default_rng(seed)
    points = np.concatenate([cells.corners, wall_points(environment, 300, rng), free_points(environment, 300, rng)])
    found = cells.locate(points)
    assert (found >= 0).all()
    polygons = np.array([shapely.Polygon(polygon) for polygon in cells.polygons])
    distances = shapely.distance(polygons[found], shapely.points(points))
    assert (distances <= 2.0 * environment.tolerance_m).all()
    np.testing.assert_array_equal(cells.locate(points[::-1]), found[::-1])


@pytest.mark.parametrize("seed", range(4))
def test_centroids_lie_in_their_cells_wherever_the_map_is(seed: int) -> None:
    drawn = environment_of(seed)
    outer, *holes = (ring * 0.5 + (1e5, -2e5) for ring in drawn.rings)
    for environment in (drawn, Environment(outer, holes, drawn.name)):
        cells = decompose(environment, "aspect")
        wide = cells.areas > 1e-9 * environment.area
        np.testing.assert_array_equal(cells.locate(cells.centroids)[wide], np.flatnonzero(wide))


def test_points_beyond_the_tolerance_are_outside() -> None:
    room = Environment([(0, 0), (10, 0), (10, 10), (0, 10)], [[(4, 4), (6, 4), (6, 6), (4, 6)]])
    cells = decompose(room)
    near, far = 0.5 * room.tolerance_m, 4.0 * room.tolerance_m
    assert (cells.locate([(-near, 5), (10 + near, 3), (2, -near), (4 + near, 5)]) >= 0).all()
    assert (cells.locate([(-far, 5), (10 + far, 3), (2, -far), (4 + far, 5), (5, 5)]) == -1).all()


def test_points_that_are_no_places_are_outside() -> None:
    cells = decompose(Environment([(0, 0), (10, 0), (10, 10), (0, 10)]))
    assert cells.locate([(np.nan, 1), (1, np.inf), (-np.inf, 0), (1e300, 1e300)]).tolist() == [-1, -1, -1, -1]
    assert cells.locate(np.empty((0, 2))).shape == (0,)
    assert cells.locate((5, 5)).tolist() == [0]
