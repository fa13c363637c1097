"""Which elements of two paths see each other throughout: every point of the one every point of the other.

The sight lines between two straight ranges fill the convex hull of the two. If no wall enters it, all elements in the
ranges see each other; if one wall parts the ranges wholly, none do; else the ranges are halved, down to pieces and
nodes. So large blocks are decided at once, and only along the border between sight and no sight, which is a curve in
the diagram of the two paths, single elements are asked for. Walls that keep out of a hull keep out of the hulls of its
parts: they are asked once.

A wall keeps out if some axis separates it from the hull, or they overlap there by no more than the tolerance: grazing
is visible. Where one grazes, the lines between the ends of the ranges are asked of `planning.line_of_sight` as well,
which knows of walls that only block together.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel
from planning.line_of_sight import free_points_see
from planning.path_elements import divide_block

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]

_KEEPS_OUT: Final = 0
_GRAZES: Final = 1
_ENTERS: Final = 2
_PARTS: Final = 3


@kernel
def _overlap(hull: Floats, ux: float, uy: float, ax: float, ay: float, bx: float, by: float) -> float:
    """By how much a wall and four points overlap along an axis of any length, in units of that length."""
    a, b = ax * ux + ay * uy, bx * ux + by * uy
    low, high = min(a, b), max(a, b)
    least = greatest = float(hull[0, 0] * ux + hull[0, 1] * uy)
    for k in range(1, 4):
        at = float(hull[k, 0] * ux + hull[k, 1] * uy)
        least, greatest = min(least, at), max(greatest, at)
    return min(high - least, greatest - low)


@kernel
def _judge_wall(hull: Floats, ax: float, ay: float, bx: float, by: float, tolerance: float) -> int:
    """Of a wall and all sight lines from points 0–1 to points 2–3 of a hull (4, 2)."""
    wx, wy = bx - ax, by - ay
    length = np.sqrt(wx * wx + wy * wy)
    grazes = False
    overlap = _overlap(hull, -wy, wx, ax, ay, bx, by)
    if overlap < -tolerance * length:
        return _KEEPS_OUT
    grazes = grazes or overlap <= tolerance * length
    overlap = _overlap(hull, wx, wy, ax, ay, bx, by)
    if overlap < -tolerance * length:
        return _KEEPS_OUT
    grazes = grazes or overlap <= tolerance * length
    parts = True
    side = 0.0
    for k in range(4):
        for m in range(k):
            vx, vy = hull[k, 0] - hull[m, 0], hull[k, 1] - hull[m, 1]
            length = np.sqrt(vx * vx + vy * vy)
            if length <= tolerance:
                continue
            overlap = _overlap(hull, -vy, vx, ax, ay, bx, by)
            if overlap < -tolerance * length:
                return _KEEPS_OUT
            grazes = grazes or overlap <= tolerance * length
            if k >= 2 > m:
                da = vx * (ay - hull[m, 1]) - vy * (ax - hull[m, 0])
                db = vx * (by - hull[m, 1]) - vy * (bx - hull[m, 0])
                parts = parts and min(abs(da), abs(db)) > tolerance * length and da * db < 0.0 and side * da >= 0.0
                side = da
    if grazes:
        return _GRAZES
    # All lines pass between the wall's ends, in one direction; they cross it if the ranges lie on different sides.
    if parts:
        reach = tolerance * np.sqrt(wx * wx + wy * wy)
        sides = np.empty(4)
        for k in range(4):
            sides[k] = wx * (hull[k, 1] - ay) - wy * (hull[k, 0] - ax)
        if (max(sides[0], sides[1]) < -reach and min(sides[2], sides[3]) > reach) or (
            min(sides[0], sides[1]) > reach and max(sides[2], sides[3]) < -reach
        ):
            return _PARTS
    return _ENTERS


@kernel
def _judge_walls(hull: Floats, walls: Floats, tolerance: float, order: Ints, count: int) -> tuple[int, int]:
    """The worst that the first ``count`` walls in ``order`` do, and how many do not keep out, moved to its front."""
    left, right = hull[0, 0], hull[0, 0]
    low, high = hull[0, 1], hull[0, 1]
    for k in range(1, 4):
        left, right = min(left, hull[k, 0]), max(right, hull[k, 0])
        low, high = min(low, hull[k, 1]), max(high, hull[k, 1])
    left, right, low, high = left - tolerance, right + tolerance, low - tolerance, high + tolerance
    worst, kept = _KEEPS_OUT, 0
    for k in range(count):
        i = order[k]
        ax, ay, bx, by = walls[i, 0, 0], walls[i, 0, 1], walls[i, 1, 0], walls[i, 1, 1]
        if max(ax, bx) < left or min(ax, bx) > right or max(ay, by) < low or min(ay, by) > high:
            continue
        judged = _judge_wall(hull, ax, ay, bx, by, tolerance)
        if judged == _KEEPS_OUT:
            continue
        to = 0 if judged == _PARTS else kept  # a wall that parts is asked first the next time
        order[k], order[to] = order[to], order[k]
        if judged == _PARTS:
            return _PARTS, 0
        worst = max(worst, judged)
        kept += 1
    return worst, kept


@kernel
def _lines_are_free(hull: Floats, walls: Floats, tolerance: float) -> bool:
    for k in range(2):
        for m in range(2, 4):
            if not free_points_see(hull[k, 0], hull[k, 1], hull[m, 0], hull[m, 1], walls, tolerance):
                return False
    return True


@kernel
def mark_sight(
    nodes_i: Floats, corners_i: Ints, nodes_j: Floats, corners_j: Ints, walls: Floats, tolerance: float,
    table: Bytes, mark: int,
) -> None:  # fmt: skip
    """Set ``mark`` in ``table`` (2 n_i + 1, 2 n_j + 1) where elements of path i see elements of path j throughout.

    All nodes lie in free space. O(w (n_i + n_j)) where the border between sight and no sight is as long as a path.
    """
    order = np.arange(walls.shape[0])
    hull = np.empty((4, 2))
    waiting = np.empty((256, 5), np.int64)
    legs_i, legs_j = max(1, corners_i.shape[0] - 1), max(1, corners_j.shape[0] - 1)
    for leg_i in range(legs_i):
        for leg_j in range(legs_j):
            waiting[0, 0], waiting[0, 1] = corners_i[leg_i], corners_i[min(leg_i + 1, corners_i.shape[0] - 1)]
            waiting[0, 2], waiting[0, 3] = corners_j[leg_j], corners_j[min(leg_j + 1, corners_j.shape[0] - 1)]
            waiting[0, 4] = walls.shape[0]
            top = 1
            while top > 0:
                top -= 1
                a, b, c, d, count = (
                    waiting[top, 0], waiting[top, 1], waiting[top, 2], waiting[top, 3], waiting[top, 4]
                )  # fmt: skip
                if b - a <= 1 and d - c <= 1 and table[a + b, c + d] & mark:
                    continue
                hull[0], hull[1], hull[2], hull[3] = nodes_i[a], nodes_i[b], nodes_j[c], nodes_j[d]
                worst, kept = _judge_walls(hull, walls, tolerance, order, count)
                if worst == _KEEPS_OUT or (worst == _GRAZES and _lines_are_free(hull, walls, tolerance)):
                    for e in range(2 * a, 2 * b + 1):
                        for f in range(2 * c, 2 * d + 1):
                            table[e, f] |= mark
                elif worst != _PARTS:
                    top = divide_block(a, b, c, d, kept, waiting, top)
