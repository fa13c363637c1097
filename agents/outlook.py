"""What becomes of a proposal: everybody's way for the next seconds, and how long the chain holds on it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.environment import Environment
from planning.foresight import chain_holds, length, walk
from planning.geodesic import GeodesicMap
from protocol.messages import Placement, Point

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

FORESIGHT_S: Final = 16.0
STEP_S: Final = 0.4
"""Ways are followed so far, in such steps."""

FADING_S: Final = 4.0
"""A chain that holds so much later counts 1/e: there will be other plans before."""

LEFT: Final = math.exp(-FORESIGHT_S / FADING_S)
"""What a second counts after the last step."""

HOPELESS_S: Final = 30.0
"""A chain that is broken at the end and not on its way to be closed counts as broken for so long after it."""

SPARE_S: Final = 0.1
"""One relay fewer is worth as much as a chain for so many seconds."""


class Prospect:
    """How long base and agent will be joined, for an agent on its announced way.

    Args:
        environment: the map as drawn.
        way: (m, 2) float, metres: the agent's, from where it is to where it will stop.
        agent_speed_m_s: along ``way``.
    """

    def __init__(self, environment: Environment, way: Floats, agent_speed_m_s: float) -> None:
        self._environment = environment
        self.times_s = np.arange(STEP_S, FORESIGHT_S + STEP_S / 2, STEP_S)
        """(t,) float, seconds from now on: those that are looked at."""
        self._agent = walk(way, self.times_s * agent_speed_m_s)

    def holds(self, team: Floats) -> Bools:
        """At which times the chain holds (t,) for a team that is there (t, k, 2), metres, the base station first."""
        return chain_holds(self._environment, np.concatenate((team, self._agent[:, None]), axis=1))

    def holds_at_last(self, team: Sequence[Point]) -> bool:
        """Whether it holds for a team that stands at these places, the base station first, at the last of the times."""
        return bool(chain_holds(self._environment, np.array([[*team, self._agent[-1]]]))[0])

    def value(self, holds: Bools) -> float:
        """Seconds of a chain that holds at these times, later ones counted less."""
        return STEP_S * float(np.exp(-self.times_s[holds] / FADING_S).sum())

    def worth(self, team: Floats) -> float:
        """The same of a team that is there (t, k, 2); a chain that is broken at last stays so for long."""
        holds = self.holds(team)
        return self.value(holds) - LEFT * HOPELESS_S * (not holds[-1])


class Outlook:
    """The next seconds of one moment: agent and robots where they are, the agent on its announced path.

    Args:
        environment: the map as drawn.
        geodesics: shortest paths of the robots.
        base: where the base station stands.
        way: (m, 2) float, metres: the agent's, from where it is to where it will stop.
        robots: where they are, in free space.
        agent_speed_m_s: along ``way``.
        robot_speed_m_s: along geodesics.
        distance_m: what spares keep from the agent.
    """

    def __init__(
        self,
        environment: Environment,
        geodesics: GeodesicMap,
        base: Point,
        way: Floats,
        robots: Mapping[str, Point],
        *,
        agent_speed_m_s: float,
        robot_speed_m_s: float,
        distance_m: float,
    ) -> None:
        self._prospect = Prospect(environment, way, agent_speed_m_s)
        self._geodesics, self._base, self._robots = geodesics, base, robots
        self._way, self._walked_m = way, np.minimum(self._prospect.times_s * agent_speed_m_s, length(way))
        self._driven_m = self._prospect.times_s * robot_speed_m_s
        self._robot_speed_m_s, self._distance_m = robot_speed_m_s, distance_m
        self._ways: dict[tuple[str, Point], Floats] = {}
        self._following: dict[str, Floats] = {}

    def worth(self, relays: Sequence[Placement]) -> float:
        """What it is worth to send these relays, in seconds of a chain that holds.

        Relays drive to their places, all others follow the agent.

        Complexity: one geodesic for each robot and place not asked for before; O(t k² w) for t steps.
        """
        places = {relay.robot: relay.position for relay in relays}
        tracks = [
            self._follow(name) if name not in places else walk(self._to(name, places[name]), self._driven_m)
            for name in self._robots
        ]
        base = np.broadcast_to(np.array(self._base), (len(self._driven_m), 2))
        holds = self._prospect.holds(np.stack([base, *tracks], axis=1))
        worth = self._prospect.value(holds) - SPARE_S * len(relays)
        if not holds[-1]:
            worth -= LEFT * self._broken_after_s(places)
        return worth

    def _broken_after_s(self, places: Mapping[str, Point]) -> float:
        """How long after the last step the chain stays broken."""
        if not self._prospect.holds_at_last([self._base, *places.values()]):
            return HOPELESS_S
        farthest_m = max((length(self._to(name, place)) for name, place in places.items()), default=0.0)
        return min(max(farthest_m / self._robot_speed_m_s - FORESIGHT_S, 0.0), HOPELESS_S)

    def _to(self, name: str, place: Point) -> Floats:
        if (name, place) not in self._ways:
            self._ways[name, place] = self._geodesics.path(self._robots[name], place)
        return self._ways[name, place]

    def _follow(self, name: str) -> Floats:
        """A spare's track: to where the agent is, then after it, at a distance."""
        if name not in self._following:
            here = self._geodesics.nearest(self._way[0])
            to_agent = self._geodesics.path(self._robots[name], here)
            behind_m = length(to_agent) + self._walked_m - self._distance_m
            way = np.concatenate((to_agent, self._way[1:]))
            self._following[name] = walk(way, np.clip(behind_m, 0.0, self._driven_m))
        return self._following[name]
