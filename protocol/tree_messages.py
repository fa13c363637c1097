"""What is said about the tree of links: proposals, answers and auctions (docs/topology.md)."""

from __future__ import annotations

from typing import Annotated

import msgspec

from protocol.leading_messages import Authority, Warrant
from protocol.moving_messages import Placement
from protocol.wire_types import Body, Count, Edge, Extent, Method, Name, Point, Share, Text, TreeNumber, Verdict


class Tree(msgspec.Struct, frozen=True, kw_only=True):
    """Who is to be linked with whom: a tree that joins all of its members, and nobody else."""

    number: TreeNumber
    members: Annotated[tuple[Name, ...], msgspec.Meta(min_length=1, max_length=64)]
    edges: Annotated[tuple[Edge, ...], msgspec.Meta(max_length=63)]
    reason: Text
    """Why it took the place of the tree before."""


class Milestone(msgspec.Struct, frozen=True, kw_only=True):
    """The beginning of a stage of the team's motion."""

    epoch: Count
    plan: Count
    revision: Count
    stage: Count


class NewLink(msgspec.Struct, frozen=True, kw_only=True):
    """A link that a tree has and the one before had not."""

    ends: Edge
    since: Milestone | None = None
    """From when on the ends are to see each other, as far as the motion goes; none: at once, where they stand."""


class TreeProposal(msgspec.Struct, frozen=True, kw_only=True):
    """The next tree. It is in force when both ends of every new link have confirmed it, and the leader says so."""

    tree: Tree
    links: Annotated[tuple[NewLink, ...], msgspec.Meta(max_length=63)]
    """The new ones: in an epoch's first tree all of them."""
    released: Annotated[tuple[Edge, ...], msgspec.Meta(max_length=63)]
    """Links of the tree before that this one does without."""
    method: Method
    round: Count
    """How often it has been said before; it is given up after a few rounds."""


class Topology(Body, frozen=True, kw_only=True, tag="topology"):
    """The leader's standing word on the team's tree: what is in force, and at most one proposal to change it.

    Repeated. While a proposal is open the links of the tree in force are kept.
    """

    authority: Authority
    warrant: Warrant
    committed: Tree | None = None
    """The tree in force; none: there has been none yet."""
    proposal: TreeProposal | None = None
    """Missing again: it is in force, or has been given up."""


class LinkView(msgspec.Struct, frozen=True, kw_only=True):
    """What one end says of a new link of its own."""

    peer: Name
    """The other end."""
    verdict: Verdict
    reason: Text = ""
    """Why it refuses."""


class Confirmation(Body, frozen=True, kw_only=True, tag="confirmation"):
    """A peer's standing answer to the leader's word on the tree. Repeated; new links not judged yet are left out."""

    proposal: TreeNumber | None = None
    """The one that ``views`` are about."""
    views: Annotated[tuple[LinkView, ...], msgspec.Meta(max_length=63)] = ()
    """On those new links that the speaker is an end of."""
    committed: Tree | None = None
    """The last tree in force that it knows of: what a new leader starts from."""


class Aim(msgspec.Struct, frozen=True, kw_only=True):
    """What a chain may be for: places where the agent may be, now or some metres on."""

    places: Annotated[tuple[Point, ...], msgspec.Meta(min_length=1, max_length=2000)]
    shares: Annotated[tuple[Share, ...], msgspec.Meta(min_length=1, max_length=2000)]
    """What each place counts for, of sum 1."""
    ahead_m: Extent
    """So far the agent has to go until it is at the farthest of them."""


class Auction(Body, frozen=True, kw_only=True, tag="auction"):
    """The leader asks what could be gained by another link in the place of one of the present tree's.

    Every robot evaluates all links that could stand in the place of its own, the one towards the base station; the last
    relay also that to the agent. Repeated until it closes.
    """

    authority: Authority
    warrant: Warrant
    auction: Count
    """Number of the auction in this epoch."""
    center: Point
    """In the middle of where the agent is."""
    aims: Annotated[tuple[Aim, ...], msgspec.Meta(min_length=1, max_length=16)]
    """What chains are asked for."""
    robots: Annotated[tuple[Placement, ...], msgspec.Meta(max_length=64)]
    """Where the robots are that can be counted on."""
    standing: Annotated[tuple[Name, ...], msgspec.Meta(max_length=64)]
    """The relays of the present chain from the base station outward."""
    obstacles: Annotated[tuple[Point, ...], msgspec.Meta(max_length=1000)] = ()
    """Where nobody can stand."""


class Offer(msgspec.Struct, frozen=True, kw_only=True):
    """The best chain that a bidder has found for an aim."""

    aim: Count
    """Its place in the auction's list."""
    whole: bool
    """Whether the last relay sees all of its places."""
    total_cost_m: Extent
    """What the chain costs, in metres: driving, relays and links."""
    cost: Extent
    """Sum of the links' virtual weights."""
    relays: Annotated[tuple[Placement, ...], msgspec.Meta(max_length=64)]
    """From the base station outward."""
    removed: Edge | None = None
    """The link that it does without; none: the tree is kept."""
    added: Edge | None = None
    """The link in its place."""


class Bid(Body, frozen=True, kw_only=True, tag="bid"):
    """The answer to an :class:`Auction`; the same again if that is said again."""

    epoch: Count
    auction: Count
    offers: Annotated[tuple[Offer, ...], msgspec.Meta(max_length=64)]
    """At most one for each aim; none where the bidder has found no chain."""
