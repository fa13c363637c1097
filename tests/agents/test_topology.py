"""The tree as a part of minds: links are judged when the motion they are about is accepted, and what comes of it."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec import structs

from agents.collection import Collection
from agents.mission import Mission
from agents.orders import first_orders
from agents.records import LogLine, TopologyChange
from agents.role import Compute, Heard, JobDone, Publish, Record, Woken
from agents.standing_orders import StandingOrders
from agents.topology import FORESEEING, JUDGING, TeamTree
from planning.environment import Environment
from protocol.keys import Address
from protocol.membership import Presence
from protocol.messages import (
    AnyBody,
    Authority,
    Confirmation,
    Deployment,
    Edge,
    Envelope,
    Intent,
    MemberWay,
    Motion,
    Point,
    Progress,
    Reign,
    State,
    Topology,
    Tree,
    Warrant,
)
from protocol.negotiation import ROUND_S, ROUNDS
from tests.agents.conftest import make_mission
from tests.agents.sworn import Sworn

EPOCH = 3
WARRANT = Warrant(lease_s=1.0, marks=())
CORNER = Environment([(0, 0), (10, 0), (10, 5), (5, 5), (5, 10), (0, 10)], name="corner")
FAR: tuple[Edge, ...] = (("base", "robot1"), ("robot1", "agent"))
NEAR: tuple[Edge, ...] = (("base", "agent"),)


class PerKind(Sworn):
    """Orders of one kind replace each other, as they do in earnest."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._orders: dict[str, tuple[int, int]] = {}

    def take(
        self, kind: str, authority: Authority, sender: str, incarnation: int, warrant: Warrant, now_s: float
    ) -> str:
        self._order = self._orders.get(kind, (-1, -1))
        refusal = super().take(kind, authority, sender, incarnation, warrant, now_s)
        self._orders[kind] = self._order
        return refusal


class Body:
    """A robot that accepts what it is told to."""

    def __init__(self, place: Point) -> None:
        self.state = State(position=place, velocity=(0.0, 0.0), mode="waiting")

    def accept(self, motion: Motion) -> None:
        progress = Progress(epoch=EPOCH, plan=motion.plan, revision=motion.revision, finished=0)
        self.state = structs.replace(self.state, progress=progress)


class Team:
    """Base station and a robot, whose messages arrive at once unless they are cut; jobs are done at once."""

    def __init__(self, agent: Point, robot: Point = (1.0, 2.0)) -> None:
        mission: Mission = make_mission()
        entries = [entry for entry in mission.roster if entry.name != "robot2"]
        mission = structs.replace(mission, roster=tuple(entries))
        self.body = Body(robot)
        self.deaf: set[str] = set()
        self.fails: set[str] = set()
        """Jobs that do."""
        self.jobs: list[str] = []
        self.changes: list[TopologyChange] = []
        self.logs: list[str] = []
        self.words: list[Topology] = []
        self.allegiances = {name: PerKind(name) for name in ("base", "robot1")}
        self.orders = {name: StandingOrders(known) for name, known in self.allegiances.items()}
        self.others = {name: Collection(known, "agent") for name, known in self.allegiances.items()}
        self.parts = {
            name: TeamTree(
                mission, CORNER, self.allegiances[name], self.orders[name], self.others[name],
                self.body if name == "robot1" else None,
            )
            for name in self.allegiances
        }  # fmt: skip
        self.allegiances["base"].office = Reign(epoch=EPOCH, leader="base", incarnation=0)
        intent = Intent(position=agent, velocity=(0.0, 0.0), mode="waiting")
        for name in self.parts:
            self.others[name].handle(heard("agent", intent), 0.0)
        self.others["base"].handle(heard("robot1", self.body.state), 0.0)
        self.pass_time(0.0, 0.1)

    @property
    def leader(self) -> TeamTree:
        return self.parts["base"]

    def links(self, name: str) -> tuple[Edge, ...]:
        """That a peer keeps."""
        return self.parts[name].held.links

    def order(self, motion: Motion | None, now_s: float) -> None:
        authority = Authority(epoch=EPOCH, leader="base", sequence=int(1000 * now_s) + 1)
        orders: Deployment = structs.replace(first_orders("base"), authority=authority, warrant=WARRANT, motion=motion)
        assert not self.orders["base"].give(orders, now_s)
        self.carry_out("base", self.leader.look(now_s), now_s)
        self.carry_out("base", [Publish(orders)], now_s)

    def pass_time(self, start_s: float, end_s: float) -> None:
        for step in range(round((end_s - start_s) / 0.05)):
            for name, part in self.parts.items():
                now_s = start_s + 0.05 * (step + 1)
                self.carry_out(name, part.handle(Woken((0.0, 0.0)), now_s), now_s)

    def carry_out(self, name: str, effects: Any, now_s: float) -> None:
        for effect in list(effects):
            match effect:
                case Publish(body):
                    if isinstance(body, Topology):
                        self.words.append(body)
                    for other, part in self.parts.items():
                        if other != name and not self.deaf & {other, name}:
                            event = heard(name, body)
                            self.orders[other].handle(event, now_s)
                            self.carry_out(other, part.handle(event, now_s), now_s)
                case Record(TopologyChange() as change):
                    self.changes.append(change)
                case Record(LogLine(text=text)):
                    self.logs.append(text)
                case Compute(job=job, function=function, arguments=arguments):
                    self.jobs.append(job)
                    assert len(self.jobs) < 1000, "jobs without end"
                    done = JobDone(job, function(*arguments), 0.01)
                    if job in self.fails:
                        done = JobDone(job, None, 0.01, "ValueError: no")
                    self.carry_out(name, self.parts[name].handle(done, now_s), now_s)


