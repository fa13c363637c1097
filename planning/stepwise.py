"""The team moves one robot at a time over a roadmap, and never disconnects: what is left when no schedule is found.

`planning.move_search` finds the moves, `planning.runs` makes them short and lets robots go at once that can.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from planning.environment import Environment
from planning.geodesic import GeodesicMap
from planning.move_search import Crew, Moves, search_moves
from planning.placement_points import choose_points, choose_spacing
from planning.runs import Run, make_runs
from planning.team_roadmap import TeamRoadmap, extend_roadmap, find_mitres, make_roadmap, ring
from planning.team_task import Level, TeamTask

if TYPE_CHECKING:
    from planning.placement_graph import PlacementGraph

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


CROWDED: Final = 1.0
"""Places around discs are no nearer to others than this share of a mover's radius."""


class Steps:
    """The moves of one team on one roadmap.

    Args:
        task: who is to go where.
        movers: rows of those who may move; those of them that start at their goals come back.
        placements: places to stop at; None: some are chosen.

    Complexity: O(N² w) for N placements and w walls the first time, then O(k N w).
    """

    def __init__(self, task: TeamTask, movers: Sequence[int], placements: PlacementGraph | None) -> None:
        self._task, self.movers = task, list(movers)
        self._rows = [*movers, *(row for row in range(len(task.members)) if row not in movers)]
        common = _join_placements(task.environment, task.geodesics, placements, float(task.radii_m[self.movers].max()))
        ends = np.concatenate([task.starts[self._rows], task.goals[self.movers]])
        new, numbers = _number(ends, common.places)
        self.roadmap: TeamRoadmap = extend_roadmap(common, task.free, np.concatenate([new, self._rings(new)]))
        self._standing: Ints = numbers[len(movers) : len(self._rows)]
        self.starts: Ints = numbers[: len(movers)]
        """(m,) int: where the movers are, on the roadmap."""
        self.goals: Ints = numbers[len(self._rows) :]
        """(m,) int: where they go."""

    def _rings(self, kept: Floats) -> Floats:
        """Places (n, 2) around all discs at their starts and goals, none near to another or to those kept."""
        task = self._task
        widest = float(task.radii_m[self.movers].max())
        near = task.environment.tolerance_m + CROWDED * widest
        first = len(kept)
        for i in self._rows:
            for place in (task.starts[i], task.goals[i]) if task.radii_m[i] > 0.0 else ():
                for spot in ring(place, widest + float(task.radii_m[i]), task.free):
                    if np.hypot(*(kept - spot).T).min(initial=np.inf) > near:
                        kept = np.concatenate([kept, spot[None]])
        return kept[first:]

    def search(self, start: Ints, goal: Ints, level: Level, effort: int) -> Moves:
        """Moves from one deployment of the movers to another, both (m,) int."""
        paths = list(self._task.unscheduled.values())
        numbers = {row: number for number, row in enumerate(self._rows)}
        joined = [numbers.get(row, row) for row in level.rows]
        crew = Crew(np.concatenate([start, self._standing]), self._task.radii_m[self._rows], joined, paths)
        return search_moves(self.roadmap, crew, goal, effort)

    def hub(self) -> int:
        """The place on the roadmap that all can draw together at with the shortest ways, from starts and goals."""
        ends = np.concatenate([self.starts, self.goals])
        ways = self.roadmap.lengths_to([*ends.tolist(), *self._standing.tolist()])
        # Whoever stands outside of the movers' free space is on no way.
        return int(np.argmin(ways[np.isfinite(ways).sum(axis=1) > 1].sum(axis=0)))

    def deployment(self, places: Ints) -> Floats:
        """Where all members are with the movers at places (m,): (k, 2) float, metres."""
        everybody = self._task.starts.copy()
        everybody[self.movers] = self.roadmap.places[places]
        return everybody

    def runs(self, places: Ints) -> list[Run]:
        """The ways of the movers through deployments (n, m) int."""
        return make_runs(self.movers, self.roadmap.places[places])


@lru_cache(maxsize=4)
def _join_placements(
    environment: Environment, geodesics: GeodesicMap, placements: PlacementGraph | None, radius_m: float
) -> TeamRoadmap:
    """What all tasks on one map have in common."""
    free = geodesics.environment
    if placements is None:
        # Places nearer to each other than two discs are of little use, and many.
        places, _ = choose_points(environment, free, max(choose_spacing(environment, free), 2.0 * radius_m))
    else:
        places = placements.positions[free.contains(placements.positions)]
    return make_roadmap(environment, free, np.concatenate([places, find_mitres(environment, free, radius_m)]))


def _number(places: Floats, known: Floats) -> tuple[Floats, Ints]:
    """Places (n, 2) that are not among those known, each once, and the numbers of all when they are put after these."""
    new: list[Floats] = []
    numbers = []
    for place in places:
        same = np.flatnonzero(np.all(np.concatenate([known, np.reshape(new, (-1, 2))]) == place, axis=1))
        numbers.append(int(same[0]) if len(same) else len(known) + len(new))
        if not len(same):
            new.append(place)
    return np.reshape(new, (-1, 2)), np.array(numbers, dtype=np.int64)
