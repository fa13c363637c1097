"""The leader's planner: which robots are relays, where they stand, and where the others wait.

Built once for a mission; after that every answer is a pure function of where agent and robots are and of the plan
before. The map is cut into cells, and the chain runs through cells that see each other (thesis §3.3).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.decomposition import Kind, decompose
from planning.deployment import NO_CHAIN, NoChain, identify_robots, relays_needed
from planning.edge_weights import virtual_weights
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from planning.mutual_visibility import mutual_visibility
from planning.placement import reachable_positions
from planning.shortest_paths import from_source, path
from protocol.messages import Placement, Point

STAND_OFF_M: Final = 0.4
"""Free distance between the agent and the spare behind it, and between one spare and the next."""

PREVIEW_M: Final = 2.0
"""So much of the announced path a standing chain must cover to be kept."""


@dataclass(frozen=True, slots=True)
class Plan:
    """Who stands where, and which links make the chain."""

    placements: tuple[Placement, ...]
    """Relays from the base station outward, then spares."""
    edges: tuple[tuple[str, str], ...]
    """From the base station over the relays to the agent; without the last link if robots are missing."""
    cost: float
    """Virtual cost of the chain."""
    relays_needed: int
    """Fewest relays of a chain to the cell that the agent is in."""
    serves: bool
    """Whether the whole chain is manned."""
    reason: str


class DeploymentPlanner:
    """Plans deployments between a fixed base station and one agent.

    Args:
        environment: the map as drawn; robots see through it.
        base: where the base station stands, metres, map frame.
        robot_radius_m: relays stand where a disc of this radius can be.
        decomposition: kind of cells.
        base_name: name of the base station in the plan's edges.
        agent_name: name of the agent.

    Raises:
        NoChain: the base station is outside the map.
        ValueError: the map has no room for such robots around the base station.
    """

    def __init__(
        self,
        environment: Environment,
        base: Point,
        robot_radius_m: float,
        decomposition: Kind,
        *,
        base_name: str = "base",
        agent_name: str = "agent",
    ) -> None:
        self._environment = environment
        self._base_name, self._agent_name = base_name, agent_name
        self._base = base
        self._radius_m = robot_radius_m
        free = environment.inflated(robot_radius_m, containing=base)
        self._geodesics = GeodesicMap(free)
        self._cells = decompose(environment, decomposition)
        self._weights = virtual_weights(self._cells, mutual_visibility(self._cells), robot_penalty="fewest")
        self._positions = reachable_positions(self._cells, free)
        self._placeable = ~np.isnan(self._positions[:, 0])
        self._base_cell = self._locate(base)
        self._needed = relays_needed(self._weights, self._base_cell, self._placeable)
        self._distances, self._predecessors = from_source(self._weights, self._base_cell, self._placeable)

    def relays_needed(self, point: Point) -> int:
        """Fewest relays of a chain between the base station and an agent at this point.

        Raises:
            NoChain: the point is outside the map, or no chain reaches its cell.
        """
        needed = int(self._needed[self._locate(point)])
        if needed == NO_CHAIN:
            raise NoChain(f"no chain of relays with a radius of {self._radius_m:g} m reaches {_name(point)}")
        return needed

    def most_relays_needed(self) -> int:
        """Fewest relays that suffice for an agent anywhere a chain can reach."""
        return int(self._needed.max())

    def plan(
        self, agent: Point, agent_path: Sequence[Point], robots: Mapping[str, Point], previous: Plan | None
    ) -> Plan:
        """Decide where every robot goes.

        Args:
            agent: where the agent is, metres, map frame.
            agent_path: what is left of its way, from where it is on; empty if it stands or says nothing.
            robots: where the robots are that can be counted on.
            previous: the plan before, whose relays stay as long as they serve.

        Returns:
            A plan that gives each of ``robots`` exactly one place.
        """
        try:
            needed = self.relays_needed(agent)
        except NoChain as problem:
            return self._wait(robots, str(problem))
        kept = self._kept(agent, agent_path, robots, previous)
        if previous is not None and kept is not None and len(kept) <= needed:
            return self._complete(kept, agent, robots, previous.cost, needed, previous.reason)
        cell = self._locate(agent)
        places = path(self._predecessors, self._base_cell, cell)[1:-1]
        names = list(robots)
        manned = places[: len(names)]
        costs = np.array([[self._length(robots[name], self._positions[place]) for place in manned] for name in names])
        chosen = identify_robots(costs.reshape(len(names), len(manned)))
        relays = [
            Placement(robot=names[robot], position=self._point(place), cell=place)
            for robot, place in zip(chosen, manned, strict=True)
        ]
        missing = needed - len(relays)
        reason = f"{needed} relays for the agent in cell {cell}"
        if missing > 0:
            reason += f": {missing} robots are missing"
        return self._complete(relays, agent, robots, float(self._distances[cell]), needed, reason)

    def _kept(
        self, agent: Point, agent_path: Sequence[Point], robots: Mapping[str, Point], previous: Plan | None
    ) -> list[Placement] | None:
        """Relays of the previous plan, if they are all there and the last one sees where the agent goes."""
        if previous is None or not previous.serves:
            return None
        relays = [placement for placement in previous.placements if not placement.spare]
        if any(relay.robot not in robots for relay in relays):
            return None
        last = relays[-1].position if relays else self._base
        ahead = _sample(agent, agent_path, PREVIEW_M)
        return relays if np.all(self._environment.line_of_sight(np.array(last), ahead)) else None

    def _complete(
        self, relays: list[Placement], agent: Point, robots: Mapping[str, Point], cost: float, needed: int, reason: str
    ) -> Plan:
        manned = {relay.robot for relay in relays}
        serves = len(relays) >= needed
        names = [self._base_name, *(relay.robot for relay in relays), *([self._agent_name] if serves else [])]
        spares = self._spares(agent, relays, {name: robots[name] for name in robots if name not in manned})
        return Plan((*relays, *spares), tuple(pairwise(names)), cost, needed, serves, reason)

    def _spares(self, agent: Point, relays: list[Placement], spares: Mapping[str, Point]) -> list[Placement]:
        """Places behind the agent, on its geodesic from the last relay, nearest robot first."""
        last = relays[-1].position if relays else self._base
        way = self._geodesics.path(self._geodesics.nearest(agent), self._geodesics.nearest(last))
        order = sorted(spares, key=lambda name: self._length(spares[name], way[0]))
        pitch = 2 * self._radius_m + STAND_OFF_M
        return [
            Placement(robot=name, position=_along(way, pitch * place), spare=True)
            for place, name in enumerate(order, 1)
        ]

    def _wait(self, robots: Mapping[str, Point], reason: str) -> Plan:
        """No chain: everybody stays where it is."""
        placements = tuple(Placement(robot=name, position=place, spare=True) for name, place in robots.items())
        return Plan(placements, (), math.inf, 0, False, reason)

    def _locate(self, point: Point) -> int:
        cell = int(self._cells.locate([point])[0])
        if cell < 0:
            raise NoChain(f"{_name(point)} is outside the map")
        return cell

    def _length(self, here: Point, there: NDArray[np.float64]) -> float:
        return self._geodesics.length(self._geodesics.nearest(here), there)

    def _point(self, cell: int) -> Point:
        return float(self._positions[cell, 0]), float(self._positions[cell, 1])


def _sample(start: Point, way: Sequence[Point], length_m: float) -> NDArray[np.float64]:
    """Points every quarter of a metre on the first part of a way."""
    points = np.array([start, *way], dtype=np.float64)
    return np.array([_along(points, length) for length in np.arange(0.0, length_m + 0.125, 0.25)])


def _along(way: NDArray[np.float64], length_m: float) -> Point:
    """Point of a polyline after this length, or its end."""
    for start, end in pairwise(way):
        piece = math.dist(start, end)
        if length_m <= piece and piece > 0:
            x, y = start + (end - start) * (length_m / piece)
            return float(x), float(y)
        length_m -= piece
    return float(way[-1, 0]), float(way[-1, 1])


def _name(point: Point) -> str:
    return f"({point[0]:g}, {point[1]:g}) m"
