"""Motions of eight on room3, from one exact deployment to the next: on its aspect cells and on points.

The same hundred redeployments are gone through, in which some robot moves and not the agent alone. Schedules are of
their geodesics; those for which there is none are counted, too: they take longest. The thesis' grid is exponential in
the number of robots: it is compared on what it solves, teams of four.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import combinations, cycle, islice
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from launcher.studies.motion_tasks import Question, draw_tasks
from launcher.studies.redeployment_runs import RADIUS_M, load_ground
from planning.certificate import certify
from planning.coordination import collision_boxes
from planning.environment import Environment
from planning.motion_plan import Schedule
from planning.no_schedule import NoSchedule
from planning.placement_graph import PlacementGraph
from planning.schedule import schedule
from tests.benchmarks.timing import Case, Work

Floats = NDArray[np.float64]
Paths = list[Floats]
T = TypeVar("T")

NODES = 8
NUMBER = 100
SMALL, FEW = 4, 12
"""Members of the teams that the grid is asked for, and the redeployments that it is asked for."""


def cases() -> Iterator[Case]:
    """Name, target in seconds, what to time, and what to compare it with."""
    for what, graph in (("cells", load_ground("room3", "aspect")), ("points", load_ground("room3", None))):
        room3 = graph.environment
        where = f"{NODES} members, room3 {what}"
        ways = list(islice(_draw_ways(graph, NODES), NUMBER))
        found = [plan for plan in (_plan(room3, paths) for paths in ways) if plan is not None]
        yield f"boxes of all pairs, {where}", 0.010, _taking_turns(_bound, ways)
        for share, said, target_s in ((0.5, "median", 0.050), (0.99, "99 %", 0.300)):
            yield f"schedule, {said} of {NUMBER}, {where}", target_s, partial(_time_plans, room3, ways, share)
        yield f"certificate, {where}", 0.020, _taking_turns(partial(certify, environment=room3), found)
        few = [paths for paths in islice(_draw_ways(graph, SMALL), FEW) if _plan(room3, paths, "grid") is not None]
        name = f"{len(few)} schedules, {SMALL} members, room3 {what}"
        yield name, len(few) * 0.050, partial(_plan_all, room3, few), "grid", partial(_plan_all, room3, few, "grid")


def _draw_ways(graph: PlacementGraph, nodes: int) -> Iterator[Paths]:
    """Geodesics of random redeployments in which robots move, and not the agent alone."""
    for task in draw_tasks(graph, Question(nodes), 4 * NUMBER, 1):
        moves = np.any(task.starts != task.goals, axis=1)
        if moves[2:].any():
            yield [
                graph.geodesics.path(start, goal) if moving else start[None]
                for start, goal, moving in zip(task.starts, task.goals, moves, strict=True)
            ]


def _taking_turns(work: Callable[[T], object], things: Sequence[T]) -> Work:
    """Work on the next of some things, and then on the first again."""
    turns = cycle(things)
    return lambda: work(next(turns))


def _bound(paths: Paths) -> None:
    for one, other in combinations(paths, 2):
        collision_boxes(one, other, 2.0 * RADIUS_M)


def _plan(environment: Environment, paths: Paths, search: Literal["order", "grid"] = "order") -> Schedule | None:
    """With collisions, and the whole team one network by any links; None where geodesics do not do."""
    try:
        return schedule(paths, RADIUS_M, environment, search=search)
    except NoSchedule:
        return None


def _plan_all(environment: Environment, ways: list[Paths], search: Literal["order", "grid"] = "order") -> None:
    for paths in ways:
        _plan(environment, paths, search)


def _time_plans(environment: Environment, ways: list[Paths], share: float) -> float:
    """The time that such a share of schedules takes no longer than."""
    spent = []
    for paths in ways:
        begin = time.perf_counter()
        _plan(environment, paths)
        spent.append(time.perf_counter() - begin)
    return float(np.quantile(spent, share))
