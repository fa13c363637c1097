"""Every role against whatever well-formed messages may come, and in every order."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agents.base_station import BaseStation
from agents.behaviour import begin
from agents.casting import Casting
from agents.certificate_judge import certificate_judge
from agents.robot import Robot
from agents.role import Heard, JobDone, Role
from agents.tracked_agent import TrackedAgent
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from protocol.bus import PeerAppeared, PeerVanished
from protocol.keys import Address
from protocol.messages import (
    AnyBody,
    Authority,
    Deployment,
    Envelope,
    Goal,
    GoalReply,
    Heartbeat,
    Intent,
    MemberWay,
    Motion,
    Placement,
    Progress,
    State,
    kind_of,
)  # fmt: skip
from tests.agents.conftest import make_mission
from tests.agents.life import Life

CORNER = Environment([(0, 0), (10, 0), (10, 5), (5, 5), (5, 10), (0, 10)], name="corner")
FREE = CORNER.inflated(0.2)
ROUTES = GeodesicMap(FREE)
MISSION = make_mission()
PEERS = ["base", "agent", "robot1", "robot2"]

coordinates = st.one_of(st.sampled_from([-1e7, -0.0, 0.2, 5.0, 1e7]), st.floats(-1e7, 1e7), st.floats(0.0, 10.0))
places = st.tuples(coordinates, coordinates)
names = st.sampled_from([*PEERS, "stranger"])
counts = st.integers(0, 2**62)
paths = st.lists(places, max_size=3).map(tuple)
modes = st.sampled_from(["waiting", "moving", "yielding", "arrived", "holding"])
authorities = st.builds(Authority, epoch=counts, leader=names, sequence=counts)
placements = st.builds(Placement, robot=names, position=places, cell=st.none() | st.integers(), spare=st.booleans())
progresses = st.builds(Progress, epoch=counts, plan=counts, revision=counts, finished=counts)
few = st.integers(0, 3)
extents = st.sampled_from([0.0, 0.2, 1.0, 1e7])
ways = st.builds(
    MemberWay,
    member=names,
    radius_m=extents,
    speed_m_s=extents,
    waypoints=st.lists(places, min_size=1, max_size=4).map(tuple),
    stages=st.lists(few, min_size=2, max_size=4).map(tuple),
    scheduled=st.booleans(),
)
stand = st.sampled_from([("base", (1.0, 1.0)), ("robot1", (1.0, 1.0)), ("robot2", (4.0, 1.0))])
fair_ways = st.builds(
    lambda member, step, speed_m_s: MemberWay(
        member=member[0], radius_m=0.2, speed_m_s=speed_m_s, stages=(0, 1, 1),
        waypoints=(member[1], (member[1][0], member[1][1] + step)),
    ),
    stand, st.sampled_from([0.25, 1.0, 30.0]), st.sampled_from([0.5, 1.0]),
)  # fmt: skip
motions = st.builds(
    Motion,
    plan=few,
    revision=few,
    first_stage=st.integers(0, 1) | counts,
    released=st.integers(-1, 3) | counts,
    ways=st.lists(ways, min_size=1, max_size=3).map(tuple)
    | st.lists(fair_ways, min_size=1, max_size=3, unique_by=lambda way: way.member).map(tuple),
    connection=st.sampled_from(["team", "joined", "none"]),
    joined=st.lists(names, max_size=3).map(tuple),
)
bodies: st.SearchStrategy[AnyBody] = st.one_of(
    st.builds(Heartbeat, role=st.just("robot"), mode=modes),
    st.builds(
        State, position=places, velocity=places, mode=modes, target=st.none() | places, path=paths,
        progress=st.none() | progresses,
    ),
    st.builds(Intent, position=places, velocity=places, mode=modes, goal=st.none() | places, path=paths),
    st.builds(Goal, goal=places, correlation=st.text(min_size=1, max_size=3)),
    st.builds(GoalReply, correlation=st.text(max_size=3), accepted=st.booleans()),
    st.builds(
        Deployment, authority=authorities, valid_for_s=st.floats(0.0, 1e300), decision=counts,
        placements=st.lists(placements, max_size=4).map(tuple),
        edges=st.lists(st.tuples(names, names), max_size=4).map(tuple),
        cost=st.floats(allow_nan=False), relays_needed=counts, reason=st.text(max_size=5),
        motion=st.none() | motions,
    ),
)  # fmt: skip
comings = st.sampled_from([PeerAppeared, PeerVanished]).flatmap(lambda kind: names.map(kind))
events = st.lists(st.tuples(st.one_of(st.tuples(names, bodies), comings), st.floats(0.0, 2.0)), max_size=12)


def make_base() -> Role:
    return Casting(MISSION, CORNER).cast("base")[0]


def make_robot() -> Role:
    return Robot(MISSION, "robot1", certificate_judge(MISSION, CORNER))


def make_agent() -> Role:
    return Casting(MISSION, CORNER).cast("agent")[0]


@pytest.mark.parametrize("make", [make_base, make_robot, make_agent])
@settings(deadline=None, max_examples=60)
@given(script=events)
def test_nothing_that_can_be_said_makes_a_role_fail(make: Callable[[], Role], script: list) -> None:  # type: ignore[type-arg]
    life = Life(make(), (1.0, 1.0))
    for what, pause_s in script:
        if isinstance(what, tuple):
            sender, body = what
            envelope = Envelope(sender=sender, incarnation=0, sequence=0, sent_at_s=0.0, body=body)
            life.hear(Heard(Address("team", sender, kind_of(body), operator=isinstance(body, Goal)), envelope))
        else:
            life.hear(what)
        while life.jobs:
            job = life.jobs.pop()
            try:
                done = JobDone(job.job, job.function(*job.arguments), 0.01)
            except ValueError as problem:
                done = JobDone(job.job, None, 0.01, str(problem))
            life.hear(done)
        life.live_until(life.now_s + pause_s)
        assert life.now_s < life.wake_at_s < math.inf
        assert FREE.contains([life.driver.pose()])[0] or isinstance(life.role, BaseStation)
