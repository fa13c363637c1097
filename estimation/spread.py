"""Points spread evenly over a set in the plane: what :func:`estimation.look_ahead.look_ahead` takes for the set."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# The plastic number: multiples of its powers fill the unit square as evenly as any known sequence (M. Roberts, 2018).
_PLASTIC = 1.32471795724474602596


def spread_points(polygons: Sequence[Floats], count: int) -> Floats:
    """About so many points, spread evenly and always the same.

    Each polygon is cut into the triangles of a fan, and each triangle gets its share by area, so that bands far thinner
    than the distance of two points are filled as evenly as squares.

    Args:
        polygons: convex, each (m, 2) float, counter-clockwise, metres: a tight set's; where two overlap, points are
            twice as dense.
        count: how many points.

    Returns:
        (count, 2) float, metres; (0, 2) when there is no area.
    """
    corners = [
        np.stack([np.broadcast_to(ring[0], ring[2:].shape), ring[1:-1], ring[2:]], axis=1)
        for ring in (np.asarray(polygon, dtype=np.float64) for polygon in polygons)
        if len(ring) > 2
    ]
    if not corners:
        return np.empty((0, 2))
    triangles = np.concatenate(corners)
    first, one, two = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    areas = 0.5 * np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])
    ends = np.cumsum(areas)
    if ends[-1] <= 0:
        return np.empty((0, 2))
    chosen = np.searchsorted(ends, ends[-1] * (np.arange(count) + 0.5) / count)
    steps = np.arange(1, count + 1)[:, None] * np.array([1 / _PLASTIC, 1 / _PLASTIC**2])
    s, t = np.mod(steps + 0.5, 1).T
    # Half of the square is folded onto the triangle.
    flip = s + t > 1
    s, t = np.where(flip, 1 - s, s), np.where(flip, 1 - t, t)
    return np.asarray(first[chosen] + s[:, None] * one[chosen] + t[:, None] * two[chosen])
