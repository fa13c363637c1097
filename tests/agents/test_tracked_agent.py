from __future__ import annotations

import pytest
from msgspec import structs

from agents.behaviour import begin
from agents.mind import Mind
from agents.mission import Behaviour, Mission, OnDemand, Scripted, Wandering
from agents.records import Track
from agents.role import Heard
from agents.tracked_agent import REMEMBERED_GOALS, TrackedAgent
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from protocol.keys import Address
from protocol.messages import Envelope, Goal, GoalReply, Heartbeat, Intent, Point
from tests.agents.conftest import make_mission
from tests.agents.life import Life

START = (1.0, 1.0)


def walk(corner: Environment, behaviour: Behaviour) -> Life:
    mission: Mission = structs.replace(make_mission(), behaviour=behaviour)
    free = corner.inflated(mission.agent_radius_m, containing=START)
    agent = TrackedAgent(mission, free, GeodesicMap(free), begin(mission, free))
    return Life(Mind([agent]), START, mission.agent_speed_m_s)


def ask(goal: Point, correlation: str, operator: str = "anna") -> Heard:
    body = Goal(goal=goal, correlation=correlation)
    envelope = Envelope(sender=operator, incarnation=0, sequence=0, sent_at_s=0.0, body=body)
    return Heard(Address("team", operator, "goal", operator=True), envelope)


def replies(life: Life) -> list[GoalReply]:
    return [body for _, body in life.all_said(GoalReply)]


def goals_taken(life: Life) -> list[tuple[float, Point | None]]:
    """When which goal was first announced."""
    taken: list[tuple[float, Point | None]] = []
    for time_s, intent in life.all_said(Intent):
        if not taken or taken[-1][1] != intent.goal:
            taken.append((time_s, intent.goal))
    return taken


def test_walks_its_script_with_rests_and_then_stays(corner: Environment) -> None:
    life = walk(corner, Scripted(goals=((2.0, 1.0), (2.0, 2.0)), pause_s=1.0, start_after_s=2.0))
    life.live_until(20.0)
    assert goals_taken(life) == [
        (0.0, None),
        (pytest.approx(2.0), (2.0, 1.0)),
        (pytest.approx(5.0), (2.0, 2.0)),  # 2 s of way at 0.5 m/s, 1 s of rest
    ]
    assert life.driver.pose() == pytest.approx((2.0, 2.0))
    assert life.all_said(Intent)[-1][1].mode == "arrived"
    assert not life.logs


def test_announces_where_it_is_and_its_way_there(corner: Environment) -> None:
    life = walk(corner, OnDemand())
    life.hear(ask((2.0, 9.0), "a"))
    life.live_until(2.0)
    time_s, intent = life.all_said(Intent)[-1]
    assert time_s == pytest.approx(2.0)
    assert intent.goal == (2.0, 9.0)
    assert intent.position == life.driver.pose() == intent.path[0]
    assert intent.path[-1] == (2.0, 9.0)
    assert len(life.all_said(Intent)) == 21
    assert not life.all_said(Heartbeat), "whoever says where it is lives"
    assert sum(isinstance(record, Track) for record in life.records) == 21


def test_waits_for_goals_when_it_has_no_behaviour(corner: Environment) -> None:
    life = walk(corner, OnDemand())
    life.live_until(10.0)
    assert life.driver.pose() == START
    assert life.all_said(Intent)[-1][1].mode == "waiting"


def test_an_operators_goal_interrupts_the_script_which_then_goes_on(corner: Environment) -> None:
    life = walk(corner, Scripted(goals=((2.0, 1.0), (3.0, 1.0)), pause_s=0.0, start_after_s=0.0))
    life.live_until(1.0)
    life.hear(ask((1.5, 3.0), "a"))
    life.live_until(30.0)
    assert [goal for _, goal in goals_taken(life)] == [(2.0, 1.0), (1.5, 3.0), (2.0, 1.0), (3.0, 1.0)]
    assert replies(life) == [GoalReply(correlation="a", accepted=True)]
    assert life.driver.pose() == pytest.approx((3.0, 1.0))


def test_the_latest_of_several_goals_is_walked(corner: Environment) -> None:
    life = walk(corner, OnDemand())
    life.hear(ask((2.0, 9.0), "a"))
    life.hear(ask((1.0, 2.0), "b", "ben"))
    life.live_until(5.0)
    assert life.driver.pose() == pytest.approx((1.0, 2.0))
    assert [reply.correlation for reply in replies(life)] == ["a", "b"]


@pytest.mark.parametrize("goal", [(3.0, 99.0), (7.5, 7.5), (0.1, 3.0), (-1e7, 1e7)])
def test_refuses_a_goal_where_it_cannot_be_and_says_why(corner: Environment, goal: Point) -> None:
    life = walk(corner, OnDemand())
    life.hear(ask(goal, "a"))
    life.live_until(3.0)
    (reply,) = replies(life)
    assert not reply.accepted
    assert reply.reason == (
        f"goal ({goal[0]:.2f}, {goal[1]:.2f}) lies outside the map or nearer than 0.20 m to a wall: "
        "choose a point in free space"
    )
    assert life.driver.pose() == START


def test_a_goal_said_again_is_answered_again_but_not_walked_again(corner: Environment) -> None:
    life = walk(corner, OnDemand())
    life.hear(ask((2.0, 1.0), "a"))
    life.live_until(5.0)
    life.hear(ask((1.0, 1.0), "b"))
    life.live_until(10.0)
    life.hear(ask((2.0, 1.0), "a"))
    life.live_until(15.0)
    assert life.driver.pose() == pytest.approx((1.0, 1.0))
    assert [reply.correlation for reply in replies(life)] == ["a", "b", "a"]
    life.hear(ask((2.0, 1.0), "a", "ben"))  # the same correlation of somebody else is another request
    life.live_until(20.0)
    assert life.driver.pose() == pytest.approx((2.0, 1.0))


def test_memory_of_goals_is_bounded(corner: Environment) -> None:
    life = walk(corner, OnDemand())
    for number in range(3 * REMEMBERED_GOALS):
        life.hear(ask((2.0, 1.0), str(number)))
    assert len(life.role.parts[0]._answers) == REMEMBERED_GOALS  # type: ignore[attr-defined]


def test_a_script_leaves_out_what_it_cannot_reach(corner: Environment) -> None:
    life = walk(corner, Scripted(goals=((7.5, 7.5), (2.0, 1.0)), pause_s=0.0, start_after_s=0.0))
    life.live_until(10.0)
    assert life.driver.pose() == pytest.approx((2.0, 1.0))
    assert [line.level for line in life.logs] == ["warning"]


def test_wandering_never_leaves_free_space_and_rests_in_between(corner: Environment) -> None:
    life = walk(corner, Wandering(pause_s=0.5, start_after_s=1.0))
    life.live_until(120.0)
    places = [intent.position for _, intent in life.all_said(Intent)]
    free = corner.inflated(0.2 - 1e-6, containing=START)
    assert free.contains(places).all()
    assert len(goals_taken(life)) > 10
    resting = sum(intent.mode == "arrived" for _, intent in life.all_said(Intent))
    assert resting == pytest.approx(5 * (len(goals_taken(life)) - 2), abs=10)
