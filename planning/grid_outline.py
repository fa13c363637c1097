"""The outline of the free cells of a grid, with few corners, and never through a wall.

All coordinates are integers: cell ``(row, column)`` is the square between the lattice points ``(column, row)`` and
``(column + 1, row + 1)``, and every corner of an outline is a lattice point. So every decision below is exact.
"""

from __future__ import annotations

import heapq
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from planning.corner_merging import merge_corners
from planning.kernel import kernel

Booleans: TypeAlias = NDArray[np.bool_]
Integers: TypeAlias = NDArray[np.int64]
Floats: TypeAlias = NDArray[np.float64]

_BUCKET = 16
"""Side of the square buckets that corners are sorted into, in cells."""


def outline(free: Booleans, depth: Floats, tolerance: float) -> list[Integers]:
    """Rings around one component of free cells, free space to the left, simplified from the inside only.

    Between the true outline and the simplified one lie only cells whose ``depth`` is at most ``tolerance``, and
    the simplified outline never leaves the free cells. It is made of simple rings that do not touch.

    Args:
        free: (h, w) bool, one component by sides, with no two cells that meet in a corner only.
        depth: (h, w) float, cells: distance of each free cell's centre to that of the nearest cell that is not free,
            which bounds the distance of every point of the cell to the wall.
        tolerance: in cells.

    Returns:
        Rings of corners, each (n, 2) int, (x, y); the outer one first.
    """
    rings = trace(free)
    core = free & (depth > tolerance)
    size = 0
    while size != (size := sum(map(len, rings))):
        rings = merge_corners(cut_corners(rings, core, tolerance), core)
    return rings


def without_pinches(free: Booleans, depth: Floats) -> Booleans:
    """Free cells, less one of any two that meet in a corner only, where an outline would touch itself.

    Args:
        free: (h, w) bool.
        depth: (h, w) float: of two cells that meet, the one with the smaller depth goes.
    """
    free = free.copy()
    while True:
        lower_left, lower_right = free[:-1, :-1], free[:-1, 1:]
        upper_left, upper_right = free[1:, :-1], free[1:, 1:]
        rising = np.argwhere(lower_left & upper_right & ~lower_right & ~upper_left)
        falling = np.argwhere(lower_right & upper_left & ~lower_left & ~upper_right)
        if len(rising) + len(falling) == 0:
            return free
        below = np.concatenate([rising, np.add(falling, (0, 1))])
        above = np.concatenate([np.add(rising, (1, 1)), np.add(falling, (1, 0))])
        gone = np.where((depth[tuple(below.T)] < depth[tuple(above.T)])[:, None], below, above)
        free[tuple(gone.T)] = False


