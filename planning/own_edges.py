"""What one member of a team can say of the next tree: the best in which an edge of its own is another one.

Algorithm 7 of the thesis (§3.6) tries all trees one edge away from the present one. Hang the tree from one of its ends,
and each edge is the own edge of the member below it, the one towards that end. If every member tries what could stand
in the place of its own, all trees of algorithm 7 are tried, each by one member, and the cheapest of what the members
find is what :func:`planning.redeployment.redeploy` finds with ``search="one-edge"``.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.edge_modification import find_exchanges
from planning.known_topology import place_nodes
from planning.min_plus import scaled_links

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Edge = tuple[int, int]


@dataclass(frozen=True, slots=True, eq=False)
class OwnExchange:
    """The cheapest tree that a member has found."""

    cost: float
    """Costs of moving and weights of the edges; inf if no tree can be placed."""
    tree: Ints
    """(m, 2) int: edges between nodes that do not idle."""
    cells: Ints
    """(k,) int: the placement of each node; -1 for nodes that idle."""
    removed: Edge | None
    """The own edge that the tree does without; None: the present tree is the cheapest."""
    added: Edge | None
    """The edge in its place."""


def exchange_own(move: Floats, W: Floats, tree: Ints, ends: list[int], own: Collection[Edge]) -> OwnExchange:
    """The cheapest among a tree and those that have another edge in the place of one of some edges.

    Args:
        move: (k, N) float, not negative: what it costs node i to go to placement v; inf where it cannot.
        W: (N, N) float, symmetric, not negative: weights of the direct links; inf where there is none.
        tree: (k − 1, 2) int: pairs of nodes, the present topology.
        ends: nodes that stay; the others may idle.
        own: edges of ``tree`` that may be exchanged.

    Complexity: O(k N²) for the messages of the tree, O(k N² + k² N) for each own edge.
    """
    links = scaled_links(W, 1.0)
    cost, exchanges = find_exchanges(links, move, tree, ends, own)
    best = exchanges[0] if exchanges else None
    modified = tree if best is None else best.applied(tree)
    placed = place_nodes(links, move, modified, ends)
    if placed is None:
        return OwnExchange(np.inf, tree[:0], np.full(len(move), -1, dtype=np.int64), None, None)
    if best is None:
        return OwnExchange(cost, *placed, None, None)
    (i, j), (m, n) = best.cut, best.added
    return OwnExchange(best.cost, *placed, (int(i), int(j)), (int(m), int(n)))


def own_edges(tree: Ints, root: int) -> dict[int, Edge]:
    """The own edge of each node but the root of a tree (m, 2): the one towards the root. O(m²)."""
    edges = [(int(i), int(j)) for i, j in tree]
    own: dict[int, Edge] = {}
    reached = [root]
    for node in reached:
        for edge in edges:
            if node in edge and own.get(node) != edge:
                other = edge[0] + edge[1] - node
                own[other] = edge
                reached.append(other)
    return own
