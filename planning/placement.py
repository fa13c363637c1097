"""Where in a cell a robot can stand: a disc does not reach every cell, and seldom every centroid."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from planning.environment import Environment

if TYPE_CHECKING:
    from planning.decomposition import Cells


def reachable_positions(cells: Cells, free: Environment) -> NDArray[np.float64]:
    """The point of each cell, within the free space of a robot's centre, that is nearest to the cell's centroid.

    A robot that stands there is in its closed cell, so it sees all that the mutual visibility graph promises, and can
    be reached from everywhere in ``free``. A cell without such a point is no placement.

    Args:
        cells: N cells of the environment as drawn.
        free: that environment inflated by the robot's radius, the component that robots are in.

    Returns:
        (N, 2) float, metres, map frame; NaN where a cell does not meet ``free``.

    Complexity: O(N w) for w walls of ``free``; only cells whose centroid is not free are intersected.
    """
    positions = np.array(cells.centroids, dtype=np.float64)
    hidden = np.flatnonzero(~free.contains(positions))
    if len(hidden) == 0:
        return positions
    shapes = np.array([shapely.Polygon(cells.polygons[cell]) for cell in hidden])
    shapely.prepare(free.polygon)
    met = shapely.intersects(free.polygon, shapes)
    positions[hidden[~met]] = np.nan
    hidden, shapes = hidden[met], shapes[met]
    standing = shapely.intersection(shapes, free.polygon)
    nearest = shapely.shortest_line(standing, shapely.points(positions[hidden]))
    positions[hidden] = shapely.get_coordinates(shapely.get_point(nearest, 0))
    return positions
