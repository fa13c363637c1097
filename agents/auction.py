"""The auction: the search for the next tree, one edge away from the present one, by all who have a vote.

The leader says what is auctioned (:mod:`agents.lot`), and everybody looks for the best chain in which a link of its own
is another (:meth:`agents.bidding.Bidder.offers`), beside its control loop and all at the same time. The least of
what is offered is what the leader would have found alone with the search ``"one-edge"`` (thesis §3.6, algorithm 7); it
goes into the leader's plan in the place of that search.

An auction is bounded: it closes when all have bid, and at the latest after :data:`OPEN_S`. What has not been heard by
then is not missed for long, as there is a next one. Question and bids are repeated, so that loss costs only time. The
team goes on meanwhile: what is planned after it begins where the robots are by then.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final, Protocol

from agents.allegiance import AT_ONCE_S, Allegiance
from agents.lot import Bids, Lot, from_auction, to_auction
from agents.planning_job import Question
from agents.records import LogLine
from agents.role import Compute, Effect, Event, Heard, JobDone, Publish, Record
from protocol.messages import Auction, Authority, Bid, Offer

DESCRIBING: Final = "describing what is auctioned"
BIDDING: Final = "looking for an offer"
"""Names of the jobs."""

OPEN_S: Final = 0.25
"""An auction is open for so long at most."""

AGAIN_S: Final = 0.08
"""It is said again after this."""


class Planner(Protocol):
    """What is used of :class:`agents.team_planner.TeamPlanner`. Pure, so that it can run beside the control loop."""

    def lot(self, question: Question) -> Lot:
        """What to auction before a question is answered."""

    def bid(self, lot: Lot, bidder: str) -> tuple[Offer, ...]:
        """What a member of the team offers."""


@dataclass(slots=True)
class _Held:
    """An auction of this peer's own."""

    number: int = -1
    lot: Lot | None = None
    """None until it is described."""
    bidders: frozenset[str] = frozenset()
    bids: dict[str, tuple[Offer, ...]] = field(default_factory=dict)
    closes_s: float = math.inf
    again_s: float = math.inf


