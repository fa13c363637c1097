"""What crosses the wire: one envelope, one tagged body per kind, JSON.

An envelope says who speaks (``sender``, ``incarnation``), in which order (``sequence``) and when (``sent_at_s``). Its
body is one of the structs below; the tag ``kind`` is also the last chunk of the key (:mod:`protocol.keys`). Kinds can
overtake one another on the way, so that a reader tells old from new by (incarnation, sequence) within a kind.

Positions are metres in the map frame. Unknown fields are ignored, so that a minor addition does not break an older
reader; a change of meaning raises :data:`SCHEMA_VERSION`, and a reader refuses a schema that it does not know.

The estimate, ranging, voting and topology negotiation add their own bodies when they land.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal, TypeAlias

import msgspec

SCHEMA_VERSION: Final = 1
"""Version of the payloads; part of every envelope and, as ``v1``, of every key."""

MAXIMUM_PAYLOAD_BYTES = 1 << 20
"""Longer payloads are refused before they are parsed."""

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

RoleName: TypeAlias = Literal["base_station", "robot", "tracked_agent"]
"""What a peer is."""

Mode: TypeAlias = Literal["waiting", "moving", "arrived", "holding"]
"""What a peer's body does: it has no orders yet, drives, stands where it should, or its orders have run out."""


class Body(msgspec.Struct, frozen=True, kw_only=True, tag_field="kind"):
    """Base of everything that can be said."""


class Heartbeat(Body, frozen=True, kw_only=True, tag="heartbeat"):
    """The sender's event loop is alive. Sent by every peer at ``heartbeat_hz``."""

    role: RoleName
    mode: Mode


class State(Body, frozen=True, kw_only=True, tag="state"):
    """Where a robot or the base station is and what it does. Sent at ``control_hz``."""

    position: Point
    velocity: Point
    mode: Mode
    target: Point | None = None
    path: tuple[Point, ...] = ()
    """What is left of the geodesic to ``target``, from ``position`` on."""
    obeying: Authority | None = None
    """The command that the sender follows."""


class Intent(Body, frozen=True, kw_only=True, tag="intent"):
    """What an *announcing* tracked agent tells of itself. Sent at ``control_hz``."""

    position: Point
    velocity: Point
    mode: Mode
    goal: Point | None = None
    path: tuple[Point, ...] = ()
    """What is left of the agent's way to ``goal``, from ``position`` on."""


class Goal(Body, frozen=True, kw_only=True, tag="goal"):
    """Go there. Said by an operator to the tracked agent, and again until it replies."""

    goal: Point
    correlation: Correlation


class GoalReply(Body, frozen=True, kw_only=True, tag="goal_reply"):
    """The tracked agent's answer to a :class:`Goal`; the same again if the goal is said again."""

    correlation: Correlation
    accepted: bool
    reason: Text = ""


class Authority(msgspec.Struct, frozen=True, kw_only=True):
    """In whose name, and in which order, a command is given. Later beats earlier: compare (epoch, sequence)."""

    epoch: Count
    leader: Name
    sequence: Count
    """Rises with every command of an epoch, repetitions included."""


class Placement(msgspec.Struct, frozen=True, kw_only=True):
    """Where one robot is to stand."""

    robot: Name
    position: Point
    cell: Count | None = None
    """Cell of the decomposition; none where placements are points, and for a robot that is not part of the chain."""
    spare: bool = False
    """A spare is no vertex of the deployment: it accompanies the agent until it is needed."""


class Deployment(Body, frozen=True, kw_only=True, tag="deployment"):
    """The leader's standing order: who stands where, and which links make the chain. Repeated while it holds."""

    authority: Authority
    valid_for_s: Seconds
    """How long a robot may obey this, from when it was heard, without hearing a later one."""
    decision: Count
    """Number of the decision; repetitions of one decision have different authority sequences."""
    placements: tuple[Placement, ...]
    edges: tuple[tuple[Name, Name], ...]
    """Links of the deployment tree between peers; from the base station, through relays, to the agent."""
    cost: float
    """Virtual cost of the chain (thesis eq. 25–26)."""
    total_cost_m: float | None = None
    """What the leader minimised, in metres: what the relays drive, and what the links are worth; none for no chain."""
    lower_bound_m: float | None = None
    """No chain costs less in all that sees as much of the agent's way as ``reason`` says; equal to ``total_cost_m`` if
    that is proven to be the least."""
    relays_needed: Count
    reason: Text
    """Why this decision replaced the one before."""


AnyBody: TypeAlias = Heartbeat | State | Intent | Goal | GoalReply | Deployment

BODIES: dict[str, type[Body]] = {
    body.__struct_config__.tag: body  # type: ignore[misc]
    for body in (Heartbeat, State, Intent, Goal, GoalReply, Deployment)
}
"""Kind → body."""

PERIODIC_KINDS: Final = frozenset({"heartbeat", "state", "intent"})
"""Kinds of which only the latest matters: it says all that the ones before said."""


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
    """Tag of a body, which is the last chunk of its key."""
    return str(body.__struct_config__.tag)


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
