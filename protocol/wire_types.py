"""Types of the fields of messages, whose limits are checked when a payload is read, and what all bodies share."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

import msgspec

Coordinate: TypeAlias = Annotated[float, msgspec.Meta(ge=-1e7, le=1e7)]
"""Bounded, so that no arithmetic on what others say overflows; JSON has neither NaN nor infinity."""

Point: TypeAlias = tuple[Coordinate, Coordinate]
"""x, y in metres, map frame; velocities in metres per second."""

Name: TypeAlias = Annotated[str, msgspec.Meta(pattern=r"^(?!operator$)[a-z][a-z0-9_]{0,31}$(?!\n)")]
"""A team's, peer's or operator's name: it is a chunk of a key (the same rule as :func:`protocol.keys.is_name`)."""

Text: TypeAlias = Annotated[str, msgspec.Meta(max_length=500)]
"""A sentence for people."""

Correlation: TypeAlias = Annotated[str, msgspec.Meta(min_length=1, max_length=64)]
"""Chosen by who asks, different each time; an answer bears that of its question."""

Count: TypeAlias = Annotated[int, msgspec.Meta(ge=0, le=2**53 - 1)]
"""Bounded by what every JSON reader holds exactly."""

Seconds: TypeAlias = Annotated[float, msgspec.Meta(ge=0.0)]
"""A duration."""

Share: TypeAlias = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]
"""A part of one whole."""

Extent: TypeAlias = Annotated[float, msgspec.Meta(ge=0.0, le=1e7)]
"""A radius in metres, or a speed in metres per second."""

RoleName: TypeAlias = Literal["base_station", "robot", "tracked_agent"]
"""What a peer is."""

Mode: TypeAlias = Literal["waiting", "moving", "yielding", "arrived", "holding", "retreating"]
"""What a peer's body does: it has no orders yet, drives, lets others go first, stands where it should, stands since
it was told to or has no order that it can follow, or goes back the way that it has come since nobody leads."""

Edge: TypeAlias = tuple[Name, Name]
"""A link of a tree between two members, in either order."""

TreeNumber: TypeAlias = tuple[Count, Count]
"""Epoch of the leader that proposed a tree, and its number in that epoch: later trees have greater numbers."""

Verdict: TypeAlias = Literal["sees", "will", "refuses"]
"""What the end of a link says of it: that it sees the other end, that it will where the proposal says, or neither."""

Method: TypeAlias = Literal["optimum", "auction"]
"""How a tree was found: by the leader's planner alone, or by the bids of all robots."""

Connection: TypeAlias = Literal["team", "joined", "none"]
"""What is certified of lines of sight: that the whole team is one network at all times, that some of its members are in
one network over any others, or nothing."""


class Body(msgspec.Struct, frozen=True, kw_only=True, tag_field="kind"):
    """Base of everything that can be said."""
