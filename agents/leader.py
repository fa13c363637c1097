"""The leader's planner: which robots are relays, where they stand, and where the others wait.

The map is cut into cells, and the chain runs through cells that see each other (thesis §3.3). The thesis plans a chain
for where the agent is; by the time that the robots stand there the agent is elsewhere, and while they drive the chain
is broken. So this planner makes several proposals, follows each of them in thought along the announced path of the
agent, and takes the one under which the chain holds longest:

- the relays stay where they were sent before,
- the cheapest chain (thesis eq. 25–26, and what the robots have to drive) for where the agent is now, and for where it
  will be some metres farther on its path; the last relay is to see the whole piece, if any cell does.

Robots that are no relays are spares: they follow the agent at a distance, so that at the next corner the chain grows
by the robot that is there already.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from agents.spares import Waiting
from planning.chain import cheapest_chain
from planning.decomposition import Kind, decompose
from planning.deployment import NO_CHAIN, NoChain, identify_robots, relays_needed
from planning.edge_weights import virtual_weights
from planning.environment import Environment
from planning.foresight import chain_holds, walk
from planning.geodesic import GeodesicMap
from planning.mutual_visibility import mutual_visibility
from planning.placement import reachable_positions
from planning.shortest_paths import from_source, path
from protocol.messages import Placement, Point

Floats = NDArray[np.float64]

PREVIEWS_M: Final = (0.0, 1.5, 4.0, 8.0)
"""How far ahead on the agent's path the proposed chains reach."""

METRES_PER_WEIGHT: Final = 3.0
"""A virtual weight of 1 is worth so many metres of driving."""

LATENESS: Final = 3.0
"""A metre that a robot drives while the agent is already where it needs it counts so many times more."""

FORESIGHT_S: Final = 8.0
STEP_S: Final = 0.25
"""Proposals are followed so far, in such steps."""

KEEPING_S: Final = 0.3
"""Another proposal than the standing one must hold the chain so much longer."""

SPARE_S: Final = 0.1
"""Being one relay fewer is worth as much as so many seconds of a chain."""


@dataclass(frozen=True, slots=True)
class Plan:
    """Who stands where, and which links make the chain."""

    placements: tuple[Placement, ...]
    """Relays from the base station outward, then spares."""
    edges: tuple[tuple[str, str], ...]
    """From the base station over the relays to the agent; without the last link if robots are missing."""
    cost: float
    """Virtual cost of the chain (thesis eq. 25–26) for the agent's place that it was chosen for; 0 without a chain."""
    relays_needed: int
    """Fewest relays of a chain to the cell that the agent is in."""
    serves: bool
    """Whether the whole chain is manned."""
    reason: str


@dataclass(frozen=True, slots=True)
class Proposal:
    """Relays from the base outward, and what becomes of it."""

    relays: tuple[Placement, ...]
    cost: float
    complete: bool
    reason: str


