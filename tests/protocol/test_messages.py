"""Whatever arrives is either a message or a MalformedMessage; whatever is said comes back as it was."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol import messages
from protocol.messages import (
    BODIES,
    Authority,
    Deployment,
    Envelope,
    Goal,
    GoalReply,
    Heartbeat,
    Intent,
    LastHeard,
    MalformedMessage,
    MemberWay,
    Motion,
    Placement,
    Progress,
    Reign,
    State,
    Vote,
    VoteRequest,
    Warrant,
    decode,
    encode,
)

counts = st.integers(0, 2**53 - 1)
coordinates = st.floats(-1e7, 1e7)
points = st.tuples(coordinates, coordinates)
paths = st.lists(points, max_size=5).map(tuple)
names = st.builds(str.__add__, st.sampled_from("aoz"), st.text("az09_", max_size=31))
modes = st.sampled_from(["waiting", "moving", "yielding", "arrived", "holding"])
texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=40)
correlations = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=64)
seconds = st.floats(0.0, 1e9)
authorities = st.builds(Authority, epoch=counts, leader=names, sequence=counts)
progresses = st.builds(Progress, epoch=counts, plan=counts, revision=counts, finished=counts)
extents = st.floats(0.0, 1e7)
ways = st.builds(
    MemberWay,
    member=names,
    radius_m=extents,
    speed_m_s=extents,
    waypoints=st.lists(points, min_size=1, max_size=5).map(tuple),
    stages=st.lists(counts, min_size=2, max_size=5).map(tuple),
    scheduled=st.booleans(),
)
motions = st.builds(
    Motion,
    plan=counts,
    revision=counts,
    first_stage=counts,
    released=st.integers(-1, 2**53 - 1),
    ways=st.lists(ways, min_size=1, max_size=3).map(tuple),
    connection=st.sampled_from(["team", "joined", "none"]),
    joined=st.lists(names, max_size=3).map(tuple),
)
warrants = st.builds(
    Warrant,
    lease_s=seconds,
    marks=st.lists(st.builds(LastHeard, peer=names, mark=correlations), max_size=3).map(tuple),
)
bodies = st.one_of(
    st.builds(Heartbeat, role=st.sampled_from(["base_station", "robot", "tracked_agent"]), mode=modes),
    st.builds(
        State,
        position=points,
        velocity=points,
        mode=modes,
        target=st.none() | points,
        path=paths,
        obeying=st.none() | authorities,
        progress=st.none() | progresses,
        refusing=texts,
    ),
    st.builds(Intent, position=points, velocity=points, mode=modes, goal=st.none() | points, path=paths),
    st.builds(Goal, goal=points, correlation=correlations),
    st.builds(GoalReply, correlation=correlations, accepted=st.booleans(), reason=texts),
    st.builds(
        Deployment,
        authority=authorities,
        warrant=warrants,
        decision=counts,
        placements=st.lists(
            st.builds(Placement, robot=names, position=points, cell=st.none() | counts, spare=st.booleans()), max_size=4
        ).map(tuple),
        edges=st.lists(st.tuples(names, names), max_size=4).map(tuple),
        cost=st.floats(allow_nan=False, allow_infinity=False),
        relays_needed=counts,
        reason=texts,
        motion=st.none() | motions,
    ),
    st.builds(
        VoteRequest,
        epoch=counts,
        correlation=correlations,
        warrant=st.none() | warrants,
        canvass=st.booleans(),
        withdrawn=st.booleans(),
    ),
    st.builds(
        Vote,
        candidate=names,
        correlation=correlations,
        granted=st.booleans(),
        promise=st.none() | st.builds(Reign, epoch=counts, leader=names, incarnation=counts),
        mark=correlations,
    ),
)
envelopes = st.builds(Envelope, sender=names, incarnation=counts, sequence=counts, sent_at_s=seconds, body=bodies)

STATE = encode(
    Envelope(
        sender="robot1",
        incarnation=0,
        sequence=1,
        sent_at_s=0.0,
        body=State(position=(1.0, 2.0), velocity=(0.0, 0.0), mode="moving"),
    )
)


@given(envelopes)
@settings(deadline=None)
def test_what_is_said_comes_back(envelope: Envelope) -> None:
    payload = encode(envelope)
    assert decode(payload) == envelope
    plain = json.loads(payload)  # another reader's view
    assert plain["schema"] == messages.SCHEMA_VERSION
    assert plain["body"]["kind"] == envelope.kind
    assert BODIES[envelope.kind] is type(envelope.body)


@given(st.binary(max_size=200))
@settings(deadline=None)
def test_noise_is_malformed(payload: bytes) -> None:
    with pytest.raises(MalformedMessage):
        decode(payload)


@given(envelopes, st.data())
@settings(deadline=None)
def test_a_damaged_message_is_malformed_or_a_message(envelope: Envelope, data: st.DataObject) -> None:
    payload = bytearray(encode(envelope))
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(payload) - 1))
        payload[place : place + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=3))
    try:
        damaged = decode(bytes(payload))
    except MalformedMessage:
        return
    assert decode(encode(damaged)) == damaged


junk = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@given(envelopes, junk, st.data())
@settings(deadline=None)
def test_a_field_of_another_type_is_malformed_or_harmless(envelope: Envelope, value: Any, data: st.DataObject) -> None:
    content = json.loads(encode(envelope))
    where = data.draw(st.sampled_from([content, content["body"]]))
    where[data.draw(st.sampled_from(sorted(where)))] = value
    try:
        changed = decode(json.dumps(content).encode("utf-8", "surrogatepass"))
    except MalformedMessage:
        return
    assert decode(encode(changed)) == changed


@pytest.mark.parametrize(
    "number", ["1e999", "-1e999", "NaN", "Infinity", "-Infinity", "1e308", "1.1e7", "9" * 400, "null", '"1"', "true"]
)
def test_positions_are_finite_and_bounded(number: str) -> None:
    payload = STATE.replace(b"[1.0,2.0]", f"[1.0,{number}]".encode())
    assert payload != STATE
    with pytest.raises(MalformedMessage):
        decode(payload)


@pytest.mark.parametrize("nonsense", [math.nan, math.inf, -math.inf])
def test_a_number_that_is_none_does_not_cross_the_wire(nonsense: float) -> None:
    body = State(position=(nonsense, 0.0), velocity=(0.0, 0.0), mode="moving")
    with pytest.raises(MalformedMessage):
        decode(encode(Envelope(sender="robot1", incarnation=0, sequence=1, sent_at_s=0.0, body=body)))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b'"schema":1', b'"schema":2'),
        (b'"sender":"robot1"', b'"sender":"Robot 1"'),
        (b'"sender":"robot1"', b'"sender":"robot1\\n"'),
        (b'"sender":"robot1"', b'"sender":"operator"'),
        (b'"sequence":1', b'"sequence":-1'),
        (b'"sequence":1', b'"sequence":9007199254740992'),
        (b'"kind":"state"', b'"kind":"estate"'),
        (b'"mode":"moving"', b'"mode":"dancing"'),
        (b"[1.0,2.0]", b"[1.0,2.0,3.0]"),
        (b"[1.0,2.0]", b"[1.0]"),
        (b'"path":[]', b'"path":' + b"[" * 100_000),
    ],
)
def test_what_does_not_fit_the_schema_is_malformed(old: bytes, new: bytes) -> None:
    assert old in STATE
    with pytest.raises(MalformedMessage):
        decode(STATE.replace(old, new))


def motion_of(waypoints: int = 1, marks: int = 2, ways: int = 1, joined: int = 0, released: int = -1) -> bytes:
    way = MemberWay(
        member="robot1", radius_m=0.2, speed_m_s=1.0, waypoints=((0.0, 0.0),) * waypoints, stages=(0,) * marks
    )
    motion = Motion(
        plan=0, revision=0, first_stage=0, released=released, ways=(way,) * ways, connection="none",
        joined=("robot1",) * joined,
    )  # fmt: skip
    body = Deployment(
        authority=Authority(epoch=0, leader="base", sequence=1), warrant=Warrant(lease_s=1.0, marks=()), decision=1,
        placements=(), edges=(), cost=0.0, relays_needed=0, reason="", motion=motion,
    )  # fmt: skip
    return encode(Envelope(sender="base", incarnation=0, sequence=1, sent_at_s=0.0, body=body))


@pytest.mark.parametrize(
    ("size", "least", "most"), [("waypoints", 1, 1000), ("marks", 2, 1001), ("ways", 1, 64), ("joined", 0, 64)]
)
def test_motions_are_bounded(size: str, least: int, most: int) -> None:
    for fits in (least, most):
        decode(motion_of(**{size: fits}))
    for unfit in (least - 1, most + 1):
        if unfit >= 0:
            with pytest.raises(MalformedMessage):
                decode(motion_of(**{size: unfit}))


def test_no_stage_comes_before_the_first() -> None:
    assert decode(motion_of(released=-1)).kind == "deployment"
    with pytest.raises(MalformedMessage):
        decode(motion_of(released=-2))


def test_unknown_fields_are_ignored() -> None:
    assert decode(STATE.replace(b'"path":[]', b'"path":[],"mood":{"deep":[1,2]}')) == decode(STATE)


def test_long_payloads_are_refused_unread() -> None:
    spaces = b" " * messages.MAXIMUM_PAYLOAD_BYTES
    with pytest.raises(MalformedMessage, match="more than"):
        decode(STATE + spaces)
