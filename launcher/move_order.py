"""The order of moves of a schedule: who goes how far, when, in which stages, and who waits for whom."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planning.motion_plan import Schedule

Floats = NDArray[np.float64]

SHORT_S = 0.1
"""Shorter waits are no stops."""

_AT_ONCE_S = 1e-6
"""Times that differ by less are one."""


@dataclass(frozen=True, slots=True)
class Move:
    """What a member drives without a stop that lasts.

    Attributes:
        member: its row in the schedule.
        stages: the first and the last one in which it does, counted from 1.
        length_m: of this piece of its path.
        from_m: of its path driven before.
        begin_s: when it sets off if nobody is late.
        end_s: when it is there.
        waits_s: how long it stood since its move before, or since the schedule's start.
        waits_for: rows of those who end last of all it has to wait for; nobody if it does not wait.
    """

    member: int
    stages: tuple[int, int]
    length_m: float
    from_m: float
    begin_s: float
    end_s: float
    waits_s: float
    waits_for: tuple[int, ...]


def cover_path(waypoints: Floats) -> Floats:
    """Metres of path up to each waypoint: (m,), of waypoints (m, 2) metres."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(waypoints, axis=0).T))])


def leave_out_stops(waypoints: Floats) -> Floats:
    """Waypoints (m, 2), metres, without those that repeat the one before."""
    kept: Floats = waypoints[np.append(True, np.hypot(*np.diff(waypoints, axis=0).T) > 0.0)]
    return kept


def order_moves(schedule: Schedule) -> list[Move]:
    """All moves of a schedule, in the order in which they begin. A schedule without stages is one stage.

    Complexity: O(k n + m) for k members, n stages and m waypoints.
    """
    count = max(schedule.stage_count, 1)
    begins, ends, lengths = _measure_stages(schedule, count)
    # When each member has finished all its moves up to a stage; standing still is finished at once.
    finished = np.maximum.accumulate(np.where(lengths > 0.0, ends, schedule.start_s), axis=1)
    moves: list[Move] = []
    for member in range(len(schedule)):
        last: Move | None = None
        for stage in np.flatnonzero(lengths[member] > 0.0).tolist():
            begin, end, length = (float(of[member, stage]) for of in (begins, ends, lengths))
            waits = begin - (schedule.start_s if last is None else last.end_s)
            if last is not None and waits < SHORT_S:
                moves.pop()
                last = replace(last, stages=(last.stages[0], stage + 1), length_m=last.length_m + length, end_s=end)
            else:
                others: tuple[int, ...] = ()
                if waits >= SHORT_S and stage >= 2:
                    before = finished[:, stage - 2]
                    others = tuple(np.flatnonzero(before >= before.max() - _AT_ONCE_S).tolist())
                driven = 0.0 if last is None else last.from_m + last.length_m
                last = Move(member, (stage + 1, stage + 1), length, driven, begin, end, max(waits, 0.0), others)
            moves.append(last)
    return sorted(moves, key=lambda move: (move.begin_s, move.member))


def _measure_stages(schedule: Schedule, count: int) -> tuple[Floats, Floats, Floats]:
    """When each member sets off and arrives in each stage, seconds, and how far it goes, metres: three times (k, n)."""
    begins = np.full((len(schedule), count), np.nan)
    ends, lengths = begins.copy(), np.zeros(begins.shape)
    for i, path in enumerate(schedule.paths):
        steps = np.hypot(*np.diff(path.waypoints, axis=0).T)
        rows = [0, len(steps)] if schedule.stages is None else schedule.stages[i].tolist()
        for stage in range(count):
            moving = rows[stage] + np.flatnonzero(steps[rows[stage] : rows[stage + 1]] > 0.0)
            if len(moving):
                begins[i, stage], ends[i, stage] = path.times_s[moving[0]], path.times_s[moving[-1] + 1]
                lengths[i, stage] = steps[moving].sum()
    return begins, ends, lengths
