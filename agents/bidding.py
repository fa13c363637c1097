"""What a member of the team bids in an auction of the next tree, and what the bids of all come to.

The search is that of :mod:`agents.proposals` with ``"one-edge"``, divided: each bidder looks at the trees in which a
link of its own is another one (:mod:`planning.own_edges`).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import cached_property, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from agents.lot import Bids, Lot
from agents.proposals import (
    AGENT,
    BASE,
    Found,
    Proposal,
    Proposer,
    read_chain,
    relays_in_words,
    team_order,
    team_tree,
)
from agents.whereabouts import Aim
from planning.own_edges import exchange_own, own_edges
from protocol.messages import Offer, Point
from protocol.topology import in_words

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Bidder(Proposer):
    """Proposes chains, and bids for them."""

    def offers(self, lot: Lot, base: str, agent: str, bidder: str) -> tuple[Offer, ...]:
        """What a bidder has to offer in an auction: for each aim the best chain in which a link of its own is another.

        Own is the link towards the base station, and to the last relay, or the base station without one, that to the
        agent too: so each link is somebody's, and the least that all offer is what ``"one-edge"`` finds.

        Args:
            lot: what is auctioned.
            base: name of the base station.
            agent: name of the agent.
            bidder: name of who offers.
        """
        order = team_order(np.array(lot.center), lot.robots, lot.standing)
        names = [base, agent, *order]
        tree = team_tree(order, lot.standing)
        edges = own_edges(tree, BASE)
        own = [
            edge
            for node, edge in edges.items()
            if names[node] == bidder or (node == AGENT and names[edge[0] + edge[1] - AGENT] == bidder)
        ]
        drive = self._drives(order, lot.robots, lot.obstacles)
        offers = []
        for number, aim in enumerate(lot.aims):
            if self._direct(aim) is not None:
                continue
            found = self._serve(aim, order, drive, partial(self._find_near, tree=tree, own=own))
            if found is None:
                continue
            proposal, whole, exchange = found
            removed, added = (None if edge is None else (names[edge[0]], names[edge[1]]) for edge in exchange)
            offers.append(
                Offer(
                    aim=number, whole=whole, total_cost_m=proposal.total_cost_m or 0.0, cost=proposal.cost,
                    relays=proposal.relays, removed=removed, added=added,
                )
            )  # fmt: skip
        return tuple(offers)

    def award(self, bids: Bids, robots: Collection[str]) -> list[Proposal]:
        """The best that was offered for each aim; those that need no relay are nobody's to offer.

        An offer counts only if its relays would stand at placements of one's own, and see what it says that they see.

        Args:
            bids: of an auction.
            robots: that can still be counted on.
        """
        won: list[Proposal] = []
        for number, aim in enumerate(bids.aims):
            direct = self._direct(aim)
            offers = [
                (offer, name)
                for name, those in bids.offers.items()
                for offer in those
                if offer.aim == number
                and all(relay.robot in robots for relay in offer.relays)
                and self._holds(offer, aim)
            ]
            if direct is not None:
                won.append(direct)
            elif offers:
                offer, bidder = min(offers, key=lambda bid: (not bid[0].whole, bid[0].total_cost_m))
                purpose = aim.whole if offer.whole else aim.part
                how = "the tree as it is"
                if offer.removed is not None and offer.added is not None:
                    how = f"{in_words([offer.added])} for {in_words([offer.removed])}, bid by {bidder}"
                reason = f"{relays_in_words(len(offer.relays))} {purpose}; {how}"
                won.append(Proposal(offer.relays, True, reason, offer.cost, offer.total_cost_m))
        return won

    def _holds(self, offer: Offer, aim: Aim) -> bool:
        """Whether the chain that is offered is one: from link to link in sight, and of the aim what is claimed."""
        if not offer.relays:
            return False
        places = [self._places.get(relay.position) for relay in offer.relays]
        stops = [place for place in places if place is not None]
        if len(stops) < len(places) or self._crowded(stops):
            return False
        links = [self._from_base[stops[0]], *(self._links[hop] for hop in pairwise(stops))]
        sees = self._graph.sees_all(aim.places) if offer.whole else self._view(aim)[1] > 0.0
        return bool(np.isfinite(links).all() and sees[stops[-1]])

    @cached_property
    def _places(self) -> dict[Point, int]:
        """The placements by where they are: numbers are the same on the wire to the last bit."""
        return {(x, y): place for place, (x, y) in enumerate(self._graph.positions.tolist())}

    def _find_near(self, move: Floats, to_agent: Floats, tree: Ints, own: Collection[tuple[int, int]]) -> Found | None:
        """The chain of the trees in which one of some edges is another."""
        costs, W = self._as_tree(move, to_agent)
        found = exchange_own(costs, W, tree, [BASE, AGENT], own)
        if np.isinf(found.cost):
            return None
        return replace(read_chain(costs, found.tree, found.cells, 0.0), exchange=(found.removed, found.added))
