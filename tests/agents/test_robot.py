from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import structs

from agents.collection import Collection
from agents.driver import patience_s
from agents.mind import Mind
from agents.mission import Mission
from agents.records import Track
from agents.robot import CERTIFICATE, LONG_S, Robot
from agents.role import Heard, JobDone
from protocol.bus import PeerVanished
from protocol.keys import Address
from protocol.messages import (
    AnyBody,
    Authority,
    Deployment,
    Envelope,
    Heartbeat,
    MemberWay,
    Motion,
    Point,
    Progress,
    State,
    Warrant,
    kind_of,
)
from tests.agents.conftest import make_mission
from tests.agents.life import Life
from tests.agents.sworn import sworn

BAD = (9.0, 9.0)
"""A place that the judge of these tests lets nobody go to."""


def judge(motion: Motion) -> str:
    assert motion.released == motion.first_stage - 1, "the judge is to remember what it was asked"
    bad = any(BAD in way.waypoints for way in motion.ways)
    return "robot1 goes where it must not" if bad else ""


def say(sender: str, body: AnyBody, sequence: int = 0) -> Heard:
    envelope = Envelope(sender=sender, incarnation=0, sequence=sequence, sent_at_s=0.0, body=body)
    return Heard(Address("team", sender, kind_of(body)), envelope)


def order(
    sequence: int, motion: Motion | None = None, *, epoch: int = 0, leader: str = "base", sender: str = "base"
) -> Heard:
    deployment = Deployment(
        authority=Authority(epoch=epoch, leader=leader, sequence=sequence), warrant=Warrant(lease_s=1.0, marks=()),
        decision=sequence, placements=(), edges=(), cost=0.0, relays_needed=1, reason="test", motion=motion,
    )  # fmt: skip
    return say(sender, deployment, sequence)


def way(member: str, *waypoints: Point, stages: tuple[int, ...]) -> MemberWay:
    return MemberWay(member=member, radius_m=0.2, speed_m_s=1.0, waypoints=waypoints, stages=stages)


def go(*waypoints: Point, plan: int = 0, revision: int = 0, released: int = 99) -> Motion:
    """One stage to each waypoint after the first; the others stand."""
    stages = tuple(range(len(waypoints)))
    still = (0,) * len(waypoints)
    ways = (
        way("base", (1.0, 1.0), stages=still),
        way("robot1", *waypoints, stages=stages),
        way("robot2", (5.0, 5.0), stages=still),
    )
    return Motion(
        plan=plan, revision=revision, first_stage=0, released=min(released, len(waypoints) - 2), ways=ways,
        connection="none",
    )  # fmt: skip


def certify(life: Life, failure: str = "") -> None:
    """Have the job under way done."""
    life.live_until(life.now_s)
    job = life.jobs.pop()
    assert job.job == CERTIFICATE
    result = None if failure else job.function(*job.arguments)
    life.hear(JobDone(job.job, result, 0.01, failure))
    life.live_until(life.now_s)


def send(life: Life, motion: Motion) -> None:
    """Told to hold, then to go: as at every fresh start."""
    life.hear(order(1))
    life.live_until(life.now_s)
    life.hear(order(2, motion))
    certify(life)


def state(life: Life) -> State:
    return life.all_said(State)[-1][1]


def tracks(life: Life) -> list[Track]:
    return [record for record in life.records if isinstance(record, Track)]


@pytest.fixture
def life(mission: Mission) -> Life:
    return Life(make_robot(mission))


def make_robot(mission: Mission) -> Mind:
    allegiance, orders = sworn("robot1")
    return Mind(
        [
            orders,
            Robot(
                mission, "robot1", judge, allegiance, orders, Collection(allegiance, mission.tracked_agent.name), 0.0
            ),
        ]
    )


def test_waits_and_says_so_until_it_hears_orders(life: Life) -> None:
    life.live_until(2.0)
    assert state(life).mode == "waiting"
    assert life.driver.pose() == (0.0, 0.0)
    assert sum(isinstance(body, State) for _, body in life.said) == 21
    assert not any(isinstance(body, Heartbeat) for _, body in life.said), "whoever says where it is lives"
    assert len(tracks(life)) == 21


