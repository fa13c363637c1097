"""Where an independent agent may go, against shortest ways one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from agents.roaming import GROWTHS_M, PITCH_M, REACH_S, WAYS, Roaming, in_words, thin
from agents.target_set import TargetSet
from planning.environment import Environment
from planning.foresight import length
from planning.geodesic import GeodesicMap
from protocol.messages import Point

SPEED_M_S = 0.9
HOME = (1.0, 1.0)

HALL = Environment([(0, 0), (20, 0), (20, 4), (12, 4), (12, 12), (8, 12), (8, 4), (0, 4)], name="hall")
"""A corridor of 20 m, 4 m wide, with a room up in the middle."""


@pytest.fixture(scope="module")
def geodesics() -> GeodesicMap:
    return GeodesicMap(HALL.inflated(0.2))


@pytest.fixture(scope="module")
def roaming(geodesics: GeodesicMap) -> Roaming:
    return Roaming(geodesics, SPEED_M_S, HOME)


def disc(center: Point, radius_m: float) -> TargetSet:
    turns = np.arange(12) * math.pi / 6
    rim = np.array(center) + radius_m * np.column_stack([np.cos(turns), np.sin(turns)])
    samples = (center, *((float(x), float(y)) for x, y in rim))
    return TargetSet(0.0, center, samples, (), math.pi * radius_m**2, 0.0)


@pytest.mark.parametrize("lead_s", [0.0, 0.5])
def test_the_set_grows_by_shortest_ways(roaming: Roaming, geodesics: GeodesicMap, lead_s: float) -> None:
    target = disc((13.0, 2.0), 0.5)
    found = roaming.whereabouts(target, (0.0, 0.0), lead_s)
    now = found.aims[0]
    assert now.ahead_m == 0.0
    for aim, growth_m in zip(found.aims[1:], GROWTHS_M, strict=False):
        assert aim.ahead_m == growth_m
        assert aim.shares.sum() == pytest.approx(1.0)
        reached = {tuple(place) for place in aim.places.tolist()}
        for node in roaming._nodes.tolist():
            away_m = min(geodesics.length(sample, node) for sample in target.samples)
            if tuple(node) in reached:
                assert away_m <= growth_m + lead_s * SPEED_M_S + PITCH_M
            else:
                assert away_m > growth_m + lead_s * SPEED_M_S - PITCH_M


@pytest.mark.parametrize("lead_s", [0.0, 0.5])
def test_ways_begin_where_the_agent_may_be_and_are_in_free_space(
    roaming: Roaming, geodesics: GeodesicMap, lead_s: float
) -> None:
    target = disc((10.0, 5.0), 0.4)
    found = roaming.whereabouts(target, (0.0, 0.0), lead_s)
    assert found.chances.sum() == pytest.approx(1.0)
    assert len(found.chances) == len(found.ways) > WAYS / 2
    for way in found.ways:
        assert geodesics.environment.contains(way).all()
        away_m = min(geodesics.length(sample, way[0]) for sample in target.samples)
        assert away_m <= lead_s * SPEED_M_S + 1e-6
        assert length(way) <= REACH_S * SPEED_M_S + 1e-6
    # Somebody in the door between room and corridor can go three ways.
    ends = np.array([way[-1] for way in found.ways])
    assert min(ends[:, 0]) < 5.0
    assert max(ends[:, 0]) > 15.0
    assert max(ends[:, 1]) > 10.0


def test_who_walks_mostly_walks_on(roaming: Roaming) -> None:
    target = disc((10.0, 2.0), 0.3)
    for drift in ((0.9, 0.0), (9.0, 0.0), (-0.9, 0.0)):
        found = roaming.whereabouts(target, drift, 0.5)
        along = np.array([(way[-1] - way[0]) @ np.array(drift) for way in found.ways])
        assert found.chances[along > 1.0].sum() > 4.0 * found.chances[along < -1.0].sum()
        # No more than it can walk is added to where it is.
        assert found.center == pytest.approx((10.0 + math.copysign(0.45, drift[0]), 2.0))


def test_of_an_agent_never_measured_the_whole_map_is_to_be_seen(roaming: Roaming) -> None:
    found = roaming.whereabouts(None, (0.0, 0.0), 0.5)
    (aim,) = found.aims
    assert found.center == HOME
    for corner in ((0.2, 0.2), (19.8, 3.8), (8.2, 11.8)):
        assert np.hypot(*(aim.places - corner).T).min() < 1.5
    assert "nothing is known" in aim.part


def test_samples_in_walls_count_where_the_agent_can_be(roaming: Roaming, geodesics: GeodesicMap) -> None:
    found = roaming.whereabouts(disc((0.1, 0.1), 0.3), (0.0, 0.0), 0.0)
    assert geodesics.environment.contains(found.aims[0].places).all()


@pytest.mark.parametrize("seed", range(5))
def test_thinned_points_are_apart_and_near_to_all(seed: int) -> None:
    points = np.random.default_rng(seed).uniform(0.0, 3.0, (60, 2))
    chosen = thin(points, 60, 0.5)
    gaps = np.hypot(*(chosen[:, None] - chosen).transpose(2, 0, 1))
    assert gaps[~np.eye(len(chosen), dtype=bool)].min() > 0.5
    assert np.hypot(*(points[:, None] - chosen).transpose(2, 0, 1)).min(axis=1).max() <= 0.5
    assert len(thin(points, 7)) == 7


def test_areas_in_words() -> None:
    assert [in_words(area) for area in (0.2468, 3.21, 321.4)] == ["0.25 m²", "3.2 m²", "321 m²"]
