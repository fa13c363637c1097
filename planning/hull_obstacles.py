"""What enters the hull of two disjoint convex polygons in free space: walls, and ends of walls.

The hull's border is a part of either polygon's and two *bridges*, the outer common tangents. A segment from one polygon
to the other that enters an obstacle crosses a wall with its start strictly in front and its end strictly behind. So
only walls matter that have a corner of the first polygon in front and a corner of the second behind; if there is none,
the hull is free. A hole between the bridges has such a wall, and that wall has an end between the bridges.

Walls (V, 4) are x, y of start and end; wall w starts at vertex w, ends at vertex after[w], and has free space on its
left, its *front*. Polygons are counter-clockwise rows of one array of corners. Grazing is not entering.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
CornerIndices = NDArray[np.int32]
Bools = NDArray[np.bool_]

NONE: Final = -1
"""No wall."""


@kernel
def sort_walls(corners: Floats, starts: Ints, walls: Floats) -> tuple[Bools, Bools]:
    """Which polygons have a corner strictly in front of which walls, and strictly behind: (N, V) bool each. O(C V)."""
    n = len(starts) - 1
    front, behind = np.zeros((n, len(walls)), np.bool_), np.zeros((n, len(walls)), np.bool_)
    for w in range(len(walls)):
        ax, ay = walls[w, 0], walls[w, 1]
        dx, dy = walls[w, 2] - ax, walls[w, 3] - ay
        for i in range(n):
            for k in range(starts[i], starts[i + 1]):
                side = dx * (corners[k, 1] - ay) - dy * (corners[k, 0] - ax)
                front[i, w] = front[i, w] or side > 0.0
                behind[i, w] = behind[i, w] or side < 0.0
    return front, behind


@kernel
def _side(px: float, py: float, qx: float, qy: float, x: float, y: float) -> float:
    """Positive when (x, y) is left of the line from p to q, negative when right."""
    return (qx - px) * (y - py) - (qy - py) * (x - px)


@kernel
def crosses(walls: Floats, w: int, px: float, py: float, qx: float, qy: float) -> bool:
    """Whether the segment from p to q goes through wall w from its front."""
    ax, ay, bx, by = walls[w, 0], walls[w, 1], walls[w, 2], walls[w, 3]
    if _side(ax, ay, bx, by, qx, qy) >= 0.0 or _side(ax, ay, bx, by, px, py) <= 0.0:
        return False
    return bool((_side(px, py, qx, qy, ax, ay) > 0.0) != (_side(px, py, qx, qy, bx, by) > 0.0))


@kernel
def find_bridges(corners: Floats, p: int, p_end: int, q: int, q_end: int) -> tuple[int, int, int, int]:
    """Both bridges of two disjoint convex polygons: the ends of the left one, first polygon first, then of the right.

    Each is found from the corners that lie farthest to its side, mostly its ends already. O(corners).
    """
    ux, uy = corners[q, 0] - corners[p, 0], corners[q, 1] - corners[p, 1]
    p_right, p_left = _find_extremes(corners, p, p_end, ux, uy)
    q_right, q_left = _find_extremes(corners, q, q_end, ux, uy)
    a, b = _find_bridge(corners, p, p_end, q, q_end, p_left, q_left, 1.0)
    c, d = _find_bridge(corners, p, p_end, q, q_end, p_right, q_right, -1.0)
    return a, b, c, d


@kernel
def _find_extremes(corners: Floats, first: int, end: int, ux: float, uy: float) -> tuple[int, int]:
    """The corners of a polygon farthest to the right and to the left of the direction u."""
    right = left = first
    least = most = ux * corners[first, 1] - uy * corners[first, 0]
    for k in range(first + 1, end):
        offset = ux * corners[k, 1] - uy * corners[k, 0]
        if offset < least:
            least, right = offset, k
        if offset > most:
            most, left = offset, k
    return right, left


@kernel
def _find_bridge(
    corners: Floats, p_first: int, p_end: int, q_first: int, q_end: int, p: int, q: int, side: float
) -> tuple[int, int]:
    """Corners of the two polygons whose line has no corner of either on the given side: 1 the left, -1 the right.

    From one end of the line to the tangent through the other, in turn; every turn moves the line towards that side.
    """
    for _ in range(p_end - p_first + q_end - q_first):
        moved = False
        x, y = corners[q, 0], corners[q, 1]
        for k in range(p_first, p_end):
            if side * _side(corners[p, 0], corners[p, 1], x, y, corners[k, 0], corners[k, 1]) > 0.0:
                p = k
                moved = True
        x, y = corners[p, 0], corners[p, 1]
        for k in range(q_first, q_end):
            if side * _side(x, y, corners[q, 0], corners[q, 1], corners[k, 0], corners[k, 1]) > 0.0:
                q = k
                moved = True
        if not moved:
            break
    return p, q


@kernel
def find_entering(
    corners: Floats, p: int, p_end: int, q: int, q_end: int, walls: Floats, candidates: Ints, count: int, most: int
) -> tuple[int, int]:
    """Which of the first ``count`` candidate walls enter the hull of two disjoint convex polygons.

    They are put in front of the other candidates. The search ends with so many as ``most``, or with a wall that parts
    the polygons, so that no point of one sees a point of the other.

    Returns:
        The number of walls that enter, and the wall that parts the polygons, or `NONE`.
    """
    a, b, c, d = find_bridges(corners, p, p_end, q, q_end)
    ax, ay, bx, by = corners[a, 0], corners[a, 1], corners[b, 0], corners[b, 1]
    cx, cy, dx, dy = corners[c, 0], corners[c, 1], corners[d, 0], corners[d, 1]
    found = 0
    for k in range(count):
        w = candidates[k]
        x, y = walls[w, 0], walls[w, 1]
        start_left = _side(ax, ay, bx, by, x, y) > 0.0
        end_left = _side(ax, ay, bx, by, walls[w, 2], walls[w, 3]) > 0.0
        if start_left and end_left:
            continue
        start_right = _side(cx, cy, dx, dy, x, y) < 0.0
        end_right = _side(cx, cy, dx, dy, walls[w, 2], walls[w, 3]) < 0.0
        if start_right and end_right:
            continue
        crosses_left = start_left != end_left and crosses(walls, w, ax, ay, bx, by)
        crosses_right = start_right != end_right and crosses(walls, w, cx, cy, dx, dy)
        if crosses_left and crosses_right:
            return found, int(w)
        if (
            crosses_left
            or crosses_right
            or (
                not (start_left or start_right)
                and _side(cx, cy, ax, ay, x, y) <= 0.0
                and _side(dx, dy, bx, by, x, y) >= 0.0
            )
        ):
            candidates[found] = w
            found += 1
            if found == most:
                break
    return found, NONE


@kernel
def find_tangents(corners: Floats, starts: Ints, walls: Floats) -> tuple[CornerIndices, CornerIndices]:
    """The rightmost and the leftmost corner of each polygon as seen from each vertex outside: (N, V) each. O(C V)."""
    n = len(starts) - 1
    right, left = np.empty((n, len(walls)), np.int32), np.empty((n, len(walls)), np.int32)
    for v in range(len(walls)):
        x, y = walls[v, 0], walls[v, 1]
        for i in range(n):
            rightmost = leftmost = starts[i]
            for k in range(starts[i] + 1, starts[i + 1]):
                if _side(x, y, corners[rightmost, 0], corners[rightmost, 1], corners[k, 0], corners[k, 1]) < 0.0:
                    rightmost = k
                if _side(x, y, corners[leftmost, 0], corners[leftmost, 1], corners[k, 0], corners[k, 1]) > 0.0:
                    leftmost = k
            right[i, v], left[i, v] = rightmost, leftmost
    return right, left


@kernel
def is_inside_hull(corners: Floats, x: float, y: float, p: int, p_left: int, q: int, q_left: int) -> bool:
    """Whether (x, y) is strictly inside the hull of two polygons: in no half-plane that holds both.

    p and p_left are the rightmost and the leftmost corner of the first polygon as seen from there, q and q_left of the
    second. A half-plane that holds both may be turned to the left until its border meets p or q.
    """
    turn = _side(x, y, corners[p, 0], corners[p, 1], corners[q, 0], corners[q, 1])
    if turn >= 0.0 and _side(x, y, corners[p, 0], corners[p, 1], corners[q_left, 0], corners[q_left, 1]) >= 0.0:
        return False
    return not (
        turn <= 0.0 and _side(x, y, corners[q, 0], corners[q, 1], corners[p_left, 0], corners[p_left, 1]) >= 0.0
    )
