"""Motions of a team that has to part: whom, where, and for how long; and whether that is proven.

Somebody has to part for certain if the team is not connected at the start, or will not be at its goals. Else it is
only that nothing better was found.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.certificate import Certificate, certify
from planning.connectivity import component_labels
from planning.motion_plan import Schedule
from planning.team_task import TeamTask

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Parting:
    """What a schedule breaks of the connection that is asked for if it is executed at full speed.

    Attributes:
        since_s: when it begins, seconds; inf if nobody parts.
        break_s: for how long, seconds; inf if it ends so.
        between: two members that part first; None if nobody parts.
        text: who parts, where and when; a sentence.
    """

    since_s: float
    break_s: float
    between: tuple[str, str] | None
    text: str


def find_parting(task: TeamTask, schedule: Schedule) -> Parting:
    """What a schedule breaks of the task's level. Complexity as of a certificate by the clock."""
    judged = _certify_connection(task, schedule)
    breaks = [
        (violation.time_s, violation.until_s) for violation in judged.violations if violation.kind == "connection"
    ]
    if not breaks:
        return Parting(np.inf, 0.0, None, "nobody parts at full speed, but somebody may if others are late")
    first = next(violation for violation in judged.violations if violation.kind == "connection")
    one, other = first.members
    row = max((schedule.members.index(name) for name in (one, other)), key=lambda i: schedule.paths[i].length_m)
    x, y = schedule.paths[row].positions([first.time_s])[0]
    lasts = sum(until - since for since, until in breaks)
    how_long = f"for {lasts:.3g} s" if np.isfinite(lasts) else "for good"
    return Parting(
        first.time_s,
        lasts,
        (one, other),
        f"{one} and {other} part at ({x:.4g}, {y:.4g}) after {first.time_s:.3g} s, {how_long}",
    )


def _certify_connection(task: TeamTask, schedule: Schedule) -> Certificate:
    by_clock = Schedule(schedule.members, schedule.paths, 0.0, np.inf, None, schedule.unscheduled)
    return certify(by_clock, task.environment, ends=task.level.rows)


def prove_parting(task: TeamTask) -> tuple[str, tuple[str, str] | None]:
    """Why no motion can keep the task's level, and who parts; an empty sentence where nothing proves it.

    Of those who go as they please each corner of their ways is tried, with all others of them at their first places.
    """
    ways = list(task.unscheduled.values())
    firsts = [way[0] for way in ways]
    spots = [firsts, *([*firsts[:i], place, *firsts[i + 1 :]] for i, way in enumerate(ways) for place in way[1:])]
    for places, when in ((task.starts, "are not connected at the start"), (task.goals, "will not be at the goals")):
        for others in spots:
            everybody = np.array([*places, *others])
            labels = component_labels(task.environment.visibility_matrix(everybody))
            rows = task.level.rows
            stray = [(i, j) for i in rows for j in rows if i < j and labels[i] != labels[j]]
            if stray:
                i, j = min(stray, key=lambda pair: float(np.hypot(*(everybody[pair[0]] - everybody[pair[1]]))))
                one, other = task.names[i], task.names[j]
                text = f"{one} at {_name(everybody[i])} and {other} at {_name(everybody[j])} {when}"
                return text, (one, other)
    return "", None


def _name(place: Floats) -> str:
    return f"({place[0]:.4g}, {place[1]:.4g})"
