"""What makes rings an environment: cleaning, orientation, and the checks with their one-sentence refusals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.kernel import kernel
from planning.line_of_sight import point_is_free

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

RELATIVE_TOLERANCE = 1e-9
"""Two things nearer than this share of the map's diagonal touch."""

FARTHEST_M = 1e9
"""Farther from the origin no coordinate may be: floating point resolves a tenth of a micrometre there."""

_NOTHING = 0
_TOUCHES = 1
_CROSSES = 2


class InvalidEnvironment(ValueError):
    """Rings that bound no free space; the text is one sentence with ring, place and remedy."""


def name_ring(index: int) -> str:
    """How messages call ring ``index``: the outer ring is 0, the holes count from 1."""
    return "the outer ring" if index == 0 else f"hole {index}"


def name_place(x: float, y: float) -> str:
    """A place as messages write it, to the millimetre."""
    return f"({x:.3f}, {y:.3f}) m"


def read_ring(points: ArrayLike, index: int) -> Floats:
    """Points of ring ``index`` as (n, 2) float, metres.

    Raises:
        InvalidEnvironment: not a list of [x, y], not finite, beyond `FARTHEST_M`, or fewer than 3 points.
    """
    ring_name = name_ring(index)
    remedy = "give metres in a local frame whose origin is near the map"
    try:
        ring = np.array(points, dtype=np.float64, order="C")
    except OverflowError:
        raise InvalidEnvironment(f"{ring_name} has a coordinate beyond {FARTHEST_M:.0f} m: {remedy}") from None
    except (TypeError, ValueError, RecursionError):
        ring = np.empty(0)
    if ring.ndim != 2 or ring.shape[1] != 2:
        raise InvalidEnvironment(f"{ring_name} is not a list of points: give it as [[x, y], [x, y], ...] in metres")
    if isinstance(points, list | tuple):  # as files have it, where numpy would take true for 1 and "1" too
        for row, point in enumerate(points):
            if any(isinstance(value, bool | str) for value in point):
                ring[row] = np.nan
    lost = np.flatnonzero(~np.isfinite(ring).all(axis=1))
    if lost.size:
        raise InvalidEnvironment(
            f"{ring_name} has a coordinate that is not a finite number at its point {lost[0] + 1}: correct or delete it"
        )
    far = np.flatnonzero((np.abs(ring) > FARTHEST_M).any(axis=1))
    if far.size:
        raise InvalidEnvironment(
            f"{ring_name} has a coordinate beyond {FARTHEST_M:.0f} m at its point {far[0] + 1}: {remedy}"
        )
    if len(ring) < 3:
        raise InvalidEnvironment(f"{ring_name} has {len(ring)} point(s): a ring needs at least 3")
    return ring


def find_tolerance(outer: Floats) -> float:
    """Length in metres below which two things on the map of this outer ring (n, 2) touch.

    A share of the diagonal, but never finer than the coordinates themselves resolve far from the origin.
    """
    size = math.hypot(*np.ptp(outer, axis=0))
    return max(RELATIVE_TOLERANCE * size, 16.0 * float(np.spacing(np.abs(outer).max())))


def clean_ring(ring: Floats, tolerance: float) -> Floats:
    """The ring (n, 2) without points that repeat their predecessor or lie on the straight line between neighbours.

    Both within ``tolerance`` metres; a closing point that repeats the first goes too. The tip of a spike stays, for it
    does not lie *between* its neighbours. Empty where fewer than 3 points are left. O(n).
    """
    kept = ring[_find_corners(ring, tolerance)]
    return kept if len(kept) >= 3 else kept[:0]


def signed_area(ring: Floats) -> float:
    """Area in m² of a ring (n, 2), positive when counter-clockwise (shoelace about its first point)."""
    x, y = (ring - ring[0]).T
    return 0.5 * float(x @ np.roll(y, -1) - np.roll(x, -1) @ y)


