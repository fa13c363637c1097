"""A robot: goes its way in the team's motion, says where it is and how far, and stands when nobody leads.

==========  ====================================================================
waiting     has heard no order yet
moving      on its way, in a stage that it may be in
yielding    stands on its way until others are farther, or more is released
arrived     stands where its way ends
holding     was told to, or obeys nobody any more, or cannot follow its orders
retreating  goes back the way that it has come, with all others of its motion
==========  ====================================================================

Standing is safe wherever it is, so whatever is amiss makes it stand, or end what it has accepted before. Only when
nobody has led for long do robots go back (:mod:`agents.retreat`): nearer to where more of the team may be heard.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise
from typing import Final, Literal, Protocol

from msgspec import structs

from agents.allegiance import AT_ONCE_S, Allegiance
from agents.certificate_judge import Judge
from agents.driver import patience_s
from agents.mission import Mission
from agents.path_follower import ASTRAY_M, STANDING, Leg, distance_off
from agents.records import LogLine
from agents.rhythm import EARLY_S
from agents.role import Compute, Drive, Effect, Event, Heard, JobDone, Record, Woken
from agents.self_report import SelfReport
from agents.stage_follower import StageFollower
from agents.standing_orders import StandingOrders
from protocol.messages import Deployment, Mode, Motion, Point, Reign, State

CERTIFICATE: Final = "certificate"
"""Name of the job that judges a motion."""

LONG_S: Final = 2.0
"""Whoever yields for longer says to whom."""

SILENCE_S: Final = 1.0
"""Robots go back only with those that they have heard within so long, or …"""

SILENT_STATES: Final = 5
"""… within so many states, if that is longer."""


class Others(Protocol):
    """What is known of other robots."""

    def heard_at(self, robot: str) -> Point | None:
        """Where it has said last that it is; None: it has not been heard."""


class Robot:
    """Obeys the deployments of whoever leads, for as long as it is led: a part of the robot's mind.

    A motion is accepted when the robot has judged it; until then, and if it is refused, the robot goes on with the
    motion that it has accepted before. When nobody is obeyed it stands at once and keeps what it has accepted: the same
    leader may go on with it. A motion of another leader begins afresh.

    Args:
        mission: rates and speeds.
        name: of this robot.
        judge: says what is wrong with a motion (:func:`agents.certificate_judge.certificate_judge`).
        allegiance: says until when orders are in force.
        orders: those of the leader, this robot or another.
        others: where they have said that they are.
        now_s: the present time.
    """

    hears = frozenset({"state"})

    def __init__(
        self,
        mission: Mission,
        name: str,
        judge: Judge,
        allegiance: Allegiance,
        orders: StandingOrders,
        others: Others,
        now_s: float,
    ) -> None:
        self.state: State | None = None
        """What it has said of itself last, or would say."""
        self._name = name
        self._judge = judge
        self._allegiance, self._standing, self._others = allegiance, orders, others
        self._starts = {robot.name: robot.start for robot in mission.robots if robot.name != name}
        self._apart_m = 2.0 * mission.robot_radius_m
        self._follower = StageFollower(name, mission.robot_speed_m_s)
        self._patience_s = patience_s(mission.control_hz)
        self._retreat_after_s = mission.retreat_after_s
        self._silence_s = max(SILENCE_S, SILENT_STATES / mission.control_hz)
        self._still = (mission.base_station.name,)
        """Members of motions that never move."""
        self._without: tuple[str, ...] | None = None
        """Who kept it from going back when that was said last."""
        self._report = SelfReport(mission, "robot", mission.robot_radius_m, now_s)
        self._wake_s = now_s
        self._mode: Mode = "waiting"
        self._obeys = False
        """Whether it did, and had orders that it follows, when that was looked at last."""
        self._orders: Deployment | None = None
        """Taken last, in force or not."""
        self._followed: Reign | None = None
        """Who was obeyed last when that was looked at."""
        self._judging: tuple[int, Motion] | None = None
        """Epoch and motion that the job is about."""
        self._judged: tuple[int, Motion, str] | None = None
        """The motion judged last, and what is wrong with it."""
        self._refusing = ""
        self._refused: tuple[int, int, int] | None = None
        """Epoch, plan and revision that have been refused in the log."""
        self._yields_since_s = 0.0
        self._said: object = None
        """What the others are told at once when it changes, as they know it."""
        self._leg: Leg = STANDING
        self._effects: list[Effect] = []

    @property
    def next_s(self) -> float:
        """When something is due; at once if orders tell it anything new, or there is another leader."""
        followed = self._allegiance.followed
        if followed is not self._followed and followed != self._followed:
            return AT_ONCE_S
        latest = self._standing.latest
        if latest is not self._orders:
            moves = self._leg is not STANDING
            if not self._obeys or _task(latest, moves=moves) != _task(self._orders, moves=moves):
                return AT_ONCE_S
        if not self._obeys:
            return self._wake_s
        until_s = self._allegiance.obeyed_until_s
        return until_s if until_s < self._wake_s else self._wake_s

    def handle(self, event: Event, now_s: float) -> Iterable[Effect]:
        """Hear of the others' progress; decide and move when woken."""
        match event:
            case Woken(position):
                if now_s >= self.next_s - EARLY_S:
                    return self._live(now_s, position)
            case Heard(_, envelope) if isinstance(envelope.body, State):
                progress = envelope.body.progress
                if self._follower.retreat is not None:
                    self._follower.retreat.hear(envelope.sender, progress, now_s)
                news = progress is not None and self._follower.hear(envelope.sender, progress)
                if news and self._mode == "yielding" and self._follower.may_go_on:
                    self._wake_s = now_s
            case JobDone(job=name) if name == CERTIFICATE:
                self._take_verdict(event)
                self._wake_s = now_s
            case _:
                pass
        return ()

    def _take_verdict(self, done: JobDone) -> None:
        if self._judging is not None:
            wrong = f"it could not be certified: {done.failure}" if done.failure else str(done.result)
            self._judged, self._judging = (*self._judging, wrong), None

    def _live(self, now_s: float, position: Point) -> list[Effect]:
        self._orders, self._followed = self._standing.latest, self._allegiance.followed
        obeys = self._obeys = self._obey(now_s, position)
        obeyed_s = self._allegiance.obeyed_until_s - now_s
        if obeys:
            self._leg = self._follower.steer(position)
            # However long this mind may hang after it has said so: the body stands when nobody is obeyed any more.
            drives_s = min(self._patience_s, max(0.0, obeyed_s))
        else:
            self._leg = self._go_back(now_s, position) if -obeyed_s >= self._retreat_after_s else STANDING
            drives_s = self._patience_s
        self._settle_mode(obeys, now_s)
        drives_s = min(self._leg.lasts_s, drives_s)
        self._effects.append(Drive(self._leg.velocity, drives_s))
        self.state = State(
            position=position,
            velocity=self._leg.velocity,
            mode=self._mode,
            target=self._follower.target,
            path=self._follower.remaining(position),
            obeying=self._orders.authority if self._orders is not None else None,
            progress=self._follower.progress,
            refusing=self._refusing,
        )
        epoch = None if self._orders is None else self._orders.authority.epoch
        news = (self.state.progress, self.state.refusing, self.state.mode == "holding", epoch)
        self._effects += self._report.due(now_s, self.state, urgent=news != self._said)
        self._said = news
        self._wake_s = self._report.next_s
        if drives_s > 0.0:
            self._wake_s = min(self._wake_s, now_s + drives_s)
        effects, self._effects = self._effects, []
        return effects

    def _obey(self, now_s: float, position: Point) -> bool:
        """Make the orders one's own as far as they can be followed; whether there is something of theirs to follow."""
        orders = self._standing.in_force(now_s)
        if orders is None:
            return False
        self._refusing = ""
        if orders.motion is None:
            self._halt(f"decision {orders.decision}: told to hold")
        elif not self._follower.takes_part(orders.motion):
            self._halt(f"decision {orders.decision} has no way for {self._name}: holding")
        else:
            self._consider(orders.authority.epoch, orders.motion, position)
        progress = self._follower.progress
        return progress is not None and progress.epoch == orders.authority.epoch

    def _go_back(self, now_s: float, position: Point) -> Leg:
        """The leg to drive when nobody has been obeyed for long."""
        if self._follower.retreat is None:
            self._without = None
            self._follower.turn_back(self._still, position, self._silence_s)
        retreat = self._follower.retreat
        if retreat is None:
            return STANDING
        leg, missing = retreat.steer(position, now_s), retreat.missing(now_s)
        if missing != self._without:
            self._without = missing
            if not retreat.others:
                does = "holds, as there is nobody to go back with"
            elif missing:
                does = f"would go back, and stands until {', '.join(missing)} would too"
            else:
                does = f"goes back together with {', '.join(retreat.others)}"
            self._log("warning", f"nobody has led for {self._retreat_after_s:g} s: {does}")
        return leg

    def _halt(self, why: str) -> None:
        if self._follower.progress is not None:
            self._log("info", why)
        self._follower.halt()

    def _consider(self, epoch: int, motion: Motion, position: Point) -> None:
        """Accept the motion ordered, refuse it, or have it judged."""
        self._accept_judged(epoch, motion, position)
        if self._follower.has(epoch, motion):
            self._follower.release(motion)
            if (off_m := self._follower.astray_m(position)) > ASTRAY_M:
                self._refuse(epoch, motion, f"{self._name} is {off_m:.2f} m off its way")
            return
        objection = (
            self._follower.object_to(epoch, motion, position)
            or self._object_to_strays(motion)
            or self._verdict(epoch, motion)
        )
        if objection:
            self._refuse(epoch, motion, objection)
        elif self._judging is None:
            self._judging = (epoch, motion)
            # What has been released does not matter to the judge, who remembers what was asked before.
            asked = structs.replace(motion, released=motion.first_stage - 1)
            self._effects.append(Compute(CERTIFICATE, self._judge, (asked,)))

    def _object_to_strays(self, motion: Motion) -> str:
        """Why its way is not free, by what this robot has heard and a leader whose process began anew has not.

        Such a leader takes a robot that is not there to be where it started, and it may have died elsewhere.
        """
        ways = {way.member: way for way in motion.ways}
        for robot, start in self._starts.items():
            known = ways.get(robot)
            place = self._others.heard_at(robot)
            if place is None or (known is not None and (known.scheduled or set(known.waypoints) != {start})):
                continue
            if any(distance_off(a, b, place) < self._apart_m for a, b in pairwise(ways[self._name].waypoints)):
                return f"{robot} is not at its start, but was heard at ({place[0]:.2f}, {place[1]:.2f}), in the way"
        return ""

    def _accept_judged(self, epoch: int, motion: Motion, position: Point) -> None:
        """Follow what was judged well, if it is still of the plan ordered; a later revision is accepted after it."""
        if self._judged is None:
            return
        judged_epoch, judged, wrong = self._judged
        if wrong or (judged_epoch, judged.plan) != (epoch, motion.plan) or self._follower.has(epoch, judged):
            return
        if self._follower.object_to(epoch, judged, position):
            return
        before = self._follower.progress
        self._follower.accept(epoch, judged)
        if before is None or (before.epoch, before.plan) != (epoch, judged.plan):
            x, y = self._follower.target or position
            self._log("info", f"accepts plan {judged.plan}, and goes to ({x:.2f}, {y:.2f})")

    def _verdict(self, epoch: int, motion: Motion) -> str:
        """What is wrong with a motion that has been judged; empty if nothing is, or it has not been."""
        if self._judged is None:
            return ""
        judged_epoch, judged, wrong = self._judged
        return wrong if _key(judged_epoch, judged) == _key(epoch, motion) else ""

    def _refuse(self, epoch: int, motion: Motion, why: str) -> None:
        """Say why to the leader, and once in the log."""
        self._refusing = why[:500]
        if _key(epoch, motion) != self._refused:
            self._refused = _key(epoch, motion)
            self._log("warning", f"refuses revision {motion.revision} of plan {motion.plan}: {why}")

    def _settle_mode(self, obeys: bool, now_s: float) -> None:
        before = self._mode
        if self._leg != STANDING:
            self._mode = "moving" if obeys else "retreating"
        elif self._orders is None:
            self._mode = "waiting"
        elif not obeys or self._refusing:
            self._mode = "holding"
        elif self._follower.arrived:
            self._mode = "arrived"
        else:
            self._mode = "yielding"
        if self._mode != "yielding":
            self._yields_since_s = math.inf
        elif before != "yielding":
            self._yields_since_s = now_s
        elif now_s - self._yields_since_s > LONG_S:
            self._yields_since_s = math.inf
            others = ", ".join(self._follower.waits_for()) or "more to be released"
            self._log("info", f"has been waiting for {others} for {LONG_S:g} s")

    def _log(self, level: Literal["info", "warning"], text: str) -> None:
        self._effects.append(Record(LogLine(level=level, text=text)))


def _task(orders: Deployment | None, *, moves: bool) -> tuple[int, ...]:
    """What orders tell a robot at once; while that is the same, their repetition only prolongs them.

    How far it may go it need not know before it comes to the end of a leg, if it moves.
    """
    if orders is None or orders.motion is None:
        return () if orders is None else (orders.authority.epoch,)
    motion = orders.motion
    task = (orders.authority.epoch, motion.plan, motion.revision)
    return task if moves else (*task, motion.released, motion.first_stage)


def _key(epoch: int, motion: Motion) -> tuple[int, int, int]:
    return epoch, motion.plan, motion.revision
