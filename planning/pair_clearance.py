"""Which elements of two paths keep their robots apart, wherever on the two elements each may be.

The least distance between two straight ranges is that of two segments, in closed form. If it is the separation or more,
all elements in the ranges are apart; if the greatest, which is that of two ends, is less, none are; else the ranges are
halved, as in `planning.pair_sight`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel
from planning.path_elements import divide_block

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]


@kernel
def _to_segment(x: float, y: float, a: Floats, b: Floats) -> float:
    """Distance of a point from a segment."""
    wx, wy = b[0] - a[0], b[1] - a[1]
    squared = wx * wx + wy * wy
    share = 0.0 if squared == 0.0 else min(1.0, max(0.0, (wx * (x - a[0]) + wy * (y - a[1])) / squared))
    return math.hypot(a[0] + share * wx - x, a[1] + share * wy - y)


@kernel
def _side(a: Floats, b: Floats, p: Floats) -> float:
    return float((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]))


@kernel
def segment_distance(a: Floats, b: Floats, c: Floats, d: Floats) -> float:
    """The least distance between the segments a–b and c–d, points (2,), metres; either may have no length."""
    if _side(a, b, c) * _side(a, b, d) < 0.0 and _side(c, d, a) * _side(c, d, b) < 0.0:
        return 0.0
    return min(
        min(_to_segment(a[0], a[1], c, d), _to_segment(b[0], b[1], c, d)),
        min(_to_segment(c[0], c[1], a, b), _to_segment(d[0], d[1], a, b)),
    )


@kernel
def _farthest(a: Floats, b: Floats, c: Floats, d: Floats) -> float:
    return max(
        max(math.hypot(c[0] - a[0], c[1] - a[1]), math.hypot(d[0] - a[0], d[1] - a[1])),
        max(math.hypot(c[0] - b[0], c[1] - b[1]), math.hypot(d[0] - b[0], d[1] - b[1])),
    )


@kernel
def mark_clearance(
    nodes_i: Floats, corners_i: Ints, nodes_j: Floats, corners_j: Ints, separation: float, table: Bytes, mark: int
) -> None:
    """Set ``mark`` in ``table`` (2 n_i + 1, 2 n_j + 1) where elements of path i and of path j are that far apart."""
    waiting = np.empty((256, 5), np.int64)
    legs_i, legs_j = max(1, corners_i.shape[0] - 1), max(1, corners_j.shape[0] - 1)
    for leg_i in range(legs_i):
        for leg_j in range(legs_j):
            waiting[0, 0], waiting[0, 1] = corners_i[leg_i], corners_i[min(leg_i + 1, corners_i.shape[0] - 1)]
            waiting[0, 2], waiting[0, 3] = corners_j[leg_j], corners_j[min(leg_j + 1, corners_j.shape[0] - 1)]
            waiting[0, 4] = 0
            top = 1
            while top > 0:
                top -= 1
                a, b, c, d = waiting[top, 0], waiting[top, 1], waiting[top, 2], waiting[top, 3]
                if b - a <= 1 and d - c <= 1 and table[a + b, c + d] & mark:
                    continue
                if segment_distance(nodes_i[a], nodes_i[b], nodes_j[c], nodes_j[d]) >= separation:
                    for e in range(2 * a, 2 * b + 1):
                        for f in range(2 * c, 2 * d + 1):
                            table[e, f] |= mark
                elif _farthest(nodes_i[a], nodes_i[b], nodes_j[c], nodes_j[d]) >= separation:
                    top = divide_block(a, b, c, d, 0, waiting, top)
