"""Leading the team: a part of every peer that has a vote, and idle while it is not in office.

Each reign is a :class:`~agents.reign_duty.ReignDuty` of its own, and is dropped whole when the office ends: what was
planned for it is ignored, and the next leader begins from what it has heard itself (:mod:`agents.collection`).

The planner is made ready beside the control loop as soon as the peer starts. One that is elected before that is done
has the team hold until it is: that takes a moment where the map has been compiled before, and it keeps the rules of the
election free of what leading needs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Final, Protocol

from agents.agent_knowledge import AgentKnowledge
from agents.allegiance import AT_ONCE_S, Allegiance
from agents.auction import Auctioneer
from agents.collection import Collection
from agents.mission import Mission
from agents.planning_job import Answer, Question
from agents.reign_duty import GRACE_S, ReignDuty
from agents.role import Compute, Effect, Event, JobDone
from agents.roll_call import Body
from agents.standing_orders import StandingOrders
from agents.topology import TeamTree

PREPARING: Final = "preparing to plan"
PLANNING: Final = "planning"
"""Names of the jobs."""


class Planner(Protocol):
    """What is used of :class:`agents.team_planner.TeamPlanner`. Pure, so that it can run beside the control loop."""

    def prepare(self) -> None:
        """Build or load what planning needs."""

    def plan(self, question: Question) -> Answer:
        """Who is to stand where, and how they get there."""


class Leadership:
    """See the module.

    Args:
        mission: roster, rates and periods.
        allegiance: says whether this peer is in office.
        tree: negotiates the team's tree.
        orders: takes the peer's own orders.
        collection: what is known of the others.
        agent: what is known of the agent.
        planner: decides on deployments and motions.
        auctioneer: asks the others before that; None: nobody is asked.
        body: this peer's own, if it is a robot.
        now_s: the present time.
    """

    hears = frozenset({"state", "intent"})

    def __init__(
        self,
        mission: Mission,
        allegiance: Allegiance,
        tree: TeamTree,
        orders: StandingOrders,
        collection: Collection,
        agent: AgentKnowledge,
        planner: Planner,
        auctioneer: Auctioneer | None,
        body: Body | None,
        now_s: float,
    ) -> None:
        self._mission, self._allegiance, self._tree, self._orders = mission, allegiance, tree, orders
        self._collection, self._agent, self._planner, self._body = collection, agent, planner, body
        self._complete_by_s = now_s + GRACE_S
        self._auctioneer = auctioneer
        self._prepared = False
        self._duty: ReignDuty | None = None
        self._asked: ReignDuty | None = None
        """Whose question is being worked on."""

    @property
    def next_s(self) -> float:
        """When there is something to do."""
        reign, duty = self._allegiance.reign, self._duty
        if duty is None:
            return math.inf if reign is None else AT_ONCE_S
        return duty.next_s if reign == duty.reign else AT_ONCE_S

    def handle(self, event: Event, now_s: float) -> Iterable[Effect]:
        """Take up or leave the office; lead."""
        if self._prepared and self._duty is None and self._asked is None and self._allegiance.reign is None:
            return ()
        effects: list[Effect] = []
        if not self._prepared:
            self._prepared = True
            effects.append(Compute(PREPARING, self._planner.prepare))
        reign = self._allegiance.reign
        if reign is None:
            self._duty = None
        elif self._duty is None or self._duty.reign != reign:
            self._duty = ReignDuty(
                self._mission, reign, self._allegiance, self._tree, self._orders, self._collection, self._agent,
                self._body, now_s=now_s, complete_by_s=self._complete_by_s,
            )  # fmt: skip
        duty = self._duty
        if isinstance(event, JobDone) and event.job == PLANNING:
            asked, self._asked = self._asked, None
            if duty is not None and duty is asked:
                duty.take(event, now_s)
        if duty is not None:
            duty.lead(now_s)
            question = self._ask(duty, now_s, effects)
            if question is not None:
                self._asked = duty
                effects.append(Compute(PLANNING, self._planner.plan, (question,)))
            effects += duty.collect()
        return effects

    def _ask(self, duty: ReignDuty, now_s: float, effects: list[Effect]) -> Question | None:
        """What to plan now; where there are auctions, after one."""
        busy = self._asked is not None
        if self._auctioneer is None:
            return duty.ask(now_s, busy=busy)
        bids = None if busy else self._auctioneer.take()
        if bids is not None:
            question = duty.ask_now(now_s)
            return None if question is None else replace(question, bids=bids)
        draft = duty.draft(now_s, busy=busy or self._auctioneer.busy)
        if draft is not None:
            effects += self._auctioneer.hold(draft)
        return None
