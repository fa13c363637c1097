"""Redeployment for more robots than can be searched exactly: one edge at a time to a local optimum, and a bound.

A local optimum is a tree that no single edge modification makes cheaper, and whose robots are identified with its
placements at the least cost (thesis §3.4, optimal identification; §3.6 takes one step of the former and none of the
latter). Where a search begins matters more than how it goes on. The trees of the relaxation of
`planning.redeployment_bound` have the right shape but for robots that they use twice: named anew, they are where the
searches begin, as the prices rise; the present tree is another. All of it is deterministic.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from planning.deployment import TooFewRobots, identify_robots
from planning.edge_modification import ROUNDING, best_modification
from planning.known_topology import place_nodes
from planning.min_plus import Links
from planning.redeployment_bound import Counted, PriceAscent, count_nodes, name_nodes, relax, without_rounding
from planning.subset_programme import ROOT, PlacedTree
from planning.tree import Floats, Ints

STEPS: Final = 6
"""Of the prices. More states in the relaxation are worth more than more steps: the first few gain most."""


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

    Complexity: a few relaxed programmes, about O(most_states N²) each, and as many searches, O(k² N²) for each edge
        that they change.
    """
    counted = count_nodes(move, ends, most_states)
    ascent = PriceAscent(counted)
    best = Found(np.inf, 0.0, np.empty((0, 2), dtype=np.int64), np.full(len(move), -1, dtype=np.int64))
    if tree is not None:
        best = min(best, improve(links, move, ends, tree), key=lambda found: found.cost)
    for _ in range(STEPS):
        relaxation = relax(links, move, counted, ascent.prices)
        if np.isinf(relaxation.bound):
            return Found(np.inf, np.inf, best.edges, best.cells)
        start = _named_tree(move, counted, relaxation.tree)
        if start is not None:
            best = min(best, improve(links, move, ends, start), key=lambda found: found.cost)
        if not ascent.step(relaxation, best.cost):
            break
    return Found(best.cost, without_rounding(ascent.bound, best.cost), best.edges, best.cells)


def improve(links: Links, move: Floats, ends: list[int], tree: Ints) -> Found:
    """Change edges and the identification of robots by turns as long as that is cheaper; the bound is left at 0."""
    best = Found(np.inf, 0.0, tree, np.full(len(move), -1, dtype=np.int64))
    while True:
        cost, tree = best_modification(links, move, tree, ends)
        if not cost < best.cost * (1.0 - ROUNDING):
            return best
        placed = place_nodes(links, move, tree, ends)
        if placed is None:
            return best
        best = Found(cost, 0.0, *placed)
        tree = _identified(move, ends, best.cells)[tree]


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
