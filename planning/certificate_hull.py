"""Whether all of one way sees all of another: the hull of every two straight pieces of them is free of walls.

Part of the certificate, and written apart from all planners. The sight lines between two straight pieces fill the
convex hull of their four ends. A wall keeps clear of that hull exactly if some line parts them; it is enough to try
the wall's own, the lines across its ends, and the six through two of the four ends, degenerate ones included: lines
whose ends are one point part nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@kernel
def _meets_hull(corners: Floats, ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether a wall has a point in the hull of four corners (4, 2)."""
    wx, wy = bx - ax, by - ay
    least = first = np.inf
    greatest = last = -np.inf
    for c in range(4):
        dx, dy = corners[c, 0] - ax, corners[c, 1] - ay
        side, past = wx * dy - wy * dx, wx * dx + wy * dy
        least, greatest = min(least, side), max(greatest, side)
        first, last = min(first, past), max(last, past)
    if least > 0.0 or greatest < 0.0 or last < 0.0 or first > wx * wx + wy * wy:
        return False
    for c in range(4):
        x, y = corners[c, 0], corners[c, 1]
        for d in range(c):
            ux, uy = corners[d, 0] - x, corners[d, 1] - y
            least, greatest = 0.0, 0.0
            for e in range(4):
                side = ux * (corners[e, 1] - y) - uy * (corners[e, 0] - x)
                least, greatest = min(least, side), max(greatest, side)
            side_a, side_b = ux * (ay - y) - uy * (ax - x), ux * (by - y) - uy * (bx - x)
            if min(side_a, side_b) > greatest or max(side_a, side_b) < least:
                return False
    return True


@kernel
def find_bounds(points: Floats, start: int, stop: int) -> tuple[float, float, float, float]:
    """Least and greatest x, least and greatest y of the points (n, 2) from ``start`` to before ``stop``."""
    left, low = right, high = points[start, 0], points[start, 1]
    for k in range(start + 1, stop):
        x, y = points[k, 0], points[k, 1]
        left, right, low, high = min(left, x), max(right, x), min(low, y), max(high, y)
    return left, right, low, high


@kernel
def _hull_is_free(corners: Floats, walls: Floats, near: Ints, count: int) -> bool:
    """Whether the first ``count`` of the walls ``near`` keep clear of the hull of four corners (4, 2)."""
    left, right, low, high = find_bounds(corners, 0, 4)
    for n in range(count):
        k = near[n]
        ax, ay, bx, by = walls[k, 0, 0], walls[k, 0, 1], walls[k, 1, 0], walls[k, 1, 1]
        if max(ax, bx) < left or min(ax, bx) > right or max(ay, by) < low or min(ay, by) > high:
            continue
        if _meets_hull(corners, ax, ay, bx, by):
            return False
    return True


@kernel
def see_throughout(p: Floats, q: Floats, walls: Floats) -> bool:
    """Whether every place on one way certainly sees every place on another.

    Args:
        p: (m, 2) float, metres, m ≥ 1: the one way, straight from point to point.
        q: (n, 2) the other.
        walls: (w, 2, 2) float, metres: receded, see `planning.certificate_sight`. Both ways lie in what they enclose.

    Complexity: O(w + m n v) for v walls near both ways.
    """
    left, right, low, high = find_bounds(p, 0, p.shape[0])
    start, stop, bottom, top = find_bounds(q, 0, q.shape[0])
    left, right, low, high = min(left, start), max(right, stop), min(low, bottom), max(high, top)
    near = np.empty(walls.shape[0], np.int64)
    count = 0
    for k in range(walls.shape[0]):
        ax, ay, bx, by = walls[k, 0, 0], walls[k, 0, 1], walls[k, 1, 0], walls[k, 1, 1]
        if max(ax, bx) >= left and min(ax, bx) <= right and max(ay, by) >= low and min(ay, by) <= high:
            near[count] = k
            count += 1
    corners = np.empty((4, 2))
    for i in range(max(1, p.shape[0] - 1)):
        for j in range(max(1, q.shape[0] - 1)):
            for axis in range(2):
                corners[0, axis], corners[1, axis] = p[i, axis], p[min(i + 1, p.shape[0] - 1), axis]
                corners[2, axis], corners[3, axis] = q[j, axis], q[min(j + 1, q.shape[0] - 1), axis]
            if not _hull_is_free(corners, walls, near, count):
                return False
    return True