def heard(sender: str, body: AnyBody) -> Heard:
    envelope = Envelope(sender=sender, incarnation=0, sequence=0, sent_at_s=0.0, body=body)
    return Heard(Address("team", sender, str(body.__struct_config__.tag)), envelope)


def motion(*stops: Point) -> Motion:
    """The robot goes from stop to stop, one a stage; the base station stands."""
    stages = len(stops) - 1
    return Motion(
        plan=0, revision=0, first_stage=0, released=-1, connection="none",
        ways=(
            MemberWay(member="base", radius_m=0.0, speed_m_s=0.0, waypoints=((1.0, 1.0),), stages=(0,) * (stages + 1)),
            MemberWay(member="robot1", radius_m=0.2, speed_m_s=1.0, waypoints=stops, stages=tuple(range(stages + 1))),
        ),
    )  # fmt: skip


NO_TREE = Topology(
    authority=Authority(epoch=EPOCH, leader="base", sequence=1),
    warrant=WARRANT,
    committed=Tree(number=(EPOCH, 1), members=("base", "agent"), edges=(), reason=""),
)
TO_THE_CORNER = motion((1.0, 2.0), (2.0, 3.0), (4.5, 4.5))


def test_a_tree_is_in_force_when_the_robot_has_accepted_the_motion_to_it_and_not_before() -> None:
    team = Team(agent=(9.0, 4.0))
    assert team.leader.may_propose(0.2, urgent=False) and not team.leader.is_in_force(FAR)
    team.carry_out("base", team.leader.propose(FAR, TO_THE_CORNER, "optimum", "it is far", 0.2), 0.2)
    team.order(TO_THE_CORNER, 0.25)
    team.pass_time(0.3, 1.3)
    assert (team.leader.busy, team.leader.is_in_force(FAR), team.links("robot1")) == (True, False, ())
    team.body.accept(TO_THE_CORNER)
    team.pass_time(1.3, 1.4)
    assert team.leader.is_in_force(FAR) and not team.leader.busy
    assert team.links("robot1") == team.links("base") == FAR
    (change,) = team.changes
    assert change.committed and change.number == (EPOCH, 0) and change.new == FAR and change.released == ()
    assert change.reason == "it is far" and change.rounds > 3
    assert team.leader.is_in_force(tuple(reversed(FAR)))


def test_the_next_tree_asks_about_new_links_only_and_keeps_the_old_ones_until_it_is_in_force() -> None:
    team = Team(agent=(2.0, 1.0))
    team.carry_out("base", team.leader.propose(NEAR, None, "optimum", "it is near", 0.2), 0.2)
    team.order(None, 0.2)
    team.pass_time(0.2, 0.3)
    assert team.leader.is_in_force(NEAR)
    assert not team.leader.may_propose(0.4, urgent=False) and team.leader.may_propose(0.4, urgent=True)
    team.carry_out("base", team.leader.propose(FAR, TO_THE_CORNER, "auction", "it goes", 0.4), 0.4)
    team.order(TO_THE_CORNER, 0.4)
    assert team.links("robot1") == NEAR
    team.body.accept(TO_THE_CORNER)
    team.pass_time(0.4, 0.6)
    first, second = team.changes
    assert (first.number, second.number) == ((EPOCH, 0), (EPOCH, 1))
    assert second.before == NEAR and second.released == NEAR and second.new == FAR and second.method == "auction"


