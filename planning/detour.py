"""Other ways than geodesics: around those who stand in the way, and on other sides of walls and of them.

Who starts at its goal stands there for good, and a geodesic through its disc is no way at all. Where that is so, the
discs of all who stand are cut out of the free space, and the shortest ways lead around them. Where two are still in
each other's way, or would have to part, one of them takes the next shortest way of another homotopy class; or it goes
over a place where it waits for others to pass.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.carving import carve
from planning.geodesic import GeodesicMap
from planning.homotopy import TautPaths
from planning.pair_clearance import segment_distance
from planning.team_task import TeamTask

Floats = NDArray[np.float64]

CLASSES: Final = 3
"""Of ways of one member, the shortest included."""

LONGEST: Final = 2.0
"""A way that is longer than this many times the shortest is no detour worth trying."""


def shortest_paths(task: TeamTask) -> list[Floats]:
    """The members' geodesics (m, 2), metres; the single place of one who stands."""
    return [
        task.geodesics.path(start, goal) if np.any(start != goal) else start[None]
        for start, goal in zip(task.starts, task.goals, strict=True)
    ]


def blocked_by_standing(task: TeamTask, paths: Sequence[Floats]) -> list[tuple[int, int]]:
    """Pairs of a mover and of a member who stands where the mover's path leads, by their rows."""
    apart = task.separations() - task.environment.tolerance_m
    return [(i, j) for i in task.movers for j in task.standing if _nearest(paths[i], task.starts[j]) < apart[i, j]]


def space_around_standing(task: TeamTask) -> GeodesicMap:
    """Shortest paths that lead around the discs of those who stand, for the movers with the widest discs."""
    discs = [(task.starts[i], float(task.radii_m[i])) for i in task.standing if task.radii_m[i] > 0.0]
    places = np.concatenate([task.starts[task.movers], task.goals[task.movers]])
    return carve(task.geodesics, discs, float(task.radii_m[task.movers].max()), places) if discs else task.geodesics


def paths_around(task: TeamTask, paths: Sequence[Floats], rows: Sequence[int], space: GeodesicMap) -> list[Floats]:
    """The paths with those of some rows led through a narrower space, where they can be."""
    return [
        space.path(task.starts[i], task.goals[i]) if i in rows and _holds(space, task, i) else path
        for i, path in enumerate(paths)
    ]


def other_paths(
    task: TeamTask, paths: Sequence[Floats], rows: Sequence[int], space: GeodesicMap
) -> Iterator[list[Floats]]:
    """The paths with one of some rows led on another way, those that add least first."""
    taut = TautPaths(space)
    others = [
        (_length(way) - _length(paths[i]), i, way)
        for i in rows
        if i in task.movers and _holds(space, task, i)
        for way in taut.paths(task.starts[i], task.goals[i], CLASSES, longest=LONGEST)[1:]
    ]
    for _, i, way in sorted(others, key=lambda other: other[:2]):
        yield [way if row == i else path for row, path in enumerate(paths)]


def path_over_outermost(task: TeamTask, row: int, waypoints: Floats) -> Floats:
    """The shortest path of one member over the one of some waypoints (n, 2), metres, that is the farthest out."""
    start, goal, geodesics = task.starts[row], task.goals[row], task.geodesics
    places = waypoints[task.free.contains(waypoints)]
    outermost = places[np.argmax(geodesics.lengths(start, places) + geodesics.lengths(goal, places))]
    return np.concatenate([geodesics.path(start, outermost), geodesics.path(outermost, goal)[1:]])


def _holds(space: GeodesicMap, task: TeamTask, row: int) -> bool:
    return bool(space.environment.contains([task.starts[row], task.goals[row]]).all())


def _nearest(path: Floats, place: Floats) -> float:
    return min(segment_distance(a, b, place, place) for a, b in pairwise(path))


def _length(path: Floats) -> float:
    return float(np.hypot(*np.diff(path, axis=0).T).sum())
