"""Exact Steiner trees: the programme over sets of terminals of Dreyfus and Wagner (thesis §3.3.3, alg. 1, eq. 28–29).

s[X, v] is the least cost of a tree on the terminals X and placement v:

    s_v[X] = min over ∅ ≠ Y ⊂ X of s[Y, v] + s[X∖Y, v]              two subtrees joined in v          (eq. 28)
    s[X, v] = min over w of p(w, v) + s_w[X]                        led on from w by a shortest path   (eq. 29)

One terminal, the first, is the root and in no X; the optimum is s[all others, root]. Two things differ from the
thesis. Paths are led on from all w at once (R. E. Erickson, C. L. Monma, A. F. Veinott 1987,
doi:10.1287/moor.12.4.634), so that no matrix of all shortest paths is needed. And a label s[X, v] is dropped if with
the least that joining v to the terminals outside X costs it is above the cost of a tree that is known, which is that
of Takahashi and Matsuyama. Half of the shortest tour through v and those terminals is such a bound, because walking
around a tree is a tour (S. Hougardy, J. Silvanus, J. Vygen 2017, doi:10.1007/s12532-016-0110-1). No label of an
optimal tree is dropped, so the result stays exact.
"""

from __future__ import annotations

import numpy as np

from planning.approximate_steiner import takahashi_matsuyama
from planning.distance_network import DistanceNetwork, Nodes, lower
from planning.kernel import kernel
from planning.shortest_paths import NO_PREDECESSOR
from planning.tree import Floats, InvalidRequest, Tree, joining_tree

LARGEST_TABLE = 2**26
"""Labels kept (12 bytes each, 0.8 GB): 17 terminals among 1000 placements."""

ROUNDING = 1e-9
"""Share of the known tree's cost by which sums of the same weights in another order may differ."""


def exact_tree(W: Floats, network: DistanceNetwork) -> Tree:
    """A cheapest tree that joins the terminals of a distance network.

    Args:
        W: (N, N) float, checked.
        network: of these weights.

    Raises:
        InvalidRequest: too many terminals for an exact answer.

    Complexity: O(3^t N + 2^t N²) time at worst, O(2^t (N + t²)) memory. On visibility graphs of 600 placements a
    tenth to a half of the labels of 8 terminals are kept.
    """
    known = takahashi_matsuyama(W, network)
    if len(network.terminals) <= 2:
        return known
    sets = 2 ** (len(network.terminals) - 1)
    if sets * len(W) > LARGEST_TABLE:
        raise InvalidRequest(
            f"{len(network.terminals)} terminals among {len(W)} placements are too many for an exact Steiner tree: "
            "take fewer, or an approximation by method='takahashi-matsuyama'"
        )
    costs = np.full((sets, len(W)), np.inf)
    predecessors = np.full((sets, len(W)), NO_PREDECESSOR, dtype=np.int32)
    singles = 1 << np.arange(len(network.terminals) - 1)
    costs[singles], predecessors[singles] = network.distances[1:], network.predecessors[1:]
    between = np.ascontiguousarray(network.distances[:, network.terminals])
    most = known.cost * (1.0 + ROUNDING)
    _solve(W, network.distances, _walks(between), most, network.step, costs, predecessors)
    return joining_tree(W, _edges(costs, predecessors, int(network.terminals[0])), network.terminals)


def _edges(costs: Floats, predecessors: Nodes, root: int) -> list[tuple[int, int]]:
    """Take the optimum apart; where costs are equal, subtrees may share an edge."""
    edges = []
    labels = [(len(costs) - 1, root)]
    while labels:
        X, v = labels.pop()
        if (before := int(predecessors[X, v])) != NO_PREDECESSOR:
            edges.append((before, v))
            labels.append((X, before))
        elif X & (X - 1):
            parts = np.arange(1, X)
            parts = parts[parts & ~X == 0]
            Y = int(parts[np.argmin(costs[parts, v] + costs[X ^ parts, v])])
            labels += [(Y, v), (X ^ Y, v)]
    return edges


@kernel
def _solve(
    W: Floats,
    distances: Floats,
    walks: Floats,
    most: float,
    step: float,
    costs: Floats,
    predecessors: Nodes,
) -> None:
    """Fill in the labels of all sets; those of one terminal are there."""
    sets, number = costs.shape
    limits = np.empty(number)
    some = np.zeros(sets, dtype=np.bool_)
    for X in range(1, sets):
        _limit(distances, walks[sets - 1 - X], most, limits)
        if X & (X - 1):
            lowest = X & -X
            Y = (X - 1) & X
            while Y > 0:
                if Y & lowest and some[Y] and some[X ^ Y]:
                    _join(costs[Y], costs[X ^ Y], costs[X])
                Y = (Y - 1) & X
            lower(W, costs[X], predecessors[X], limits, step)
        for v in range(number):
            if costs[X, v] <= limits[v]:
                some[X] = True
            else:
                costs[X, v] = np.inf


@kernel
def _join(one: Floats, other: Floats, both: Floats) -> None:
    for v in range(len(both)):
        both[v] = min(both[v], one[v] + other[v])


@kernel
def _limit(distances: Floats, walks: Floats, most: float, limits: Floats) -> None:
    """What a subtree may cost in each placement: what the whole may, less half a tour through the other terminals."""
    limits[:] = np.inf
    for a in range(len(walks)):
        for b in range(a + 1):
            walk = walks[a, b]
            if walk < np.inf:
                for v in range(len(limits)):
                    limits[v] = min(limits[v], distances[a, v] + walk + distances[b, v])
    for v in range(len(limits)):
        limits[v] = most - limits[v] / 2.0


@kernel
def _walks(between: Floats) -> Floats:
    """The shortest walk from a to b ≤ a over the root, which is terminal 0, and all terminals of a set X.

    (2^(t−1), t, t) float, symmetric in a and b, inf where a or b is not among them, or a = b and others are. Bit i of
    X is terminal i + 1. The last terminal but the root of a walk is taken away, from whichever end.
    """
    terminals = len(between)
    walks = np.full((2 ** (terminals - 1), terminals, terminals), np.inf)
    walks[0, 0, 0] = 0.0
    for X in range(1, len(walks)):
        for b in range(1, terminals):
            if not X >> (b - 1) & 1:
                continue
            shorter = walks[X ^ (1 << (b - 1))]
            for a in range(terminals):
                for c in range(terminals):
                    walks[X, a, b] = min(walks[X, a, b], shorter[a, c] + between[c, b])
                walks[X, b, a] = walks[X, a, b]
    return walks
