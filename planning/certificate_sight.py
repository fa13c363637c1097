"""When two members of a schedule certainly see each other: by bounds over intervals of time, halved until they decide.

Part of the certificate, and written apart from all planners: no roots are computed here.

Walls recede into the solid by a small depth, so that a sight line that grazes a wall keeps clear of it, and one that
touches a receded wall has gone too deep. Each wall then stands by itself: it is clear of all sight lines of an interval
of time if both its ends stay on one side of the moving line, or both robots stay on one side of the wall, or beyond one
of its ends. It blocks all of them if its ends stay on different sides of the line, and the robots on different sides of
the wall. The side of a fixed point from a line through two points that move evenly is quadratic in time, and lies
between the least and the greatest of its three Bernstein coefficients. An interval in which a wall does neither is
halved, and in the end counted as blocked when nothing in it moves by more than an eighth of the depth.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_LONGEST_MITRE: Final = 10.0
"""Depths that the corner of a receded wall moves at most: sharper corners than 11° stay nearer to their place."""

_MOST_HALVINGS: Final = 4096
"""For each straight piece of motion; what is undecided then counts as blocked, so that no schedule can take long."""


def recede_walls(walls: Floats, successors: Ints, depth_m: float) -> Floats:
    """The walls, drawn back from free space by a small depth.

    Args:
        walls: (w, 2, 2) float, metres: from where to where each runs, free space on its left.
        successors: (w,) int: the wall that begins where each one ends.
        depth_m: metres.

    Returns:
        (w, 2, 2) float: the same walls, still joined at their ends.
    """
    along = walls[:, 1] - walls[:, 0]
    normals = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1, keepdims=True)
    sums = normals + normals[successors]
    squares = 0.5 * np.einsum("ij,ij->i", sums, sums)
    # A corner so sharp that its mitre cannot be computed stays where it is: that is the strict side.
    mitres = np.where(squares[:, None] > 1e-12, sums / np.maximum(squares, 1e-12)[:, None], 0.0)
    lengths = np.linalg.norm(mitres, axis=1)
    mitres *= np.minimum(1.0, _LONGEST_MITRE / np.maximum(lengths, 1.0))[:, None]
    ends = walls[:, 1] - depth_m * mitres
    receded = np.empty_like(walls)
    receded[:, 1] = ends
    receded[successors, 0] = ends
    return receded


@kernel
def _side(px: float, py: float, qx: float, qy: float, x: float, y: float) -> float:
    return (px - x) * (qy - y) - (py - y) * (qx - x)


@kernel
def _find_side(
    px: float, py: float, rx: float, ry: float, qx: float, qy: float, sx: float, sy: float, x: float, y: float
) -> int:
    """The side of a point from the line through p and q while these move to r and s: 1 or −1, 0 where undecided."""
    first, last = _side(px, py, qx, qy, x, y), _side(rx, ry, sx, sy, x, y)
    middle = _side(px, py, sx, sy, x, y) + _side(rx, ry, qx, qy, x, y)
    if first > 0.0 and last > 0.0 and middle > 0.0:
        return 1
    return -1 if first < 0.0 and last < 0.0 and middle < 0.0 else 0


@kernel
def _judge_wall(
    px: float, py: float, rx: float, ry: float, qx: float, qy: float, sx: float, sy: float,
    ax: float, ay: float, bx: float, by: float,
) -> int:  # fmt: skip
    """Of a wall and all sight lines while p moves to r, q to s: 1 if it is clear of all, −1 if it blocks all; or 0."""
    wx, wy = bx - ax, by - ay
    p, r = wx * (py - ay) - wy * (px - ax), wx * (ry - ay) - wy * (rx - ax)
    q, s = wx * (qy - ay) - wy * (qx - ax), wx * (sy - ay) - wy * (sx - ax)
    if min(p, r, q, s) > 0.0 or max(p, r, q, s) < 0.0:
        return 1
    side_a = _find_side(px, py, rx, ry, qx, qy, sx, sy, ax, ay)
    side_b = _find_side(px, py, rx, ry, qx, qy, sx, sy, bx, by)
    if side_a * side_b > 0:
        return 1
    if side_a * side_b < 0 and ((max(p, r) < 0.0 and min(q, s) > 0.0) or (min(p, r) > 0.0 and max(q, s) < 0.0)):
        return -1
    past_p, past_r = wx * (px - ax) + wy * (py - ay), wx * (rx - ax) + wy * (ry - ay)
    past_q, past_s = wx * (qx - ax) + wy * (qy - ay), wx * (sx - ax) + wy * (sy - ay)
    beyond = max(past_p, past_r, past_q, past_s) < 0.0 or min(past_p, past_r, past_q, past_s) > wx * wx + wy * wy
    return 1 if beyond else 0


@kernel
def _judge_walls(
    px: float, py: float, rx: float, ry: float, qx: float, qy: float, sx: float, sy: float,
    walls: Floats, order: Ints, count: int,
) -> int:  # fmt: skip
    """How many of the first ``count`` walls in ``order`` are undecided, moved to its front; −1 if one blocks.

    It only permutes these, so that the walls undecided at one interval can be asked for both of its halves.
    """
    left, right = min(px, rx, qx, sx), max(px, rx, qx, sx)
    low, high = min(py, ry, qy, sy), max(py, ry, qy, sy)
    undecided = 0
    for k in range(count):
        i = order[k]
        ax, ay, bx, by = walls[i, 0, 0], walls[i, 0, 1], walls[i, 1, 0], walls[i, 1, 1]
        if max(ax, bx) < left or min(ax, bx) > right or max(ay, by) < low or min(ay, by) > high:
            continue
        judged = _judge_wall(px, py, rx, ry, qx, qy, sx, sy, ax, ay, bx, by)
        if judged == 1:
            continue
        to = undecided if judged == 0 else 0  # a wall that blocks is asked first the next time
        order[k], order[to] = order[to], order[k]
        if judged == -1:
            return -1
        undecided += 1
    return undecided


@kernel
def watch(times: Floats, p: Floats, q: Floats, walls: Floats, depth: float) -> Floats:
    """When two members certainly see each other.

    Args:
        times: (m,) float, seconds, rising, m ≥ 2: between two of them both move evenly.
        p: (m, 2) float, metres: where the one is at these times.
        q: the same of the other.
        walls: (w, 2, 2) float, metres: receded.
        depth: by which they are, metres.

    Returns:
        (n, 2) float, seconds: closed intervals in order, apart from each other.

    Complexity: O(m w), and O(log(motion / depth)) halvings for each beginning or end of sight.
    """
    order = np.arange(walls.shape[0])
    waiting = np.empty((64, 2))
    counts = np.empty(64, np.int64)
    found = np.empty((16, 2))
    n = 0
    for i in range(times.shape[0] - 1):
        px, py, ux, uy = p[i, 0], p[i, 1], p[i + 1, 0] - p[i, 0], p[i + 1, 1] - p[i, 1]
        qx, qy, vx, vy = q[i, 0], q[i, 1], q[i + 1, 0] - q[i, 0], q[i + 1, 1] - q[i, 1]
        motion = max(math.hypot(ux, uy), math.hypot(vx, vy))
        waiting[0, 0], waiting[0, 1], counts[0] = 0.0, 1.0, walls.shape[0]
        top, halvings = 1, 0
        while top > 0:
            top -= 1
            start, end = waiting[top, 0], waiting[top, 1]
            undecided = _judge_walls(
                px + start * ux, py + start * uy, px + end * ux, py + end * uy,
                qx + start * vx, qy + start * vy, qx + end * vx, qy + end * vy,
                walls, order, counts[top],
            )  # fmt: skip
            if undecided == 0:
                # Ends of a piece are given as they are, so that pieces join without a gap.
                begin = times[i] if start == 0.0 else times[i] + start * (times[i + 1] - times[i])
                finish = times[i + 1] if end == 1.0 else times[i] + end * (times[i + 1] - times[i])
                if n > 0 and found[n - 1, 1] == begin:
                    found[n - 1, 1] = finish
                else:
                    if n == found.shape[0]:
                        longer = np.empty((2 * n, 2))
                        longer[:n] = found
                        found = longer
                    found[n, 0], found[n, 1] = begin, finish
                    n += 1
            elif undecided > 0 and (end - start) * motion > 0.125 * depth and halvings < _MOST_HALVINGS:
                halvings += 1
                middle = 0.5 * (start + end)
                waiting[top, 0], waiting[top, 1], counts[top] = middle, end, undecided
                waiting[top + 1, 0], waiting[top + 1, 1], counts[top + 1] = start, middle, undecided
                top += 2
    return found[:n].copy()
