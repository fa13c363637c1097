"""The motion certificate: an independent judge of a schedule, at every instant and not at samples.

What a valid certificate says, from the schedule's start to its end and ever after (all stand then):

- *walls*: each member's disc stays in free space, a member without a body its centre;
- *collisions*: the discs of two members with bodies do not overlap; touching is no overlap;
- *speed*: no member goes faster than it can on the nominal clock;
- *connection*: the team is one network of lines of sight, by whatever links there are at the time — or, where asked
  for, a network holds some members, or every link of a list holds throughout.

Of a schedule in stages this is said *by progress*: wherever the members are while none begins stage n + 2 before all
have finished stage n, however late or slow they are, and wherever on their ways the unscheduled ones are. The clock is
asked only whether the nominal times keep that rule; then what happens on it is one of these cases. Links that join the
network have to hold for all places in two stages. Of a schedule without stages it is said of the one clock.

Sight is closed: a line that grazes a wall holds. Everything is judged in free space that reaches into the walls by
`depth_m`, twice the map's tolerance (some 10⁻⁷ m on a map of 100 m), which is as deep as the planners' sight lines may
dip, and discs may overlap by as much: so no rounding of theirs makes a refusal. What is nearer to the limit than an
eighth of that depth is refused by the clock. A piece of path may be longer than its member's speed allows by 10⁻⁹ of
itself and that depth.

Where a member goes into a wall nothing is said of what it sees there. Nothing is said either of members whose future is
not planned: leave an independent agent out, certify the chain to its last relay, and see `planning.reach_in_sight` for
how long that one keeps it in sight.

The code shares nothing with planners but the values in `planning.motion_plan`: bounds over intervals of time that are
halved (`planning.certificate_sight`), lines that part walls from hulls (`planning.certificate_hull`), and convex
distances (`planning.certificate_clearance`). Beyond the thesis, which
has no guarantee in motion (§4.3.5 and chapter 5).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.certificate_clearance import find_contacts, inside_rings
from planning.certificate_clock import check_clock, merge_intervals
from planning.certificate_progress import check_progress
from planning.certificate_sight import recede_walls
from planning.certificate_violation import Violation as Violation
from planning.motion_plan import InvalidSchedule, Schedule, TimedPath

if TYPE_CHECKING:
    from planning.environment import Environment

Floats = NDArray[np.float64]
Name = str | int
"""Of a member: what it is called, or its row."""

_FASTER: Final = 1e-9
"""Of the greatest speed: what rounding may add."""


@dataclass(frozen=True, slots=True)
class Certificate:
    """What is true of a schedule."""

    violations: tuple[Violation, ...]
    """In order of time."""

    @property
    def valid(self) -> bool:
        """Whether no rule is ever broken."""
        return not self.violations

    @property
    def holds_until_s(self) -> float:
        """Until when no rule is broken; inf if none ever is."""
        return min((violation.time_s for violation in self.violations), default=np.inf)


def certify(
    schedule: Schedule,
    environment: Environment,
    radius_m: ArrayLike | None = None,
    *,
    speed_m_s: ArrayLike | None = None,
    links: Collection[tuple[Name, Name]] | None = None,
    ends: Collection[Name] | None = None,
) -> Certificate:
    """Judge a schedule against a map, the robots' bodies and speeds, and the chain.

    A schedule with stages is judged by progress, else it is by the clock.

    Args:
        schedule: what the members are to do.
        environment: the map as drawn, not inflated.
        radius_m: of the discs, one or (k,), for a judge that does not rely on the schedule's own.
        speed_m_s: the greatest speeds, likewise.
        links: pairs of members, by name or row, that must see each other throughout; an empty list asks for no
            connection at all.
        ends: two members or more, by name or row, that must be in one network throughout, over any others.
            Without ``links`` and ``ends`` the whole team must be one network, unscheduled members too.

    Raises:
        InvalidSchedule: a link is not two members, or the ends are not at least as many, or radii or speeds do not fit.

    Complexity: by the clock O(k² (m + w) + k m w) for k members, m waypoints each and w walls where intervals of time
        need few halvings, which is bounded for each piece of motion. By progress O(k m w + n k² log k) for n stages
        and O(w + v m²) for each of O(n k) links, v of w walls near it; O(n k²) links where the network is parted.
    """
    if radius_m is not None or speed_m_s is not None:
        schedule = Schedule(
            schedule.members,
            schedule.paths,
            schedule.radii_m if radius_m is None else radius_m,
            schedule.speeds_m_s if speed_m_s is None else speed_m_s,
            schedule.stages,
            schedule.unscheduled,
        )
    required = None if links is None else sorted(set(_find_links(schedule, links)))
    joined = None if ends is None else _find_rows(schedule, ends)
    depth = 2.0 * environment.tolerance_m
    walls = recede_walls(environment.walls, environment.successors, depth)
    check_pairs = check_clock if schedule.stages is None else check_progress
    violations = [
        *_check_walls(schedule, walls, depth),
        *_check_speeds(schedule, depth),
        *check_pairs(schedule, walls, depth, required, joined),
    ]
    return Certificate(tuple(sorted(violations, key=lambda violation: violation.time_s)))


def _find_rows(schedule: Schedule, names: Collection[Name]) -> list[int]:
    """Rows of members that are to be joined, two or more, all different, in order."""
    rows: list[int] = []
    for name in names:
        row = schedule.members.index(name) if name in schedule.members else name
        if isinstance(row, str) or not 0 <= row < len(schedule):
            raise InvalidSchedule(f"{name!r} is no member of the schedule: it has {', '.join(schedule.members)}")
        if row in rows:
            raise InvalidSchedule(f"{name!r} is asked to be joined to itself: name different members")
        rows.append(int(row))
    if len(rows) < 2:
        raise InvalidSchedule(f"{len(rows)} members are asked to be joined: name at least two")
    return sorted(rows)


def _find_links(schedule: Schedule, links: Collection[tuple[Name, Name]]) -> Iterator[tuple[int, int]]:
    for link in links:
        if len(link) != 2:
            raise InvalidSchedule(f"a link of {len(link)} members: name two")
        i, j = _find_rows(schedule, link)
        yield i, j


def _join_in_solid(path: TimedPath, contacts: list[tuple[float, float]], walls: Floats) -> list[tuple[float, float]]:
    """Contacts between which the member is inside a wall as one: it went in and came out."""
    joined = contacts[:1]
    for start, end in contacts[1:]:
        between = path.positions([0.5 * (joined[-1][1] + start)])
        if inside_rings(between, walls)[0]:
            joined.append((start, end))
        else:
            joined[-1] = (joined[-1][0], end)
    return joined


def _check_walls(schedule: Schedule, walls: Floats, depth: float) -> list[Violation]:
    found = []
    starts = np.array([path.waypoints[0] for path in schedule.paths])
    for member, path, radius, inside in zip(
        schedule.members, schedule.paths, schedule.radii_m, inside_rings(starts, walls), strict=True
    ):
        if not inside:
            x, y = path.waypoints[0]
            text = f"{member} starts outside of free space, at ({x:.6g}, {y:.6g})"
            found.append(Violation(schedule.start_s, np.inf, "wall", (member,), text))
            continue
        # A centre alone keeps clear of receded walls by what is left of the depth at the sharpest corners.
        contacts = find_contacts(path.times_s, path.waypoints, walls, max(float(radius), 0.0625 * depth))
        for start, end in _join_in_solid(path, merge_intervals(contacts), walls):
            x, y = contacts[contacts[:, 0] == start][0, 2:]
            # A member stands at its first place before that time, and at its last for good.
            begin = schedule.start_s if start == path.times_s[0] else start
            what = f"is nearer than {radius:g} m to" if radius > 0.0 else "goes into"
            text = f"{member} {what} a wall from {begin:.6g} s on, at ({x:.6g}, {y:.6g})"
            found.append(Violation(begin, end if end < path.times_s[-1] else np.inf, "wall", (member,), text))
    return found


def _check_speeds(schedule: Schedule, depth: float) -> list[Violation]:
    found = []
    for member, path, limit in zip(schedule.members, schedule.paths, schedule.speeds_m_s, strict=True):
        lengths = np.hypot(*np.diff(path.waypoints, axis=0).T)
        seconds = np.diff(path.times_s)
        for i in np.flatnonzero(lengths > limit * seconds * (1.0 + _FASTER) + depth):
            start, end = float(path.times_s[i]), float(path.times_s[i + 1])
            text = f"{member} would go {lengths[i] / seconds[i]:.6g} m/s from {start:.6g} s on; it can go {limit:g} m/s"
            found.append(Violation(start, end, "speed", (member,), text))
    return found
