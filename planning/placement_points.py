"""Points worth standing at: the corners of the space that a robot's centre can be in, and a grid over the rest of it.

Who stands at a corner sees both sides of it, and shortest paths bend there, so every place of that space sees one of
its corners (or all of it, if it has none). Around each reflex vertex of the map the space has an arc of many corners,
which see about the same; the one in the middle stands for its arc. A hexagonal grid adds places with a wide view.
Points move with the map when it is moved or scaled.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from planning.connectivity import connected
from planning.environment import Environment

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

NUMBER: Final = 240
"""About so many points a map gets if nobody says how dense."""

LEAST_GRID: Final = 120
"""So many of them are left to the grid, however many corners there are."""

MOST: Final = 4000
"""More points take too much memory, and minutes."""

CORNER_SHARE: Final = 0.1
"""Corners nearer to one another than this share of the spacing are one."""

GRID_SHARE: Final = 0.5
"""A point of the grid nearer to a corner than this share of the spacing is left out."""

HEXAGON: Final = math.sqrt(3.0) / 2.0
"""Area for each point of a hexagonal grid of spacing 1."""


class UnfitSpacing(ValueError):
    """A spacing of no use on this map; the text is one sentence with the remedy."""


def choose_spacing(environment: Environment, free: Environment) -> float:
    """The spacing, metres, at which :func:`choose_points` finds about :data:`NUMBER`. Arguments as there."""
    return math.sqrt(free.area / (HEXAGON * max(NUMBER - len(environment.reflex_vertices), LEAST_GRID)))


def choose_points(environment: Environment, free: Environment, spacing_m: float) -> tuple[Floats, Bools]:
    """Points and who sees whom: corners in the order of the map's walls, then the grid, row by row from below.

    Args:
        environment: the map as drawn.
        free: that map inflated by the robot's radius.
        spacing_m: of the grid, metres.

    Returns:
        points: (N, 2) float, metres, map frame, N ≥ 1, all in ``free``.
        visible: (N, N) bool, by lines of sight through the map as drawn. The points are connected: where the middles of
        arcs would not be, all corners are taken.

    Raises:
        UnfitSpacing: the spacing is not positive and finite, or makes more than :data:`MOST` points.

    Complexity: O(N² w) for w walls.
    """
    if not (isinstance(spacing_m, int | float | np.number) and 0.0 < spacing_m < math.inf):
        raise UnfitSpacing(f"the spacing of placements is {spacing_m!r}: give a finite number of metres above 0")
    corners = _thin(_middles_of_arcs(environment, free), CORNER_SHARE * spacing_m)
    expected = free.area / (HEXAGON * spacing_m**2) + len(corners)
    if expected > MOST:
        least_m = math.sqrt(free.area / (HEXAGON * max(MOST - len(corners), LEAST_GRID)))
        raise UnfitSpacing(
            f"a spacing of {spacing_m:g} m makes about {expected:.0f} placements, and at most {MOST} can be planned "
            f"on: make it at least {math.ceil(1e3 * least_m) / 1e3:g} m"
        )
    points = _with_grid(corners, free, spacing_m)
    visible = environment.visibility_matrix(points)
    if not connected(visible):
        points = _with_grid(free.reflex_vertices, free, spacing_m)
        visible = environment.visibility_matrix(points)
    return points, visible


def _middles_of_arcs(environment: Environment, free: Environment) -> Floats:
    """Of the corners of ``free`` nearest to each reflex vertex of the map the one in their middle: (n, 2)."""
    corners = free.reflex_vertices
    if len(corners) == 0:
        return np.empty((0, 2))
    _, vertices = KDTree(environment.reflex_vertices).query(corners)
    middles = []
    for vertex in np.unique(vertices):
        arc = corners[vertices == vertex]
        # Rounding must not choose between two that are equally near to the middle.
        apart = np.hypot(*(arc - arc.mean(axis=0)).T)
        middles.append(arc[np.flatnonzero(apart <= apart.min() + 1e3 * free.tolerance_m)[0]])
    return np.array(middles)


def _thin(points: Floats, least_m: float) -> Floats:
    """The points without those nearer than ``least_m`` to one before them that stays."""
    stay: list[int] = []
    for index, point in enumerate(points):
        if not stay or np.hypot(*(points[stay] - point).T).min() >= least_m:
            stay.append(index)
    return points[stay]


def _with_grid(corners: Floats, free: Environment, spacing_m: float) -> Floats:
    """Corners, and the grid apart from them; one point in the middle where there would be none."""
    grid = _hexagons(free, spacing_m)
    if len(corners) and len(grid):
        apart, _ = KDTree(corners).query(grid)
        grid = grid[apart >= GRID_SHARE * spacing_m]
    points = np.concatenate([corners, grid])
    # A space without corners is convex.
    return points if len(points) else free.vertices.mean(axis=0, keepdims=True)


def _hexagons(free: Environment, spacing_m: float) -> Floats:
    """The points in ``free`` of a hexagonal grid, in the middle of its bounds: (g, 2)."""
    low, high = np.array(free.bounds[:2]), np.array(free.bounds[2:])
    pitch = np.array([spacing_m, HEXAGON * spacing_m])
    columns, rows = np.floor((high - low) / pitch + 1e-9).astype(int) + 1
    first = low + 0.5 * (high - low - (np.array([columns, rows]) - 1) * pitch)
    row, column = np.mgrid[0:rows, 0:columns]
    x = first[0] + (column + (row % 2 - 0.5) / 2) * spacing_m
    grid = np.column_stack([x.ravel(), (first[1] + row * pitch[1]).ravel()])
    return grid[free.contains(grid)]
