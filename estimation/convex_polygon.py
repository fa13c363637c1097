"""Kernels on one convex polygon: its first n rows of an array (K, 2), counter-clockwise, metres.

Whatever these leave out, they leave out outwards: a result contains what it stands for up to rounding, which is far
below the padding of a range (`estimation.range_measurement`).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from estimation.kernel import kernel

Floats = NDArray[np.float64]

ROUNDING_M = 1e-10
"""Half-planes are moved out by this much, and vertices nearer to each other are one."""

SHORT_M = 1e-8
"""Edges no longer than this have no direction to rely on."""

DISC_SIDES = 16
"""Sides of the polygon around a disc that sets grow by."""


@kernel
def clip(P: Floats, n: int, nx: float, ny: float, limit: float, out: Floats) -> int:
    """Write the part with nx·x + ny·y ≤ limit into out (at least n + 1 rows); the number of its vertices."""
    bound = limit + ROUNDING_M
    m = 0
    before = nx * P[n - 1, 0] + ny * P[n - 1, 1] - bound
    for i in range(n):
        j = i - 1 if i else n - 1
        here = nx * P[i, 0] + ny * P[i, 1] - bound
        if (before > 0.0) != (here > 0.0):
            t = before / (before - here)
            out[m, 0] = P[j, 0] + t * (P[i, 0] - P[j, 0])
            out[m, 1] = P[j, 1] + t * (P[i, 1] - P[j, 1])
            m += 1
        if here <= 0.0:
            out[m, 0], out[m, 1] = P[i, 0], P[i, 1]
            m += 1
        before = here
    return m if m >= 3 else 0


@kernel
def area(P: Floats, n: int) -> float:
    """Area, m²."""
    double = 0.0
    for i in range(2, n):
        ux, uy = P[i - 1, 0] - P[0, 0], P[i - 1, 1] - P[0, 1]
        vx, vy = P[i, 0] - P[0, 0], P[i, 1] - P[0, 1]
        double += ux * vy - uy * vx
    return 0.5 * double


@kernel
def width(P: Floats, n: int) -> float:
    """2 · area / perimeter of a piece, metres."""
    around = 0.0
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        around += math.sqrt((P[j, 0] - P[i, 0]) ** 2 + (P[j, 1] - P[i, 1]) ** 2)
    return 2.0 * area(P, n) / around if around > 0.0 else 0.0


@kernel
def depth(P: Floats, n: int, x: float, y: float) -> float:
    """How far a point is inside all edges' lines, metres; negative outside."""
    deepest = np.inf
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        ex, ey = P[j, 0] - P[i, 0], P[j, 1] - P[i, 1]
        length = math.sqrt(ex * ex + ey * ey)
        if length > 0.0:
            deepest = min(deepest, (ex * (y - P[i, 1]) - ey * (x - P[i, 0])) / length)
    return deepest


@kernel
def distances(P: Floats, n: int, x: float, y: float) -> tuple[float, float, bool]:
    """Least and greatest distance of the polygon from a point, and whether the point is inside."""
    nearest, farthest, inside = np.inf, 0.0, True
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        px, py = x - P[i, 0], y - P[i, 1]
        ex, ey = P[j, 0] - P[i, 0], P[j, 1] - P[i, 1]
        square = ex * ex + ey * ey
        farthest = max(farthest, px * px + py * py)
        inside = inside and ex * py - ey * px >= 0.0
        t = min(1.0, max(0.0, (px * ex + py * ey) / square)) if square > 0.0 else 0.0
        nearest = min(nearest, (px - t * ex) ** 2 + (py - t * ey) ** 2)
    return (0.0 if inside else math.sqrt(nearest)), math.sqrt(farthest), inside


