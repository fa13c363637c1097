"""The base station's body: it stands, says where, and keeps account of who sees whom.

What it does as a leader is a part that every peer with a vote has (:mod:`agents.leadership`).
"""

from __future__ import annotations

from collections.abc import Iterable

from agents.collection import Collection
from agents.mission import Mission
from agents.network import judge_network
from agents.records import Connectivity
from agents.rhythm import EARLY_S
from agents.role import Effect, Event, Record, Woken
from agents.self_report import SelfReport
from agents.standing_orders import StandingOrders
from planning.environment import Environment
from protocol.messages import Mode, State


class BaseStation:
    """See the module.

    Args:
        mission: roster and rates.
        environment: the map as drawn, for the true lines of sight between the places heard.
        orders: in force.
        collection: where the others are.
        now_s: the present time.
    """

    hears = frozenset[str]()

    def __init__(
        self,
        mission: Mission,
        environment: Environment,
        orders: StandingOrders,
        collection: Collection,
        now_s: float,
    ) -> None:
        self._mission, self._environment = mission, environment
        self._orders, self._collection = orders, collection
        self._report = SelfReport(mission, "base_station", mission.robot_radius_m, now_s)

    @property
    def next_s(self) -> float:
        """When something is to be said."""
        return self._report.next_s

    def handle(self, event: Event, now_s: float) -> Iterable[Effect]:
        """Say and record where it is, and who sees whom."""
        if not isinstance(event, Woken) or now_s < self.next_s - EARLY_S:
            return ()
        latest = self._orders.latest
        state = State(
            position=event.position,
            velocity=(0.0, 0.0),
            mode=self._mode(now_s),
            obeying=None if latest is None else latest.authority,
        )
        effects = self._report.due(now_s, state)
        if any(isinstance(effect, Record) for effect in effects):
            effects.append(Record(self._judge_network(state)))
        return effects

    def _judge_network(self, state: State) -> Connectivity:
        mission, latest = self._mission, self._orders.latest
        name, agent = mission.base_station.name, mission.tracked_agent.name
        places = {name: state.position}
        for peer in (agent, *(robot.name for robot in mission.robots)):
            body = self._collection.body(peer)
            if body is not None:
                places[peer] = body.position
        expected = 1 + len(mission.robots) + mission.announces
        edges = () if latest is None else latest.edges
        return judge_network(self._environment, name, agent, places, edges, len(places) == expected)

    def _mode(self, now_s: float) -> Mode:
        if self._orders.latest is None:
            return "waiting"
        return "holding" if self._orders.in_force(now_s) is None else "arrived"