def test_goes_its_way_at_full_speed_and_arrives_exactly(life: Life) -> None:
    life.live_until(0.25)
    send(life, go((0.0, 0.0), (0.6, 0.8)))
    life.live_until(0.75)
    assert life.driver.pose() == pytest.approx((0.3, 0.4))
    said = state(life)
    assert said.mode == "moving"
    assert said.obeying == Authority(epoch=0, leader="base", sequence=2)
    assert (said.target, said.path[1:]) == ((0.6, 0.8), ((0.6, 0.8),))
    life.live_until(1.5)
    assert life.driver.pose() == pytest.approx((0.6, 0.8), abs=1e-12)
    assert state(life).mode == "arrived"
    assert state(life).velocity == (0.0, 0.0)


def test_placements_alone_send_it_nowhere(life: Life) -> None:
    life.hear(order(1))
    life.live_until(2.0)
    assert (state(life).mode, state(life).obeying) == ("holding", Authority(epoch=0, leader="base", sequence=1))
    assert life.driver.pose() == (0.0, 0.0)


def test_does_not_move_before_the_motion_is_certified(life: Life) -> None:
    life.hear(order(1))
    life.live_until(0.5)
    life.hear(order(2, go((0.0, 0.0), (5.0, 0.0))))
    life.live_until(1.0)
    assert (life.driver.pose(), state(life).mode, state(life).progress) == ((0.0, 0.0), "holding", None)
    certify(life)
    life.live_until(2.0)
    assert life.driver.pose() == pytest.approx((1.0, 0.0))


def test_says_at_once_that_it_accepts_and_that_it_has_finished_a_stage(life: Life) -> None:
    life.live_until(0.03)
    send(life, go((0.0, 0.0), (0.25, 0.0), (1.0, 0.0)))
    life.live_until(1.0)
    changes: dict[int, float] = {}
    for time_s, said in life.all_said(State):
        if said.progress is not None:
            changes.setdefault(said.progress.finished, time_s)
    assert changes[0] == pytest.approx(0.03)
    assert changes[1] == pytest.approx(0.28)
    assert len(tracks(life)) == 11  # the recording keeps its rhythm


def test_yields_to_the_others_and_goes_on_when_it_hears_that_they_are_farther(life: Life) -> None:
    still = (0, 0, 0, 0)
    order_2 = Motion(
        plan=7, revision=0, first_stage=0, released=2, connection="none",
        ways=(
            way("base", (1.0, 1.0), stages=still),
            way("robot1", (0.0, 0.0), (1.0, 0.0), stages=(0, 0, 0, 1)),
            way("robot2", (5.0, 5.0), (6.0, 5.0), stages=(0, 1, 1, 1)),
        ),
    )  # fmt: skip
    send(life, order_2)
    life.live_until(LONG_S + 0.5)
    assert (life.driver.pose(), state(life).mode) == ((0.0, 0.0), "yielding")
    assert life.logs[-1].text == f"has been waiting for robot2 for {LONG_S:g} s"
    logs = len(life.logs)
    there = State(
        position=(6.0, 5.0), velocity=(0.0, 0.0), mode="yielding",
        progress=Progress(epoch=0, plan=7, revision=0, finished=1),
    )  # fmt: skip
    life.hear(say("robot2", there))
    life.live_until(2.9)
    assert life.driver.pose() == pytest.approx((2.9 - LONG_S - 0.5, 0.0))
    assert len(life.logs) == logs


def test_yields_until_more_is_released(life: Life) -> None:
    way_out = ((0.0, 0.0), (1.0, 0.0), (2.0, 0.0))
    send(life, go(*way_out, released=0))
    life.live_until(1.5)
    assert (life.driver.pose(), state(life).mode) == ((1.0, 0.0), "yielding")
    life.hear(order(3, go(*way_out)))
    life.live_until(2.0)
    assert life.driver.pose() == pytest.approx((1.5, 0.0))
    assert life.jobs == []  # it was certified before


@settings(deadline=None)
@given(st.permutations([(0, 1), (0, 2), (1, 1), (1, 2), (2, 1), (2, 2)]))
def test_does_what_the_latest_order_says_whatever_the_order_of_arrival(arrivals: list[tuple[int, int]]) -> None:
    life = Life(make_robot(make_mission()))
    for epoch, sequence in arrivals:
        motion = go((0.0, 0.0), (float(epoch), 1.0)) if sequence == 2 else None
        life.hear(order(sequence, motion, epoch=epoch))
        life.live_until(life.now_s + 0.02)
    life.live_until(0.2)
    assert state(life).obeying == Authority(epoch=2, leader="base", sequence=2)
    news = [arrival for place, arrival in enumerate(arrivals) if arrival == max(arrivals[: place + 1])]
    while life.jobs:
        certify(life)
    life.live_until(3.1)
    if any(sequence == 1 for _, sequence in news):
        assert life.driver.pose() == pytest.approx((2.0, 1.0))
    else:  # nobody has told it to hold before
        assert (life.driver.pose(), state(life).mode) == ((0.0, 0.0), "holding")


