"""How a leader changes the team's tree: make before break, in few rounds, one change at a time.

A *proposal* names the next tree and the links that it has and the tree in force has not. Both ends of each of these say
whether they see each other, or will from a stated stage of the motion on. Only when all have said so is the tree in
force, and only then are links of the one before released. What is not confirmed within :data:`ROUNDS` rounds is given
up, with a reason that names who is missing. Standing words carry all of this: they are repeated, and the latest says
all that the ones before said, so that loss costs nothing but time.

Trees are in one order, by epoch and number. A new leader takes over the highest that it is told of, and gives up what
its predecessor left open. It relies on nothing that it has not heard itself: in an epoch's first tree every link counts
as new. So no harm comes of a tree that was in force and is known to nobody any more.

After a change the tree rests for a while, unless it does not serve any more.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Final, TypeAlias

from msgspec import structs

from protocol.core import Heard, Note, Tick, WakeAt
from protocol.messages import Confirmation, Edge, Method, Milestone, NewLink, Tree, TreeNumber, TreeProposal
from protocol.topology import find_fault, in_words, links_of, without
from protocol.topology_states import TRANSITIONS, Occurrence, Phase

ROUND_S: Final = 0.25
"""The word on the tree is said again after this."""

ROUNDS: Final = 8
"""A proposal is said so often at most."""

COLLECTING_S: Final = 0.5
"""A new leader waits so long for what the others know."""

REST_S: Final = 1.0
"""So long after a change there is no other, unless the tree does not serve any more."""


class InvalidProposal(ValueError):
    """What is proposed is no tree, cannot be confirmed, or comes at a time when nothing can be proposed."""


@dataclass(frozen=True, slots=True)
class Elected:
    """From now on this peer leads, in this epoch."""

    epoch: int
    present: frozenset[str]
    """Who is there to be asked."""


@dataclass(frozen=True, slots=True)
class Deposed:
    """It leads no more."""


@dataclass(frozen=True, slots=True)
class Propose:
    """Make another tree the one in force; only when :meth:`Negotiation.may_propose`."""

    members: tuple[str, ...]
    edges: tuple[Edge, ...]
    since: Mapping[frozenset[str], Milestone]
    """From when on the ends of a link will see each other; links that are not in it: now."""
    method: Method
    reason: str
    absent: frozenset[str] = frozenset()
    """Who stands and is not there to answer: of a link to them only the other end is asked."""


@dataclass(frozen=True, slots=True)
class Withdraw:
    """Give the open proposal up, if there is one."""

    reason: str


@dataclass(frozen=True, slots=True)
class Word:
    """Say this now, as the leader's :class:`~protocol.messages.Topology`."""

    committed: Tree | None
    proposal: TreeProposal | None


@dataclass(frozen=True, slots=True)
class Settled:
    """A proposal is not open any more."""

    proposal: TreeProposal
    before: Tree | None
    """The tree that was in force when it was made."""
    committed: bool
    """Whether its tree is in force now."""
    duration_s: float
    reason: str
    """Why it was made, or why it has been given up."""
    absent: frozenset[str]
    """Ends of its links that were not asked, since they were not there."""


Event: TypeAlias = Elected | Deposed | Propose | Withdraw | Heard | Tick
Effect: TypeAlias = Word | Settled | Note | WakeAt


@dataclass(slots=True)
class _Open:
    """The proposal under way."""

    proposal: TreeProposal
    opened_s: float
    absent: frozenset[str]


@dataclass(slots=True)
class _Heard:
    incarnation: int = -1
    word: Confirmation = field(default_factory=Confirmation)


