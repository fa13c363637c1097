"""What must never happen in a simulated team, looked for after every event.

The rules see more than any peer does: true time, all minds, all disks. They are told by what peers say and by what they
hold to be true; none of them asks the code that they judge whether it did right. Each kind of rule is a class of its
own: leases and obedience here, orders and motion in :mod:`launcher.order_rules`, trees in :mod:`launcher.tree_rules`,
bodies in :mod:`launcher.body_rules`, what peers know of the agent in :mod:`launcher.set_rules`; how soon a team
recovers is for :mod:`launcher.recovery_rules`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final, Protocol

from agents.allegiance import Allegiance
from agents.mission import Mission
from agents.shared_estimate import SharedEstimate
from agents.shell import PeerShell
from launcher.body_rules import BodyRules
from launcher.fault_timetable import Kill, Timetable
from launcher.kept_memory import count_kept
from launcher.order_rules import MotionRules, OrderRules
from launcher.set_rules import SetRules
from launcher.simulated_peer import SimulatedPeer, holds_lease, read_shared
from launcher.simulation import SimulatedTeam
from launcher.tree_rules import TreeRules
from launcher.violation import Violation
from protocol.bus import Received
from protocol.inbox import Inbox
from protocol.keys import route
from protocol.messages import Envelope, Reign

COUNT_S: Final = 12.5
"""How often it is counted what they keep."""

MOST_KEPT: Final[Mapping[type[object], int]] = {
    Allegiance: 200,
    SharedEstimate: 20_000,
    PeerShell: 30_000,
    Inbox: 10_000,
}
"""Things in the containers of two parts of a mind, of a whole peer, and of what waits for one that is paused; several
times what healthy teams keep."""

JUDGED_KINDS: Final = frozenset({"deployment", "topology", "auction", "confirmation", "state", "vote_request"})


class Rules(Protocol):
    """Some rules. What they find they raise as a :class:`~launcher.violation.Violation`."""

    def hear(self, peer: SimulatedPeer, envelope: Envelope) -> None:
        """Judge what a peer says, at the moment at which it decides to."""

    def look(self, peer: SimulatedPeer) -> None:
        """Judge a peer that has just handled an event."""


class Invariants:
    """All rules, for one team.

    Args:
        mission: of the team.
        team: has not begun; its peers are watched from now on.
        faults: that happen to it. Where a disk is lost, two reigns may have the same epoch one after the other, and
            what is numbered by epochs is not judged.
    """

    def __init__(self, mission: Mission, team: SimulatedTeam, faults: Timetable) -> None:
        keeps_disks = not any(isinstance(fault, Kill) and fault.disk == "lost" for fault in faults.faults)
        self._team = team
        self._rules: Sequence[Rules] = (OfficeRules(team.peers, keeps_disks), OrderRules(keeps_disks))
        if keeps_disks:
            self._rules += (MotionRules(team.peers), TreeRules(mission.voters.voters))
        if not mission.announces:
            self._rules += (SetRules(mission, team),)
        self._looks = [rules.look for rules in self._rules]
        self._found: Violation | None = None
        for peer in team.peers.values():
            peer.said, peer.watch = self._hear, self._look
        BodyRules(mission, team)
        team.time.call_at(COUNT_S, self._look_at_memory)

    def _hear(self, peer: SimulatedPeer, key: str, payload: bytes) -> None:
        """Called in the middle of an event, where whatever is raised would count as a failure of the role."""
        if self._found is not None or route(key)[0] not in JUDGED_KINDS:
            return
        message = read_shared(Received(key, payload))
        try:
            if isinstance(message, str):
                raise Violation("what is said can be read", f"what {peer.name} says under {key} is {message}")
            for rules in self._rules:
                rules.hear(peer, message.envelope)
        except Violation as violation:
            self._found = violation

    def _look(self, peer: SimulatedPeer) -> None:
        if self._found is not None:
            raise self._found
        shell = peer.shell
        if shell is not None and shell.faults:
            raise Violation("roles fail on nothing", f"{peer.name} failed on an event: see its log")
        for look in self._looks:
            look(peer)

    def _look_at_memory(self) -> None:
        for peer in self._team.peers.values():
            parts: list[tuple[type[object], object]] = [(PeerShell, peer.shell), (Inbox, peer.inbox)]
            parts += [(kind, peer.part(kind)) for kind in (Allegiance, SharedEstimate)]
            for kind, kept in parts:
                if kept is not None and (count := count_kept(kept)) > MOST_KEPT[kind]:
                    raise Violation("memory is bounded", f"{kind.__name__} of {peer.name} keeps {count} things")
        self._team.time.call_at(self._team.time.now_s + COUNT_S, self._look_at_memory)


_NEVER: Final = (None, math.nan, None, math.nan)
"""Before a peer's lease and obedience have been looked at."""


