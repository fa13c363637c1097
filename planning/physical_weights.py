"""Physical weights: what it costs robots to go where a deployment wants them.

Thesis §3.4.1, W_p of eq. 38 and 43. Rows are robots, columns placements (cells, or placements of another kind); all
are lengths in metres, and infinite where a robot cannot go at all. An infinite weight is also how motion is bounded
(§3.5.1, the note on design): :func:`bounded_weights` forbids what is too far, :func:`arrival_times` what cannot be
reached in time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.adjacency_path import AdjacencyPaths
from planning.geodesic import GeodesicMap

Floats = NDArray[np.float64]


def euclidean_weights(positions: ArrayLike, places: ArrayLike) -> Floats:
    """Straight distances: ‖centroid(C_i) − centroid(C_j)‖ of §3.4.1. They count walls for nothing.

    Args:
        positions: (k, 2), metres, map frame: where the robots are.
        places: (N, 2), metres, map frame: where they would stand; NaN for no place.

    Returns:
        (k, N) float, metres; inf for no place. O(k N).
    """
    robots, stops = _read_points(positions), _read_points(places)
    distances = np.hypot(*(robots[:, None] - stops).transpose(2, 0, 1))
    return np.where(np.isnan(distances), np.inf, distances)


def geodesic_weights(geodesics: GeodesicMap, positions: ArrayLike, places: ArrayLike) -> Floats:
    """Lengths of the shortest paths among walls (§3.4.1, §4.2.1).

    Args:
        geodesics: of the space where the robots' centres may be.
        positions: as for :func:`euclidean_weights`.
        places: likewise.

    Returns:
        (k, N) float, metres; inf for robots and places outside that space. O(k (t r + N (t w + r))) as
        `GeodesicMap.lengths`.
    """
    robots, stops = _read_points(positions), _read_points(places)
    weights = np.full((len(robots), len(stops)), np.inf)
    inside = geodesics.environment.contains(stops)
    for robot in np.flatnonzero(geodesics.environment.contains(robots)):
        weights[robot, inside] = geodesics.lengths(robots[robot], stops[inside])
    return weights


def adjacency_path_weights(paths: AdjacencyPaths, positions: ArrayLike) -> Floats:
    """Lengths of the shortest paths through adjacent cells (§3.4.1, §4.2.2), wherever in its cell a robot is.

    Args:
        paths: of the cells that are the placements.
        positions: as for :func:`euclidean_weights`.

    Returns:
        (k, N) float, metres, 0 for the cell that a robot is in; inf for cells that no path leads to, and for robots
        outside all cells. O(k N log N).
    """
    cells = paths.cells.locate(_read_points(positions))
    weights = np.full((len(cells), len(paths.cells)), np.inf)
    for cell in np.unique(cells[cells >= 0]):
        weights[cells == cell] = paths.lengths_from(int(cell))
    return weights


def bounded_weights(weights: ArrayLike, most: ArrayLike) -> Floats:
    """Weights with all that are above a bound infinite, so that no robot is sent there.

    Args:
        weights: (k, N), of any unit.
        most: the bound in that unit: one for all, (k, 1) one for each robot, or (N,) one for each placement.

    Returns:
        (k, N) float.
    """
    given = np.asarray(weights, dtype=np.float64)
    return np.where(given <= np.asarray(most, dtype=np.float64), given, np.inf)


def arrival_times(lengths_m: ArrayLike, speed_m_s: ArrayLike, deadline_s: ArrayLike = np.inf) -> Floats:
    """When robots that start now arrive; inf where that is too late.

    Args:
        lengths_m: (k, N), metres: how far robots have to go.
        speed_m_s: above 0: one for all, or (k, 1) one for each robot.
        deadline_s: seconds from now: one for all, (k, 1) for each robot, or (N,) for each placement.

    Returns:
        (k, N) float, seconds.

    Raises:
        ValueError: a speed is not above 0.
    """
    speed = np.asarray(speed_m_s, dtype=np.float64)
    if not np.all(speed > 0.0):
        raise ValueError(f"robots arrive at a speed above 0 m/s, not {float(speed.min()):g}")
    return bounded_weights(np.asarray(lengths_m, dtype=np.float64) / speed, deadline_s)


def _read_points(points: ArrayLike) -> Floats:
    return np.array(points, dtype=np.float64, order="C").reshape(-1, 2)
