"""What a team is to do: for each member a path that is piecewise linear in time.

These are values only. What makes them, and what judges them, are other modules: the certificate shares no code with the
planners but this.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


class InvalidSchedule(ValueError):
    """Paths, times or limits that are no schedule; the text is one sentence that names the member and the place."""


@dataclass(frozen=True, init=False, eq=False)
class TimedPath:
    """Straight and evenly from each waypoint to the next; still before the first and after the last.

    Args:
        waypoints: (m, 2) float, metres, map frame, m ≥ 1. A waypoint repeated at a later time is a stop.
        times_s: (m,) float, seconds since the schedule's epoch, strictly rising.

    Raises:
        InvalidSchedule: the arrays do not fit, or hold what is not finite, or time does not rise.
    """

    waypoints: Floats
    times_s: Floats

    def __init__(self, waypoints: ArrayLike, times_s: ArrayLike) -> None:
        points = np.array(waypoints, dtype=np.float64, order="C").reshape(-1, 2)
        times = np.array(times_s, dtype=np.float64).reshape(-1)
        if len(points) != len(times) or len(points) == 0:
            raise InvalidSchedule(
                f"a path has {len(points)} waypoints and {len(times)} times: give as many, at least one"
            )
        if not (np.isfinite(points).all() and np.isfinite(times).all()):
            raise InvalidSchedule("a path has a waypoint or time that is not finite: give metres and seconds")
        if np.any(np.diff(times) <= 0.0):
            late = int(np.argmax(np.diff(times) <= 0.0))
            raise InvalidSchedule(
                f"time does not rise from waypoint {late} ({times[late]:g} s) to waypoint {late + 1} "
                f"({times[late + 1]:g} s): give every waypoint a later time"
            )
        for array in (points, times):
            array.flags.writeable = False
        object.__setattr__(self, "waypoints", points)
        object.__setattr__(self, "times_s", times)

    @classmethod
    def standing(cls, place: ArrayLike, since_s: float = 0.0) -> TimedPath:
        """Of a member that stays at a place (2,), metres."""
        return cls(np.reshape(place, (1, 2)), [since_s])

    def positions(self, times_s: ArrayLike) -> Floats:
        """Where the member is at each of ``times_s`` (n,), seconds: (n, 2) float, metres. O(n log m)."""
        times = np.asarray(times_s, dtype=np.float64)
        return np.stack([np.interp(times, self.times_s, self.waypoints[:, axis]) for axis in (0, 1)], axis=-1)

    @property
    def length_m(self) -> float:
        """Length of the way."""
        return float(np.hypot(*np.diff(self.waypoints, axis=0).T).sum())


@dataclass(frozen=True, init=False, eq=False)
class Schedule:
    """The paths of k members on one clock.

    Args:
        members: k different names.
        paths: k paths.
        radii_m: of each member's disc, or one for all, metres. A member of radius 0 has no body: it needs free space
            for its centre only, and is in nobody's way.
        speeds_m_s: the most that each member can drive, or one for all.

    Raises:
        InvalidSchedule: these do not fit, or a radius or speed is negative or not a number.
    """

    members: tuple[str, ...]
    paths: tuple[TimedPath, ...]
    radii_m: Floats
    """(k,) float."""
    speeds_m_s: Floats
    """(k,) float; inf for no limit."""

    def __init__(
        self, members: Sequence[str], paths: Sequence[TimedPath], radii_m: ArrayLike, speeds_m_s: ArrayLike = np.inf
    ) -> None:
        if len(paths) != len(members) or not members or len(set(members)) < len(members):
            raise InvalidSchedule(
                f"a schedule has {len(paths)} paths of {len(set(members))} different members: give each one path"
            )
        object.__setattr__(self, "members", tuple(members))
        object.__setattr__(self, "paths", tuple(paths))
        object.__setattr__(self, "radii_m", self._spread(radii_m, "radius"))
        object.__setattr__(self, "speeds_m_s", self._spread(speeds_m_s, "greatest speed"))
        if np.isinf(self.radii_m).any():
            raise InvalidSchedule(f"{self.members[int(np.argmax(self.radii_m))]} has no finite radius: give metres")

    def _spread(self, given: ArrayLike, name: str) -> Floats:
        values = np.array(given, dtype=np.float64)
        if values.shape not in {(), (len(self.members),)}:
            raise InvalidSchedule(f"a schedule of {len(self.members)} members has {values.size} values of {name}")
        values = np.array(np.broadcast_to(values, len(self.members)))
        for member, value in zip(self.members, values, strict=True):
            if not value >= 0.0:
                raise InvalidSchedule(f"the {name} of {member} is {value}: give a number of at least 0")
        values.flags.writeable = False
        return values

    def __len__(self) -> int:
        return len(self.members)

    @property
    def start_s(self) -> float:
        """When the first path begins."""
        return float(min(path.times_s[0] for path in self.paths))

    @property
    def end_s(self) -> float:
        """When the last path ends; from then on all stand still."""
        return float(max(path.times_s[-1] for path in self.paths))

    def positions(self, times_s: ArrayLike) -> Floats:
        """Where the members are at each of ``times_s`` (n,), seconds: (n, k, 2) float, metres."""
        return np.stack([path.positions(times_s) for path in self.paths], axis=1)
