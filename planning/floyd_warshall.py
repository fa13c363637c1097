"""All shortest distances of an undirected graph by the blocked algorithm of Floyd and Warshall.

Floyd (DOI 10.1145/367766.368168) lets paths pass through one node after the other. Here ``BLOCK`` nodes K are taken at
a time, so that what is read stays in the processor's cache (Venkataraman, Sahni and Mukhopadhyaya,
DOI 10.1145/996546.996553):

1. d[k, j] for k and j in K, with paths through K;
2. d[k, j] for k in K and all j, with paths through K, from 1 and the old d[k, j];
3. d[i, j] = min over k in K of d[i, k] + d[k, j] for all i, j.

As d is symmetric, only d[i, j] with j ≤ i are kept up to date, and 3 needs no columns: d[i, k] is d[k, i]. The inner
loop runs over j, without a branch and with nothing but additions, comparisons and selections: vector instructions.

*Paths.* Beside d stands ``via[i, j]``, the last k that shortened d[i, j]; the path is that from i to k and that from
k to j. Where all edges are longer than the rounding of d, distances fall along a path, and it comes to an end.

Measured on 681 cells, as multiples of this: Dijkstra's algorithm from every source 5.3, the same blocks without the use
of symmetry 3, blocks of 64 nodes 1.2, minima first and the k of each looked for afterwards 1.2.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

BLOCK: Final = 32
"""Nodes taken at a time: 32 rows of some hundred floats stay in the second-level cache."""

NONE: Final = -1
"""No node between: the edge itself, or no path."""


@kernel
def find_distances(W: Floats) -> tuple[Floats, Ints]:
    """Distances (N, N) and nodes between (N, N), as above, of symmetric weights (N, N) that are not negative. O(N³)."""
    n = len(W)
    distances = W.copy()
    via = np.full((n, n), NONE, np.int32)
    for i in range(n):
        distances[i, i] = 0.0
    for start in range(0, n, BLOCK):
        end = min(n, start + BLOCK)
        rows, rows_via = _read_rows(distances, via, start, end)
        _close_rows(rows, rows_via, start)
        columns, columns_via = np.ascontiguousarray(rows.T), np.ascontiguousarray(rows_via.T)
        distances[start:end], via[start:end] = rows, rows_via
        for i in range(n):
            if i >= end:
                distances[i, start:end], via[i, start:end] = columns[i], columns_via[i]
            if not start <= i < end:
                _relax(distances[i], via[i], 0, i + 1, columns[i], rows, start)
    for i in range(n):
        for j in range(i):
            distances[j, i], via[j, i] = distances[i, j], via[i, j]
    return distances, via


@kernel
def find_predecessors(distances: Floats, via: Ints) -> Ints:
    """The last node before j on the path from i, (N, N); `NONE` where i is j or there is no path.

    O(N²) times the number of vias that a path is made of, less than its hops.
    """
    n = len(via)
    predecessors = np.full((n, n), NONE, np.int32)
    for i in range(n):
        for j in range(n):
            if i != j and distances[i, j] < np.inf:
                before = np.int32(i)
                while via[before, j] != NONE:
                    before = via[before, j]
                predecessors[i, j] = before
    return predecessors


@kernel
def _read_rows(distances: Floats, via: Ints, start: int, end: int) -> tuple[Floats, Ints]:
    """Whole rows ``start`` to ``end`` of both tables, of which only the entries with j ≤ i are up to date."""
    n = len(distances)
    rows, rows_via = distances[start:end].copy(), via[start:end].copy()
    for i in range(start + 1, n):
        for k in range(start, min(i, end)):
            rows[k - start, i], rows_via[k - start, i] = distances[i, k], via[i, k]
    return rows, rows_via


@kernel
def _close_rows(rows: Floats, rows_via: Ints, start: int) -> None:
    """Steps 1 and 2 for the nodes from ``start`` on, one for each row."""
    end = start + len(rows)
    for k in range(len(rows)):
        for i in range(len(rows)):
            offset = rows[i, start + k : start + k + 1].copy()
            _relax(rows[i], rows_via[i], start, end, offset, rows[k : k + 1], start + k)
    before = rows.copy()
    for i in range(len(rows)):
        _relax(rows[i], rows_via[i], 0, rows.shape[1], before[i, start:end], before, start)


@kernel
def _relax(distances: Floats, via: Ints, low: int, high: int, offsets: Floats, rows: Floats, first: int) -> None:
    """distances[j] = min over k of offsets[k] + rows[k, j], for j from low to high; row k is that of node first + k.

    Four rows at a time, so that a distance is loaded and stored once for four candidates. More rows are so many arrays
    that the compiler does not check whether they overlap, and makes no vector instructions.
    """
    k = 0
    while k + 4 <= len(rows):
        via_0, via_1, via_2, via_3 = (
            np.int32(first + k),
            np.int32(first + k + 1),
            np.int32(first + k + 2),
            np.int32(first + k + 3),
        )
        offset_0, offset_1, offset_2, offset_3 = offsets[k], offsets[k + 1], offsets[k + 2], offsets[k + 3]
        row_0, row_1, row_2, row_3 = rows[k], rows[k + 1], rows[k + 2], rows[k + 3]
        for j in range(low, high):
            least, through = distances[j], via[j]
            candidate = offset_0 + row_0[j]
            through = via_0 if candidate < least else through
            least = candidate if candidate < least else least
            candidate = offset_1 + row_1[j]
            through = via_1 if candidate < least else through
            least = candidate if candidate < least else least
            candidate = offset_2 + row_2[j]
            through = via_2 if candidate < least else through
            least = candidate if candidate < least else least
            candidate = offset_3 + row_3[j]
            through = via_3 if candidate < least else through
            least = candidate if candidate < least else least
            distances[j], via[j] = least, through
        k += 4
    while k < len(rows):
        for j in range(low, high):
            if offsets[k] + rows[k, j] < distances[j]:
                distances[j], via[j] = offsets[k] + rows[k, j], first + k
        k += 1
