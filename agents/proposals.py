"""The chains that a leader considers: for where the agent may be, and for where it may be some metres on.

What a chain costs, in metres, and what every search minimises:

    Σ over relays of (driven + 3 · driven while the agent is already there + 1.5)  +  3 · Σ over links of W

W are the virtual weights of the placements' links (thesis eq. 25–26). The searches are those of
:func:`planning.redeployment.redeploy`: ``"chain"`` and ``"exact"`` find the least cost over all choices and orders of
robots, ``"one-edge"`` and ``"fixed"`` (thesis §3.5–3.6) stay within one edge of the team's tree, or keep it. That tree
is the standing chain, and the spares hang on the agent, whom they follow: so one edge less and one more make the spare
at the agent the last relay, or a relay a spare.

A chain is made for each *aim* (:mod:`agents.whereabouts`). Its last relay is to see all places of it: of an agent that
announces its way, every place of a piece of that; of an independent one, every place where it may be, now or when it
has gone so many metres. Only where the robots make no such chain, one serves that sees a part: the agent when it has
arrived, or the most of the set, at UNSEEN_M for all that is not seen. Which of the two it is, the proposal's reason
says; its lower bound is one for chains of that kind, by any robots in any order. So a chain that loses sight of the
agent on the way may well cost less.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import combinations, groupby, pairwise
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agents.whereabouts import Aim, Whereabouts
from planning.chain import cheapest_chain
from planning.deployment import NO_CHAIN, identify_robots
from planning.placement_graph import PlacementGraph
from planning.redeployment import Search, redeploy
from protocol.messages import Placement, Point

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Exchange: TypeAlias = tuple[tuple[int, int] | None, tuple[int, int] | None]
Bools = NDArray[np.bool_]

METRES_PER_WEIGHT: Final = 3.0
"""A virtual weight of 1 is worth so many metres of driving."""

RELAY_M: Final = 1.5
"""So many metres are driven rather than one relay more is used, besides what its link costs."""

LATENESS: Final = 3.0
"""A metre that a robot drives while the agent is already where it needs it counts so many times more."""

UNSEEN_M: Final = 60.0
"""To see nothing of what a chain is for is as bad as to drive so many metres."""

KEPT_POINTS: Final = 1024
"""Of so many points it is remembered which placements see them."""

ROUNDING: Final = 1e-9
"""Relative: costs that differ by less are the same."""

BASE, AGENT, FIRST_ROBOT = 0, 1, 2
"""Nodes of the team's tree."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """Relays from the base outward, and what becomes of it."""

    relays: tuple[Placement, ...]
    complete: bool
    """Whether the chain reaches the agent."""
    reason: str
    cost: float = 0.0
    """Sum of the links' virtual weights (thesis eq. 25–26); 0 without a chain."""
    total_cost_m: float | None = None
    """What the search minimised (see the module)."""
    lower_bound_m: float | None = None
    """No chain of the kind that the reason names costs less; equal to ``total_cost_m`` where that is proven least."""


@dataclass(frozen=True, slots=True)
class Found:
    """What a search found: rows of robots from the base outward, their placements, and a bound of what that costs."""

    robots: tuple[int, ...]
    places: tuple[int, ...]
    lower_bound_m: float
    exchange: Exchange = (None, None)
    """Edges of the team's tree that a search near to it has exchanged: the one removed, and the one added."""


