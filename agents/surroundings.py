"""What a peer knows itself of who is where and goes where: what it judges links by."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from agents.collection import Collection
from agents.link_sight import Scene, places_on
from agents.mission import Mission
from agents.standing_orders import StandingOrders
from agents.target_set import TargetSet
from planning.environment import Environment
from protocol.messages import Motion, NewLink, Point, State


class Body(Protocol):
    """What is needed of a robot's own body."""

    @property
    def state(self) -> State | None:
        """What it says of itself."""


class Estimate(Protocol):
    """What is needed of the shared estimate of the agent."""

    def target(self, now_s: float) -> TargetSet | None:
        """Where the agent may be; None: nothing has been measured yet."""


class Surroundings:
    """See the module.

    Args:
        mission: roster.
        environment: the map as drawn.
        name: of this peer.
        orders: as it has taken them.
        others: where they are.
        body: this peer's own, if it is a robot; the base station stands, and accepts any motion.
        estimate: of where an agent is that does not announce its way.
    """

    def __init__(
        self,
        mission: Mission,
        environment: Environment,
        name: str,
        orders: StandingOrders,
        others: Collection,
        body: Body | None,
        estimate: Estimate | None,
    ) -> None:
        self.environment = environment
        self.agent = mission.tracked_agent.name
        self._name, self._base = name, mission.base_station
        self._robots = tuple(robot.name for robot in mission.robots)
        self._orders, self._others, self._body, self._estimate = orders, others, body, estimate

    def scene(self, motion: Motion | None, now_s: float) -> Scene:
        """Where all are, and a motion that is accepted, or to be."""
        states = {name: self._others.state(name) for name in self._robots}
        if self._body is not None:
            states[self._name] = self._body.state
        places = {self._base.name: self._base.start}
        places |= {name: state.position for name, state in states.items() if state is not None}
        return Scene(self.environment, motion, places, self.agent, self.may_be(now_s))

    def may_be(self, now_s: float) -> Sequence[Point] | None:
        """Where the agent may be, now or on its way; None: anywhere. Empty: it has yet to say so."""
        if self._estimate is not None:
            target = self._estimate.target(now_s)
            return None if target is None else target.samples
        intent = self._others.intent()
        return () if intent is None else places_on(intent.path or (intent.position,))

    def ready_to_judge(self, links: Sequence[NewLink], now_s: float) -> tuple[Scene, tuple[NewLink, ...]]:
        """By what to judge links now, and those that can be: whose motion is accepted, and of what is known."""
        orders = self._orders.in_force(now_s)
        if orders is None:
            return self.scene(None, now_s), ()
        scene = self.scene(orders.motion, now_s)
        ready = (link for link in links if self._is_accepted(link, orders.authority.epoch, orders.motion))
        return scene, tuple(link for link in ready if scene.may_be != () or self.agent not in link.ends)

    def _is_accepted(self, link: NewLink, epoch: int, motion: Motion | None) -> bool:
        """Whether this peer goes by the motion that a link is about."""
        since = link.since
        if since is None or motion is None:
            return since is None and motion is None
        meant = (since.epoch, since.plan, since.revision)
        if (epoch, motion.plan, motion.revision) != meant:
            return False
        if self._body is None:
            return True
        own = None if self._body.state is None else self._body.state.progress
        return own is not None and (own.epoch, own.plan, own.revision) == meant