def test_who_is_not_heard_is_named_when_a_proposal_is_given_up() -> None:
    team = Team(agent=(9.0, 4.0))
    team.deaf = {"robot1"}
    team.body.accept(TO_THE_CORNER)
    team.carry_out("base", team.leader.propose(FAR, TO_THE_CORNER, "optimum", "it is far", 0.2), 0.2)
    team.order(TO_THE_CORNER, 0.2)
    team.pass_time(0.2, 0.2 + ROUNDS * ROUND_S + 0.1)
    (change,) = team.changes
    assert not change.committed and change.reason == f"no answer in {ROUNDS} rounds from robot1"
    assert not team.leader.busy and team.links("base") == ()


def test_links_whose_ends_will_not_see_each_other_are_not_even_proposed() -> None:
    team = Team(agent=(9.0, 4.0))
    away = motion((1.0, 2.0), (1.0, 9.0))
    team.carry_out("base", team.leader.propose(FAR, away, "optimum", "it is far", 0.2), 0.2)
    assert not team.leader.busy and not team.changes
    assert any("does not propose the links robot1\N{EN DASH}agent" in text for text in team.logs)


def test_a_robot_refuses_what_the_leader_claims_and_is_not_so() -> None:
    team = Team(agent=(9.0, 4.0))
    away = motion((1.0, 2.0), (1.0, 9.0))
    # The leader believes in one motion, and orders another one under its number.
    team.carry_out("base", team.leader.propose(FAR, TO_THE_CORNER, "optimum", "it is far", 0.2), 0.2)
    team.body.accept(away)
    team.order(away, 0.2)
    team.pass_time(0.2, 0.4)
    (change,) = team.changes
    assert not change.committed
    assert "refuses the link with" in change.reason and "robot1" in change.reason


def test_links_that_cannot_be_judged_are_refused_and_not_judged_again() -> None:
    team = Team(agent=(9.0, 4.0))
    team.fails = {JUDGING}
    team.body.accept(TO_THE_CORNER)
    for now_s in (0.2, 0.6):
        team.carry_out("base", team.leader.propose(FAR, TO_THE_CORNER, "optimum", "it is far", now_s), now_s)
        team.order(TO_THE_CORNER, now_s)
        team.pass_time(now_s, now_s + 0.3)
    assert [change.committed for change in team.changes] == [False, False]
    assert "could not judge it: ValueError: no" in team.changes[0].reason
    assert team.jobs.count(JUDGING) <= 4, "each end judges each proposal once"
    said = [text for text in team.logs if "could not be judged" in text]
    assert 1 <= len(said) <= 2, "each end says it once"
    team.fails.clear()
    team.carry_out("base", team.leader.propose(FAR, TO_THE_CORNER, "optimum", "it is far", 1.0), 1.0)
    team.order(TO_THE_CORNER, 1.0)
    team.pass_time(1.0, 1.3)
    assert team.leader.is_in_force(FAR)


def test_why_a_tree_is_not_proposed_is_said_once() -> None:
    team = Team(agent=(9.0, 4.0))
    team.fails = {FORESEEING}
    for now_s in (0.2, 0.3, 0.4):
        team.carry_out("base", team.leader.propose(FAR, None, "optimum", "it is far", now_s), now_s)
        assert not team.leader.busy
    assert [text for text in team.logs if "does not propose" in text] == [
        "does not propose the links base\N{EN DASH}robot1, robot1\N{EN DASH}agent: ValueError: no"
    ]


