"""The cheapest of all trees one edge away from a given one: thesis §3.6, algorithm 7, corrected, in O(k² N²).

An edge is removed, and the two trees that are left are joined by another edge. Algorithm 7 solves the tree programme
for each of the O(k³) trees that come of it, in O(k⁴ N²); (m, n) in its line 3 has to run over nodes on *different*
sides of the cut, or no tree comes of it. Most of that work is done over and over. With

    M_ij(v) = min over u of move_i(u) + sum over neighbours l of i but j of M_li(u) + μ W[u, v]

the *message* from i to j — what it costs to hang i's side of the edge (i, j) from j in v — a tree rooted in any of its
nodes costs the sum of the messages that arrive there. Cutting (i, j) changes only the messages that lead away from the
cut. So for each of the k − 1 cuts k − 2 messages are computed again, and one more product for each node of the smaller
side; after that, each new edge takes the minimum of a sum of two vectors.

All cuts are taken at once, a step away from the cut at a time, so that the products are many (`planning.min_plus`).

Where nodes may idle, a branch without an end sends no message: it would be left out (`planning.known_topology`).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

import numpy as np

from planning.known_topology import neighbours_of
from planning.min_plus import Links, min_plus
from planning.tree import Floats, Ints

ROUNDING: Final = 1e-12
"""Relative: a modification that is not cheaper by more than this is no improvement."""

Edge = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Exchange:
    """One edge of a tree for another that joins what it leaves."""

    cost: float
    """Of the tree that comes of it."""
    cut: Edge
    added: Edge

    def applied(self, tree: Ints) -> Ints:
        """The tree, (m, 2) int, with the other edge in the place of the one that is cut."""
        modified = tree.copy()
        modified[(tree == self.cut).all(axis=1) | (tree == self.cut[::-1]).all(axis=1)] = self.added
        return modified


def best_modification(links: Links, move: Floats, tree: Ints, ends: list[int]) -> tuple[float, Ints]:
    """The cheapest tree among the given one and those that differ from it in one edge.

    Args:
        links: of N placements.
        move: (k, N) float, not negative: what it costs node i to go to placement v; inf where it cannot.
        tree: (k − 1, 2) int: pairs of nodes.
        ends: nodes that are needed; all nodes if none may idle.

    Returns:
        Its cost, inf if none of the trees can be placed, and the tree; the given one unless another is cheaper.

    Complexity: O(k² N²) for the products and O(k³ N) for the sums.
    """
    cost, exchanges = find_exchanges(links, move, tree, ends)
    return (exchanges[0].cost, exchanges[0].applied(tree)) if exchanges else (cost, tree)


def find_exchanges(
    links: Links, move: Floats, tree: Ints, ends: list[int], cuts: Collection[Edge] | None = None
) -> tuple[float, list[Exchange]]:
    """For each edge of a tree the one that is best in its place, where that makes the tree cheaper.

    Arguments and complexity as of :func:`best_modification`; of the edges only those in ``cuts`` are exchanged, if that
    is given.

    Returns:
        The cost of the tree as it is, inf if it cannot be placed, and the exchanges, the cheapest tree first.
    """
    messages = _Messages(links, move, tree, ends)
    cost = float(messages.rooted(ends[0]).min())
    exchanges = []
    parted = messages.cuts(cuts)
    smaller = [min(sides, key=lambda side: len(side.nodes)) for sides in parted]
    rows = [side.rooted for side in smaller]
    hung = np.split(min_plus(links, np.concatenate(rows)), np.cumsum([len(row) for row in rows])[:-1]) if rows else []
    for (first, second), near, hanging in zip(parted, smaller, hung, strict=True):
        far = second if near is first else first
        totals = (far.rooted[:, None] + hanging).min(axis=2)
        place, other = np.unravel_index(np.argmin(totals), totals.shape)
        if totals[place, other] < cost * (1.0 - ROUNDING):
            exchanges.append(Exchange(float(totals[place, other]), first.cut, (far.nodes[place], near.nodes[other])))
    return cost, sorted(exchanges, key=lambda exchange: exchange.cost)


class _Side:
    """What is left on i's side when the edge (i, j) is cut."""

    def __init__(self, cut: Edge) -> None:
        self.cut = cut
        self.nodes: list[int] = [cut[0]]
        self.parents: dict[int, int] = {cut[0]: cut[1]}
        """Of each node, its neighbour on the way to the cut."""
        self.arriving: dict[int, Floats] = {}
        """At each node but i: the message from its parent, which knows of the cut."""
        self.rooted = np.empty((0, 0))
        """(n, N) float: what the side costs, rooted in each of its nodes."""


class _Messages:
    """The messages of the uncut tree, and those that a cut changes."""

    def __init__(self, links: Links, move: Floats, tree: Ints, ends: list[int]) -> None:
        self._links = links
        self._move = move
        self._neighbours = neighbours_of(tree, len(move))
        self._edges: list[Edge] = [(i, j) for i, j in tree.tolist()]
        self._messages: dict[Edge, Floats] = {}
        self._ends: dict[Edge, int] = {}
        """How many ends there are on i's side of (i, j)."""
        waiting = self._edges + [(j, i) for i, j in self._edges]
        while waiting:
            ready = [(i, j) for i, j in waiting if all((n, i) in self._messages for n in self._neighbours[i] if n != j)]
            for i, j in ready:
                self._ends[i, j] = (i in ends) + sum(self._ends[n, i] for n in self._neighbours[i] if n != j)
            products = min_plus(links, np.stack([self.rooted(i, j) for i, j in ready]))
            self._messages.update(zip(ready, products, strict=True))
            waiting = [edge for edge in waiting if edge not in self._messages]

    def rooted(self, i: int, without: int = -1, side: _Side | None = None) -> Floats:
        """(N,) float: what the tree, or a side of it, costs with i in v, the branch of one neighbour aside."""
        total: Floats = self._move[i].copy()
        for n in self._neighbours[i]:
            if n == without:
                continue
            if side is None or n != side.parents[i]:
                if self._ends[n, i]:
                    total += self._messages[n, i]
            elif i != side.cut[0] and self._ends[n, i] > self._ends[side.cut[::-1]]:  # some are not cut off
                total += side.arriving[i]
        return total

    def cuts(self, among: Collection[Edge] | None) -> list[tuple[_Side, _Side]]:
        """Both sides of each edge that has ends on either side, of all edges or of some."""
        cuts = [
            (_Side((i, j)), _Side((j, i)))
            for i, j in self._edges
            if self._ends[i, j] and self._ends[j, i] and (among is None or (i, j) in among or (j, i) in among)
        ]
        sides = [side for pair in cuts for side in pair]
        steps = [(side, side.cut[0], n) for side in sides for n in self._neighbours[side.cut[0]] if n != side.cut[1]]
        while steps:
            products = min_plus(self._links, np.stack([self.rooted(i, n, side) for side, i, n in steps]))
            for (side, i, n), product in zip(steps, products, strict=True):
                side.nodes.append(n)
                side.parents[n] = i
                side.arriving[n] = product
            steps = [(side, n, other) for side, i, n in steps for other in self._neighbours[n] if other != i]
        for side in sides:
            side.rooted = np.stack([self.rooted(i, side=side) for i in side.nodes])
        return cuts
