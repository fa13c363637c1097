"""Geodesic lengths to places that stay: from a robot to all placements, and between all of them.

What a place sees of the reflex vertices by a tangent segment (its *legs*) is found once; after that a shortest path to
it is the shorter of the direct way and the best of a few legs. A row costs one search from its start and N lines of
sight, a tenth of what `GeodesicMap.lengths` takes, and a table of all pairs a hundredth.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.geodesic import GeodesicMap, is_tangent, reach_corners
from planning.kernel import kernel
from planning.line_of_sight import free_points_see

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Legs: TypeAlias = tuple[Ints, Ints, Floats]


class GeodesicTable:
    """Lengths of shortest paths to N places.

    Args:
        geodesics: of the space where the robot's centre may be.
        places: (N, 2) float, metres, map frame.
        legs: :attr:`legs` of another table of the same places in the same space, if they are known.

    Raises:
        NotInFreeSpace: a place is no point of that space.

    Complexity: O(N r w) for r reflex vertices and w walls, of which most are ruled out by their tangents; O(N t) memory
    for t legs of a place.
    """

    def __init__(self, geodesics: GeodesicMap, places: ArrayLike, legs: Legs | None = None) -> None:
        self.places: Floats = np.array(places, dtype=np.float64, order="C").reshape(-1, 2)
        self.geodesics = geodesics
        if legs is None:
            geodesics.check_free(self.places)
            walls, tolerance = geodesics.environment.walls, geodesics.environment.tolerance_m
            legs = _find_legs(self.places, geodesics.corners, walls, tolerance)
        self.legs: Legs = legs
        """Of place i: entries ``starts[i]`` to ``starts[i + 1]`` of two lists: reflex vertices and lengths, metres."""

    def lengths(self, p: ArrayLike) -> Floats:
        """Lengths of the shortest paths from p (2,), metres, to each place: (N,) float. O(t r + N (w + t)).

        Raises:
            NotInFreeSpace: p is no point of the space.
        """
        start = np.array(p, dtype=np.float64, order="C").reshape(1, 2)
        self.geodesics.check_free(start)
        geodesics = self.geodesics
        walls, tolerance = geodesics.environment.walls, geodesics.environment.tolerance_m
        found: Floats = _find_row(
            start[0], self.places, *self.legs, geodesics.corners, geodesics.corner_lengths, walls, tolerance
        )
        return found

    @cached_property
    def between(self) -> Floats:
        """Lengths of the shortest paths between all places: (N, N) float, metres, symmetric. O(N t r + N² (w + t))."""
        geodesics = self.geodesics
        walls, tolerance = geodesics.environment.walls, geodesics.environment.tolerance_m
        found: Floats = _find_table(self.places, *self.legs, geodesics.corner_lengths, walls, tolerance)
        found.flags.writeable = False
        return found


@kernel
def _find_legs(places: Floats, corners: Floats, walls: Floats, tolerance: float) -> Legs:
    """The legs of place i are entries ``starts[i]`` to ``starts[i + 1]`` of two lists: reflex vertices and lengths."""
    starts = np.zeros(len(places) + 1, np.int64)
    bends = np.empty(64, np.int64)
    lengths = np.empty(64)
    n = 0
    for i in range(len(places)):
        x, y = places[i, 0], places[i, 1]
        for j in range(corners.shape[0]):
            vx, vy = corners[j, 1, 0], corners[j, 1, 1]
            if is_tangent(x, y, corners, j, tolerance) and free_points_see(x, y, vx, vy, walls, tolerance):
                if n == len(bends):
                    bends = np.concatenate((bends, np.empty(n, np.int64)))
                    lengths = np.concatenate((lengths, np.empty(n)))
                bends[n] = j
                lengths[n] = math.hypot(vx - x, vy - y)
                n += 1
        starts[i + 1] = n
    return starts, bends[:n].copy(), lengths[:n].copy()


@kernel
def _finish_at(place: int, reached: Floats, starts: Ints, bends: Ints, lengths: Floats) -> float:
    """Length of the shortest bent path to a place, its reflex vertices having been reached."""
    best = np.inf
    for leg in range(starts[place], starts[place + 1]):
        best = min(best, reached[bends[leg]] + lengths[leg])
    return best


@kernel
def _find_row(
    start: Floats,
    places: Floats,
    starts: Ints,
    bends: Ints,
    leg_lengths: Floats,
    corners: Floats,
    corner_lengths: Floats,
    walls: Floats,
    tolerance: float,
) -> Floats:
    reached, _ = reach_corners(start, corners, corner_lengths, walls, tolerance)
    row = np.empty(len(places))
    for i in range(len(places)):
        x, y = places[i, 0], places[i, 1]
        if free_points_see(start[0], start[1], x, y, walls, tolerance):
            row[i] = math.hypot(x - start[0], y - start[1])
        else:
            row[i] = _finish_at(i, reached, starts, bends, leg_lengths)
    return row


@kernel
def _find_table(
    places: Floats,
    starts: Ints,
    bends: Ints,
    leg_lengths: Floats,
    corner_lengths: Floats,
    walls: Floats,
    tolerance: float,
) -> Floats:
    number = len(places)
    table = np.zeros((number, number))
    reached = np.empty(len(corner_lengths))
    for i in range(number):
        reached[:] = np.inf
        for leg in range(starts[i], starts[i + 1]):
            for corner in range(len(reached)):
                reached[corner] = min(reached[corner], leg_lengths[leg] + corner_lengths[bends[leg], corner])
        x, y = places[i, 0], places[i, 1]
        for j in range(i + 1, number):
            if free_points_see(x, y, places[j, 0], places[j, 1], walls, tolerance):
                length = math.hypot(places[j, 0] - x, places[j, 1] - y)
            else:
                length = _finish_at(j, reached, starts, bends, leg_lengths)
            table[i, j] = table[j, i] = length
    return table