def test_another_leader_begins_afresh_and_until_it_does_the_robot_stands(life: Life) -> None:
    send(life, go((0.0, 0.0), (5.0, 0.0)))
    life.live_until(1.0)
    life.hear(order(1, go((1.0, 0.0), (1.0, 5.0)), epoch=1, leader="robot2", sender="robot2"))
    life.live_until(1.5)
    assert (life.driver.pose(), state(life).mode) == ((1.0, 0.0), "holding")
    assert state(life).refusing == "plan 0 is new, and robot1 has not been told to hold before"
    life.hear(order(2, epoch=1, leader="robot2", sender="robot2"))
    life.live_until(1.5)
    assert (state(life).progress, state(life).obeying) == (None, Authority(epoch=1, leader="robot2", sequence=2))
    life.hear(order(3, go((1.0, 0.0), (1.0, 5.0)), epoch=1, leader="robot2", sender="robot2"))
    certify(life)
    life.live_until(2.5)
    assert life.driver.pose() == pytest.approx((1.0, 1.0))
    assert state(life).progress == Progress(epoch=1, plan=0, revision=0, finished=0)


def test_stands_when_nobody_is_obeyed_and_goes_on_with_the_same_leader(life: Life) -> None:
    motion = go((0.0, 0.0), (10.0, 0.0))
    send(life, motion)
    life.live_until(2.0)
    life.hear(order(3, motion))
    life.live_until(6.0)
    assert state(life).mode == "holding"
    assert life.driver.pose() == pytest.approx((5.0, 0.0))
    life.hear(order(3, motion))  # an echo of old orders renews nothing
    life.live_until(7.0)
    assert life.driver.pose() == pytest.approx((5.0, 0.0))
    life.hear(order(4, motion))
    life.live_until(8.0)
    assert life.driver.pose() == pytest.approx((6.0, 0.0))
    assert state(life).mode == "moving"
    assert life.jobs == []


def test_holds_at_once_when_told_to_and_says_so(life: Life) -> None:
    send(life, go((0.0, 0.0), (5.0, 0.0)))
    life.live_until(0.55)
    life.hear(order(3))
    life.live_until(0.55)
    said = state(life)
    assert (said.mode, said.velocity, said.progress, said.position) == ("holding", (0.0, 0.0), None, (0.55, 0.0))
    life.live_until(1.0)
    assert life.driver.pose() == pytest.approx((0.55, 0.0))
    assert life.logs[-1].text == "decision 3: told to hold"


def test_holds_when_the_motion_has_no_way_for_it(life: Life) -> None:
    send(life, go((0.0, 0.0), (5.0, 0.0)))
    life.live_until(0.5)
    others = go((0.0, 0.0), (1.0, 0.0), plan=1)
    life.hear(order(3, structs.replace(others, ways=tuple(way for way in others.ways if way.member != "robot1"))))
    life.live_until(1.0)
    assert (state(life).mode, state(life).progress, state(life).refusing) == ("holding", None, "")
    assert life.driver.pose() == pytest.approx((0.5, 0.0))
    assert life.logs[-1].text == "decision 3 has no way for robot1: holding"


def test_refuses_what_is_not_certified_and_says_once_why(life: Life) -> None:
    life.hear(order(1))
    life.live_until(0.0)
    bad = go((0.0, 0.0), BAD)
    life.hear(order(2, bad))
    certify(life)
    for sequence in range(3, 6):
        life.hear(order(sequence, bad))
        life.live_until(life.now_s + 0.5)
    assert life.jobs == []
    assert (state(life).mode, state(life).refusing) == ("holding", "robot1 goes where it must not")
    assert life.driver.pose() == (0.0, 0.0)
    assert [line.text for line in life.logs] == ["refuses revision 0 of plan 0: robot1 goes where it must not"]
    life.hear(order(6))
    life.live_until(life.now_s)
    assert state(life).refusing == ""
    life.hear(order(7, go((0.0, 0.0), (1.0, 0.0), plan=1)))
    certify(life)
    life.live_until(life.now_s + 1.5)
    assert (state(life).mode, state(life).refusing) == ("arrived", "")


def test_a_failing_judge_is_no_certificate(life: Life) -> None:
    life.hear(order(1))
    life.live_until(0.0)
    life.hear(order(2, go((0.0, 0.0), (1.0, 0.0))))
    certify(life, failure="MemoryError: none left")
    life.live_until(1.0)
    assert life.driver.pose() == (0.0, 0.0)
    assert state(life).refusing == "it could not be certified: MemoryError: none left"


