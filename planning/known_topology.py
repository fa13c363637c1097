"""The cheapest placements of a tree whose topology is known: thesis §3.3.4 and §3.5.1, algorithms 4–6, corrected.

The cost of a tree is what its nodes pay to move and μ times what its edges weigh. Removing an edge leaves two trees
that know of each other only through the placements at its ends, so (eq. 45) the least cost of the part of the tree
below node i, with i in placement v, is

    C_i(v) = move_i(v) + sum over children j of min over u of C_j(u) + μ W[u, v]

from the leaves to the root; then the placements are read off from the root to the leaves. Corrected: algorithm 4 fills
in the *physical* costs (line 7 says W_v), and algorithm 5, line 4, minimises over the placement of the child j.

Without costs of moving — every row of ``move`` is 0, or finite in one place for a target — this is the deployment with
known topology of §3.3.4.

A tree whose nodes may idle keeps what it takes to join its ends: branches without an end are left out, as each node
and edge of theirs only adds to the cost.
"""

from __future__ import annotations

import numpy as np

from planning.min_plus import Links, min_plus
from planning.tree import Floats, Ints


def neighbours_of(tree: Ints, nodes: int) -> list[list[int]]:
    """The neighbours of each of the nodes in a tree given as (m, 2) int pairs of nodes."""
    neighbours: list[list[int]] = [[] for _ in range(nodes)]
    for i, j in tree.tolist():
        neighbours[i].append(j)
        neighbours[j].append(i)
    return neighbours


def place_nodes(links: Links, move: Floats, tree: Ints, ends: list[int]) -> tuple[Ints, Ints] | None:
    """The cheapest placements for a topology.

    Args:
        links: of N placements.
        move: (k, N) float, not negative: what it costs node i to go to placement v; inf where it cannot.
        tree: (m, 2) int: pairs of nodes. The first end, and all that hangs together with it, is the tree.
        ends: nodes that have to stay; branches that hold none of them are left out. All nodes: none is left out.

    Returns:
        The edges of ``tree`` that are left, and the placement of each node, (k,) int, -1 for those left out. None if
        no placements are possible.

    Complexity: O(k m) for m links, at most O(k N²).
    """
    hanging = _Hanging(links, move, tree, ends)
    costs, cells = hanging.costs, np.full(len(move), -1, dtype=np.int64)
    cells[ends[0]] = np.argmin(costs[ends[0]])
    if np.isinf(costs[ends[0], cells[ends[0]]]):
        return None
    for generation in hanging.generations[1:]:
        for i in generation:
            choices, weights = links.of(int(cells[hanging.parents[i]]))
            cells[i] = choices[np.argmin(costs[i, choices] + weights)]
    return tree[(cells[tree] >= 0).all(axis=1)], cells


def topology_cost(links: Links, move: Floats, tree: Ints, ends: list[int]) -> float:
    """The cost of what :func:`place_nodes` finds, inf if it finds nothing; arguments as there."""
    return float(_Hanging(links, move, tree, ends).costs[ends[0]].min())


class _Hanging:
    """What the part of the tree below each node costs; the first end is the root."""

    def __init__(self, links: Links, move: Floats, tree: Ints, ends: list[int]) -> None:
        neighbours = neighbours_of(tree, len(move))
        generations = [[ends[0]]]
        self.parents = {ends[0]: -1}
        while generations[-1]:
            for i in generations[-1]:
                self.parents.update((j, i) for j in neighbours[i] if j != self.parents[i])
            generations.append([j for i in generations[-1] for j in neighbours[i] if j != self.parents[i]])
        kept = set(ends)
        for generation in reversed(generations):
            kept |= {self.parents[i] for i in generation if i in kept}
        self.generations = [[i for i in generation if i in kept] for generation in generations]
        """The nodes that stay, by how many edges they are away from the root."""
        self.costs = move.copy()
        """(k, N) float: C of the nodes that stay."""
        for hanging in self.generations[:0:-1]:
            for i, hung in zip(hanging, min_plus(links, self.costs[hanging]), strict=True):
                self.costs[self.parents[i]] += hung
