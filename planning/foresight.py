"""Looking ahead: where one is on a way, and at which times a team in motion is joined by lines of sight."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.environment import Environment
from planning.kernel import kernel
from planning.line_of_sight import free_points_see

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


def length(way: ArrayLike) -> float:
    """Length of a polyline (m, 2), metres."""
    points = np.asarray(way, dtype=np.float64).reshape(-1, 2)
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def walk(way: ArrayLike, lengths_m: Floats) -> Floats:
    """Where one is on a polyline (m, 2) after each of these lengths (t,), at its end when it is over: (t, 2) float."""
    points = np.asarray(way, dtype=np.float64).reshape(-1, 2)
    passed = _passed(points)
    return np.column_stack((np.interp(lengths_m, passed, points[:, 0]), np.interp(lengths_m, passed, points[:, 1])))


def head(way: ArrayLike, length_m: float) -> Floats:
    """The first metres of a polyline (m, 2), or all of it: (n, 2) float."""
    points = np.asarray(way, dtype=np.float64).reshape(-1, 2)
    return np.concatenate((points[_passed(points) < length_m], walk(points, np.array([length_m]))))


def tail(way: ArrayLike, length_m: float) -> Floats:
    """What is left of a polyline (m, 2) after its first metres, at least its end: (n, 2) float."""
    points = np.asarray(way, dtype=np.float64).reshape(-1, 2)
    return np.concatenate((walk(points, np.array([length_m])), points[_passed(points) > length_m]))


def distance(way: ArrayLike, places: ArrayLike) -> float:
    """How near the nearest of some places (n, 2) is to a polyline (m, 2), metres; inf where there is none. O(m n)."""
    points = np.asarray(way, dtype=np.float64).reshape(-1, 2)
    others = np.asarray(places, dtype=np.float64).reshape(-1, 1, 2)
    starts = points[: max(len(points) - 1, 1)]
    steps = points[1:] - starts if len(points) > 1 else np.zeros((1, 2))
    squares = np.maximum((steps**2).sum(axis=1), np.finfo(float).tiny)
    shares = np.clip(((others - starts) * steps).sum(axis=2) / squares, 0.0, 1.0)
    gaps = others - starts - shares[..., None] * steps
    return float(np.hypot(gaps[..., 0], gaps[..., 1]).min(initial=np.inf))


def _passed(points: Floats) -> Floats:
    """How far each point of a polyline (m, 2) is from its beginning: (m,) float, metres."""
    return np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))


def chain_holds(environment: Environment, tracks: Floats) -> Bools:
    """At which times the first and the last of a team are joined by lines of sight, directly or over others.

    Args:
        environment: the map as drawn.
        tracks: (t, n, 2) float, metres, map frame: where the n members are at each time, all in free space.

    Returns:
        (t,) bool.

    Complexity: O(t n² w); lines that cannot change the answer are not looked at.
    """
    holds: Bools = _chain_holds(np.ascontiguousarray(tracks), environment.walls, environment.tolerance_m)
    return holds


@kernel
def _chain_holds(tracks: Floats, walls: Floats, tolerance: float) -> Bools:
    times, members, _ = tracks.shape
    holds = np.zeros(times, dtype=np.bool_)
    waiting = np.empty(members, dtype=np.int64)
    for t in range(times):
        # Search from the last member on: the agent is seldom far from a robot, and most are seen at once.
        reached = np.zeros(members, dtype=np.bool_)
        reached[members - 1] = True
        waiting[0] = members - 1
        size = 1
        while size > 0 and not reached[0]:
            size -= 1
            here = waiting[size]
            for there in range(members):
                if not reached[there] and free_points_see(
                    tracks[t, here, 0], tracks[t, here, 1], tracks[t, there, 0], tracks[t, there, 1], walls, tolerance
                ):
                    reached[there] = True
                    if there == 0:
                        break
                    waiting[size] = there
                    size += 1
        holds[t] = reached[0]
    return holds
