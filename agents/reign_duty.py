"""What a leader does in one reign: hold first, plan from a standstill, order, go on as the team progresses.

A *decision* is a choice of links and relay places. While one stands it is repeated, with a rising authority sequence,
the spares' places brought up to date, and as much of the motion released as is due (:mod:`agents.dispatcher`); the
decision's number rises only when links or relay places change, and goes on from that of the leader before.

A plan with another tree is no decision yet: its tree is negotiated (:mod:`agents.topology`) while the robots judge the
motion to it, of which nothing is released before the tree is in force. Until then nothing else is planned.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

from msgspec import structs

from agents.agent_knowledge import AgentKnowledge
from agents.allegiance import Allegiance
from agents.collection import Collection
from agents.dispatcher import Dispatcher
from agents.mission import Mission
from agents.orders import changes_topology, first_orders, is_decision, plan_of, renew
from agents.planning_job import Answer, Question
from agents.records import Advance, Decision, LogLine, Ordered, Planned
from agents.rhythm import EARLY_S, Rhythm
from agents.role import Effect, JobDone, Publish, Record
from agents.roll_call import Body, RollCall
from agents.setbacks import Setbacks
from agents.standing_orders import StandingOrders
from agents.topology import TeamTree
from protocol.membership import Presence
from protocol.messages import Authority, Motion, Reign

if TYPE_CHECKING:
    from agents.leader import Plan

GRACE_S: Final = 1.5
"""The first deployment waits so long for robots that have not been heard yet, counted from when this peer started."""

REPEAT_S: Final = 0.4
"""A deployment is repeated after this, so that who comes late or has lost some hears it within a second."""

AGAIN_S: Final = 0.2
"""A deployment is said again after this while robots have not answered it."""

PACE_S: Final = 0.04
"""Deployments are at least so far apart, however much there is to release."""


@dataclass(frozen=True, slots=True)
class _Pending:
    """A plan whose tree is being negotiated."""

    plan: Plan
    planning_s: float
    revision: tuple[int, int] | None
    """Plan and revision of the motion that leads there."""
    base_there: bool
    """Whether the base station was, when it was proposed: then its answer is waited for."""


class ReignDuty:
    """See the module.

    Args:
        mission: roster, rates and periods.
        reign: the office.
        allegiance: gives warrants.
        tree: negotiates the team's tree.
        orders: takes the peer's own orders; what was taken last says where the team stands.
        collection: what is known of the others.
        agent: what is known of the agent.
        body: the leader's own, if it is a robot.
        now_s: the present time.
        complete_by_s: until then robots are waited for of which nothing has been heard.
    """

    def __init__(
        self,
        mission: Mission,
        reign: Reign,
        allegiance: Allegiance,
        tree: TeamTree,
        orders: StandingOrders,
        collection: Collection,
        agent: AgentKnowledge,
        body: Body | None,
        *,
        now_s: float,
        complete_by_s: float,
    ) -> None:
        self.reign = reign
        self._mission, self._allegiance, self._standing = mission, allegiance, orders
        self._agent, self._tree = agent, tree
        self._complete_by_s = complete_by_s
        own = None if body is None else body.state
        places = {robot.name: collection.whereabouts(robot.name, own) or (robot.start,) for robot in mission.robots}
        base = mission.base_station
        self._dispatcher = Dispatcher(base.name, base.start, places, reign.epoch, mission.robot_radius_m)
        self._authority = Authority(epoch=reign.epoch, leader=reign.leader, sequence=0)
        told = first_orders(reign.leader) if orders.latest is None else orders.latest
        self._orders = structs.replace(told, authority=self._authority, motion=None)
        """What was said last."""
        self._plan: Plan | None = plan_of(told, mission.tracked_agent.name)
        self._pending: _Pending | None = None
        """The plan whose tree is being negotiated."""
        robots = [robot.name for robot in mission.robots]
        self._roll = RollCall(robots, allegiance.name, collection, body, self._dispatcher)
        self._goal: object = None
        """Where the agent was going when that was looked at last."""
        self._replanning = Rhythm(mission.planning_period_s, now_s)
        self._say_at_s, self._said_s = now_s, -math.inf
        self._advance: Advance | None = None
        """What was recorded last."""
        self._planning, self._urgent = False, True
        self._setbacks = Setbacks()
        """Trees that were given up."""
        self._complaints: dict[str, str] = {}
        """What was wrong last, by what it was about; said once, however often it happens."""
        self._effects: list[Effect] = []

    @property
    def next_s(self) -> float:
        """When there is something to do."""
        return min(self._replanning.next_s, self._say_at_s, self._setbacks.next_s)

    def lead(self, now_s: float) -> None:
        """Learn what is new, and say what is due."""
        self._follow(now_s)
        self._settle(now_s)
        self._heed(now_s)
        if now_s >= self._say_at_s - EARLY_S:
            self._say(now_s)

    def collect(self) -> list[Effect]:
        """Effects since the last time."""
        effects, self._effects = self._effects, []
        return effects

    def _follow(self, now_s: float) -> None:
        """See who is where, who is new and who is lost, and where the agent goes."""
        changed, given_up = self._roll.hold(self._authority, now_s)
        for robot in given_up:
            self._log("warning", f"{robot} does not answer: the team goes on without it")
        goal = self._agent.goal()
        if changed:
            self._setbacks.forget()
        self._urgent = self._urgent or changed or goal != self._goal
        self._goal = goal

    def _heed(self, now_s: float) -> None:
        """See to what the dispatcher has come to, after it was told something."""
        for text in self._dispatcher.reports:
            self._log("warning", text)
        self._dispatcher.reports.clear()
        self._urgent = self._urgent or self._dispatcher.forgotten
        self._dispatcher.forgotten = False
        if not self._planning:  # what is planned begins where the robots may go now
            self._dispatcher.release()
        if self._dispatcher.news:
            self._say_at_s = min(self._say_at_s, max(now_s, self._said_s + PACE_S))

    def ask(self, now_s: float, *, busy: bool) -> Question | None:
        """What to plan now, as soon as the agent and enough of the team are known.

        Args:
            now_s: the present time.
            busy: whether a question is being worked on, of this reign or one before.
        """
        question = self.draft(now_s, busy=busy)
        self._planning = self._planning or question is not None
        return question

    def draft(self, now_s: float, *, busy: bool) -> Question | None:
        """What will be asked soon, as for :meth:`ask`; until then the team goes on."""
        self._urgent = self._setbacks.due(now_s) or self._urgent
        due = self._replanning.due(now_s) or self._urgent
        return self._question(now_s) if due and not busy else None

    def ask_now(self, now_s: float) -> Question | None:
        """What to plan, now that what was drafted has been prepared."""
        question = self._question(now_s)
        self._planning = self._planning or question is not None
        return question

    def _question(self, now_s: float) -> Question | None:
        if self._tree.collecting:  # nothing that is planned now could be proposed
            self._urgent = True
            return None
        if self._pending is not None or not self._is_complete(now_s):
            return None
        agent = self._agent.look(now_s)
        if agent is None:
            return None
        onset = self._dispatcher.onset()
        self._urgent = onset is None
        if onset is None:
            return None
        return Question(
            way=agent.way,
            target=agent.target,
            drift_m_s=agent.drift_m_s,
            onset=onset,
            lead_s=self._dispatcher.lead_s,
            previous=self._plan,
            heading=self._dispatcher.heading,
            lost=self._dispatcher.lost,
        )

    def _is_complete(self, now_s: float) -> bool:
        if now_s >= self._complete_by_s:
            return True
        return all(self._allegiance.presence(robot) is Presence.GONE for robot in self._roll.missing)

    def take(self, done: JobDone, now_s: float) -> None:
        """Take over what was planned: a new decision, other places for the spares, another motion, or nothing new."""
        self._planning = False
        self._complain("error", "planning failed, the last deployment stands: ", done.failure)
        if not done.failure:
            answer: Answer = done.result
            self._effects.append(Record(Planned(planning_s=done.duration_s, in_sight_s=answer.in_sight_s)))
            self._complain("error", "no motion to the deployment: ", answer.failure)
            if self._tree.is_in_force(answer.plan.edges):
                self._decide(answer.plan, done.duration_s)
                self._go(answer)
                if not answer.failure:  # else what is under way may lead to a tree that was given up
                    self._dispatcher.permit(True)
            elif not answer.failure and self._may_propose(answer.plan, now_s):
                self._propose(answer, done.duration_s, now_s)
        self._heed(now_s)

    def _go(self, answer: Answer) -> bool:
        """Order the motion of an answer; whether there is one under way now that leads where the answer does."""
        course = answer.course
        if course is None:
            return True
        if self._dispatcher.take(course):
            self._complain("warning", "the motion is less than wished: ", course.reason)
        motion = self._dispatcher.motion
        return motion is not None and motion.plan == course.motion.plan

    @property
    def _stands(self) -> bool:
        """Whether everybody holds, and waits for a plan whatever it is."""
        return self._dispatcher.motion is None

    def _serves(self, now_s: float) -> bool:
        """Whether the tree in force still does for where the agent may be, with the robots that are there."""
        placements = () if self._plan is None else self._plan.placements
        goals = {placement.robot: placement.position for placement in placements}
        places = {robot: goals.get(robot, state.position) for robot, state in self._roll.states.items()}
        base = self._mission.base_station
        return self._tree.serves({base.name: base.start, **places}, now_s)

    def _may_propose(self, plan: Plan, now_s: float) -> bool:
        urgent = self._stands or not self._serves(now_s)
        return self._setbacks.may_try(plan.edges, now_s) and self._tree.may_propose(now_s, urgent=urgent)

    def _propose(self, answer: Answer, planning_s: float, now_s: float) -> None:
        """Have another tree negotiated, and keep everybody from going where it is needed until it is in force."""
        if not self._go(answer):
            return
        self._dispatcher.permit(False)
        plan, motion = answer.plan, self._dispatcher.motion
        self._pending = _Pending(plan, planning_s, _revision(motion), self._base_there)
        self._effects += self._tree.propose(plan.edges, motion, self._mission.topology, plan.reason, now_s)

    def _settle(self, now_s: float) -> None:
        """See what has become of the tree that is being negotiated."""
        pending = self._pending
        if pending is None:
            return
        if self._tree.is_in_force(pending.plan.edges):
            self._decide(pending.plan, pending.planning_s)
            self._dispatcher.permit(True)
            self._setbacks.forget(pending.plan.edges)
        elif pending.base_there and not self._base_there:
            self._effects += self._tree.withdraw("the base station is gone, and is not asked again", now_s)
            self._urgent = True
        elif pending.revision != _revision(self._dispatcher.motion) or not self._tree.busy:
            self._effects += self._tree.withdraw("the motion to it has ended", now_s)
            self._setbacks.note(pending.plan.edges, now_s)
        else:
            return
        self._pending = None

    @property
    def _base_there(self) -> bool:
        return self._allegiance.presence(self._mission.base_station.name) is Presence.PRESENT

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
        self._say_at_s = self._said_s + PACE_S
        if decides:
            changed = changes_topology(plan, before)
            self._effects.append(
                Record(Decision(deployment=self._orders, planning_s=planning_s, topology_changed=changed))
            )

    def _say(self, now_s: float) -> None:
        """Order what stands, under the next authority, if that may be: the peer itself obeys like all others."""
        self._say_at_s = now_s + PACE_S
        warrant = self._allegiance.warrant(now_s)
        if warrant is None:
            return
        dispatcher, motion = self._dispatcher, self._dispatcher.motion
        authority = structs.replace(self._authority, sequence=self._authority.sequence + 1)
        orders = structs.replace(self._orders, authority=authority, warrant=warrant, motion=motion)
        if self._standing.give(orders, now_s):
            return
        self._effects += self._tree.look(now_s)
        self._authority, self._orders = authority, orders
        if dispatcher.said(authority, now_s) and motion is not None:
            self._effects.append(Record(Ordered(epoch=self.reign.epoch, motion=motion)))
        if (advance := dispatcher.advance) != self._advance and advance is not None:
            self._effects.append(Record(advance))
        self._advance = advance
        self._said_s = now_s
        self._say_at_s = now_s + (AGAIN_S if dispatcher.pressing else REPEAT_S)
        self._effects.append(Publish(orders))

    def _complain(self, level: Literal["warning", "error"], what: str, why: str) -> None:
        """Log what is wrong; the same only once, however often it happens."""
        if why and why != self._complaints.get(what):
            self._log(level, f"{what}{why}")
        self._complaints[what] = why

    def _log(self, level: Literal["info", "warning", "error"], text: str) -> None:
        self._effects.append(Record(LogLine(level=level, text=text)))


def _revision(motion: Motion | None) -> tuple[int, int] | None:
    return None if motion is None else (motion.plan, motion.revision)
