"""What the leader has allowed the team to do: how far everybody may go, and how far everybody has come.

Like a railway's movement authority: robots go no farther than has been released, whatever becomes of the leader.

- A motion is in stages; nobody begins stage n + 2 before all have finished stage n (:mod:`planning.motion_plan`).
  Stages keep their numbers for as long as the plan lasts.
- What has been released is never changed. A *revision* keeps it and puts other stages behind it, planned from the
  places where the released stages end; so robots that have not heard of it are merely late.
- Of a revision nothing is released before every robot has said that it accepts it. So one that refuses breaks nothing:
  all keep to what they have accepted before, and stand where that ends.

*Finished* counts stages from 0 on, as in :class:`protocol.messages.Progress`.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice, pairwise, takewhile

from msgspec import structs

from agents.motion_message import end_stage, piece
from agents.records import Advance
from agents.retreat import MEMORY
from protocol.messages import MemberWay, Motion, Point, Progress

SAME_PLACE_M = 1e-9
"""Between where what is kept ends and where the next motion begins."""

REMEMBERED = 4 * MEMORY
"""Waypoints of each robot's way back; a stage has some four at most, mostly none or one."""


class Discontinuity(ValueError):
    """A motion that does not begin where the one before ends; the text says who."""


@dataclass(frozen=True)
class Onset:
    """Where a new motion begins."""

    plan: int
    revision: int
    """Of the new motion."""
    first_stage: int
    """Number of the first stage of ``kept``, or of the new motion."""
    places: Mapping[str, Point]
    """Of everybody that is scheduled."""
    kept: Motion | None = None
    """What goes on before: released, and not finished by all."""

    def continued(self, motion: Motion) -> Motion:
        """What is kept, and then a motion that begins at ``places``, with the numbers of the onset.

        Between them is a stage in which nobody moves, so that no two stages meet that were not planned together. Who is
        unscheduled goes as in ``motion``, and so does what is certified of lines of sight.

        Raises:
            Discontinuity: it begins elsewhere, or is of other members.
        """
        ways = {way.member: way for way in motion.ways}
        for way in motion.ways:
            if way.scheduled and (
                way.member not in self.places or math.dist(way.waypoints[0], self.places[way.member]) > SAME_PLACE_M
            ):
                raise Discontinuity(f"the motion has {way.member} at {way.waypoints[0]}, and it is elsewhere")
        if self.kept is not None:
            before = {way.member: way for way in self.kept.ways if way.scheduled}
            stages = end_stage(self.kept) - self.kept.first_stage
            ways = {
                name: _join(before[name], way) if way.scheduled else _stretch(way, stages + 1)
                for name, way in ways.items()
            }
        return structs.replace(
            motion, plan=self.plan, revision=self.revision, first_stage=self.first_stage,
            released=self.first_stage - 1, ways=tuple(ways.values()),
        )  # fmt: skip


