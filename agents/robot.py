"""A robot: goes where the leader wants it, says where it is, and stands when nobody leads.

=========  =====================================================================
waiting    no deployment has given it a place
moving     on its geodesic to its place
arrived    stands at its place
holding    its orders have run out, or their place cannot be reached: it stands
=========  =====================================================================
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from agents.driver import patience_s
from agents.mission import Mission
from agents.path_follower import STANDING, Leg, PathFollower, Routes, Unreachable
from agents.records import LogLine, Track
from agents.rhythm import EARLY_S, Rhythm
from agents.role import Drive, Effect, Event, Heard, JobDone, Publish, Record, WakeAt, Woken
from protocol.bus import PeerAppeared, PeerVanished
from protocol.messages import Deployment, Heartbeat, Mode, Placement, Point, State


class Robot:
    """Obeys the base station's deployments, the latest by (epoch, sequence), for as long as each is valid.

    The base station leads in this version: a deployment is an order if the base station says it in its own name.

    Args:
        mission: rates, speeds, and who the base station is.
        name: of this robot.
        routes: geodesics of the map inflated by the robot's radius.
    """

    hears = frozenset({"deployment"})

    def __init__(self, mission: Mission, name: str, routes: Routes) -> None:
        self._mission = mission
        self._name = name
        self._leader = mission.base_station.name
        self._follower = PathFollower(routes, mission.robot_speed_m_s)
        self._patience_s = patience_s(mission.control_hz)
        self._mode: Mode = "waiting"
        self._orders: Deployment | None = None
        self._orders_end_s = 0.0
        self._refused: Point | None = None
        self._leg: Leg = STANDING
        self._logs: list[Effect] = []

    def start(self, now_s: float, position: Point) -> Sequence[Effect]:
        """Begin the two rhythms: control with state, and heartbeat."""
        self._control = Rhythm(1.0 / self._mission.control_hz, now_s)
        self._heartbeat = Rhythm(1.0 / self._mission.heartbeat_hz, now_s)
        return self._live(now_s, position)

    def handle(self, event: Event, now_s: float) -> Sequence[Effect]:
        """Take orders when they arrive; move when woken."""
        match event:
            case Woken(position):
                return self._live(now_s, position)
            case Heard(_, envelope) if isinstance(envelope.body, Deployment) and envelope.sender == self._leader:
                return self._take_orders(envelope.body, now_s)
            case Heard() | JobDone() | PeerAppeared() | PeerVanished():
                return ()

    def _take_orders(self, orders: Deployment, now_s: float) -> Sequence[Effect]:
        authority = orders.authority
        if authority.leader != self._leader:
            return ()
        if self._orders is not None:
            known = self._orders.authority
            if (authority.epoch, authority.sequence) <= (known.epoch, known.sequence):
                return ()
        self._orders, self._orders_end_s = orders, now_s + orders.valid_for_s
        return (WakeAt(now_s),)

    def _live(self, now_s: float, position: Point) -> Sequence[Effect]:
        self._decide(now_s, position)
        self._leg = self._follower.steer(position) if self._mode in ("moving", "arrived") else STANDING
        if self._mode == "moving" and self._follower.arrived:
            self._mode = "arrived"
        effects, self._logs = self._logs, []
        effects.append(Drive(self._leg.velocity, min(self._leg.lasts_s, self._patience_s)))
        path = self._follower.remaining(position)
        target = self._follower.target
        if self._control.due(now_s):
            effects.append(
                Publish(
                    State(
                        position=position,
                        velocity=self._leg.velocity,
                        mode=self._mode,
                        target=target,
                        path=path,
                        obeying=self._orders.authority if self._orders is not None else None,
                    )
                )
            )
            effects.append(
                Record(
                    Track(
                        role="robot",
                        position=position,
                        velocity=self._leg.velocity,
                        radius_m=self._mission.robot_radius_m,
                        mode=self._mode,
                        target=target,
                        path=path,
                    )
                )
            )
        if self._heartbeat.due(now_s):
            effects.append(Publish(Heartbeat(role="robot", mode=self._mode)))
        effects.append(WakeAt(self._next_wake_s(now_s)))
        return effects

    def _decide(self, now_s: float, position: Point) -> None:
        """Settle mode and target by the orders that are in force."""
        orders = self._orders
        if orders is None:
            return
        if now_s >= self._orders_end_s - EARLY_S:
            self._hold(f"no word from {self._leader} for {orders.valid_for_s:g} s: orders have run out, holding")
            return
        placement = self._placement(orders)
        if placement is None:
            self._hold(f"decision {orders.decision} has no place for {self._name}: holding")
        elif placement.position not in (self._follower.target, self._refused):
            self._go(placement, orders.decision, position)

    def _go(self, placement: Placement, decision: int, position: Point) -> None:
        was, before = self._mode, self._follower.target
        try:
            self._follower.go(position, placement.position)
        except Unreachable as problem:
            self._refused = placement.position
            self._hold(f"decision {decision}: cannot go where it sends {self._name} ({problem}): holding")
            return
        self._refused = None
        self._mode = "moving"
        if was == "holding":
            self._log("info", f"obeys {self._leader} again")
        elif before is None:
            self._log("info", f"decision {decision}: first place")

    def _hold(self, why: str) -> None:
        """Stand from now on; says why when it begins, and not again while it lasts."""
        if self._mode != "holding":
            self._mode = "holding"
            self._follower.stop()
            self._log("warning", why)

    def _placement(self, orders: Deployment) -> Placement | None:
        return next((placement for placement in orders.placements if placement.robot == self._name), None)

    def _next_wake_s(self, now_s: float) -> float:
        wake_s = min(self._control.next_s, self._heartbeat.next_s)
        if self._leg.lasts_s > 0.0:
            wake_s = min(wake_s, now_s + self._leg.lasts_s)
        if self._mode in ("moving", "arrived"):
            wake_s = min(wake_s, self._orders_end_s)
        return wake_s

    def _log(self, level: Literal["info", "warning"], text: str) -> None:
        self._logs.append(Record(LogLine(level=level, text=text)))
