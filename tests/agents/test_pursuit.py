"""Spares that measure: where they tell images apart, out of everybody's way, and near to the agent."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest

from agents.pursuit import FAR_M, NEAR_M, PURSUERS, Pursuit
from agents.roaming import Roaming
from agents.target_set import TargetSet
from agents.whereabouts import Whereabouts
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from protocol.messages import Point

FIELD = Environment([(0, 0), (20, 0), (20, 12), (0, 12)], name="field")
BOUND_M = 0.2
APART_M = 0.5
FREE = GeodesicMap(FIELD.inflated(0.2))
PURSUIT = Pursuit(FIELD, FREE, apart_m=APART_M, agent_speed_m_s=0.9, bound_m=BOUND_M)
ROAMING = Roaming(FREE, 0.9, (1.0, 6.0))


def about(*centers: Point) -> Whereabouts:
    offsets = [(0.0, 0.0), (0.2, 0.0), (-0.2, 0.0), (0.0, 0.2), (0.0, -0.2)]
    samples = tuple((x + dx, y + dy) for x, y in centers for dx, dy in offsets)
    return ROAMING.whereabouts(TargetSet(0.0, centers[0], samples, (), 0.2, 0.0), (0.0, 0.0), 0.0)


def test_a_pursuer_tells_an_agent_from_its_mirror_image() -> None:
    """Relays on a line measure the same for both; from where the pursuer goes they differ by more than the noise."""
    images = ((12.0, 7.0), (12.0, 5.0))
    chain = [(1.0, 6.0), (5.0, 6.0), (9.0, 6.0)]
    for center in (images, images[::-1]):
        chosen = PURSUIT.places(about(*center), chain, {"robot1": (10.0, 6.0)}, {})
        place = chosen["robot1"]
        assert abs(math.dist(place, images[0]) - math.dist(place, images[1])) > 2 * BOUND_M
        for relay in chain:
            assert math.dist(relay, images[0]) == pytest.approx(math.dist(relay, images[1]))


@pytest.mark.parametrize("seed", range(6))
def test_pursuers_are_the_nearest_and_in_nobodys_way(seed: int) -> None:
    random = np.random.default_rng(seed)
    places: list[Point] = [(float(x), float(y)) for x, y in random.uniform((1, 1), (19, 11), (10, 2))]
    agent, chain, obstacles = about(places[0]), places[1:4], places[4:6]
    spares = {f"robot{number}": place for number, place in enumerate(places[6:], 1)}
    chosen = PURSUIT.places(agent, chain, spares, {}, obstacles)
    assert len(chosen) == PURSUERS
    ordered = sorted(spares, key=lambda name: math.dist(spares[name], agent.center))
    assert set(chosen) == set(ordered[:PURSUERS])
    for place in chosen.values():
        assert FREE.environment.contains([place])[0]
        assert min(NEAR_M) - 1e-9 < math.dist(place, agent.center) < FAR_M or place in spares.values()
        assert all(math.dist(place, other) > APART_M for other in (*chain[1:], *obstacles))
    for one, other in combinations(chosen.values(), 2):
        assert math.dist(one, other) > APART_M


def test_a_pursuer_stays_for_a_trifle_and_comes_from_afar() -> None:
    chain = [(1.0, 6.0), (9.0, 6.0)]
    first = PURSUIT.places(about((12.0, 7.0)), chain, {"robot1": (10.0, 6.5)}, {})
    again = PURSUIT.places(about((12.05, 7.0)), chain, first, first)
    assert again == first
    far = {"robot1": (2.0, 1.0)}
    assert math.dist(PURSUIT.places(about((12.0, 7.0)), chain, far, far)["robot1"], (12.0, 7.0)) < FAR_M


def test_nobody_is_sent_where_there_is_no_room() -> None:
    narrow = Environment([(0, 0), (12, 0), (12, 0.5), (0, 0.5)])
    free = GeodesicMap(narrow.inflated(0.2))
    pursuit = Pursuit(narrow, free, apart_m=3.0, agent_speed_m_s=0.9, bound_m=BOUND_M)
    roaming = Roaming(free, 0.9, (1.0, 0.25))
    target = TargetSet(0.0, (6.0, 0.25), ((6.0, 0.25),), (), 0.1, 0.0)
    agent = roaming.whereabouts(target, (0.0, 0.0), 0.0)
    assert pursuit.places(agent, [(1.0, 0.25), (5.5, 0.25)], {"robot1": (4.0, 0.25)}, {}) == {}