class Proposer:
    """Proposes chains between a base station that stays and an agent.

    Args:
        graph: where relays can stand.
        base: where the base station stands, metres, map frame.
        search: see the module.
        robot_speed_m_s: of the robots.
        agent_speed_m_s: of the agent.
        apart_m: least distance between the places of two relays, and between those and obstacles.
    """

    def __init__(
        self,
        graph: PlacementGraph,
        base: Point,
        search: Search,
        *,
        robot_speed_m_s: float,
        agent_speed_m_s: float,
        apart_m: float,
    ) -> None:
        self._graph, self._base, self._search = graph, base, search
        self._speed_ratio = robot_speed_m_s / agent_speed_m_s
        self._from_base = METRES_PER_WEIGHT * graph.link_weights(base)
        self._apart_m = apart_m
        near = np.hypot(*(graph.positions[:, None] - graph.positions).transpose(2, 0, 1)) < apart_m
        self._links = METRES_PER_WEIGHT * np.where(near, np.inf, graph.weights)
        np.fill_diagonal(self._links, 0.0)
        self._relays = graph.relays_from(base)
        self._link_weights = lru_cache(KEPT_POINTS)(lambda x, y: graph.link_weights((x, y)))

    def chains(
        self, agent: Whereabouts, robots: Mapping[str, Point], standing: Sequence[str], obstacles: Sequence[Point] = ()
    ) -> list[Proposal]:
        """One for each aim that the robots suffice for.

        Args:
            agent: where it may be.
            robots: where they are, in free space.
            standing: relays of the chain that there is, from the base outward.
            obstacles: where nobody can stand.
        """
        order = team_order(np.array(agent.center), robots, standing)
        tree = team_tree(order, standing)
        drive = self._drives(order, robots, obstacles)
        found = [self._chain(aim, order, drive, self._search, tree) for aim in agent.aims]
        if self._search in ("one-edge", "fixed") and not any(found):
            # The team's tree is too far from one that serves.
            found = [self._chain(aim, order, drive, "chain", tree) for aim in agent.aims]
        return [proposal for proposal in found if proposal is not None]

    def _drives(self, order: list[str], robots: Mapping[str, Point], obstacles: Sequence[Point]) -> Floats:
        """How far it is for each robot to each placement, (k, N) float, metres; inf where nobody can stand."""
        drive = np.array([self._graph.distances_from(robots[name]) for name in order]).reshape(
            len(order), len(self._graph)
        )
        drive[:, self._taken(obstacles)] = np.inf
        return drive

    def _direct(self, aim: Aim) -> Proposal | None:
        """The chain without relays, if the base station sees all of an aim."""
        direct = self._graph.direct_weights(self._base, aim.places)
        if not np.isfinite(direct).all():
            return None
        weight = float(aim.shares @ direct)
        cost = METRES_PER_WEIGHT * weight
        return Proposal((), True, f"no relay needed {aim.whole}", weight, cost, cost)

    def _chain(self, aim: Aim, order: list[str], drive: Floats, search: Search, tree: Ints) -> Proposal | None:
        """The cheapest chain for an aim; None if the robots make none."""
        direct = self._direct(aim)
        if direct is not None:
            return direct
        found = self._serve(aim, order, drive, partial(self._find, search=search, tree=tree))
        return None if found is None else found[0]

    def _serve(
        self, aim: Aim, order: list[str], drive: Floats, find: Callable[[Floats, Floats], Found | None]
    ) -> tuple[Proposal, bool, Exchange] | None:
        """The cheapest chain with relays that a search finds for an aim, whether it sees all, and what it exchanges."""
        # The robots have until the agent is there.
        move = drive + LATENESS * np.maximum(0.0, drive - aim.ahead_m * self._speed_ratio)
        weights, share = self._view(aim)
        kinds = ((True, self._graph.sees_all(aim.places), aim.whole), (False, share > 0.0, aim.part))
        for whole, sees, purpose in kinds:
            unseen_m = UNSEEN_M * (1.0 - share)
            to_agent = np.where(sees, METRES_PER_WEIGHT * weights + unseen_m, np.inf)
            found = find(move, to_agent)
            if found is not None:
                if self._crowded(found.places):
                    continue
                relays = tuple(
                    self._placement(order[robot], place)
                    for robot, place in zip(found.robots, found.places, strict=True)
                )
                last = found.places[-1]
                links = [self._from_base[found.places[0]], *(self._links[hop] for hop in pairwise(found.places))]
                cost = float(sum(links)) / METRES_PER_WEIGHT + float(weights[last])
                driven = float(sum(move[stop] for stop in zip(found.robots, found.places, strict=True)))
                total_m = driven + RELAY_M * len(relays) + METRES_PER_WEIGHT * cost + float(unseen_m[last])
                # A search adds up in another order.
                bound_m = total_m if found.lower_bound_m >= total_m * (1.0 - ROUNDING) else found.lower_bound_m
                seen = "" if share[last] == 1.0 else f", {share[last]:.0%} of that in sight"
                reason = f"{relays_in_words(len(relays))} {purpose}{seen}"
                return Proposal(relays, True, reason, cost, total_m, bound_m), whole, found.exchange
        return None

    def _view(self, aim: Aim) -> tuple[Floats, Floats]:
        """Of each placement the mean weight of its links to what it sees of an aim, and how much of it that is."""
        counting = aim.shares > 0.0
        rows = np.array([self._link_weights(x, y) for x, y in aim.places[counting].tolist()])
        shares = aim.shares[counting, None]
        seen = np.isfinite(rows)
        share = np.where(seen.all(axis=0), 1.0, (shares * seen).sum(axis=0))
        with np.errstate(invalid="ignore"):
            mean = (shares * np.where(seen, rows, 0.0)).sum(axis=0) / share
        return np.where(share > 0.0, mean, np.inf), share

    def _find(self, move: Floats, to_agent: Floats, search: Search, tree: Ints) -> Found | None:
        """The chain of one search."""
        if search == "chain":
            chain = cheapest_chain(self._links, move, self._from_base, to_agent, RELAY_M)
            return None if chain is None else Found(chain.robots, chain.cells, chain.lower_bound)
        costs, W = self._as_tree(move, to_agent)
        found = redeploy(costs, W, search=search, tree=tree, ends=(BASE, AGENT), idle=True)
        return None if found.tree is None else read_chain(costs, found.tree, found.cells, float(found.lower_bound))

    def _as_tree(self, move: Floats, to_agent: Floats) -> tuple[Floats, Floats]:
        """Costs of all nodes and weights of all links, of a tree of base, agent and robots."""
        # Base and agent become two nodes of the tree, in two places of their own.
        places = len(self._links)
        base, agent = places, places + 1
        W = np.full((places + 2, places + 2), np.inf)
        W[:places, :places] = self._links
        W[base, :places] = W[:places, base] = self._from_base
        W[agent, :places] = W[:places, agent] = to_agent
        np.fill_diagonal(W, 0.0)
        costs = np.full((FIRST_ROBOT + len(move), places + 2), np.inf)
        costs[BASE, base] = costs[AGENT, agent] = 0.0
        costs[FIRST_ROBOT:, :places] = move + RELAY_M
        return costs, W

    def relays_needed(self, points: ArrayLike) -> Ints:
        """Fewest relays of a chain to an agent at each of these points (m, 2), metres: (m,) int, NO_CHAIN for none."""
        places = np.reshape(points, (-1, 2))
        needed = np.full(len(places), NO_CHAIN)
        for index, place in enumerate(places):
            last = self._relays[self._graph.sees(place)]
            needed[index] = min(last[last != NO_CHAIN], default=NO_CHAIN)
        needed[np.isfinite(self._graph.direct_weights(self._base, places))] = 0
        return needed

    def relays_for(self, aim: Aim) -> int:
        """Fewest relays of a chain that sees all of an aim, or as much as one can; NO_CHAIN if none sees anything."""
        if np.isfinite(self._graph.direct_weights(self._base, aim.places)).all():
            return 0
        return int(min(self._relays[self._best_views(aim)], default=NO_CHAIN))

    def _best_views(self, aim: Aim) -> Bools:
        """The placements that a chain reaches and that see most of an aim; none where none sees anything of it."""
        share = np.where(self._relays == NO_CHAIN, 0.0, self._view(aim)[1])
        best: Bools = (share > 0.0) & (share >= share.max() * (1.0 - ROUNDING))
        return best

    def _taken(self, obstacles: Sequence[Point]) -> Bools:
        """Which placements are too near to obstacles."""
        gaps = self._graph.positions[:, None] - np.reshape(obstacles, (-1, 2))
        return np.any(np.hypot(gaps[..., 0], gaps[..., 1]) < self._apart_m, axis=1)  # type: ignore[no-any-return]

    def _crowded(self, places: Sequence[int]) -> bool:
        """Whether two placements are too near to each other. Neighbours in a chain never are."""
        points = self._graph.positions[list(places)].tolist()
        return any(math.dist(one, other) < self._apart_m for one, other in combinations(points, 2))

    def outward(self, aim: Aim, robots: Mapping[str, Point], obstacles: Sequence[Point] = ()) -> Proposal:
        """Too few robots for a chain: those that there are man one of fewest relays from the base outward.

        There must be a chain for the aim.
        """
        needed = self.relays_for(aim)
        weights = np.where(self._taken(obstacles) | ~self._best_views(aim), np.inf, self._view(aim)[0])
        # Back to the base, where there is a choice by the cheapest link.
        places = [int(np.argmin(np.where(self._relays == needed, weights, np.inf)))]
        for relays in range(needed - 1, 0, -1):
            places.insert(0, int(np.argmin(np.where(self._relays == relays, self._links[places[0]], np.inf))))
        places = places[: len(robots)]
        names = list(robots)
        costs = np.array([self._graph.distances_from(place)[places] for place in robots.values()])
        chosen = identify_robots(costs.reshape(len(names), len(places)))
        manned = tuple(self._placement(names[robot], place) for robot, place in zip(chosen, places, strict=True))
        missing = needed - len(manned)
        reason = f"{relays_in_words(needed)} needed and {missing} missing: the chain ends before the agent"
        return Proposal(manned, False, reason)

    def _placement(self, robot: str, place: int) -> Placement:
        x, y = self._graph.positions[place].tolist()
        cell = int(self._graph.cells[place])
        return Placement(robot=robot, position=(x, y), cell=cell if cell >= 0 else None)


