"""What is said about where an agent is that tells nobody: ranges, and who has which (docs/shared-estimate.md)."""

from __future__ import annotations

from typing import Annotated

import msgspec

from protocol.wire_types import Body, Coordinate, Correlation, Count, Extent, Name, Point


class RangeRequest(Body, frozen=True, kw_only=True, tag="range_request"):
    """How far are you? Asked of the tracked agent's radio at ``ranging.rate_hz``, by who measures where it is.

    The built-in radio is the agent's process; with a real one neither this nor the reply crosses the wire.
    """

    position: Point
    """Where the sender is: the radio answers if it is in line of sight of that, and else not."""
    correlation: Correlation


class RangeReply(Body, frozen=True, kw_only=True, tag="range_reply"):
    """The answer to a :class:`RangeRequest`: the distance when it was answered."""

    asker: Name
    correlation: Correlation
    """Of the request."""
    range_m: Extent
    bound_m: Extent
    """The true distance lies in [range_m - bound_m, range_m + bound_m]."""


class SharedRange(msgspec.Struct, frozen=True, kw_only=True):
    """One range, as all peers keep it. Named by (owner, start, number)."""

    owner: Name
    """Who measured it."""
    start: Count
    """Incarnation of the process that measured it: one that starts again counts from 0."""
    number: Count
    """That process's own count of its ranges, from 0."""
    time_s: float
    """Mission time by the owner's clock; never falls with the number."""
    anchor: Point
    """Where the owner was."""
    range_m: Extent
    bound_m: Extent
    """By this the distance from the anchor to where the agent is at ``time_s`` differs from ``range_m``, at most."""


class Ranges(Body, frozen=True, kw_only=True, tag="ranges"):
    """Ranges that others may lack: the sender's own as it measures them, and anybody's whom a digest shows to lack."""

    ranges: Annotated[tuple[SharedRange, ...], msgspec.Meta(min_length=1, max_length=64)]


class HeardRanges(msgspec.Struct, frozen=True, kw_only=True):
    """Which ranges of one process somebody has."""

    owner: Name
    start: Count
    below: Count
    """All of lower numbers."""
    beyond: Annotated[tuple[Count, ...], msgspec.Meta(max_length=256)] = ()
    """And these."""


class RangeDigest(Body, frozen=True, kw_only=True, tag="range_digest"):
    """Which ranges the sender has: who has others that it lacks sends them. Said once a second."""

    clock_s: float
    """Mission time by the sender's clock: it stamps no range earlier from now on."""
    heard: Annotated[tuple[HeardRanges, ...], msgspec.Meta(max_length=256)]


class ConvexPiece(msgspec.Struct, frozen=True, kw_only=True):
    """A part of a set."""

    corners: Annotated[tuple[Point, ...], msgspec.Meta(min_length=3, max_length=16)]
    """Counter-clockwise, from the set's origin."""
    checked_m: Extent
    """How wide the piece was when all remembered rings were cut out of it."""


class Ring(msgspec.Struct, frozen=True, kw_only=True):
    """What one range leaves: all between two circles."""

    center: Point
    """From the set's origin."""
    inner_m: Coordinate
    """Negative: there is no inner circle."""
    outer_m: Extent


class RangeBase(Body, frozen=True, kw_only=True, tag="range_base"):
    """The set that the oldest ranges leave, which nobody keeps any more: for who joins late or was away for long."""

    time_s: float
    """Of the last range that is in the set, whose name follows."""
    owner: Name
    start: Count
    number: Count
    heard: Annotated[tuple[HeardRanges, ...], msgspec.Meta(max_length=256)]
    """Which ranges are in the set, or come too late to be."""
    fingerprint: Count
    """Of all the ranges in the set."""
    origin: Point
    pieces: Annotated[tuple[ConvexPiece, ...], msgspec.Meta(min_length=1, max_length=512)]
    """The agent was in one of them."""
    rings: Annotated[tuple[Ring, ...], msgspec.Meta(max_length=64)]
    """Of the last ranges; they are cut out again as the set becomes thinner."""
    rejections: Count
    """How many of the last ranges have contradicted the set."""
    anchor: Point | None = None
    """Where the last range was measured from; none if it contradicted the set."""
    slack_m: Extent = 0.0
    """The agent was in sight of the anchor, or had gone away so far since."""
