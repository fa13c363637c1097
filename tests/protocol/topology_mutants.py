"""Negotiations that break one rule each."""

from __future__ import annotations

from msgspec import structs

from protocol.held_tree import HeldTree
from protocol.messages import Edge, Topology, Tree
from protocol.negotiation import Effect, Elected, Event, Negotiation
from protocol.topology_states import Phase


class OneEndIsEnough(Negotiation):
    """Asks only the first end of each new link."""

    def unconfirmed(self) -> tuple[str, ...]:
        if self._open is None:
            return ()
        firsts = {link.ends[0] for link in self._open.proposal.links}
        return tuple(end for end in super().unconfirmed() if end in firsts)


class CommitsAtOnce(Negotiation):
    """Puts every proposal in force without asking."""

    def unconfirmed(self) -> tuple[str, ...]:
        return ()


class RefusalsCount(Negotiation):
    """Takes any answer for a confirmation."""

    def _hear(self, peer, incarnation, word, now_s):  # type: ignore[no-untyped-def]
        views = tuple(structs.replace(view, verdict="sees") for view in word.views)
        super()._hear(peer, incarnation, structs.replace(word, views=views), now_s)


class AnyProposalsAnswers(Negotiation):
    """Takes an answer to an earlier proposal for one to this."""

    def _verdicts_missing(self, end: str) -> bool:
        if self._open is not None and end in self._heard:
            word = structs.replace(self._heard[end].word, proposal=self._open.proposal.tree.number)
            self._heard[end].word = word
        return super()._verdicts_missing(end)


class TrustsItsPredecessor(Negotiation):
    """Takes the links of an earlier reign's tree for confirmed."""

    def _confirmed_here(self, tree: Tree) -> bool:
        return bool(tree.number)


class NeverGivesUp(Negotiation):
    """Keeps a proposal open for as long as it takes."""

    def handle(self, event: Event, now_s: float) -> list[Effect]:
        if self._open is not None:
            self._open.opened_s = now_s
        return super().handle(event, now_s)


class TwoAtATime(Negotiation):
    """Opens a proposal while another one is open, and forgets that."""

    def may_propose(self, now_s: float, urgent: bool) -> bool:
        if self.phase is Phase.PROPOSING:
            self.phase, self._open = Phase.KEEPING, None
        return super().may_propose(now_s, urgent)


class CountsFromZero(Negotiation):
    """Gives the numbers of an epoch twice."""

    def handle(self, event: Event, now_s: float) -> list[Effect]:
        if isinstance(event, Elected):
            event = Elected(max(event.epoch - 1, 1), event.present)
        return super().handle(event, now_s)


class ReleasesFirst(HeldTree):
    """Lets go of links as soon as a tree without them is proposed."""

    @property
    def links(self) -> tuple[Edge, ...]:
        if self.proposal is None:
            return super().links
        return tuple(edge for edge in super().links if edge not in self.proposal.released)


class MakesBeforeItIsInForce(HeldTree):
    """Goes over to the tree that is proposed."""

    def take(self, word: Topology) -> str:
        fault = super().take(word)
        if self.proposal is not None:
            self.committed = self.proposal.tree
        return fault


class GoesBack(HeldTree):
    """Takes whatever tree is said, whether it is later or earlier than the one it knows."""

    def take(self, word: Topology) -> str:
        if word.committed is not None:
            self.committed = word.committed
        return super().take(word)


NEGOTIATIONS = (
    OneEndIsEnough, CommitsAtOnce, RefusalsCount, AnyProposalsAnswers, TrustsItsPredecessor, NeverGivesUp, TwoAtATime,
    CountsFromZero,
)  # fmt: skip
HOLDERS = (ReleasesFirst, MakesBeforeItIsInForce, GoesBack)
