"""Motions of the team: certified, to the right places, and weighed by how long the chain holds on them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs

from agents.assignment import assign
from agents.certificate_judge import certificate_judge
from agents.leader import DeploymentPlanner, Plan
from agents.mission import Mission, RosterEntry
from agents.motion_message import end_stage, to_schedule
from agents.motion_planner import MotionPlanner, Option
from agents.movement_authority import MovementAuthority, Onset
from agents.planning_job import Question
from agents.roaming import Roaming
from agents.target_set import TargetSet
from agents.team_planner import EXCHANGED, TeamPlanner
from agents.whereabouts import announce
from planning.certificate import certify
from planning.compiled_map import CompiledMap
from planning.environment import Environment
from protocol.messages import Motion, Placement, Point, Progress
from tests.agents.conftest import make_mission

HALL = Environment([(0, 0), (20, 0), (20, 4), (12, 4), (12, 12), (8, 12), (8, 4), (0, 4)], name="hall")
"""A corridor of 20 m, 4 m wide, with a room of its own width up in the middle."""

ALLEY = Environment([(0, 0), (20, 0), (20, 0.7), (0, 0.7)], name="alley")
"""Too narrow for two to pass."""

BASE = (1.0, 1.0)


def make_planner(environment: Environment, base: Point = BASE, robots: int = 3) -> tuple[MotionPlanner, Mission]:
    mission = make_mission()
    mission = structs.replace(
        mission,
        roster=(
            structs.replace(mission.base_station, start=base),
            mission.tracked_agent,
            *(RosterEntry(name=f"robot{n}", role="robot", start=base) for n in range(1, robots + 1)),
        ),
    )
    graph = CompiledMap(environment, "inflection", 0.2, containing=base).point_placements(None)
    return MotionPlanner(mission, environment, graph, certificate_judge(mission, environment)), mission


def stand(base: Point, **robots: Point) -> Onset:
    return Onset(0, 0, 0, {"base": base, **robots})


def places_at_last(motion: Motion) -> dict[str, Point]:
    return {way.member: way.waypoints[-1] for way in motion.ways if way.scheduled}


def check_certified(motion: Motion, environment: Environment, ends: tuple[str, ...] | None) -> None:
    certificate = certify(to_schedule(motion), environment, ends=ends or None, links=[] if ends == () else None)
    assert certificate.valid, certificate.violations[0].text


def test_a_motion_is_one_network_with_the_next_moments_of_the_agent() -> None:
    planner, _ = make_planner(HALL)
    goals = {"robot1": (5.0, 3.0), "robot2": (9.0, 2.0), "robot3": (13.0, 1.0)}
    way = np.array([(15.0, 2.0), (19.0, 2.0)])
    onset = stand(BASE, robot1=(2.0, 1.0), robot2=(2.0, 2.0), robot3=(2.0, 3.0))
    course = planner.plan(onset, [Option(goals, ["robot3"])], announce(way), {})
    motion = course.motion
    assert course.arrives
    assert course.reason == ""
    assert motion.connection == "team"
    assert {way.member: way.scheduled for way in motion.ways} == {
        "base": True, "robot1": True, "robot2": True, "robot3": True, "agent": False,
    }  # fmt: skip
    agent = next(way for way in motion.ways if way.member == "agent")
    assert agent.waypoints == ((15.0, 2.0), (15.5, 2.0))  # one second at 0.5 m/s
    assert {name: place for name, place in places_at_last(motion).items() if name != "base"} == goals
    check_certified(motion, HALL, None)


def test_a_robot_that_stands_at_its_goal_but_for_rounding_has_nothing_to_drive() -> None:
    planner, _ = make_planner(HALL)
    goals = {"robot1": (5.0, 3.0), "robot2": (9.0, 2.0), "robot3": (13.0, 1.0)}
    onset = stand(BASE, robot1=(5.0, 3.0 + 5e-16), robot2=(9.0, 1.5), robot3=(13.0, 1.0 - 1e-15))
    course = planner.plan(onset, [Option(goals, ["robot3"])], announce(np.array([(15.0, 2.0)])), {})
    assert course.arrives
    assert places_at_last(course.motion)["robot2"] == goals["robot2"]


def test_whoever_is_in_the_way_exchanges_places() -> None:
    planner, _ = make_planner(ALLEY, (1.0, 0.35))
    onset = stand((1.0, 0.35), robot1=(3.0, 0.35), robot2=(5.0, 0.35))
    crossing = Option({"robot1": (12.0, 0.35), "robot2": (9.0, 0.35)}, ["robot1"])
    way = np.array([(16.0, 0.35)])
    alone = planner.plan(onset, [crossing], announce(way), {})
    assert not alone.arrives
    assert alone.reason
    check_certified(alone.motion, ALLEY, ())
    exchanged = Option({"robot2": (12.0, 0.35), "robot1": (9.0, 0.35)}, ["robot2"])
    course = planner.plan(onset, [crossing, exchanged], announce(way), {})
    assert course.option is exchanged
    assert course.arrives
    check_certified(course.motion, ALLEY, None)


def test_a_lost_robot_is_gone_around() -> None:
    planner, mission = make_planner(HALL)
    onset = stand(BASE, robot1=(3.0, 2.0))
    option = Option({"robot1": (17.0, 2.0)}, ["robot1"])
    for lost in ([(10.0, 2.0)], [(9.0, 2.0), (11.0, 2.2)]):
        course = planner.plan(onset, [option], announce(np.array([(18.0, 2.0)])), {"robot2": np.array(lost)})
        assert course.arrives
        ways = {way.member: way for way in course.motion.ways}
        assert not ways["robot2"].scheduled
        assert ways["robot2"].waypoints == tuple(lost)
        assert ways["robot2"].radius_m == mission.robot_radius_m
        assert course.motion.connection == "joined"
        check_certified(course.motion, HALL, course.motion.joined)


def test_a_revision_keeps_what_was_released_and_is_certified_with_it() -> None:
    planner, _ = make_planner(HALL)
    robots = {"robot1": (2.0, 1.0), "robot2": (2.0, 2.0)}
    first = Option({"robot1": (9.0, 1.0), "robot2": (9.0, 3.0)}, ["robot1"])
    course = planner.plan(stand(BASE, **robots), [first], announce(np.array([(15.0, 2.0)])), {})
    authority = MovementAuthority(0, course.motion, robots)
    for robot in robots:
        authority.hear(robot, Progress(epoch=0, plan=0, revision=0, finished=0))
    authority.release(0.6)
    onset = authority.onset()
    assert onset.kept is not None
    second = Option({"robot1": (5.0, 3.0), "robot2": (12.0, 2.0)}, ["robot2"])
    revised = planner.plan(onset, [second], announce(np.array([(15.5, 2.0)])), {}).motion
    assert (revised.plan, revised.revision, revised.first_stage) == (0, 1, 0)
    check_certified(revised, HALL, None)
    before = {way.member: way for way in course.motion.ways}
    for way in revised.ways:
        if way.scheduled:
            end = way.stages[authority.released + 1]
            assert way.waypoints[: end + 1] == before[way.member].waypoints[: end + 1]
    assert end_stage(revised) > authority.released + 1


def test_nobody_overtakes_whoever_is_sent_where() -> None:
    planner, _ = make_planner(ALLEY, (1.0, 0.35))
    robots: Mapping[str, Point] = {"a": (3.0, 0.35), "b": (5.0, 0.35), "c": (7.0, 0.35)}
    places = [(12.0, 0.35), (9.0, 0.35), (15.0, 0.35)]
    assert assign(planner.geodesics, robots, places, {}) == ["b", "a", "c"]
    # Two beside each other keep the places that they had, though a little would be won.
    assert assign(planner.geodesics, {"a": (3.0, 0.3), "b": (3.1, 0.4)}, [(9.0, 0.35), (9.3, 0.35)], {}) == ["a", "b"]
    kept = assign(
        planner.geodesics, {"a": (3.0, 0.3), "b": (3.1, 0.4)}, [(9.0, 0.35), (9.3, 0.35)],
        {"a": (9.3, 0.35), "b": (8.9, 0.35)},
    )  # fmt: skip
    assert kept == ["a", "b"]


@pytest.fixture(scope="module")
def team_planner() -> TeamPlanner:
    motions, mission = make_planner(HALL)
    deployments = DeploymentPlanner(
        HALL, BASE, 0.2, "inflection", robot_speed_m_s=mission.robot_speed_m_s, agent_speed_m_s=mission.agent_speed_m_s
    )
    return TeamPlanner(HALL, deployments, motions, mission.agent_speed_m_s)


def test_what_leads_to_the_goals_is_not_planned_again(team_planner: TeamPlanner) -> None:
    onset = stand(BASE, robot1=(2.0, 1.0), robot2=(2.0, 2.0), robot3=(2.0, 3.0))
    question = Question(way=((10.0, 11.0),), onset=onset, lead_s=0.0, previous=None, heading={})
    answer = team_planner.plan(question)
    assert answer.failure == ""
    assert answer.course is not None
    assert answer.plan.serves
    goals = {place.robot: place.position for place in answer.plan.placements}
    assert answer.course.option.goals == goals
    again = team_planner.plan(
        Question(way=((10.0, 11.0),), onset=onset, lead_s=0.0, previous=answer.plan, heading=goals)
    )
    assert again.course is None
    assert again.plan.edges == answer.plan.edges


def test_how_long_the_agent_is_certain_to_be_seen(team_planner: TeamPlanner) -> None:
    """In the corridor everything is in sight of the base but the room above; its door is 7 m and 14 s from here."""
    onset = stand(BASE, robot1=(2.0, 1.0))
    for lead_s, left_s in ((0.0, 14.0), (2.0, 12.0)):
        answer = team_planner.plan(Question(way=((1.0, 3.5),), onset=onset, lead_s=lead_s, previous=None, heading={}))
        door = float(np.hypot(8.0 - 1.0, 4.0 - 3.5))
        assert answer.in_sight_s == pytest.approx(door / 0.5 - lead_s, abs=0.2)
        assert answer.in_sight_s == pytest.approx(left_s, abs=0.5)


def test_of_an_agent_that_is_only_measured_no_sight_is_promised_but_how_long_it_lasts() -> None:
    motions, mission = make_planner(HALL)
    deployments = DeploymentPlanner(HALL, BASE, 0.2, "inflection", agent_speed_m_s=mission.agent_speed_m_s)
    roaming = Roaming(motions.geodesics, mission.agent_speed_m_s, BASE)
    planner = TeamPlanner(HALL, deployments, motions, mission.agent_speed_m_s, roaming)
    onset = stand(BASE, robot1=(2.0, 1.0), robot2=(2.0, 2.0))
    samples = ((1.0, 3.5), (1.5, 3.5), (1.5, 3.0), (1.0, 3.0))
    near = TargetSet(0.0, samples[0], samples, (), 0.25, 0.0)
    question = Question(way=(), onset=onset, lead_s=1.0, previous=None, heading={}, target=near)
    door = float(np.hypot(8.0 - 1.5, 4.0 - 3.5))
    assert planner.plan(question).in_sight_s == pytest.approx(door / 0.5 - 1.0, abs=0.2)
    above = TargetSet(0.0, (10.0, 11.0), ((10.0, 11.0), (10.5, 11.0)), (), 0.25, 0.0)
    answer = planner.plan(Question(way=(), onset=onset, lead_s=0.0, previous=None, heading={}, target=above))
    assert answer.failure == ""
    assert answer.course is not None
    assert answer.course.motion.connection == "team"
    assert "agent" not in {way.member for way in answer.course.motion.ways}
    check_certified(answer.course.motion, HALL, None)
    nothing = planner.plan(Question(way=(), onset=onset, lead_s=0.0, previous=None, heading={}))
    assert nothing.in_sight_s == 0.0


def test_who_says_that_it_is_where_none_can_be_is_left_out_and_keeps_nobody(team_planner: TeamPlanner) -> None:
    """Off the map, or deep in a wall; so near to a wall that its disc reaches into it, it is taken to be beside it."""
    places = {"robot1": (2.0, 0.1), "robot2": (1e7, -1e7)}
    spare = Placement(robot="robot1", position=(-9.0, -9.0), spare=True)
    before = Plan((spare,), (("base", "agent"),), 1.0, 0, True, "what another leader may have said")
    relay = replace(before, placements=(structs.replace(spare, spare=False),))
    for previous, others in ((None, ()), (before, ((4.0, 3.0),)), (relay, ((4.0, 3.0), (4.5, 3.0)))):
        lost = {"robot3": np.array([(-50.0, 1.0), *others])}
        question = Question(
            way=((10.0, 11.0),), onset=stand(BASE, **places), lead_s=0.0, previous=previous, heading={}, lost=lost
        )
        answer = team_planner.plan(question)
        assert answer.failure == "" and answer.course is not None
        assert [place.robot for place in answer.plan.placements] == ["robot1"]
        assert HALL.inflated(0.2).contains([place.position for place in answer.plan.placements]).all()
        ways = {way.member: way for way in answer.course.motion.ways}
        assert "robot2" not in ways and ("robot3" in ways) == bool(others)
        assert ways["robot1"].waypoints[0] == pytest.approx((2.0, 0.2))
        assert not others or set(ways["robot3"].waypoints) == set(others)
        assert answer.course.reason.endswith(
            "robot2 says that it is at (10000000, -10000000) m, where no robot can be, and is left out"
        )
    nobody = team_planner.plan(replace(question, onset=stand(BASE, robot2=(1e7, -1e7)), previous=None))
    assert nobody.course is None and "robot2 says that it is at" in nobody.plan.reason


def test_goals_keep_apart_from_each_other_and_from_the_lost(team_planner: TeamPlanner) -> None:
    onset = stand(BASE, robot1=(2.0, 1.0), robot2=(2.0, 2.0))
    lost = {"robot3": np.array([(9.5, 4.5), (9.8, 4.2)])}
    answer = team_planner.plan(
        Question(way=((10.0, 11.0),), onset=onset, lead_s=0.0, previous=None, heading={}, lost=lost)
    )
    assert answer.failure == ""
    places = [*(place.position for place in answer.plan.placements), *map(tuple, lost["robot3"].tolist())]
    for index, one in enumerate(places[:2]):
        for other in places[index + 1 :]:
            assert np.hypot(one[0] - other[0], one[1] - other[1]) > 0.4
    assert not answer.plan.reason.endswith(EXCHANGED)
