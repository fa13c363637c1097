"""What ranges, sight and walls leave: never without the agent, and without what it cannot have walked to."""

from __future__ import annotations

import math
from copy import deepcopy

import numpy as np
import pytest
import shapely

import maps
from agents.recorder_estimate import hatch
from agents.sighted_set import Sight, SightedSet
from agents.target_set import MOST_CORNERS, describe
from agents.walkable_ground import WalkableGround, widened
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from protocol.messages import Point

OFFICE = Environment.load(maps.path("office"))
ROOM = OFFICE.inflated(0.2)
WALKS = GeodesicMap(ROOM)
SIGHT = Sight(OFFICE, ROOM)


def free_points(rng: np.random.Generator, count: int) -> np.ndarray:
    x0, y0, x1, y1 = ROOM.bounds
    points = rng.uniform((x0, y0), (x1, y1), (4 * count, 2))
    return points[ROOM.contains(points)][:count]


@pytest.mark.parametrize("seed", range(3))
def test_an_agent_that_walks_and_is_ranged_now_and_then_is_always_inside(seed: int) -> None:
    """Also while it is out of everybody's sight for long, and when it is seen again."""
    rng = np.random.default_rng(seed)
    way = WALKS.path(*free_points(rng, 2))
    anchors = free_points(rng, 12)
    held = SightedSet(SIGHT)
    lengths = np.append(0.0, np.cumsum(np.hypot(*np.diff(way, axis=0).T)))
    ranges = unseen = 0
    for walked_m in np.arange(0.0, lengths[-1], 0.25).tolist():
        agent = np.array([np.interp(walked_m, lengths, way[:, axis]) for axis in (0, 1)])
        held.predict(0.25)
        for anchor in rng.permutation(anchors)[:2]:
            if OFFICE.line_of_sight(anchor, agent) and rng.random() < 0.5:
                held.measure(anchor, float(np.hypot(*(anchor - agent))) + rng.uniform(-0.2, 0.2), 0.2)
                ranges += 1
        unseen += not any(OFFICE.line_of_sight(anchor, agent) for anchor in anchors)
        if held.region is not None:
            assert shapely.dwithin(held.region, shapely.Point(agent), 1e-6), f"seed {seed}, after {walked_m} m"
            assert shapely.covers(shapely.buffer(ROOM.polygon, 1e-6), held.region)
    assert ranges > 5


def test_what_is_reached_on_ways_is_no_less_and_hardly_more() -> None:
    """Against geodesics to a grid of points; straight across walls would be far more."""
    rng = np.random.default_rng(4)
    ground, start = WalkableGround(ROOM), free_points(rng, 1)[0]
    region: shapely.Geometry = shapely.Point(start)
    for _ in range(10):
        region = ground.walked(region, 0.5)
    goals = free_points(rng, 300)
    away = np.array([WALKS.length(start, goal) for goal in goals])
    inside = shapely.contains_xy(shapely.buffer(region, 1e-9), goals)
    assert inside[away <= 5.0].all() and not inside[away > 5.2].any()
    straight = shapely.intersection(widened(shapely.Point(start), 5.0), ROOM.polygon)
    assert region.area < straight.area


def test_the_mirror_image_behind_a_wall_goes_with_the_range() -> None:
    walled = Environment([(0, 0), (12, 0), (12, 4.9), (0.5, 4.9), (0.5, 5.1), (12, 5.1), (12, 10), (0, 10)])
    sight = Sight(walled, walled.inflated(0.1))
    held, agent = SightedSet(sight), (9.0, 4.0)
    for anchor in ((3.0, 4.7), (5.0, 4.7), (7.0, 4.7)):
        held.measure(anchor, math.dist(anchor, agent), 0.05)
    assert held.region is not None
    image = (9.0, 5.4)
    assert held.region.contains(shapely.Point(agent)) and not held.region.dwithin(shapely.Point(image), 0.3)


def test_copies_go_their_own_ways_and_equal_steps_come_to_the_same_set() -> None:
    held = SightedSet(SIGHT)
    held.measure((4.0, 11.0), 3.0, 0.2)
    twin = deepcopy(held)
    for one in (held, twin):
        one.predict(0.4)
        one.measure((5.0, 11.0), 2.5, 0.2)
    assert held.tight is twin.tight, "a step is computed once"
    held.predict(1.0)
    assert held.tight is not twin.tight and held.region.area > twin.region.area  # type: ignore[union-attr]


def regions() -> list[shapely.Geometry]:
    square = shapely.box(0.0, 0.0, 4.0, 3.0)
    return [
        square,
        shapely.Polygon(square.exterior, [shapely.box(1.0, 1.0, 2.0, 2.0).exterior.coords]),
        shapely.union(square, shapely.box(6.0, 0.0, 6.3, 5.0)),
        shapely.buffer(shapely.Point(3.0, 3.0), 2.0, quad_segs=64),
        shapely.Point(1.0, 2.0),
        shapely.box(0.0, 0.0, 0.01, 0.01),
    ]


@pytest.mark.parametrize("number", range(6))
def test_samples_are_in_the_set_and_near_all_of_it(number: int) -> None:
    region = regions()[number]
    found = describe(region, 1.0, 0.5)
    assert (found.time_s, found.newest_s, found.area_m2) == (1.0, 0.5, region.area)
    assert found.samples and len(found.samples) <= MOST_CORNERS + 60
    assert all(shapely.dwithin(region, shapely.Point(sample), 1e-9) for sample in found.samples)
    farthest = {sample: max(math.dist(sample, other) for other in found.samples) for sample in found.samples}
    assert farthest[found.center] == min(farthest.values())
    rng = np.random.default_rng(number)
    x0, y0, x1, y1 = region.bounds
    points = rng.uniform((x0, y0), (x1, y1), (400, 2))
    points = points[shapely.contains_xy(region, points)]
    if len(points):
        away = np.hypot(*(points[:, None] - np.array(found.samples)[None]).transpose(2, 0, 1)).min(axis=1)
        assert away.max() <= 1.5 * math.sqrt(region.area / 32) + 0.1


@pytest.mark.parametrize("number", range(4))
def test_hatches_cover_the_inside_and_nothing_else(number: int) -> None:
    region = regions()[number]
    lines: list[tuple[Point, Point]] = hatch(describe(region).rings)
    height = region.bounds[3] - region.bounds[1]
    length = sum(math.dist(*line) for line in lines)
    assert length * max(height / 40, 0.05) == pytest.approx(region.area, rel=0.06)
    inside = shapely.buffer(region, 0.02)
    assert all(shapely.covers(inside, shapely.LineString(line)) for line in lines)
    assert not hatch([])
