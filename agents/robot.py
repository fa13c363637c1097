"""A robot: goes its way in the team's motion, says where it is and how far, and stands when nobody leads.

=========  ====================================================================
waiting    has heard no order yet
moving     on its way, in a stage that it may be in
yielding   stands on its way until others are farther, or more is released
arrived    stands where its way ends
holding    was told to, or its orders have run out, or it cannot follow them
=========  ====================================================================

Standing is safe wherever it is, so whatever is amiss makes it stand, or end what it has accepted before.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, Literal

from msgspec import structs

from agents.certificate_judge import Judge
from agents.driver import patience_s
from agents.mission import Mission
from agents.path_follower import STANDING, Leg
from agents.records import LogLine
from agents.rhythm import EARLY_S
from agents.role import Compute, Drive, Effect, Event, Heard, JobDone, Record, WakeAt, Woken, Written
from agents.self_report import SelfReport
from agents.stage_follower import ASTRAY_M, StageFollower
from protocol.bus import PeerAppeared, PeerVanished
from protocol.messages import Deployment, Mode, Motion, Point, State

CERTIFICATE: Final = "certificate"
"""Name of the job that judges a motion."""

LONG_S: Final = 2.0
"""Whoever yields for longer says to whom."""


class Robot:
    """Obeys the base station's deployments, the latest by (epoch, sequence), for as long as each is valid.

    The base station leads in this version: a deployment is an order if the base station says it in its own name. Its
    motion is accepted when the robot has judged it; until then, and if it is refused, the robot goes on with the
    motion that it has accepted before.

    Args:
        mission: rates, speeds, and who the base station is.
        name: of this robot.
        judge: says what is wrong with a motion (:func:`agents.certificate_judge.certificate_judge`).
    """

    hears = frozenset({"deployment", "state"})

    def __init__(self, mission: Mission, name: str, judge: Judge) -> None:
        self._mission = mission
        self._name = name
        self._leader = mission.base_station.name
        self._judge = judge
        self._follower = StageFollower(name, mission.robot_speed_m_s)
        self._patience_s = patience_s(mission.control_hz)
        self._mode: Mode = "waiting"
        self._orders: Deployment | None = None
        self._orders_end_s = 0.0
        self._orphaned = False
        """Whether the orders have run out."""
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

    def start(self, now_s: float, position: Point) -> Sequence[Effect]:
        """Begin the two rhythms: control with state, and heartbeat."""
        self._report = SelfReport(self._mission, "robot", self._mission.robot_radius_m, now_s)
        return self._live(now_s, position)

    def handle(self, event: Event, now_s: float) -> Sequence[Effect]:
        """Take orders and news of the others when they arrive; decide and move when woken."""
        match event:
            case Woken(position):
                return self._live(now_s, position)
            case Heard(_, envelope) if isinstance(envelope.body, Deployment):
                return self._take_orders(envelope.sender, envelope.body, now_s)
            case Heard(_, envelope) if isinstance(envelope.body, State):
                progress = envelope.body.progress
                news = progress is not None and self._follower.hear(envelope.sender, progress)
                return (WakeAt(now_s),) if news and self._mode == "yielding" else ()
            case JobDone(job=name) if name == CERTIFICATE:
                return self._take_verdict(event, now_s)
            case Heard() | JobDone() | Written() | PeerAppeared() | PeerVanished():
                return ()

    def _take_orders(self, sender: str, orders: Deployment, now_s: float) -> Sequence[Effect]:
        authority = orders.authority
        if sender != self._leader or authority.leader != self._leader:
            return ()
        if self._orders is not None:
            known = self._orders.authority
            if (authority.epoch, authority.sequence) <= (known.epoch, known.sequence):
                return ()
        self._orders, self._orders_end_s = orders, now_s + orders.valid_for_s
        return (WakeAt(now_s),)

    def _take_verdict(self, done: JobDone, now_s: float) -> Sequence[Effect]:
        if self._judging is not None:
            wrong = f"it could not be certified: {done.failure}" if done.failure else str(done.result)
            self._judged, self._judging = (*self._judging, wrong), None
        return (WakeAt(now_s),)

    def _live(self, now_s: float, position: Point) -> Sequence[Effect]:
        obeys = self._obey(now_s, position)
        self._leg = self._follower.steer(position) if obeys else STANDING
        self._settle_mode(obeys, now_s)
        self._effects.append(Drive(self._leg.velocity, min(self._leg.lasts_s, self._patience_s)))
        state = State(
            position=position,
            velocity=self._leg.velocity,
            mode=self._mode,
            target=self._follower.target,
            path=self._follower.remaining(position),
            obeying=self._orders.authority if self._orders is not None else None,
            progress=self._follower.progress,
            refusing=self._refusing,
        )
        news = (state.progress, state.refusing, state.mode == "holding")
        self._effects += self._report.due(now_s, state, urgent=news != self._said)
        self._said = news
        self._effects.append(WakeAt(self._next_wake_s(now_s)))
        effects, self._effects = self._effects, []
        return effects

    def _obey(self, now_s: float, position: Point) -> bool:
        """Make the orders one's own as far as they can be followed; whether there is something to follow."""
        orders = self._orders
        if orders is None:
            return False
        if now_s >= self._orders_end_s - EARLY_S:
            if not self._orphaned:
                self._log("warning", f"no word from {self._leader} for {orders.valid_for_s:g} s: holding")
            self._orphaned = True
            return False
        if self._orphaned:
            self._log("info", f"hears {self._leader} again")
        self._orphaned = False
        self._refusing = ""
        if orders.motion is None:
            self._halt(f"decision {orders.decision}: told to hold")
        elif not self._follower.takes_part(orders.motion):
            self._halt(f"decision {orders.decision} has no way for {self._name}: holding")
        else:
            self._consider(orders.authority.epoch, orders.motion, position)
        return self._follower.progress is not None

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
        objection = self._follower.object_to(epoch, motion, position) or self._verdict(epoch, motion)
        if objection:
            self._refuse(epoch, motion, objection)
        elif self._judging is None:
            self._judging = (epoch, motion)
            # What has been released does not matter to the judge, who remembers what was asked before.
            asked = structs.replace(motion, released=motion.first_stage - 1)
            self._effects.append(Compute(CERTIFICATE, self._judge, (asked,)))

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
            self._mode = "moving"
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
            others = ", ".join(self._follower.waits_for()) or f"{self._leader} to release more"
            self._log("info", f"has been waiting for {others} for {LONG_S:g} s")

    def _next_wake_s(self, now_s: float) -> float:
        wake_s = self._report.next_s
        if self._leg.lasts_s > 0.0:
            wake_s = min(wake_s, now_s + self._leg.lasts_s)
        if self._mode in ("moving", "yielding", "arrived"):
            wake_s = min(wake_s, self._orders_end_s)
        return wake_s

    def _log(self, level: Literal["info", "warning"], text: str) -> None:
        self._effects.append(Record(LogLine(level=level, text=text)))


def _key(epoch: int, motion: Motion) -> tuple[int, int, int]:
    return epoch, motion.plan, motion.revision
