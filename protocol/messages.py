"""What crosses the wire: one envelope, one tagged body per kind, JSON.

An envelope says who speaks (``sender``, ``incarnation``), in which order (``sequence``) and when (``sent_at_s``). Its
body is one of :data:`AnyBody`, each in the file of what it is about; the tag ``kind`` is in the key, too
(:mod:`protocol.keys`). Kinds can overtake one another on the way, so that a reader tells old from new by (incarnation,
sequence) within a kind.

Positions are metres in the map frame. Unknown fields are ignored, so that a minor addition does not break an older
reader; a change of meaning raises :data:`SCHEMA_VERSION`, and a reader refuses a schema that it does not know.
"""

from __future__ import annotations

from typing import Final, Literal, TypeAlias

import msgspec

from protocol.leading_messages import Authority, LastHeard, Reign, Vote, VoteRequest, Warrant
from protocol.moving_messages import (
    Deployment,
    Goal,
    GoalReply,
    Heartbeat,
    Intent,
    MemberWay,
    Motion,
    Placement,
    Progress,
    State,
)
from protocol.range_messages import (
    ConvexPiece,
    HeardRanges,
    RangeBase,
    RangeDigest,
    RangeReply,
    RangeRequest,
    Ranges,
    Ring,
    SharedRange,
)
from protocol.tree_messages import (
    Aim,
    Auction,
    Bid,
    Confirmation,
    LinkView,
    Milestone,
    NewLink,
    Offer,
    Topology,
    Tree,
    TreeProposal,
)
from protocol.wire_types import (
    Body,
    Connection,
    Coordinate,
    Correlation,
    Count,
    Edge,
    Extent,
    Method,
    Mode,
    Name,
    Point,
    RoleName,
    Seconds,
    Share,
    Text,
    TreeNumber,
    Verdict,
)

__all__ = [
    "BODIES",
    "MAXIMUM_PAYLOAD_BYTES",
    "PERIODIC_KINDS",
    "SCHEMA_VERSION",
    "STANDING_KINDS",
    "STANDS_FOR_S",
    "Aim",
    "AnyBody",
    "Auction",
    "Authority",
    "Bid",
    "Body",
    "Confirmation",
    "Connection",
    "ConvexPiece",
    "Coordinate",
    "Correlation",
    "Count",
    "Deployment",
    "Edge",
    "Envelope",
    "Extent",
    "Goal",
    "GoalReply",
    "HeardRanges",
    "Heartbeat",
    "Intent",
    "LastHeard",
    "LinkView",
    "MalformedMessage",
    "MemberWay",
    "Method",
    "Milestone",
    "Mode",
    "Motion",
    "Name",
    "NewLink",
    "Offer",
    "Placement",
    "Point",
    "Progress",
    "RangeBase",
    "RangeDigest",
    "RangeReply",
    "RangeRequest",
    "Ranges",
    "Reign",
    "Ring",
    "RoleName",
    "Seconds",
    "Share",
    "SharedRange",
    "State",
    "Text",
    "Topology",
    "Tree",
    "TreeNumber",
    "TreeProposal",
    "Verdict",
    "Vote",
    "VoteRequest",
    "Warrant",
    "addressee_of",
    "decode",
    "encode",
    "kind_of",
]

SCHEMA_VERSION: Final = 1
"""Version of the payloads; part of every envelope and, as ``v1``, of every key."""

MAXIMUM_PAYLOAD_BYTES = 1 << 20
"""Longer payloads are refused before they are parsed."""

AnyBody: TypeAlias = (
    Heartbeat
    | State
    | Intent
    | Goal
    | GoalReply
    | Deployment
    | VoteRequest
    | Vote
    | Topology
    | Confirmation
    | Auction
    | Bid
    | RangeRequest
    | RangeReply
    | Ranges
    | RangeDigest
    | RangeBase
)

BODIES: dict[str, type[Body]] = {
    body.__struct_config__.tag: body  # type: ignore[misc]
    for body in (
        Heartbeat,
        State,
        Intent,
        Goal,
        GoalReply,
        Deployment,
        VoteRequest,
        Vote,
        Topology,
        Confirmation,
        Auction,
        Bid,
        RangeRequest,
        RangeReply,
        Ranges,
        RangeDigest,
        RangeBase,
    )
}
"""Kind → body."""

PERIODIC_KINDS: Final = frozenset(
    {
        "heartbeat", "state", "intent", "vote_request", "topology", "confirmation", "auction", "bid", "range_request",
        "range_digest", "range_base",
    }
)  # fmt: skip
"""Kinds of which only the latest matters: it says all that the ones before said."""

STANDING_KINDS: Final = frozenset(
    {"heartbeat", "state", "intent", "deployment", "topology", "confirmation", "range_digest"}
)
"""Kinds that are said again and again, so that who joins late hears them soon; who asks is answered at once."""

STANDS_FOR_S: Final = 2.0
"""What was said so long ago, and not again, does not stand any more: each kind is repeated once a second or more often,
unless a mission sets its rates lower than that."""


class Envelope(msgspec.Struct, frozen=True, kw_only=True):
    """One message as it stands on the wire."""

    schema: Literal[1] = SCHEMA_VERSION
    """Version of all that follows."""
    sender: Name
    """The speaker that the key names."""
    incarnation: Count
    """Greater than in the processes that bore this name before: a count of restarts, or the milliseconds since 1970
    at which the sender began."""
    sequence: Count
    """Rises by one with every message of an incarnation, over all kinds."""
    sent_at_s: float
    """Sender's wall clock, seconds since 1970-01-01 UTC (virtual seconds in simulation)."""
    body: AnyBody

    @property
    def kind(self) -> str:
        """Tag of the body."""
        return kind_of(self.body)


class MalformedMessage(ValueError):
    """A payload that is not an envelope of this schema; the text says what is wrong with it."""


def kind_of(body: Body) -> str:
    """Tag of a body, which is the kind in its key."""
    return str(body.__struct_config__.tag)


def addressee_of(body: Body) -> str:
    """The peer that a body is for, which its key names behind the kind; empty: all."""
    if isinstance(body, Vote):
        return body.candidate
    return body.asker if isinstance(body, RangeReply) else ""


_encoder = msgspec.json.Encoder()

_decoder = msgspec.json.Decoder(Envelope)


def encode(envelope: Envelope) -> bytes:
    """JSON of an envelope."""
    return _encoder.encode(envelope)


def decode(payload: bytes) -> Envelope:
    """Envelope of a payload from anywhere.

    Raises:
        MalformedMessage: the payload is too long, is no JSON, or does not fit the schema.
    """
    if len(payload) > MAXIMUM_PAYLOAD_BYTES:
        raise MalformedMessage(f"payload of {len(payload)} bytes, more than {MAXIMUM_PAYLOAD_BYTES}")
    try:
        return _decoder.decode(payload)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as problem:
        raise MalformedMessage(str(problem)) from problem
