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
eighth of that depth is refused. Speeds may be too high by 10⁻⁹ of them.

It says nothing of members whose future is not planned: leave an independent agent out, and certify the chain to its
last relay. Members advance by this one clock; who waits for whom when one is late is not part of a schedule.

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
from planning.certificate_sight import recede_walls, watch
from planning.kernel import kernel
from planning.motion_plan import InvalidSchedule, Schedule, TimedPath

if TYPE_CHECKING:
    from planning.environment import Environment

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
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
        InvalidSchedule: a link or end is no member, or radii or speeds do not fit.

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
        for start, end in _find_gaps(schedule, sight[i, j]):
            one, other = schedule.members[i], schedule.members[j]
            text = f"{one} and {other} do not see each other from {start:.6g} s on"
            found.append(Violation(start, _until(schedule, end), "connection", (one, other), text))
    if network:
        found += _find_breaks(schedule, sight, ends)
    return found


def _find_gaps(schedule: Schedule, intervals: Floats) -> list[tuple[float, float]]:
    """The times of a schedule outside of closed intervals (n, 2), which are in order."""
    edges = np.concatenate([[schedule.start_s], intervals.ravel(), [schedule.end_s]]).reshape(-1, 2)
    gaps = [(float(start), float(end)) for start, end in edges if start < end]
    return gaps if gaps or len(intervals) else [(schedule.start_s, schedule.end_s)]


def _find_breaks(
    schedule: Schedule, sight: dict[tuple[int, int], Floats], ends: tuple[int, int] | None
) -> list[Violation]:
    """Where the network of sight does not join the ends, or the team if there are none.

    Between two neighbouring beginnings and ends of sight the links stay the same; at such an instant itself, for sight
    is closed, there are those of both neighbours. So it is enough to look between.
    """
    edges = [schedule.start_s, schedule.end_s]
    times = np.unique(np.concatenate([edges, *(intervals.ravel() for intervals in sight.values())]))
    if len(times) == 1:
        times = np.repeat(times, 2)
    pairs = np.array(list(sight), dtype=np.int64).reshape(-1, 2)
    held = np.zeros((len(pairs), len(times) - 1), dtype=np.bool_)
    for row, intervals in zip(held, sight.values(), strict=True):
        for start, end in np.searchsorted(times, intervals):
            row[start:end] = True
        if schedule.start_s == schedule.end_s:
            row[:] = len(intervals) > 0
    labels = _label_parts(held, pairs, len(schedule))
    joined = np.all(labels == 0, axis=1) if ends is None else labels[:, ends[0]] == labels[:, ends[1]]
    found = []
    for first in np.flatnonzero(~joined & np.append(True, joined[:-1])):
        last = first + int(np.argmax(np.append(joined[first:], True)))
        lost = [
            (int(i), int(j))
            for (i, j), row in zip(pairs, held, strict=True)
            if first > 0 and row[first - 1] and labels[first, i] != labels[first, j]
        ]
        i, j = ends or (lost[0] if lost else (0, int(np.argmax(labels[first] > 0))))
        found.append(_describe_break(schedule, labels[first], (i, j), lost, float(times[first]), float(times[last])))
    return found


def _describe_break(
    schedule: Schedule, labels: Ints, pair: tuple[int, int], lost: list[tuple[int, int]], start: float, end: float
) -> Violation:
    parts = [
        " + ".join(name for name, label in zip(schedule.members, labels, strict=True) if label == part)
        for part in range(labels.max() + 1)
    ]
    names = [" and ".join((schedule.members[i], schedule.members[j])) for i, j in lost]
    why = f"as {', '.join(names)} lose sight of each other, " if names else ""
    text = f"{why}the team is parted from {start:.6g} s on: {' | '.join(parts)}"
    members = (schedule.members[pair[0]], schedule.members[pair[1]])
    return Violation(start, _until(schedule, end), "connection", members, text)


@kernel
def _label_parts(held: Bools, pairs: Ints, members: int) -> Ints:
    """The part of the network that each member is in, numbered by its lowest member: (pieces, members).

    ``held`` (n, pieces) bool: which of the n ``pairs`` see each other in each piece of time.
    """
    pieces = held.shape[1]
    labels = np.empty((pieces, members), np.int64)
    for t in range(pieces):
        root = np.arange(members)
        for k in range(pairs.shape[0]):
            if held[k, t]:
                low, high = root[pairs[k, 0]], root[pairs[k, 1]]
                if low != high:
                    low, high = min(low, high), max(low, high)
                    for i in range(members):
                        if root[i] == high:
                            root[i] = low
        parts = 0
        for i in range(members):
            if root[i] == i:
                labels[t, i] = parts
                parts += 1
            else:
                labels[t, i] = labels[t, root[i]]
    return labels
