"""Random successive deployments, and how the team gets from each to the next: by several ways, one certificate.

- *at once*: all set off together, each along its geodesic at full speed, as in the thesis' simulations (§4.4.2).
- *hybrid*: the thesis' schedules (§4.3.5): the same geodesics, no collisions, and every link of the tree holds from
  cell to cell. The links are those of the tree before, or of the tree afterwards if these cannot be kept.
- *ours*: `planning.plan_motion`: any links, other paths and intermediate deployments where need be.

Whatever comes out is judged by the certificate: the first two by the clock, as they have no stages.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from launcher.studies.motion_tasks import MotionTask, Question, draw_tasks
from launcher.studies.redeployment_runs import RADIUS_M
from planning import PlacementGraph, certify
from planning.hybrid_schedule import hybrid_schedule
from planning.motion import Motion, plan_motion
from planning.motion_plan import Schedule, TimedPath
from planning.no_schedule import NoSchedule
from planning.placement_sight import CellSight

Floats = NDArray[np.float64]
Links: TypeAlias = tuple[tuple[int, int], ...]

AT_ONCE, HYBRID, OURS = METHODS = ("at once", "hybrid", "ours")

AGENT: Final = 1
"""Its row in tasks."""

SPEED_M_S: Final = 1.0
"""Of all members."""

DRAWN: Final = 100
"""At most so many redeployments are drawn for each that is asked for."""

MOST_NODES: Final = 20_000
"""Of the hybrid's search, after which it gives up."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What one method made of one task.

    Attributes:
        kept: whether a certified motion came out: discs apart and the network whole throughout.
        collided: whether discs overlap at some time.
        broken_s: how long the network is parted; nan where there is no motion to the end.
        planning_s: processor time.
        certifying_s: likewise; nan where there is nothing to certify.
        duration_s: until all are there, nobody late; likewise.
        length_m: what all drive together; likewise.
        way: what ours took, or how the hybrid refused.
    """

    kept: bool
    collided: bool
    broken_s: float
    planning_s: float
    certifying_s: float
    duration_s: float
    length_m: float
    way: str = ""


@dataclass(frozen=True, slots=True)
class MotionAnswer:
    """All outcomes of one task."""

    outcomes: Mapping[str, Outcome]
    fastest_s: float
    """The longest geodesic at full speed."""
    geodesic_m: float
    """All geodesics together."""
    movers: int
    """Members that do not stay where they are."""


class Ground:
    """A map to go about: placements of cells, and which of all its cells see each other.

    Args:
        graph: placements, of cells.
    """

    def __init__(self, graph: PlacementGraph) -> None:
        assert isinstance(graph.sight, CellSight)
        self.graph = graph
        self.cells = graph.sight.cells
        self.seen = csr_array(np.isfinite(graph.sight.all_weights))


@dataclass(frozen=True, slots=True, eq=False)
class Journey:
    """What a task asks of the members that are scheduled: where each is, and the geodesic that it would go."""

    members: tuple[str, ...]
    starts: Floats
    goals: Floats
    paths: tuple[Floats, ...]
    trees: tuple[Links, Links]
    """Who sees whom before and afterwards, by row."""

    @classmethod
    def of(cls, graph: PlacementGraph, task: MotionTask, governed: bool) -> Journey:
        """All of the task's nodes, or all but an agent that is not governed."""
        rows = [row for row in range(len(task.starts)) if governed or row != AGENT]
        place = {row: number for number, row in enumerate(rows)}
        starts, goals = task.starts[rows], task.goals[rows]
        paths = [
            graph.geodesics.path(start, goal) if np.any(start != goal) else start[None]
            for start, goal in zip(starts, goals, strict=True)
        ]
        before, after = (
            tuple((place[u], place[v]) for u, v in tree.tolist() if u in place and v in place)
            for tree in (task.tree, task.next_tree)
        )
        names = ("base", "agent", *(f"robot {number}" for number in range(1, len(task.starts) - 1)))
        return cls(tuple(names[row] for row in rows), starts, goals, tuple(paths), (before, after))

    def go_at_once(self) -> Schedule:
        """All at full speed along their geodesics, from 0 s on."""
        timed = [TimedPath(path, _cover(path) / SPEED_M_S) for path in self.paths]
        return Schedule(self.members, timed, self.radii_m, SPEED_M_S)

    def go_by_hybrid(self, ground: Ground) -> Schedule:
        """The thesis' schedule for the links before, or else for those afterwards.

        Raises:
            NoSchedule: for neither.
        """
        for links in self.trees:
            try:
                return hybrid_schedule(
                    self.paths, self.radii_m, ground.cells, ground.seen, links, members=self.members,
                    speed_m_s=SPEED_M_S, most_nodes=MOST_NODES,
                )  # fmt: skip
            except NoSchedule as problem:
                refusal = problem
        raise refusal

    def plan_ours(self, ground: Ground) -> Motion:
        """By any links and, where need be, other paths than geodesics."""
        return plan_motion(
            ground.graph.environment, self.starts, self.goals, self.radii_m, members=self.members, speed_m_s=SPEED_M_S,
            geodesics=ground.graph.geodesics,
        )  # fmt: skip

    @property
    def radii_m(self) -> Floats:
        """(k,) float, metres; a base station has no body."""
        return np.array([0.0 if name == "base" else RADIUS_M for name in self.members])

    @property
    def is_joined(self) -> bool:
        """Whether links join all members before and afterwards, so that there is something to keep."""
        return all(len(links) == len(self.members) - 1 for links in self.trees)


