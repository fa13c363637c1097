from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agents.driver import patience_s
from agents.mission import Mission
from agents.records import Track
from agents.robot import Robot
from agents.role import Heard
from protocol.bus import PeerVanished
from protocol.keys import Address
from protocol.messages import Authority, Deployment, Envelope, Heartbeat, Placement, Point, State
from tests.agents.conftest import StraightRoutes, make_mission
from tests.agents.life import Life


def order(sequence: int, target: Point | None, *, epoch: int = 0, leader: str = "base", sender: str = "base") -> Heard:
    placements = () if target is None else (Placement(robot="robot1", position=target, cell=sequence),)
    deployment = Deployment(
        authority=Authority(epoch=epoch, leader=leader, sequence=sequence), valid_for_s=3.0, decision=sequence,
        placements=placements, edges=(), cost=0.0, relays_needed=1, reason="test",
    )  # fmt: skip
    envelope = Envelope(sender=sender, incarnation=0, sequence=sequence, sent_at_s=0.0, body=deployment)
    return Heard(Address("team", sender, "deployment"), envelope)


def state(life: Life) -> State:
    return life.all_said(State)[-1][1]


def tracks(life: Life) -> list[Track]:
    return [record for record in life.records if isinstance(record, Track)]


@pytest.fixture
def life(mission: Mission, routes: StraightRoutes) -> Life:
    return Life(Robot(mission, "robot1", routes))


def test_waits_and_says_so_until_it_has_a_place(life: Life) -> None:
    life.live_until(2.0)
    assert state(life).mode == "waiting"
    assert life.driver.pose() == (0.0, 0.0)
    assert sum(isinstance(body, State) for _, body in life.said) == 21
    assert sum(isinstance(body, Heartbeat) for _, body in life.said) == 5
    assert len(tracks(life)) == 21


def test_goes_to_its_place_at_full_speed_and_arrives_exactly(life: Life) -> None:
    life.live_until(0.25)
    life.hear(order(1, (0.6, 0.8)))
    life.live_until(0.75)
    assert life.driver.pose() == pytest.approx((0.3, 0.4))
    assert state(life).mode == "moving"
    assert state(life).obeying == Authority(epoch=0, leader="base", sequence=1)
    life.live_until(1.5)
    assert life.driver.pose() == pytest.approx((0.6, 0.8), abs=1e-12)
    assert state(life).mode == "arrived"
    assert state(life).velocity == (0.0, 0.0)


@settings(deadline=None)
@given(st.permutations([(0, 1), (0, 2), (1, 1), (1, 2), (2, 1)]), st.integers(0, 3))
def test_ends_where_the_latest_order_sends_it_whatever_the_order_of_arrival(
    arrivals: list[tuple[int, int]], seed: int
) -> None:
    life = Life(make_robot())
    chance = random.Random(seed)
    for epoch, sequence in [*arrivals, chance.choice(arrivals)]:
        life.hear(order(sequence, (float(epoch), float(sequence)), epoch=epoch))
        life.live_until(life.now_s + 0.05)
    life.live_until(life.now_s + 2.6)
    assert life.driver.pose() == pytest.approx((2.0, 1.0)), f"seed {seed}, arrivals {arrivals}"


def make_robot() -> Robot:
    return Robot(make_mission(), "robot1", StraightRoutes())


@pytest.mark.parametrize(
    "false", [order(9, (5.0, 5.0), leader="robot2"), order(9, (5.0, 5.0), leader="robot2", sender="robot2"),
              order(9, (5.0, 5.0), sender="robot2")]
)  # fmt: skip
def test_obeys_nobody_but_the_base_station_in_its_own_name(life: Life, false: Heard) -> None:
    life.hear(order(1, (1.0, 0.0)))
    life.hear(false)
    life.live_until(2.0)
    assert life.driver.pose() == pytest.approx((1.0, 0.0))


def test_holds_when_its_orders_run_out_and_goes_on_when_they_are_renewed(life: Life) -> None:
    life.hear(order(1, (10.0, 0.0)))
    life.live_until(2.0)
    life.hear(order(2, (10.0, 0.0)))
    life.live_until(6.0)
    assert state(life).mode == "holding"
    assert life.driver.pose() == pytest.approx((5.0, 0.0))
    assert [line.level for line in life.logs] == ["info", "warning"]
    life.hear(order(2, (10.0, 0.0)))  # an echo of old orders renews nothing
    life.live_until(7.0)
    assert life.driver.pose() == pytest.approx((5.0, 0.0))
    life.hear(order(3, (10.0, 0.0)))
    life.live_until(8.0)
    assert life.driver.pose() == pytest.approx((6.0, 0.0))
    assert state(life).mode == "moving"
    assert [line.level for line in life.logs] == ["info", "warning", "info"]


def test_holds_when_it_has_no_place(life: Life) -> None:
    life.hear(order(1, (1.0, 0.0)))
    life.live_until(0.5)
    life.hear(order(2, None))
    life.live_until(1.0)
    assert state(life).mode == "holding"
    assert life.driver.pose() == pytest.approx((0.5, 0.0))


def test_holds_and_says_once_why_when_a_place_cannot_be_reached(life: Life) -> None:
    for sequence in range(1, 5):
        life.hear(order(sequence, (1e6, 0.0)))
        life.live_until(life.now_s + 0.5)
    assert state(life).mode == "holding"
    assert life.driver.pose() == (0.0, 0.0)
    assert [line.text for line in life.logs] == [
        "decision 1: cannot go where it sends robot1 (not in free space): holding"
    ]
    life.hear(order(5, (1.0, 0.0)))
    life.live_until(life.now_s + 2.0)
    assert state(life).mode == "arrived"


def test_a_place_that_moves_is_followed_without_a_stop(life: Life) -> None:
    for step in range(1, 40):
        life.hear(order(step, (0.05 * step + 0.5, 0.0)))
        life.live_until(life.now_s + 0.1)
    assert life.driver.pose()[0] == pytest.approx(0.05 * 39 + 0.5, abs=0.06)
    moving = [track.mode for track in tracks(life)[3:]]
    assert len(life.logs) == 1
    assert set(moving) <= {"moving", "arrived"}


def test_a_mind_that_hangs_does_not_drive_on(life: Life) -> None:
    life.hear(order(1, (10.0, 0.0)))
    life.live_until(1.0)
    life.driver.advance(9.0)
    assert life.driver.pose()[0] == pytest.approx(1.0 + patience_s(10.0), abs=0.11)


def test_the_loss_of_others_is_not_its_business(life: Life) -> None:
    assert life.role.handle(PeerVanished("base"), 0.0) == ()
