"""Redeployment for more robots than can be searched exactly: one edge at a time to a local optimum, and a bound.

A local optimum is a tree that no single edge modification makes cheaper, and whose robots are identified with its
placements at the least cost (thesis §3.4, optimal identification; §3.6 takes one step of the former and none of the
latter). Where a search begins matters more than how it goes on. The trees of the relaxation of
`planning.redeployment_bound` have the right shape but for robots that they use twice: named anew, they are where the
searches begin, as the prices rise; the present tree is another. All of it is deterministic.

The work is bounded, and measured in links that are looked at rather than in seconds (:data:`EFFORT`), so that the
answer is the same on every machine. Beyond about 20 nodes not every search comes to its end within it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from planning.deployment import TooFewRobots, identify_robots
from planning.distant_nodes import bound_by_distant
from planning.edge_modification import ROUNDING, find_exchanges
from planning.known_topology import neighbours_of, place_nodes, topology_cost
from planning.min_plus import Links
from planning.redeployment_bound import Counted, PriceAscent, count_nodes, name_nodes, relax, without_rounding
from planning.subset_programme import ROOT, PlacedTree
from planning.tree import Floats, Ints

STEPS: Final = 6
"""Of the prices. More states in the relaxation are worth more than more steps: the first few gain most."""

DISTANT: Final = 8
"""Nodes, besides the root, of the bound by distant nodes."""

EFFORT: Final = 2_000_000_000
"""Links looked at by the local searches together, and as many by the relaxations: a second or two each. A round of a
search takes 3 k² of all links, a relaxation as many times all links as it has states."""

OVERHEAD: Final = 50
"""Links that the rest of the work for one placement amounts to."""


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """The best redeployment that was found; if none was, the cost is inf, and edges and cells mean nothing."""

    cost: float
    lower_bound: float
    """inf: it is proven that there is none."""
    edges: Ints
    """(m, 2) int: pairs of nodes."""
    cells: Ints
    """(k,) int: placements; -1 for nodes left out."""


def search_with_bound(links: Links, move: Floats, ends: list[int], tree: Ints | None, most_states: int) -> Found:
    """A redeployment that is locally optimal, and what none can cost less than.

    Args:
        links: of N placements.
        move: (k, N) float, not negative: what it costs node i to go to placement v; inf where it cannot.
        ends: nodes that are needed, all nodes if none may idle.
        tree: (k − 1, 2) int: pairs of nodes to begin with as well; None: no such.
        most_states: of the relaxed subset programme; more give a better bound and take as much longer.

    Complexity: O(N³) and 2 :data:`EFFORT` operations, but at least two rounds of a search, O(k² N²) each, and one
        relaxed programme, about O(most_states N²).
    """
    counted = count_nodes(move, ends, most_states)
    ascent = PriceAscent(counted)
    best = Found(np.inf, 0.0, np.empty((0, 2), dtype=np.int64), np.full(len(move), -1, dtype=np.int64))
    work = len(links.weights) + OVERHEAD * links.number
    rounds = max(2, EFFORT // (3 * len(move) ** 2 * work))
    if tree is not None:
        best, left = improve(links, move, ends, tree, rounds // 2)
        rounds -= rounds // 2 - left
    bound = bound_by_distant(links, move, ends, DISTANT)
    for _ in range(min(STEPS, max(1, EFFORT // (most_states * work)))):
        relaxation = relax(links, move, counted, ascent.prices)
        if np.isinf(relaxation.bound):
            return Found(np.inf, np.inf, best.edges, best.cells)
        start = _named_tree(move, counted, relaxation.tree)
        if start is not None and rounds:
            found, rounds = improve(links, move, ends, start, rounds)
            best = min(best, found, key=lambda either: either.cost)
        if not ascent.step(relaxation, best.cost) or bound >= best.cost * (1.0 - ROUNDING):
            break
    return Found(best.cost, without_rounding(max(bound, ascent.bound), best.cost), best.edges, best.cells)


def improve(links: Links, move: Floats, ends: list[int], tree: Ints, rounds: int) -> tuple[Found, int]:
    """Change edges and the identification of robots by turns as long as that is cheaper, or the rounds last.

    A round finds the best exchange for every edge and makes all that still help after the ones before.

    Returns:
        What was found, its bound left at 0, and how many rounds are left.
    """
    best = Found(np.inf, 0.0, tree, np.full(len(move), -1, dtype=np.int64))
    while rounds:
        rounds -= 1
        cost, tree = _exchange_edges(links, move, ends, tree)
        if not cost < best.cost * (1.0 - ROUNDING):
            break
        placed = place_nodes(links, move, tree, ends)
        if placed is None:
            break
        best = Found(cost, 0.0, *placed)
        tree = _identified(move, ends, best.cells)[tree]
    return best, rounds


def _exchange_edges(links: Links, move: Floats, ends: list[int], tree: Ints) -> tuple[float, Ints]:
    """The best modification, and on top of it those of other edges that make the tree cheaper still."""
    cost, exchanges = find_exchanges(links, move, tree, ends)
    for place, exchange in enumerate(exchanges):
        modified = exchange.applied(tree)
        if place == 0:
            cost, tree = exchange.cost, modified
        elif _joins(modified, exchange.added, len(move)):
            least = topology_cost(links, move, modified, ends)
            if least < cost * (1.0 - ROUNDING):
                cost, tree = least, modified
    return cost, tree


def _joins(edges: Ints, added: tuple[int, int], nodes: int) -> bool:
    """Whether (nodes − 1, 2) edges are a tree, which they were before one was exchanged for ``added``."""
    neighbours = neighbours_of(edges, nodes)
    reached = {added[0]}
    waiting = [added[0]]
    while waiting:
        new = set(neighbours[waiting.pop()]) - reached
        reached |= new
        waiting += new
    return len(reached) == nodes


def _identified(move: Floats, ends: list[int], cells: Ints) -> Ints:
    """Who takes the part of each node, (k,) int: the cheapest identification of robots with the placements."""
    parts = np.arange(len(move))
    needed = np.isin(parts, ends)
    for members in (np.flatnonzero(needed), np.flatnonzero(~needed)):
        standing = members[cells[members] >= 0]
        if len(standing):
            chosen = members[identify_robots(move[np.ix_(members, cells[standing])])]
            parts[standing] = chosen
            parts[np.setdiff1d(members, standing)] = np.setdiff1d(members, chosen)
    return parts


def _named_tree(move: Floats, counted: Counted, tree: PlacedTree) -> Ints | None:
    """The edges of a counted tree between named nodes, those it leaves out as leaves at the root: (k − 1, 2) int."""
    try:
        names = name_nodes(move, counted, tree)
    except TooFewRobots:
        return None
    edges = [(names[parent], name) for name, parent in zip(names, tree.parents, strict=True) if parent != ROOT]
    idle = sorted({*range(len(move))} - {*names})
    return np.array(edges + [(counted.root, i) for i in idle], dtype=np.int64)
