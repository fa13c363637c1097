"""What a planner of schedules is asked for: paths, bodies, speeds and connection, read and checked."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.environment import Environment
from planning.motion_plan import InvalidSchedule, read_points
from planning.step_rules import Demand

Floats = NDArray[np.float64]

Member = str | int
"""A name, or a row."""

MOST_MEMBERS: Final = 62
"""Sets of members are bits of a 64-bit number."""


@dataclass(frozen=True, slots=True, eq=False)
class ScheduleRequest:
    """k members and what is asked of them.

    Attributes:
        members: k different names.
        paths: each (m, 2) float, metres, map frame, m ≥ 1.
        radii_m: (k,) float.
        speeds_m_s: (k,) float, positive and finite.
        env: the map as drawn, or None.
        links: pairs of rows that must see each other, or None where nothing is said of links.
        joined: rows that must be in one network, or None likewise.
        anywhere: rows of the members that go as they please.
    """

    members: list[str]
    paths: list[Floats]
    radii_m: Floats
    speeds_m_s: Floats
    env: Environment | None
    links: list[tuple[int, int]] | None
    joined: list[int] | None
    anywhere: list[int]

    @property
    def demand(self) -> Demand:
        """Whom to connect: with a map, and unless links or members to be joined are named, the whole team."""
        k = len(self.members)
        joined = self.joined
        if joined is None:
            joined = list(range(k)) if self.env is not None and self.links is None else []
        required = np.zeros(k, dtype=np.int64)
        for i, j in self.links or ():
            required[i] |= 1 << j
            required[j] |= 1 << i
        return Demand(sum(1 << i for i in joined), required)


def read_request(
    paths: Sequence[ArrayLike],
    radius_m: ArrayLike,
    env: Environment | None,
    links: Sequence[tuple[Member, Member]] | None,
    joined: Collection[Member] | None,
    members: Sequence[str] | None,
    speed_m_s: ArrayLike,
    unscheduled: Collection[Member],
) -> ScheduleRequest:
    """Read the arguments of `planning.schedule.schedule`.

    Raises:
        InvalidSchedule: they make no sense; one sentence that says which, and what to do.
    """
    names = [str(i) for i in range(len(paths))] if members is None else [str(name) for name in members]
    if not 0 < len(paths) <= MOST_MEMBERS or len(names) != len(paths) or len(set(names)) < len(names):
        raise InvalidSchedule(
            f"a schedule of {len(paths)} paths for {len(set(names))} different members: give each one path, and not "
            f"more than {MOST_MEMBERS}"
        )
    if env is None and (links or joined):
        raise InvalidSchedule("members are asked to see each other, but on no map: give an environment")

    def find(member: Member) -> int:
        if isinstance(member, str) and member in names:
            return names.index(member)
        if not isinstance(member, str) and 0 <= member < len(names):
            return int(member)
        raise InvalidSchedule(f"{member!r} is no member of the schedule: it has {', '.join(names)}")

    pairs = None if links is None else [(find(one), find(other)) for one, other in links]
    for i, j in pairs or ():
        if i == j:
            raise InvalidSchedule(f"{names[i]} is asked to see itself: name two different members")
    return ScheduleRequest(
        names,
        [_read_path(path, name) for path, name in zip(paths, names, strict=True)],
        _spread(radius_m, "radius", names, 0.0),
        _spread(speed_m_s, "greatest speed", names, float(np.finfo(np.float64).tiny)),
        env,
        pairs,
        None if joined is None else sorted({find(member) for member in joined}),
        sorted({find(member) for member in unscheduled}),
    )


def _read_path(path: ArrayLike, name: str) -> Floats:
    points = read_points(path)
    if len(points) == 0:
        raise InvalidSchedule(f"the path of {name} has no points: give at least the place where it stands")
    if not np.isfinite(points).all():
        raise InvalidSchedule(f"the path of {name} has a point that is not finite: give metres")
    return points


def _spread(given: ArrayLike, quantity: str, names: Sequence[str], least: float) -> Floats:
    values = np.array(given, dtype=np.float64)
    if values.shape not in {(), (len(names),)}:
        raise InvalidSchedule(f"{len(names)} members have {values.size} values of {quantity}: give one, or one each")
    values = np.array(np.broadcast_to(values, len(names)))
    for name, value in zip(names, values, strict=True):
        if not least <= value < np.inf:
            raise InvalidSchedule(
                f"the {quantity} of {name} is {value:g}: give a finite number, "
                + ("at least 0" if least == 0.0 else "greater than 0")
            )
    return values
