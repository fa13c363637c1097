"""What is tried, one after the other, so that a team arrives and keeps a level of connection."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
from numpy.typing import NDArray

from planning.bridge import cross_bridge
from planning.continuation import follow
from planning.detour import (
    blocked_by_standing,
    other_paths,
    path_over_outermost,
    paths_around,
    shortest_paths,
    space_around_standing,
)
from planning.geodesic import GeodesicMap
from planning.motion_plan import Schedule
from planning.move_search import Moves
from planning.no_schedule import NoSchedule
from planning.runs import shorten_runs, stage_runs
from planning.stepwise import Steps
from planning.team_task import NOTHING, Level, TeamTask

if TYPE_CHECKING:
    from planning.placement_graph import PlacementGraph

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
ArrivingWay = Literal["direct", "detour", "stepwise", "bridge"]

EFFORT: Final = 2000
"""Deployments that a search goes on from, at most."""

OTHER_SCHEDULES: Final = 2
"""So many schedules are tried on paths of other classes."""


WORTHWHILE: Final = 0.2
"""Share of all detours: who makes so much of them is asked to make one alone."""


class Attempts:
    """All attempts at one task.

    Args:
        task: who is to go where.
        placements: places to stop at; None: some are chosen if needed.
        yielding: names of those that start at their goals and may step aside.
        effort: deployments that each search goes on from, at most.

    Attributes:
        reason: why the first attempt failed; empty if it did not.
        between: whom it failed by; None if no two are to blame.
    """

    def __init__(
        self, task: TeamTask, placements: PlacementGraph | None, yielding: Collection[str], effort: int
    ) -> None:
        self._task, self._placements, self._effort = task, placements, effort
        self._yielding = [row for row in task.standing if task.members[row] in yielding]
        self._found: dict[tuple[Steps, tuple[int, ...]], Moves] = {}
        self.reason = ""
        self.between: tuple[str, str] | None = None

    def arrive(self, level: Level) -> Iterator[tuple[Schedule, ArrivingWay]]:
        """Motions to the goals that keep a level of connection, each looked for when it is asked for."""
        task = self._task
        if not task.movers:
            yield self._stand(), "direct"
            return
        for paths, way in self._paths():
            try:
                yield task.schedule(paths, level), way
            except NoSchedule as problem:
                self._blame(problem.text, problem.between)
        for steps in self._crews():
            moves = self._search(steps, level)
            staged = self._stage(steps, moves.places, level) if moves.complete else None
            if staged is not None:
                yield from self._ease(staged, level)
                yield staged, "stepwise"
        for steps in self._crews():
            places = cross_bridge(steps, level, self._effort)
            staged = None if places is None else self._stage(steps, places, level)
            if staged is not None:
                yield staged, "bridge"

    def come_near(self, level: Level) -> Schedule:
        """A motion that keeps a level of connection, and brings the team as near to its goals as was found."""
        task = self._task
        if not task.movers or not task.keeps(task.starts, level):
            return self._stand()
        steps = self._crew
        return self._stage(steps, self._search(steps, level).places, level) or self._stand()

    def patch(self, level: Level) -> Schedule | None:
        """Connected as far as the team gets from its start, and again as soon as it can be before the goals."""
        task = self._task
        if not task.movers:
            return None
        steps = self._crew
        there, back = steps.starts[None], steps.goals[None]
        if task.keeps(task.starts, level):
            there = self._search(steps, level).places
        if task.keeps(task.goals, level):
            back = steps.search(steps.goals, there[-1], level, self._effort).places[::-1]
        between = steps.search(there[-1], back[0], NOTHING, self._effort)
        if not between.complete:
            return None
        whole = self._stand()
        for places, kept in ((there, level), (between.places, NOTHING), (back, level)):
            part = self._stage(steps, places, kept)
            if part is None:
                return None
            whole = follow(whole, part)
        return whole

    def _paths(self) -> Iterator[tuple[list[Floats], ArrivingWay]]:
        """Paths worth a schedule."""
        task = self._task
        paths = shortest_paths(task)
        blocked = blocked_by_standing(task, paths)
        if blocked:
            mover, stander = (task.members[row] for row in blocked[0])
            self._blame(f"{stander} stands in the way of {mover}", (mover, stander))
            paths = paths_around(task, paths, [row for row, _ in blocked], self._space)
            if blocked_by_standing(task, paths):
                return
        yield paths, "detour" if blocked else "direct"
        rows = [task.names.index(name) for name in self.between or ()]
        if rows:
            for others in islice(other_paths(task, paths, rows, self._space), OTHER_SCHEDULES):
                yield others, "detour"

    def _ease(self, staged: Schedule, level: Level) -> Iterator[tuple[Schedule, ArrivingWay]]:
        """A schedule in which one waits aside where it does in this one, and all others go their shortest ways."""
        task = self._task
        extra = [path.length_m - length for path, length in zip(staged.paths, task.geodesic_lengths_m, strict=False)]
        for row in sorted(task.movers, key=lambda row: -extra[row])[:OTHER_SCHEDULES]:
            if extra[row] < WORTHWHILE * sum(extra):
                return
            paths = shortest_paths(task)
            paths[row] = path_over_outermost(task, row, staged.paths[row].waypoints)
            try:
                yield task.schedule(paths, level), "detour"
            except NoSchedule:
                continue

    def _blame(self, reason: str, between: tuple[str, str] | None) -> None:
        if not self.reason:
            self.reason, self.between = reason, between

    def _crews(self) -> Iterator[Steps]:
        """Those who have to move; then with those who may step aside."""
        yield self._crew
        if self._yielding:
            yield self._larger_crew

    @cached_property
    def _space(self) -> GeodesicMap:
        return space_around_standing(self._task)

    @cached_property
    def _crew(self) -> Steps:
        return Steps(self._task, self._task.movers, self._placements)

    @cached_property
    def _larger_crew(self) -> Steps:
        return Steps(self._task, [*self._task.movers, *self._yielding], self._placements)

    def _search(self, steps: Steps, level: Level) -> Moves:
        """Moves from the start to the goals, or as near as was found; looked for once."""
        key = steps, level.rows
        if key not in self._found:
            self._found[key] = steps.search(steps.starts, steps.goals, level, self._effort)
        return self._found[key]

    def _stage(self, steps: Steps, places: Ints, level: Level) -> Schedule | None:
        """Deployments (n, m) made into stages; None if a run is not allowed after all."""
        task = self._task.starting_at(steps.deployment(places[0]))
        return stage_runs(task, level, shorten_runs(task, level, steps.runs(places)))

    def _stand(self) -> Schedule:
        standing = stage_runs(self._task, NOTHING, [])
        assert standing is not None  # where nobody moves no run can be refused
        return standing
