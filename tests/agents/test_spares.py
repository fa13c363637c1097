"""Waiting places: behind the agent, apart from each other and from the relays."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest

from agents.spares import SETTLED_M, Waiting
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from protocol.messages import Point

RADIUS_M = 0.2
AGENT = (9.0, 2.0)
CHAIN = [(2.0, 9.0), (4.0, 4.0)]


@pytest.fixture
def waiting(corner: Environment) -> Waiting:
    free = corner.inflated(RADIUS_M)
    refuges = np.array([(x, y) for x in np.arange(0.5, 10.0, 1.0) for y in np.arange(0.5, 10.0, 1.0)])
    return Waiting(GeodesicMap(free), RADIUS_M, refuges[free.contains(refuges)])


def _spares(number: int) -> dict[str, Point]:
    return {f"robot{place}": (0.5 + 0.45 * place, 8.0) for place in range(number)}


def test_spares_queue_from_the_agent_to_the_base(waiting: Waiting, corner: Environment) -> None:
    places = waiting.places(AGENT, CHAIN, _spares(9), {})
    assert list(places) == list(_spares(9))
    assert corner.inflated(RADIUS_M).contains(list(places.values())).all()
    for one, other in combinations([AGENT, CHAIN[1], *places.values()], 2):
        assert math.dist(one, other) > waiting.pitch_m - 1e-5
    assert min(math.dist(AGENT, place) for place in places.values()) == pytest.approx(waiting.pitch_m)


def test_the_nearest_spare_gets_the_first_place(waiting: Waiting) -> None:
    spares = {"far": (1.0, 9.0), "near": (8.0, 1.0), "between": (4.0, 2.0)}
    places = waiting.places(AGENT, CHAIN, spares, {})
    order = sorted(spares, key=lambda name: math.dist(AGENT, places[name]))
    assert order == ["near", "between", "far"]


def test_a_spare_does_not_move_for_a_trifle(waiting: Waiting) -> None:
    spares = _spares(3)
    before = waiting.places(AGENT, CHAIN, spares, {})
    nudged = (AGENT[0] - 0.5 * SETTLED_M, AGENT[1])
    assert waiting.places(nudged, CHAIN, spares, before) == before
    moved = (AGENT[0] - 4 * SETTLED_M, AGENT[1])
    assert waiting.places(moved, CHAIN, spares, before) != before


def test_those_that_there_is_no_room_for_stay(waiting: Waiting) -> None:
    beside_the_base = (2.5, 9.0)
    spares = {f"robot{place}": (0.5 + 0.6 * place, 7.0) for place in range(4)}
    assert waiting.places(beside_the_base, CHAIN[:1], spares, {}) == spares
    sent = {name: (3.0, y) for name, y in zip(spares, (1.0, 2.0, 3.0, 4.0), strict=True)}
    assert waiting.places(beside_the_base, CHAIN[:1], spares, sent) == sent


@pytest.mark.parametrize("seed", range(10))
def test_all_places_are_apart(waiting: Waiting, corner: Environment, seed: int) -> None:
    """Wherever the spares are and were sent, even in one place: nobody is to stand where another or a relay stands."""
    chance = np.random.default_rng(seed)
    free = corner.inflated(RADIUS_M)
    drawn = chance.uniform(0.0, 10.0, (200, 2))
    places: list[Point] = [(x, y) for x, y in drawn[free.contains(drawn)].tolist()]
    agent, *rest = places
    relays, obstacles = [(2.0, 9.0), (4.0, 4.0), *rest[: seed % 2]], rest[2:4]
    spares = {f"robot{number}": relays[number % len(relays)] for number in range(5)}
    before = {name: rest[4 + number // 2] for number, name in enumerate(spares)} if seed % 3 else {}
    found = waiting.places(agent, relays, spares, before, obstacles)
    assert free.contains(list(found.values())).all()
    fixed = [*relays[1:], *obstacles]
    for place in found.values():
        assert all(math.dist(place, other) > waiting.apart_m - 1e-5 for other in fixed)
    for one, other in combinations(found.values(), 2):
        assert math.dist(one, other) > waiting.apart_m - 1e-5


def test_nobody_spare_asks_for_nothing(waiting: Waiting) -> None:
    assert waiting.places(AGENT, CHAIN, {}, {}) == {}
