"""Schedules put together: of pieces of path, stage by stage, and of one schedule that goes on where another ends.

Symbols: f(i, n) is when member i finishes stage n, and l(i, n) the length of its piece. At full speed v the earliest
execution under the rule of progress (see `planning.motion_plan`) is

    f(i, n) = max(f(i, n − 1), max over j of f(j, n − 2)) + l(i, n) / v(i)

Whatever is certified of two schedules by progress holds of the one followed by the other, if nothing moves in between
for one stage: then no two stages meet that did not before.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import accumulate, pairwise
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.motion_plan import InvalidSchedule, Schedule, TimedPath

Floats = NDArray[np.float64]
Places = list[list[float]]

_SAME_PLACE_M: Final = 1e-9
"""Between where one schedule ends and where the next one starts."""


def assemble(
    members: Sequence[str],
    pieces: Sequence[Sequence[ArrayLike]],
    radii_m: ArrayLike,
    speeds_m_s: ArrayLike,
    *,
    start_s: float = 0.0,
    unscheduled: Mapping[str, TimedPath] | None = None,
) -> Schedule:
    """The schedule of given stages, at the times of its earliest execution.

    Args:
        members: names of those that are scheduled.
        pieces: for each of them n ≥ 1 pieces, each (m, 2) float, metres, map frame, m ≥ 1: its way in each stage, from
            where it was before. A single point is a stage in which it stands.
        radii_m: of all, the unscheduled ones last in their order: one or (k,), metres.
        speeds_m_s: likewise, metres a second; finite and positive for those that move.
        start_s: when the first stage begins, seconds.
        unscheduled: the paths of others, which go as they please; kept as they are.

    Raises:
        InvalidSchedule: members have different numbers of stages, a piece does not begin where the last one ended, or
            someone moves without a speed.

    Complexity: O(k n + m).
    """
    others = dict(unscheduled or {})
    names = [*members, *others]
    speeds = np.broadcast_to(np.asarray(speeds_m_s, dtype=np.float64), len(names))
    ways = [[_thin(piece) for piece in own] for own in pieces]
    counts = {len(own) for own in ways}
    if len(counts) != 1 or 0 in counts or len(ways) != len(members):
        raise InvalidSchedule(
            f"pieces of {len(ways)} members in {sorted(counts)} stages for {len(members)} members: give each a piece "
            "for every stage, the place where it stands if it does"
        )
    for name, own, speed in zip(members, ways, speeds, strict=False):
        _check_way(name, own, float(speed))
    lengths = np.array([[math.fsum(math.dist(p, q) for p, q in pairwise(piece)) for piece in own] for own in ways])
    moves = lengths > 0.0
    takes = np.divide(lengths, speeds[: len(ways), None], out=np.zeros_like(lengths), where=moves)
    begins, ends = _earliest(takes, start_s)
    paths, rows = [], []
    for own, began, ended, speed in zip(ways, begins, ends, speeds, strict=False):
        path, row = _lay(own, began, ended, float(speed), start_s)
        paths.append(path)
        rows.append(row)
    stage_count = counts.pop()
    rows += [[0] + [len(path.waypoints) - 1] * stage_count for path in others.values()]
    return Schedule(names, [*paths, *others.values()], radii_m, speeds, rows, frozenset(others))


def follow(first: Schedule, second: Schedule) -> Schedule:
    """The first schedule, then the second, as one at the times of its earliest execution.

    The stages of the first keep their numbers; those of the second are the last ones of the result. Between them is a
    stage in which nobody moves, unless the first ends or the second starts with one.

    Args:
        first: a schedule in stages.
        second: another of the same members, radii and speeds, in any order; it starts where the first one ends. An
            unscheduled member may be anywhere on its path at any time, so it has one path: that of the second schedule.

    Raises:
        InvalidSchedule: one is bound to the clock, members, radii or speeds differ, or someone starts elsewhere.

    Complexity: O(k (n + m)).
    """
    if first.stages is None or second.stages is None:
        raise InvalidSchedule("a schedule that is bound to the clock has no stages to go on from: give each its stages")
    if set(first.members) != set(second.members) or first.unscheduled != second.unscheduled:
        raise InvalidSchedule(
            f"a schedule of {', '.join(second.members)} cannot follow one of {', '.join(first.members)}: plan for the "
            "same members"
        )
    order = [second.members.index(name) for name in first.members]
    if not (
        np.array_equal(first.radii_m, second.radii_m[order])
        and np.array_equal(first.speeds_m_s, second.speeds_m_s[order])
    ):
        raise InvalidSchedule("two schedules give their members different radii or speeds: plan both with the same")
    scheduled = [i for i, name in enumerate(first.members) if name not in first.unscheduled]
    others = [i for i, name in enumerate(first.members) if name in first.unscheduled]
    for i in scheduled:
        end, start = first.paths[i].waypoints[-1], second.paths[order[i]].waypoints[0]
        if np.hypot(*(end - start)) > _SAME_PLACE_M:
            raise InvalidSchedule(
                f"{first.members[i]} ends at ({end[0]:.6g}, {end[1]:.6g}) and is to go on from "
                f"({start[0]:.6g}, {start[1]:.6g}): plan from where it ends"
            )
    still = any(
        np.array_equal(schedule.stages[rows, column], schedule.stages[rows, column + 1])
        for schedule, rows, column in (
            (first, scheduled, first.stage_count - 1),
            (second, [order[i] for i in scheduled], 0),
        )
        if schedule.stages is not None
    )
    pieces = []
    for i in scheduled:
        before = [first.piece(i, n, n) for n in range(first.stage_count)]
        after = [second.piece(order[i], n, n) for n in range(second.stage_count)]
        place = before[-1][-1:]
        after[0] = np.concatenate([place, after[0][1:]])
        pieces.append([*before, *([] if still else [place]), *after])
    ranks = scheduled + others
    return assemble(
        [first.members[i] for i in scheduled],
        pieces,
        first.radii_m[ranks],
        first.speeds_m_s[ranks],
        start_s=first.start_s,
        unscheduled={first.members[i]: _begin_at(second.paths[order[i]], first.start_s) for i in others},
    )


def _thin(piece: ArrayLike) -> Places:
    """Without stops: a stop is what waiting makes of a path, and times are made anew."""
    points: Places = np.array(piece, dtype=np.float64).reshape(-1, 2).tolist()
    if not points:
        raise InvalidSchedule("a piece of path has no points: give the place where the member stands")
    return points[:1] + [after for before, after in pairwise(points) if before != after]


def _check_way(name: str, own: list[Places], speed: float) -> None:
    for n, (before, after) in enumerate(pairwise(own)):
        if before[-1] != after[0]:
            raise InvalidSchedule(
                f"{name} ends stage {n} at {tuple(before[-1])} and begins the next at {tuple(after[0])}: "
                "begin where it is"
            )
    if any(len(piece) > 1 for piece in own) and not (0.0 < speed < np.inf):
        raise InvalidSchedule(f"{name} is to move at {speed:g} m/s: give a finite speed above 0")


def _earliest(takes: Floats, start_s: float) -> tuple[Floats, Floats]:
    """When each member begins and finishes each stage, both (k, n), seconds, from how long each takes (k, n)."""
    begins, ends = np.empty_like(takes), np.empty_like(takes)
    for n in range(takes.shape[1]):
        own = ends[:, n - 1] if n > 0 else np.full(len(takes), start_s)
        all_ = ends[:, n - 2].max() if n > 1 else start_s
        begins[:, n] = np.maximum(own, all_)
        ends[:, n] = begins[:, n] + takes[:, n]
    return begins, ends


def _lay(own: list[Places], begins: Floats, ends: Floats, speed: float, start_s: float) -> tuple[TimedPath, list[int]]:
    """A member's path at the times of its stages, and the waypoints at which these begin and the last one ends."""
    points, times, row = [own[0][0]], [start_s], [0]
    for piece, begin, end in zip(own, begins.tolist(), ends.tolist(), strict=True):
        if len(piece) > 1:
            if begin > times[-1]:
                points.append(piece[0])
                times.append(begin)
            points += piece[1:]
            covered = list(accumulate(math.dist(p, q) for p, q in pairwise(piece)))
            for time in (*(begin + length / speed for length in covered[:-1]), end):
                # Steps so short that rounding swallows their time take the least time that there is.
                times.append(max(time, math.nextafter(times[-1], math.inf)))
        row.append(len(points) - 1)
    return TimedPath(points, times), row


def _begin_at(path: TimedPath, start_s: float) -> TimedPath:
    return TimedPath(path.waypoints, path.times_s - path.times_s[0] + start_s)
