"""Plans without a team: trees of lines of sight to any number of agents, and who goes where for them.

Terminals are the base station and the agents, which stand anywhere. They are further nodes of the placement graph: with
N placements, terminal i is node N + i.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from planning.deployment import TooFewRobots, identify_robots
from planning.placement_graph import PlacementGraph
from planning.redeployment import redeploy
from planning.relays import fewest_relays, join_terminals
from planning.steiner import Method, steiner_tree
from planning.tree import InvalidRequest, NoTree, Tree

if TYPE_CHECKING:
    from launcher.present_tree import Links
    from protocol.messages import Point

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


EXACT_COUNT = 8
"""Terminals up to which the fewest relays are counted exactly whatever the method: that takes milliseconds."""


class NoPlan(ValueError):
    """There is no such plan; the text says what is in the way."""


@dataclass(frozen=True)
class Need:
    """How many relays join all terminals.

    Attributes:
        relays: so many do.
        least: and fewer do not.
    """

    relays: int
    least: bool


@dataclass(frozen=True)
class TreePlan:
    """A tree of lines of sight.

    Attributes:
        relays: where relays stand, those nearer to the base station along the tree first.
        links: the two ends of each line of sight, that nearer to the base station first.
        cost: virtual, without unit.
    """

    relays: tuple[Point, ...]
    links: tuple[tuple[Point, Point], ...]
    cost: float


@dataclass(frozen=True)
class MovePlan:
    """Who goes where.

    Attributes:
        placements: for each robot the placement it is to go to; None for one that idles.
        targets: where those are.
        tree: who is to see whom: base station, agents and robots are counted in this order, from 0.
        links: the two ends of each line of sight.
        movement: what going there costs, in metres or seconds.
        virtual: what the links cost, without unit.
        cost: ``movement`` + μ ``virtual``.
        lower_bound: no plan of this kind costs less; None where nothing is promised.
    """

    placements: tuple[int | None, ...]
    targets: tuple[Point | None, ...]
    tree: Links
    links: tuple[tuple[Point, Point], ...]
    movement: float
    virtual: float
    cost: float
    lower_bound: float | None


class Terminals:
    """A placement graph with a base station and agents on it.

    Args:
        graph: the placements.
        places: (t, 2) metres: the base station, then the agents.
    """

    def __init__(self, graph: PlacementGraph, places: Sequence[Point]) -> None:
        self._graph = graph
        self._places: list[Point] = [(float(x), float(y)) for x, y in places]
        self.links: Floats = np.array([graph.link_weights(place) for place in places])
        direct = np.array([graph.direct_weights(place, places) for place in places])
        self.direct: Floats = np.minimum(direct, direct.T)
        self.weights: Floats = join_terminals(graph.weights, self.links, self.direct)
        """(N + t, N + t) float: of all links."""
        self.nodes = len(graph) + np.arange(len(places))
        self._standing = np.arange(len(self.weights)) < len(graph)

    def unreachable(self) -> list[int]:
        """Which agents, counted from 0, no chain of relays joins to the base station."""
        reached = self._graph.relays_from(self._places[0]) >= 0
        joined = np.isfinite(self.direct[0]) | (np.isfinite(self.links) & reached).any(axis=1)
        return [int(agent) for agent in np.flatnonzero(~joined[1:])]

    def need(self, method: Method = "exact") -> Need:
        """How many robots it takes: the least that do, or with many terminals what the method finds.

        Raises:
            NoPlan: too many terminals for an exact answer.
        """
        if method == "exact" or len(self.nodes) <= EXACT_COUNT:
            seen, direct = np.isfinite(self.links), np.isfinite(self.direct)
            np.fill_diagonal(direct, True)
            try:
                return Need(len(fewest_relays(self._graph.visible, seen, direct).relays), True)
            except InvalidRequest as problem:
                raise self._too_many("say --method takahashi-matsuyama or --method mst") from problem
        tree = steiner_tree(np.where(np.isfinite(self.weights), 1.0, np.inf), self.nodes, method, None, self._standing)
        relays = int(np.count_nonzero(tree.nodes < len(self._graph)))
        return Need(relays, relays == 0)

    def tree(self, method: Method = "exact", vertices: int | None = None, robots: int | None = None) -> TreePlan:
        """A tree of little cost that joins all terminals.

        Args:
            method: how it is found.
            vertices: exactly so many nodes, terminals included.
            robots: at most so many of the nodes are robots.

        Raises:
            NoPlan: there is none of that size, or too many terminals for an exact one.
        """
        try:
            if vertices is not None:
                remedy = "leave out --vertices, and say --method takahashi-matsuyama"
                return self._ordered(steiner_tree(self.weights, self.nodes, "exact", vertices, self._standing))
            remedy = "say --method takahashi-matsuyama or --method mst"
            tree = steiner_tree(self.weights, self.nodes, method, None, self._standing)
            count = len(tree.nodes) - len(self.nodes)
            if robots is not None and count > robots:
                remedy = f"give --robots {count}, which the tree by --method {method} takes, or move the agents"
                tree = steiner_tree(self.weights, self.nodes, "exact", len(self.nodes) + robots, self._standing)
        except NoTree as problem:
            raise NoPlan(f"no tree joins the base station and all agents: {problem}") from problem
        except InvalidRequest as problem:
            raise self._too_many(remedy) from problem
        return self._ordered(tree)

    def _too_many(self, remedy: str) -> NoPlan:
        return NoPlan(
            f"{len(self.nodes) - 1} agents and the base station on {len(self._graph)} placements are too many for an "
            f"exact tree; {remedy}"
        )

    def place_of(self, node: int) -> Point:
        """Where a node is."""
        if node >= len(self._graph):
            return self._places[node - len(self._graph)]
        x, y = self._graph.positions[node]
        return float(x), float(y)

    def _ordered(self, tree: Tree) -> TreePlan:
        """From the base station outwards, breadth first; nodes that share a placement are one in the links."""
        neighbours: dict[int, list[int]] = {}
        for u, v in tree.edges.tolist():
            if u != v:
                neighbours.setdefault(u, []).append(v)
                neighbours.setdefault(v, []).append(u)
        order = [int(self.nodes[0])]
        links = []
        for node in order:
            for other in neighbours.get(node, []):
                if other not in order:
                    order.append(other)
                    links.append((self.place_of(node), self.place_of(other)))
        counts = np.bincount(tree.nodes, minlength=len(self.weights))
        relays = [self.place_of(node) for node in order if node < len(self._graph) for _ in range(counts[node])]
        return TreePlan(tuple(relays), tuple(links), tree.cost)

    def assign(self, movement: Floats, mu: float, method: Method) -> MovePlan:
        """The cheapest tree, and for each of its places one of the robots (thesis §3.4, eq. 38).

        Args:
            movement: (k, N) float: what it costs each robot to go to each placement.
            mu: what virtual costs count beside that.
            method: how the tree is found.

        Raises:
            NoPlan: too many terminals for an exact tree.
            TooFewRobots: the tree needs more robots, or they cannot get there.
        """
        try:
            tree = steiner_tree(self.weights, self.nodes, method, None, self._standing)
        except InvalidRequest as problem:
            raise self._too_many("say --method takahashi-matsuyama or --method mst") from problem
        relays = tree.nodes[tree.nodes < len(self._graph)]
        chosen = identify_robots(movement[:, relays])
        placements: list[int | None] = [None] * len(movement)
        for robot, node in zip(chosen, relays, strict=True):
            placements[robot] = int(node)
        moved = float(movement[chosen, relays].sum())
        links, cost = self._ordered(tree).links, moved + mu * tree.cost
        topology = self._labelled(tree, chosen, relays)
        return MovePlan(tuple(placements), self._places_of(placements), topology, links, moved, tree.cost, cost, None)

    def redeploy(
        self,
        movement: Floats,
        mu: float,
        search: Literal["exact", "one-edge", "fixed", "chain"],
        tree: Links | None = None,
        idle: bool = False,
    ) -> MovePlan:
        """Who goes where at the least cost of moving and of links together.

        Args:
            movement: as for :meth:`assign`.
            mu: likewise.
            search: see :mod:`planning.redeployment`.
            tree: the present topology, of nodes: the terminals, then the robots. None, of ``exact`` only: where that
                cannot search everything, it starts from a tree that joins all terminals.
            idle: robots may be left out.

        Raises:
            NoPlan: there is none.
            InvalidRedeployment: a chain to several agents.
        """
        t, k = len(self.nodes), len(movement)
        move = np.full((t + k, len(self.weights)), np.inf)
        move[np.arange(t), self.nodes] = 0.0
        move[t:, : len(self._graph)] = movement
        if tree is None and search == "exact":
            tree = self._joining_topology(movement)
        found = redeploy(move, self.weights, mu, search, tree, tuple(range(t)), idle)
        if found.tree is None:
            remedy = "give more of them, or more time"
            if search in ("one-edge", "fixed"):
                remedy = "say --search exact, or tell the present tree by --link"
            raise NoPlan(
                f"from where the {k} robots are, --search {search} finds no way to join all agents to the base; "
                f"{remedy}"
            )
        cells = [None if cell < 0 else int(cell) for cell in found.cells]
        places = self._places_of(cells)
        links = [(places[u], places[v]) for u, v in found.tree.tolist()]
        robots = np.flatnonzero(found.cells[t:] >= 0)
        moved = float(movement[robots, found.cells[t:][robots]].sum())
        ends = found.cells[found.tree]
        virtual = float(self.weights[ends[:, 0], ends[:, 1]].sum())
        return MovePlan(
            tuple(cells[t:]),
            places[t:],
            tuple((u, v) for u, v in found.tree.tolist()),
            tuple((here, there) for here, there in links if here is not None and there is not None),
            moved,
            virtual,
            found.cost,
            found.lower_bound,
        )

    def _joining_topology(self, movement: Floats) -> Links | None:
        """A topology of terminals and robots that has placements, as far as robots get there in time; None: no such.

        A tree of little cost, the robots nearest to its places, and the others beside the base station.
        """
        tree = steiner_tree(self.weights, self.nodes, "takahashi-matsuyama", None, self._standing)
        relays = tree.nodes[tree.nodes < len(self._graph)]
        try:
            chosen = identify_robots(movement[:, relays])
        except TooFewRobots:
            return None
        t, k = len(self.nodes), len(movement)
        spare = sorted({*range(t, t + k)} - {t + int(robot) for robot in chosen})
        return (*self._labelled(tree, chosen, relays), *((0, robot) for robot in spare))

    def _labelled(self, tree: Tree, chosen: Ints, relays: Ints) -> Links:
        """The edges of a tree between terminals and, counted on from these, the robots chosen for its relays."""
        label = {int(node): terminal for terminal, node in enumerate(self.nodes)}
        label |= {int(node): len(self.nodes) + int(robot) for robot, node in zip(chosen, relays, strict=True)}
        return tuple((label[u], label[v]) for u, v in tree.edges.tolist())

    def _places_of(self, nodes: Sequence[int | None]) -> tuple[Point | None, ...]:
        return tuple(None if node is None else self.place_of(node) for node in nodes)
