"""Deployments D = (V, E, m): a structure of relations between team members, and where it is mapped to.

Thesis §3.3. V are the members, E ⊆ V × V their relations (lines of sight), m maps members into cells, or placements of
another kind. A deployment is mutually visible if (V, E) is connected and every edge joins cells that see each other.
With one agent and one base station the shortest path between their cells solves it (§3.3.2): the cells in between are
where the relays go.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from planning.shortest_paths import NoPath, from_source, path

if TYPE_CHECKING:
    from planning.tree import Tree

NO_CHAIN = -1
"""In counts of relays: no number of relays makes a chain."""

IDLE: Final = -1
"""Cell of a robot that is not needed: it stays where it is and takes part in no relation."""


class NoChain(ValueError):
    """No chain of relays joins the base station and the agent; the text says why."""


class TooFewRobots(ValueError):
    """There are fewer robots than places, or too few that can get there."""


class InvalidDeployment(ValueError):
    """Nodes, edges and cells do not make a deployment; the text says where."""


@dataclass(frozen=True, slots=True)
class Deployment:
    """D = (V, E, m) of thesis §3.3: a connected graph of members, each in a cell.

    Robots can take each other's places. All other members, base stations and agents, are who they are.

    Raises:
        InvalidDeployment: a name comes twice or is unknown, a cell is missing or none, an edge joins a node to itself
            or comes twice, or not all nodes that are in a cell are connected.
    """

    nodes: tuple[str, ...]
    """V: names of the members."""
    edges: tuple[tuple[str, str], ...]
    """E: pairs of members that are to see each other, without direction."""
    cells: tuple[int, ...]
    """m: the cell of each node, in the order of ``nodes``; :data:`IDLE` for robots that are not needed."""
    robots: tuple[str, ...]
    """The nodes that are robots."""

    def __post_init__(self) -> None:
        for names, what in ((self.nodes, "node"), (self.robots, "robot")):
            if len(set(names)) != len(names):
                raise InvalidDeployment(f"{what} {next(name for name in names if names.count(name) > 1)!r} comes twice")
        for name in self.robots:
            if name not in self.nodes:
                raise InvalidDeployment(f"robot {name!r} is none of the nodes {', '.join(self.nodes)}")
        if len(self.cells) != len(self.nodes):
            raise InvalidDeployment(f"{len(self.nodes)} nodes have as many cells, not {len(self.cells)}")
        for name, cell in zip(self.nodes, self.cells, strict=True):
            if cell < 0 and not (cell == IDLE and name in self.robots):
                raise InvalidDeployment(f"node {name!r} is in cell {cell}: cells are at least 0, and only robots idle")
        self._check_edges()

    def _check_edges(self) -> None:
        row = {name: row for row, name in enumerate(self.nodes)}
        seen = set()
        for a, b in self.edges:
            if a not in row or b not in row:
                raise InvalidDeployment(f"edge {a!r}-{b!r} joins {a if a not in row else b!r}, which is no node")
            if a == b or frozenset((a, b)) in seen:
                raise InvalidDeployment(f"edge {a!r}-{b!r} " + ("joins a node to itself" if a == b else "comes twice"))
            if IDLE in (self.cells[row[a]], self.cells[row[b]]):
                raise InvalidDeployment(f"edge {a!r}-{b!r} joins a robot that idles: give it a cell")
            seen.add(frozenset((a, b)))
        placed = [i for i, cell in enumerate(self.cells) if cell != IDLE]
        ends = np.array([(row[a], row[b]) for a, b in self.edges], dtype=np.int64).reshape(-1, 2)
        graph = coo_array((np.ones(len(ends)), ends.T), shape=(len(self.nodes), len(self.nodes)))
        _, part = connected_components(graph, directed=False)
        for i in placed:
            if part[i] != part[placed[0]]:
                raise InvalidDeployment(
                    f"nodes {self.nodes[placed[0]]!r} and {self.nodes[i]!r} are not connected: join them by edges"
                )

    @classmethod
    def from_tree(cls, tree: Tree, terminals: Mapping[str, int]) -> Deployment:
        """The deployment of a Steiner tree: a relay for every node that is no terminal.

        Args:
            tree: over distinct placements, as `steiner_tree` makes it without ``vertices``.
            terminals: names and placements of the terminals; those in one placement are joined to the first of them.

        Returns:
            The terminals under their names, then ``relay1`` …

        Raises:
            InvalidDeployment: the tree misses a terminal or repeats a placement.
        """
        at: dict[int, str] = {}
        edges = []
        for name, cell in terminals.items():
            if cell not in tree.nodes:
                raise InvalidDeployment(f"terminal {name!r} is in placement {cell}, which is not in the tree")
            if at.setdefault(cell, name) != name:
                edges.append((at[cell], name))
        others = [int(cell) for cell in tree.nodes if int(cell) not in at]
        if len(set(tree.nodes.tolist())) != len(tree.nodes):
            raise InvalidDeployment(
                "several nodes of the tree are in one placement: which of them an edge joins is open"
            )
        relays = {cell: f"relay{count}" for count, cell in enumerate(others, start=1)}
        at |= relays
        edges += [(at[int(u)], at[int(v)]) for u, v in tree.edges]
        return cls(
            (*terminals, *relays.values()),
            tuple(edges),
            (*terminals.values(), *others),
            tuple(relays.values()),
        )

    @property
    def is_tree(self) -> bool:
        """Whether no edge could be left out."""
        return len(self.edges) == sum(cell != IDLE for cell in self.cells) - 1

    def cell_of(self, node: str) -> int:
        """m(v): the cell of a node."""
        return self.cells[self.nodes.index(node)]

    def virtual_cost(self, W: NDArray[np.float64]) -> float:
        """C_v(D), the sum of the virtual weights of its edges (thesis eq. 30 and 37); W as `virtual_weights` gives it.

        Infinite unless the deployment is mutually visible. Members in one cell see each other at no cost.
        """
        return float(sum(W[self.cell_of(a), self.cell_of(b)] for a, b in self.edges))

    def is_mutually_visible(self, W: NDArray[np.float64]) -> bool:
        """Whether every edge joins cells that see each other (thesis §3.3)."""
        return bool(np.isfinite(self.virtual_cost(W)))


def shortest_path_deployment(
    W: NDArray[np.float64], base_cell: int, agent_cell: int, placements: NDArray[np.bool_] | None = None
) -> Deployment:
    """The cheapest chain between a base station and an agent (thesis §3.3.2).

    Args:
        W: (N, N) float, virtual weights, inf where cells do not see each other.
        base_cell: cell of the base station.
        agent_cell: cell of the agent; that of the base station gives a chain without relays.
        placements: (N,) bool: cells that a relay can stand in. None: all.

    Returns:
        Nodes ``base``, ``relay1`` …, ``agent`` in the order of the chain, joined each to the next.

    Raises:
        NoChain: the two cells are not joined through cells that relays can stand in.

    Complexity: O(N² + N log N).
    """
    _check_cells(len(W), base_cell, agent_cell)
    _, predecessors = from_source(W, base_cell, placements)
    if base_cell == agent_cell:
        return Deployment(("base", "agent"), (("base", "agent"),), (base_cell, agent_cell), ())
    try:
        cells = path(predecessors, base_cell, agent_cell)
    except NoPath:
        raise NoChain(
            f"no chain of relays joins the base's cell {base_cell} to the agent's cell {agent_cell}"
        ) from None
    relays = tuple(f"relay{place}" for place in range(1, len(cells) - 1))
    nodes = ("base", *relays, "agent")
    return Deployment(nodes, tuple(pairwise(nodes)), tuple(cells), relays)


def identify_robots(costs: NDArray[np.float64]) -> NDArray[np.int64]:
    """Which robot goes to which place, so that the costs add up to the least (thesis §3.4, optimal identification).

    Args:
        costs: (k, n) float: what it costs robot i to go to place j; inf where it cannot.

    Returns:
        (n,) int: the robot of each place; all different.

    Raises:
        TooFewRobots: fewer robots than places, or no complete assignment of finite cost.

    Complexity: O(k n²).
    """
    costs = np.asarray(costs, dtype=np.float64)
    robots, places = costs.shape
    if robots < places:
        raise TooFewRobots(f"{places} places need as many robots, and there are {robots}: {places - robots} too few")
    try:
        chosen, filled = linear_sum_assignment(costs)
    except ValueError:
        raise TooFewRobots(f"no assignment of {robots} robots fills all of the {places} places") from None
    by_place = np.empty(places, dtype=np.int64)
    by_place[filled] = chosen
    return by_place


def _check_cells(number: int, *cells: int) -> None:
    for cell in cells:
        if not 0 <= cell < number:
            raise NoChain(f"cell {cell} does not exist: there are {number}, and -1 means outside the map")
