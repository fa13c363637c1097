"""When discs that move come too near to walls or to each other.

Part of the certificate, and written apart from all planners. A distance between things that move evenly is a convex
function of time, so the time in which it is too small is one interval, found by halving around its least value.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


def inside_rings(points: Floats, walls: Floats) -> Bools:
    """Which of ``points`` (n, 2) lie inside the rings that ``walls`` (w, 2, 2) form: (n,) bool. O(n w) crossings."""
    x, y = points[:, None, 0], points[:, None, 1]
    (ax, ay), (bx, by) = walls[:, 0].T, walls[:, 1].T
    spans = (ay > y) != (by > y)
    left_of = (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0
    crossed: Bools = np.bitwise_xor.reduce(spans & (left_of == (by > ay)), axis=1)
    return crossed


@kernel
def _distance_to_segment(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> float:
    wx, wy = bx - ax, by - ay
    squared = wx * wx + wy * wy
    share = 0.0 if squared == 0.0 else min(1.0, max(0.0, (wx * (x - ax) + wy * (y - ay)) / squared))
    return math.hypot(ax + share * wx - x, ay + share * wy - y)


@kernel
def _too_near(
    px: float, py: float, ux: float, uy: float, ax: float, ay: float, bx: float, by: float, reach: float
) -> tuple[float, float]:
    """First and last share of a motion from p by u at which it is nearer than ``reach`` to a segment, as it is once."""
    low, high = 0.0, 1.0
    for _ in range(80):
        third = (high - low) / 3.0
        s, t = low + third, high - third
        at_s = _distance_to_segment(px + s * ux, py + s * uy, ax, ay, bx, by)
        at_t = _distance_to_segment(px + t * ux, py + t * uy, ax, ay, bx, by)
        if at_s <= at_t:
            high = t
        else:
            low = s
    first = last = nearest = 0.5 * (low + high)
    for end in (0.0, 1.0):
        inner, outer = nearest, end
        if _distance_to_segment(px + end * ux, py + end * uy, ax, ay, bx, by) < reach:
            inner = end
        else:
            for _ in range(60):
                t = 0.5 * (inner + outer)
                if _distance_to_segment(px + t * ux, py + t * uy, ax, ay, bx, by) < reach:
                    inner = t
                else:
                    outer = t
        first, last = min(first, inner), max(last, inner)
    return first, last


@kernel
def _crosses(
    px: float, py: float, rx: float, ry: float, ax: float, ay: float, bx: float, by: float
) -> bool:  # fmt: skip
    da = (rx - px) * (ay - py) - (ry - py) * (ax - px)
    db = (rx - px) * (by - py) - (ry - py) * (bx - px)
    ep = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
    er = (bx - ax) * (ry - ay) - (by - ay) * (rx - ax)
    return ((da > 0.0) != (db > 0.0)) and ((ep > 0.0) != (er > 0.0))


@kernel
def _date(share: float, start: float, end: float) -> float:
    """The time at a share of a piece of time: its end exactly at 1, so that pieces join."""
    return end if share == 1.0 else start + share * (end - start)


@kernel
def find_contacts(times: Floats, points: Floats, walls: Floats, reach: float) -> Floats:
    """When a member is too near to walls.

    Args:
        times: (m,) float, seconds.
        points: (m, 2) float, metres: its waypoints.
        walls: (w, 2, 2) float, metres.
        reach: metres: a distance below this is too small.

    Returns:
        (n, 4) float: first and last second, and the place (x, y) of the member at the first; in any order.

    Complexity: O(m w).
    """
    contacts = np.empty((16, 4))
    n = 0
    for i in range(max(1, times.shape[0] - 1)):
        j = min(i + 1, times.shape[0] - 1)
        px, py, rx, ry = points[i, 0], points[i, 1], points[j, 0], points[j, 1]
        left, right = min(px, rx) - reach, max(px, rx) + reach
        low, high = min(py, ry) - reach, max(py, ry) + reach
        for k in range(walls.shape[0]):
            ax, ay, bx, by = walls[k, 0, 0], walls[k, 0, 1], walls[k, 1, 0], walls[k, 1, 1]
            if max(ax, bx) < left or min(ax, bx) > right or max(ay, by) < low or min(ay, by) > high:
                continue
            # Two segments are nearest to each other at an end of one, unless they cross.
            if not _crosses(px, py, rx, ry, ax, ay, bx, by) and reach <= min(
                _distance_to_segment(px, py, ax, ay, bx, by), _distance_to_segment(rx, ry, ax, ay, bx, by),
                _distance_to_segment(ax, ay, px, py, rx, ry), _distance_to_segment(bx, by, px, py, rx, ry),
            ):  # fmt: skip
                continue
            ux, uy = rx - px, ry - py
            first, last = _too_near(px, py, ux, uy, ax, ay, bx, by, reach)
            if n == contacts.shape[0]:
                longer = np.empty((2 * n, 4))
                longer[:n] = contacts
                contacts = longer
            contacts[n, 0], contacts[n, 1] = _date(first, times[i], times[j]), _date(last, times[i], times[j])
            contacts[n, 2], contacts[n, 3] = px + first * ux, py + first * uy
            n += 1
    return contacts[:n].copy()


@kernel
def approach(
    px: float, py: float, rx: float, ry: float, qx: float, qy: float, sx: float, sy: float
) -> tuple[float, float, float]:
    """The least distance of a segment from p to r to another from q to s, and the place on the first where it is."""
    ux, uy, vx, vy = rx - px, ry - py, sx - qx, sy - qy
    if _crosses(px, py, rx, ry, qx, qy, sx, sy):
        side_p, side_r = vx * (py - qy) - vy * (px - qx), vx * (ry - qy) - vy * (rx - qx)
        share = side_p / (side_p - side_r)
        return 0.0, px + share * ux, py + share * uy
    nearest, x, y = _distance_to_segment(px, py, qx, qy, sx, sy), px, py
    distance = _distance_to_segment(rx, ry, qx, qy, sx, sy)
    if distance < nearest:
        nearest, x, y = distance, rx, ry
    squared = ux * ux + uy * uy
    for ax, ay in ((qx, qy), (sx, sy)):
        distance = _distance_to_segment(ax, ay, px, py, rx, ry)
        if distance < nearest and squared > 0.0:
            share = min(1.0, max(0.0, (ux * (ax - px) + uy * (ay - py)) / squared))
            nearest, x, y = distance, px + share * ux, py + share * uy
    return nearest, x, y


@kernel
def find_collisions(times: Floats, p: Floats, q: Floats, reach: float) -> Floats:
    """When two members are nearer to each other than ``reach``, metres.

    Args:
        times: (m,) float, seconds, rising, m ≥ 2: between two of them both move evenly.
        p: (m, 2) float, metres: where the one is at these times.
        q: the same of the other.
        reach: metres.

    Returns:
        (n, 2) float: first and last second in each piece of time; in order.

    Complexity: O(m).
    """
    found = np.empty((times.shape[0], 2))
    n = 0
    for i in range(times.shape[0] - 1):
        dx, dy = p[i, 0] - q[i, 0], p[i, 1] - q[i, 1]
        ex, ey = p[i + 1, 0] - q[i + 1, 0], p[i + 1, 1] - q[i + 1, 1]
        if _distance_to_segment(0.0, 0.0, dx, dy, ex, ey) >= reach:
            continue
        first, last = _too_near(dx, dy, ex - dx, ey - dy, 0.0, 0.0, 0.0, 0.0, reach)
        found[n, 0], found[n, 1] = _date(first, times[i], times[i + 1]), _date(last, times[i], times[i + 1])
        n += 1
    return found[:n].copy()
