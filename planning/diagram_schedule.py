"""From a coordination diagram to a schedule: a way through it in time, or why there is none.

Some refusals need no search of the whole diagram. If two robots alone cannot get from start to end in their own
diagram, no team with them can; so the diagrams of all pairs are looked at first, completely, and what a pair cannot
reach is taken out of all further search.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from planning.coordination_diagram import CoordinationDiagram, Pair, measure_path
from planning.diagram_search import Route, search_diagram
from planning.motion_plan import Schedule, TimedPath
from planning.no_schedule import NoSchedule

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_TRY: Final = 20
"""Where it is known that the end cannot be reached, this part of the effort goes into how far one gets."""

_HASTE: Final = 1.0
"""Of a second search, where one for the earliest end is given up."""

_WRONG: Final = {
    "collision": "are in each other's way",
    "link": "would have to part",
    "network": "would be parted",
}


@dataclass(frozen=True, slots=True, eq=False)
class Team:
    """Who moves in a diagram of k robots.

    Attributes:
        members: k names.
        radii_m: (k,) float.
        speeds_m_s: (k,) float, positive and finite.
        anywhere: rows of those that may be anywhere on their paths: the unscheduled members of the schedule.
    """

    members: Sequence[str]
    radii_m: Floats
    speeds_m_s: Floats
    anywhere: Collection[int] = ()


def schedule_in(diagram: CoordinationDiagram, team: Team, most_nodes: int) -> Schedule:
    """The schedule of a way through a diagram: bound to the clock, from 0 s on. Robots may go back on their paths.

    Args:
        diagram: of k robots.
        team: the same k.
        most_nodes: of each search, see `planning.diagram_search.search_diagram`.

    Raises:
        NoSchedule: there is none on the grid of the diagram (then that is ``proven``), or the search was given up.
    """
    start = np.zeros(len(diagram), dtype=np.int64)
    if (wrong := _find_trouble(diagram, team, start)) is not None:
        text, between = wrong
        raise NoSchedule(f"no schedule starts where {text}", _execute(diagram, team, start[None]), between, proven=True)
    reachable, parted = _trim(diagram)
    if (known := _refuse_at_once(diagram, team, parted)) is not None:
        text, between = known
        route = search_diagram(reachable, team.speeds_m_s, most_nodes // _TRY, _HASTE)
        raise NoSchedule(text, _execute(diagram, team, route.turns), between, proven=True)
    for haste in (0.0, _HASTE):
        route = search_diagram(reachable, team.speeds_m_s, most_nodes, haste)
        if route.complete or route.exhausted:
            break
    found = _execute(diagram, team, route.turns)
    if route.complete:
        return found
    text, blamed = _blame(diagram, team, route)
    raise NoSchedule(text, found, blamed, proven=route.exhausted)


def _refuse_at_once(
    diagram: CoordinationDiagram, team: Team, parted: Pair | None
) -> tuple[str, tuple[str, str]] | None:
    """Why no search can get to the end, in words, and between whom; None if it may."""
    goal = np.array([2 * len(limits) - 2 for limits in diagram.limits_m], dtype=np.int64)
    if (wrong := _find_trouble(diagram, team, goal)) is not None:
        return f"no schedule ends where {wrong[0]}", wrong[1]
    if parted is None:
        return None
    one, other = (team.members[robot] for robot in parted)
    text = f"{one} and {other} alone cannot both get to the ends of their paths on the grid of {_size(diagram)}"
    return text, (one, other)


def _find_trouble(diagram: CoordinationDiagram, team: Team, elements: Ints) -> tuple[str, tuple[str, str]] | None:
    """What is wrong if robots are in these elements (k,), in words, and between whom."""
    trouble = diagram.find_trouble(elements)
    if trouble is None:
        return None
    i, j = trouble.between
    text = f"{_name_robot(diagram, team, i, elements)} and {_name_robot(diagram, team, j, elements)} "
    return text + _WRONG[trouble.kind], (team.members[i], team.members[j])


def _name_robot(diagram: CoordinationDiagram, team: Team, robot: int, elements: Ints) -> str:
    if robot in team.anywhere:
        return f"{team.members[robot]} somewhere on its way"
    limits = diagram.limits_m[robot]
    x, y = diagram.places(robot, limits[[elements[robot] // 2]])[0]
    return f"{team.members[robot]} {'at' if elements[robot] % 2 == 0 else 'going on from'} ({x:.4g}, {y:.4g})"


def _trim(diagram: CoordinationDiagram) -> tuple[CoordinationDiagram, Pair | None]:
    """The diagram without what single pairs cannot reach from the start; and a pair that cannot reach its end."""
    blocked = {}
    parted = None
    for pair, table in diagram.blocked.items():
        parts, _ = ndimage.label(~table)
        blocked[pair] = parts != parts[0, 0]
        if blocked[pair][-1, -1] and parted is None:
            parted = pair
    return replace(diagram, collides=blocked, links=frozenset()), parted


def _size(diagram: CoordinationDiagram) -> str:
    return " × ".join(str(len(limits)) for limits in diagram.limits_m) + " limits"


def _blame(diagram: CoordinationDiagram, team: Team, route: Route) -> tuple[str, tuple[str, str] | None]:
    """Why a search failed, and the two robots that keep a third, or one another, from going on where it got to."""
    if route.exhausted:
        text = f"no schedule exists on the grid of {_size(diagram)}"
    else:
        text = f"the search on the grid of {_size(diagram)} was given up"
    at = 2 * route.turns[-1]
    for robot, limits in enumerate(diagram.limits_m):
        if at[robot] < 2 * len(limits) - 2:
            moved = at.copy()
            moved[robot] += 1
            wrong = _find_trouble(diagram, team, moved)
            if wrong is not None:
                return f"{text}: as far as it got, {wrong[0]}", wrong[1]
    return text, None


def _execute(diagram: CoordinationDiagram, team: Team, turns: Ints) -> Schedule:
    """All robots go evenly from turn to turn (n, k), as fast as the one that takes longest can."""
    covered = np.stack([limits[turn] for limits, turn in zip(diagram.limits_m, turns.T, strict=True)], axis=1)
    spans = np.abs(np.diff(covered, axis=0)) / team.speeds_m_s
    times = np.append(0.0, np.cumsum(spans.max(axis=1)))
    paths = []
    for robot, path in enumerate(diagram.paths):
        if robot in team.anywhere:
            metres = measure_path(path)
            paths.append(_drive(diagram, robot, metres / team.speeds_m_s[robot], metres))
        else:
            paths.append(_drive(diagram, robot, times, covered[:, robot]))
    unscheduled = [team.members[robot] for robot in team.anywhere]
    return Schedule(team.members, paths, team.radii_m, team.speeds_m_s, unscheduled=unscheduled)


def _drive(diagram: CoordinationDiagram, robot: int, times: Floats, covered: Floats) -> TimedPath:
    """Evenly from each of ``covered`` (n,), metres of path, to the next, over all bends between them."""
    bends = measure_path(diagram.paths[robot])
    all_times, all_covered = [times[:1]], [covered[:1]]
    for start, end, from_m, to_m in zip(times, times[1:], covered, covered[1:], strict=False):
        passed = bends[(bends > min(from_m, to_m)) & (bends < max(from_m, to_m))]
        passed = np.append(passed if to_m > from_m else passed[::-1], to_m)
        share = (passed - from_m) / (to_m - from_m) if to_m != from_m else np.ones(1)
        all_times.append(start + share * (end - start))
        all_covered.append(passed)
    at, metres = np.concatenate(all_times), np.concatenate(all_covered)
    # Neither bends that rounding puts at one instant, nor instants within a stop or after the last.
    kept = np.append(True, np.diff(at) > 0.0)
    at, metres = at[kept], metres[kept]
    still = np.append(np.diff(metres) == 0.0, True)
    stays = still & np.append(True, still[:-1])
    stays[0] = False
    return TimedPath(diagram.places(robot, metres[~stays]), at[~stays])