def orient(ring: Floats, *, clockwise: bool) -> Floats:
    """The ring in the wanted direction, starting at the same point."""
    if (signed_area(ring) < 0.0) == clockwise:
        return ring
    return np.concatenate([ring[:1], ring[:0:-1]])


def check_rings(walls: Floats, ring_starts: Ints, tolerance: float) -> None:
    """Refuse walls that do not bound one connected free space with holes.

    Args:
        walls: (w, 2, 2) float, metres: all directed walls, ring after ring, outer first.
        ring_starts: (R + 1,) int, where each ring starts in ``walls``.
        tolerance: metres.

    Raises:
        InvalidEnvironment: a ring touches or crosses itself or another, or a hole lies outside or in another hole.

    Complexity: O(w²) box tests.
    """
    ring_of_wall = np.repeat(np.arange(len(ring_starts) - 1), np.diff(ring_starts))
    kind, i, j, x, y = _find_conflict(walls, ring_of_wall, ring_starts, tolerance)
    if kind != _NOTHING:
        _refuse_conflict(kind == _CROSSES, int(ring_of_wall[i]), int(ring_of_wall[j]), name_place(x, y))
    rings = [walls[start:end] for start, end in pairwise(ring_starts)]
    _check_nesting(rings, tolerance)


def _refuse_conflict(crosses: bool, first: int, second: int, place: str) -> None:
    verb = "crosses" if crosses else "touches"
    if first == second:
        remedy = (
            "put its points in order along the boundary, or cut it in two"
            if crosses
            else "move the points there apart, or cut the ring in two"
        )
        raise InvalidEnvironment(f"{name_ring(first)} {verb} itself at {place}: {remedy}")
    other = name_ring(min(first, second))
    remedy = "merge the two rings or move them apart" if first and second else "cut it out of the outer ring or move it"
    raise InvalidEnvironment(f"{name_ring(max(first, second))} {verb} {other} at {place}: {remedy}")


def _check_nesting(rings: Sequence[Floats], tolerance: float) -> None:
    """Rings that touch nowhere nest or not as a whole: one point of each tells."""
    for index, ring in enumerate(rings[1:], start=1):
        x, y = ring[0, 0]
        if not point_is_free(x, y, rings[0], tolerance):
            raise InvalidEnvironment(
                f"hole {index} lies outside the outer ring at {name_place(x, y)}: delete it or move it inside"
            )
        for other in range(1, len(rings)):
            if other != index and point_is_free(x, y, rings[other], tolerance):
                raise InvalidEnvironment(
                    f"hole {index} lies inside hole {other} at {name_place(x, y)}: delete it, or load the space inside "
                    f"hole {other} as a map of its own"
                )


@kernel
def _find_corners(ring: Floats, tolerance: float) -> Bools:
    """Which points of a ring (n, 2) `clean_ring` keeps: (n,) bool. Neighbours of what goes are looked at again."""
    n = ring.shape[0]
    kept = np.ones(n, np.bool_)
    before, after = np.arange(-1, n - 1), np.arange(1, n + 1)
    before[0], after[n - 1] = n - 1, 0
    i, left, settled = 0, n, 0
    while settled < left and left >= 3:
        b, a = before[i], after[i]
        if _is_superfluous(ring[b, 0], ring[b, 1], ring[i, 0], ring[i, 1], ring[a, 0], ring[a, 1], tolerance):
            kept[i] = False
            after[b], before[a] = a, b
            left -= 1
            settled = max(0, settled - 2)
            i = b
        else:
            settled += 1
            i = a
    return kept


@kernel
def _is_superfluous(bx: float, by: float, x: float, y: float, ax: float, ay: float, tolerance: float) -> bool:
    """Whether a point repeats the one before it, b, or lies on the segment from there to the one after it, a."""
    hx, hy = x - bx, y - by
    if math.hypot(hx, hy) <= tolerance:
        return True
    sx, sy = ax - bx, ay - by
    length = math.hypot(sx, sy)
    if length <= tolerance:
        return False
    along = (hx * sx + hy * sy) / length
    return abs(hx * sy - hy * sx) <= tolerance * length and 0.0 <= along <= length


