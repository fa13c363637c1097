"""Walls grown by the radius of a robot: what is left is where its centre can be (thesis §4.2.1).

Every wall grows by the radius; around a reflex vertex it grows by a *circumscribed* arc of straight pieces, each
tangent to the circle, so that no point of what is left is nearer to a wall than the radius, and none is lost that is
farther than radius / cos(π/32), 0.5 % more: one millimetre for a robot of 0.2 m. That is 8 pieces to a quarter circle.
Fewer would make geodesics longer (4: 1.3 % of the arc, 8: 0.3 %), more would add reflex vertices, whose number the
visibility graph pays for squared. Convex corners stay as sharp as they are.
"""

from __future__ import annotations

import math

import numpy as np
import shapely
from numpy.typing import NDArray

from planning.environment import Environment
from planning.polygon_validation import InvalidEnvironment, name_place

Floats = NDArray[np.float64]

PIECES_PER_QUARTER = 8
"""Straight pieces to a quarter circle around a reflex vertex."""

_MARGINS = (2.0, 16.0, 128.0, 1024.0, 8192.0)
"""What is added to the radius, in tolerances, until the result has no pinches; the first covers all rounding."""


class NothingLeft(ValueError):
    """No free space is left for a robot; the text is one sentence with radius, place and remedy."""


def inflate(environment: Environment, radius_m: float, containing: Floats | None = None) -> Environment:
    """One component of the free space that is at least ``radius_m`` from every wall.

    Where grown walls would meet in a single point, the radius is enlarged by up to a few millionths of the map's size,
    so that what is left is bounded by simple rings.

    Args:
        environment: the space whose walls grow.
        radius_m: metres, at least 0.
        containing: (2,) metres: take the component that holds this point, else the nearest that the point sees; None:
            the largest.

    Raises:
        NothingLeft: a disc of this radius fits nowhere, or nowhere in sight of the point.
        ValueError: the radius is negative or not finite.

    Complexity: one overlay of w convex pieces, O(w log w) when few of them overlap.
    """
    if not (math.isfinite(radius_m) and radius_m >= 0.0):
        raise ValueError(f"the radius is {radius_m} m: give a finite length of at least 0")
    if radius_m == 0.0:
        return environment
    refusal = InvalidEnvironment()
    for margin in _MARGINS:
        grown = shapely.union_all(_grow_walls(environment, radius_m + margin * environment.tolerance_m))
        left = environment.polygon.difference(grown)
        component = _choose_component(environment, left, radius_m, containing)
        try:
            return Environment(
                component.exterior.coords,
                [hole.coords for hole in component.interiors if not _is_sliver(shapely.Polygon(hole), environment)],
                environment.name,
                source=environment.source,
            )
        except InvalidEnvironment as error:
            refusal = error
    raise refusal


def _grow_walls(environment: Environment, radius: float) -> list[shapely.Geometry]:
    """A convex piece for each wall: the strip at its left, and the arcs around its reflex ends.

    Neighbours share whole arcs, and strips reach behind their walls, so that rounding leaves no slivers between them.
    What lies behind a wall is nearer to a wall than the radius anyway.
    """
    walls = environment.walls
    along = walls[:, 1] - walls[:, 0]
    normals = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.hypot(along[:, 0], along[:, 1])[:, None]
    after = environment.successors
    before = np.argsort(after)
    arcs = [
        _arc(vertex, normals[before[i]], normals[i], radius) if environment.is_reflex[i] else vertex[None]
        for i, vertex in enumerate(environment.vertices)
    ]
    pieces: list[shapely.Geometry] = []
    for i, (wall, normal) in enumerate(zip(walls, normals, strict=True)):
        corners = np.concatenate([wall - 0.5 * radius * normal, wall + radius * normal, arcs[i], arcs[after[i]]])
        pieces.append(shapely.MultiPoint(corners).convex_hull)
    return pieces


def _arc(vertex: Floats, start: Floats, end: Floats, radius: float) -> Floats:
    """Corners (k, 2) of the circumscribed arc about a reflex vertex, clockwise between two walls' normals."""
    turn = math.atan2(start[1] * end[0] - start[0] * end[1], start @ end)
    count = max(1, math.ceil(turn / (0.5 * math.pi) * PIECES_PER_QUARTER - 1e-9))
    step = turn / count
    angles = math.atan2(start[1], start[0]) - step * (np.arange(count) + 0.5)
    return vertex + radius / math.cos(0.5 * step) * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _choose_component(
    environment: Environment, left: shapely.Geometry, radius_m: float, containing: Floats | None
) -> shapely.Polygon:
    components = [
        part
        for part in shapely.get_parts(left)
        if isinstance(part, shapely.Polygon) and not _is_sliver(part, environment)
    ]
    robot = f"a robot of radius {radius_m:g} m"
    where = f"the map {environment.name!r}" if environment.name else "the map"
    if not components:
        raise NothingLeft(f"{robot} fits nowhere on {where}: use a smaller robot or a map with wider rooms")
    if containing is None:
        return max(components, key=lambda part: part.area)
    point = shapely.Point(containing)
    for part in sorted(components, key=point.distance):
        ends = shapely.shortest_line(point, part).coords
        if part.covers(point) or environment.line_of_sight(containing, ends[1]):
            return part
    x, y = containing
    raise NothingLeft(
        f"{robot} fits nowhere in sight of {name_place(x, y)} on {where}: use a smaller robot or another place"
    )


def _is_sliver(part: shapely.Polygon, environment: Environment) -> bool:
    """Whether a part is no wider than rounding makes it."""
    return bool(part.area <= environment.tolerance_m * part.length)
