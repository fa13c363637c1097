"""Long stages cut into short ones, so that robots that stand at the end of a stage are never far from where they are.

Symbols: B(n) is when the last member finishes stage n at full speed. Between B(n − 1) and B(n) all members are in
stages n and n + 1 whatever the rule of progress allows, so whatever is certified of those two holds of every cut in
between. A cut at B(n) itself is a stage in which nobody moves: the stages before it and after it never meet.

At full speed nobody waits at any of these cuts, so all of it takes as long as before.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planning.motion_plan import InvalidSchedule, Schedule, TimedPath

Floats = NDArray[np.float64]


def shorten(schedule: Schedule, longest_s: float, growth: float = 0.0) -> Schedule:
    """The same ways in shorter stages.

    Args:
        schedule: in stages, at the times of its earliest execution.
        longest_s: what a stage may take at full speed, seconds.
        growth: so much longer may a stage be for each second that it begins after the start: what is far off will be
            planned anew before.

    Raises:
        InvalidSchedule: the schedule is bound to the clock.
        ValueError: ``longest_s`` is not positive, or ``growth`` negative.

    Complexity: O(k (m + n) log (m + n)) for n stages of the result.
    """
    if not longest_s > 0.0 or not growth >= 0.0:
        raise ValueError(f"stages of {longest_s} s, growing by {growth}: give a positive duration and growth from 0 on")
    if schedule.stages is None:
        raise InvalidSchedule("a schedule that is bound to the clock has no stages to shorten: give it stages")
    rows = [row for row, name in enumerate(schedule.members) if name not in schedule.unscheduled]
    ends_s = np.max([schedule.paths[row].times_s[schedule.stages[row, 1:]] for row in rows], axis=0, initial=-np.inf)
    since_s = start_s = schedule.start_s
    cuts: list[Floats] = []
    for until_s in np.unique(ends_s[ends_s > start_s]).tolist():
        between = start_s + _cut(since_s - start_s, until_s - start_s, longest_s, growth)
        between[0], between[-1] = since_s, until_s
        cuts.append(between)
        since_s = until_s
    if not cuts:
        return schedule
    times_s = np.concatenate(cuts)
    paths = list(schedule.paths)
    stages = np.zeros((len(paths), len(times_s)), dtype=np.int64)
    for row, path in enumerate(paths):
        if row in rows:
            all_s = np.union1d(path.times_s[path.times_s <= since_s], times_s)
            paths[row] = TimedPath(path.positions(all_s), all_s)
            stages[row] = np.searchsorted(all_s, times_s)
        else:
            stages[row, 1:] = len(path.waypoints) - 1
    return Schedule(schedule.members, paths, schedule.radii_m, schedule.speeds_m_s, stages, schedule.unscheduled)


def _cut(since_s: float, until_s: float, longest_s: float, growth: float) -> Floats:
    """Times from one to another with steps no longer than allowed, as few as will do."""
    whole_s = until_s - since_s
    length_s = max(longest_s, growth * since_s)
    if growth * whole_s < 1e-3 * length_s:
        return np.linspace(since_s, until_s, 1 + int(np.ceil(whole_s / length_s)))
    cuts = [since_s]
    while cuts[-1] < until_s:
        cuts.append(cuts[-1] + max(longest_s, growth * cuts[-1]))
    # Shrunk to fit, which keeps their proportions.
    return since_s + (np.array(cuts) - since_s) * (whole_s / (cuts[-1] - since_s))
