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

from agents.outlook import Outlook
from agents.spares import Waiting
from planning.chain import cheapest_chain
from planning.decomposition import Kind, decompose
from planning.deployment import NO_CHAIN, NoChain, identify_robots, relays_needed
from planning.edge_weights import virtual_weights
from planning.environment import Environment
from planning.foresight import length, walk
from planning.geodesic import GeodesicMap
from planning.mutual_visibility import mutual_visibility
from planning.placement import reachable_positions
from planning.shortest_paths import from_source, path
from protocol.messages import Placement, Point

Floats = NDArray[np.float64]

PREVIEWS_M: Final = (0.0, 1.5, 4.0, 8.0, 16.0)
"""How far ahead on the agent's path the proposed chains reach."""

METRES_PER_WEIGHT: Final = 3.0
"""A virtual weight of 1 is worth so many metres of driving."""

RELAY_M: Final = 1.5
"""So many metres are driven rather than one relay more is used, besides what its link costs."""

LATENESS: Final = 3.0
"""A metre that a robot drives while the agent is already where it needs it counts so many times more."""

KEEPING_S: Final = 0.3
"""Another proposal than the standing chain must be worth so many seconds more."""

MOST_CELLS: Final = 6000
"""More cells take too much memory, and minutes of preparation."""


class TooManyCells(ValueError):
    """The decomposition of this map is too fine to plan on; the text says how fine, and the remedy."""


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
        TooManyCells: the map has more than :data:`MOST_CELLS`.
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
        if len(self._cells) > MOST_CELLS:
            raise TooManyCells(
                f"map {environment.name!r} has {len(self._cells)} {decomposition} cells, and at most {MOST_CELLS} "
                "can be planned on: "
                + ("use inflection cells" if decomposition == "aspect" else "simplify it, a grid by a larger tolerance")
            )
        seen = mutual_visibility(self._cells)
        self._weights = virtual_weights(self._cells, seen)
        self._positions = reachable_positions(self._cells, free)
        self._placeable = ~np.isnan(self._positions[:, 0])
        self._places = np.flatnonzero(self._placeable)
        self._links = np.ascontiguousarray(METRES_PER_WEIGHT * self._weights[np.ix_(self._places, self._places)])
        self._base_cell = self._locate(base)
        self._driven: dict[Point, Floats] = {}
        self._needed = relays_needed(self._weights, self._base_cell, self._placeable)
        hops_first = virtual_weights(self._cells, seen, robot_penalty="fewest")
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
            waiting = tuple(Placement(robot=name, position=place, spare=True) for name, place in robots.items())
            return Plan(waiting, (), 0.0, 0, False, f"{problem}: everybody waits")
        way = np.array([agent, *agent_path], dtype=np.float64)
        robots = {name: self._inside(place) for name, place in robots.items()}
        standing = self._standing(way, robots, previous)
        new = self._chains(way, robots, previous) or [self._outward(agent, robots, needed)]
        chosen = self._best(standing, new, way, robots)
        return self._complete(chosen, way, robots, needed, previous)

    def _standing(self, way: Floats, robots: Mapping[str, Point], previous: Plan | None) -> Proposal | None:
        """The chain of the previous plan, if it was one and all its relays are still there."""
        if previous is None or not previous.serves:
            return None
        relays = tuple(place for place in previous.placements if not place.spare)
        if any(relay.robot not in robots for relay in relays):
            return None
        last = relays[-1].position if relays else self._base
        ahead = walk(way, np.linspace(0.0, PREVIEWS_M[-1], 33))
        serves = bool(np.any(self._environment.line_of_sight(np.array(last), ahead)))
        reason = previous.reason if serves else f"{_relays(len(relays))} kept, seeing nothing of the agent's way"
        return Proposal(relays, previous.cost, serves, reason)

    def _chains(self, way: Floats, robots: Mapping[str, Point], previous: Plan | None) -> list[Proposal]:
        """New chains, one for each preview that the robots suffice for."""
        order = self._order(way[0], robots, previous)
        # Robots that stand where they stood need not be asked again.
        places = self._positions[self._places]
        self._driven = {
            here: self._driven[here] if here in self._driven else self._estimates.lengths(here, places)
            for here in robots.values()
        }
        drive = np.array([self._driven[robots[name]] for name in order]).reshape(len(order), len(self._places))
        whole = length(way)
        found = (self._chain(way, preview, order, drive) for preview in sorted({min(m, whole) for m in PREVIEWS_M}))
        return [proposal for proposal in found if proposal is not None]

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
            chain = cheapest_chain(self._links, move, from_base, to_agent, RELAY_M)
            if chain is not None:
                stops = [int(self._places[cell]) for cell in chain.cells]
                robots = identify_robots(move[:, chain.cells])
                relays = tuple(self._placement(order[robot], stop) for robot, stop in zip(robots, stops, strict=True))
                cost = float(sum(self._weights[hop] for hop in pairwise([self._base_cell, *stops, goal])))
                return Proposal(relays, cost, True, f"{_relays(len(relays))} {where}")
        return None

    def _outward(self, agent: Point, robots: Mapping[str, Point], needed: int) -> Proposal:
        """Too few robots: those that there are man the chain of fewest relays from the base outward."""
        places = path(self._tree, self._base_cell, self._locate(agent))[1:-1][: len(robots)]
        names = list(robots)
        costs = np.array([self._geodesics.lengths(robots[name], self._positions[places]) for name in names])
        chosen = identify_robots(costs.reshape(len(names), len(places)))
        relays = tuple(self._placement(names[robot], place) for robot, place in zip(chosen, places, strict=True))
        missing = needed - len(relays)
        reason = f"{_relays(needed)} needed and {missing} missing: the chain ends before the agent"
        return Proposal(relays, 0.0, False, reason)

    def _best(
        self, standing: Proposal | None, new: list[Proposal], way: Floats, robots: Mapping[str, Point]
    ) -> Proposal:
        """The proposal that is worth most, the standing chain when in doubt."""
        outlook = Outlook(
            self._environment, self._geodesics, self._base, way, robots,
            agent_speed_m_s=self._agent_speed_m_s, robot_speed_m_s=self._robot_speed_m_s,
            distance_m=self._waiting.pitch_m,
        )  # fmt: skip
        different = {proposal.relays: proposal for proposal in reversed(new)}
        worth = {relays: outlook.worth(relays) for relays in different}
        best = max(worth, key=lambda relays: worth[relays])
        if standing is None or worth[best] > outlook.worth(standing.relays) + KEEPING_S:
            return different[best]
        return standing

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

    def _order(self, agent: Floats, robots: Mapping[str, Point], previous: Plan | None) -> list[str]:
        """The relays of the previous plan from the base outward, then the others, nearest to the agent last."""
        before = () if previous is None else previous.placements
        standing = [place.robot for place in before if place.robot in robots and not place.spare]
        others = [name for name in robots if name not in standing]
        return [*standing, *sorted(others, key=lambda name: -math.dist(robots[name], agent))]

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


def _relays(number: int) -> str:
    return f"{number} relay{'' if number == 1 else 's'}"
