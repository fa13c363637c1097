"""Collisions and connection of a schedule in stages, wherever its members are by their own progress.

Part of the certificate, and written apart from all planners. While the rule of progress is kept (nobody begins stage
n + 2 before all have finished stage n), all are in two stages that follow each other: a *window*. In each window every
member has a piece of its path, and may be anywhere on it whatever the others do. So in each window

- pieces of members with bodies keep their distance from each other, all of one from all of the other;
- the links that hold for all places on both pieces join the network.

An unscheduled member may be anywhere on its whole path in every window. The nominal times have to keep the rule of
progress too; then whatever happens on the nominal clock is one of these cases.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.certificate_violation import Violation, name_parts
from planning.certificate_window import find_distances, find_link, find_networks, time_stages
from planning.motion_plan import Schedule

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_SOONER: Final = 1e-9
"""Of a schedule's duration: what rounding may make a stage begin too soon."""


def check_progress(
    schedule: Schedule,
    walls: Floats,
    depth: float,
    required: Sequence[tuple[int, int]] | None,
    ends: Sequence[int] | None,
) -> Iterator[Violation]:
    """What is wrong between members in any two stages that follow each other, and with the nominal times.

    The arguments are those of `planning.certificate_clock.check_clock`; the schedule has stages.
    """
    assert schedule.stages is not None
    points = np.concatenate([path.waypoints for path in schedule.paths])
    lengths = [len(path.waypoints) for path in schedule.paths]
    starts = np.cumsum([0, *lengths[:-1]])
    stages = schedule.stages + starts[:, None]
    waits = np.array([name not in schedule.unscheduled for name in schedule.members])
    times = np.concatenate([path.times_s for path in schedule.paths])
    begun, finished = time_stages(times, points, stages[waits], schedule.start_s)
    # When all have finished each stage; an unscheduled member has nothing to finish.
    barriers = finished.max(axis=0, initial=schedule.start_s)
    yield from _check_times(schedule, np.flatnonzero(waits), begun, finished, barriers)
    first, last = (stages[:, :-2], stages[:, 2:]) if schedule.stage_count > 1 else (stages[:, :1], stages[:, 1:])
    first = np.where(waits[:, None], first, starts[:, None])
    last = np.where(waits[:, None], last, (starts + lengths)[:, None] - 1)
    yield from _check_collisions(schedule, points, first, last, depth, barriers)
    yield from _check_connection(schedule, points, first, last, walls, required, ends, barriers)


def _check_times(
    schedule: Schedule, rows: Ints, begun: Floats, finished: Floats, barriers: Floats
) -> Iterator[Violation]:
    """Who begins a stage too early on the nominal clock, by the times (n, stages) of the members ``rows`` (n,)."""
    span = schedule.end_s - schedule.start_s
    slack = _SOONER * span + 4.0 * np.spacing(max(abs(schedule.start_s), abs(schedule.end_s)))
    for row, stage in np.argwhere(begun[:, 2:] < barriers[:-2] - slack):
        late = int(np.argmax(finished[:, stage]))
        one, other = schedule.members[rows[row]], schedule.members[rows[late]]
        begins, ends = float(begun[row, stage + 2]), float(barriers[stage])
        text = (
            f"{one} would begin stage {stage + 2} at {begins:.6g} s, before {other} has finished stage {stage} "
            f"at {ends:.6g} s"
        )
        yield Violation(begins, ends, "progress", (one, other), text, int(stage))


def _runs(broken: Bools) -> Iterator[tuple[int, int]]:
    """First and last of each run of true values (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], broken, [False]])))
    for first, after in edges.reshape(-1, 2):
        yield int(first), int(after) - 1


def _place_window(schedule: Schedule, barriers: Floats, first: int, last: int) -> tuple[float, float, str]:
    """From when to when all can be in a run of windows, on the nominal clock, and the words for its first one."""
    begins = schedule.start_s if first == 0 else float(barriers[first - 1])
    ends = float(barriers[last + 1]) if last + 2 < schedule.stage_count else np.inf
    return begins, ends, f"stages {first} and {first + 1}" if schedule.stage_count > 1 else "stage 0"


def _check_collisions(
    schedule: Schedule, points: Floats, first: Ints, last: Ints, depth: float, barriers: Floats
) -> Iterator[Violation]:
    distances, places = find_distances(points, first, last, schedule.radii_m)
    for i in range(len(schedule)):
        for j in range(i):
            separation = float(schedule.radii_m[i] + schedule.radii_m[j])
            for window, until in _runs(distances[i, j] < separation - depth):
                begins, ends, where = _place_window(schedule, barriers, window, until)
                one, other = schedule.members[j], schedule.members[i]
                x, y = places[i, j, window]
                near = f"can come nearer than {separation:g} m to each other, at ({x:.6g}, {y:.6g})"
                text = f"in {where} {one} and {other} {near}"
                yield Violation(begins, ends, "collision", (one, other), text, window)


def _check_connection(
    schedule: Schedule,
    points: Floats,
    first: Ints,
    last: Ints,
    walls: Floats,
    required: Sequence[tuple[int, int]] | None,
    ends: Sequence[int] | None,
    barriers: Floats,
) -> Iterator[Violation]:
    names = schedule.members
    for i, j in required or ():
        held = find_link(points, first, last, i, j, walls)
        for window, until in _runs(~held):
            begins, finishes, where = _place_window(schedule, barriers, window, until)
            text = f"in {where} {names[i]} and {names[j]} do not see each other from everywhere on their ways"
            yield Violation(begins, finishes, "connection", (names[i], names[j]), text, window)
    if required is not None and ends is None:
        return
    asked = np.arange(len(schedule)) if ends is None else np.array(ends)
    labels, links = find_networks(points, first, last, asked, walls)
    broken = np.any(labels[:, asked] != labels[:, asked[:1]], axis=1)
    for window, until in _runs(broken):
        begins, finishes, where = _place_window(schedule, barriers, window, until)
        label = np.unique(labels[window], return_inverse=True)[1]
        before = links[window - 1] if window > 0 else links[:0, 0]
        lost = [(int(i), int(j)) for i, j in before if i >= 0 and label[i] != label[j]]
        clause, parts = name_parts(names, label.tolist(), lost)
        why = f", as {clause} can lose sight of each other," if lost else ""
        apart = (int(asked[0]), int(asked[np.argmax(label[asked] != label[asked[0]])]))
        i, j = lost[0] if lost and ends is None else apart
        text = f"in {where}{why} the team can be parted: {parts}"
        yield Violation(begins, finishes, "connection", (names[i], names[j]), text, window)
