"""The motion certificate: an independent judge of a schedule, at every instant and not at samples.

What a valid certificate says, of all times from the schedule's start to its end and ever after (all stand then):

- *walls*: each member's disc stays in free space, a member without a body its centre;
- *collisions*: the discs of two members with bodies do not overlap; touching is no overlap;
- *speed*: no member goes faster than it can;
- *connection*: the team is one network of lines of sight, by whatever links there are at the time — or, where asked
  for, a chain of such links joins two ends, or every link of a list holds throughout.

Sight is closed: a line that grazes a wall holds. Everything is judged in free space that reaches into the walls by
`depth_m`, twice the map's tolerance (some 10⁻⁷ m on a map of 100 m), which is as deep as the planners' sight lines may
dip, and discs may overlap by as much: so no rounding of theirs makes a refusal. What is nearer to the limit than an
eighth of that depth is refused. A piece of path may be longer than its member's speed allows by 10⁻⁹ of itself and
that depth.

Where a member goes into a wall nothing is said of what it sees there. Nothing is said either of members whose future is
not planned: leave an independent agent out, and certify the chain to its last relay. Members advance by this one clock;
who waits for whom when one is late is not part of a schedule.

The code shares nothing with planners but the values in `planning.motion_plan`: bounds over intervals of time that are
halved (`planning.certificate_sight`) and convex distances (`planning.certificate_clearance`). Beyond the thesis, which
has no guarantee in motion (§4.3.5 and chapter 5).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.certificate_clearance import find_collisions, find_contacts, inside_rings
from planning.certificate_motion import join_motions
from planning.certificate_network import Break, find_breaks, find_gaps
from planning.certificate_sight import recede_walls, watch
from planning.motion_plan import InvalidSchedule, Schedule, TimedPath

if TYPE_CHECKING:
    from planning.environment import Environment

Floats = NDArray[np.float64]
Motions = dict[tuple[int, int], tuple[Floats, Floats, Floats]]
Kind = Literal["wall", "collision", "speed", "connection"]

_FASTER: Final = 1e-9
"""Of the greatest speed: what rounding may add."""


@dataclass(frozen=True, slots=True)
class Violation:
    """One rule broken for one stretch of time."""

    time_s: float
    """When it begins."""
    until_s: float
    """When it ends; inf if it lasts."""
    kind: Kind
    members: tuple[str, ...]
    """Whom it concerns: one at walls and for speed, else two; of a parted team two on either side of the break."""
    text: str
    """One sentence."""


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
    links: Sequence[tuple[str, str]] | None = None,
    ends: tuple[str, str] | None = None,
) -> Certificate:
    """Judge a schedule against a map, the robots' bodies and speeds, and the chain.

    Args:
        schedule: what the members are to do.
        environment: the map as drawn, not inflated.
        radius_m: of the discs, one or (k,), for a judge that does not rely on the schedule's own.
        speed_m_s: the greatest speeds, likewise.
        links: pairs of members that must see each other throughout; an empty list asks for no connection at all.
        ends: two members that a chain must join throughout, over any others.
            Without ``links`` and ``ends`` the whole team must be one network.

    Raises:
        InvalidSchedule: a link or the ends are not two members, or radii or speeds do not fit.

    Complexity: O(k² (m + w) + k m w) for k members, m waypoints each and w walls where intervals of time need few
        halvings, which is bounded for each piece of motion.
    """
    if radius_m is not None or speed_m_s is not None:
        schedule = Schedule(
            schedule.members,
            schedule.paths,
            schedule.radii_m if radius_m is None else radius_m,
            schedule.speeds_m_s if speed_m_s is None else speed_m_s,
        )
    required = None if links is None else {_find_pair(schedule, link) for link in links}
    joined = None if ends is None else _find_pair(schedule, ends)
    depth = 2.0 * environment.tolerance_m
    walls = recede_walls(environment.walls, environment.successors, depth)
    motions = _join_paths(schedule)
    violations = [
        *_check_walls(schedule, walls, depth),
        *_check_speeds(schedule, depth),
        *_check_collisions(schedule, motions, depth),
        *_check_connection(schedule, motions, walls, depth, required, joined),
    ]
    return Certificate(tuple(sorted(violations, key=lambda violation: violation.time_s)))


def _find_pair(schedule: Schedule, names: tuple[str, str]) -> tuple[int, int]:
    for name in names:
        if name not in schedule.members:
            raise InvalidSchedule(f"'{name}' is no member of the schedule: it has {', '.join(schedule.members)}")
    i, j = sorted(schedule.members.index(name) for name in names)
    if i == j:
        raise InvalidSchedule(f"'{names[0]}' is asked to be joined to itself: name two different members")
    return i, j


def _merge_intervals(intervals: Floats) -> list[tuple[float, float]]:
    """Intervals (n, 2 or more) in any order, joined where they touch or overlap."""
    merged: list[tuple[float, float]] = []
    for start, end in sorted((float(row[0]), float(row[1])) for row in intervals):
        if merged and start <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        else:
            merged.append((start, end))
    return merged


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
        for start, end in _join_in_solid(path, _merge_intervals(contacts), walls):
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


def _join_paths(schedule: Schedule) -> Motions:
    """For each pair of members: times between which both move evenly, and their places then."""
    start, end = schedule.start_s, schedule.end_s
    return {
        (i, j): join_motions(p.times_s, p.waypoints, q.times_s, q.waypoints, start, end)
        for (i, p), (j, q) in combinations(enumerate(schedule.paths), 2)
    }


def _until(schedule: Schedule, end_s: float) -> float:
    """What is so when all have come to stand stays so."""
    return end_s if end_s < schedule.end_s else np.inf


def _check_collisions(schedule: Schedule, motions: Motions, depth: float) -> list[Violation]:
    found = []
    for (i, j), motion in motions.items():
        if min(schedule.radii_m[i], schedule.radii_m[j]) == 0.0:
            continue
        separation = float(schedule.radii_m[i] + schedule.radii_m[j])
        overlaps = find_collisions(*motion, separation - depth)
        for start, end in _merge_intervals(overlaps):
            one, other = schedule.members[i], schedule.members[j]
            text = f"{one} and {other} are nearer than {separation:g} m to each other from {start:.6g} s on"
            found.append(Violation(start, _until(schedule, end), "collision", (one, other), text))
    return found


def _check_connection(
    schedule: Schedule,
    motions: Motions,
    walls: Floats,
    depth: float,
    required: set[tuple[int, int]] | None,
    ends: tuple[int, int] | None,
) -> list[Violation]:
    found = []
    network = required is None or ends is not None
    sight = {
        pair: watch(*motion, walls, depth) for pair, motion in motions.items() if network or pair in (required or ())
    }
    for i, j in sorted(required or ()):
        for start, end in find_gaps(sight[i, j], schedule.start_s, schedule.end_s):
            one, other = schedule.members[i], schedule.members[j]
            text = f"{one} and {other} do not see each other from {start:.6g} s on"
            found.append(Violation(start, _until(schedule, end), "connection", (one, other), text))
    if network:
        found += [
            Violation(gap.start_s, _until(schedule, gap.end_s), "connection", *_name_parts(schedule, gap))
            for gap in find_breaks(sight, len(schedule), schedule.start_s, schedule.end_s, ends)
        ]
    return found


def _name_parts(schedule: Schedule, gap: Break) -> tuple[tuple[str, str], str]:
    """Two members that part, and the sentence about it."""
    names = schedule.members
    parts = [
        " + ".join(name for name, label in zip(names, gap.parts, strict=True) if label == part)
        for part in range(max(gap.parts) + 1)
    ]
    lost = ", ".join(f"{names[i]} and {names[j]}" for i, j in gap.lost)
    why = f"as {lost} lose sight of each other, " if lost else ""
    i, j = gap.between
    return (names[i], names[j]), f"{why}the team is parted from {gap.start_s:.6g} s on: {' | '.join(parts)}"
