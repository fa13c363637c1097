"""Every role against whatever well-formed messages may come, and in every order."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agents.allegiance import Allegiance
from agents.casting import Casting
from agents.mind import Mind
from agents.role import Heard, JobDone, Written
from planning.environment import Environment
from protocol.bus import PeerAppeared, PeerVanished
from protocol.election_states import Standing
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
    LastHeard,
    MemberWay,
    Motion,
    Placement,
    Progress,
    Reign,
    State,
    Vote,
    VoteRequest,
    Warrant,
    kind_of,
)  # fmt: skip
from tests.agents.conftest import make_mission
from tests.agents.life import Life

CORNER = Environment([(0, 0), (10, 0), (10, 5), (5, 5), (5, 10), (0, 10)], name="corner")
FREE = CORNER.inflated(0.2)
MISSION = make_mission()
PEERS = ["base", "agent", "robot1", "robot2"]

coordinates = st.one_of(st.sampled_from([-1e7, -0.0, 0.2, 5.0, 1e7]), st.floats(-1e7, 1e7), st.floats(0.0, 10.0))
places = st.tuples(coordinates, coordinates)
names = st.sampled_from([*PEERS, "stranger"])
counts = st.integers(0, 2**62)
paths = st.lists(places, max_size=3).map(tuple)
modes = st.sampled_from(["waiting", "moving", "yielding", "arrived", "holding"])
authorities = st.builds(Authority, epoch=st.integers(0, 1) | counts, leader=names, sequence=counts)
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
correlations = st.sampled_from(["0.0", "0.1", "0.2", "0.3", "x"])
warrants = st.builds(
    Warrant, lease_s=st.floats(0.0, 1e300),
    marks=st.lists(st.builds(LastHeard, peer=names, mark=correlations), max_size=3).map(tuple),
)  # fmt: skip
reigns = st.builds(Reign, epoch=few | counts, leader=names, incarnation=few)
bodies: st.SearchStrategy[AnyBody] = st.one_of(
    st.builds(Heartbeat, role=st.just("robot"), mode=modes),
    st.builds(
        State, position=places, velocity=places, mode=modes, target=st.none() | places, path=paths,
        obeying=st.none() | authorities, progress=st.none() | progresses,
    ),
    st.builds(Intent, position=places, velocity=places, mode=modes, goal=st.none() | places, path=paths),
    st.builds(Goal, goal=places, correlation=st.text(min_size=1, max_size=3)),
    st.builds(GoalReply, correlation=st.text(max_size=3), accepted=st.booleans()),
    st.builds(
        Deployment, authority=authorities, warrant=warrants, decision=counts,
        placements=st.lists(placements, max_size=4).map(tuple),
        edges=st.lists(st.tuples(names, names), max_size=4).map(tuple),
        cost=st.floats(allow_nan=False), relays_needed=counts, reason=st.text(max_size=5),
        motion=st.none() | motions,
    ),
    st.builds(
        VoteRequest, epoch=few | counts, correlation=correlations, warrant=st.none() | warrants, canvass=st.booleans(),
        withdrawn=st.booleans(),
    ),
    st.builds(
        Vote, candidate=names, correlation=correlations, granted=st.booleans(), promise=st.none() | reigns,
        mark=correlations,
    ),
)  # fmt: skip
comings = st.sampled_from([PeerAppeared, PeerVanished]).flatmap(lambda kind: names.map(kind))
events = st.lists(st.tuples(st.one_of(st.tuples(names, bodies), comings), st.floats(0.0, 2.0)), max_size=12)


CASTING = Casting(MISSION, CORNER)


def cast(name: str, leads: bool) -> Life:
    """A peer; one that leads has been elected by others who stand by it for ever."""
    role, _ = CASTING.cast(name)
    if leads:
        assert isinstance(role, Mind)
        allegiance = role.parts[0]
        assert isinstance(allegiance, Allegiance)
        election = allegiance.election
        election.office = election._voter.promise = Reign(epoch=1, leader=name, incarnation=0)
        election.standing, election.lease_until_s = Standing.FOLLOWING, math.inf
    return Life(role, (1.0, 1.0))


@pytest.mark.parametrize(
    ("name", "leads"), [("base", False), ("base", True), ("robot1", False), ("robot1", True), ("agent", False)]
)
@settings(deadline=None, max_examples=40)
@given(script=events)
def test_nothing_that_can_be_said_makes_a_role_fail(name: str, leads: bool, script: list) -> None:  # type: ignore[type-arg]
    life = cast(name, leads)
    for what, pause_s in script:
        if isinstance(what, tuple):
            sender, body = what
            envelope = Envelope(sender=sender, incarnation=0, sequence=0, sent_at_s=0.0, body=body)
            heard = Heard(Address("team", sender, kind_of(body), operator=isinstance(body, Goal)), envelope)
            if envelope.kind in life.role.hears and sender in PEERS and sender != name:
                life.hear(heard)
        else:
            life.hear(what)
        while life.jobs:
            job = life.jobs.pop()
            try:
                done = JobDone(job.job, job.function(*job.arguments), 0.01)
            except ValueError as problem:
                done = JobDone(job.job, None, 0.01, str(problem))
            life.hear(done)
        while life.promises:
            life.hear(Written(life.promises.pop().token))
        life.live_until(life.now_s + pause_s)
        assert life.now_s < life.wake_at_s < math.inf
        assert FREE.contains([life.driver.pose()])[0] or name == "base"