class DeploymentPlanner:
    """Plans deployments between a fixed base station and one agent.

    Built once for a mission; every answer is a function of its arguments alone.

    Args:
        environment: the map as drawn; robots see through it.
        base: where the base station stands, metres, map frame.
        robot_radius_m: relays stand where a disc of this radius can be.
        decomposition: kind of cells.
        base_name: name of the base station in the plan's edges.
        agent_name: name of the agent.
        robot_speed_m_s: of the robots, for the look ahead.
        agent_speed_m_s: of the agent, likewise.

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
        robot_speed_m_s: float = 1.0,
        agent_speed_m_s: float = 1.0,
    ) -> None:
        self._environment, self._base, self._radius_m = environment, base, robot_radius_m
        self._base_name, self._agent_name = base_name, agent_name
        self._robot_speed_m_s, self._agent_speed_m_s = robot_speed_m_s, agent_speed_m_s
        free = environment.inflated(robot_radius_m, containing=base)
        self._geodesics = GeodesicMap(free)
        # What robots have to drive is judged by geodesics past bare walls: shorter by centimetres, and ten times
        # quicker than in the inflated map, where every corner has become an arc of many.
        self._estimates = GeodesicMap(environment)
        self._waiting = Waiting(self._geodesics, robot_radius_m)
        self._cells = decompose(environment, decomposition)
        self._weights = virtual_weights(self._cells, mutual_visibility(self._cells))
        self._positions = reachable_positions(self._cells, free)
        self._placeable = ~np.isnan(self._positions[:, 0])
        self._places = np.flatnonzero(self._placeable)
        self._links = np.ascontiguousarray(METRES_PER_WEIGHT * self._weights[np.ix_(self._places, self._places)])
        self._base_cell = self._locate(base)
        self._needed = relays_needed(self._weights, self._base_cell, self._placeable)
        # The tree of fewest relays: a penalty above all else makes hops count first.
        hops_first = self._weights + np.where(self._weights > 0, 2.0 * len(self._weights), 0.0)
        _, self._tree = from_source(hops_first, self._base_cell, self._placeable)

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
            previous: the plan before.

        Returns:
            A plan that gives each of ``robots`` exactly one place.

        Complexity: O(k N²) for each preview, k robots and N cells; then O(s k² w) for s steps and w walls.
        """
        try:
            needed = self.relays_needed(agent)
        except NoChain as problem:
            standing = tuple(Placement(robot=name, position=place, spare=True) for name, place in robots.items())
            return Plan(standing, (), 0.0, 0, False, f"{problem}: everybody waits")
        way = np.array([agent, *agent_path], dtype=np.float64)
        robots = {name: self._inside(place) for name, place in robots.items()}
        proposals = self._proposals(way, robots, previous)
        if not any(proposal.complete for proposal in proposals):
            proposals = [self._outward(agent, robots, needed)]
        chosen = self._best(proposals, way, robots)
        return self._complete(chosen, way, robots, needed, previous)

    def _proposals(self, way: Floats, robots: Mapping[str, Point], previous: Plan | None) -> list[Proposal]:
        """What could be done, the standing chain first."""
        proposals = []
        relays = () if previous is None else tuple(place for place in previous.placements if not place.spare)
        if previous is not None and previous.serves and all(relay.robot in robots for relay in relays):
            proposals.append(Proposal(relays, previous.cost, True, previous.reason))
        order = self._order(way[0], robots, relays)
        drive = np.array([self._drive(robots[name]) for name in order]).reshape(len(order), len(self._places))
        length = float(np.hypot(*np.diff(way, axis=0).T).sum())
        for preview in sorted({min(preview, length) for preview in PREVIEWS_M}):
            proposal = self._chain(way, preview, order, drive)
            if proposal is not None and all(proposal.relays != other.relays for other in proposals):
                proposals.append(proposal)
        return proposals

    def _chain(self, way: Floats, preview: float, order: list[str], drive: Floats) -> Proposal | None:
        """The cheapest chain for an agent that goes so far on its way; None if there are too few robots."""
        pieces = np.linspace(0.0, preview, 1 + math.ceil(preview / 0.5))
        cells = self._cells.locate(walk(way, pieces))
        cells = cells[cells >= 0]
        goal = int(cells[-1]) if len(cells) else self._base_cell
        where = f"for the agent in cell {goal}" + (f", {preview:.1f} m ahead" if preview > 0 else "")
        if np.all(np.isfinite(self._weights[self._base_cell, cells])):
            return Proposal((), float(self._weights[self._base_cell, goal]), True, f"no relay needed {where}")
        # The robots have until the agent is there.
        time = preview / self._agent_speed_m_s * self._robot_speed_m_s
        move = drive + LATENESS * np.maximum(0.0, drive - time)
        for covered in (cells, cells[-1:]):
            sees = np.isfinite(self._weights[np.ix_(covered, self._places)]).all(axis=0)
            to_agent = np.where(sees, METRES_PER_WEIGHT * self._weights[goal, self._places], np.inf)
            from_base = METRES_PER_WEIGHT * self._weights[self._base_cell, self._places]
            chain = cheapest_chain(self._links, move, from_base, to_agent, 0.5 * METRES_PER_WEIGHT)
            if chain is not None:
                relays = tuple(
                    self._placement(order[robot], self._places[cell])
                    for robot, cell in zip(chain.robots, chain.cells, strict=True)
                )
                hops = pairwise([self._base_cell, *(int(self._places[cell]) for cell in chain.cells), goal])
                cost = float(sum(self._weights[hop] for hop in hops))
                return Proposal(relays, cost, True, f"{len(relays)} relays {where}")
        return None

    def _outward(self, agent: Point, robots: Mapping[str, Point], needed: int) -> Proposal:
        """Too few robots: those that there are man the chain of fewest relays from the base outward."""
        places = path(self._tree, self._base_cell, self._locate(agent))[1:-1][: len(robots)]
        names = list(robots)
        costs = np.array([self._geodesics.lengths(robots[name], self._positions[places]) for name in names])
        chosen = identify_robots(costs.reshape(len(names), len(places)))
        relays = tuple(self._placement(names[robot], place) for robot, place in zip(chosen, places, strict=True))
        missing = needed - len(relays)
        reason = f"{needed} relays are needed and {missing} missing: the chain ends before the agent"
        return Proposal(relays, 0.0, False, reason)

    def _best(self, proposals: list[Proposal], way: Floats, robots: Mapping[str, Point]) -> Proposal:
        """The proposal under which the chain holds longest on the announced path."""
        if len(proposals) == 1:
            return proposals[0]
        times = np.arange(STEP_S, FORESIGHT_S + STEP_S / 2, STEP_S)
        agent = walk(way, times * self._agent_speed_m_s)
        ways: dict[tuple[str, Point], Floats] = {}
        behind = {
            name: np.concatenate((self._geodesics.path(place, self._inside(way[0])), way[1:]))
            for name, place in robots.items()
        }
        scores = []
        for number, proposal in enumerate(proposals):
            tracks = [np.broadcast_to(np.array(self._base), agent.shape)]
            relays = {relay.robot: relay for relay in proposal.relays}
            for name, place in robots.items():
                if name in relays:
                    key = name, relays[name].position
                    if key not in ways:
                        ways[key] = self._geodesics.path(place, key[1])
                    tracks.append(walk(ways[key], times * self._robot_speed_m_s))
                else:
                    tracks.append(self._following(behind[name], way, times))
            tracks.append(agent)
            held = STEP_S * chain_holds(self._environment, np.stack(tracks, axis=1)).sum()
            scores.append(held - SPARE_S * len(relays) + (KEEPING_S if number == 0 else 0.0))
        return proposals[int(np.argmax(scores))]

    def _following(self, route: Floats, way: Floats, times: Floats) -> Floats:
        """A spare's track behind the agent."""
        ahead = np.hypot(*np.diff(way, axis=0).T).sum()
        whole = np.hypot(*np.diff(route, axis=0).T).sum()
        agent_at = whole - ahead + np.minimum(times * self._agent_speed_m_s, ahead)
        return walk(
            route, np.clip(np.minimum(times * self._robot_speed_m_s, agent_at - self._waiting.pitch_m), 0.0, None)
        )

    def _complete(
        self, chosen: Proposal, way: Floats, robots: Mapping[str, Point], needed: int, previous: Plan | None
    ) -> Plan:
        relays = chosen.relays
        names = [self._base_name, *(relay.robot for relay in relays), *([self._agent_name] if chosen.complete else [])]
        manned = {relay.robot for relay in relays}
        spares = {name: place for name, place in robots.items() if name not in manned}
        before = (
            {} if previous is None else {place.robot: place.position for place in previous.placements if place.spare}
        )
        chain = [self._base, *(relay.position for relay in relays)]
        waiting = self._waiting.places(self._inside(way[0]), chain, spares, before)
        placements = tuple(Placement(robot=name, position=place, spare=True) for name, place in waiting.items())
        return Plan((*relays, *placements), tuple(pairwise(names)), chosen.cost, needed, chosen.complete, chosen.reason)

    def _order(self, agent: Floats, robots: Mapping[str, Point], relays: Sequence[Placement]) -> list[str]:
        """The relays of the standing chain from the base outward, then the others, nearest to the agent last."""
        standing = [relay.robot for relay in relays if relay.robot in robots]
        others = [name for name in robots if name not in standing]
        return [*standing, *sorted(others, key=lambda name: -math.dist(robots[name], agent))]

    def _drive(self, here: Point) -> Floats:
        return self._estimates.lengths(here, self._positions[self._places])

    def _placement(self, robot: str, cell: int) -> Placement:
        x, y = self._positions[cell]
        return Placement(robot=robot, position=(float(x), float(y)), cell=int(cell))

    def _inside(self, place: Point | Floats) -> Point:
        """The nearest place where a robot can be: the agent may be thinner, and positions are heard late."""
        x, y = self._geodesics.nearest(place)
        return float(x), float(y)

    def _locate(self, point: Point) -> int:
        cell = int(self._cells.locate([point])[0])
        if cell < 0:
            raise NoChain(f"{_name(point)} is outside the map")
        return cell


def _name(point: Point) -> str:
    return f"({point[0]:g}, {point[1]:g}) m"