def read_chain(costs: Floats, tree: Ints, cells: Ints, bound_m: float) -> Found:
    """The chain between base and agent in a tree whose nodes have been placed."""
    # Where several would stand in one place, the one that drives least will do.
    kept = [
        (min(nodes, key=lambda node: float(costs[node, cells[node]])), int(place))
        for place, nodes in groupby(path_between(tree), key=lambda node: cells[node])
    ]
    return Found(tuple(node - FIRST_ROBOT for node, _ in kept), tuple(place for _, place in kept), bound_m)


def team_order(agent: Floats, robots: Mapping[str, Point], standing: Sequence[str]) -> list[str]:
    """The relays of the standing chain from the base outward, then the others, nearest to the agent last."""
    others = [name for name in robots if name not in standing]
    return [*standing, *sorted(others, key=lambda name: -math.dist(robots[name], agent))]


def team_tree(order: Sequence[str], standing: Sequence[str]) -> Ints:
    """The team's tree: base, standing chain, agent, and the others at the agent; robots by their place in ``order``."""
    chain = [BASE, *range(FIRST_ROBOT, FIRST_ROBOT + len(standing)), AGENT]
    spares = range(FIRST_ROBOT + len(standing), FIRST_ROBOT + len(order))
    return np.array([*pairwise(chain), *((AGENT, spare) for spare in spares)], dtype=np.int64)


def path_between(tree: Ints) -> list[int]:
    """Nodes on the tree's path from the base to the agent, without these."""
    before = {BASE: BASE}
    reached = [BASE]
    for node in reached:
        for edge in tree.tolist():
            if node in edge:
                other = edge[0] + edge[1] - node
                if other not in before:
                    before[other] = node
                    reached.append(other)
    path = [AGENT]
    while path[-1] != BASE:
        path.append(before[path[-1]])
    return path[-2:0:-1]


def relays_in_words(number: int) -> str:
    """So many relays."""
    return f"{number} relay{'' if number == 1 else 's'}"