def trace(free: Booleans) -> list[Integers]:
    """Rings around free cells, free space to the left; only where it turns is there a corner.

    Args:
        free: (h, w) bool, with no two cells that meet in a corner only.

    Returns:
        Rings of corners, each (n, 2) int, (x, y); the one with the largest signed area first.
    """
    height, width = free.shape
    padded = np.pad(free, 1)
    stride = width + 1
    steps: dict[int, int] = {}
    # The side of a cell towards (up, right) is walked from its corner `at`, in the direction `step`.
    for (up, right), at, step in (
        ((-1, 0), (0, 0), (0, 1)),
        ((0, 1), (0, 1), (1, 0)),
        ((1, 0), (1, 1), (0, -1)),
        ((0, -1), (1, 0), (-1, 0)),
    ):
        beyond = padded[1 + up : 1 + up + height, 1 + right : 1 + right + width]
        rows, columns = np.nonzero(free & ~beyond)
        starts = (rows + at[0]) * stride + columns + at[1]
        steps.update(dict.fromkeys(starts.tolist(), step[0] * stride + step[1]))
    rings = []
    while steps:
        place, step_here = steps.popitem()
        ring = [place]
        place += step_here
        while place in steps:
            ring.append(place)
            place += steps.pop(place)
        points = np.stack([np.array(ring) % stride, np.array(ring) // stride], axis=1)
        turns = np.any(np.roll(points, -1, axis=0) - points != points - np.roll(points, 1, axis=0), axis=1)
        rings.append(points[turns])
    return sorted(rings, key=_signed_area, reverse=True)


def _signed_area(ring: Integers) -> float:
    x, y = ring.T
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2


def _corners(cells: Booleans) -> Integers:
    """Lattice points (n, 2) where the outline of the cells turns."""
    padded = np.pad(cells, 1).astype(np.int8)
    around = padded[:-1, :-1] + padded[:-1, 1:] + padded[1:, :-1] + padded[1:, 1:]
    diagonal = (around == 2) & (padded[:-1, :-1] == padded[1:, 1:])
    return np.argwhere((around == 1) | (around == 3) | diagonal)[:, ::-1]


def cut_corners(rings: list[Integers], core: Booleans, tolerance: float) -> list[Integers]:
    """Rings without the convex corners that cost less than the tolerance, and nothing of the core.

    Args:
        rings: corners (n, 2) int, free space to the left; simple, and not touching.
        core: (h, w) bool, cells that must stay, all inside the rings.
        tolerance: in cells, how far the new wall may be from the corner it replaces.

    Returns:
        Rings of the same kind; their corners are some of those given.
    """
    sizes = [len(ring) for ring in rings]
    starts = np.concatenate([[0], np.cumsum(sizes)])
    corners = np.arange(starts[-1])
    before, after = corners - 1, corners + 1
    before[starts[:-1]] = starts[1:] - 1
    after[starts[1:] - 1] = starts[:-1]
    points = np.concatenate([*rings, _corners(core)]).astype(np.int64)
    shape = points.max(axis=0) // _BUCKET + 1
    bucket = points[:, 1] // _BUCKET * shape[0] + points[:, 0] // _BUCKET
    order = np.argsort(bucket, kind="stable")
    bucket_starts = np.searchsorted(bucket[order], np.arange(shape[0] * shape[1] + 1))
    alive = np.ones(len(corners), dtype=np.bool_)
    while _cut_corners(points, before, after, alive, order, bucket_starts, shape[0], tolerance):
        pass
    return [ring[kept] for ring, kept in zip(rings, np.split(alive, starts[1:-1]), strict=True)]


@kernel
def _cut_corners(
    points: Integers,
    before: Integers,
    after: Integers,
    alive: Booleans,
    order: Integers,
    bucket_starts: Integers,
    columns: int,
    tolerance: float,
) -> int:
    """Cut convex corners off, the smallest triangle first, and say how many; updates `before`, `after` and `alive`.

    Corner v between a and b goes if it is within `tolerance` of the line ab, and the closed triangle (a, v, b) holds
    no other corner of any ring and, off ab, no corner of the core. For simple rings that do not touch that is the
    ear criterion: nothing of the outline, and nothing of the core, lies in the triangle. (After M. Visvalingam and
    J. D. Whyatt, 1993, doi:10.1179/000870493786962263, restricted to one side.) Near-linear in practice.
    """
    heap = [
        (_doubled_area(points, before[v], v, after[v]), v, before[v], after[v]) for v in range(len(alive)) if alive[v]
    ]
    heapq.heapify(heap)
    removed = 0
    while heap:
        area, v, a, b = heapq.heappop(heap)
        if not alive[v] or before[v] != a or after[v] != b or area < 0 or after[b] == a:
            continue
        base = np.hypot(points[b, 0] - points[a, 0], points[b, 1] - points[a, 1])
        if area > tolerance * base or _occupied(points, a, v, b, alive, order, bucket_starts, columns):
            continue
        alive[v] = False
        after[a], before[b] = b, a
        removed += 1
        heapq.heappush(heap, (_doubled_area(points, before[a], a, b), a, before[a], b))
        heapq.heappush(heap, (_doubled_area(points, a, b, after[b]), b, a, after[b]))
    return removed


@kernel
def _doubled_area(points: Integers, a: int, v: int, b: int) -> int:
    """Twice the signed area of the triangle of three points by number."""
    (x, y), (over, up), (across, rise) = points[a], points[v], points[b]
    area: int = (over - x) * (rise - y) - (up - y) * (across - x)
    return area


@kernel
def _occupied(
    points: Integers, a: int, v: int, b: int, alive: Booleans, order: Integers, bucket_starts: Integers, columns: int
) -> bool:
    """Whether a corner of a ring lies in the closed triangle (a, v, b), or one of the core in it and off ab."""
    left = min(points[a, 0], points[v, 0], points[b, 0])
    right = max(points[a, 0], points[v, 0], points[b, 0])
    low = min(points[a, 1], points[v, 1], points[b, 1])
    high = max(points[a, 1], points[v, 1], points[b, 1])
    for row in range(low // _BUCKET, high // _BUCKET + 1):
        first = row * columns + left // _BUCKET
        last = row * columns + right // _BUCKET
        for k in range(bucket_starts[first], bucket_starts[last + 1]):
            p = int(order[k])
            if points[p, 0] < left or points[p, 0] > right or points[p, 1] < low or points[p, 1] > high:
                continue
            of_ring = p < len(alive)
            if of_ring and (not alive[p] or p in (a, v, b)):
                continue
            inside = _doubled_area(points, a, v, p) >= 0 and _doubled_area(points, v, b, p) >= 0
            if inside and _doubled_area(points, b, a, p) >= (0 if of_ring else 1):
                return True
    return False
