"""Whom a peer obeys, and until when by its own clock: late orders are refused on arrival, not taken for fresh ones.

Clocks of different machines share no zero, so that nobody can read the age of an order off a time stamp. Instead every
peer says *marks*, one with each vote, and remembers when. A leader's :class:`~protocol.messages.Warrant` brings back
the latest mark that it had heard of each peer and for how long it has had it, and says how much of its lease was left.
From when the leader heard the mark it was that age and that rest until its lease ends; the hearer counts both from when
it *said* the mark, which was earlier. Two clocks measure that time, and :data:`~protocol.ballot.CAUTION` covers what
they differ by. So nobody obeys an order when the lease has ended that it was given in, however long it was on its way,
by all clocks within :data:`protocol.ballot.CLOCK_DRIFT`. Hence at any moment all who obey anybody obey one and the same
leader.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from protocol.ballot import CAUTION
from protocol.messages import Authority, Reign, Warrant
from protocol.voter import Voter

MARK_EVERY_S: Final = 0.01
"""Marks said in quicker succession are one mark, so that floods of requests do not fill the memory."""

Refusal: TypeAlias = Literal[
    "",
    "of another leader than it names",
    "of a leader that it has not promised its vote",
    "stale: its warrant has run out or was never for this process",
    "of an earlier epoch than the one obeyed before",
    "older than an order taken before",
]
"""Why an order is not taken; empty: it is."""


@dataclass(frozen=True, slots=True)
class Obeys:
    """From now on orders of this reign are in force; also those of this peer itself."""

    reign: Reign


@dataclass(frozen=True, slots=True)
class ObeysNobody:
    """No order is in force any more: hold."""

    reason: str


class Obedience:
    """What one peer needs to judge orders. Times are of its own clock, in seconds.

    Args:
        name, incarnation: of this peer.
        lease_s: how long a promise runs.
        voter: its promises; None if it has no vote. A voter obeys only the peer that it promised last: hence the
            epoch that it obeys is on its disk.
    """

    def __init__(self, name: str, incarnation: int, lease_s: float, voter: Voter | None) -> None:
        self.last: Reign | None = None
        """Whom it obeyed last."""
        self.until_s = -math.inf
        """Until when it obeys; later orders put it off."""
        self._name = name
        self._incarnation = incarnation
        self._most_s = CAUTION * lease_s
        self._voter = voter
        self._marks = 0
        self._said_s: dict[str, float] = {}
        self._taken: dict[str, tuple[int, int]] = {}
        self._told: Reign | None = None

    def mark(self, now_s: float) -> str:
        """A mark to be said now."""
        self._said_s = {mark: said_s for mark, said_s in self._said_s.items() if now_s < said_s + self._most_s}
        latest = next(reversed(self._said_s), None)
        if latest is not None and now_s < self._said_s[latest] + MARK_EVERY_S:
            return latest
        self._marks += 1
        mark = f"{self._incarnation}.{self._marks}"
        self._said_s[mark] = now_s
        return mark

    def obeyed(self, now_s: float) -> Reign | None:
        """Whose orders are in force; None: hold."""
        return self.last if now_s < self.until_s else None

    def heed(self, reign: Reign, warrant: Warrant, now_s: float) -> Refusal:
        """Judge somebody's claim to lead; obey them if it holds good."""
        if self._voter is not None and not self._voter.has_promised(reign):
            return "of a leader that it has not promised its vote"
        until_s = self._end_s(warrant)
        if now_s >= until_s:
            return "stale: its warrant has run out or was never for this process"
        if self.last is None or reign.epoch > self.last.epoch:
            self.last, self.until_s = reign, until_s
        elif reign != self.last:
            return "of an earlier epoch than the one obeyed before"
        self.until_s = max(self.until_s, until_s)
        return ""

    def take(self, kind: str, authority: Authority, reign: Reign, warrant: Warrant, now_s: float) -> Refusal:
        """Judge an order, of oneself too. One that is taken is in force as long as its reign is :meth:`obeyed`.

        Args:
            kind: of the message. Orders of one kind replace each other; those of different kinds may overtake.
            authority: of the order.
            reign: who gave it: epoch of the authority, sender and incarnation of the envelope.
            warrant: that came with it.
            now_s: when it arrived.
        """
        if authority.leader != reign.leader:
            return "of another leader than it names"
        refusal = self.heed(reign, warrant, now_s)
        if refusal:
            return refusal
        order = (authority.epoch, authority.sequence)
        if order <= self._taken.get(kind, (-1, -1)):
            return "older than an order taken before"
        self._taken[kind] = order
        return ""

    def changes(self, now_s: float) -> list[Obeys | ObeysNobody]:
        """What is new since this was asked last."""
        before, self._told = self._told, self.obeyed(now_s)
        if self._told == before:
            return []
        if self._told is not None:
            return [Obeys(self._told)]
        return [ObeysNobody(f"no word in time from {before.leader}")] if before is not None else []

    def _end_s(self, warrant: Warrant) -> float:
        for heard in warrant.marks:
            if heard.peer == self._name:
                rest_s = min(CAUTION * (warrant.lease_s + heard.age_s), self._most_s)
                return self._said_s.get(heard.mark, -math.inf) + rest_s
        return -math.inf
