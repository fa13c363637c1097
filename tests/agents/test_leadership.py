"""The base station in office, with a planner that does what the test wants, and robots that obey."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest
from msgspec import structs

from agents.agent_knowledge import AgentKnowledge
from agents.base_station import BaseStation
from agents.collection import Collection
from agents.dispatcher import PATIENCE_S, Dispatcher
from agents.leader import Plan
from agents.leadership import PLANNING, PREPARING, Leadership
from agents.mind import Mind
from agents.mission import Mission
from agents.motion_planner import Course, Option
from agents.planning_job import Answer, Question
from agents.records import Connectivity, Decision, Ordered, Planned, Track
from agents.reign_duty import AGAIN_S, GRACE_S, PACE_S, REPEAT_S
from agents.role import Compute, Effect, Heard, JobDone
from agents.setbacks import LONGEST_S, REST_S
from planning.environment import Environment
from protocol.keys import Address
from protocol.messages import (
    AnyBody,
    Authority,
    Deployment,
    Edge,
    Envelope,
    Heartbeat,
    Intent,
    MemberWay,
    Motion,
    Placement,
    Point,
    Progress,
    Reign,
    State,
    decode,
    encode,
)
from tests.agents.life import Life
from tests.agents.sworn import sworn

START = (1.0, 1.0)
CHAIN = (("base", "robot1"), ("robot1", "agent"))


def plan(relay: Point = (2.0, 2.0), spare: Point = (3.0, 3.0), edges: Any = CHAIN, serves: bool = True) -> Plan:
    return Plan(
        placements=(
            Placement(robot="robot1", position=relay, cell=4),
            Placement(robot="robot2", position=spare, spare=True),
        ),
        edges=edges, cost=2.0, relays_needed=1, serves=serves, reason=f"{relay} for the agent",
    )  # fmt: skip


class Agreed:
    """A tree that everybody has agreed to, whatever it is."""

    busy = False
    collecting = False

    def is_in_force(self, _edges: object) -> bool:
        return True

    def look(self, _now_s: float) -> list[Effect]:
        return []


class Refused(Agreed):
    """A tree that somebody refuses at once, whatever it is; the one in force does not serve."""

    def __init__(self) -> None:
        self.proposed_s: list[float] = []
        self.last: frozenset[frozenset[str]] = frozenset()

    def is_in_force(self, _edges: object) -> bool:
        return False

    def may_propose(self, _now_s: float, *, urgent: bool) -> bool:
        return urgent

    def serves(self, _places: object, _now_s: float) -> bool:
        return False

    def propose(self, edges: Iterable[Edge], *wish: Any) -> list[Effect]:
        self.proposed_s.append(wish[-1])
        self.last = frozenset(map(frozenset, edges))
        return []

    def withdraw(self, _reason: str, _now_s: float) -> list[Effect]:
        return []


class Oracle:
    """Gives the plan that the test has put there, and a motion straight to it in two stages."""

    def __init__(self) -> None:
        self.answer = plan()
        self.asked: list[Question] = []
        self.reason = ""

    def prepare(self) -> None:
        pass

    def plan(self, question: Question) -> Answer:
        self.asked.append(question)
        onset = question.onset
        goals = {place.robot: place.position for place in self.answer.placements if place.robot in onset.places}
        if goals == question.heading:
            return Answer(self.answer, None)
        ways = [
            MemberWay(member="base", radius_m=0.0, speed_m_s=1.0, waypoints=(onset.places["base"],), stages=(0,) * 3)
        ]
        for name, goal in goals.items():
            start = onset.places[name]
            middle = (0.5 * (start[0] + goal[0]), 0.5 * (start[1] + goal[1]))
            waypoints, stages = ((start, middle, goal), (0, 1, 2)) if start != goal else ((start,), (0, 0, 0))
            ways.append(MemberWay(member=name, radius_m=0.2, speed_m_s=1.0, waypoints=waypoints, stages=stages))
        motion = Motion(plan=0, revision=0, first_stage=0, released=-1, ways=tuple(ways), connection="none")
        return Answer(self.answer, Course(onset.continued(motion), Option(goals, ()), True, self.reason))


class Team(Life):
    """A base station, a planner, and peers that speak when the test says so.

    The robots hear every deployment and obey it at once: what is released they have finished when they speak next.
    """

    def __init__(self, mission: Mission, corner: Environment, tree: Any = None) -> None:
        tree = Agreed() if tree is None else tree
        self.mission, self.corner = mission, corner
        self.tree = tree
        self.oracle = Oracle()
        self.speaking: dict[str, Point] = {"agent": (8.0, 2.0), "robot1": (1.0, 2.0), "robot2": (1.0, 3.0)}
        self.progress: dict[str, Progress] = {}
        self.refusing: dict[str, str] = {}
        self.deaf: set[str] = set()
        self.mute: set[str] = set()
        """Robots that go on saying what they had heard before."""
        self.before: Authority | None = None
        self.obeying: Authority | None = None
        self.allegiance, self.orders = sworn("base")
        self.allegiance.office = Reign(epoch=1, leader="base", incarnation=0)
        collection = Collection(self.allegiance, "agent")
        body = BaseStation(mission, corner, self.orders, collection, 0.0)
        leadership = Leadership(
            mission,
            self.allegiance,
            self.tree,
            self.orders,
            collection,
            AgentKnowledge(collection, None),
            self.oracle,
            None,
            None,
            0.0,
        )
        super().__init__(Mind([self.orders, collection, body, leadership]), START)
        self.goal: Point | None = None
        self.planning_takes_s = 0.02
        self.fails = ""

    def speak(self) -> None:
        for peer, place in list(self.speaking.items()):
            body: AnyBody = State(
                position=place, velocity=(0.0, 0.0), mode="moving",
                obeying=self.before if peer in self.mute else self.obeying,
                progress=self.progress.get(peer), refusing=self.refusing.get(peer, ""),
            )  # fmt: skip
            if peer == "agent":
                path = () if self.goal is None else (place, self.goal)
                body = Intent(position=place, velocity=(0.0, 0.0), mode="moving", goal=self.goal, path=path)
            kind = "intent" if peer == "agent" else "state"
            envelope = Envelope(sender=peer, incarnation=0, sequence=0, sent_at_s=0.0, body=body)
            self.hear(Heard(Address("team", peer, kind), envelope))

    def obey(self, deployment: Deployment) -> None:
        if not self.mute:
            self.before = deployment.authority
        self.obeying, motion = deployment.authority, deployment.motion
        if motion is None:
            self.progress.clear()
            return
        for way in motion.ways:
            if way.member not in self.speaking or way.member in self.deaf:
                continue
            end = max(motion.released + 1 - motion.first_stage, 0)
            self.speaking[way.member] = way.waypoints[way.stages[end]]
            self.progress[way.member] = Progress(
                epoch=deployment.authority.epoch, plan=motion.plan, revision=motion.revision,
                finished=motion.released + 1,
            )  # fmt: skip

    def go_on(self, seconds: float) -> None:
        """Let time pass; everybody speaks ten times a second, and jobs end when they should."""
        for _ in range(round(10 * seconds)):
            self.speak()
            step_ends_s = self.now_s + 0.1
            while self.jobs and self.began_s + self.planning_takes_s <= step_ends_s:
                self.live_until(max(self.now_s, self.began_s + self.planning_takes_s))
                job = self.jobs.pop()
                result = None if self.fails else job.function(*job.arguments)
                self.hear(JobDone(job.job, result, self.planning_takes_s, self.fails))
            self.live_until(step_ends_s)

    def do(self, effects: Iterable[Effect]) -> None:
        said = len(self.said)
        effects = list(effects)
        super().do(effects)
        self.jobs = [job for job in self.jobs if job.job != PREPARING]
        for _, body in self.said[said:]:
            if isinstance(body, Deployment):
                self.obey(body)
        if any(isinstance(effect, Compute) and effect.job == PLANNING for effect in effects):
            assert len(self.jobs) == 1
            self.began_s = self.now_s

    @property
    def deployments(self) -> list[tuple[float, Deployment]]:
        """Those that send somebody somewhere."""
        return [(time_s, said) for time_s, said in self.all_said(Deployment) if said.motion is not None]

    @property
    def motions(self) -> list[Motion]:
        return [said.motion for _, said in self.deployments if said.motion is not None]

    @property
    def decisions(self) -> list[Decision]:
        return [record for record in self.records if isinstance(record, Decision)]

    @property
    def connectivity(self) -> Connectivity:
        return [record for record in self.records if isinstance(record, Connectivity)][-1]


@pytest.fixture
def team(mission: Mission, corner: Environment) -> Team:
    return Team(mission, corner)


def test_first_deployment_goes_out_as_soon_as_everybody_is_heard(team: Team) -> None:
    team.go_on(0.3)
    hold, first = team.all_said(Deployment)[0], team.deployments[0]
    assert hold[1].motion is None
    assert hold[0] == 0.0
    assert first[0] == pytest.approx(PACE_S)  # everybody has said by then that it stands
    question = team.oracle.asked[0]
    assert question.way == ((8.0, 2.0),)
    assert question.onset.places == {"base": START, "robot1": (1.0, 2.0), "robot2": (1.0, 3.0)}
    assert question.lost == {}


def test_first_deployment_waits_for_latecomers_but_not_for_ever(team: Team) -> None:
    del team.speaking["robot2"]
    team.go_on(3.0)
    assert team.deployments[0][0] == pytest.approx(GRACE_S, abs=0.13)
    assert set(team.oracle.asked[0].onset.places) == {"base", "robot1"}
    # It may stand where it is to start from.
    assert {name: way.tolist() for name, way in team.oracle.asked[0].lost.items()} == {"robot2": [[1.0, 3.0]]}


def test_nothing_is_planned_without_an_agent(team: Team) -> None:
    del team.speaking["agent"]
    team.go_on(5.0)
    assert not team.oracle.asked
    assert not team.deployments


def test_a_decision_that_stands_is_repeated_with_a_rising_sequence(team: Team) -> None:
    team.go_on(10.0)
    assert len(team.decisions) == 1
    times_s = [time_s for time_s, _ in team.deployments]
    assert max(b - a for a, b in pairwise(times_s)) <= REPEAT_S + 1e-6
    sequences = [deployment.authority.sequence for _, deployment in team.deployments]
    assert sequences == sorted(set(sequences))
    assert {deployment.decision for _, deployment in team.deployments} == {1}
    assert len(team.oracle.asked) == pytest.approx(20, abs=1)
    assert sum(isinstance(record, Planned) for record in team.records) == len(team.oracle.asked)


def test_the_plan_before_is_given_to_the_planner(team: Team) -> None:
    team.go_on(1.2)
    assert [asked.previous for asked in team.oracle.asked[:2]] == [None, team.oracle.answer]


def test_spares_that_move_are_no_new_decision(team: Team) -> None:
    team.go_on(1.0)
    team.oracle.answer = plan(spare=(4.0, 4.0))
    team.go_on(1.0)
    assert len(team.decisions) == 1
    assert team.deployments[-1][1].placements == team.oracle.answer.placements
    assert team.deployments[-1][1].reason == team.deployments[0][1].reason


def test_a_relay_that_moves_is_a_decision_and_a_new_link_changes_the_topology(team: Team) -> None:
    team.go_on(1.0)
    team.oracle.answer = plan(relay=(4.0, 4.0))
    team.go_on(1.0)
    team.oracle.answer = plan(relay=(4.0, 4.0), edges=(("base", "robot1"), ("base", "agent")))
    team.go_on(1.0)
    assert [decision.topology_changed for decision in team.decisions] == [False, False, True]
    assert [decision.deployment.decision for decision in team.decisions] == [1, 2, 3]


def test_robots_that_exchange_places_leave_the_topology_as_it_is(team: Team) -> None:
    team.go_on(1.0)
    exchanged = tuple(
        structs.replace(place, robot={"robot1": "robot2", "robot2": "robot1"}[place.robot])
        for place in plan().placements
    )
    team.oracle.answer = replace(plan(edges=(("base", "robot2"), ("robot2", "agent"))), placements=exchanged)
    team.go_on(1.0)
    assert [decision.topology_changed for decision in team.decisions] == [False, False]


def test_plans_at_once_when_the_agent_has_a_new_goal(team: Team) -> None:
    team.go_on(5.2)
    before = len(team.oracle.asked)
    team.goal = (9.0, 1.0)
    team.go_on(0.1)
    assert len(team.oracle.asked) == before + 1
    assert team.oracle.asked[-1].way == ((8.0, 2.0), (9.0, 1.0))


def test_plans_without_a_robot_that_is_lost_and_with_it_when_it_is_back(team: Team) -> None:
    team.go_on(5.2)
    place = team.speaking.pop("robot1")
    team.allegiance.gone.add("robot1")
    team.go_on(0.3)
    question = team.oracle.asked[-1]
    assert set(question.onset.places) == {"base", "robot2"}
    assert (question.onset.plan, question.onset.revision) == (1, 0)
    assert question.lost["robot1"][0].tolist() == list(place)
    assert not team.connectivity.team_connected
    team.speaking["robot1"] = place
    team.allegiance.gone.clear()
    team.go_on(0.4)
    assert set(team.oracle.asked[-1].onset.places) == {"base", "robot1", "robot2"}
    assert team.oracle.asked[-1].lost == {}
    assert team.motions[-1].plan == 2


def test_between_two_plans_everybody_holds(team: Team) -> None:
    team.go_on(3.0)
    team.allegiance.gone.add("robot1")
    team.go_on(1.0)
    plans = [None if said.motion is None else said.motion.plan for _, said in team.all_said(Deployment)]
    assert list(dict.fromkeys(plans)) == [None, 0, 1]
    hold = plans.index(None, plans.index(0))
    assert plans[hold - 1] == 0
    assert plans[hold + 1] in (None, 1)


def test_a_robot_that_refuses_ends_the_plan_and_nothing_of_it_is_released(team: Team) -> None:
    team.go_on(1.0)
    team.deaf, team.refusing = {"robot2"}, {"robot2": "it is too far"}
    team.oracle.answer = plan(spare=(4.0, 4.0))
    before = team.motions[-1]
    team.go_on(0.5)
    assert [line.text for line in team.logs if line.level == "warning"] == [
        "robot2 refuses revision 1 of plan 0: it is too far: everybody holds, then a new plan begins"
    ]
    refused = [motion for motion in team.motions if motion.revision == 1]
    assert refused
    assert {motion.released for motion in refused} == {before.released}
    team.deaf, team.refusing = set(), {}
    team.go_on(1.0)
    assert team.motions[-1].plan == 1
    assert team.speaking["robot2"] == (4.0, 4.0)


def test_a_robot_that_does_not_answer_is_asked_again_and_then_given_another_plan(team: Team) -> None:
    team.go_on(1.0)
    team.deaf = {"robot2"}
    team.oracle.answer = plan(spare=(4.0, 4.0))
    team.go_on(1.5)
    times_s = [time_s for time_s, said in team.deployments if said.motion and said.motion.revision == 1]
    assert max(b - a for a, b in pairwise(times_s)) <= AGAIN_S + 1e-6
    team.go_on(2.0)
    assert "robot2 has not accepted a revision for 2 s" in team.logs[-1].text


def test_releases_as_robots_progress_and_not_more_often_than_it_must(team: Team) -> None:
    team.go_on(10.0)
    times_s = [time_s for time_s, _ in team.all_said(Deployment)]
    assert min(b - a for a, b in pairwise(times_s)) >= PACE_S - 1e-6
    released = [motion.released for motion in team.motions]
    assert released == sorted(released)
    assert released[-1] == 1
    assert team.speaking["robot1"] == (2.0, 2.0)


def test_a_motion_that_leads_to_the_goals_is_not_planned_again(team: Team) -> None:
    team.go_on(5.0)
    assert team.oracle.asked[0].heading == {}
    assert team.oracle.asked[-1].heading == {"robot1": (2.0, 2.0), "robot2": (3.0, 3.0)}
    assert {motion.revision for motion in team.motions} == {0}
    assert sum(isinstance(record, Ordered) for record in team.records) == 1


def test_nothing_is_released_while_a_revision_is_planned(team: Team) -> None:
    team.planning_takes_s = 0.35
    relays = [(2.0, 2.0), (4.0, 4.0), (2.0, 4.0), (4.0, 2.0)]
    for relay in relays:
        team.oracle.answer = plan(relay=relay)
        team.go_on(1.0)
    for before, after in pairwise(team.motions):
        assert after.revision == before.revision or after.released == before.released


def test_one_job_at_a_time_however_long_it_takes(team: Team) -> None:
    team.planning_takes_s = 0.35
    for step in range(20):
        team.goal = (9.0, 1.0 + 0.1 * step)
        team.go_on(0.1)
    assert len(team.oracle.asked) <= 7


def test_a_failed_plan_is_logged_and_the_last_deployment_stands(team: Team) -> None:
    team.go_on(1.0)
    team.fails = "ValueError: no"
    team.go_on(2.0)
    assert {line.text for line in team.logs if line.level == "error"} == {
        "planning failed, the last deployment stands: ValueError: no"
    }
    assert team.deployments[-1][0] > 2.0
    assert len(team.decisions) == 1


def test_a_plan_that_does_not_serve_is_said_once(team: Team) -> None:
    team.go_on(1.0)
    team.oracle.answer = plan(serves=False)
    team.go_on(2.0)
    team.oracle.answer = plan()
    team.go_on(1.0)
    assert [line.level for line in team.logs] == ["warning", "info"]


def test_a_plan_without_a_chain_can_be_said(team: Team) -> None:
    team.oracle.answer = replace(plan(edges=(), serves=False), cost=math.inf, total_cost_m=math.inf)
    team.go_on(0.5)
    assert (team.deployments[0][1].total_cost_m, team.deployments[0][1].lower_bound_m) == (None, None)
    envelope = Envelope(sender="base", incarnation=0, sequence=0, sent_at_s=0.0, body=team.deployments[0][1])
    assert decode(encode(envelope)) == envelope


def test_a_decision_carries_its_cost_and_the_bound(team: Team) -> None:
    team.oracle.answer = replace(plan(), total_cost_m=7.5, lower_bound_m=7.0)
    team.go_on(0.5)
    (decision,) = team.decisions
    assert (decision.deployment.total_cost_m, decision.deployment.lower_bound_m) == (7.5, 7.0)


def test_says_where_it_is_and_that_it_lives(team: Team) -> None:
    team.go_on(2.0)
    assert len(team.all_said(State)) == 21
    assert not team.all_said(Heartbeat), "whoever says where it is lives"
    assert sum(isinstance(record, Track) for record in team.records) == 21
    assert {body.position for _, body in team.all_said(State)} == {START}


def test_connectivity_is_true_line_of_sight_between_the_places_heard(team: Team) -> None:
    team.speaking = {"agent": (2.0, 9.0), "robot1": (9.0, 2.0), "robot2": (2.0, 2.0)}
    team.oracle.answer = plan((9.0, 2.0), (2.0, 2.0))
    team.go_on(0.5)
    seen = team.connectivity
    # Everybody sees everybody but agent and robot1: the complete graph less one link has λ2 = n − 2.
    assert len(seen.links) == 5
    assert ((2.0, 9.0), (9.0, 2.0)) not in seen.links
    assert (seen.agent_visible, seen.chain_connected, seen.team_connected) == (True, True, True)
    assert seen.lambda2 == pytest.approx(2.0)
    assert seen.tree_links == ((START, (9.0, 2.0)), ((9.0, 2.0), (2.0, 9.0)))


def test_visible_is_less_than_connected(mission: Mission, corner: Environment) -> None:
    base = structs.replace(mission.roster[0], start=(9.0, 4.0))
    team = Team(structs.replace(mission, roster=(base, *mission.roster[1:])), corner)
    team.driver = type(team.driver)((9.0, 4.0), 0.0)
    team.speaking = {"agent": (2.0, 9.0), "robot1": (4.0, 9.0), "robot2": (3.0, 9.0)}
    team.oracle.answer = plan((4.0, 9.0), (3.0, 9.0))
    team.go_on(0.5)
    seen = team.connectivity
    assert (seen.agent_visible, seen.chain_connected, seen.team_connected) == (True, False, False)
    assert seen.lambda2 == 0.0


def test_without_the_agent_nothing_is_connected(team: Team) -> None:
    team.go_on(0.5)
    team.allegiance.gone.add("agent")
    team.go_on(0.3)
    seen = team.connectivity
    assert (seen.agent_visible, seen.chain_connected, seen.team_connected) == (False, False, False)


def test_nothing_is_said_out_of_office_and_what_was_planned_in_it_is_dropped(team: Team) -> None:
    team.go_on(1.0)
    team.planning_takes_s = 0.35
    team.oracle.answer = plan(relay=(4.0, 4.0))
    team.go_on(0.2)
    assert team.jobs
    team.allegiance.office = None
    said = len(team.all_said(Deployment))
    team.go_on(2.0)
    assert len(team.all_said(Deployment)) == said
    assert len(team.decisions) == 1
    assert not team.jobs


def test_the_next_reign_holds_first_and_goes_on_from_what_was_said_before(team: Team) -> None:
    team.go_on(1.0)
    before = team.deployments[-1][1]
    team.allegiance.office = Reign(epoch=7, leader="base", incarnation=0)
    team.go_on(1.0)
    hold, *_ = [said for _, said in team.all_said(Deployment) if said.authority.epoch == 7]
    assert (hold.motion, hold.placements, hold.edges) == (None, before.placements, before.edges)
    asked = [question for question in team.oracle.asked if question.onset.plan == 0][-1]
    assert asked.previous is not None
    assert asked.previous.placements == before.placements
    motion = team.motions[-1]
    assert (motion.plan, motion.revision) == (0, 0)
    assert {said.decision for _, said in team.all_said(Deployment)[1:]} == {1}
    assert len(team.decisions) == 1, "the same links and places are the same decision"


def test_nothing_is_asked_while_nothing_can_be_proposed_and_at_once_when_it_can(team: Team) -> None:
    team = Team(structs.replace(team.mission, planning_period_s=100.0), team.corner)
    team.tree.collecting = True
    team.go_on(1.0)
    assert not team.oracle.asked
    team.tree.collecting = False
    team.go_on(0.1)
    assert len(team.oracle.asked) == 1


@pytest.mark.parametrize("period_s", [0.05, 0.5, 100.0])
def test_a_tree_that_is_refused_at_once_is_proposed_again_after_longer_and_longer(team: Team, period_s: float) -> None:
    team = Team(structs.replace(team.mission, planning_period_s=period_s), team.corner, Refused())
    team.go_on(12.0)
    times_s = team.tree.proposed_s
    gaps_s = [b - a for a, b in pairwise(times_s)]
    assert 6 <= len(times_s) <= 11
    assert gaps_s[0] < 0.8
    # A long wait is as long as it may be, and until the next plan.
    assert all(gap_s <= LONGEST_S + min(period_s, 1.0) + 0.1 for gap_s in gaps_s)
    assert all(gap_s >= min(REST_S * 2**n, LONGEST_S) - 1e-6 for n, gap_s in enumerate(gaps_s))


def test_another_tree_does_not_wait_for_one_that_was_refused(team: Team) -> None:
    team = Team(team.mission, team.corner, Refused())
    team.go_on(5.0)
    refused = len(team.tree.proposed_s)
    team.oracle.answer = plan(edges=(("base", "robot2"), ("robot2", "agent")))
    team.go_on(0.7)
    assert len(team.tree.proposed_s) > refused
    assert frozenset(("base", "robot2")) in team.tree.last


def test_who_is_heard_late_has_as_long_to_answer_the_order_to_hold(mission: Mission) -> None:
    places = {"robot1": [(1.0, 2.0)], "robot2": [(1.0, 3.0)]}
    dispatcher = Dispatcher("base", START, places, 1, 0.2)
    held = Authority(epoch=1, leader="base", sequence=1)
    dispatcher.said(held, 0.0)
    obeying = State(position=(1.0, 2.0), velocity=(0.0, 0.0), mode="waiting", obeying=held)
    silent = structs.replace(obeying, obeying=None)
    dispatcher.hear("robot1", obeying, 0.1)
    assert dispatcher.deaf(3.0) == ()
    dispatcher.hear("robot2", silent, 3.0)
    assert dispatcher.deaf(3.0) == dispatcher.deaf(3.0 + PATIENCE_S) == ()
    dispatcher.hear("robot2", silent, 4.0)
    assert dispatcher.deaf(3.1 + PATIENCE_S) == ("robot2",)
    dispatcher.lose("robot2")
    dispatcher.hear("robot2", silent, 6.0)
    assert dispatcher.deaf(6.1) == ()


def test_a_robot_that_does_not_answer_the_order_to_hold_is_done_without(team: Team) -> None:
    team.go_on(1.0)
    team.mute = {"robot2"}
    team.allegiance.office = Reign(epoch=7, leader="base", incarnation=0)
    team.go_on(PATIENCE_S + 0.5)
    assert "robot2 does not answer: the team goes on without it" in [line.text for line in team.logs]
    assert set(team.oracle.asked[-1].onset.places) == {"base", "robot1"}
    team.mute = set()
    team.go_on(1.0)
    assert set(team.oracle.asked[-1].onset.places) == {"base", "robot1", "robot2"}


def test_orders_that_the_leader_itself_may_not_take_are_not_said(team: Team) -> None:
    team.go_on(1.0)
    said = len(team.all_said(Deployment))
    team.allegiance.take = lambda *_: "stale"  # type: ignore[method-assign]
    team.go_on(1.0)
    assert len(team.all_said(Deployment)) == said
