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


class Heartbeat(Body, frozen=True, kw_only=True, tag="heartbeat"):
    """The sender's event loop is alive. Said at ``heartbeat_hz`` by who has not said where it is meanwhile."""

    role: RoleName
    mode: Mode


class State(Body, frozen=True, kw_only=True, tag="state"):
    """Where a robot or the base station is and what it does. Sent at ``control_hz``, and when its progress changes."""

    position: Point
    velocity: Point
    mode: Mode
    target: Point | None = None
    path: tuple[Point, ...] = ()
    """What is left of the geodesic to ``target``, from ``position`` on."""
    obeying: Authority | None = None
    """The latest command that the sender has heard."""
    progress: Progress | None = None
    """How far it is in the motion that it has accepted; none of a peer that has accepted none."""
    refusing: Text = ""
    """Why it does not accept the motion of the command that it obeys: it goes on with what it has accepted before, as
    far as that was released. Empty if it accepts, or has not judged yet."""


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


class Progress(msgspec.Struct, frozen=True, kw_only=True):
    """How far a robot is in the team's motion."""

    epoch: Count
    """Of the authority under which the plan was made."""
    plan: Count
    """That it has accepted."""
    revision: Count
    """Of the motion that it has accepted: it knows no other stages."""
    finished: Count
    """Number of stages of the plan that it has finished: all below this one."""
    retreat: Count | None = None
    """Nobody leads, and it has turned back: it is not beyond the beginning of this stage, and goes forward no more in
    this plan. None of a robot that has not turned."""


class MemberWay(msgspec.Struct, frozen=True, kw_only=True):
    """The way of one member of a motion, cut into stages."""

    member: Name
    """A robot, the base station or the agent."""
    radius_m: Extent
    """Of its disc; 0 for a member that is in nobody's way."""
    speed_m_s: Extent
    """The most that it can drive."""
    waypoints: Annotated[tuple[Point, ...], msgspec.Meta(min_length=1, max_length=1000)]
    """Straight from each to the next; one alone: it stands."""
    stages: Annotated[tuple[Count, ...], msgspec.Meta(min_length=2, max_length=1001)]
    """The waypoint at which each stage begins and the last one ends: from 0 to the last waypoint, never falling. A
    stage that begins and ends at one waypoint is a stop."""
    scheduled: bool = True
    """Whether it waits for the others and they for it. Otherwise it may be anywhere on its way at any time."""


class Motion(msgspec.Struct, frozen=True, kw_only=True):
    """Who goes where, in stages. Nobody begins stage n + 2 before all scheduled members have finished stage n.

    Stages are numbered from 0 in each plan. A message contains those from ``first_stage`` on. A new plan follows on an
    order to hold; within a plan, a revision changes none of the stages that have been released.
    """

    plan: Count
    """Number of the plan in this epoch; rises with every fresh start."""
    revision: Count
    """Rises within a plan with every change of its stages."""
    first_stage: Count
    """Number of the first stage contained: all members have finished those before."""
    released: Annotated[int, msgspec.Meta(ge=-1, le=2**53 - 1)]
    """Number of the last stage that may be begun; ``first_stage`` - 1 if none of those contained. Never falls."""
    ways: Annotated[tuple[MemberWay, ...], msgspec.Meta(min_length=1, max_length=64)]
    """Of the members; all have as many stages."""
    connection: Connection
    """What the leader certifies of the stages contained."""
    joined: Annotated[tuple[Name, ...], msgspec.Meta(max_length=64)] = ()
    """The members that stay in one network where ``connection`` is ``joined``."""


class Placement(msgspec.Struct, frozen=True, kw_only=True):
    """Where one robot is to stand."""

    robot: Name
    position: Point
    cell: Count | None = None
    """Cell of the decomposition; none where placements are points, and for a robot that is not part of the chain."""
    spare: bool = False
    """A spare is no vertex of the deployment: it accompanies the agent until it is needed."""


class Deployment(Body, frozen=True, kw_only=True, tag="deployment"):
    """The leader's standing order: who goes where and how, and which links make the chain. Repeated while it holds."""

    authority: Authority
    warrant: Warrant
    """By this each hearer judges whether, and for how long, the leader may be obeyed."""
    decision: Count
    """Number of the decision; repetitions of one decision have different authority sequences. The next leader goes on
    with it."""
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
    motion: Motion | None = None
    """How the robots get there; none: hold where you are. Placements alone send nobody anywhere."""


class Reign(msgspec.Struct, frozen=True, kw_only=True):
    """Who leads in an epoch, and which process of that name. No two leaders share an epoch."""

    epoch: Count
    leader: Name
    incarnation: Count
    """Of the leader: started again, it has to be elected again."""


class LastHeard(msgspec.Struct, frozen=True, kw_only=True):
    """The latest mark that a speaker had heard of a peer."""

    peer: Name
    mark: Correlation
    age_s: Seconds = 0.0
    """How long before it spoke it had heard it."""


class Warrant(msgspec.Struct, frozen=True, kw_only=True):
    """How long what a leader says may be obeyed; each hearer judges on its own clock how old it is.

    Obey for ``lease_s`` from when you said the mark of yours that is in ``marks``, and not at all without one of this
    incarnation. The leader had heard that mark before it spoke, so that delay makes orders run out sooner, not later.
    Nine tenths of ``lease_s`` and the mark's ``age_s`` together will do as well, if that is longer.
    """

    lease_s: Seconds
    """What was left of the leader's lease when it spoke, by its own clock and with its caution."""
    marks: Annotated[tuple[LastHeard, ...], msgspec.Meta(max_length=64)]


class VoteRequest(Body, frozen=True, kw_only=True, tag="vote_request"):
    """Promise me the lease of this epoch, or renew your promise. Said in rounds by who would lead, stands or leads."""

    epoch: Count
    correlation: Correlation
    """Of this round."""
    warrant: Warrant | None = None
    """Of a leader in office; none while it only stands."""
    canvass: bool = False
    """Promise nothing yet, but say whether you would."""
    withdrawn: bool = False
    """It has not won, and will not lead in this epoch or one before: promises of these are void. Wants no answer."""


class Vote(Body, frozen=True, kw_only=True, tag="vote"):
    """The answer to a :class:`VoteRequest`. Peers that have no vote answer too: what is obeyed depends on marks."""

    candidate: Name
    correlation: Correlation
    granted: bool
    """Whether nobody else will be promised a lease for one lease from now on; to a canvass, whether it would be so."""
    promise: Reign | None = None
    """The last one made; it is on disk. Of a peer that has no vote: whom it obeyed last."""
    mark: Correlation
    """Chosen by the voter, another one each time that time has passed; comes back in warrants."""


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
"""What was said so long ago, and not again, does not stand any more: each kind is repeated at least once a second."""


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
