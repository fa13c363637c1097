"""Motions of one robot after another, shortened, and put into stages in which as many go at once as can.

A *run* is the way of one robot while all others stand. Where it could go straight on, it does: a leg is allowed if it
keeps clear of all others' discs, and the network of their links and of those of the mover's links that hold on the
whole leg joins whom it should.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.connectivity import component_labels
from planning.motion_plan import Schedule
from planning.order_search import Demand, is_joined
from planning.pair_clearance import segment_distance
from planning.pair_tables import APART, SEES, PairTables, make_tables
from planning.path_elements import cut_path
from planning.staging import choose_cuts, time_stages
from planning.team_roadmap import see_throughout
from planning.team_task import Level, TeamTask

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LONGEST_PIECE_M: Final = 1.0
"""Of paths, metres: stages begin and end between such pieces."""


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """Attributes: the robot's row in its task, and its way (m, 2) float, metres, m ≥ 2."""

    row: int
    way: Floats


def make_runs(rows: Sequence[int], places: Floats) -> list[Run]:
    """The runs of robots, given by their rows, that stand at places (n, m, 2), of which one changes each time."""
    runs: list[Run] = []
    for before, after in pairwise(places):
        for i in np.flatnonzero(np.any(before != after, axis=1)).tolist():
            if runs and runs[-1].row == rows[i]:
                runs[-1] = Run(rows[i], np.concatenate([runs[-1].way, after[i : i + 1]]))
            else:
                runs.append(Run(rows[i], np.array([before[i], after[i]])))
    return runs


def shorten_runs(task: TeamTask, level: Level, runs: Sequence[Run]) -> list[Run]:
    """Every run with as few bends as it needs; those that lead nowhere left out. O(n² k w) for a run of n bends."""
    places = task.starts.copy()
    found = []
    for run in runs:
        network = task.network(places)
        way = [run.way[0]]
        at = 0
        while at < len(run.way) - 1:
            to = len(run.way) - 1
            while to > at + 1 and not _leg_is_allowed(task, level, places, network, run.row, run.way[[at, to]]):
                to -= 1
            way.append(run.way[to])
            at = to
        if np.any(way[0] != way[-1]):
            found.append(Run(run.row, np.array(way)))
        places[run.row] = run.way[-1]
    return found


def _leg_is_allowed(
    task: TeamTask, level: Level, places: Floats, network: NDArray[np.bool_], mover: int, leg: Floats
) -> bool:
    if not task.free.line_of_sight(leg[0], leg[1]):
        return False
    apart = task.separations()[mover] - task.environment.tolerance_m
    for i, place in enumerate(places):
        if i != mover and segment_distance(leg[0], leg[1], place, place) < apart[i]:
            return False
    if not level.asks:
        return True
    links = network.copy()
    for j, other in enumerate([*(place[None] for place in places), *task.unscheduled.values()]):
        if j != mover and links[mover, j] and not see_throughout(task.environment, leg, other):
            links[mover, j] = links[j, mover] = False
    labels = component_labels(links)
    return len({int(labels[row]) for row in level.rows}) == 1


def stage_runs(task: TeamTask, level: Level, runs: Sequence[Run]) -> Schedule | None:
    """The runs in their order, as a schedule: who can goes while others go. None if a run is not allowed after all.

    O(p k + p² k²) for p pieces in all, besides the tables of pairs.
    """
    n = len(task.names)
    paths = [[place] for place in task.starts]
    state = np.zeros(n, dtype=np.int64)
    states = [state.copy()]
    for run in runs:
        paths[run.row] += list(run.way[1:])
        for _ in range(cut_path(run.way, LONGEST_PIECE_M).pieces):
            state[run.row] += 1
            states.append(state.copy())
    elements = [cut_path(np.array(path), LONGEST_PIECE_M) for path in (*paths, *task.unscheduled.values())]
    anywhere = list(range(len(task.members), n))
    separations = np.zeros((n, n))
    separations[: len(task.members), : len(task.members)] = task.separations()
    tables = make_tables(
        elements, separations, anywhere, task.environment.walls if level.asks else None, task.environment.tolerance_m
    )
    demand = Demand(sum(1 << row for row in level.rows), np.zeros(n, dtype=np.int64))
    order = np.array(states)
    if not all(_step_is_allowed(tables, demand, *step) for step in pairwise(order)):
        return None
    cuts = choose_cuts(order, tables, demand) if len(order) > 1 else np.zeros(2, dtype=np.int64)
    timed, stages = time_stages(order[cuts], elements, task.all_speeds, anywhere)
    radii = np.append(task.radii_m, np.zeros(len(task.unscheduled)))
    return Schedule(task.names, timed, radii, task.all_speeds, stages, list(task.unscheduled))


def _step_is_allowed(tables: PairTables, demand: Demand, before: Ints, after: Ints) -> bool:
    """Whether one member may go on by one piece, by the tables that stages are made by."""
    elements = before + after
    adjacent = np.zeros(len(before), dtype=np.int64)
    for i in range(len(before)):
        for j in range(i):
            bits = tables.table(i, j)[elements[i], elements[j]]
            if not bits & APART:
                return False
            if bits & SEES:
                adjacent[i] |= 1 << j
                adjacent[j] |= 1 << i
    return bool(is_joined(adjacent, demand.joined))
