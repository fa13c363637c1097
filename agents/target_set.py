"""Where an agent that tells nobody its place may be, as planning and pictures need it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray

from protocol.messages import Point

Floats = NDArray[np.float64]

MOST_CORNERS: Final = 40
"""Samples taken from the outline; of more corners those that lie far from each other."""

GRID_POINTS: Final = 32
"""Samples inside, about so many."""

LEAST_PITCH_M: Final = 0.1
"""A finer grid says nothing more."""

SIMPLER_M: Final = 0.01
"""Corners that matter less are left out of the outline's samples and of pictures."""


@dataclass(frozen=True, slots=True)
class TargetSet:
    """The set that contains the agent, in samples and outlines. Metres, map frame.

    A picture of the set, not the set: whether a point is in it is asked of what made it
    (:meth:`agents.shared_estimate.SharedEstimate.contains`).
    """

    time_s: float
    """Mission time at which the set holds; later it is larger by what the agent can walk."""
    center: Point
    """The sample whose farthest sample is nearest: inside the set, and in free space."""
    samples: tuple[Point, ...]
    """Of the set: corners and a grid inside, all in free space; never empty."""
    rings: tuple[tuple[Point, ...], ...]
    """Outlines, open: of its parts, and of holes in them."""
    area_m2: float
    newest_s: float
    """Time of the newest range in it."""


def describe(region: shapely.Geometry, time_s: float = math.nan, newest_s: float = math.nan) -> TargetSet:
    """Samples and outlines of a region that is not empty, metres, map frame.

    Args:
        region: all places where the agent may be.
        time_s: when; not a number if that is to be filled in.
        newest_s: as in the set.

    Complexity: O(n²) for n samples, of which there are some dozens.
    """
    simple = shapely.simplify(region, SIMPLER_M)
    outlines = [
        shapely.get_coordinates(ring)[:-1]
        for part in shapely.get_parts(simple)
        if isinstance(part, shapely.Polygon)
        for ring in (part.exterior, *part.interiors)
    ]
    corners = np.concatenate(outlines) if outlines else shapely.get_coordinates(region)
    samples = np.concatenate([_spread(corners, MOST_CORNERS), _grid(region)])
    between = np.hypot(*(samples[:, None] - samples[None]).transpose(2, 0, 1))
    center = samples[np.argmin(between.max(axis=1))]
    return TargetSet(
        time_s=time_s,
        center=_point(center),
        samples=tuple(map(_point, samples)),
        rings=tuple(tuple(map(_point, outline)) for outline in outlines),
        area_m2=float(shapely.area(region)),
        newest_s=newest_s,
    )


def _spread(points: Floats, most: int) -> Floats:
    """At most so many of the points: the first, then again and again the one farthest from those taken."""
    if len(points) <= most:
        return points
    taken = [0]
    away = np.hypot(*(points - points[0]).T)
    while len(taken) < most:
        taken.append(int(np.argmax(away)))
        away = np.minimum(away, np.hypot(*(points - points[taken[-1]]).T))
    return points[taken]


def _grid(region: shapely.Geometry) -> Floats:
    """Points of a square grid inside the region."""
    pitch = max(math.sqrt(float(shapely.area(region)) / GRID_POINTS), LEAST_PITCH_M)
    x0, y0, x1, y1 = shapely.bounds(region).tolist()
    across, up = (np.arange(low + 0.5 * pitch, high, pitch) for low, high in ((x0, x1), (y0, y1)))
    grid = np.stack(np.meshgrid(across, up, indexing="ij"), axis=-1).reshape(-1, 2)
    return grid[shapely.contains_xy(region, grid[:, 0], grid[:, 1])]


def _point(values: Floats) -> Point:
    return float(values[0]), float(values[1])
