"""Two corners of an obstacle become one, where the walls beside them meet: boxes keep four corners, not eight.

Coordinates are integers, as in :mod:`planning.grid_outline`; all decisions on corners and walls are exact.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel

Booleans: TypeAlias = NDArray[np.bool_]
Integers: TypeAlias = NDArray[np.int64]
Floats: TypeAlias = NDArray[np.float64]


def merge_corners(rings: list[Integers], core: Booleans) -> list[Integers]:
    """Replace the ends of walls by the point where their neighbours meet, as long as no free space of worth is lost.

    Of four corners a, b, c, d in a row, b and c both reflex, the two become one point p on the free side of the wall
    bc, so that b and c lie in the obstacle or on its walls ap and pd. The space cut off, between (a, b, c, d) and
    (a, p, d), holds no cell of the core and no part of another wall. Each merger leaves one reflex corner less.

    Args:
        rings: corners (n, 2) int, (x, y), free space to the left; simple, and not touching.
        core: (h, w) bool, cells that must stay, all inside the rings.

    Returns:
        Rings of the same kind.

    Complexity: O(V²) for V corners, times the handful of sweeps that it takes.
    """
    sizes = [len(ring) for ring in rings]
    starts = np.concatenate([[0], np.cumsum(sizes)])
    points = np.concatenate(rings).astype(np.int64)
    before, after = np.arange(-1, len(points) - 1), np.arange(1, len(points) + 1)
    before[starts[:-1]], after[starts[1:] - 1] = starts[1:] - 1, starts[:-1]
    alive = np.ones(len(points), dtype=np.bool_)
    counts = np.zeros((core.shape[0], core.shape[1] + 1), dtype=np.int64)
    np.cumsum(core, axis=1, out=counts[:, 1:])
    while _sweep(points, before, after, alive, counts):
        pass
    return [points[start:end][alive[start:end]] for start, end in pairwise(starts)]


@kernel
def _sweep(points: Integers, before: Integers, after: Integers, alive: Booleans, counts: Integers) -> int:
    """Merge the ends of every wall that allows it, those that lose the least space first; say how many there were."""
    n = len(points)
    loss = np.full(n, -1.0)
    meeting = np.empty((n, 2), dtype=np.int64)
    for b in range(n):
        if alive[b]:
            loss[b] = _find_meeting(points, before[b], b, after[b], after[after[b]], meeting[b])
    touched = np.zeros(n, dtype=np.bool_)
    merged = 0
    for b in np.argsort(loss):
        if loss[b] < 0 or not alive[b]:
            continue
        a, c = before[b], after[b]
        d = after[c]
        if touched[a] or touched[b] or touched[c] or touched[d]:
            continue
        if _is_clear(points, after, alive, a, b, c, d, meeting[b], counts):
            points[b] = meeting[b]
            alive[c] = False
            after[b], before[d] = d, b
            touched[a] = touched[b] = touched[d] = True
            merged += 1
    return merged


@kernel
def _find_meeting(points: Integers, a: int, b: int, c: int, d: int, meeting: Integers) -> float:
    """Put the lattice point for b and c into `meeting`; return twice the area lost, or -1 if there is none."""
    pa, pb, pc, pd = points[a], points[b], points[c], points[d]
    if d == a or _turn(pa, pb, pc) >= 0 or _turn(pb, pc, pd) >= 0:
        return -1.0
    along, onward = pb - pa, pd - pc
    sine = along[0] * onward[1] - along[1] * onward[0]
    if sine >= 0:
        return -1.0
    share = ((pc[0] - pa[0]) * onward[1] - (pc[1] - pa[1]) * onward[0]) / sine
    x, y = int(np.floor(pa[0] + share * along[0])), int(np.floor(pa[1] + share * along[1]))
    best = -1.0
    p = np.empty(2, dtype=np.int64)
    for right in range(-2, 4):
        for up in range(-2, 4):
            p[0], p[1] = x + right, y + up
            first, middle, last = _turn(pa, pb, p), _turn(pb, pc, p), _turn(pc, pd, p)
            if first < 0 or middle <= 0 or last < 0 or _turn(pa, p, pd) >= 0:
                continue
            lost = float(first + middle + last)
            if best < 0 or lost < best:
                best = lost
                meeting[0], meeting[1] = p[0], p[1]
    return best


@kernel
def _is_clear(
    points: Integers,
    after: Integers,
    alive: Booleans,
    a: int,
    b: int,
    c: int,
    d: int,
    p: Integers,
    counts: Integers,
) -> bool:
    """Whether the triangles abp, bcp and cdp hold nothing of the core, and they and the walls ap and pd no corner.

    As nothing crosses the old walls, another wall in there would cross a new one, or have a corner inside.
    """
    pa, pb, pc, pd = points[a], points[b], points[c], points[d]
    for v in range(len(points)):
        if not alive[v]:
            continue
        if v not in (a, b, c, d) and (
            _holds(pa, pb, p, points[v]) or _holds(pb, pc, p, points[v]) or _holds(pc, pd, p, points[v])
        ):
            return False
        w = after[v]
        if v in (a, b, c):
            continue
        if w != a and _cross(pa, p, points[v], points[w]):
            return False
        if v != d and _cross(p, pd, points[v], points[w]):
            return False
    return not (_has_core(pa, pb, p, counts) or _has_core(pb, pc, p, counts) or _has_core(pc, pd, p, counts))


@kernel
def _turn(p: Integers, q: Integers, r: Integers) -> int:
    """Twice the signed area of a triangle: positive where r is to the left of pq."""
    doubled: int = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    return doubled


@kernel
def _holds(p: Integers, q: Integers, r: Integers, point: Integers) -> bool:
    """Whether the closed triangle pqr, counter-clockwise, holds a point; one without area holds nothing."""
    inside: bool = (
        _turn(p, q, r) > 0 and _turn(p, q, point) >= 0 and _turn(q, r, point) >= 0 and _turn(r, p, point) >= 0
    )
    return inside


@kernel
def _cross(p: Integers, q: Integers, r: Integers, s: Integers) -> bool:
    """Whether the closed segments pq and rs meet."""
    if max(p[0], q[0]) < min(r[0], s[0]) or max(r[0], s[0]) < min(p[0], q[0]):
        return False
    if max(p[1], q[1]) < min(r[1], s[1]) or max(r[1], s[1]) < min(p[1], q[1]):
        return False
    sides_of_pq = np.sign(_turn(p, q, r)) * np.sign(_turn(p, q, s))
    sides_of_rs = np.sign(_turn(r, s, p)) * np.sign(_turn(r, s, q))
    return bool(sides_of_pq <= 0 and sides_of_rs <= 0)


@kernel
def _has_core(p: Integers, q: Integers, r: Integers, counts: Integers) -> bool:
    """Whether a triangle meets the inside of a cell of the core, by rows; `counts` are cells left of a column."""
    if _turn(p, q, r) == 0:
        return False
    for row in range(min(p[1], q[1], r[1]), max(p[1], q[1], r[1])):
        left, right = np.inf, -np.inf
        for start, end in ((p, q), (q, r), (r, p)):
            low, high = max(row, min(start[1], end[1])), min(row + 1, max(start[1], end[1]))
            if low > high:
                continue
            for y in (low, high):
                if start[1] == end[1]:
                    left, right = min(left, start[0], end[0]), max(right, start[0], end[0])
                else:
                    x = start[0] + (end[0] - start[0]) * ((y - start[1]) / (end[1] - start[1]))
                    left, right = min(left, x), max(right, x)
        if counts[row, int(np.ceil(right))] > counts[row, int(np.floor(left))]:
            return True
    return False
