"""The tracked agent's body: walks by itself or where an operator sends it.

Nobody of the team tells it where to go, and it waits for nobody. If it announces, it says position, goal and path. Else
it is *independent* in this too: the others hear that it lives, and how far it is (:mod:`agents.ranging`); where it is
goes into the recording only.

=======  ====================================================
waiting  has had no goal yet
moving   on its geodesic to its goal
arrived  rests at its goal
=======  ====================================================
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, Literal

from agents.behaviour import Routine
from agents.driver import patience_s
from agents.mission import Mission, OnDemand
from agents.path_follower import STANDING, Leg, PathFollower, Routes, Unreachable
from agents.records import LogLine
from agents.rhythm import EARLY_S
from agents.role import Drive, Effect, Event, Heard, Publish, Record, Woken
from agents.self_report import SelfReport
from planning.environment import Environment
from protocol.messages import Goal, GoalReply, Intent, Mode, Point

REMEMBERED_GOALS: Final = 256
"""Answers kept, so that a goal that is said again is answered again and not walked again."""

NOTHING_TO_DO_S: Final = 1.0
"""A behaviour that has no goal is asked again after this."""


class TrackedAgent:
    """Walks from goal to goal; a goal of an operator interrupts the behaviour, which goes on afterwards.

    Args:
        mission: rates, speed, radius and rests, and whether it announces.
        free: where its centre can be: the map inflated by its radius.
        routes: geodesics of ``free``.
        routine: where it goes by itself.
        now_s: the present time by its clock.
    """

    hears = frozenset({"goal"})

    def __init__(
        self, mission: Mission, free: Environment, routes: Routes, routine: Routine, now_s: float = 0.0
    ) -> None:
        self._mission = mission
        self._announces = mission.announces
        self._report = SelfReport(mission, "tracked_agent", mission.agent_radius_m, now_s)
        self._free = free
        self._routine = routine
        self._follower = PathFollower(routes, mission.agent_speed_m_s)
        behaviour = mission.behaviour
        self._pause_s, self._idle_until_s = (
            (0.0, 0.0) if isinstance(behaviour, OnDemand) else (behaviour.pause_s, behaviour.start_after_s)
        )
        self._ordered: Point | None = None
        """Goal of an operator that is waiting to be taken up."""
        self._on_order = False
        """Whether the present goal is an operator's."""
        self._answers: dict[tuple[str, str], GoalReply] = {}
        self._patience_s = patience_s(mission.control_hz)
        self._mode: Mode = "waiting"
        self._leg: Leg = STANDING
        self._leg_ends_s = math.inf
        self._logs: list[Effect] = []

    @property
    def next_s(self) -> float:
        """When it has something to say, the end of a leg or of a rest; at once when it has been sent somewhere."""
        if self._ordered is not None:
            return -math.inf
        wake_s = self._report.next_s
        if self._mode == "moving":
            return min(wake_s, self._leg_ends_s)
        return min(wake_s, self._idle_until_s)

    def handle(self, event: Event, now_s: float) -> Sequence[Effect]:
        """Answer goals when they arrive; walk when woken."""
        match event:
            case Woken(position):
                return self._live(now_s, position)
            case Heard(address, envelope) if isinstance(envelope.body, Goal):
                return self._answer(address.speaker, envelope.body)
            case _:
                return ()

    def _answer(self, operator: str, goal: Goal) -> Sequence[Effect]:
        asked = (operator, goal.correlation)
        known = self._answers.get(asked)
        if known is not None:
            return (Publish(known),)
        x, y = goal.goal
        if self._free.contains([goal.goal])[0]:
            reply = GoalReply(correlation=goal.correlation, accepted=True)
            log = Record(LogLine(level="info", text=f"{operator} sends it to ({x:.2f}, {y:.2f})"))
            self._ordered = goal.goal
        else:
            reason = (
                f"goal ({x:.2f}, {y:.2f}) lies outside the map or nearer than {self._mission.agent_radius_m:.2f} m "
                "to a wall: choose a point in free space"
            )
            reply = GoalReply(correlation=goal.correlation, accepted=False, reason=reason)
            log = Record(LogLine(level="warning", text=f"refused what {operator} asked: {reason}"))
        self._answers[asked] = reply
        if len(self._answers) > REMEMBERED_GOALS:
            del self._answers[next(iter(self._answers))]
        return (Publish(reply), log)

    def _live(self, now_s: float, position: Point) -> Sequence[Effect]:
        self._decide(now_s, position)
        self._leg = self._follower.steer(position)
        if self._mode == "moving" and self._follower.arrived:
            self._rest(now_s)
        effects, self._logs = self._logs, []
        effects.append(Drive(self._leg.velocity, min(self._leg.lasts_s, self._patience_s)))
        intent = Intent(
            position=position,
            velocity=self._leg.velocity,
            mode=self._mode,
            goal=self._follower.target,
            path=self._follower.remaining(position),
        )
        self._leg_ends_s = now_s + self._leg.lasts_s
        effects += self._report.due(now_s, intent, silent=not self._announces)
        return effects

    def _decide(self, now_s: float, position: Point) -> None:
        """Take up an operator's goal at once, and the routine's next one when it is free and has rested."""
        if self._ordered is not None:
            goal, self._ordered, self._on_order = self._ordered, None, True
            self._go(position, goal, now_s)
        elif self._mode != "moving" and now_s >= self._idle_until_s - EARLY_S:
            chosen = self._routine.choose(position)
            if chosen is None:
                self._idle_until_s = now_s + NOTHING_TO_DO_S
            else:
                self._on_order = False
                self._go(position, chosen, now_s)

    def _go(self, position: Point, goal: Point, now_s: float) -> None:
        try:
            self._follower.go(position, goal)
            self._mode = "moving"
        except Unreachable as problem:
            self._log("warning", f"gives up goal ({goal[0]:.2f}, {goal[1]:.2f}): {problem}")
            self._rest(now_s)
            self._idle_until_s = now_s + NOTHING_TO_DO_S

    def _rest(self, now_s: float) -> None:
        self._mode = "arrived"
        self._idle_until_s = max(self._idle_until_s, now_s + self._pause_s)
        if not self._on_order:
            self._routine.reached()

    def _log(self, level: Literal["info", "warning"], text: str) -> None:
        self._logs.append(Record(LogLine(level=level, text=text)))
