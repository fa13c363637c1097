"""What goes into a recording: the values that roles and shells record, and that a review reads back.

``Track`` is the truth about the peer that records it (each driver knows its own body); everything else is what the
peer believed or decided at the time. Nothing here crosses the wire.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

import msgspec

from protocol.messages import Deployment, Edge, Method, Mode, Motion, Point, Reign, RoleName


class Track(msgspec.Struct, frozen=True, kw_only=True, tag_field="record", tag="track"):
    """Where the recording peer truly is and what its body does; once per control period."""

    role: RoleName
    position: Point
    velocity: Point
    radius_m: float
    mode: Mode
    target: Point | None = None
    path: tuple[Point, ...] = ()


class Decision(msgspec.Struct, frozen=True, kw_only=True, tag_field="record", tag="decision"):
    """The leader has decided on a deployment (not on the repetitions of one)."""

    deployment: Deployment
    planning_s: float
    """Time that the planning job took (modelled in simulation)."""
    topology_changed: bool
    """Whether the tree's edges differ from those of the decision before, and not only by who stands where."""


def in_words(deployment: Deployment) -> str:
    """What a deployment costs and could cost at least, to be read after its reason; empty without a chain."""
    cost_m, bound_m = deployment.total_cost_m, deployment.lower_bound_m
    if cost_m is None or bound_m is None:
        return ""
    if bound_m >= cost_m:
        return f"costs {cost_m:.1f} m, the least of such chains"
    return f"costs {cost_m:.1f} m, such chains at least {bound_m:.1f} m"


class Ordered(msgspec.Struct, frozen=True, kw_only=True, tag_field="record", tag="ordered"):
    """The leader has ordered a motion for the first time: a new plan, or a revision of it."""

    epoch: int
    """Of the leader. Numbers of plans begin anew with every epoch."""
    motion: Motion


class Advance(msgspec.Struct, frozen=True, kw_only=True, tag_field="record", tag="advance"):
    """How far the motion is, as the leader knows it: numbers of stages of the present plan."""

    epoch: int
    """Of the leader."""
    plan: int
    revision: int
    released: int
    """Those that may be begun."""
    finished: dict[str, int]
    """Those that each robot has finished."""


class TopologyChange(msgspec.Struct, frozen=True, kw_only=True, tag_field="record", tag="topology_change"):
    """A proposal of the leader to change the team's tree is settled: its tree is in force, or it has been given up."""

    number: tuple[int, int]
    """Epoch of the leader, and of the tree in that epoch."""
    committed: bool
    """Whether it is in force."""
    before: tuple[Edge, ...]
    """Links of the tree that was in force when it was proposed."""
    members: tuple[str, ...]
    """Who the tree proposed is to join."""
    edges: tuple[Edge, ...]
    """Its links."""
    new: tuple[Edge, ...]
    """Links of it that had to be confirmed."""
    released: tuple[Edge, ...]
    """Links of the tree before that it does without; they are kept if it has been given up."""
    absent: tuple[str, ...]
    """Ends of new links that were not asked, since they were not there."""
    motion: tuple[int, int] | None
    """Plan and revision of the motion that leads to where the new links are; none: they are where everybody stands."""
    method: Method
    rounds: int
    """How often the proposal was said."""
    duration_s: float
    """From then on until it was settled."""
    reason: str
    """Why it was made, or why it has been given up."""


class TreeAnswer(msgspec.Struct, frozen=True, kw_only=True, tag_field="record", tag="tree_answer"):
    """What a peer says of the team's tree, before it says it; with every change."""

    proposal: tuple[int, int] | None
    """Number of the proposal that it answers."""
    confirmed: tuple[str, ...]
    """Ends of new links of that proposal with this peer that it sees, or will."""
    kept: tuple[int, int] | None
    """Number of the tree whose links it keeps."""


