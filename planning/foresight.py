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
    passed = np.zeros(len(points))
    np.cumsum(np.hypot(*np.diff(points, axis=0).T), out=passed[1:])
    return np.column_stack((np.interp(lengths_m, passed, points[:, 0]), np.interp(lengths_m, passed, points[:, 1])))


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
