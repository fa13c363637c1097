"""What becomes of a proposal: everybody's way for the next seconds, and how long the chain holds on it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from agents.whereabouts import Whereabouts
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
    """How long base and agent will be joined, for an agent on any of its ways.

    Args:
        environment: the map as drawn.
        agent: where it may be and go, p ways.
        agent_speed_m_s: along them.
    """

    def __init__(self, environment: Environment, agent: Whereabouts, agent_speed_m_s: float) -> None:
        self._environment = environment
        self.times_s = np.arange(STEP_S, FORESIGHT_S + STEP_S / 2, STEP_S)
        """(t,) float, seconds from now on: those that are looked at."""
        self._chances = agent.chances
        self._agent = np.stack([walk(way, self.times_s * agent_speed_m_s) for way in agent.ways])

    def holds(self, team: Floats) -> Bools:
        """At which times the chain holds, (p, t), for a team that is there, the base station first.

        Args:
            team: (t, k, 2) or (p, t, k, 2) float, metres: whatever way the agent takes, or for each.
        """
        ways, times, _ = self._agent.shape
        everywhere = np.broadcast_to(team, (ways, *team.shape[-3:]))
        tracks = np.concatenate((everywhere, self._agent[:, :, None]), axis=2)
        return chain_holds(self._environment, tracks.reshape(ways * times, -1, 2)).reshape(ways, times)

    def holds_at_last(self, team: Sequence[Point]) -> Bools:
        """Whether it holds, (p,), for a team that stands at these places at the last of the times."""
        places = np.broadcast_to(np.array(team), (len(self._agent), len(team), 2))
        return chain_holds(self._environment, np.concatenate((places, self._agent[:, -1:]), axis=1))

    def value(self, holds: Bools) -> Floats:
        """Seconds of a chain that holds at these times (p, t), later ones counted less: (p,)."""
        return np.array([STEP_S * float(np.exp(-self.times_s[row] / FADING_S).sum()) for row in holds])

    def expect(self, worth_s: Floats) -> float:
        """What is worth so much on each way (p,), by their chances."""
        return float(self._chances @ worth_s)

    def worth(self, team: Floats) -> float:
        """Seconds of a chain that holds, for a team as in :meth:`holds`; broken at last, it stays so for long."""
        holds = self.holds(team)
        return self.expect(self.value(holds) - LEFT * HOPELESS_S * ~holds[:, -1])


class Outlook:
    """The next seconds of one moment: agent and robots where they are, the agent on its ways.

    Args:
        environment: the map as drawn.
        geodesics: shortest paths of the robots.
        base: where the base station stands.
        agent: where it may be and go.
        robots: where they are, in free space.
        agent_speed_m_s: along its way.
        robot_speed_m_s: along geodesics.
        distance_m: what spares keep from the agent.
    """

    def __init__(
        self,
        environment: Environment,
        geodesics: GeodesicMap,
        base: Point,
        agent: Whereabouts,
        robots: Mapping[str, Point],
        *,
        agent_speed_m_s: float,
        robot_speed_m_s: float,
        distance_m: float,
    ) -> None:
        self._prospect = Prospect(environment, agent, agent_speed_m_s)
        self._geodesics, self._base, self._robots = geodesics, base, robots
        self._here = geodesics.nearest(agent.center)
        walked_m = self._prospect.times_s * agent_speed_m_s
        self._walks = [(way, np.minimum(walked_m, length(way))) for way in agent.ways]
        self._driven_m = self._prospect.times_s * robot_speed_m_s
        self._robot_speed_m_s, self._distance_m = robot_speed_m_s, distance_m
        self._ways: dict[tuple[str, Point], Floats] = {}
        self._following: dict[str, Floats] = {}

    def worth(self, relays: Sequence[Placement]) -> float:
        """What it is worth to send these relays, in seconds of a chain that holds.

        Relays drive to their places, all others follow the agent, whatever way it takes.

        Complexity: one geodesic for each robot and place not asked for before; O(p t k² w) for t steps on p ways.
        """
        places = {relay.robot: relay.position for relay in relays}
        shape = (len(self._walks), len(self._driven_m), 2)
        tracks = [np.broadcast_to(np.array(self._base), shape)]
        for name in self._robots:
            if name in places:
                tracks.append(np.broadcast_to(walk(self._to(name, places[name]), self._driven_m), shape))
            else:
                tracks.append(self._follow(name))
        holds = self._prospect.holds(np.stack(tracks, axis=2))
        worth_s = self._prospect.value(holds) - SPARE_S * len(relays)
        broken = ~holds[:, -1]
        if broken.any():
            worth_s -= LEFT * np.where(broken, self._broken_after_s(places), 0.0)
        return self._prospect.expect(worth_s)

    def _broken_after_s(self, places: Mapping[str, Point]) -> Floats:
        """How long after the last step the chain stays broken, on each way."""
        farthest_m = max((length(self._to(name, place)) for name, place in places.items()), default=0.0)
        arrives_s = min(max(farthest_m / self._robot_speed_m_s - FORESIGHT_S, 0.0), HOPELESS_S)
        return np.where(self._prospect.holds_at_last([self._base, *places.values()]), arrives_s, HOPELESS_S)

    def _to(self, name: str, place: Point) -> Floats:
        if (name, place) not in self._ways:
            self._ways[name, place] = self._geodesics.path(self._robots[name], place)
        return self._ways[name, place]

    def _follow(self, name: str) -> Floats:
        """A spare's tracks (p, t, 2): to where the agent is, then after it, at a distance."""
        if name not in self._following:
            to_agent = self._geodesics.path(self._robots[name], self._here)
            apart_m = length(to_agent) - self._distance_m
            tracks = [
                walk(np.concatenate((to_agent, own[1:])), np.clip(apart_m + walked_m, 0.0, self._driven_m))
                for own, walked_m in self._walks
            ]
            self._following[name] = np.stack(tracks)
        return self._following[name]