class Taken(msgspec.Struct, frozen=True, kw_only=True, tag_field="record", tag="taken"):
    """A peer has taken orders of another that it had not: of another reign, another decision or another motion."""

    epoch: int
    leader: str
    sequence: int
    """Of the authority that they were taken with."""
    decision: int
    motion: tuple[int, int] | None
    """Plan and revision; none: hold."""
    lease_s: float
    """What was left of the leader's lease when they were given."""
    sent_at_s: float
    """When they were, in seconds since 1970 by the leader's clock."""


class Planned(msgspec.Struct, frozen=True, kw_only=True, tag_field="record", tag="planned"):
    """A planning job has ended, whatever came of it."""

    planning_s: float
    """Time that it took (modelled in simulation)."""
    in_sight_s: float = 0.0
    """For how long from when its motion begins all that the agent can reach, wherever it goes, is in sight of the place
    where the last relay is then, or the base station where there is no relay; no more than a minute is looked ahead."""


class Connectivity(msgspec.Struct, frozen=True, kw_only=True, tag_field="record", tag="connectivity"):
    """Who sees whom, by true line of sight between the positions that the recording peer (the leader) has heard."""

    links: tuple[tuple[Point, Point], ...]
    agent_visible: bool
    chain_connected: bool
    team_connected: bool
    lambda2: float
    """Second smallest eigenvalue of the Laplacian of the visibility graph of the whole team."""
    tree_links: tuple[tuple[Point, Point], ...] = ()
    """The links of the current deployment tree, between the same positions; those that are not among ``links`` (in
    either order of the ends) are out of sight at the moment."""


class Office(msgspec.Struct, frozen=True, kw_only=True, tag_field="record", tag="office"):
    """Who leads and who is obeyed, as the recording peer believes; with every change."""

    incarnation: int
    """Of this process. One that is killed says nothing more, so that all of this ends with what it recorded last."""
    standing: str
    """Where it stands in the election (:class:`protocol.election_states.Standing`)."""
    leads: Reign | None
    """The reign that it leads in itself."""
    obeys: Reign | None
    """Whose orders are in force for it; none: it holds."""
    led_until_s: float | None = None
    """When the reign ended that it led in before; earlier than this record if it hung then."""
    obeyed_until_s: float | None = None
    """When it ceased to obey the one that it obeyed before, likewise."""


class Estimate(msgspec.Struct, frozen=True, kw_only=True, tag_field="record", tag="estimate"):
    """Where the recording peer takes the agent to be; once a second, from the first range on."""

    center: Point
    area_m2: float
    age_s: float
    """Since the newest range in it."""
    rings: tuple[tuple[Point, ...], ...]
    """Outlines of the set, open: of its parts, and of holes in them."""
    made: int
    """Ranges that this process has measured."""
    heard: int
    """Ranges of all processes that it has, or does not wait for any more."""
    held: int
    """Of these, those kept one by one."""
    folded: int
    """Of these, those that it has put into the set in front of the others."""
    late: int
    """Ranges that came after their place was folded, and were dropped."""
    refused: int
    """Ranges, digests and bases of others that no peer can have said."""
    compared_s: float
    """Up to this mission time its log is summed up in ``fingerprint``."""
    fingerprint: int | None
    """Peers with equal ones for a time have equal sets; none where it cannot be told any more."""


class LogLine(msgspec.Struct, frozen=True, kw_only=True, tag_field="record", tag="log"):
    """A sentence for the reviewer."""

    level: Literal["debug", "info", "warning", "error"]
    text: str


class Mishap(msgspec.Struct, frozen=True, kw_only=True, tag_field="record", tag="mishap"):
    """Something befell a process or a link: it crashed, or it was done on purpose (:mod:`launcher.chaos`)."""

    kind: str
    """Of the fault, as in a timetable; ``crash`` if nobody wanted it."""
    who: tuple[str, ...]
    """Whose process or links it is."""
    text: str
    """What it was, in a few words."""
    over: bool = False
    """Whether it is over with this, or begins."""


AnyRecord: TypeAlias = (
    Track
    | Decision
    | Ordered
    | Advance
    | Planned
    | Connectivity
    | Estimate
    | Office
    | LogLine
    | Mishap
    | TopologyChange
    | TreeAnswer
    | Taken
)
