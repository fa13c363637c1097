"""Kernels that grow a union of convex polygons by a distance, and part what overlaps then.

Areas are sums over the pieces (`estimation.convex_pieces`), so overlaps would count twice, more with every step.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from estimation import convex_polygon
from estimation.convex_cut import MOST_VERTICES, SCRATCH
from estimation.convex_polygon import area, clip, hull, simplify, width
from estimation.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


MOST_CROSSINGS = 16
"""Of two boundaries that are looked at; two are the rule."""


@kernel
def part(P: Floats, n: int, Q: Floats, m: int, other: Floats) -> tuple[int, int, bool]:
    """Part two overlapping pieces by a line that loses no point of either, in place.

    Returns their numbers of vertices, and whether there was such a line, or no need for one.

    Where two convex boundaries cross at two points, the line through these will do: what it takes from one lies in the
    other. That is checked, not trusted. A piece inside the other vanishes.
    """
    if _separates(P, n, Q, m) or _separates(Q, m, P, n):
        return n, m, True
    if _inside(Q, m, P, n):
        return n, 0, True
    if _inside(P, n, Q, m):
        return 0, m, True
    points = np.empty((MOST_CROSSINGS, 2))
    found = _crossings(P, n, Q, m, points)
    for i in range(found):
        for j in range(found):
            ex, ey = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
            length = math.sqrt(ex * ex + ey * ey)
            if length < 1e-7:
                continue
            # P keeps the left of the line from i to j, Q the right.
            nx, ny = ey / length, -ex / length
            limit = nx * points[i, 0] + ny * points[i, 1]
            k = clip(P, n, -nx, -ny, -limit, other)
            if not _inside(other, k, Q, m):
                continue
            k = clip(Q, m, nx, ny, limit, other)
            if not _inside(other, k, P, n):
                continue
            n = clip(P, n, nx, ny, limit, other)
            P[:n] = other[:n]
            m = clip(Q, m, -nx, -ny, -limit, other)
            Q[:m] = other[:m]
            return n, m, True
    return n, m, False


@kernel
def _separates(P: Floats, n: int, Q: Floats, m: int) -> bool:
    """Whether an edge of a polygon has another polygon on its outer side, up to what clipping moves outwards."""
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        ex, ey = P[j, 0] - P[i, 0], P[j, 1] - P[i, 1]
        slack = 4.0 * convex_polygon.ROUNDING_M * math.sqrt(ex * ex + ey * ey)
        beyond = slack > 0.0
        for k in range(m):
            if ex * (Q[k, 1] - P[i, 1]) - ey * (Q[k, 0] - P[i, 0]) > slack:
                beyond = False
                break
        if beyond:
            return True
    return False


@kernel
def _inside(P: Floats, n: int, Q: Floats, m: int) -> bool:
    """Whether a polygon lies in another, to within rounding."""
    for i in range(m):
        j = i + 1 if i + 1 < m else 0
        ex, ey = Q[j, 0] - Q[i, 0], Q[j, 1] - Q[i, 1]
        slack = -4.0 * convex_polygon.ROUNDING_M * math.sqrt(ex * ex + ey * ey)
        for k in range(n):
            if ex * (P[k, 1] - Q[i, 1]) - ey * (P[k, 0] - Q[i, 0]) < slack:
                return False
    return True


@kernel
def _crossings(P: Floats, n: int, Q: Floats, m: int, points: Floats) -> int:
    """Write the points where the boundary of a polygon enters or leaves another into points (k, 2); their number."""
    found = 0
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        enter, leave = 0.0, 1.0
        for k in range(m):
            h = k + 1 if k + 1 < m else 0
            ex, ey = Q[h, 0] - Q[k, 0], Q[h, 1] - Q[k, 1]
            slack = convex_polygon.ROUNDING_M * math.sqrt(ex * ex + ey * ey)
            first = ex * (P[i, 1] - Q[k, 1]) - ey * (P[i, 0] - Q[k, 0]) + slack
            last = ex * (P[j, 1] - Q[k, 1]) - ey * (P[j, 0] - Q[k, 0]) + slack
            if first < 0.0 and last < 0.0:
                leave = -1.0
                break
            if first < 0.0:
                enter = max(enter, first / (first - last))
            elif last < 0.0:
                leave = min(leave, first / (first - last))
        if enter > leave:
            continue
        for t in (enter, leave):
            if 0.0 < t < 1.0 and found < len(points):
                points[found, 0] = P[i, 0] + t * (P[j, 0] - P[i, 0])
                points[found, 1] = P[i, 1] + t * (P[j, 1] - P[i, 1])
                found += 1
    return found


@kernel
def grow(pieces: Floats, counts: Ints, distance: float, out: Floats, kept: Ints, passed: Floats) -> int:
    """Write an outer bound of all points within a distance of a set into out, kept and passed; the number of pieces.

    They count as checked at the width that they have then (`estimation.convex_pieces`): growing blurs what was fine.

    All pieces grow by the same polygon, and then overlap. The boundaries of two convex sets that were apart and grew by
    the same convex set cross at no more than two points, so they can be parted again.
    """
    m = len(counts)
    grown, box = np.empty((m, SCRATCH, 2)), np.empty((m, 4))
    other, joint = np.empty((SCRATCH, 2)), np.empty((3 * SCRATCH, 2))
    for i in range(m):
        kept[i] = convex_polygon.grow(pieces[i], counts[i], distance, grown[i])
        _bound(grown[i], kept[i], box[i])
    overlaps = True
    # A second round for what the hulls of the first one overlap.
    for _ in range(2):
        if not overlaps:
            break
        overlaps = False
        for i in range(m):
            for j in range(i):
                if kept[i] == 0 or kept[j] == 0:
                    continue
                for k in (i, j):
                    # Every line that parts a piece from another may leave a vertex more.
                    if kept[k] > SCRATCH - 4:
                        kept[k] = simplify(grown[k], kept[k], SCRATCH // 2)
                        _bound(grown[k], kept[k], box[k])
                if box[i, 0] > box[j, 2] or box[j, 0] > box[i, 2] or box[i, 1] > box[j, 3] or box[j, 1] > box[i, 3]:
                    continue
                kept[i], kept[j], parted = part(grown[i], kept[i], grown[j], kept[j], other)
                if parted:
                    continue
                n = simplify(joint, hull(grown[i], kept[i], grown[j], kept[j], joint), MOST_VERTICES)
                # An overlap costs area over and over again, a hull once.
                if area(joint, n) <= 1.1 * max(area(grown[i], kept[i]), area(grown[j], kept[j])):
                    grown[j, :n] = joint[:n]
                    kept[i], kept[j], overlaps = 0, n, True
                    _bound(joint, n, box[j])
    k = 0
    for i in range(m):
        n = simplify(grown[i], kept[i], MOST_VERTICES)
        if n:
            out[k, :n] = grown[i, :n]
            kept[k], passed[k] = n, width(out[k], n)
            k += 1
    return k


@kernel
def _bound(P: Floats, n: int, box: Floats) -> None:
    """Write the bounding box of a polygon: least x, least y, greatest x, greatest y."""
    box[:2] = np.inf
    box[2:] = -np.inf
    for i in range(n):
        for axis in range(2):
            box[axis] = min(box[axis], P[i, axis])
            box[axis + 2] = max(box[axis + 2], P[i, axis])
