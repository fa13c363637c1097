"""The leader's planner: which robots are relays, where they stand, and where the others wait.

Relays stand at placements that see each other (thesis §3.3; :mod:`planning.placement_graph`). The thesis plans a chain
for where the agent is; by the time that the robots stand there the agent is elsewhere, and while they drive the chain
is broken. So this planner makes several proposals, follows each of them in thought along the ways that the agent may
take (:mod:`agents.whereabouts`), and takes the one under which the chain holds longest:

- the relays stay where they were sent before,
- the cheapest chain (:mod:`agents.proposals`) for where the agent may be now, and for where it may be some metres on.

Robots that are no relays are spares: they follow the agent at a distance, so that at the next corner the chain grows
by the robot that is there already. Around an agent that is only measured some of them spread out
(:mod:`agents.pursuit`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from agents.bidding import Bidder
from agents.lot import Bids, Lot
from agents.outlook import Outlook
from agents.proposals import Proposal, relays_in_words
from agents.pursuit import Pursuit
from agents.spares import Waiting
from agents.whereabouts import Whereabouts, name_place
from planning.compiled_map import CompiledMap
from planning.decomposition import Kind
from planning.deployment import NO_CHAIN, NoChain
from planning.environment import Environment
from planning.mutual_visibility import TooManyCells
from planning.redeployment import Search
from protocol.messages import Offer, Placement, Point

Floats = NDArray[np.float64]

PlacementKind: TypeAlias = Literal["cells", "points"]

KEEPING_S: Final = 0.3
"""Another proposal than the standing chain must be worth so many seconds more."""

MOST_TO_PLAN_ON: Final = 6000
"""More cells take gigabytes in the leader, and seconds a plan."""


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
    """Fewest relays of a chain to the agent."""
    serves: bool
    """Whether the whole chain is manned."""
    reason: str
    total_cost_m: float | None = None
    """With what the relays drove for it when it was chosen (:mod:`agents.proposals`); None without a chain."""
    lower_bound_m: float | None = None
    """No chain could have cost less that sees as much of the agent's way as ``reason`` says."""


