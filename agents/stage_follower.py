"""Going one's own way in the team's motion, stage by stage, never ahead of the others.

The rule (:mod:`planning.motion_plan`): nobody begins stage n + 2 before all have finished stage n. Here it is kept by
each robot for itself, from what it hears of the others; so at every moment all are within two stages that follow each
other, however late messages come and whoever stands. What is not heard only makes robots wait.

Of what can be begun at all the leader says how much: stage n is begun only if it is *released*. Released stages never
change, so robots that follow different revisions of a plan are still in stages that all of them have in common.

Who has no motion in a stage is where it ends before it begins, and is not waited for.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection

from agents.motion_message import InvalidMotion, check, end_stage, piece
from agents.path_follower import ASTRAY_M, PASSED_M, STANDING, Leg, distance_off
from agents.retreat import MEMORY, Retreat
from protocol.messages import MemberWay, Motion, Point, Progress


class StageFollower:
    """Follows one plan at a time, at full speed, and only as far as it may.

    It knows no time and no orders: :class:`agents.robot.Robot` decides which motions are worth accepting, and when to
    stand.

    Args:
        name: of this robot.
        speed_m_s: the most that it drives, if a motion asks for no less.
    """

    def __init__(self, name: str, speed_m_s: float) -> None:
        self._name = name
        self._speed_m_s = speed_m_s
        self._plan = (-1, -1)
        """Epoch and number of the latest plan accepted."""
        self._motion: Motion | None = None
        self._ways: dict[str, MemberWay] = {}
        self._halted = False
        self._finished = 0
        self._passed = 0
        """Waypoints passed in the stage that is next or under way, without the one at which it begins."""
        self._released = -1
        self._others_finished = 0
        """What the leader says that all have finished."""
        self._heard: dict[str, Progress] = {}
        self._behind: deque[tuple[Point, ...]] = deque(maxlen=MEMORY)
        """Its way through each stage that it has finished in this plan, backwards; the latest first."""
        self.retreat: Retreat | None = None
        """Its way back, once it has turned; until the plan is forgotten."""

    @property
    def progress(self) -> Progress | None:
        """What to tell the others; None without a plan."""
        if self._motion is None:
            return None
        epoch, plan = self._plan
        back = None if self.retreat is None else self.retreat.stage
        return Progress(epoch=epoch, plan=plan, revision=self._motion.revision, finished=self._finished, retreat=back)

    @property
    def arrived(self) -> bool:
        """Whether all stages that it knows of are finished."""
        return self._motion is not None and self.retreat is None and self._finished == end_stage(self._motion)

    @property
    def target(self) -> Point | None:
        """Where its way ends; None without a plan."""
        if self._motion is None:
            return None
        ahead = self._ways[self._name].waypoints if self.retreat is None else self.retreat.ahead
        return ahead[-1] if ahead else None

    def remaining(self, position: Point) -> tuple[Point, ...]:
        """What is left of its way, from ``position`` on; empty if nothing is."""
        if self._motion is None:
            return ()
        if self.retreat is not None:
            return (position, *self.retreat.ahead)
        way = self._ways[self._name]
        ahead = way.waypoints[way.stages[self._finished - self._motion.first_stage] + 1 + self._passed :]
        return (position, *ahead) if ahead else ()

    def has(self, epoch: int, motion: Motion) -> bool:
        """Whether this is what it follows already, in this or an earlier or later repetition."""
        return (
            self._motion is not None
            and self.retreat is None
            and (epoch, motion.plan) == self._plan
            and motion.revision == self._motion.revision
        )

    def halt(self) -> None:
        """Forget the plan: it stands until it accepts a new one, which it may from now on."""
        self._motion, self.retreat, self._halted = None, None, True

    def turn_back(self, still: Collection[str], position: Point, silence_s: float) -> None:
        """Go forward no more in this plan; :attr:`retreat` is the way back. Who is off its way, or has no plan, stays.

        Args:
            still: members of the motion that never move.
            position: where it is.
            silence_s: who is not heard for so long is not there.
        """
        if self._motion is None or self.retreat is not None or self.astray_m(position) > ASTRAY_M:
            return
        way, stage = self._ways[self._name], self._finished - self._motion.first_stage
        passed: tuple[Point, ...] = ()
        if stage < len(way.stages) - 1:
            passed = piece(way, stage)[: self._passed + 1]
        pieces = list(self._behind)
        begun = len(passed) > 1 or (passed and math.dist(position, passed[0]) >= PASSED_M)
        if begun:
            pieces.insert(0, passed[::-1])
        self.retreat = Retreat(
            self._plan,
            {other.member for other in self._motion.ways if other.scheduled} - {self._name, *still},
            stage=self._finished + bool(begun),
            pieces=pieces,
            position=position,
            speed_m_s=min(self._speed_m_s, way.speed_m_s),
            silence_s=silence_s,
        )

    def takes_part(self, motion: Motion) -> bool:
        """Whether a motion has a way for this robot, and others wait for it."""
        return any(way.member == self._name and way.scheduled for way in motion.ways)

    def object_to(self, epoch: int, motion: Motion, position: Point) -> str:
        """Why it cannot accept a motion that it takes part in, here and now; empty if it can.

        Complexity: O(k m) for k ways of m waypoints.
        """
        try:
            check(motion)
        except InvalidMotion as problem:
            return str(problem)
        way = next(way for way in motion.ways if way.member == self._name)
        if self._motion is None or (epoch, motion.plan) != self._plan:
            if objection := self._object_to_plan(epoch, motion):
                return objection
            off_m = math.dist(position, way.waypoints[0])
        else:
            if self.retreat is not None:
                return f"{self._name} has turned back in this plan"
            if objection := self._object_to_revision(self._motion, motion):
                return objection
            stage = self._finished - motion.first_stage
            if self._finished <= self._released:
                off_m = _distance_off(way, stage, self._passed, position)
            else:
                off_m = math.dist(position, way.waypoints[way.stages[stage]])
        return f"it has {self._name} {off_m:.2f} m from where it is" if off_m > ASTRAY_M else ""

    def accept(self, epoch: int, motion: Motion) -> None:
        """Follow a motion from now on to which there is no objection."""
        self._ways = {way.member: way for way in motion.ways}
        if self._motion is None or (epoch, motion.plan) != self._plan:
            self._plan, self._halted = (epoch, motion.plan), False
            self._finished = self._passed = self._others_finished = 0
            self._behind.clear()
            self.retreat = None
            self._released = -1
        self._motion = motion
        self.release(motion)

    def release(self, motion: Motion) -> None:
        """Learn from a repetition of what it follows how far it may go."""
        assert self._motion is not None
        self._released = max(self._released, min(motion.released, end_stage(self._motion) - 1))
        self._others_finished = max(self._others_finished, motion.first_stage)

    def hear(self, member: str, progress: Progress) -> bool:
        """Learn how far another robot is; whether that is news. Within a plan it only gets farther."""
        known = self._heard.get(member)
        news = known is None or _order(progress) > _order(known)
        if news:
            self._heard[member] = progress
        return news

    @property
    def may_go_on(self) -> bool:
        """Whether nobody keeps it from its next stage. O(k) for k members."""
        return self._motion is not None and self.retreat is None and self._may_begin(self._finished)

    def steer(self, position: Point) -> Leg:
        """The leg to drive from here, which does not go beyond the stage that may be under way. O(k) a stage."""
        if self.retreat is not None:
            return STANDING
        while self._motion is not None and not self.arrived and self._may_begin(self._finished):
            way, stage = self._ways[self._name], self._finished - self._motion.first_stage
            ahead = piece(way, stage)[1 + self._passed :]
            if not ahead:
                self._behind.appendleft(piece(way, stage)[::-1])
                self._finished, self._passed = self._finished + 1, 0
                continue
            distance_m = math.dist(position, ahead[0])
            if distance_m >= PASSED_M:
                if self.astray_m(position) > ASTRAY_M:
                    return STANDING
                speed_m_s = min(self._speed_m_s, way.speed_m_s)
                scale = speed_m_s / distance_m
                return Leg(
                    ((ahead[0][0] - position[0]) * scale, (ahead[0][1] - position[1]) * scale), distance_m / speed_m_s
                )
            self._passed += 1
        return STANDING

    def astray_m(self, position: Point) -> float:
        """How far ``position`` is from the piece of way that it is on; 0 without a plan."""
        if self._motion is None:
            return 0.0
        return _distance_off(self._ways[self._name], self._finished - self._motion.first_stage, self._passed, position)

    def waits_for(self) -> tuple[str, ...]:
        """Members that must finish a stage before it goes on; empty if it waits for a release, or not at all."""
        if self._motion is None or self.retreat or self.arrived or self._finished > self._released:
            return ()
        return tuple(name for name in self._ways if self._keeps_back(name, self._finished))

    def _may_begin(self, stage: int) -> bool:
        return stage <= self._released and not any(self._keeps_back(name, stage) for name in self._ways)

    def _keeps_back(self, name: str, stage: int) -> bool:
        """Whether a member has something left to do of the stages before the last one before ``stage``."""
        assert self._motion is not None
        way, first = self._ways[name], self._motion.first_stage
        if name == self._name or not way.scheduled:
            return False
        finished, heard = self._others_finished, self._heard.get(name)
        if heard is not None and (heard.epoch, heard.plan) == self._plan:
            finished = max(finished, heard.finished)
        return any(way.stages[number - first] < way.stages[number - first + 1] for number in range(finished, stage - 1))

    def _object_to_plan(self, epoch: int, motion: Motion) -> str:
        if (epoch, motion.plan) <= self._plan:
            return f"plan {motion.plan} comes after plan {self._plan[1]}, but has no greater number"
        if not (self._halted or self.arrived):
            return f"plan {motion.plan} is new, and {self._name} has not been told to hold before"
        if motion.first_stage > 0:
            return f"plan {motion.plan} is at stage {motion.first_stage}, and {self._name} has not begun it"
        return ""

    def _object_to_revision(self, before: Motion, motion: Motion) -> str:
        if motion.revision < before.revision:
            return f"revision {motion.revision} comes after revision {before.revision}"
        if motion.first_stage > self._finished:
            return f"it begins at stage {motion.first_stage}, and {self._name} has finished {self._finished} stages"
        if end_stage(motion) <= self._released:
            return f"it ends before stage {self._released}, which was released"
        ways = {way.member: way for way in motion.ways if way.scheduled}
        known = {way.member: way for way in before.ways if way.scheduled}
        if ways.keys() != known.keys():
            return f"revision {motion.revision} has other members than revision {before.revision}"
        for stage in range(max(before.first_stage, motion.first_stage), self._released + 1):
            for name, way in ways.items():
                if piece(way, stage - motion.first_stage) != piece(known[name], stage - before.first_stage):
                    return f"it changes stage {stage} of {name}, which was released"
        return ""


def _order(progress: Progress) -> tuple[int, int, int]:
    return progress.epoch, progress.plan, progress.finished


def _distance_off(way: MemberWay, stage: int, passed: int, position: Point) -> float:
    """Of a place from the straight to the next waypoint: of a stage, counted from the first one contained."""
    if stage == len(way.stages) - 1:
        return math.dist(position, way.waypoints[-1])
    place, *ahead = piece(way, stage)[passed:]
    return distance_off(place, ahead[0] if ahead else place, position)
