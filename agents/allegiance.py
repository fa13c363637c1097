"""Whom this peer follows, and who is there: election and membership as a part of its mind.

Whoever gives orders asks :meth:`Allegiance.warrant` for what must go with them; whoever hears one asks
:meth:`Allegiance.take` whether it counts, and carries it out only while :meth:`Allegiance.obeyed` names its reign.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, Literal

from msgspec import structs

from agents.records import LogLine, Office
from agents.role import Effect, Event, Heard, Publish, Record, Written
from protocol import core
from protocol.bus import PeerAppeared, PeerVanished
from protocol.core import Note, Persist, Say, Tick, WakeAt
from protocol.election import Effect as ElectionEffect
from protocol.election import Election, Leads, LeadsNoMore
from protocol.membership import Changed, Membership, Presence, Restarted
from protocol.membership import Effect as MembershipEffect
from protocol.messages import Authority, Reign, Vote, VoteRequest, Warrant
from protocol.obedience import Obeys, ObeysNobody
from protocol.roster import Roster

AT_ONCE_S: Final = float("-inf")
"""A time that has passed."""

TICK: Final = Tick()

WORDS: Final = (Vote, VoteRequest)
"""What is said in elections."""


class Allegiance:
    """See the module. Times are of this peer's own clock, in seconds.

    Args:
        roster: of the team.
        team, name, incarnation: of this peer. An incarnation must never be used twice.
        promise: the last one on this voter's disk.
        seed: of the waiting times.
        heartbeat_s: time between two heartbeats.
        now_s: the present time.
    """

    hears = frozenset({"vote", "vote_request", "heartbeat", "state", "intent", "range_reply"})
    """The last three because whoever says anything lives: with some loss, heartbeats alone are too few to tell."""

    def __init__(
        self,
        roster: Roster,
        *,
        team: str,
        name: str,
        incarnation: int,
        promise: Reign | None,
        seed: int,
        heartbeat_s: float,
        now_s: float,
    ) -> None:
        self.name, self.incarnation = name, incarnation
        self.election = Election(
            roster, team=team, name=name, incarnation=incarnation, promise=promise, seed=seed, now_s=now_s
        )
        self.membership = Membership(roster, name, heartbeat_s)
        self.is_there = self.membership.is_there
        self._election_s = self._membership_s = now_s
        self._office = Office(incarnation=incarnation, standing="", leads=None, obeys=None)
        """What was recorded last."""
        self._effects: list[Effect] = []

    @property
    def next_s(self) -> float:
        """When something of election or membership is due."""
        return self._election_s if self._election_s < self._membership_s else self._membership_s

    @property
    def reign(self) -> Reign | None:
        """The reign that this peer leads in."""
        return self.election.office

    @property
    def followed(self) -> Reign | None:
        """Whose orders it obeys, or has obeyed last."""
        return self.election.obedience.last

    @property
    def obeyed_until_s(self) -> float:
        """When orders in force end unless more is heard of their leader."""
        return self.election.obedience.until_s

    def leads(self, now_s: float) -> bool:
        """Whether this peer holds an unexpired lease."""
        return self.election.leads(now_s)

    def obeyed(self, now_s: float) -> Reign | None:
        """Whose orders are in force; None: hold."""
        return self.election.obedience.obeyed(now_s)

    def warrant(self, now_s: float) -> Warrant | None:
        """What goes with an order given now; None: no order may be given."""
        return self.election.warrant(now_s)

    def take(
        self, kind: str, authority: Authority, sender: str, incarnation: int, warrant: Warrant, now_s: float
    ) -> str:
        """Judge an order, one's own too: empty if it is in force as long as its reign is obeyed, else why not.

        Args:
            kind: of the message. Orders of one kind replace each other.
            authority: of the order.
            sender: of its envelope.
            incarnation: of the sender.
            warrant: of the order.
            now_s: when it arrived.
        """
        reign, before = Reign(epoch=authority.epoch, leader=sender, incarnation=incarnation), self.obeyed(now_s)
        refusal = self.election.obedience.take(kind, authority, reign, warrant, now_s)
        if self.obeyed(now_s) != before:
            self._election_s = AT_ONCE_S  # the election is to see that another leader is obeyed by that
        return refusal

    def presence(self, peer: str) -> Presence:
        """Whether a peer is there."""
        return self.membership.presence(peer)

    def handle(self, event: Event, now_s: float) -> Iterable[Effect]:
        """Pass an event on to election and membership, if it is for them or they are due, and do what they want."""
        word: core.Heard | Written | None = None
        if isinstance(event, Heard):
            envelope = event.envelope
            peer, incarnation, body = envelope.sender, envelope.incarnation, envelope.body
            if self.membership.refresh(peer, incarnation, now_s):
                self._membership_s = self.membership.due_s
            else:
                self._join(self.membership.handle(core.Heard(peer, incarnation, body), now_s))
            if isinstance(body, WORDS):
                word = core.Heard(peer, incarnation, body)
        elif isinstance(event, PeerAppeared | PeerVanished):
            self._join(self.membership.handle(event, now_s))
        elif isinstance(event, Written):
            word = event
        elif now_s >= self._membership_s:
            self._join(self.membership.handle(TICK, now_s))
        if word is not None or now_s >= self._election_s:
            ended_s = self.election.lease_until_s, self.obeyed_until_s
            self._vote(self.election.handle(word or TICK, now_s))
            self._note_office(*ended_s, now_s)
        if not self._effects:
            return ()
        effects, self._effects = self._effects, []
        return effects

    def _vote(self, effects: Iterable[ElectionEffect]) -> None:
        for effect in effects:
            match effect:
                case Say(body):
                    self._effects.append(Publish(body))
                case Persist():
                    self._effects.append(effect)
                case WakeAt(time_s):
                    self._election_s = time_s
                case Note(level, text):
                    self._log(level, text)
                case Leads(reign):
                    self._log("info", f"leads in epoch {reign.epoch}")
                case LeadsNoMore(reason):
                    self._log("warning", f"leads no more: {reason}")
                case Obeys(reign):
                    self._log("info", f"obeys {reign.leader} in epoch {reign.epoch}")
                case ObeysNobody(reason):
                    self._log("warning", f"obeys nobody: {reason}")

    def _join(self, effects: Iterable[MembershipEffect]) -> None:
        for effect in effects:
            match effect:
                case WakeAt(time_s):
                    self._membership_s = time_s
                case Note(level, text):
                    self._log(level, text)
                case Restarted(peer, incarnation):
                    self._log("info", f"{peer} is incarnation {incarnation} now: what was known of its plans is void")
                case Changed(peer, before, presence, reason):
                    self._log(_gravity(before, presence), f"{peer} is {presence.value}: {reason}")

    def _note_office(self, lease_until_s: float, obeyed_until_s: float, now_s: float) -> None:
        """Record who leads and who is obeyed, if that is new. What ended while this peer hung ended in its time."""
        before = self._office
        standing, leads, obeys = self.election.standing.value, self.reign, self.obeyed(now_s)
        if standing == before.standing and leads == before.leads and obeys == before.obeys:
            return
        self._office = office = structs.replace(before, standing=standing, leads=leads, obeys=obeys)
        self._effects.append(
            Record(
                structs.replace(
                    office,
                    led_until_s=min(now_s, lease_until_s) if before.leads not in (None, office.leads) else None,
                    obeyed_until_s=min(now_s, obeyed_until_s) if before.obeys not in (None, office.obeys) else None,
                )
            )
        )

    def _log(self, level: Literal["debug", "info", "warning", "error"], text: str) -> None:
        self._effects.append(Record(LogLine(level=level, text=text)))


def _gravity(before: Presence, presence: Presence) -> Literal["debug", "info", "warning"]:
    if presence is Presence.PRESENT:
        return "info"
    return "warning" if before is Presence.PRESENT else "debug"
