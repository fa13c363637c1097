"""Free space less discs that stay where they are: ways lead around them as around walls."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from planning.environment import Environment
from planning.geodesic import GeodesicMap
from planning.polygon_validation import InvalidEnvironment

Floats = NDArray[np.float64]

_PIECES: Final = 8
"""Straight pieces to a quarter circle, as around corners."""

_MARGINS: Final = (16.0, 128.0, 1024.0, 8192.0)
"""Tolerances that a disc is larger by, until what is left is bounded by simple rings."""


def carve(
    geodesics: GeodesicMap, discs: Sequence[tuple[ArrayLike, float]], radius_m: float, starts: Floats
) -> GeodesicMap:
    """Shortest paths that keep a robot's disc clear of others.

    Args:
        geodesics: of the space where the robots' centres can be.
        discs: each a place (2,), or a path (m, 2) anywhere on which the disc may be, metres, and its radius, metres. A
            disc that a start is nearer to than that is as large as the start leaves it.
        radius_m: of the robots, metres.
        starts: (n, 2) float, metres: where they are. Of several components that are left, the one with the most of them
            is taken.

    Returns:
        Those of what is left; what was given where nothing is left, or the discs are out of the way.

    Complexity: an overlay, and a new graph of the reflex vertices.
    """
    free = geodesics.environment
    points = shapely.points(starts)
    lines = [np.array(way, dtype=np.float64).reshape(-1, 2) for way, _ in discs]
    shapes = [shapely.Point(way[0]) if len(way) == 1 else shapely.LineString(way) for way in lines]
    reaches = []
    for shape, (_, radius) in zip(shapes, discs, strict=True):
        nearest = float(shapely.distance(shape, points).min(initial=math.inf))
        reaches.append(min((radius + radius_m) / math.cos(0.25 * math.pi / _PIECES), nearest * (1.0 - 1e-4)))
    for margin in _MARGINS:
        grown = [
            shape.buffer(reach + margin * free.tolerance_m, quad_segs=_PIECES)
            for shape, reach in zip(shapes, reaches, strict=True)
        ]
        left = free.polygon.difference(shapely.union_all(grown))
        parts = [part for part in shapely.get_parts(left) if isinstance(part, shapely.Polygon)]
        if not parts:
            return geodesics
        most = max(parts, key=lambda part: (int(shapely.covers(part, points).sum()), part.area))
        try:
            return GeodesicMap(Environment(most.exterior.coords, [hole.coords for hole in most.interiors], free.name))
        except InvalidEnvironment:
            continue
    return geodesics
