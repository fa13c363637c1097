"""Shortest paths on a dense matrix of edge weights: from one node, and between all pairs.

Dijkstra's algorithm with a binary heap, one run per source (thesis §3.3.2). On a dense matrix the time goes into
looking at edges that improve nothing, so a row is first tested block by block with vector instructions. Between all
pairs of an undirected graph, which visibility graphs are, `planning.floyd_warshall` is five times as fast.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.floyd_warshall import find_distances, find_predecessors
from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Bools = NDArray[np.bool_]

NO_PREDECESSOR: Final = -1
"""Predecessor of the source itself and of nodes that cannot be reached."""


BLOCK = 64
"""Edges tested at once."""

SHORTEST_EDGE: Final = 1e-9
"""Of the longest distance. What is shorter may drown in rounding, and predecessors then run in a circle."""


class NoPath(ValueError):
    """No path leads from the source to the target."""


def all_pairs(W: Floats) -> tuple[Floats, Ints]:
    """Distances and predecessors between all pairs of nodes.

    O(N³), 16 bytes a pair; above about 2000 nodes :func:`from_source` on demand serves better. Undirected graphs whose
    edges are not too short (:data:`SHORTEST_EDGE`) by the blocked algorithm of Floyd and Warshall, others by Dijkstra's
    from every source.

    Args:
        W: (N, N) float, not negative; W[u, v] is the weight of the edge u → v, inf where there is none. The diagonal
            is not looked at.

    Returns:
        distances: (N, N) float, inf where there is no path, 0 on the diagonal; the sum of the path's weights but for
            rounding.
        predecessors: (N, N) int32; [s, v] is the node before v on the path from s, :data:`NO_PREDECESSOR` for v = s
            and where there is no path.

    Raises:
        ValueError: W is not square, or holds a negative weight or a NaN.
    """
    W = _checked(W)
    if np.array_equal(W, W.T):
        distances, via = find_distances(W)
        least = W.min(where=~np.eye(len(W), dtype=np.bool_), initial=np.inf)
        farthest = distances.max(where=distances < np.inf, initial=0.0)
        if least > SHORTEST_EDGE * farthest:
            return distances, find_predecessors(distances, via)
    distances = np.empty(W.shape)
    predecessors = np.empty(W.shape, dtype=np.int32)
    _settle_all(W, distances, predecessors)
    return distances, predecessors


def from_source(W: Floats, source: int, relays: Bools | None = None) -> tuple[Floats, Ints]:
    """Distances and predecessors from one node; O(N² + N log N).

    Args:
        W: as in :func:`all_pairs`.
        source: node to start from.
        relays: (N,) bool: nodes that paths may pass *through*; all nodes may be ends. None: all.

    Returns:
        distances: (N,) float and predecessors: (N,) int32, like rows of :func:`all_pairs`.

    Raises:
        ValueError: W as in :func:`all_pairs`, or the source is no node.
    """
    W = _checked(W)
    if not 0 <= source < len(W):
        raise ValueError(f"node {source} does not exist: there are {len(W)}")
    allowed = np.ones(len(W), dtype=np.bool_) if relays is None else np.asarray(relays, dtype=np.bool_)
    distances = np.empty(len(W))
    predecessors = np.empty(len(W), dtype=np.int32)
    _settle(W, source, allowed, distances, predecessors)
    return distances, predecessors


def path(predecessors: Ints, source: int, target: int) -> list[int]:
    """Nodes from source to target, both included.

    Args:
        predecessors: (N,) int32, the source's row.
        source: where the row's paths start.
        target: where this path ends.

    Raises:
        NoPath: the target cannot be reached.
    """
    nodes = [target]
    while nodes[-1] != source:
        before = int(predecessors[nodes[-1]])
        if before == NO_PREDECESSOR:
            raise NoPath(f"no path leads from node {source} to node {target}")
        nodes.append(before)
    return nodes[::-1]


def _checked(W: Floats) -> Floats:
    W = np.ascontiguousarray(W, dtype=np.float64)
    if W.ndim != 2 or W.shape[0] != W.shape[1]:
        raise ValueError(f"edge weights form a square matrix, not one of shape {W.shape}")
    if not np.all(W >= 0):
        row, column = np.argwhere(~(W >= 0))[0]
        raise ValueError(f"edge weights are not negative, but W[{row}, {column}] is {W[row, column]}")
    return W


@kernel
def _settle_all(W: Floats, distances: Floats, predecessors: Ints) -> None:
    relays = np.ones(len(W), dtype=np.bool_)
    for source in range(len(W)):
        _settle(W, source, relays, distances[source], predecessors[source])


@kernel
def _settle(W: Floats, source: int, relays: Bools, distances: Floats, predecessors: Ints) -> None:
    """Dijkstra from one source into one row of distances and one of predecessors.

    The heap holds the reached nodes that are not settled; ``places`` says where each one stands in it.
    """
    number = len(W)
    distances[:] = np.inf
    predecessors[:] = NO_PREDECESSOR
    heap = np.empty(number, dtype=np.int32)
    places = np.full(number, -1, dtype=np.int32)
    distances[source] = 0.0
    heap[0] = source
    places[source] = 0
    size = 1
    while size > 0:
        node = heap[0]
        size -= 1
        _sink(heap, places, distances, heap[size], size)
        if not relays[node] and node != source:
            continue
        distance = distances[node]
        weights = W[node]
        for start in range(0, number, BLOCK):
            stop = min(start + BLOCK, number)
            if not _improves(weights[start:stop], distances[start:stop], distance):
                continue
            for head in range(start, stop):
                if distance + weights[head] < distances[head]:
                    distances[head] = distance + weights[head]
                    predecessors[head] = node
                    if places[head] < 0:
                        places[head] = size
                        size += 1
                    _rise(heap, places, distances, head)


@kernel
def _improves(weights: Floats, distances: Floats, distance: float) -> bool:
    """Whether any distance falls. Counts without a branch, so that the loop becomes vector instructions."""
    improved = 0
    for place in range(len(weights)):
        improved += distance + weights[place] < distances[place]
    return improved > 0


@kernel
def _sink(heap: Ints, places: Ints, distances: Floats, node: int, size: int) -> None:
    """Put the node in at the root of a heap of this size, whose root is free, and let it sink."""
    place = 0
    while True:
        child = 2 * place + 1
        if child >= size:
            break
        if child + 1 < size and distances[heap[child + 1]] < distances[heap[child]]:
            child += 1
        if distances[heap[child]] >= distances[node]:
            break
        heap[place] = heap[child]
        places[heap[place]] = place
        place = child
    heap[place] = node
    places[node] = place


@kernel
def _rise(heap: Ints, places: Ints, distances: Floats, node: int) -> None:
    """Let a node rise from its place after its distance fell."""
    place = places[node]
    while place > 0:
        above = (place - 1) >> 1
        if distances[heap[above]] <= distances[node]:
            break
        heap[place] = heap[above]
        places[heap[place]] = place
        place = above
    heap[place] = node
    places[node] = place
