"""Going somewhere along a geodesic: straight at the next corner, arriving on it exactly, then at the one after."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from protocol.messages import Point

ARRIVED_M = 1e-3
"""Nearer than this, a corner counts as passed and a target as reached."""

PASSED_M = 1e-7
"""Nearer than this a waypoint of a motion is reached: as exact as certificates are."""

ASTRAY_M = 0.01
"""Farther than this from its way in a motion a robot stands: nothing is certified of where it is."""


class Routes(Protocol):
    """Shortest paths in free space: what is used of :class:`planning.geodesic.GeodesicMap`."""

    def path(self, p: Point, q: Point) -> NDArray[np.float64]:
        """Corners from ``p`` to ``q``, (m, 2), metres. Raises ValueError where one of them is not in free space."""


class Unreachable(ValueError):
    """There is no way from here to the target; the text says why."""


@dataclass(frozen=True, slots=True)
class Leg:
    """The straight piece ahead."""

    velocity: Point
    lasts_s: float
    """Until its end is reached; 0 for a body that stands."""


STANDING = Leg((0.0, 0.0), 0.0)


def distance_off(a: Point, b: Point, position: Point) -> float:
    """Of a place from the straight from ``a`` to ``b``, metres."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    along = (position[0] - a[0]) * dx + (position[1] - a[1]) * dy
    share = min(1.0, max(0.0, along / ((dx * dx + dy * dy) or 1.0)))
    return math.dist(position, (a[0] + share * dx, a[1] + share * dy))


class PathFollower:
    """Follows one path at a time, at full speed, without cutting a corner and without overshooting."""

    def __init__(self, routes: Routes, speed_m_s: float) -> None:
        self._routes = routes
        self._speed_m_s = speed_m_s
        self._ahead: list[Point] = []
        self.target: Point | None = None
        """Where it goes or stands; None before the first target and after :meth:`stop`."""

    @property
    def arrived(self) -> bool:
        """Whether the target has been reached."""
        return self.target is not None and not self._ahead

    def go(self, position: Point, target: Point) -> None:
        """Plan the way from here to a new target. On failure the follower stops.

        Raises:
            Unreachable: the position or the target is not in free space.
        """
        self.stop()
        try:
            path = self._routes.path(position, target)
        except ValueError as problem:
            raise Unreachable(str(problem)) from problem
        self.target = target
        self._ahead = [(float(x), float(y)) for x, y in path[1:]]
        self._pass(position)

    def stop(self) -> None:
        """Forget the target."""
        self.target = None
        self._ahead = []

    def steer(self, position: Point) -> Leg:
        """The leg to drive from here. O(1) amortised."""
        self._pass(position)
        if not self._ahead:
            return STANDING
        dx, dy = self._ahead[0][0] - position[0], self._ahead[0][1] - position[1]
        distance_m = math.hypot(dx, dy)
        scale = self._speed_m_s / distance_m
        return Leg((dx * scale, dy * scale), distance_m / self._speed_m_s)

    def remaining(self, position: Point) -> tuple[Point, ...]:
        """What is left of the path, from ``position`` on; empty for a body that stands."""
        return (position, *self._ahead) if self._ahead else ()

    def _pass(self, position: Point) -> None:
        while self._ahead and math.dist(position, self._ahead[0]) < ARRIVED_M:
            del self._ahead[0]
