"""What is said about bodies: where they are and go, and where the leader wants them (docs/motion.md)."""

from __future__ import annotations

from typing import Annotated

import msgspec

from protocol.leading_messages import Authority, Warrant
from protocol.wire_types import Body, Connection, Correlation, Count, Extent, Mode, Name, Point, RoleName, Text


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
