"""The mutual visibility graph: which pairs of cells see each other with all their points.

Two convex cells P and Q are mutually visible iff the hull of P ∪ Q lies in free space (thesis §3.2.1, and §4.1.1,
steps 2–5); see `planning.hull_obstacles`. Two observations make that cheap:

- The wall that hides a cell mostly hides its neighbours too. It is tried first, on the segment of the centroids.
- Every aspect cell lies in one inflection cell, its *parent*, and inherits what enters the hull of its parent and the
  other's: nothing, and they see each other; a wall that parts the parents, and they do not; or a few walls and their
  ends. Then the hull of the cells themselves is free iff none of those walls crosses the segment of the centroids and
  none of those ends lies inside it: a wall that enters a hull and does not end there goes through, between the cells.

Cells touch walls, and bridges of cells run along walls and through vertices: grazing is seeing. So every cell is first
shrunk about its centroid by the factor 1 − `SHRINKAGE`; then a bridge meets a wall only if it crosses it. An obstacle
that enters the hull by less than this share of a cell's size is not noticed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import depth_first_order

from planning.decomposition import Cells, decompose, measure_cells
from planning.hull_obstacles import (
    NONE,
    CornerIndices,
    crosses,
    find_entering,
    find_tangents,
    is_inside_hull,
    sort_walls,
)
from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SHRINKAGE = 1e-6
"""Smaller is less forgiving towards rounding: 1e-9 loses edges between slivers."""

PARENT_SHRINKAGE = 1e-9
"""Smaller than that of the cells, so that what enters the hull of two cells is found in that of their parents."""

MOST_CELLS = 20_000
"""Above this the graph alone takes hundreds of megabytes, and what is computed from it gigabytes."""


class TooManyCells(ValueError):
    """More cells than a mutual visibility graph is made for; the text is one sentence with map and remedy."""


def mutual_visibility(cells: Cells) -> csr_array:
    """The mutual visibility graph Q of thesis §3.2.1.

    Returns:
        (N, N) bool, symmetric, True on the diagonal.

    Raises:
        TooManyCells: more than `MOST_CELLS`.

    Complexity: O(M² V + N²) for N aspect cells in M parents, as few of the V walls enter the hull of two parents;
    O(N² V) for inflection cells, where a hidden pair mostly costs O(1). N² bytes besides the graph.
    """
    n = len(cells)
    if n > MOST_CELLS:
        raise TooManyCells(
            f"{cells.environment.name or 'the map'} has {n} {cells.kind} cells, more than the {MOST_CELLS} that a "
            f"mutual visibility graph is made for: use inflection cells, shorter bitangents or a simpler map"
        )
    divided = cells.kind == "aspect"
    parents = decompose(cells.environment, "inflection") if divided else cells
    parent = parents.locate(cells.centroids) if divided else np.arange(n)
    members = np.argsort(parent, kind="stable")
    seen = _find_visible(
        *_shrink(parents, PARENT_SHRINKAGE if divided else SHRINKAGE),
        # Neighbours after each other: depth first along adjacency.
        depth_first_order(parents.adjacency, 0, directed=False, return_predecessors=False).astype(np.int64),
        *_shrink(cells, SHRINKAGE),
        members,
        np.searchsorted(parent[members], np.arange(len(parents) + 1)),
        cells.frame.enter(cells.environment.walls.reshape(-1, 2)).reshape(-1, 4),
        cells.environment.successors.copy(),  # kernels are compiled for arrays that can be written to
        divided,
    )
    columns, starts = _list_true(seen)
    return csr_array((np.ones(len(columns), np.bool_), columns, starts), shape=(n, n))


def _shrink(cells: Cells, share: float) -> tuple[Floats, Ints, Floats]:
    """The cells shrunk about their centroids: corners (C, 2), starts (N + 1,), centroids (N, 2), unit frame."""
    centroids = measure_cells(cells.unit_corners, cells.starts)[1]
    centre = np.repeat(centroids, np.diff(cells.starts), axis=0)
    return centre + (1.0 - share) * (cells.unit_corners - centre), cells.starts, centroids


@kernel
def _find_visible(
    parent_corners: Floats,
    parent_starts: Ints,
    parent_centroids: Floats,
    order: Ints,
    corners: Floats,
    starts: Ints,
    centroids: Floats,
    members: Ints,
    member_starts: Ints,
    walls: Floats,
    after: Ints,
    divided: bool,
) -> Bools:
    """`mutual_visibility` as a dense (N, N) array.

    Args:
        parent_corners: of M parents, shrunk, one after the other.
        parent_starts: (M + 1,), where each parent's corners start.
        parent_centroids: (M, 2).
        order: (M,), puts near parents after each other.
        corners: (C, 2), of N cells, shrunk.
        starts: (N + 1,), where each cell's corners start.
        centroids: (N, 2), of the cells.
        members: (N,), the cells, by parent.
        member_starts: (M + 1,), where each parent's cells start.
        walls: (V, 4).
        after: (V,), the vertex at each wall's end.
        divided: False if the cells are their own parents.
    """
    seen = np.zeros((len(starts) - 1, len(starts) - 1), np.bool_)
    front, behind = sort_walls(parent_corners, parent_starts, walls)
    vertices = walls if divided else walls[:0]
    parent_right, parent_left = find_tangents(parent_corners, parent_starts, vertices)
    right, left = find_tangents(corners, starts, vertices)
    hides = np.zeros(len(order), np.int64)  # by parent: the wall that last hid it
    entering, ends = np.empty(len(walls), np.int64), np.empty(2 * len(walls), np.int64)
    for row in range(len(order)):
        i = order[row]
        first = members[member_starts[i] : member_starts[i + 1]]
        for p in first:
            for q in first:
                seen[p, q] = True
        facing = np.flatnonzero(front[i])
        last = 0  # the wall that last hid a cell of this row
        for column in range(row + 1, len(order)):
            j = order[column]
            if not divided:
                px, py = parent_centroids[i, 0], parent_centroids[i, 1]
                qx, qy = parent_centroids[j, 0], parent_centroids[j, 1]
                if crosses(walls, last, px, py, qx, qy):
                    continue
                if crosses(walls, hides[j], px, py, qx, qy):
                    last = hides[j]
                    continue
            number = 0
            for w in facing:
                entering[number] = w
                number += behind[j, w]
            if number > 0:
                number, parting = find_entering(
                    parent_corners,
                    parent_starts[i],
                    parent_starts[i + 1],
                    parent_starts[j],
                    parent_starts[j + 1],
                    walls,
                    entering,
                    number,
                    len(walls) if divided else 1,
                )
                if number > 0 and not divided:
                    parting = entering[0]
                if parting != NONE:
                    last = hides[j] = parting
                    continue
            ends_number = 0
            if number > 0:
                ends_number = _find_ends(
                    parent_corners, parent_right, parent_left, i, j, walls, after, entering, number, ends
                )
            for k in range(member_starts[i], member_starts[i + 1]):
                p = members[k]
                for m in range(member_starts[j], member_starts[j + 1]):
                    q = members[m]
                    hidden = False
                    for e in range(number):
                        if crosses(
                            walls, entering[e], centroids[p, 0], centroids[p, 1], centroids[q, 0], centroids[q, 1]
                        ):
                            hidden = True
                            break
                    for e in range(0 if hidden else ends_number):
                        v = ends[e]
                        if is_inside_hull(
                            corners, walls[v, 0], walls[v, 1], right[p, v], left[p, v], right[q, v], left[q, v]
                        ):
                            hidden = True
                            break
                    if not hidden:
                        seen[p, q] = seen[q, p] = True
    return seen


@kernel
def _find_ends(
    corners: Floats,
    right: CornerIndices,
    left: CornerIndices,
    i: int,
    j: int,
    walls: Floats,
    after: Ints,
    entering: Ints,
    count: int,
    ends: Ints,
) -> int:
    """The ends of the first ``count`` entering walls that lie inside the hull of i and j, each once, and how many."""
    found = 0
    for k in range(count):
        for v in (entering[k], after[entering[k]]):
            new = is_inside_hull(corners, walls[v, 0], walls[v, 1], right[i, v], left[i, v], right[j, v], left[j, v])
            for e in range(found):
                new = new and ends[e] != v
            if new:
                ends[found] = v
                found += 1
    return found


@kernel
def _list_true(seen: Bools) -> tuple[CornerIndices, CornerIndices]:
    """Columns of the true entries, row by row, and where each row starts, (N + 1,)."""
    starts = np.zeros(len(seen) + 1, np.int32)
    for i in range(len(seen)):
        starts[i + 1] = starts[i] + np.count_nonzero(seen[i])
    columns = np.empty(starts[-1], np.int32)
    entry = 0
    for i in range(len(seen)):
        for j in range(len(seen)):
            if seen[i, j]:
                columns[entry] = j
                entry += 1
    return columns, starts
