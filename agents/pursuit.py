"""Robots that go where their ranges tell most about an independent agent, when the chain does not need them elsewhere.

The control law is that of :mod:`estimation.look_ahead`: of the places that a robot could go to, that one from which a
range is expected to leave least of the set. What is predicted is the set as it will be in a moment, grown by what the
agent can walk, after ranges from the last relays and from that place. So robots do not all measure along one line, from
which an agent and its mirror image cannot be told apart.

What that may cost the chain is nothing: relays stand where the chain wants them, and only spares pursue, so near to the
agent that they are there when the chain has to grow.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from agents.whereabouts import Whereabouts
from estimation.look_ahead import predict_shares
from planning.foresight import walk
from protocol.messages import Point

if TYPE_CHECKING:
    from planning.environment import Environment
    from planning.geodesic import GeodesicMap

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

PURSUERS: Final = 2
"""So many spares, those nearest to the agent."""

NEAR_M: Final = (1.2, 2.2)
DIRECTIONS: Final = 12
"""They go to places so far from the middle of where the agent may be, in so many directions."""

FAR_M: Final = 3.0
"""Or stay where they are, if that is no farther from it."""

AHEAD_S: Final = 1.0
"""The set is that of so long after the robots can set out."""

ANCHORS: Final = 2
"""Ranges of so many of the last relays count as certain."""

HALVING_M: Final = 3.0
"""To leave half as much of the set is worth driving so many metres."""

UNSEEN_M: Final = 8.0
"""To see nothing of the set is as bad as to drive so many metres."""

SETTLED_M: Final = 0.8
"""Another place than before must be better by so much."""


class Pursuit:
    """Chooses places for spares.

    Args:
        environment: the map as drawn.
        geodesics: shortest paths of the robots.
        apart_m: least distance between the places of two robots.
        agent_speed_m_s: the most that the agent can go.
        bound_m: no range is wrong by more.
    """

    def __init__(
        self,
        environment: Environment,
        geodesics: GeodesicMap,
        *,
        apart_m: float,
        agent_speed_m_s: float,
        bound_m: float,
    ) -> None:
        self._environment, self._geodesics, self._apart_m = environment, geodesics, apart_m
        self._ahead_m, self._bound_m = AHEAD_S * agent_speed_m_s, bound_m
        turns = np.arange(DIRECTIONS) * (2.0 * math.pi / DIRECTIONS)
        self._ring = np.concatenate([near * np.column_stack([np.cos(turns), np.sin(turns)]) for near in NEAR_M])

    def places(
        self,
        agent: Whereabouts,
        relays: Sequence[Point],
        spares: Mapping[str, Point],
        before: Mapping[str, Point],
        obstacles: Sequence[Point] = (),
    ) -> dict[str, Point]:
        """Places for the spares nearest to the agent, one after the other, each given those before.

        Args:
            agent: where the agent may be.
            relays: base station and relays, from the base station outward.
            spares: where the spares are, in free space.
            before: where spares were sent last.
            obstacles: where nobody can stand.

        Complexity: O(c m²) for c places and m points of the set, and a geodesic for each place and robot.
        """
        points = np.concatenate([agent.aims[0].places, *(walk(way, np.array([self._ahead_m])) for way in agent.ways)])
        anchors = [np.array(relay) for relay in relays[-ANCHORS:] if self._sight(relay, points) > 0.5]
        taken = [*relays[1:], *obstacles]
        chosen: dict[str, Point] = {}
        nearest = sorted(spares, key=lambda name: self._geodesics.length(spares[name], agent.center))
        for name in nearest[:PURSUERS]:
            choice = self._choose(agent.center, points, anchors, spares[name], before.get(name), taken)
            if choice is None:
                break
            chosen[name] = choice
            taken.append(choice)
            anchors.append(np.array(choice))
        return chosen

    def _choose(
        self,
        center: Point,
        points: Floats,
        anchors: Sequence[Floats],
        robot: Point,
        before: Point | None,
        taken: Sequence[Point],
    ) -> Point | None:
        """The best place for one robot; None if there is none."""
        ring = np.array(center) + self._ring
        known = [place for place in (robot, before) if place is not None and math.dist(place, center) < FAR_M]
        places = np.concatenate([ring[self._geodesics.environment.contains(ring)], np.reshape(known, (-1, 2))])
        gaps = np.hypot(*(places[:, None] - np.reshape(taken, (-1, 2))).transpose(2, 0, 1))
        places = places[gaps.min(axis=1, initial=np.inf) > self._apart_m]
        if len(places) == 0:
            return None
        stops = np.stack([np.concatenate([np.reshape(anchors, (-1, 2)), place[None]]) for place in places])
        left = predict_shares(points, stops, self._bound_m, False)
        seen = np.array([self._sight(place, points) for place in places])
        costs_m = HALVING_M * seen * np.log2(left) + UNSEEN_M * (1.0 - seen)
        costs_m += self._geodesics.lengths(robot, places)
        if before is not None:
            costs_m -= SETTLED_M * (np.hypot(*(places - np.array(before)).T) == 0.0)
        x, y = places[int(np.argmin(costs_m))].tolist()
        return x, y

    def _sight(self, place: Point | Floats, points: Floats) -> float:
        """How much of the set a place sees."""
        return float(np.mean(self._environment.line_of_sight(np.array(place), points)))