class DeploymentPlanner:
    """Plans deployments between a fixed base station and one agent.

    Built once for a mission, of a compiled map; every answer is a function of its arguments alone.

    Args:
        environment: the map as drawn; robots see through it.
        base: where the base station stands, metres, map frame.
        robot_radius_m: relays stand where a disc of this radius can be.
        decomposition: kind of cells; of no account where placements are points.
        placements: ``"cells"``: relays stand in cells that wholly see each other; ``"points"``: at corners and on a
            grid, with exact lines of sight, and fewer of them do.
        search: how chains are found (:mod:`agents.proposals`).
        spacing_m: of the grid of points, metres; None: one that suits the map.
        base_name: name of the base station in the plan's edges.
        agent_name: name of the agent.
        robot_speed_m_s: of the robots, for the look ahead.
        agent_speed_m_s: of the agent, likewise.
        range_bound_m: no distance to the agent that is measured is wrong by more.

    Raises:
        NoChain: the base station is outside the map.
        TooManyCells: the map has more than :data:`MOST_TO_PLAN_ON`.
        UnfitSpacing: of the grid of points.
        ValueError: the map has no room for such robots around the base station.
    """

    def __init__(
        self,
        environment: Environment,
        base: Point,
        robot_radius_m: float,
        decomposition: Kind,
        *,
        placements: PlacementKind = "points",
        search: Search = "chain",
        spacing_m: float | None = None,
        base_name: str = "base",
        agent_name: str = "agent",
        robot_speed_m_s: float = 1.0,
        agent_speed_m_s: float = 1.0,
        range_bound_m: float = 0.2,
    ) -> None:
        if not environment.contains([base])[0]:
            raise NoChain(f"{name_place(base)} is outside the map")
        self._environment, self._base = environment, base
        self._base_name, self._agent_name = base_name, agent_name
        self._robot_speed_m_s, self._agent_speed_m_s = robot_speed_m_s, agent_speed_m_s
        compiled = CompiledMap(environment, decomposition, robot_radius_m, containing=base)
        if placements == "cells":
            _check_number(compiled)
        self.graph = compiled.point_placements(spacing_m) if placements == "points" else compiled.cell_placements
        self._geodesics = self.graph.geodesics
        self._waiting = Waiting(self._geodesics, robot_radius_m, self.graph.positions)
        self._pursuit = Pursuit(
            environment, self._geodesics, apart_m=self._waiting.apart_m, agent_speed_m_s=agent_speed_m_s,
            bound_m=range_bound_m,
        )  # fmt: skip
        self._proposer = Bidder(
            self.graph, base, search, robot_speed_m_s=robot_speed_m_s, agent_speed_m_s=agent_speed_m_s,
            apart_m=self._waiting.apart_m,
        )  # fmt: skip

    def relays_needed(self, point: Point) -> int:
        """Fewest relays of a chain between the base station and an agent at this point.

        Raises:
            NoChain: the point is outside the map, or no chain reaches it.
        """
        needed = int(self._proposer.relays_needed([point])[0])
        if needed == NO_CHAIN or not self._environment.contains([point])[0]:
            raise NoChain(self._unreachable(point))
        return needed

    def most_relays_needed(self) -> int:
        """Fewest relays that suffice for an agent anywhere a chain can reach."""
        return int(self._proposer.relays_needed(self.graph.probes).max())

    def plan(
        self,
        agent: Whereabouts,
        robots: Mapping[str, Point],
        previous: Plan | None,
        obstacles: Sequence[Point] = (),
        bids: Bids | None = None,
    ) -> Plan:
        """Decide where every robot goes.

        Args:
            agent: where the agent may be, and go.
            robots: where the robots are that can be counted on.
            previous: the plan before.
            obstacles: where robots may stand that cannot be counted on.
            bids: what was offered in an auction of :meth:`lot`; None: the planner looks for chains itself, as it does
                if no chain was offered.

        Returns:
            A plan that gives each of ``robots`` exactly one place.

        Complexity: O(k N²) for each aim, k robots and N cells; then O(p s k² w) for s steps on p ways and w walls.
        """
        now = agent.aims[0]
        needed = self._proposer.relays_for(now)
        if needed == NO_CHAIN:
            waiting = tuple(Placement(robot=name, position=place, spare=True) for name, place in robots.items())
            return Plan(waiting, (), 0.0, 0, False, f"{self._unreachable(agent.center)}: everybody waits")
        robots = {name: self._inside(place) for name, place in robots.items()}
        relays = () if previous is None else tuple(place for place in previous.placements if not place.spare)
        standing = self._standing(agent, robots, relays, previous)
        names = [relay.robot for relay in relays if relay.robot in robots]
        new = [] if bids is None else self._proposer.award(bids, robots)
        new = new or self._proposer.chains(agent, robots, names, obstacles)
        chosen = self._best(standing, new or [self._proposer.outward(now, robots, obstacles)], agent, robots)
        return self._complete(chosen, agent, robots, needed, previous, obstacles)

    def lot(
        self, agent: Whereabouts, robots: Mapping[str, Point], previous: Plan | None, obstacles: Sequence[Point] = ()
    ) -> Lot:
        """What can be auctioned before :meth:`plan` is asked the same."""
        relays = () if previous is None else tuple(place for place in previous.placements if not place.spare)
        inside = {name: self._inside(place) for name, place in robots.items()}
        standing = tuple(relay.robot for relay in relays if relay.robot in robots)
        return Lot(agent.center, agent.aims, inside, standing, tuple(obstacles))

    def bid(self, lot: Lot, bidder: str) -> tuple[Offer, ...]:
        """What a member of the team offers in an auction (:meth:`agents.bidding.Bidder.offers`)."""
        robots = {name: self._inside(place) for name, place in lot.robots.items()}
        return self._proposer.offers(replace(lot, robots=robots), self._base_name, self._agent_name, bidder)

    def _unreachable(self, point: Point) -> str:
        """Why no chain leads there; a sentence."""
        if not self._environment.contains([point])[0]:
            return f"{name_place(point)} is outside the map"
        return f"no chain of relays with a radius of {self.graph.radius_m:g} m reaches {name_place(point)}"

    def _standing(
        self, agent: Whereabouts, robots: Mapping[str, Point], relays: tuple[Placement, ...], previous: Plan | None
    ) -> Proposal | None:
        """The chain of the previous plan, if it was one and all its relays are still there."""
        if previous is None or not previous.serves or any(relay.robot not in robots for relay in relays):
            return None
        last = relays[-1].position if relays else self._base
        serves = any(np.any(self._environment.line_of_sight(np.array(last), aim.places)) for aim in agent.aims)
        reason = previous.reason
        if not serves:
            reason = f"{relays_in_words(len(relays))} kept, seeing nothing of where the agent may be and go"
        return Proposal(relays, serves, reason, previous.cost, previous.total_cost_m, previous.lower_bound_m)

    def _best(
        self, standing: Proposal | None, new: list[Proposal], agent: Whereabouts, robots: Mapping[str, Point]
    ) -> Proposal:
        """The proposal that is worth most, the standing chain when in doubt."""
        outlook = Outlook(
            self._environment, self._geodesics, self._base, agent, robots,
            agent_speed_m_s=self._agent_speed_m_s, robot_speed_m_s=self._robot_speed_m_s,
            distance_m=self._waiting.pitch_m,
        )  # fmt: skip
        different = {proposal.relays: proposal for proposal in reversed(new)}
        worth = {relays: outlook.worth(relays) for relays in different}
        best = max(worth, key=lambda relays: worth[relays])
        if standing is None or not standing.complete or worth[best] > outlook.worth(standing.relays) + KEEPING_S:
            return different[best]
        return standing

    def _complete(
        self,
        chosen: Proposal,
        agent: Whereabouts,
        robots: Mapping[str, Point],
        needed: int,
        previous: Plan | None,
        obstacles: Sequence[Point],
    ) -> Plan:
        relays = chosen.relays
        names = [self._base_name, *(relay.robot for relay in relays), *([self._agent_name] if chosen.complete else [])]
        manned = {relay.robot for relay in relays}
        spares = {name: place for name, place in robots.items() if name not in manned}
        before = (
            {} if previous is None else {place.robot: place.position for place in previous.placements if place.spare}
        )
        chain = [self._base, *(relay.position for relay in relays)]
        waiting = {} if agent.announced else self._pursuit.places(agent, chain, spares, before, obstacles)
        others = {name: place for name, place in spares.items() if name not in waiting}
        taken = [*obstacles, *waiting.values()]
        waiting |= self._waiting.places(self._inside(agent.center), chain, others, before, taken)
        placements = tuple(Placement(robot=name, position=place, spare=True) for name, place in waiting.items())
        return Plan(
            (*relays, *placements), tuple(pairwise(names)), chosen.cost, needed, chosen.complete, chosen.reason,
            chosen.total_cost_m, chosen.lower_bound_m,
        )  # fmt: skip

    def _inside(self, place: Point | Floats) -> Point:
        """The nearest place where a robot can be: the agent may be thinner, and positions are heard late."""
        x, y = self._geodesics.nearest(place)
        return float(x), float(y)


def _check_number(compiled: CompiledMap) -> None:
    """Raise TooManyCells before it is asked which of them see each other."""
    name, kind, number = compiled.environment.name, compiled.kind, len(compiled.cells)
    if number > MOST_TO_PLAN_ON:
        raise TooManyCells(
            f"map {name!r} has {number} {kind} cells, and at most {MOST_TO_PLAN_ON} can be planned on: "
            f"{remedy_for(kind)}, or use placements on points"
        )


def remedy_for(kind: Kind) -> str:
    """What makes fewer cells of a kind."""
    return "use inflection cells" if kind == "aspect" else "simplify it, a grid by a larger tolerance"
