"""Which cell holds a point: a grid of buckets, each with the cells that reach into it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_BUCKETS_PER_CELL = 4.0


@dataclass(frozen=True, slots=True)
class CellIndex:
    """Convex cells, as half-planes and by bucket, in a frame where the map is about 1 wide.

    Attributes:
        sides: (C, 3) float: for each edge its unit inward normal n and offset d; a point x lies n·x − d inside it.
        starts: (N + 1,) int, where each cell's edges start.
        low: (2,) float, the corner of the grid; ``step`` (2,) its buckets' size; ``shape`` their numbers.
        bucket_starts: (B + 1,) int and ``bucket_cells`` (.,) int: the cells of each bucket, ascending.
        tolerance: how far outside every cell a point may lie and still be inside.
    """

    sides: Floats
    starts: Ints
    low: Floats
    step: Floats
    shape: tuple[int, int]
    bucket_starts: Ints
    bucket_cells: Ints
    tolerance: float

    @classmethod
    def build(cls, corners: Floats, starts: Ints, tolerance: float) -> CellIndex:
        """Index convex counter-clockwise cells, one after the other in ``corners`` (C, 2). O(C + bucket entries)."""
        following = np.arange(1, len(corners) + 1)
        following[starts[1:] - 1] = starts[:-1]
        edge = corners[following] - corners
        normal = np.stack([-edge[:, 1], edge[:, 0]], axis=1) / np.hypot(edge[:, 0], edge[:, 1])[:, None]
        sides = np.concatenate([normal, (normal * corners).sum(axis=1, keepdims=True)], axis=1)
        low = corners.min(axis=0) - 2.0 * tolerance
        extent = corners.max(axis=0) + 2.0 * tolerance - low
        bucket = math.sqrt(extent[0] * extent[1] / (_BUCKETS_PER_CELL * (len(starts) - 1)))
        shape = (math.ceil(extent[0] / bucket), math.ceil(extent[1] / bucket))
        step = extent / shape
        bucket_starts, bucket_cells = _fill_buckets(corners, sides, starts, low, step, *shape, tolerance)
        return cls(sides, starts, low, step, shape, bucket_starts, bucket_cells, tolerance)

    def locate(self, points: Floats) -> Ints:
        """The cell that each of ``points`` (n, 2) lies deepest in, the first of equals; -1 for none."""
        found: Ints = _locate(
            points,
            self.sides,
            self.starts,
            self.low,
            self.step,
            *self.shape,
            self.bucket_starts,
            self.bucket_cells,
            self.tolerance,
        )
        return found


@kernel
def _fill_buckets(
    corners: Floats, sides: Floats, starts: Ints, low: Floats, step: Floats, columns: int, rows: int, tolerance: float
) -> tuple[Ints, Ints]:
    """The cells that reach within ``tolerance`` of each bucket (separating axes: the cell's edges and the grid's)."""
    bucket_starts = np.zeros(columns * rows + 1, np.int64)
    bucket_cells = np.empty(0, np.int64)
    for fill in (False, True):
        if fill:
            entries = 0
            for bucket in range(columns * rows):
                # The start of each bucket, one place late: it moves on to the bucket's end as cells are put in.
                entries, bucket_starts[bucket + 1] = entries + bucket_starts[bucket + 1], entries
            bucket_cells = np.empty(entries, np.int64)
        for k in range(len(starts) - 1):
            x_min, x_max, y_min, y_max = np.inf, -np.inf, np.inf, -np.inf
            for c in range(starts[k], starts[k + 1]):
                x_min, x_max = min(x_min, corners[c, 0]), max(x_max, corners[c, 0])
                y_min, y_max = min(y_min, corners[c, 1]), max(y_max, corners[c, 1])
            for column in range(
                int((x_min - tolerance - low[0]) / step[0]), int((x_max + tolerance - low[0]) / step[0]) + 1
            ):
                for row in range(
                    int((y_min - tolerance - low[1]) / step[1]), int((y_max + tolerance - low[1]) / step[1]) + 1
                ):
                    x, y = low[0] + (column + 0.5) * step[0], low[1] + (row + 0.5) * step[1]
                    reaches = True
                    for c in range(starts[k], starts[k + 1]):
                        margin = 0.5 * (step[0] * abs(sides[c, 0]) + step[1] * abs(sides[c, 1])) + 2.0 * tolerance
                        reaches = reaches and sides[c, 0] * x + sides[c, 1] * y - sides[c, 2] >= -margin
                    if reaches:
                        bucket = column * rows + row
                        if fill:
                            bucket_cells[bucket_starts[bucket + 1]] = k
                        bucket_starts[bucket + 1] += 1
    return bucket_starts, bucket_cells


@kernel
def _locate(
    points: Floats,
    sides: Floats,
    starts: Ints,
    low: Floats,
    step: Floats,
    columns: int,
    rows: int,
    bucket_starts: Ints,
    bucket_cells: Ints,
    tolerance: float,
) -> Ints:
    """`CellIndex.locate`."""
    found = np.full(len(points), -1)
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        across, up = (x - low[0]) / step[0], (y - low[1]) / step[1]
        if not (0.0 <= across < columns and 0.0 <= up < rows):
            continue
        bucket = int(across) * rows + int(up)
        deepest = -tolerance
        for entry in range(bucket_starts[bucket], bucket_starts[bucket + 1]):
            cell = bucket_cells[entry]
            depth = np.inf
            for c in range(starts[cell], starts[cell + 1]):
                depth = min(depth, sides[c, 0] * x + sides[c, 1] * y - sides[c, 2])
                if depth < deepest:
                    break
            if depth > deepest or (found[i] < 0 and depth == deepest):
                deepest = depth
                found[i] = cell
    return found