@kernel
def _distance_squared(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> float:
    wx, wy = bx - ax, by - ay
    t = min(1.0, max(0.0, ((px - ax) * wx + (py - ay) * wy) / (wx * wx + wy * wy)))
    dx, dy = ax + t * wx - px, ay + t * wy - py
    return dx * dx + dy * dy


@kernel
def _meet(a: Floats, b: Floats, shared: int, tolerance: float) -> tuple[int, float, float]:
    """How two walls (2, 2) meet and where; ``shared`` counts the ends of b that are a's by construction.

    shared 1: b starts where a ends; they meet nowhere else unless one lies on the other (a spike).
    """
    squared = tolerance * tolerance
    ax, ay, bx, by = a[0, 0], a[0, 1], a[1, 0], a[1, 1]
    cx, cy, dx, dy = b[0, 0], b[0, 1], b[1, 0], b[1, 1]
    if _distance_squared(dx, dy, ax, ay, bx, by) <= squared:
        return _TOUCHES, dx, dy
    if _distance_squared(ax, ay, cx, cy, dx, dy) <= squared:
        return _TOUCHES, ax, ay
    if shared == 1:
        return _NOTHING, 0.0, 0.0
    if _distance_squared(cx, cy, ax, ay, bx, by) <= squared:
        return _TOUCHES, cx, cy
    if _distance_squared(bx, by, cx, cy, dx, dy) <= squared:
        return _TOUCHES, bx, by
    sa = (dx - cx) * (ay - cy) - (dy - cy) * (ax - cx)
    sb = (dx - cx) * (by - cy) - (dy - cy) * (bx - cx)
    sc = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    sd = (bx - ax) * (dy - ay) - (by - ay) * (dx - ax)
    if (sa > 0.0) != (sb > 0.0) and (sc > 0.0) != (sd > 0.0):
        t = sa / (sa - sb)
        return _CROSSES, ax + t * (bx - ax), ay + t * (by - ay)
    return _NOTHING, 0.0, 0.0


@kernel
def _find_conflict(
    walls: Floats, ring_of_wall: Ints, ring_starts: Ints, tolerance: float
) -> tuple[int, int, int, float, float]:
    """First pair of walls that meet where they must not, crossings before touches: kind, both walls, place."""
    found = (_NOTHING, 0, 0, 0.0, 0.0)
    w = walls.shape[0]
    for i in range(w):
        low_x, high_x = min(walls[i, 0, 0], walls[i, 1, 0]) - tolerance, max(walls[i, 0, 0], walls[i, 1, 0]) + tolerance
        low_y, high_y = min(walls[i, 0, 1], walls[i, 1, 1]) - tolerance, max(walls[i, 0, 1], walls[i, 1, 1]) + tolerance
        start, end = ring_starts[ring_of_wall[i]], ring_starts[ring_of_wall[i] + 1]
        for j in range(i + 1, w):
            if (
                min(walls[j, 0, 0], walls[j, 1, 0]) > high_x
                or max(walls[j, 0, 0], walls[j, 1, 0]) < low_x
                or min(walls[j, 0, 1], walls[j, 1, 1]) > high_y
                or max(walls[j, 0, 1], walls[j, 1, 1]) < low_y
            ):
                continue
            if j == i + 1 and j < end:
                kind, x, y = _meet(walls[i], walls[j], 1, tolerance)
            elif i == start and j == end - 1:
                kind, x, y = _meet(walls[j], walls[i], 1, tolerance)
            else:
                kind, x, y = _meet(walls[i], walls[j], 0, tolerance)
            if kind == _CROSSES:
                return kind, i, j, x, y
            if kind == _TOUCHES and found[0] == _NOTHING:
                found = (kind, i, j, x, y)
    return found
