"""Who of the roster is there: by liveliness tokens *and* by what is heard, because each alone says too little.

A token is held by a process whose main thread may hang; a cut takes it away from a peer that a relay still carries;
and a process that has ended is missed within milliseconds by its token, but only after a while by its silence.

============  ===============  ======================  ====================================================
state         token            heard lately            that is
============  ===============  ======================  ====================================================
``unknown``   never seen       never                   not started yet, or a replacement kept in reserve
``present``   held or lost     yes                     lives, whatever its token says
``silent``    held             no                      starts, hangs, or is stopped: may go on at any moment
``gone``      lost             no                      has ended, or is cut off
============  ===============  ======================  ====================================================

A peer that is started again, or replaced, keeps its name and has a later incarnation; from then on nothing of an
earlier one counts, however late it arrives. Of peers that are not on the roster only their number is kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Final, TypeAlias

from protocol.bus import PeerAppeared, PeerVanished
from protocol.core import Heard, Note, Tick, WakeAt
from protocol.roster import Roster

SILENT_AFTER: Final = 3.5
"""Heartbeats that a peer may miss before it counts as silent: three lost ones, and a late one."""

GONE_AFTER: Final = 1.5
"""Heartbeats after the loss of a token in which its peer must be heard, or it counts as gone."""


class Presence(Enum):
    """What is known of a peer; the value is said to people."""

    UNKNOWN = "unknown"
    PRESENT = "present"
    SILENT = "silent"
    GONE = "gone"


@dataclass(frozen=True, slots=True)
class Changed:
    """A peer's state is another one now."""

    peer: str
    before: Presence
    presence: Presence
    reason: str


@dataclass(frozen=True, slots=True)
class Restarted:
    """The first message of a later incarnation: what was known of this peer's plans and promises is void."""

    peer: str
    incarnation: int


Event: TypeAlias = Heard | PeerAppeared | PeerVanished | Tick
Effect: TypeAlias = Changed | Restarted | Note | WakeAt


@dataclass(slots=True)
class _Known:
    presence: Presence = Presence.UNKNOWN
    incarnation: int = -1
    token: bool = False
    quiet_at_s: float = math.inf
    """When it will have been quiet for too long; infinite once that has been noticed."""


