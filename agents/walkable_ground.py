"""Where somebody can be who walks in free space: regions cut along the walls, and what can be reached from them.

Regions are shapely geometries, metres, map frame. Everything is rounded outwards: what is left out cannot be reached.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray

from planning.environment import Environment

Floats = NDArray[np.float64]

ROUNDING_M: Final = 1e-4
"""By this outlines of pieces are widened before they are joined, so that slivers are polygons too."""

_SEGMENTS: Final = 4
"""Of a quarter of a circle."""

_OUTWARDS: Final = 1.0 / math.cos(math.pi / (4 * _SEGMENTS))
"""A polygon of so many segments on a circle of this radius has the unit circle inside."""


class WalkableGround:
    """The free space of a walker's centre.

    Args:
        room: the map inflated by the walker's radius.
    """

    def __init__(self, room: Environment) -> None:
        self.polygon = room.polygon

    def clip(self, pieces: Sequence[Floats]) -> shapely.Geometry:
        """What of convex pieces, (n, 2) float each, is in free space; the point nearest to the first if nothing is."""
        around = outlines(pieces)
        region = shapely.union_all(shapely.intersection(around, self.polygon))
        if region.is_empty:
            return shapely.Point(shapely.get_coordinates(shapely.shortest_line(self.polygon, around[0]))[0])
        return region

    def walked(self, region: shapely.Geometry, distance_m: float) -> shapely.Geometry:
        """All that can be reached from a region on a way of this length in free space, and a little more.

        Such a way stays within its length of its beginning. So of what is as near as that, the parts that hang together
        with the region are enough. The shorter the way, the less it seems to lead through walls.
        """
        near = shapely.intersection(widened(region, distance_m), self.polygon)
        parts = shapely.get_parts(near)
        return shapely.union_all(parts[shapely.dwithin(parts, region, ROUNDING_M)])


def widened(region: shapely.Geometry, distance_m: float) -> shapely.Geometry:
    """All points within a distance of a region, and at most 2 % of that more."""
    return shapely.buffer(region, _OUTWARDS * distance_m, quad_segs=_SEGMENTS)


def outlines(pieces: Sequence[Floats]) -> NDArray[np.object_]:
    """(n,) polygons around convex pieces, valid whatever rounding has made of their corners."""
    hulls = shapely.convex_hull(np.array([shapely.MultiPoint(piece) for piece in pieces], dtype=object))
    return np.asarray(shapely.buffer(hulls, ROUNDING_M, quad_segs=1))