class Negotiation:
    """One peer's part as the leader. Times are of its own clock, in seconds.

    Args:
        voices: who can confirm: base station and robots. Of a link to anybody else only the other end is asked.
    """

    def __init__(self, voices: Collection[str]) -> None:
        self.phase = Phase.IDLE
        self.committed: Tree | None = None
        """The tree in force, as far as this peer knows."""
        self._voices = frozenset(voices)
        self._epoch = -1
        self._sequence = 0
        self._open: _Open | None = None
        self._asked: frozenset[str] = frozenset()
        self._heard: dict[str, _Heard] = {}
        self._until_s = math.inf
        """When collecting ends."""
        self._rests_until_s = -math.inf
        self._says_at_s = math.inf
        self._effects: list[Effect] = []

    @property
    def proposal(self) -> TreeProposal | None:
        """The open proposal."""
        return None if self._open is None else self._open.proposal

    def is_in_force(self, members: Collection[str], edges: Collection[Edge]) -> bool:
        """Whether this tree is the one in force, confirmed in this reign."""
        tree = self.committed
        return (
            tree is not None
            and self._confirmed_here(tree)
            and set(tree.members) == set(members)
            and links_of(tree.edges) == links_of(edges)
        )

    def may_propose(self, now_s: float, urgent: bool) -> bool:
        """Whether a change may be proposed now.

        Args:
            now_s: the time.
            urgent: the tree in force does not serve any more.
        """
        return self.phase is Phase.KEEPING and (urgent or now_s >= self._rests_until_s)

    def unconfirmed(self) -> tuple[str, ...]:
        """Peers that have not confirmed all of their new links in the open proposal."""
        if self._open is None:
            return ()
        ends = (end for link in self._open.proposal.links for end in link.ends)
        return tuple(dict.fromkeys(end for end in ends if self._verdicts_missing(end)))

    def handle(self, event: Event, now_s: float) -> list[Effect]:
        """Effects of one event; the last says when to send the next :class:`~protocol.core.Tick`.

        Raises:
            InvalidProposal: what is proposed is no tree, or :meth:`may_propose` said no whatever the urgency.
        """
        if self._open is not None and now_s >= self._open.opened_s + ROUNDS * ROUND_S:
            self._give_up(Occurrence.ROUNDS_ENDED, self._name_missing(), now_s)
        match event:
            case Elected():
                self._begin(event, now_s)
            case Deposed():
                self._end(now_s)
            case Propose():
                self._propose(event, now_s)
            case Withdraw(reason):
                if self._open is not None:
                    self._give_up(Occurrence.WITHDRAWN, reason, now_s)
            case Heard(peer, incarnation, Confirmation() as word):
                self._hear(peer, incarnation, word, now_s)
            case Heard() | Tick():
                pass
        if self.phase is Phase.COLLECTING and (now_s >= self._until_s or self._all_have_said()):
            self._settle_predecessor()
            self._occur(Occurrence.COLLECTED)
        if self.phase is not Phase.IDLE and now_s >= self._says_at_s:
            if self._open is not None:
                self._open.proposal = structs.replace(self._open.proposal, round=self._open.proposal.round + 1)
            self._say(now_s)
        self._effects.append(WakeAt(self._next_s()))
        effects, self._effects = self._effects, []
        return effects

    def _next_s(self) -> float:
        if self.phase is Phase.IDLE:
            return math.inf
        end_s = self._until_s if self.phase is Phase.COLLECTING else math.inf
        if self._open is not None:
            end_s = self._open.opened_s + ROUNDS * ROUND_S
        return min(self._says_at_s, end_s)

    def _occur(self, occurrence: Occurrence) -> None:
        self.phase = TRANSITIONS[self.phase][occurrence]

    def _begin(self, event: Elected, now_s: float) -> None:
        if self._open is not None:
            self._drop("the leader has a new epoch", now_s)
        self._occur(Occurrence.ELECTED)
        self._epoch, self._sequence = event.epoch, 0
        self._asked = event.present & self._voices
        self._heard.clear()
        self._until_s = now_s + COLLECTING_S
        self._rests_until_s = -math.inf
        self._says_at_s = now_s

    def _end(self, now_s: float) -> None:
        if self.phase is not Phase.IDLE:
            if self._open is not None:
                self._drop("its leader leads no more", now_s)
            self._occur(Occurrence.LEASE_ENDED)

    def _propose(self, wish: Propose, now_s: float) -> None:
        if not self.may_propose(now_s, urgent=True):
            raise InvalidProposal(f"nothing can be proposed while the negotiation is {self.phase.value}")
        tree = Tree(
            number=(self._epoch, self._sequence), members=wish.members, edges=wish.edges, reason=wish.reason[:500]
        )
        if fault := find_fault(tree):
            raise InvalidProposal(f"what is proposed is no tree: {fault}")
        before = self.committed
        kept = before.edges if before is not None and self._confirmed_here(before) else ()
        links = without(tree.edges, kept)
        for edge in links:
            if not self._voices.intersection(edge):
                raise InvalidProposal(f"nobody can confirm the link {in_words([edge])}")
        proposal = TreeProposal(
            tree=tree,
            links=tuple(NewLink(ends=edge, since=wish.since.get(frozenset(edge))) for edge in links),
            released=() if before is None else without(before.edges, tree.edges),
            method=wish.method,
            round=0,
        )
        self._sequence += 1
        self._open = _Open(proposal, now_s, wish.absent)
        self._occur(Occurrence.PROPOSED)
        self._say(now_s)
        self._commit_if_confirmed(now_s)

    def _hear(self, peer: str, incarnation: int, word: Confirmation, now_s: float) -> None:
        if peer not in self._voices or self.phase is Phase.IDLE:
            return
        known = self._heard.setdefault(peer, _Heard())
        if incarnation < known.incarnation:
            return
        self._heard[peer] = _Heard(incarnation, word)
        if word.committed is not None:
            self._take_over(word.committed)
        if self._open is None or word.proposal != self._open.proposal.tree.number:
            return
        refusals = [view for view in word.views if view.verdict == "refuses"]
        if refusals:
            why = refusals[0].reason
            self._give_up(Occurrence.REFUSED, f"{peer} refuses the link with {refusals[0].peer}: {why}"[:500], now_s)
        else:
            self._commit_if_confirmed(now_s)

    def _take_over(self, tree: Tree) -> None:
        """Start from a tree of an earlier reign, if it is the highest."""
        later = self.committed is None or tree.number > self.committed.number
        if later and tree.number[0] < self._epoch and not find_fault(tree):
            self.committed = tree

    def _commit_if_confirmed(self, now_s: float) -> None:
        """Put the open proposal's tree in force if both ends of every new link have confirmed it."""
        if self._open is None or self.unconfirmed():
            return
        done, before, self._open = self._open, self.committed, None
        self.committed = done.proposal.tree
        self._rests_until_s = now_s + REST_S
        self._occur(Occurrence.CONFIRMED)
        proposal, took_s = done.proposal, now_s - done.opened_s
        self._effects.append(Settled(proposal, before, True, took_s, proposal.tree.reason, done.absent))
        self._say(now_s)

    def _give_up(self, occurrence: Occurrence, reason: str, now_s: float) -> None:
        self._drop(reason, now_s)
        self._occur(occurrence)
        self._rests_until_s = now_s + REST_S
        self._say(now_s)

    def _drop(self, reason: str, now_s: float) -> None:
        assert self._open is not None
        done, self._open = self._open, None
        self._effects.append(Settled(done.proposal, self.committed, False, now_s - done.opened_s, reason, done.absent))

    def _say(self, now_s: float) -> None:
        self._says_at_s = now_s + ROUND_S
        self._effects.append(Word(self.committed, self.proposal))

    def _verdicts_missing(self, end: str) -> bool:
        """Whether this end of new links has yet to say that it sees, or will see, all of their other ends."""
        assert self._open is not None
        if end not in self._voices or end in self._open.absent:
            return False
        known = self._heard.get(end)
        if known is None or known.word.proposal != self._open.proposal.tree.number:
            return True
        seen = {view.peer for view in known.word.views if view.verdict != "refuses"}
        own = (link.ends for link in self._open.proposal.links if end in link.ends)
        return not all(seen.intersection(ends) for ends in own)

    def _name_missing(self) -> str:
        return f"no answer in {ROUNDS} rounds from {', '.join(self.unconfirmed())}"

    def _confirmed_here(self, tree: Tree) -> bool:
        """Whether a tree was confirmed in this reign: of one before nothing is known for sure."""
        return tree.number[0] == self._epoch

    def _all_have_said(self) -> bool:
        return all(peer in self._heard for peer in self._asked)

    def _settle_predecessor(self) -> None:
        """Give up what an earlier leader has left open: whether it came into force nobody can know."""
        left: list[TreeNumber] = [
            known.word.proposal
            for known in self._heard.values()
            if known.word.proposal is not None and known.word.proposal[0] < self._epoch
        ]
        number = max(left, default=None)
        if number is not None and (self.committed is None or number > self.committed.number):
            text = f"proposal {number[1]} of epoch {number[0]} was left open by its leader, and is given up"
            self._effects.append(Note("info", text))