class Auctioneer:
    """Bids in the leader's auctions, and holds them while this peer leads.

    Args:
        allegiance: whose auctions count, and whether this peer leads.
        planner: this peer's own.
        base: name of the base station.
    """

    hears = frozenset({"auction", "bid"})

    def __init__(self, allegiance: Allegiance, planner: Planner, base: str) -> None:
        self.latest: Auction | None = None
        """The last question of another that was taken."""
        self._allegiance, self._planner, self._base = allegiance, planner, base
        self._name = allegiance.name
        self._numbers = self._said = 0
        self._held: _Held | None = None
        self._bids: Bids | None = None
        """Of an auction that has closed."""
        self._closed = False
        """Whether it has since this peer was woken."""
        self._wanted: tuple[int, int, Lot] | None = None
        """Epoch and number of the last auction heard, until a job looks for an offer."""
        self._bidding: tuple[int, int] | None = None
        """Those of the auction that the job is about."""
        self._bid: Bid | None = None
        """The last one."""
        self._missed: frozenset[str] = frozenset()
        self._effects: list[Effect] = []

    @property
    def next_s(self) -> float:
        """When an auction of its own is to be said again, or closes; at once when one has closed."""
        if self._closed:
            return AT_ONCE_S
        return math.inf if self._held is None else min(self._held.again_s, self._held.closes_s)

    @property
    def busy(self) -> bool:
        """Whether an auction is open, or its bids are waiting."""
        return self._held is not None or self._bids is not None

    def hold(self, question: Question) -> list[Effect]:
        """Hold an auction before a question is answered, unless :attr:`busy`."""
        self._held = _Held()
        return [Compute(DESCRIBING, self._planner.lot, (question,))]

    def take(self) -> Bids | None:
        """The bids of an auction that has closed, once; without any if nobody could be asked."""
        bids, self._bids = self._bids, None
        return bids

    def handle(self, event: Event, now_s: float) -> Iterable[Effect]:
        """Bid; take bids; close what is to be closed."""
        self._closed = False
        if self._bids is not None and not self._allegiance.leads(now_s):
            self._bids = None
        match event:
            case Heard(_, envelope) if isinstance(envelope.body, Auction):
                self._hear(envelope.body, envelope.sender, envelope.incarnation, now_s)
            case Heard(_, envelope) if isinstance(envelope.body, Bid):
                self._count(envelope.sender, envelope.body)
            case JobDone(job=name) if name == DESCRIBING:
                self._open(event, now_s)
            case JobDone(job=name) if name == BIDDING:
                self._offer(event)
        held = self._held
        if held is not None and held.lot is not None:
            if now_s >= held.closes_s or held.bids.keys() >= held.bidders or not self._allegiance.leads(now_s):
                self._close(held)
            elif now_s >= held.again_s:
                self._say(held, now_s)
        self._look_for_an_offer()
        effects, self._effects = self._effects, []
        return effects

    def _open(self, done: JobDone, now_s: float) -> None:
        """Open the auction, now that it is known what of."""
        held, reign = self._held, self._allegiance.reign
        if held is None:
            return
        if done.failure or reign is None:
            self._close(held)
            return
        lot: Lot = done.result
        self._numbers += 1
        held.number, held.lot, held.bidders = self._numbers, lot, frozenset((self._base, *lot.robots))
        held.closes_s = now_s + OPEN_S
        self._wanted = (reign.epoch, held.number, lot)
        self._say(held, now_s)

    def _say(self, held: _Held, now_s: float) -> None:
        reign, warrant = self._allegiance.reign, self._allegiance.warrant(now_s)
        held.again_s = now_s + AGAIN_S
        if reign is not None and warrant is not None and held.lot is not None:
            self._said += 1
            authority = Authority(epoch=reign.epoch, leader=self._name, sequence=self._said)
            self._effects.append(Publish(to_auction(held.lot, held.number, authority, warrant)))

    def _hear(self, auction: Auction, sender: str, incarnation: int, now_s: float) -> None:
        """Look for an offer, or make the one again that has been made."""
        if self._allegiance.take("auction", auction.authority, sender, incarnation, auction.warrant, now_s):
            return
        self.latest = auction
        order = (auction.authority.epoch, auction.auction)
        if self._bid is not None and order == (self._bid.epoch, self._bid.auction):
            self._effects.append(Publish(self._bid))
        elif order != self._bidding and (self._wanted is None or order != self._wanted[:2]):
            try:
                self._wanted = (*order, from_auction(auction))
            except ValueError as problem:
                self._log(f"cannot bid in auction {auction.auction} of {sender}: {problem}")

    def _look_for_an_offer(self) -> None:
        if self._wanted is not None and self._bidding is None:
            *order, lot = self._wanted
            self._bidding, self._wanted = (order[0], order[1]), None
            self._effects.append(Compute(BIDDING, self._planner.bid, (lot, self._name)))

    def _offer(self, done: JobDone) -> None:
        """Bid what has been found."""
        order, self._bidding = self._bidding, None
        if done.failure or order is None:
            self._log(f"could not look for an offer: {done.failure}")
            return
        self._bid = Bid(epoch=order[0], auction=order[1], offers=done.result)
        reign = self._allegiance.reign
        if reign is not None and reign.epoch == self._bid.epoch:
            self._count(self._name, self._bid)
        else:
            self._effects.append(Publish(self._bid))

    def _count(self, bidder: str, bid: Bid) -> None:
        held, reign = self._held, self._allegiance.reign
        if held is None or reign is None or (bid.epoch, bid.auction) != (reign.epoch, held.number):
            return
        if bidder in held.bidders and all(self._is_sound(offer, held) for offer in bid.offers):
            held.bids[bidder] = bid.offers

    def _is_sound(self, offer: Offer, held: _Held) -> bool:
        """Whether an offer is for an aim of the auction, and of robots that are in it, each in one place."""
        assert held.lot is not None
        relays = [relay.robot for relay in offer.relays]
        known = len(set(relays)) == len(relays) and all(robot in held.lot.robots for robot in relays)
        return offer.aim < len(held.lot.aims) and known and bool(relays)

    def _close(self, held: _Held) -> None:
        """Keep what has been offered until it is asked for."""
        self._held = None
        missed = held.bidders - held.bids.keys()
        if missed and missed != self._missed:
            self._log(f"auction {held.number} closed without the bids of {', '.join(sorted(missed))}")
        self._missed = missed
        self._closed = True
        self._bids = Bids(() if held.lot is None else held.lot.aims, dict(sorted(held.bids.items())))

    def _log(self, text: str) -> None:
        self._effects.append(Record(LogLine(level="warning", text=text)))
