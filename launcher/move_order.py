"""The order of moves of a schedule: who goes how far in which stage, when, and who waits for whom."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.motion_plan import Schedule

Floats = NDArray[np.float64]

_AT_ONCE_S = 1e-6
"""Times that differ by less are one."""


@dataclass(frozen=True, slots=True)
class Move:
    """What a member drives in one stage.

    Attributes:
        member: its row in the schedule.
        stage: counted from 1.
        length_m: of this piece of its path.
        from_m: of its path driven before.
        begin_s: when it sets off if nobody is late.
        end_s: when it is there.
        waits_s: how long it stood since its move before, or since the schedule's start.
        waits_for: rows of those who end last of all it has to wait for; nobody if it does not wait.
    """

    member: int
    stage: int
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
    """All moves of a schedule, by stage and then by member. A schedule without stages is one stage.

    Complexity: O(k n + m) for k members, n stages and m waypoints.
    """
    count = max(schedule.stage_count, 1)
    begins, ends, lengths = _measure_stages(schedule, count)
    covered = np.cumsum(lengths, axis=1) - lengths
    # When each member has finished all its moves up to a stage; standing still is finished at once.
    finished = np.maximum.accumulate(np.where(lengths > 0.0, ends, schedule.start_s), axis=1)
    moves = []
    for stage, member in np.argwhere(lengths.T > 0.0).tolist():
        begin = float(begins[member, stage])
        waits = begin - float(finished[member, stage - 1] if stage else schedule.start_s)
        others: tuple[int, ...] = ()
        if waits > _AT_ONCE_S and stage >= 2:
            before = finished[:, stage - 2]
            others = tuple(np.flatnonzero(before >= before.max() - _AT_ONCE_S).tolist())
        moves.append(
            Move(
                member, stage + 1, float(lengths[member, stage]), float(covered[member, stage]), begin,
                float(ends[member, stage]), waits if waits > _AT_ONCE_S else 0.0, others,
            )
        )  # fmt: skip
    return moves


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