def test_ends_what_it_has_accepted_when_it_refuses_what_comes_after(life: Life) -> None:
    send(life, go((0.0, 0.0), (1.0, 0.0), (2.0, 0.0), released=0))
    life.live_until(0.5)
    life.hear(order(3, go((0.0, 0.0), (1.0, 0.0), BAD, revision=1, released=1)))
    certify(life)
    said = state(life)
    assert (said.mode, said.refusing) == ("moving", "robot1 goes where it must not")
    life.live_until(2.0)
    assert life.driver.pose() == pytest.approx((1.0, 0.0))
    said = state(life)
    assert (said.mode, said.progress) == ("holding", Progress(epoch=0, plan=0, revision=0, finished=1))


def test_takes_a_revision_up_without_a_stop(life: Life) -> None:
    send(life, go((0.0, 0.0), (1.0, 0.0), (1.0, 5.0), released=0))
    life.live_until(0.5)
    life.hear(order(3, go((0.0, 0.0), (1.0, 0.0), (2.0, 0.0), revision=1, released=0)))
    life.live_until(0.7)
    assert (state(life).mode, state(life).progress) == ("moving", Progress(epoch=0, plan=0, revision=0, finished=0))
    certify(life)
    assert state(life).progress == Progress(epoch=0, plan=0, revision=1, finished=0)
    life.hear(order(4, go((0.0, 0.0), (1.0, 0.0), (2.0, 0.0), revision=1)))
    life.live_until(1.5)
    assert life.driver.pose() == pytest.approx((1.5, 0.0))


def test_accepts_a_certified_revision_although_the_next_one_has_come(life: Life) -> None:
    ways = ((0.0, 0.0), (1.0, 0.0))
    send(life, go(*ways, (1.0, 5.0), released=0))
    life.hear(order(3, go(*ways, (2.0, 0.0), revision=1, released=0)))
    life.live_until(0.1)
    life.hear(order(4, go(*ways, (3.0, 0.0), revision=2, released=0)))
    certify(life)
    assert state(life).progress == Progress(epoch=0, plan=0, revision=1, finished=0)
    certify(life)
    assert state(life).progress == Progress(epoch=0, plan=0, revision=2, finished=0)
    assert state(life).target == (3.0, 0.0)


def test_a_certificate_that_comes_after_the_plan_is_of_no_use(life: Life) -> None:
    life.hear(order(1))
    life.live_until(0.0)
    life.hear(order(2, go((0.0, 0.0), (5.0, 0.0))))
    life.live_until(0.1)
    life.hear(order(3))
    certify(life)
    life.live_until(0.5)
    assert (life.driver.pose(), state(life).progress) == ((0.0, 0.0), None)
    life.hear(order(4, go((0.0, 0.0), (0.0, 5.0), plan=1)))
    certify(life)
    life.live_until(1.5)
    assert life.driver.pose() == pytest.approx((0.0, 1.0))


def test_a_robot_that_was_started_again_asks_for_a_fresh_start(life: Life) -> None:
    life.hear(order(7, go((0.0, 0.0), (5.0, 0.0))))
    life.live_until(1.0)
    assert life.jobs == []
    assert (state(life).mode, state(life).progress) == ("holding", None)
    assert state(life).refusing == "plan 0 is new, and robot1 has not been told to hold before"


def test_holds_when_something_has_moved_it_off_its_way(life: Life) -> None:
    send(life, go((0.0, 0.0), (5.0, 0.0)))
    life.live_until(1.0)
    life.driver.drive((0.0, 1.0), 0.5)
    life.driver.advance(1.25)
    life.now_s = 1.25
    life.live_until(2.0)
    x, y = life.driver.pose()
    assert math.dist((x, y), (1.0, 0.25)) < 0.11
    assert state(life).mode == "holding"
    assert state(life).refusing == f"robot1 is {y:.2f} m off its way"


def test_a_mind_that_hangs_does_not_drive_on(life: Life) -> None:
    send(life, go((0.0, 0.0), (10.0, 0.0)))
    life.live_until(1.0)
    life.driver.advance(9.0)
    assert life.driver.pose()[0] == pytest.approx(1.0 + patience_s(10.0), abs=0.11)


def test_the_loss_of_others_is_not_its_business(life: Life) -> None:
    before = len(life.said)
    life.hear(PeerVanished("base"))
    assert len(life.said) == before
