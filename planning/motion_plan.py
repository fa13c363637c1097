"""What a team is to do: for each member a path that is piecewise linear in time, and who waits for whom.

A path has nominal times: what happens if all drive at full speed and nobody is late. Robots are late, so a schedule is
cut into *stages*, and robots advance by their own progress, under one rule:

    nobody begins stage n + 2 before all have finished stage n.

So at every instant all are within two stages that follow each other, whatever their speeds. Where that is not strict
enough a planner puts a stage in which nobody moves between two others. A certificate by progress shows that all is well
wherever in two such stages each member may be; then no clock is needed.

These are values only. What makes them, and what judges them, are other modules: the certificate shares no code with the
planners but this.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


class InvalidSchedule(ValueError):
    """Paths, times or limits that are no schedule; the text is one sentence that names the member and the place."""


def read_points(given: ArrayLike) -> Floats:
    """Points (m, 2) float, metres, of an array of pairs; a single pair is one point.

    Raises:
        InvalidSchedule: they are no pairs of numbers.
    """
    try:
        points = np.array(given, dtype=np.float64, order="C")
    except (TypeError, ValueError) as problem:
        raise InvalidSchedule(f"points are no numbers ({problem}): give pairs x, y in metres") from None
    if points.size == 0:
        return np.zeros((0, 2))
    if points.ndim not in (1, 2) or points.shape[-1] != 2:
        raise InvalidSchedule(f"points of shape {points.shape}: give pairs x, y in metres")
    return points.reshape(-1, 2)


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
        points = read_points(waypoints)
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
        stages: (k, n + 1) int: the waypoint of each member at which each of n ≥ 1 stages begins, and the last one ends;
            from 0 to the last waypoint, never falling. A stage that begins and ends with one waypoint is a stop. None:
            a schedule that is bound to the clock.
        unscheduled: members that go along their paths as they please: they wait for nobody and nobody for them.

    Raises:
        InvalidSchedule: these do not fit, or a radius or speed is negative or not a number.
    """

    members: tuple[str, ...]
    paths: tuple[TimedPath, ...]
    radii_m: Floats
    """(k,) float."""
    speeds_m_s: Floats
    """(k,) float; inf for no limit."""
    stages: NDArray[np.int64] | None
    """(k, n + 1) int."""
    unscheduled: frozenset[str]

    def __init__(
        self,
        members: Sequence[str],
        paths: Sequence[TimedPath],
        radii_m: ArrayLike,
        speeds_m_s: ArrayLike = np.inf,
        stages: ArrayLike | None = None,
        unscheduled: Collection[str] = (),
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
        object.__setattr__(self, "stages", None if stages is None else self._read_stages(stages))
        object.__setattr__(self, "unscheduled", frozenset(unscheduled))
        for name in self.unscheduled - set(self.members):
            raise InvalidSchedule(f"'{name}' is unscheduled, but no member of the schedule: give it a path")

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

    def _read_stages(self, given: ArrayLike) -> NDArray[np.int64]:
        stages = np.array(given, dtype=np.int64)
        if stages.ndim != 2 or len(stages) != len(self.members) or stages.shape[1] < 2:
            raise InvalidSchedule(
                f"stages of shape {stages.shape} for {len(self.members)} members: give each where every stage begins "
                "and the last one ends"
            )
        for member, path, row in zip(self.members, self.paths, stages, strict=True):
            if row[0] != 0 or row[-1] != len(path.waypoints) - 1 or np.any(np.diff(row) < 0):
                raise InvalidSchedule(
                    f"the stages of {member} are {row.tolist()}: give waypoints from 0 to {len(path.waypoints) - 1} "
                    "that never fall"
                )
        stages.flags.writeable = False
        return stages

    def __len__(self) -> int:
        return len(self.members)

    @property
    def stage_count(self) -> int:
        """Number of stages; 0 for a schedule that is bound to the clock."""
        return 0 if self.stages is None else self.stages.shape[1] - 1

    def piece(self, member: int, first: int, last: int) -> Floats:
        """The waypoints (m, 2), metres, of a member from the beginning of one stage to the end of another, m ≥ 1.

        Of an unscheduled member they are all of its waypoints.
        """
        if self.stages is None:
            raise InvalidSchedule("a schedule that is bound to the clock has no stages")
        waypoints = self.paths[member].waypoints
        if self.members[member] in self.unscheduled:
            return waypoints
        return waypoints[self.stages[member, first] : self.stages[member, last + 1] + 1]

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