def find_journeys(ground: Ground, question: Question, number: int, seed: int) -> Iterator[Journey]:
    """Random redeployments; of those in which only an agent that is not governed joins robots others are drawn."""
    tasks = draw_tasks(ground.graph, question, DRAWN * number, seed)
    journeys = (Journey.of(ground.graph, task, question.governed) for task in tasks)
    return islice((journey for journey in journeys if journey.is_joined), number)


def answer_all(ground: Ground, question: Question, number: int, seed: int) -> list[MotionAnswer]:
    """Draw some redeployments and plan the motion of each by every method."""
    journeys = list(find_journeys(ground, question, number, seed))
    answer(ground, journeys[0])  # caches are cold
    return [answer(ground, journey) for journey in journeys]


def answer(ground: Ground, journey: Journey) -> MotionAnswer:
    """Plan one motion by every method, and judge what comes out."""
    lengths = np.array([_cover(path)[-1] for path in journey.paths])

    def plan_hybrid() -> tuple[Schedule | None, str]:
        try:
            return journey.go_by_hybrid(ground), ""
        except NoSchedule as refusal:
            return None, "proven" if refusal.proven else "given up"

    def plan_ours() -> tuple[Schedule | None, str]:
        motion = journey.plan_ours(ground)
        return motion.schedule, motion.way

    plans: dict[str, Callable[[], tuple[Schedule | None, str]]] = {
        AT_ONCE: lambda: (journey.go_at_once(), ""),
        HYBRID: plan_hybrid,
        OURS: plan_ours,
    }
    outcomes = {}
    for method, plan in plans.items():
        begin = time.thread_time()
        schedule, way = plan()
        spent = time.thread_time() - begin
        outcomes[method] = _judge(ground, schedule, way, spent)
    return MotionAnswer(outcomes, float(lengths.max()) / SPEED_M_S, float(lengths.sum()), int(np.sum(lengths > 0.0)))


def _judge(ground: Ground, schedule: Schedule | None, way: str, planning_s: float) -> Outcome:
    if schedule is None:
        return Outcome(False, False, np.nan, planning_s, np.nan, np.nan, np.nan, way)
    begin = time.thread_time()
    found = certify(schedule, ground.graph.environment).violations
    certifying_s = time.thread_time() - begin
    return Outcome(
        not found,
        any(one.kind == "collision" for one in found),
        sum(min(one.until_s, schedule.end_s) - one.time_s for one in found if one.kind == "connection"),
        planning_s,
        certifying_s,
        schedule.end_s - schedule.start_s,
        sum(path.length_m for path in schedule.paths),
        way,
    )


def _cover(path: Floats) -> Floats:
    """Metres of path up to each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