class Membership:
    """One peer's view of all others. Times are of its own clock, in seconds.

    Args:
        roster: of the team.
        name: of this peer, which is always present.
        heartbeat_s: time between two heartbeats. Whatever else a peer says shows that it lives just as well.
    """

    def __init__(self, roster: Roster, name: str, heartbeat_s: float) -> None:
        self.strangers = 0
        """Events of peers that are not on the roster."""
        self._roster = roster
        self._name = name
        self._heartbeat_s = heartbeat_s
        self._due_s = math.inf
        self._known = {peer: _Known() for peer in roster.names if peer != name}

    def handle(self, event: Event, now_s: float) -> list[Effect]:
        """Effects of one event; the last says when to send the next :class:`~protocol.core.Tick`."""
        effects: list[Effect] = []
        late_s = now_s - self._due_s
        for peer, known in self._known.items():
            if late_s > self._heartbeat_s:
                # This peer was asleep, and has yet to read what the others said meanwhile.
                known.quiet_at_s += late_s + self._heartbeat_s
            if now_s >= known.quiet_at_s:
                effects += self._fall_quiet(peer, known)
        if not isinstance(event, Tick) and event.peer != self._name:
            known_one = self._known.get(event.peer)
            if known_one is None:
                effects += self._meet_stranger(event.peer)
            else:
                effects += self._learn(known_one, event, now_s)
        self._due_s = min((known.quiet_at_s for known in self._known.values()), default=math.inf)
        effects.append(WakeAt(self._due_s))
        return effects

    @property
    def due_s(self) -> float:
        """When to send the next :class:`~protocol.core.Tick`; infinite: not before something else happens."""
        return self._due_s

    def refresh(self, peer: str, incarnation: int, now_s: float) -> bool:
        """Note in passing that a peer is heard which is there, as nearly always; False: :meth:`handle` has to see it.

        Does what :meth:`handle` would where that has no effect but a new :attr:`due_s`, in O(1) most times.
        """
        known = self._known.get(peer)
        if (
            known is None
            or known.incarnation != incarnation
            or known.presence is not Presence.PRESENT
            or now_s >= self._due_s
        ):
            return False
        before_s = known.quiet_at_s
        known.quiet_at_s = now_s + (SILENT_AFTER if known.token else GONE_AFTER) * self._heartbeat_s
        if before_s > self._due_s:
            self._due_s = min(self._due_s, known.quiet_at_s)
        else:
            self._due_s = min(other.quiet_at_s for other in self._known.values())
        return True

    def presence(self, peer: str) -> Presence:
        """State of a peer; one that is not on the roster is unknown for ever."""
        if peer == self._name:
            return Presence.PRESENT
        known = self._known.get(peer)
        return known.presence if known is not None else Presence.UNKNOWN

    def incarnation(self, peer: str) -> int:
        """The latest one heard of a peer; -1 before anything is, and for one that is not on the roster."""
        known = self._known.get(peer)
        return known.incarnation if known is not None else -1

    def is_there(self, peer: str, incarnation: int) -> bool:
        """Whether another peer is present, and this is its latest incarnation."""
        known = self._known.get(peer)
        return known is not None and known.presence is Presence.PRESENT and known.incarnation == incarnation

    def _learn(self, known: _Known, event: Heard | PeerAppeared | PeerVanished, now_s: float) -> list[Effect]:
        match event:
            case PeerAppeared(peer):
                known.token = True
                if known.presence is not Presence.PRESENT:
                    return self._change(
                        peer, known, Presence.SILENT, "its token has appeared, and nothing is heard yet"
                    )
            case PeerVanished(peer):
                known.token = False
                if known.presence is Presence.SILENT:
                    return self._change(peer, known, Presence.GONE, "silent, and its token has gone too")
                if known.presence is Presence.PRESENT:
                    known.quiet_at_s = min(known.quiet_at_s, now_s + GONE_AFTER * self._heartbeat_s)
            case Heard(peer, incarnation) if incarnation >= known.incarnation:
                restarted = 0 <= known.incarnation < incarnation
                known.incarnation = incarnation
                known.quiet_at_s = now_s + (SILENT_AFTER if known.token else GONE_AFTER) * self._heartbeat_s
                effects: list[Effect] = [Restarted(peer, incarnation)] if restarted else []
                return effects + self._change(peer, known, Presence.PRESENT, _why_present(known.presence, restarted))
        return []

    def _fall_quiet(self, peer: str, known: _Known) -> list[Effect]:
        known.quiet_at_s = math.inf
        if known.token:
            quiet_s = SILENT_AFTER * self._heartbeat_s
            return self._change(
                peer, known, Presence.SILENT, f"nothing heard for {quiet_s:.3g} s, yet its token is held"
            )
        return self._change(peer, known, Presence.GONE, "its token has gone, and nothing more is heard")

    def _change(self, peer: str, known: _Known, presence: Presence, reason: str) -> list[Effect]:
        before, known.presence = known.presence, presence
        return [Changed(peer, before, presence, reason)] if presence is not before else []

    def _meet_stranger(self, peer: str) -> list[Effect]:
        self.strangers += 1
        if self.strangers > 1:
            return []
        text = (
            f"{peer[:40]} is not on the roster and is not heard; start it under the name of the peer that it replaces"
        )
        return [Note("warning", text)]


def _why_present(before: Presence, restarted: bool) -> str:
    if before is Presence.UNKNOWN:
        return "heard for the first time"
    return "heard again, started anew" if restarted else "heard again"
