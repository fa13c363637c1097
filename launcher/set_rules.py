"""Rule on what peers know of an agent that tells nobody where it is: it is inside the set of each of them."""

from __future__ import annotations

from typing import Final

from agents.mission import Mission
from agents.shared_estimate import SharedEstimate
from launcher.simulated_peer import SimulatedPeer
from launcher.simulation import SimulatedTeam
from launcher.violation import Violation
from protocol.messages import Envelope

EVERY: Final = 8
"""One in so many events after which a peer knows of a newer range is looked at: a look costs as much as all else that
comes of a range."""

LOOK_S: Final = 1.0
"""All peers' sets are looked at after this, too: they grow when nothing is measured."""


class SetRules:
    """Compares sets with the true place of the agent.

    Args:
        mission: of the team; its agent does not announce.
        team: has not begun.
    """

    def __init__(self, mission: Mission, team: SimulatedTeam) -> None:
        self._team = team
        self._agent = team.peers[mission.tracked_agent.name]
        self._newest_s: dict[str, float] = {}
        """By peer: when the newest range was measured that it knew of when that was looked at last."""
        self._news = 0
        team.time.call_at(LOOK_S, self._look_at_all)

    def hear(self, peer: SimulatedPeer, envelope: Envelope) -> None:
        """Nothing: what is said is for other rules."""

    def look(self, peer: SimulatedPeer) -> None:
        """Look at the set of who has learned of a newer range, every now and then."""
        estimate = peer.part(SharedEstimate)
        if estimate is None or estimate.newest_s == self._newest_s.get(peer.name):
            return
        self._newest_s[peer.name] = estimate.newest_s
        self._news += 1
        if self._news % EVERY == 0:
            self._judge(peer, estimate)

    def _look_at_all(self) -> None:
        for peer in self._team.peers.values():
            if (estimate := peer.part(SharedEstimate)) is not None:
                self._judge(peer, estimate)
        self._team.time.call_at(self._team.time.now_s + LOOK_S, self._look_at_all)

    def _judge(self, peer: SimulatedPeer, estimate: SharedEstimate) -> None:
        place = self._agent.place
        if not estimate.contains(place, peer.now_s):
            raise Violation("the agent is inside every set", f"it is at {place}, and not for {peer.name}")
