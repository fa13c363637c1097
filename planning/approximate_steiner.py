"""Approximate Steiner trees: at most 2 (1 − 1/t) times the least cost for t terminals, in polynomial time."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from planning.distance_network import DistanceNetwork, Nodes
from planning.kernel import kernel
from planning.tree import Floats, Ints, Tree, joining_tree


def minimum_spanning_approximation(W: Floats, network: DistanceNetwork) -> Tree:
    """The minimum spanning tree of the distance network, its edges expanded into paths (thesis §3.3.3, alg. 2).

    L. Kou, G. Markowsky, L. Berman 1981, doi:10.1007/BF00288961.

    Complexity: O(t² log t + t N), the distance network given.
    """
    between = network.distances[:, network.terminals]
    indices = np.arange(len(network.terminals))
    spanning = joining_tree(between, combinations(range(len(indices)), 2), indices)
    edges = [edge for a, b in spanning.edges.tolist() for edge in network.path(a, int(network.terminals[b]))]
    return joining_tree(W, edges, network.terminals)


def takahashi_matsuyama(W: Floats, network: DistanceNetwork) -> Tree:
    """From one terminal, the terminal nearest to the tree is joined to it next, and so on (thesis §3.3.3, alg. 3).

    H. Takahashi, A. Matsuyama 1980, Mathematica Japonica 24(6). The algorithm leaves open where it starts: every
    terminal is tried, and the cheapest tree is kept, so that the answer does not depend on the order of terminals.

    Complexity: O(t² N), the distance network given.
    """
    best_cost, best_edges = np.inf, np.empty((0, 2), dtype=np.int64)
    for start in range(len(network.terminals)):
        cost, edges = _grow(network.distances, network.predecessors, network.terminals, start)
        if cost < best_cost:
            best_cost, best_edges = cost, edges
    return joining_tree(W, [(u, v) for u, v in best_edges.tolist()], network.terminals)


@kernel
def _grow(distances: Floats, predecessors: Nodes, terminals: Ints, start: int) -> tuple[float, Ints]:
    """Cost and edges (m, 2) of the tree grown from one terminal; the others come by their own shortest paths."""
    number = distances.shape[1]
    edges = np.empty((number, 2), dtype=np.int64)
    in_tree = np.zeros(number, dtype=np.bool_)
    in_tree[terminals[start]] = True
    away = distances[:, terminals[start]].copy()  # from each terminal to the tree
    nearest = np.full(len(terminals), terminals[start])  # where it would be joined
    away[start] = np.inf  # it is joined
    cost, size = 0.0, 0
    for _ in range(len(terminals) - 1):
        joining = np.argmin(away)
        cost += away[joining]
        v = nearest[joining]
        away[joining] = np.inf
        while v != terminals[joining]:
            u, v = v, predecessors[joining, v]
            if in_tree[v]:
                continue
            in_tree[v] = True
            edges[size, 0], edges[size, 1] = u, v
            size += 1
            for i in range(len(terminals)):
                if distances[i, v] < away[i] < np.inf:
                    away[i] = distances[i, v]
                    nearest[i] = v
    return cost, edges[:size]
