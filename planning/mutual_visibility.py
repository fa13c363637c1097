"""The mutual visibility graph: which pairs of cells see each other with all their points.

Two convex cells P and Q are mutually visible iff the hull of P ∪ Q lies in free space (thesis §3.2.1). The hull's
border is a part of P's, a part of Q's, and two *bridges*, its common tangents. So the hull is free iff no wall crosses
a bridge and no hole lies in the quadrilateral between the bridges (§4.1.1, steps 2–5, with the bridges found directly
instead of through a hull).

Cells touch walls, and bridges of cells run along walls and through vertices: grazing is seeing. So every cell is first
shrunk about its centroid by the factor 1 − `SHRINKAGE`; then a bridge meets a wall only if it crosses it. An obstacle
that enters the hull by less than this share of a cell's size is not noticed.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import depth_first_order

from planning.decomposition import Cells, measure_cells

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SHRINKAGE = 1e-6
"""Smaller is less forgiving towards rounding: 1e-9 loses edges between slivers."""


def mutual_visibility(cells: Cells) -> csr_array:
    """The mutual visibility graph Q of thesis §3.2.1.

    Returns:
        (N, N) bool, symmetric, True on the diagonal.

    Complexity: O(N² V) at worst for N cells and V walls; most pairs cost a few wall tests, for the wall that hides a
    cell from another mostly hides its neighbours too.
    """
    environment, frame = cells.environment, cells.frame
    n = len(cells)
    centroids = measure_cells(cells.unit_corners, cells.starts)[1]
    centre = np.repeat(centroids, np.diff(cells.starts), axis=0)
    shrunk = centre + (1.0 - SHRINKAGE) * (cells.unit_corners - centre)
    walls = frame.enter(environment.walls.reshape(-1, 2)).reshape(-1, 4)
    holes = frame.enter(environment.vertices[environment.ring_starts[1:-1]])
    # Neighbours after each other: depth first along adjacency.
    order = depth_first_order(cells.adjacency, 0, directed=False, return_predecessors=False).astype(np.int64)
    seen = _find_visible(shrunk, cells.starts, centroids, order, walls, holes)
    flat = np.flatnonzero(seen)
    starts = np.concatenate([[0], np.cumsum(np.count_nonzero(seen, axis=1))])
    return csr_array((np.ones(len(flat), np.bool_), flat % n, starts), shape=(n, n))


@njit(cache=True, nogil=True)
def _crosses(wall: Floats, px: float, py: float, qx: float, qy: float) -> bool:
    """Whether the segment from p to q crosses a wall (4,): one end in front of it, the other not, and vice versa."""
    ax, ay, bx, by = wall[0], wall[1], wall[2], wall[3]
    dx, dy = bx - ax, by - ay
    if (dx * (py - ay) - dy * (px - ax) > 0.0) == (dx * (qy - ay) - dy * (qx - ax) > 0.0):
        return False
    ux, uy = qx - px, qy - py
    return bool((ux * (ay - py) - uy * (ax - px) > 0.0) != (ux * (by - py) - uy * (bx - px) > 0.0))


@njit(cache=True, nogil=True)
def _find_bridge(corners: Floats, p: int, p_end: int, q: int, q_end: int, side: float) -> tuple[int, int]:
    """Corners of two disjoint convex polygons whose line has no corner of either on the given side.

    ``side`` is 1 for the left of the line from the first polygon to the second, -1 for the right. From one end of the
    line to the tangent through the other, in turn; every turn moves the line towards that side. O(corners) a turn,
    two or three turns.
    """
    p_first, q_first = p, q
    for _ in range(p_end - p + q_end - q):
        moved = False
        x, y = corners[q, 0], corners[q, 1]
        for k in range(p_first, p_end):
            ux, uy = x - corners[p, 0], y - corners[p, 1]
            if side * (ux * (corners[k, 1] - corners[p, 1]) - uy * (corners[k, 0] - corners[p, 0])) > 0.0:
                p = k
                moved = True
        x, y = corners[p, 0], corners[p, 1]
        for k in range(q_first, q_end):
            ux, uy = corners[q, 0] - x, corners[q, 1] - y
            if side * (ux * (corners[k, 1] - y) - uy * (corners[k, 0] - x)) > 0.0:
                q = k
                moved = True
        if not moved:
            break
    return p, q


@njit(cache=True, nogil=True)
def _holds(corners: Floats, a: int, b: int, c: int, d: int, x: float, y: float) -> bool:
    """Whether (x, y) lies in the convex quadrilateral of four corners, counter-clockwise."""
    inside = True
    for i, j in ((a, b), (b, c), (c, d), (d, a)):
        ux, uy = corners[j, 0] - corners[i, 0], corners[j, 1] - corners[i, 1]
        inside = inside and ux * (y - corners[i, 1]) - uy * (x - corners[i, 0]) >= 0.0
    return inside


@njit(cache=True, nogil=True)
def _find_visible(corners: Floats, starts: Ints, centroids: Floats, order: Ints, walls: Floats, holes: Floats) -> Bools:
    """`mutual_visibility` as a dense (N, N) array.

    A segment from a cell into an obstacle crosses a wall that the cell has a corner in front of, so only those walls
    are tested. Before them come the walls that hid the previous cell of the row and the same cell in the previous row.
    """
    n = len(order)
    seen = np.zeros((n, n), np.bool_)
    hid = np.zeros(n, np.int64)  # by cell: the wall that last hid its centroid
    cut = np.zeros(n, np.int64)  # by cell: the wall that last crossed a bridge to it
    facing = np.empty(len(walls), np.int64)
    for row in range(n):
        i = order[row]
        seen[i, i] = True
        p, p_end = starts[i], starts[i + 1]
        px, py = centroids[i, 0], centroids[i, 1]
        m = 0
        for w in range(len(walls)):
            ax, ay = walls[w, 0], walls[w, 1]
            dx, dy = walls[w, 2] - ax, walls[w, 3] - ay
            for k in range(p, p_end):
                if dx * (corners[k, 1] - ay) - dy * (corners[k, 0] - ax) > 0.0:
                    facing[m] = w
                    m += 1
                    break
        last = 0
        for column in range(row + 1, n):
            j = order[column]
            qx, qy = centroids[j, 0], centroids[j, 1]
            if _crosses(walls[last], px, py, qx, qy):
                hid[j] = last
                continue
            if _crosses(walls[hid[j]], px, py, qx, qy):
                last = hid[j]
                continue
            hidden = False
            for f in range(m):
                if _crosses(walls[facing[f]], px, py, qx, qy):
                    last = facing[f]
                    hid[j] = last
                    hidden = True
                    break
            if hidden:
                continue
            q, q_end = starts[j], starts[j + 1]
            p_left, q_left = _find_bridge(corners, p, p_end, q, q_end, 1.0)
            p_right, q_right = _find_bridge(corners, p, p_end, q, q_end, -1.0)
            lx, ly, ltx, lty = corners[p_left, 0], corners[p_left, 1], corners[q_left, 0], corners[q_left, 1]
            rx, ry, rtx, rty = corners[p_right, 0], corners[p_right, 1], corners[q_right, 0], corners[q_right, 1]
            wall = walls[cut[j]]
            if _crosses(wall, lx, ly, ltx, lty) or _crosses(wall, rx, ry, rtx, rty):
                continue
            for f in range(m):
                wall = walls[facing[f]]
                if _crosses(wall, lx, ly, ltx, lty) or _crosses(wall, rx, ry, rtx, rty):
                    cut[j] = facing[f]
                    hidden = True
                    break
            for h in range(len(holes)):
                hidden = hidden or _holds(corners, p_right, q_right, q_left, p_left, holes[h, 0], holes[h, 1])
            if not hidden:
                seen[i, j] = seen[j, i] = True
    return seen