@kernel
def simplify(P: Floats, n: int, most: int) -> int:
    """Drop double vertices, then edges while there are more than most (≥ 4), in place; the number of vertices left.

    The edge to go is the one whose neighbours, made longer until they meet, add the least area. Nothing is left of a
    polygon no wider than rounding: what it was cut from, or the padding of the ranges, holds its points too.
    """
    m = 0
    for i in range(n):
        j = m - 1 if m else n - 1
        if i == 0 or not _near(P[i], P[j], ROUNDING_M):
            P[m, 0], P[m, 1] = P[i, 0], P[i, 1]
            m += 1
    if m > 1 and _near(P[0], P[m - 1], ROUNDING_M):
        m -= 1
    n = m if m >= 3 else 0
    while n > most:
        best, at, x, y = np.inf, -1, 0.0, 0.0
        for i in range(n):
            a, b, c, d = i, (i + 1) % n, (i + 2) % n, (i + 3) % n
            # The edge b–c goes; a–b and d–c are made longer.
            ux, uy = P[b, 0] - P[a, 0], P[b, 1] - P[a, 1]
            vx, vy = P[d, 0] - P[c, 0], P[d, 1] - P[c, 1]
            wx, wy = P[c, 0] - P[b, 0], P[c, 1] - P[b, 1]
            turn = ux * vy - uy * vx
            if turn <= 1e-9 * math.sqrt((ux * ux + uy * uy) * (vx * vx + vy * vy)):
                continue
            t = (wx * vy - wy * vx) / turn
            added = 0.5 * abs(t * (ux * wy - uy * wx))
            if t >= 0.0 and added < best:
                best, at, x, y = added, b, P[b, 0] + t * ux, P[b, 1] + t * uy
        if at < 0:
            break
        P[at, 0], P[at, 1] = x, y
        gone = (at + 1) % n
        for i in range(gone, n - 1):
            P[i, 0], P[i, 1] = P[i + 1, 0], P[i + 1, 1]
        n -= 1
    if n > most:
        # All edges but a few are parallel to rounding: a sliver, for which a box will do.
        left, bottom, right, top = P[:n, 0].min(), P[:n, 1].min(), P[:n, 0].max(), P[:n, 1].max()
        P[0, 0], P[0, 1], P[1, 0], P[1, 1] = left, bottom, right, bottom
        P[2, 0], P[2, 1], P[3, 0], P[3, 1] = right, top, left, top
        n = 4
    return n


@kernel
def grow(P: Floats, n: int, distance: float, out: Floats) -> int:
    """Write the Minkowski sum with a polygon around the disc of a radius into out; at most 2 n + DISC_SIDES vertices.

    The disc is always bounded by the same polygon, so that sides of the same direction add up and do not multiply from
    one step to the next. It overshoots by 1.9 % at its corners.
    """
    step = 2.0 * math.pi / DISC_SIDES
    corner = (distance + 2.0 * SHORT_M) / math.cos(0.5 * step)
    # Edges so short that rounding turns them: the disc is larger by what leaving them out costs.
    V = np.empty((n, 2))
    count = 0
    for i in range(n):
        if count == 0 or not _near(P[i], V[count - 1], SHORT_M):
            V[count] = P[i]
            count += 1
    while count > 1 and _near(V[count - 1], V[0], SHORT_M):
        count -= 1
    # A vertex adds those corners of the disc whose normals lie between those of the edges before and after it. Normals
    # turn one way only, and once around, whatever rounding says; else neighbours would disagree about a corner.
    around = 2.0 * math.pi
    begin = _normal(V, count, count - 1) if count > 1 else 0.0
    normal = begin
    before = math.floor(begin / step)
    last = before + DISC_SIDES
    m = 0
    for i in range(count):
        after = last
        if i < count - 1:
            turn = (_normal(V, count, i) - normal) % around
            normal = min(begin + around, normal + (turn if turn < 1.25 * math.pi else 0.0))
            after = min(last, math.floor(normal / step))
        for k in range(before, after + 1):
            angle = (k + 0.5) * step
            out[m, 0] = V[i, 0] + corner * math.cos(angle)
            out[m, 1] = V[i, 1] + corner * math.sin(angle)
            m += 1
        before = after
    return m


@kernel
def _normal(P: Floats, n: int, i: int) -> float:
    """Direction of the outer normal of the edge that begins at vertex i."""
    j = i + 1 if i + 1 < n else 0
    return math.atan2(P[i, 0] - P[j, 0], P[j, 1] - P[i, 1])


@kernel
def _near(p: Floats, q: Floats, distance: float) -> bool:
    """Whether no coordinate differs by more than a distance."""
    near: bool = max(abs(p[0] - q[0]), abs(p[1] - q[1])) <= distance
    return near


@kernel
def hull(P: Floats, n: int, Q: Floats, m: int, out: Floats) -> int:
    """Write the convex hull of two polygons into out (at least n + m + 1 rows); the number of its vertices."""
    total = n + m
    points = np.empty((total, 2))
    points[:n] = P[:n]
    points[n:] = Q[:m]
    for i in range(1, total):
        x, y = points[i]
        j = i - 1
        while j >= 0 and (points[j, 0] > x or (points[j, 0] == x and points[j, 1] > y)):
            points[j + 1] = points[j]
            j -= 1
        points[j + 1] = x, y
    k = 0
    for way in range(2):
        base = k
        for step in range(total):
            p = points[step] if way == 0 else points[total - 1 - step]
            while k - base >= 2 and _turns_right(out[k - 2], out[k - 1], p):
                k -= 1
            out[k] = p
            k += 1
        k -= 1
    return k


@kernel
def _turns_right(a: Floats, b: Floats, c: Floats) -> bool:
    """Or goes straight on."""
    result: bool = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) <= 0.0
    return result
