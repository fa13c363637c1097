"""The distance network of some terminals: how far every placement is from each of them, and by which way.

All Steiner tree algorithms start from it (thesis §3.3.3). A few sources on a dense matrix of weights are served best by
Δ-stepping (U. Meyer, P. Sanders 2003, doi:10.1016/S0196-6774(03)00076-2): all placements whose cost is within a step
of the least that waits pass it on together, row by row with vector instructions and without a heap. The step changes
the time, never the result.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel
from planning.shortest_paths import NO_PREDECESSOR
from planning.tree import Floats, Ints, NoTree

Nodes = NDArray[np.int32]


@dataclass(frozen=True, slots=True, eq=False)
class DistanceNetwork:
    """Shortest paths from every terminal."""

    terminals: Ints
    """(t,) int: placements, all different."""
    distances: Floats
    """(t, N) float: from terminal i to placement v."""
    predecessors: Nodes
    """(t, N) int32: the placement before v on that path, or :data:`planning.shortest_paths.NO_PREDECESSOR`."""
    step: float
    """The Δ of Δ-stepping that suits these weights."""

    def path(self, terminal: int, placement: int) -> list[tuple[int, int]]:
        """Edges of the shortest path from the terminal of this index to a placement, the last one first."""
        edges = []
        while (before := int(self.predecessors[terminal, placement])) != NO_PREDECESSOR:
            edges.append((before, placement))
            placement = before
        return edges


def distance_network(W: Floats, terminals: Ints) -> DistanceNetwork:
    """Shortest paths from each terminal to every placement.

    Args:
        W: (N, N) float, checked.
        terminals: (t,) int: placements, all different.

    Raises:
        NoTree: a terminal cannot be reached from the first.

    Complexity: O(t N²) for a step near the weights of the links, at worst O(t N³).
    """
    shape = (len(terminals), len(W))
    distances, predecessors = np.full(shape, np.inf), np.full(shape, NO_PREDECESSOR, dtype=np.int32)
    distances[np.arange(len(terminals)), terminals] = 0.0
    links = np.delete(W[terminals[0]], terminals[0])
    links = links[links < np.inf]
    step = float(links.mean()) / 2.0 if len(links) else 0.0
    unlimited = np.full(len(W), np.inf)
    for i, terminal in enumerate(terminals):
        lower(W, distances[i], predecessors[i], unlimited, step)
        if i == 0 and np.isinf(distances[0, terminals]).any():
            lost = int(np.argmax(np.isinf(distances[0, terminals])))
            raise NoTree(
                f"the terminal in placement {terminals[lost]} cannot be reached from the one in placement {terminal}"
            )
    return DistanceNetwork(terminals, distances, predecessors, step)


@kernel
def lower(W: Floats, costs: Floats, predecessors: Nodes, limits: Floats, step: float) -> None:
    """Lower costs that are known somewhere to the least over all paths that lead on from there.

    Args:
        W: (N, N) float.
        costs: (N,) float, inf where unknown; changed.
        predecessors: (N,) int32: where a lowered cost came from; changed.
        limits: (N,) float: a cost above it is of no use and is not passed on.
        step: costs that differ by no more are passed on together.
    """
    number = len(W)
    passed = np.full(number, np.inf)
    while True:
        least = np.inf
        for u in range(number):
            if costs[u] < passed[u] and costs[u] <= limits[u] and costs[u] < least:
                least = costs[u]
        if least == np.inf:
            return
        for u in range(number):
            if costs[u] < passed[u] and costs[u] <= limits[u] and costs[u] <= least + step:
                passed[u] = costs[u]
                _pass_on(W[u], costs[u], u, costs, predecessors)


@kernel
def _pass_on(weights: Floats, cost: float, node: int, costs: Floats, predecessors: Nodes) -> None:
    """Over the links of one node; apart, so that it becomes vector instructions."""
    for v in range(len(weights)):
        total = cost + weights[v]
        if total < costs[v]:
            costs[v] = total
            predecessors[v] = node
