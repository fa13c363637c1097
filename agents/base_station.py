"""The base station: the fixed end of the chain, and in this version the leader.

It hears where robots and agent are, has deployments and motions planned beside its control loop, and publishes them. A
*decision* is a choice of links and relay places. While one stands it is repeated, with a rising authority sequence, the
spares' places brought up to date, and as much of the motion released as is due (:mod:`agents.dispatcher`); the
decision's number rises only when links or relay places change.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, Protocol

from msgspec import structs

from agents.dispatcher import Dispatcher
from agents.mission import Mission
from agents.network import judge_network
from agents.orders import changes_topology, first_orders, is_decision, renew
from agents.planning_job import Answer, Question
from agents.records import Advance, Decision, LogLine, Ordered, Planned, Track
from agents.rhythm import EARLY_S, Rhythm
from agents.role import Compute, Effect, Event, Heard, JobDone, Publish, Record, WakeAt, Woken, Written
from planning.environment import Environment
from protocol.bus import PeerAppeared, PeerVanished
from protocol.messages import AnyBody, Authority, Heartbeat, Intent, Mode, Point, State

if TYPE_CHECKING:
    from agents.leader import Plan

GRACE_S: Final = 1.5
"""The first deployment waits so long for robots that have not been heard yet."""

REPETITIONS: Final = 4
"""A deployment is said so often within its validity: a robot holds only when all of these are lost."""

AGAIN_S: Final = 0.2
"""A deployment is said again after this while robots have not answered it."""

PACE_S: Final = 0.04
"""Deployments are at least so far apart, however much there is to release."""

PLANNING: Final = "planning"
"""Name of the planning job."""


def silence_s(control_hz: float) -> float:
    """Who has not said where it is for so long is not counted on: another robot gets its place."""
    return max(1.0, 3.0 / control_hz)


class Planner(Protocol):
    """What is used of :class:`agents.team_planner.TeamPlanner`. Pure, so that it can run beside the control loop."""

    def plan(self, question: Question) -> Answer:
        """Who is to stand where, and how they get there."""


@dataclass(frozen=True, slots=True)
class Known:
    """What was last heard of a peer."""

    body: State | Intent
    heard_s: float


class BaseStation:
    """Leads the team.

    The epoch is the mission time, in milliseconds, at which this incarnation began: a base station that was started
    again outranks what its predecessor said, without a file.

    Args:
        mission: roster, rates and periods.
        environment: the map as drawn, for the true lines of sight between the places heard.
        planner: decides on deployments and motions.
    """

    hears = frozenset({"state", "intent"})

    def __init__(self, mission: Mission, environment: Environment, planner: Planner) -> None:
        self._mission = mission
        self._environment = environment
        self._planner = planner
        self._name = mission.base_station.name
        self._position = mission.base_station.start
        self._agent = mission.tracked_agent.name
        self._robots = tuple(robot.name for robot in mission.robots)
        self._silent_s = silence_s(mission.control_hz)
        self._known: dict[str, Known] = {}
        self._sequence = 0
        self._plan: Plan | None = None
        self._orders = first_orders(mission)
        """What was said last."""
        self._said_s = -math.inf
        self._advance: Advance | None = None
        """What was recorded last."""
        self._planning = self._urgent = False
        self._complaints: dict[str, str] = {}
        """What was wrong last, by what it was about; said once, however often it happens."""
        self._effects: list[Effect] = []

    def start(self, now_s: float, position: Point) -> Sequence[Effect]:
        """Begin the rhythms: control with state, heartbeat, planning."""
        epoch = max(0, round(1000.0 * now_s))
        starts = {robot.name: robot.start for robot in self._mission.robots}
        self._dispatcher = Dispatcher(self._name, self._position, starts, epoch, self._mission.robot_radius_m)
        self._authority = Authority(epoch=epoch, leader=self._name, sequence=0)
        self._grace_until_s = now_s + GRACE_S
        self._control = Rhythm(1.0 / self._mission.control_hz, now_s)
        self._heartbeat = Rhythm(1.0 / self._mission.heartbeat_hz, now_s)
        self._replanning = Rhythm(self._mission.planning_period_s, now_s)
        self._say_at_s = math.inf
        return self.handle(Woken(position), now_s)

    def handle(self, event: Event, now_s: float) -> Sequence[Effect]:
        """Listen; plan and speak when it is time or when something has happened."""
        match event:
            case Woken(position):
                self._position = position
            case Heard(_, envelope):
                self._listen(envelope.sender, envelope.body, now_s)
            case PeerVanished(peer):
                self._lose(peer, "its process has ended or cannot be reached", now_s)
            case JobDone(job=name) if name == PLANNING:
                self._planned(event, now_s)
            case JobDone() | Written() | PeerAppeared():
                pass
        if not isinstance(event, Woken) and not self._urgent and not self._effects and now_s < self._say_at_s - EARLY_S:
            return ()
        self._live(now_s)
        effects, self._effects = self._effects, []
        return effects

    def _listen(self, peer: str, body: AnyBody, now_s: float) -> None:
        """Learn where a robot or the agent is. Whoever is new, and a new goal of the agent, ask for a plan at once."""
        if not (
            (isinstance(body, State) and peer in self._robots) or (isinstance(body, Intent) and peer == self._agent)
        ):
            return
        before = self._known.get(peer)
        self._known[peer] = Known(body, now_s)
        if before is None:
            self._log("info", f"hears {peer}")
            self._urgent = True
        elif isinstance(body, Intent) and isinstance(before.body, Intent) and body.goal != before.body.goal:
            self._urgent = True
        if isinstance(body, State):
            self._dispatcher.hear(peer, body, now_s)
            self._heed(now_s)

    def _lose(self, peer: str, why: str, now_s: float) -> None:
        if self._known.pop(peer, None) is not None:
            self._log("warning", f"has lost {peer}: {why}")
            self._urgent = True
            if peer in self._robots:
                self._dispatcher.lose(peer)
                self._heed(now_s)

    def _live(self, now_s: float) -> None:
        """Do what is due and ask to be woken for the next of it."""
        for peer in [peer for peer, known in self._known.items() if now_s - known.heard_s > self._silent_s]:
            self._lose(peer, f"silent for {self._silent_s:g} s", now_s)
        self._plan_if_due(now_s)
        if now_s >= self._say_at_s - EARLY_S:
            self._say(now_s)
        if self._control.due(now_s):
            self._report()
        if self._heartbeat.due(now_s):
            self._effects.append(Publish(Heartbeat(role="base_station", mode=self._mode)))
        wake_s = min(self._control.next_s, self._heartbeat.next_s, self._replanning.next_s, self._say_at_s)
        self._effects.append(WakeAt(wake_s))

    def _heed(self, now_s: float) -> None:
        """See to what the dispatcher has come to, after it was told something."""
        for text in self._dispatcher.reports:
            self._log("warning", text)
        self._dispatcher.reports.clear()
        if not self._planning:  # what is planned begins where the robots may go now
            self._dispatcher.release()
        if self._dispatcher.news:
            self._say_at_s = min(self._say_at_s, max(now_s, self._said_s + PACE_S))

    def _plan_if_due(self, now_s: float) -> None:
        """Ask for a plan, one at a time, as soon as the agent and enough of the team are known."""
        due = self._replanning.due(now_s) or self._urgent
        agent = self._known.get(self._agent)
        complete = all(robot in self._known for robot in self._robots) or now_s >= self._grace_until_s
        if not due or self._planning or agent is None or not complete:
            return
        onset = self._dispatcher.onset()
        self._urgent = onset is None
        if onset is None:
            return
        self._planning = True
        question = Question(
            way=agent.body.path or (agent.body.position,),
            onset=onset,
            lead_s=self._dispatcher.lead_s,
            previous=self._plan,
            heading=self._dispatcher.heading,
            lost=self._dispatcher.lost,
        )
        self._effects.append(Compute(PLANNING, self._planner.plan, (question,)))

    def _planned(self, done: JobDone, now_s: float) -> None:
        """Take over what was planned: a new decision, other places for the spares, another motion, or nothing new."""
        self._planning = False
        self._complain("error", "planning failed, the last deployment stands: ", done.failure)
        if not done.failure:
            answer: Answer = done.result
            self._effects.append(Record(Planned(planning_s=done.duration_s, in_sight_s=answer.in_sight_s)))
            self._decide(answer.plan, done.duration_s)
            self._complain("error", "no motion to the deployment: ", answer.failure)
            if answer.course is not None and self._dispatcher.take(answer.course):
                self._complain("warning", "the motion is less than wished: ", answer.course.reason)
        self._heed(now_s)

    def _decide(self, plan: Plan, planning_s: float) -> None:
        """Take a deployment over, and say so soon unless it is the same as before."""
        before = self._plan
        self._plan = plan
        if plan.serves != (before is None or before.serves):
            self._log("info" if plan.serves else "warning", plan.reason)
        decides = is_decision(plan, before)
        if before is not None and not decides and plan.placements == before.placements:
            return
        self._orders = renew(self._orders, plan, decides=decides)
        self._say_at_s = -math.inf
        if decides:
            changed = changes_topology(plan, before)
            self._effects.append(
                Record(Decision(deployment=self._orders, planning_s=planning_s, topology_changed=changed))
            )

    def _say(self, now_s: float) -> None:
        """Order what stands, under the next authority."""
        dispatcher = self._dispatcher
        self._authority = structs.replace(self._authority, sequence=self._authority.sequence + 1)
        motion = dispatcher.motion
        self._orders = structs.replace(self._orders, authority=self._authority, motion=motion)
        if dispatcher.said(self._authority, now_s) and motion is not None:
            self._effects.append(Record(Ordered(motion=motion)))
        if (advance := dispatcher.advance) != self._advance and advance is not None:
            self._effects.append(Record(advance))
        self._advance = advance
        self._said_s = now_s
        self._say_at_s = now_s + (AGAIN_S if dispatcher.pressing else self._orders.valid_for_s / REPETITIONS)
        self._effects.append(Publish(self._orders))

    @property
    def _mode(self) -> Mode:
        return "waiting" if self._plan is None else "arrived"

    def _report(self) -> None:
        """Say and record where it is, and who sees whom."""
        still = (0.0, 0.0)
        places = {self._name: self._position}
        for name in (self._agent, *self._robots):
            if name in self._known:
                places[name] = self._known[name].body.position
        complete = len(places) == 2 + len(self._robots)
        self._effects += (
            Publish(
                State(
                    position=self._position, velocity=still, mode=self._mode,
                    obeying=self._authority, progress=self._dispatcher.progress,
                )
            ),
            Record(
                Track(
                    role="base_station", position=self._position, velocity=still,
                    radius_m=self._mission.robot_radius_m, mode=self._mode,
                )
            ),
            Record(judge_network(self._environment, self._name, self._agent, places, self._orders.edges, complete)),
        )  # fmt: skip

    def _complain(self, level: Literal["warning", "error"], what: str, why: str) -> None:
        """Log what is wrong; the same only once, however often it happens."""
        if why and why != self._complaints.get(what):
            self._log(level, f"{what}{why}")
        self._complaints[what] = why

    def _log(self, level: Literal["info", "warning", "error"], text: str) -> None:
        self._effects.append(Record(LogLine(level=level, text=text)))
