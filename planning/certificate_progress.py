"""Collisions and connection of a schedule in stages, wherever its members are by their own progress.

Part of the certificate, and written apart from all planners. While the rule of progress is kept (nobody begins stage
n + 2 before all have finished stage n), all are in two stages that follow each other: a *window*. In each window every
member has a piece of its path, and may be anywhere on it whatever the others do. So in each window

- pieces of members with bodies keep their distance from each other, all of one from all of the other;
- the links that hold for all places on both pieces join the network.

An unscheduled member may be anywhere on its whole path in every window; two of them are not held against each other, as
no schedule can keep them apart. The nominal times have to keep the rule of progress too; then whatever happens on the
nominal clock is one of these cases.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.certificate_violation import Violation, name_parts
from planning.certificate_window import bound_pieces, find_distances, find_link, find_networks, time_stages
from planning.motion_plan import Schedule

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_SOONER: Final = 1e-9
"""Of a schedule's duration: what rounding may make a stage begin too soon."""


@dataclass(frozen=True, slots=True, eq=False)
class _Windows:
    """The pieces of all members in every window, as rows of one list of points (see `planning.certificate_window`)."""

    points: Floats
    first: Ints
    last: Ints
    bounds: Floats
    barriers: Floats
    """(stages,) float, seconds: when all have finished each of them, on the nominal clock."""
    start_s: float

    def place(self, first: int, last: int) -> tuple[float, float, str]:
        """From when to when a run of windows lasts, on the nominal clock, and the words for the first of them."""
        begins = self.start_s if first == 0 else float(self.barriers[first - 1])
        ends = float(self.barriers[last + 1]) if last + 2 < len(self.barriers) else np.inf
        return begins, ends, f"stages {first} and {first + 1}" if len(self.barriers) > 1 else "stage 0"


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
    times = np.concatenate([path.times_s for path in schedule.paths])
    lengths = np.array([len(path.waypoints) for path in schedule.paths])
    starts = np.cumsum(lengths) - lengths
    stages = schedule.stages + starts[:, None]
    waits = np.array([name not in schedule.unscheduled for name in schedule.members])
    begun, finished, barriers = time_stages(times, points, stages[waits], schedule.start_s)
    yield from _check_times(schedule, np.flatnonzero(waits), begun, finished, barriers)
    first, last = (stages[:, :-2], stages[:, 2:]) if schedule.stage_count > 1 else (stages[:, :1], stages[:, 1:])
    first = np.where(waits[:, None], first, starts[:, None])
    last = np.where(waits[:, None], last, (starts + lengths)[:, None] - 1)
    bounds = bound_pieces(points, first, last)
    windows = _Windows(points, first, last, bounds, barriers, schedule.start_s)
    yield from _check_collisions(schedule, windows, depth)
    yield from _check_links(schedule, windows, walls, required or ())
    if required is None or ends is not None:
        yield from _check_network(schedule, windows, walls, ends)


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


def _check_collisions(schedule: Schedule, windows: _Windows, depth: float) -> Iterator[Violation]:
    found = find_distances(windows.points, windows.first, windows.last, windows.bounds, schedule.radii_m)
    separations = schedule.radii_m[:, None] + schedule.radii_m
    near = found[..., 0] < separations[:, :, None] - depth
    free = np.array([name in schedule.unscheduled for name in schedule.members])
    near[np.ix_(free, free)] = False
    for i, j in np.argwhere(near.any(axis=2)):
        one, other = schedule.members[i], schedule.members[j]
        for window, until in _runs(near[i, j]):
            begins, ends, where = windows.place(window, until)
            _, x, y = found[i, j, window]
            distance = f"nearer than {separations[i, j]:g} m to each other"
            text = f"in {where} {one} and {other} can come {distance}, at ({x:.6g}, {y:.6g})"
            yield Violation(begins, ends, "collision", (one, other), text, window)


def _check_links(
    schedule: Schedule, windows: _Windows, walls: Floats, required: Sequence[tuple[int, int]]
) -> Iterator[Violation]:
    names = schedule.members
    for i, j in required:
        held = find_link(windows.points, windows.first, windows.last, i, j, walls)
        for window, until in _runs(~held):
            begins, finishes, where = windows.place(window, until)
            text = f"in {where} {names[i]} and {names[j]} do not see each other from everywhere on their ways"
            yield Violation(begins, finishes, "connection", (names[i], names[j]), text, window)


def _check_network(
    schedule: Schedule, windows: _Windows, walls: Floats, ends: Sequence[int] | None
) -> Iterator[Violation]:
    names = schedule.members
    asked = np.array(range(len(schedule)) if ends is None else ends)
    pairs = _order_pairs(windows.bounds)
    labels, links = find_networks(windows.points, windows.first, windows.last, pairs, asked, walls)
    broken = np.any(labels[:, asked] != labels[:, asked[:1]], axis=1)
    for window, until in _runs(broken):
        begins, finishes, where = windows.place(window, until)
        label = np.unique(labels[window], return_inverse=True)[1]
        before = links[window - 1] if window > 0 else links[:0, 0]
        lost = [(int(i), int(j)) for i, j in before if i >= 0 and label[i] != label[j]]
        clause, parts = name_parts(names, label.tolist(), lost)
        why = f", as {clause} can lose sight of each other," if lost else ""
        apart = (int(asked[0]), int(asked[np.argmax(label[asked] != label[asked[0]])]))
        i, j = lost[0] if lost and ends is None else apart
        text = f"in {where}{why} the team can be parted: {parts}"
        yield Violation(begins, finishes, "connection", (names[i], names[j]), text, window)


def _order_pairs(bounds: Floats) -> Ints:
    """All pairs of members in each window, (w, n, 2), those first whose pieces are near each other."""
    pairs = np.column_stack(np.triu_indices(len(bounds), 1))
    middles = bounds[..., ::2] + bounds[..., 1::2]
    spans = np.linalg.norm(middles[pairs[:, 0]] - middles[pairs[:, 1]], axis=-1)
    return pairs[np.argsort(spans, axis=0).T]