class OfficeRules:
    """At any moment of true time at most one peer believes that it holds a lease, and all who obey obey that one.

    Args:
        peers: of the team, by name.
        keeps_disks: whether no disk is lost, so that every reign has a greater epoch than all before.
    """

    def __init__(self, peers: Mapping[str, SimulatedPeer], keeps_disks: bool) -> None:
        self._peers, self._keeps_disks = peers, keeps_disks
        self._known: dict[str, tuple[object, float, object, float]] = {}
        """What each peer's lease and obedience were when they were looked at last."""
        self._last: Reign | None = None
        """The last reign that began."""

    def hear(self, peer: SimulatedPeer, envelope: Envelope) -> None:
        """Nothing: what is said is for other rules."""

    def look(self, peer: SimulatedPeer) -> None:
        """Compare with all others, if lease or obedience is another. They end by themselves, and begin at events."""
        own = peer.allegiance
        if own is None:
            return
        election, obedience = own.election, own.election.obedience
        office, lease_s, last, until_s = self._known.get(peer.name, _NEVER)
        if (
            until_s == obedience.until_s
            and lease_s == election.lease_until_s
            and last is obedience.last
            and office is election.office
        ):
            return
        self._known[peer.name] = election.office, election.lease_until_s, obedience.last, obedience.until_s
        leads, obeyed = holds_lease(peer), _obeyed(peer)
        if leads and election.office != self._last:
            self._begin(election.office)
        for other in self._peers.values():
            if other is peer or other.allegiance is None:
                continue
            if leads and holds_lease(other):
                raise Violation("one leads", f"{peer.name} and {other.name} hold leases")
            follows = _obeyed(other)
            if leads and follows is not None and follows.leader != peer.name:
                raise Violation("who obeys obeys who leads", f"{other.name} obeys {follows.leader}, {peer.name} leads")
            if obeyed is None:
                continue
            if follows is not None and _process(follows) != _process(obeyed):
                text = f"{peer.name} obeys {_process(obeyed)}, {other.name} obeys {_process(follows)}"
                raise Violation("all obey the same", text)
            if holds_lease(other) and obeyed.leader != other.name:
                raise Violation("who obeys obeys who leads", f"{peer.name} obeys {obeyed.leader}, {other.name} leads")

    def _begin(self, reign: Reign | None) -> None:
        if self._keeps_disks and self._last is not None and reign is not None and reign.epoch <= self._last.epoch:
            raise Violation("epochs rise", f"epoch {reign.epoch} of {reign.leader} after {self._last.epoch}")
        self._last = reign


def _obeyed(peer: SimulatedPeer) -> Reign | None:
    """Whose orders are in force at a peer now."""
    if peer.allegiance is None:
        return None
    obedience = peer.allegiance.election.obedience
    return obedience.last if peer.now_s < obedience.until_s else None


def _process(reign: Reign) -> tuple[str, int]:
    return reign.leader, reign.incarnation
