"""How a team gets from one deployment to the next: the best motion that can be found, and what is true of it.

Ways, in the order in which they are tried, each within bounded effort:

- *direct*: everybody on its geodesic, by a schedule;
- *detour*: some lead around those who stand in the way, along paths of other homotopy classes, or over a place aside
  where one waits for others to pass; by a schedule too (`planning.detour`);
- *stepwise*: one robot at a time over a roadmap, made into stages in which as many go at once as can
  (`planning.stepwise`);
- *bridge*: the same over intermediate deployments (`planning.bridge`);
- *parted*: the connection that is asked for breaks, as briefly as was found (`planning.parting`).

All but the last keep it throughout, whoever is late (see `planning.motion_plan`). Thesis §4.3.5 has the first only, and
names the rest as work to be done (chapter 5).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from planning.attempts import EFFORT, Attempts
from planning.certificate import certify
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from planning.motion_plan import InvalidSchedule, Schedule
from planning.parting import find_parting, prove_parting
from planning.team_task import NOTHING, Level, TeamTask, read_task

if TYPE_CHECKING:
    from planning.placement_graph import PlacementGraph

Way = Literal["direct", "detour", "stepwise", "bridge", "parted"]


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A motion of a team.

    Attributes:
        schedule: what everybody is to do; it starts at 0 s. Members that go as they please are its last ones.
        way: how it was found, see the module.
        arrives: whether everybody gets to its goal.
        reason: why it is not direct, or does not arrive; one sentence.
        between: the two members that part, or that were in each other's way; None if no two are to blame.
        break_s: how long those who should be joined are not, executed at full speed; 0 unless parted.
        length_m: of all paths, metres; those that go as they please left out.
        geodesic_m: of the shortest ways of those who can get to their goals.
        connection: members that are in one network throughout, over any others, whoever is late: ask for these as
            ``ends`` of a certificate. Fewer than two: for nothing.
        proven: of a motion that is parted or does not arrive: whether it is certain that none arrives and keeps the
            connection.
    """

    schedule: Schedule
    way: Way
    arrives: bool
    reason: str
    between: tuple[str, str] | None
    break_s: float
    length_m: float
    geodesic_m: float
    connection: tuple[str, ...]
    proven: bool


def plan_motion(
    env: Environment,
    starts: ArrayLike,
    goals: ArrayLike,
    radius_m: ArrayLike,
    *,
    members: Sequence[str],
    speed_m_s: ArrayLike = 1.0,
    joined: Collection[str] | None = None,
    unscheduled: Mapping[str, ArrayLike] | None = None,
    obstacles: Sequence[tuple[ArrayLike, float]] = (),
    geodesics: GeodesicMap | None = None,
    placements: PlacementGraph | None = None,
    yielding: Collection[str] = (),
    may_part: bool = True,
    effort: int = EFFORT,
) -> Motion:
    """The best motion found from starts to goals.

    Args:
        env: the map as drawn.
        starts: (k, 2) float, metres, map frame.
        goals: (k, 2) float, metres; who starts at its goal stands.
        radius_m: of the discs, one or (k,), metres; 0 for a member without a body, as a base station may be. All who
            move keep as clear of walls as the widest of them has to.
        members: k names.
        speed_m_s: the greatest speeds, one or (k,), finite and positive.
        joined: members that have to be in one network of sight throughout, over any others; None for all, those that
            go as they please too; empty for nobody.
        unscheduled: of members that go as they please, without a body: by name, (m, 2) float, metres, the way on
            which each may be anywhere at any time.
        obstacles: discs that nobody sees by: each a place (2,), or a way (m, 2) anywhere on which it may be, metres,
            and its radius. They are kept clear of as walls are, and are no members of the schedule.
        geodesics: of the map inflated by the radius of those who move. None: made here.
        placements: places to stop at where geodesics do not do. None: chosen here if needed. Give the same map,
            geodesics and placements again and again: what they have in common is made once.
        yielding: members that start at their goals, and may step aside for others and come back.
        may_part: whether the connection may break so that everybody gets to its goal; else the best effort that keeps
            it.
        effort: deployments that each search goes on from, at most.

    Raises:
        InvalidSchedule: names, places, radii or speeds do not fit together.
        NotInFreeSpace: somebody is to set out from where it cannot be.

    Complexity: that of a schedule for the direct way; up to a few times that and O(effort · k² d) besides for d moves
        of a robot at a place.
    """
    task = read_task(env, starts, goals, radius_m, members, speed_m_s, joined, unscheduled or {}, obstacles, geodesics)
    for name in set(yielding) - set(task.members):
        raise InvalidSchedule(f"'{name}' may step aside, but is no member: there are {', '.join(task.members)}")
    attempts = Attempts(task, placements, yielding, effort)
    proof, between = prove_parting(task)
    if not proof:
        for schedule, way in attempts.arrive(task.level):
            reason = f"not by shortest ways alone: {attempts.reason}" if attempts.reason else ""
            return _report(task, schedule, way, task.level, reason, attempts.between)
    if may_part and task.level.asks:
        motion = _part(task, attempts, proof, between)
        if motion.arrives or proof:
            return motion
    schedule = attempts.come_near(task.level)
    kept = task.level if task.keeps(task.starts, task.level) else NOTHING
    return _report(
        task, schedule, "stepwise", kept, f"not all arrive: {proof or attempts.reason}", between or attempts.between,
        proven=bool(proof),
    )  # fmt: skip


def _part(task: TeamTask, attempts: Attempts, proof: str, between: tuple[str, str] | None) -> Motion:
    """The motion with the briefest break."""
    tried = [(schedule, find_parting(task, schedule)) for schedule in _partings(attempts, task)]
    schedule, parting = min(tried, key=lambda found: (found[1].break_s, -found[1].since_s))
    if not proof and certify(schedule, task.environment, links=[], ends=task.level.rows).valid:
        # The searches judge steps by more than a certificate asks for.
        return _report(task, schedule, "stepwise", task.level, attempts.reason, attempts.between)
    reason = f"not possible: {proof}" if proof else f"no connected motion was found: {parting.text}"
    return _report(
        task, schedule, "parted", NOTHING, reason, between or parting.between, parting.break_s, proven=bool(proof)
    )


def _partings(attempts: Attempts, task: TeamTask) -> Iterator[Schedule]:
    arriving = [schedule for schedule, _ in islice(attempts.arrive(NOTHING), 1)]
    patched = attempts.patch(task.level)
    yield from arriving
    if patched is not None:
        yield patched
    elif not arriving:
        yield attempts.come_near(NOTHING)


def _report(
    task: TeamTask,
    schedule: Schedule,
    way: Way,
    level: Level,
    reason: str,
    between: tuple[str, str] | None,
    break_s: float = 0.0,
    *,
    proven: bool = False,
) -> Motion:
    k = len(task.members)
    ends = np.array([path.waypoints[-1] for path in schedule.paths[:k]])
    if task.unreachable:
        lost = f"not possible: there is no way for {task.unreachable[0]} to its goal"
        reason = f"{lost}; {reason}" if reason else lost
    return Motion(
        schedule,
        way,
        not task.unreachable and bool(np.array_equal(ends, task.goals)),
        reason,
        between,
        break_s,
        float(sum(path.length_m for path in schedule.paths[:k])),
        float(task.geodesic_lengths_m.sum()),
        tuple(task.names[row] for row in level.rows),
        proven or (bool(task.unreachable) and task.alike),
    )
