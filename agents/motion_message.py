"""Schedules as they cross the wire, and back.

A message holds no times: these follow from stages and speeds, and robots keep to their order and not to a clock. It
holds no stops either, as a stop is what waiting makes of a path.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from planning.continuation import assemble
from planning.motion_plan import InvalidSchedule, Schedule, TimedPath
from protocol.messages import Connection, MemberWay, Motion, Point

FASTEST_M_S = 1e7
"""What stands for no limit on the wire."""

SLOWEST_M_S = 1e-6
"""Of a member that moves: times stay finite."""


class InvalidMotion(ValueError):
    """A message that is no schedule; the text is one sentence that names the member and the place."""


def to_motion(
    schedule: Schedule,
    *,
    plan: int,
    revision: int,
    first_stage: int,
    released: int,
    connection: Connection,
    joined: Sequence[str] = (),
) -> Motion:
    """A schedule in stages as a message; ``first_stage`` is the number that its first stage has in the plan.

    Raises:
        InvalidSchedule: the schedule is bound to the clock.
    """
    ways = []
    for member, name in enumerate(schedule.members):
        pieces = [
            [(float(x), float(y)) for x, y in schedule.piece(member, stage, stage)]
            for stage in range(schedule.stage_count)
        ]
        scheduled = name not in schedule.unscheduled
        if not scheduled:  # then each piece is the whole way
            pieces[1:] = [pieces[0][-1:]] * (schedule.stage_count - 1)
        waypoints, marks = pieces[0][:1], [0]
        for piece in pieces:
            waypoints += [place for before, place in pairwise(piece) if place != before]
            marks.append(len(waypoints) - 1)
        ways.append(
            MemberWay(
                member=name,
                radius_m=float(schedule.radii_m[member]),
                speed_m_s=min(float(schedule.speeds_m_s[member]), FASTEST_M_S),
                waypoints=tuple(waypoints),
                stages=tuple(marks),
                scheduled=scheduled,
            )
        )
    return Motion(
        plan=plan, revision=revision, first_stage=first_stage, released=released, ways=tuple(ways),
        connection=connection, joined=tuple(joined),
    )  # fmt: skip


def to_schedule(motion: Motion) -> Schedule:
    """The schedule of a message, at the times of its earliest execution from 0 s on; who is unscheduled comes last.

    Raises:
        InvalidMotion: the message is no schedule.
    """
    check(motion)
    scheduled = [way for way in motion.ways if way.scheduled]
    others = [way for way in motion.ways if not way.scheduled]
    if not scheduled:
        raise InvalidMotion("nobody in the motion is scheduled: it moves no robot")
    ways = [*scheduled, *others]
    try:
        return assemble(
            [way.member for way in scheduled],
            [[piece(way, stage) for stage in range(len(way.stages) - 1)] for way in scheduled],
            [way.radius_m for way in ways],
            [way.speed_m_s for way in ways],
            unscheduled={way.member: _time(way) for way in others},
        )
    except InvalidSchedule as problem:
        raise InvalidMotion(str(problem)) from problem


def check(motion: Motion) -> None:
    """Raise InvalidMotion unless members differ, and the stages of each are as many, and are its whole way."""
    names = [way.member for way in motion.ways]
    if len(set(names)) < len(names):
        raise InvalidMotion(f"a member of the motion has two ways: {', '.join(sorted(names))}")
    for way in motion.ways:
        if len(way.stages) != len(motion.ways[0].stages):
            raise InvalidMotion(
                f"{way.member} has {len(way.stages) - 1} stages, {names[0]} {len(motion.ways[0].stages) - 1}"
            )
        last = len(way.waypoints) - 1
        if way.stages[0] != 0 or way.stages[-1] != last or any(after < mark for mark, after in pairwise(way.stages)):
            raise InvalidMotion(
                f"the stages of {way.member} begin at waypoint {way.stages[0]} and end at {way.stages[-1]}: they must "
                f"rise from 0 to {last}"
            )
        if last > 0 and way.speed_m_s < SLOWEST_M_S:
            raise InvalidMotion(f"{way.member} is to move at {way.speed_m_s:g} m/s: give at least {SLOWEST_M_S:g} m/s")


def end_stage(motion: Motion) -> int:
    """Number of the first stage that is not contained any more."""
    return motion.first_stage + len(motion.ways[0].stages) - 1


def piece(way: MemberWay, stage: int) -> tuple[Point, ...]:
    """The waypoints of a stage, counted from the first one contained: one for a stop."""
    return way.waypoints[way.stages[stage] : way.stages[stage + 1] + 1]


def _time(way: MemberWay) -> TimedPath:
    """The way at full speed from 0 s on."""
    points = np.array(way.waypoints)
    points = points[np.append(True, np.any(np.diff(points, axis=0) != 0.0, axis=1))]
    times_s, time_s = [0.0], 0.0
    for length_m in np.hypot(*np.diff(points, axis=0).T):
        time_s = max(time_s + float(length_m) / way.speed_m_s, float(np.nextafter(time_s, np.inf)))
        times_s.append(time_s)
    return TimedPath(points, times_s)
