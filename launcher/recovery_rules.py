"""When nothing goes wrong any more the team goes on: soon somebody leads whom all obey, and then there is a plan."""

from __future__ import annotations

import math
from typing import Final

from agents.mission import Mission
from agents.standing_orders import StandingOrders
from launcher.simulated_peer import SimulatedPeer, holds_lease
from launcher.simulation import SimulatedTeam
from launcher.violation import Violation
from protocol.ballot import CLOCK_DRIFT
from protocol.election import LEASE_S, REST_AFTER_FAILURE_S
from protocol.membership import SILENT_AFTER, Presence

LOOK_S: Final = 0.05

LED_S: Final = 3.0 * LEASE_S / (1.0 - CLOCK_DRIFT)
"""By then all obey somebody, even if all clocks are slow."""

JOBS: Final = 4
"""Computations that follow each other before a plan is in force: the plan, its links as the leader foresees them, its
certificate, and the links as their ends judge them."""

PLANNED_S: Final = 1.0
"""So long after that the robots have a plan, and what these take."""


class RecoveryRules:
    """Looks twenty times a second, from when the last fault is over.

    Args:
        mission: of the team.
        team: has not begun.
        full_disks: whether any disk is full in between: a voter tries again a while after that.
    """

    def __init__(self, mission: Mission, team: SimulatedTeam, *, full_disks: bool = False) -> None:
        self.led_after_s = self.planned_after_s = math.nan
        """How long it took since the last fault; not a number if that has not been seen."""
        self._mission, self._team = mission, team
        self._begins_s = 1.0 / mission.control_hz
        """By then all processes have begun."""
        self._known_after_s = 0.0
        """As long after that fault a leader has counted on a robot that had died; no longer than it takes to notice."""
        self._noticed_within_s = SILENT_AFTER / mission.heartbeat_hz / (1.0 - CLOCK_DRIFT)
        self._planning_s = JOBS * mission.planning_delay_s
        self._led_within_s = LED_S + (REST_AFTER_FAILURE_S / (1.0 - CLOCK_DRIFT) if full_disks else 0.0)
        team.time.call_at(LOOK_S, self._look)

    def _look(self) -> None:
        time, quiet_s = self._team.time, max(self._team.faults.quiet_since_s, self._begins_s)
        if time.now_s > quiet_s:
            if math.isnan(self.led_after_s):
                self._look_whether_led(time.now_s - quiet_s)
            elif math.isnan(self.planned_after_s):
                self._look_whether_planned(time.now_s - quiet_s)
            else:
                return
        time.call_at(time.now_s + LOOK_S, self._look)

    def _look_whether_led(self, after_s: float) -> None:
        voters = self._voters()
        if 2 * len(voters) <= len(self._mission.voters.voters):
            self.led_after_s = self.planned_after_s = math.inf  # no majority is left
            return
        lost = self._lost()
        if not lost:
            self.led_after_s = after_s
        elif after_s > self._led_within_s:
            text = f"{after_s:.1f} s after the last fault {', '.join(lost)} obey nobody who leads"
            raise Violation("a team is led soon after the last fault", text)

    def _lost(self) -> list[str]:
        """Who is there and not led."""
        return [peer.name for peer in self._voters() if not self._is_led(peer)]

    def _is_led(self, peer: SimulatedPeer) -> bool:
        """Whether a peer obeys somebody who leads: it may obey who has died for some moments more."""
        reign = None if peer.allegiance is None else peer.allegiance.obeyed(peer.now_s)
        if reign is None:
            return False
        leader = self._team.peers[reign.leader]
        return leader.allegiance is not None and leader.allegiance.reign == reign and holds_lease(leader)

    def _look_whether_planned(self, after_s: float) -> None:
        if after_s <= self._led_within_s and self._lost():
            self.led_after_s = math.nan  # a lease that the faults have left without enough votes has ended
            return
        idle = [peer.name for peer in self._voters() if not self._has_plan(peer)]
        if not idle:
            self.planned_after_s = after_s
        elif after_s <= self._noticed_within_s and self._counts_on_the_dead():
            self._known_after_s = after_s
        elif after_s > (known_s := max(self.led_after_s, self._known_after_s)) + PLANNED_S + self._planning_s:
            text = f"{after_s - known_s:.1f} s after all obey a leader {', '.join(idle)} have no plan"
            raise Violation("a team that is led has a plan soon", text)

    def _counts_on_the_dead(self) -> bool:
        """Whether who leads has yet to notice that somebody has died, and waits for an answer."""
        leader = next((peer.allegiance for peer in self._voters() if holds_lease(peer)), None)
        dead = [peer.name for peer in self._team.peers.values() if peer.shell is None]
        return leader is not None and any(leader.presence(name) is Presence.PRESENT for name in dead)

    def _has_plan(self, peer: SimulatedPeer) -> bool:
        """Whether orders are in force at a peer that come from a plan of who leads now."""
        part = peer.part(StandingOrders)
        orders = None if part is None else part.in_force(peer.now_s)
        return orders is not None and orders.motion is not None

    def _voters(self) -> list[SimulatedPeer]:
        """Those that are there."""
        return [peer for peer in self._team.peers.values() if peer.allegiance is not None]
