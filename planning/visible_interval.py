"""When two points that move see each other: exact intervals of time, in closed form.

Symbols: p and q move straight and evenly while t goes from 0 to 1, a wall runs from a to b. With the cross product ×,

    f_a(t) = (p(t) − a) × (q(t) − a)    the side of the wall's end a from the sight line: quadratic in t
    e_p(t) = (b − a) × (p(t) − a)       the side of p from the wall: linear in t

and f_b, e_q likewise. The wall blocks at t if f_a f_b < 0 and e_p e_q < 0. That can change only at a root of the four,
the critical path values where a wall's end crosses the sight line or p or q crosses the wall's line. Cut there, and at
the extrema of f_a and f_b, time falls into pieces in each of which the middle tells for the whole.

Visibility is closed, as in `planning.line_of_sight`: grazing is visible, crossing is not. A wall that reaches over the
sight line by less than its tolerance throughout a piece grazes it. Walls that graze it for longer than an instant may
block only together (a sight line through the corner between two), so there each piece is asked of
`planning.line_of_sight`. Instants of sight in which nothing can be done, shorter than 1e-9 of the motion, are left out.

Of two points with a path coordinate each, hold one still: the sections of their coordination diagram are the intervals
of the other. `sees_throughout` tells whether all of it is visible.

Where cells are too careful (thesis §4.3.5) this decides. Beyond the thesis.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.environment import Environment
from planning.kernel import kernel
from planning.line_of_sight import free_points_see, point_is_free
from planning.motion_plan import TimedPath

Floats = NDArray[np.float64]

_SHORTEST: Final = 1e-9
"""Of the motion: a time in which nothing can be done."""

_CLEAR: Final = 0.25
"""Of the tolerance, in the middle of a piece: anywhere in it a monotone quadratic is at most four times as large."""


def visible_intervals(environment: Environment, p: ArrayLike, q: ArrayLike) -> Floats:
    """When two points see each other that move straight and evenly during the same time.

    Args:
        environment: the walls.
        p: (2, 2) float, metres, map frame: where the one is at t = 0 and at t = 1, both in free space and on the way.
        q: the same of the other.

    Returns:
        (n, 2) float: first and last t of each interval, closed, in order, in [0, 1]. A point that is in a wall after
        all sees nothing; if both enter walls at one instant, what they saw before it may be missing too.

    Complexity: O(w log w + n w) for w walls; O(w²) where walls are grazed for longer than an instant.
    """
    moved_p, moved_q = (np.array(points, dtype=np.float64).reshape(2, 2) for points in (p, q))
    found: Floats = _find_intervals(moved_p, moved_q, environment.walls, environment.tolerance_m)
    return found


def visible_times(environment: Environment, p: TimedPath, q: TimedPath) -> Floats:
    """When two members of a schedule see each other, from the first waypoint of either to the last.

    Returns:
        (n, 2) float, seconds: closed intervals, in order; those that touch are one.

    Complexity: that of :func:`visible_intervals` for each piece of time in which both move evenly.
    """
    times = np.union1d(p.times_s, q.times_s)
    if len(times) == 1:
        times = np.repeat(times, 2)
    found: Floats = _find_times(
        times, p.positions(times), q.positions(times), environment.walls, environment.tolerance_m
    )
    return found


def sees_throughout(environment: Environment, segment_i: ArrayLike, segment_j: ArrayLike) -> bool:
    """Whether every point of one segment sees every point of another, each (2, 2) float, metres, map frame.

    The sight lines fill the convex hull of the two. Nothing blocks them if the six lines between the four ends are free
    and no wall's end lies inside the hull, deeper than the tolerance. O(w).
    """
    corners = np.concatenate([np.array(s, dtype=np.float64).reshape(2, 2) for s in (segment_i, segment_j)])
    return bool(_hull_is_free(corners, environment.walls, environment.tolerance_m))


@kernel
def _add_roots(c0: float, c1: float, c2: float, cuts: Floats, n: int) -> int:
    """Write the roots and the extremum of c0 + c1 t + c2 t² that lie in (0, 1) after the first n cuts; their number."""
    if c2 == 0.0:
        first = second = middle = -c0 / c1 if c1 != 0.0 else -1.0
    else:
        middle = -0.5 * c1 / c2
        first = second = middle
        discriminant = c1 * c1 - 4.0 * c0 * c2
        if discriminant > 0.0:
            # The sum of two of the same sign, so that nothing cancels.
            half = -0.5 * (c1 + math.copysign(math.sqrt(discriminant), c1))
            first, second = half / c2, c0 / half
    for root in (first, middle, second):
        if 0.0 < root < 1.0:
            cuts[n] = root
            n += 1
    return n


@kernel
def _cut_at_wall(
    px: float, py: float, qx: float, qy: float, ux: float, uy: float, vx: float, vy: float,
    ax: float, ay: float, bx: float, by: float, cuts: Floats,
) -> int:  # fmt: skip
    """Write 0, 1 and what lies between them of a wall's roots and extrema, in order; their number, at most 10.

    p moves from (px, py) by u, q from (qx, qy) by v.
    """
    cuts[0], cuts[1] = 0.0, 1.0
    n = 2
    turning = ux * vy - uy * vx
    for x, y in ((ax, ay), (bx, by)):
        n = _add_roots(
            (px - x) * (qy - y) - (py - y) * (qx - x),
            ux * (qy - y) - uy * (qx - x) + (px - x) * vy - (py - y) * vx,
            turning, cuts, n,
        )  # fmt: skip
    wx, wy = bx - ax, by - ay
    for x, y, dx, dy in ((px, py, ux, uy), (qx, qy, vx, vy)):
        slope = wx * dy - wy * dx
        if slope != 0.0:
            root = -(wx * (y - ay) - wy * (x - ax)) / slope
            if 0.0 < root < 1.0:
                cuts[n] = root
                n += 1
    cuts[:n].sort()
    return n


@kernel
def _judge_wall(
    px: float, py: float, qx: float, qy: float, ax: float, ay: float, bx: float, by: float, tolerance: float
) -> int:
    """Of a wall and one sight line: 1 if it blocks clearly, 0 if it clearly misses, −1 if it touches."""
    vx, vy = qx - px, qy - py
    wx, wy = bx - ax, by - ay
    near = _CLEAR * tolerance * math.sqrt(vx * vx + vy * vy)
    reach = _CLEAR * tolerance * math.sqrt(wx * wx + wy * wy)
    da, db = vx * (ay - py) - vy * (ax - px), vx * (by - py) - vy * (bx - px)
    if (da > near and db > near) or (da < -near and db < -near):
        return 0
    ep, eq = wx * (py - ay) - wy * (px - ax), wx * (qy - ay) - wy * (qx - ax)
    if (ep > reach and eq > reach) or (ep < -reach and eq < -reach):
        return 0
    return 1 if min(abs(da), abs(db)) > near and min(abs(ep), abs(eq)) > reach else -1


@kernel
def _find_blocks(p: Floats, q: Floats, walls: Floats, tolerance: float) -> tuple[Floats, Floats]:
    """When single walls clearly block the sight line, (n, 2) in any order; and cuts (m,) of those that graze it."""
    px, py, qx, qy = p[0, 0], p[0, 1], q[0, 0], q[0, 1]
    ux, uy, vx, vy = p[1, 0] - px, p[1, 1] - py, q[1, 0] - qx, q[1, 1] - qy
    left, right = min(px, px + ux, qx, qx + vx) - tolerance, max(px, px + ux, qx, qx + vx) + tolerance
    low, high = min(py, py + uy, qy, qy + vy) - tolerance, max(py, py + uy, qy, qy + vy) + tolerance
    cuts = np.empty(10)
    blocks = np.empty((9 * walls.shape[0], 2))
    grazes = np.empty(10 * walls.shape[0])
    n = m = 0
    for i in range(walls.shape[0]):
        ax, ay, bx, by = walls[i, 0, 0], walls[i, 0, 1], walls[i, 1, 0], walls[i, 1, 1]
        if max(ax, bx) < left or min(ax, bx) > right or max(ay, by) < low or min(ay, by) > high:
            continue
        count = _cut_at_wall(px, py, qx, qy, ux, uy, vx, vy, ax, ay, bx, by, cuts)
        grazing = False
        for k in range(count - 1):
            start, end = cuts[k], cuts[k + 1]
            if start == end:
                continue
            t = 0.5 * (start + end)
            judged = _judge_wall(
                px + t * ux, py + t * uy, qx + t * vx, qy + t * vy, ax, ay, bx, by, tolerance
            )  # fmt: skip
            if judged == 1:
                blocks[n, 0], blocks[n, 1] = start, end
                n += 1
            elif judged == -1 and end - start > _SHORTEST:
                grazing = True
        if grazing:
            grazes[m : m + count] = cuts[:count]
            m += count
    return blocks[:n], grazes[:m]


@kernel
def _find_intervals(p: Floats, q: Floats, walls: Floats, tolerance: float) -> Floats:
    blocks, grazes = _find_blocks(p, q, walls, tolerance)
    blocks = blocks[np.argsort(blocks[:, 0])]
    grazes = np.sort(grazes)
    found = np.empty((blocks.shape[0] + grazes.shape[0] + 1, 2))
    n = 0
    seen_until = 0.0
    g = 0
    for i in range(blocks.shape[0] + 1):
        # A gap between blocks, or a piece of it between grazing walls' cuts: visible or not as its middle is.
        gap_end = blocks[i, 0] if i < blocks.shape[0] else 1.0
        start = seen_until
        while gap_end - start > _SHORTEST:
            while g < grazes.shape[0] and grazes[g] <= start + _SHORTEST:
                g += 1
            end = gap_end
            if g < grazes.shape[0] and grazes[g] < gap_end - _SHORTEST:
                end = grazes[g]
            t = 0.5 * (start + end)
            x, y = p[0, 0] + t * (p[1, 0] - p[0, 0]), p[0, 1] + t * (p[1, 1] - p[0, 1])
            X, Y = q[0, 0] + t * (q[1, 0] - q[0, 0]), q[0, 1] + t * (q[1, 1] - q[0, 1])
            if (
                point_is_free(x, y, walls, tolerance)
                and point_is_free(X, Y, walls, tolerance)
                and free_points_see(x, y, X, Y, walls, tolerance)
            ):
                if n > 0 and found[n - 1, 1] == start:
                    found[n - 1, 1] = end
                else:
                    found[n, 0], found[n, 1] = start, end
                    n += 1
            start = end
        if i < blocks.shape[0]:
            seen_until = max(seen_until, blocks[i, 1])
    return found[:n].copy()


@kernel
def _find_times(times: Floats, p: Floats, q: Floats, walls: Floats, tolerance: float) -> Floats:
    pieces = [_find_intervals(p[i : i + 2], q[i : i + 2], walls, tolerance) for i in range(times.shape[0] - 1)]
    total = 0
    for piece in pieces:
        total += piece.shape[0]
    found = np.empty((total, 2))
    n = 0
    for i, piece in enumerate(pieces):
        for k in range(piece.shape[0]):
            # Both ends of a piece are given as they are, so that pieces join without a gap.
            start = times[i] if piece[k, 0] == 0.0 else times[i] + piece[k, 0] * (times[i + 1] - times[i])
            end = times[i + 1] if piece[k, 1] == 1.0 else times[i] + piece[k, 1] * (times[i + 1] - times[i])
            if n > 0 and found[n - 1, 1] >= start:
                found[n - 1, 1] = end
            else:
                found[n, 0], found[n, 1] = start, end
                n += 1
    return found[:n].copy()


@kernel
def _depth_in_triangle(x: float, y: float, a: Floats, b: Floats, c: Floats) -> float:
    """How far a point is inside a triangle: its distance from the nearest side; negative outside."""
    turn = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    depth = np.inf
    for start, end in ((a, b), (b, c), (c, a)):
        length = math.hypot(end[0] - start[0], end[1] - start[1])
        if length == 0.0:
            return -np.inf
        side = ((end[0] - start[0]) * (y - start[1]) - (end[1] - start[1]) * (x - start[0])) / length
        depth = min(depth, side if turn > 0.0 else -side)
    return depth


@kernel
def _hull_is_free(corners: Floats, walls: Floats, tolerance: float) -> bool:
    for i in range(4):
        if not point_is_free(corners[i, 0], corners[i, 1], walls, tolerance):
            return False
    for i in range(4):
        for j in range(i):
            if not free_points_see(
                corners[i, 0], corners[i, 1], corners[j, 0], corners[j, 1], walls, tolerance
            ):  # fmt: skip
                return False
    # Any three of the corners: their triangles cover the hull.
    for k in range(walls.shape[0]):
        x, y = walls[k, 0, 0], walls[k, 0, 1]
        for omitted in range(4):
            a, b, c = corners[(omitted + 1) % 4], corners[(omitted + 2) % 4], corners[(omitted + 3) % 4]
            if _depth_in_triangle(x, y, a, b, c) > tolerance:
                return False
    return True