def test_the_leader_is_woken_when_it_has_collected_what_was_in_force() -> None:
    team = Team(agent=(2.0, 1.0))
    part, robot = team.leader, team.allegiances["robot1"]
    team.deaf = {"robot1"}
    team.allegiances["base"].office = Reign(epoch=EPOCH + 1, leader="base", incarnation=0)
    team.carry_out("base", part.handle(Woken((0.0, 0.0)), 1.0), 1.0)
    assert robot.presence("robot1") is Presence.PRESENT
    assert (part.collecting, part.next_s > 0.0) == (True, True)
    team.carry_out("base", part.handle(heard("robot1", Confirmation()), 1.1), 1.1)
    assert (part.collecting, part.next_s > 0.0) == (False, False), "else nobody asks before the next plan is due"
    assert part.may_propose(1.1, urgent=False)


def test_words_that_are_not_in_force_are_not_heard() -> None:
    team = Team(agent=(2.0, 1.0))
    team.carry_out("base", team.leader.propose(NEAR, None, "optimum", "it is near", 0.2), 0.2)
    team.order(None, 0.2)
    team.pass_time(0.2, 0.3)
    robot, late = team.parts["robot1"], team.words[0]
    assert late.committed is None and team.links("robot1") == NEAR
    robot.handle(heard("base", late), 0.4)
    assert team.links("robot1") == NEAR and robot.held.proposal is None


def test_a_tree_that_is_none_is_not_taken_and_that_is_said_once() -> None:
    team = Team(agent=(2.0, 1.0))
    robot = team.parts["robot1"]
    for sequence in (900, 901):
        authority = Authority(epoch=EPOCH, leader="base", sequence=sequence)
        fault = structs.replace(NO_TREE, authority=authority)
        team.carry_out("robot1", robot.handle(heard("base", fault), 0.4), 0.4)
    assert team.links("robot1") == ()
    assert [text for text in team.logs if "does not take" in text] == [
        "does not take the word of base: tree 1 of epoch 3 is none: agent is not joined to base"
    ]


@pytest.mark.parametrize("there", [True, False])
def test_the_base_stations_end_is_asked_if_it_is_there(there: bool) -> None:
    team = Team(agent=(9.0, 4.0))
    robot, base = team.allegiances["robot1"], team.allegiances["base"]
    base.office, robot.office = None, Reign(epoch=EPOCH + 1, leader="robot1", incarnation=0)
    if not there:
        team.deaf = {"base"}
        robot.gone = {"base"}
    team.pass_time(0.1, 1.0)
    assert robot.presence("base") is (Presence.PRESENT if there else Presence.GONE)
    part = team.parts["robot1"]
    team.carry_out("robot1", part.propose((("base", "robot1"),), None, "optimum", "x", 1.0), 1.0)
    authority = Authority(epoch=EPOCH + 1, leader="robot1", sequence=1)
    orders = structs.replace(first_orders("robot1"), authority=authority, warrant=WARRANT)
    assert not team.orders["robot1"].give(orders, 1.0)
    team.carry_out("robot1", [*part.look(1.0), Publish(orders)], 1.0)
    team.pass_time(1.0, 1.2)
    assert part.is_in_force((("base", "robot1"),))


def test_a_tree_serves_while_its_members_are_there_and_it_reaches_the_agent() -> None:
    team = Team(agent=(9.0, 4.0))
    assert not team.leader.serves({"base": (1.0, 1.0)}, 0.2)
    team.body.accept(TO_THE_CORNER)
    team.carry_out("base", team.leader.propose(FAR, TO_THE_CORNER, "optimum", "it is far", 0.2), 0.2)
    team.order(TO_THE_CORNER, 0.2)
    team.pass_time(0.2, 0.3)
    assert team.leader.is_in_force(FAR)
    places = {"base": (1.0, 1.0), "robot1": (4.5, 4.5)}
    assert team.leader.serves(places, 0.4)
    assert not team.leader.serves({"base": (1.0, 1.0)}, 0.4)
    assert not team.leader.serves({**places, "robot1": (1.0, 9.0)}, 0.4)


def test_the_answer_says_which_tree_is_in_force() -> None:
    team = Team(agent=(2.0, 1.0))
    team.carry_out("base", team.leader.propose(NEAR, None, "optimum", "it is near", 0.2), 0.2)
    team.order(None, 0.2)
    answers = [
        effect.body
        for effect in team.parts["robot1"].handle(Woken((0.0, 0.0)), 5.0)
        if isinstance(effect, Publish) and isinstance(effect.body, Confirmation)
    ]
    assert answers and answers[0].committed is not None and answers[0].committed.edges == NEAR