class MovementAuthority:
    """The account of one plan, from a standstill on.

    Args:
        epoch: of the authority in whose name the plan is given.
        motion: it starts where everybody stands, at stage 0; nothing is released.
        robots: the scheduled members that report; all other scheduled members stand all the time.
    """

    def __init__(self, epoch: int, motion: Motion, robots: Collection[str]) -> None:
        self.epoch, self.robots = epoch, tuple(sorted(robots))
        self._settled = -1
        """The last stage that no revision under discussion changes."""
        self._finished = dict.fromkeys(self.robots, 0)
        self._accepted = dict.fromkeys(self.robots, -1)
        self._behind = {robot: deque[Point](maxlen=REMEMBERED) for robot in self.robots}
        """Waypoints of the stages that are not in the motion any more."""
        self._take(motion)

    def _take(self, motion: Motion) -> None:
        self.motion = motion
        self._takes_s = [_durations(way) for way in motion.ways if way.scheduled]

    @property
    def released(self) -> int:
        """Number of the last stage that may be begun."""
        return self.motion.released

    @property
    def finished(self) -> int:
        """Stages that all have finished."""
        return min(self._finished.values(), default=self.released + 1)

    @property
    def over(self) -> bool:
        """Whether everybody has come to the end."""
        return self.finished >= end_stage(self.motion)

    @property
    def undecided(self) -> tuple[str, ...]:
        """Robots that have not said that they accept the present revision."""
        return tuple(robot for robot, revision in self._accepted.items() if revision < self.motion.revision)

    def hear(self, robot: str, progress: Progress) -> bool:
        """Note what a robot reports; whether it is news. Late, duplicated and foreign reports change nothing."""
        if robot not in self._finished or (progress.epoch, progress.plan) != (self.epoch, self.motion.plan):
            return False
        before = self._accepted[robot], self._finished[robot]
        self._accepted[robot] = max(before[0], min(progress.revision, self.motion.revision))
        self._finished[robot] = max(before[1], min(progress.finished, self.released + 1))
        return before != (self._accepted[robot], self._finished[robot])

    def release(self, horizon_s: float) -> bool:
        """Release the stages that begin, at full speed, within so long after the one that the slowest robot is in.

        Returns:
            Whether these are more than before.

        Complexity: O(k n) for k members and n stages.
        """
        begun = sum(1 for _ in takewhile(lambda times_s: times_s[0] <= horizon_s, self._clock()))
        soon = self.finished + begun - 1
        released = min(soon, self._settled if self.undecided else end_stage(self.motion) - 1)
        if released <= self.released:
            return False
        self.motion = structs.replace(self.motion, released=released)
        return True

    def lead_s(self) -> float:
        """What the released stages take at full speed, from the beginning of that which the slowest robot is in."""
        stages = self.released + 1 - self.finished
        return max((end_s for _, end_s in islice(self._clock(), stages)), default=0.0)

    def onset(self) -> Onset:
        """Where a revision begins if nothing more is released before it is there."""
        end, first = self.released + 1 - self.motion.first_stage, self.finished
        places = {way.member: way.waypoints[way.stages[end]] for way in self.motion.ways if way.scheduled}
        kept = _cut(self.motion, first, self.released) if first <= self.released else None
        return Onset(self.motion.plan, self.motion.revision + 1, first, places, kept)

    def revise(self, motion: Motion) -> None:
        """Put other stages behind what has been released: a continued motion of the onset, nothing released since."""
        self._settled = self.released
        self._remember(motion.first_stage)
        self._take(structs.replace(motion, released=self.released))

    def prune(self) -> None:
        """Forget the stages that all have finished, but the last one."""
        first = min(self.finished, end_stage(self.motion) - 1)
        if first > self.motion.first_stage:
            self._remember(first)
            self._take(_cut(self.motion, first, end_stage(self.motion) - 1))

    def advance(self) -> Advance:
        """How far everybody is."""
        motion = self.motion
        return Advance(
            epoch=self.epoch, plan=motion.plan, revision=motion.revision, released=motion.released,
            finished=dict(self._finished),
        )  # fmt: skip

    def way(self, robot: str) -> tuple[Point, ...]:
        """Where a robot may be of which no more is heard: its stage and all that are released."""
        way = next(way for way in self.motion.ways if way.member == robot)
        end = self.released + 1 - self.motion.first_stage
        first = min(max(self._finished[robot] - self.motion.first_stage, 0), end)
        return way.waypoints[way.stages[first] : way.stages[end] + 1]

    def way_back(self, robot: str) -> tuple[Point, ...]:
        """Where else it may be if all have turned back (:mod:`agents.retreat`): the plan's way up to its stage."""
        way = next(way for way in self.motion.ways if way.member == robot)
        stage = min(max(self._finished[robot] - self.motion.first_stage, 0), len(way.stages) - 1)
        return (*self._behind[robot], *way.waypoints[: way.stages[stage] + 1])

    def _remember(self, first: int) -> None:
        """Keep, of the stages before ``first``, where robots have been."""
        for way in self.motion.ways:
            if way.member in self._behind:
                self._behind[way.member] += way.waypoints[: way.stages[first - self.motion.first_stage]]

    def _clock(self) -> Iterator[tuple[float, float]]:
        """When each stage begins and ends at full speed, seconds from when that of the slowest robot begins.

        A stage begins when the first begins it that moves in it.
        """
        first = self.finished - self.motion.first_stage
        ready_s = [0.0] * len(self._takes_s)
        ended_s = before_s = 0.0
        """When the last stage ends, and the one before it."""
        for stage in range(end_stage(self.motion) - self.finished):
            begins_s = [max(time_s, before_s) for time_s in ready_s]
            moving_s = [
                begin_s for begin_s, own in zip(begins_s, self._takes_s, strict=True) if own[first + stage] > 0.0
            ]
            ready_s = [
                begin_s + takes_s[first + stage] for begin_s, takes_s in zip(begins_s, self._takes_s, strict=True)
            ]
            before_s, ended_s = ended_s, max(ready_s)
            yield min(moving_s or begins_s), ended_s


def _durations(way: MemberWay) -> list[float]:
    """What each stage takes at full speed, seconds."""
    lengths_m = [sum(math.dist(p, q) for p, q in pairwise(piece(way, stage))) for stage in range(len(way.stages) - 1)]
    return [length_m / way.speed_m_s if length_m > 0.0 else 0.0 for length_m in lengths_m]


def _cut(motion: Motion, first: int, last: int) -> Motion:
    """The stages from one number to another. Who is unscheduled keeps its whole way."""
    begin, end = first - motion.first_stage, last + 1 - motion.first_stage
    ways = []
    for way in motion.ways:
        marks = way.stages[begin : end + 1]
        if way.scheduled:
            ways.append(
                structs.replace(
                    way,
                    waypoints=way.waypoints[marks[0] : marks[-1] + 1],
                    stages=tuple(mark - marks[0] for mark in marks),
                )
            )
        else:
            ways.append(structs.replace(way, stages=(0, *[len(way.waypoints) - 1] * (end - begin))))
    return structs.replace(motion, first_stage=first, ways=tuple(ways))


def _join(before: MemberWay, after: MemberWay) -> MemberWay:
    """One way after the other, and a stop between."""
    last = before.stages[-1]
    return structs.replace(
        after,
        waypoints=(*before.waypoints, *after.waypoints[1:]),
        stages=(*before.stages, *(last + mark for mark in after.stages)),
    )


def _stretch(way: MemberWay, stages: int) -> MemberWay:
    """An unscheduled member's way in so many more stages."""
    return structs.replace(way, stages=(*way.stages, *[way.stages[-1]] * stages))
