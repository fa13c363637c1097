"""All that can be seen from a place, as one polygon."""

from __future__ import annotations

import math

import numpy as np
import shapely
from numpy.typing import NDArray

from planning.environment import Environment

Floats = NDArray[np.float64]


def visible_region(environment: Environment, place: tuple[float, float]) -> shapely.Polygon:
    """The region in line of sight of a place in free space: star-shaped about it.

    Between the directions of two neighbouring vertices one wall, the nearest, bounds the sight. So the directions of
    all vertices are sorted, the wall that the middle direction of each sector meets first is found, and the ends of the
    sector on that wall are corners of the region; where there is nothing to be seen, the place itself is one. Sight
    along a wall, a region without area, is left out.

    Args:
        environment: the walls.
        place: (x, y), metres, map frame.

    Returns:
        The region, metres, map frame, right up to rounding; empty if the place sees no area.

    Complexity: O(w²) for w walls, vectorised.
    """
    walls = environment.walls
    begins, along = walls[:, 0] - place, walls[:, 1] - walls[:, 0]
    angles = np.unique(np.arctan2(begins[:, 1], begins[:, 0]))
    ends = np.append(angles[1:], angles[0] + 2.0 * math.pi)
    middles = 0.5 * (angles + ends)
    reach = _reach(middles, begins, along)
    nearest = np.argmin(reach, axis=1)
    far = reach[np.arange(len(middles)), nearest]
    wide = ends - angles > _NARROW
    sees = wide & np.isfinite(far)
    # From a place on a wall some directions lead into it.
    halfway = 0.5 * far[sees, None] * np.stack([np.cos(middles[sees]), np.sin(middles[sees])], axis=1)
    sees[sees] = environment.contains(halfway + place)
    if not sees.any():
        return shapely.Polygon()
    corners = np.zeros((len(angles), 2, 2))
    seen = nearest[sees]
    corners[sees] = _meet(np.stack([angles[sees], ends[sees]], axis=1), begins[seen], along[seen])
    corners = corners[wide].reshape(-1, 2) + place
    region = shapely.Polygon(corners)
    return region if region.is_valid else shapely.buffer(region, 0.0)


_NARROW = 1e-12
"""Radians; a sector no wider shows nothing."""

_TOUCHING_M = 1e-12
"""A wall no farther is one that the place is on."""


def _reach(angles: Floats, begins: Floats, along: Floats) -> Floats:
    """(a, w) float: how far each wall is in each direction, metres; inf where it is not met."""
    u, v = np.cos(angles)[:, None], np.sin(angles)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        across = u * along[:, 1] - v * along[:, 0]
        far = (begins[:, 0] * along[:, 1] - begins[:, 1] * along[:, 0]) / across
        share = (begins[:, 0] * v - begins[:, 1] * u) / across
    met = (far > _TOUCHING_M) & (share >= 0.0) & (share <= 1.0)
    return np.where(met, far, math.inf)


def _meet(sides: Floats, begins: Floats, along: Floats) -> Floats:
    """(n, 2, 2) float: where two rays (n, 2) of directions meet the line of a wall (n,), from the place."""
    u, v = np.cos(sides), np.sin(sides)
    across = u * along[:, 1:] - v * along[:, :1]
    far = (begins[:, :1] * along[:, 1:] - begins[:, 1:] * along[:, :1]) / across
    return np.stack([u * far, v * far], axis=-1)
