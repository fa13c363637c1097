"""Closed line of sight among walls: a segment that grazes a wall or a vertex is visible, one that crosses is not.

Symbols: the segment runs from p to q, a wall from a to b with free space on its left. d is the signed distance of a
wall's end from the line pq, e that of a segment's end from the line ab. Everything nearer than ``tolerance`` (a length,
`Environment.tolerance_m`) counts as touching.

A wall blocks at once when a and b lie clearly on different sides of pq and p and q clearly on different sides of ab. A
segment that touches nothing is visible when p is in free space. Only a segment that touches something needs care: its
touches cut it into pieces, none of which changes sides, so the middle of each piece tells for the whole piece. The
answer is exact for a segment that keeps clear of all walls or crosses one clearly; a segment that dips into a wall by
less than twice the tolerance is taken to graze it.

Thesis §3.1 (the function L(x, y)) and §4.2.1, with the degenerate cases that it leaves open.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]


@kernel
def point_is_free(x: float, y: float, walls: Floats, tolerance: float) -> bool:
    """Whether a point lies in the closed free space, which reaches ``tolerance`` into the walls.

    ``walls`` (w, 2, 2) float, metres, map frame. O(w): crossings of the ray to the right, and the distance from each
    wall, without which a point on a wall would fall to either side by rounding.
    """
    inside = False
    squared = tolerance * tolerance
    for i in range(walls.shape[0]):
        ax, ay = walls[i, 0, 0] - x, walls[i, 0, 1] - y
        bx, by = walls[i, 1, 0] - x, walls[i, 1, 1] - y
        if min(ay, by) > tolerance or max(ay, by) < -tolerance or max(ax, bx) < -tolerance:
            continue
        wx, wy = bx - ax, by - ay
        t = min(1.0, max(0.0, -(ax * wx + ay * wy) / (wx * wx + wy * wy)))
        nx, ny = ax + t * wx, ay + t * wy
        if nx * nx + ny * ny <= squared:
            return True
        if (ay > 0.0) != (by > 0.0) and (ax * by - ay * bx > 0.0) == (by > ay):
            inside = not inside
    return inside


@kernel
def _find_touches(px: float, py: float, qx: float, qy: float, walls: Floats, tolerance: float, touching: Ints) -> int:
    """Write the walls that the segment touches into ``touching`` (w,); their number, or −1 if a wall clearly blocks."""
    ux, uy = qx - px, qy - py
    length = math.sqrt(ux * ux + uy * uy)
    ux, uy = ux / length, uy / length
    n = 0
    for i in range(walls.shape[0]):
        ax, ay = walls[i, 0, 0], walls[i, 0, 1]
        bx, by = walls[i, 1, 0], walls[i, 1, 1]
        da = ux * (ay - py) - uy * (ax - px)
        db = ux * (by - py) - uy * (bx - px)
        if (da > tolerance and db > tolerance) or (da < -tolerance and db < -tolerance):
            continue
        wx, wy = bx - ax, by - ay
        reach = tolerance * math.sqrt(wx * wx + wy * wy)
        ep = wx * (py - ay) - wy * (px - ax)
        eq = wx * (qy - ay) - wy * (qx - ax)
        if (ep > reach and eq > reach) or (ep < -reach and eq < -reach):
            continue
        if min(abs(da), abs(db)) > tolerance and min(abs(ep), abs(eq)) > reach:
            return -1
        touching[n] = i
        n += 1
    return n


@kernel
def _pieces_are_free(
    px: float, py: float, qx: float, qy: float, walls: Floats, tolerance: float, touching: Ints
) -> bool:
    """Whether the middle of every piece between the segment's touches is free; no wall clearly blocks it."""
    vx, vy = qx - px, qy - py
    length = math.sqrt(vx * vx + vy * vy)
    cuts = np.empty(2 + 3 * len(touching))
    cuts[0], cuts[1] = 0.0, 1.0
    n = 2
    for i in touching:
        ax, ay = walls[i, 0, 0], walls[i, 0, 1]
        bx, by = walls[i, 1, 0], walls[i, 1, 1]
        da = (vx * (ay - py) - vy * (ax - px)) / length
        db = (vx * (by - py) - vy * (bx - px)) / length
        if abs(da) <= tolerance:
            cuts[n] = (vx * (ax - px) + vy * (ay - py)) / (length * length)
            n += 1
        if abs(db) <= tolerance:
            cuts[n] = (vx * (bx - px) + vy * (by - py)) / (length * length)
            n += 1
        ep = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
        eq = (bx - ax) * (qy - ay) - (by - ay) * (qx - ax)
        if (da > 0.0) != (db > 0.0) and (ep > 0.0) != (eq > 0.0):
            cuts[n] = ep / (ep - eq)
            n += 1
    ordered = np.sort(cuts[:n])
    for k in range(n - 1):
        start, end = max(0.0, ordered[k]), min(1.0, ordered[k + 1])
        if (end - start) * length <= tolerance:
            continue
        t = 0.5 * (start + end)
        if not point_is_free(px + t * vx, py + t * vy, walls, tolerance):
            return False
    return True


@kernel
def free_points_see(px: float, py: float, qx: float, qy: float, walls: Floats, tolerance: float) -> bool:
    """Whether two points known to lie in the closed free space see each other.

    O(w), and O(w) more for each piece that touches cut the segment into.
    """
    if math.hypot(qx - px, qy - py) <= tolerance:
        return True
    touching = np.empty(walls.shape[0], np.int64)
    n = _find_touches(px, py, qx, qy, walls, tolerance, touching)
    return n == 0 or (n > 0 and _pieces_are_free(px, py, qx, qy, walls, tolerance, touching[:n]))


@kernel
def points_are_free(points: Floats, walls: Floats, tolerance: float) -> Bools:
    """`point_is_free` of each row of ``points`` (n, 2): (n,) bool. O(n w)."""
    free = np.empty(points.shape[0], np.bool_)
    for i in range(points.shape[0]):
        free[i] = point_is_free(points[i, 0], points[i, 1], walls, tolerance)
    return free


@kernel
def segments_are_visible(p: Floats, q: Floats, walls: Floats, tolerance: float) -> Bools:
    """Line of sight between ``p[i]`` and ``q[i]``, each (n, 2): (n,) bool. Points in walls see nothing. O(n w)."""
    visible = np.empty(p.shape[0], np.bool_)
    for i in range(p.shape[0]):
        px, py, qx, qy = p[i, 0], p[i, 1], q[i, 0], q[i, 1]
        visible[i] = (
            point_is_free(px, py, walls, tolerance)
            and point_is_free(qx, qy, walls, tolerance)
            and free_points_see(px, py, qx, qy, walls, tolerance)
        )
    return visible


@kernel
def visible_pairs(points: Floats, walls: Floats, tolerance: float) -> Bools:
    """The visibility matrix A of ``points`` (n, 2): (n, n) bool, symmetric, True on the diagonal. O(n² w).

    Thesis §3.1. A point in a wall sees nothing but itself.
    """
    n = points.shape[0]
    free = points_are_free(points, walls, tolerance)
    seen = np.zeros((n, n), np.bool_)
    for i in range(n):
        seen[i, i] = True
        if free[i]:
            for j in range(i + 1, n):
                if free[j] and free_points_see(
                    points[i, 0], points[i, 1], points[j, 0], points[j, 1], walls, tolerance
                ):
                    seen[i, j] = seen[j, i] = True
    return seen
