"""Robots go back together, within two stages that follow each other, or they stand: whatever becomes of messages."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import accumulate, pairwise
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agents import retreat as going_back
from agents.motion_message import to_motion
from agents.path_follower import ASTRAY_M, STANDING, Leg
from agents.retreat import Retreat
from agents.stage_follower import StageFollower
from planning import Environment, certify
from planning.connectivity import connected
from planning.motion import plan_motion
from protocol.messages import Motion, Point, Progress
from tests.agents.test_stage_follower import EPOCH, Lengths, follower, lengths, motion, name, said

SILENCE_S = 1.0
BASE = ("base",)


def back(stage: int, *, plan: int = 0, epoch: int = EPOCH, finished: int = 9) -> Progress:
    return Progress(epoch=epoch, plan=plan, revision=0, finished=finished, retreat=stage)


@dataclass
class Orphans:
    """Robots in the middle of a motion whose leader is gone; what they say is lost, doubled, and overtaken.

    Each turns back when it pleases. Time goes on by itself.
    """

    order: Motion
    chance: Random
    loss: float = 0.2
    now_s: float = 0.0
    cut: set[str] = field(default_factory=set)
    """Robots that nobody hears."""
    robots: dict[str, StageFollower] = field(default_factory=dict)
    places: dict[str, Point] = field(default_factory=dict)
    on_the_way: list[tuple[str, str, Progress | None]] = field(default_factory=list)
    """Receiver, sender, and what is said."""

    def __post_init__(self) -> None:
        for way in self.order.ways:
            if way.scheduled and way.member != "base":
                mine = StageFollower(way.member, 1.0)
                mine.halt()
                assert mine.object_to(EPOCH, self.order, way.waypoints[0]) == ""
                mine.accept(EPOCH, self.order)
                self.robots[way.member] = mine
                self.places[way.member] = way.waypoints[0]

    def tell(self, robot: str) -> None:
        if robot in self.cut:
            return
        for other in self.robots:
            for _ in range(self.chance.choice([1, 1, 2])):
                if other != robot and self.chance.random() >= self.loss:
                    self.on_the_way.append((other, robot, self.robots[robot].progress))

    def deliver(self) -> None:
        if self.on_the_way:
            receiver, sender, progress = self.on_the_way.pop(self.chance.randrange(len(self.on_the_way)))
            mine = self.robots[receiver]
            if mine.retreat is not None:
                mine.retreat.hear(sender, progress, self.now_s)
            if progress is not None:
                mine.hear(sender, progress)

    def leg(self, robot: str) -> Leg:
        mine, place = self.robots[robot], self.places[robot]
        return mine.steer(place) if mine.retreat is None else mine.retreat.steer(place, self.now_s)

    def drive(self, robot: str, for_s: float) -> None:
        leg, (x, y) = self.leg(robot), self.places[robot]
        lasts_s = min(for_s, leg.lasts_s)
        self.places[robot] = (x + leg.velocity[0] * lasts_s, y + leg.velocity[1] * lasts_s)

    def turn(self, robot: str) -> None:
        self.robots[robot].turn_back(BASE, self.places[robot], SILENCE_S)

    def live(self, turning: bool) -> None:
        """One thing happens."""
        robot = self.chance.choice(list(self.robots))
        match self.chance.choices(range(4), [4, 8, 4, turning])[0]:
            case 0:
                self.tell(robot)
            case 1:
                self.deliver()
            case 2:
                self.drive(robot, self.chance.choice([0.125, 0.3, 0.75]))
            case 3:
                self.turn(robot)
        self.now_s += 0.002

    def talk(self) -> None:
        """All say all to all at once, but those who are cut off."""
        self.loss = 0.0
        for robot in self.robots:
            self.tell(robot)
        while self.on_the_way:
            self.deliver()
        self.now_s += 0.1


def on_rows(rows: Lengths, chance: Random) -> Orphans:
    order = motion(rows, released=chance.randrange(-1, len(rows[0])))
    return Orphans(order, chance)


def check_rows(team: Orphans, rows: Lengths) -> None:
    """All are in two successive stages: by places alone."""
    ends = [list(accumulate(row, initial=0)) for row in rows]
    places = [team.places[name(robot)][0] for robot in range(len(rows))]
    assert any(
        all(
            own[stage] - 1e-6 <= place <= own[min(stage + 2, len(own) - 1)] + 1e-6
            for place, own in zip(places, ends, strict=True)
        )
        for stage in range(len(ends[0]))
    ), (places, ends)


@given(lengths, st.integers(0, 2**32))
def test_all_are_within_two_stages_whenever_each_of_them_turns(rows: Lengths, seed: int) -> None:
    team = on_rows(rows, Random(seed))
    for _ in range(Random(seed).randrange(200)):
        team.live(turning=False)
    for _ in range(150):
        team.live(turning=True)
        check_rows(team, rows)
    for robot in team.robots:
        team.turn(robot)
    for _ in range(200):  # from here on they talk, and go back to where they have begun
        if all(mine.retreat is not None and mine.retreat.stage == 0 for mine in team.robots.values()):
            break
        team.talk()
        for robot in team.robots:
            team.drive(robot, 0.7)
            check_rows(team, rows)
    else:
        raise AssertionError([mine.retreat and mine.retreat.stage for mine in team.robots.values()])
    assert max(place[0] for place in team.places.values()) < 1e-6
    assert all(team.leg(robot) == STANDING for robot in team.robots)


class Forward(Retreat):
    """Does not ask whether others still go forward."""

    def missing(self, now_s: float) -> tuple[str, ...]:
        return tuple(name for name in super().missing(now_s) if name in self._left)


class Ahead(Retreat):
    """Goes back a stage before its turn."""

    def _may_enter(self, stage: int, now_s: float) -> bool:
        return super()._may_enter(stage + 1, now_s)


@pytest.mark.parametrize("mutant", [Forward, Ahead])
def test_a_retreat_that_lacks_a_rule_is_found_out(mutant: type[Retreat], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("agents.stage_follower.Retreat", mutant)
    rows = [[1, 1, 2, 1, 1], [2, 1, 1, 1, 0], [0, 1, 1, 2, 1]]

    def find() -> None:
        for seed in range(300):
            team = on_rows(rows, Random(seed))
            for step in range(400):
                team.live(turning=step > 150)
                check_rows(team, rows)

    with pytest.raises(AssertionError):
        find()


@given(lengths, st.integers(0, 2**32))
@settings(max_examples=50)
def test_without_one_of_them_all_stand(rows: Lengths, seed: int) -> None:
    """Whether it is silent, has turned and falls silent, has another plan, or has none."""
    chance = Random(seed)
    team = on_rows(rows, chance)
    for _ in range(chance.randrange(150)):
        team.live(turning=False)
    lost = chance.choice(list(team.robots))
    what = chance.choice(["deaf", "silent", "halted"])
    for robot in team.robots:
        if robot != lost or what != "deaf":
            team.turn(robot)
    for _ in range(chance.randrange(3)):
        team.talk()
    if what == "silent":
        team.cut.add(lost)
        team.now_s += 1.01 * SILENCE_S
        team.on_the_way.clear()
    elif what == "halted":
        team.robots[lost].halt()
    stand = dict(team.places)
    for _ in range(5):
        team.talk()
        for robot in team.robots:
            if robot != lost:
                team.drive(robot, 0.5)
    assert all(team.places[robot] == stand[robot] for robot in team.robots if robot != lost)
    others = [mine.retreat for robot, mine in team.robots.items() if robot != lost]
    assert all(other is not None and lost in other.missing(team.now_s) for other in others)


@given(lengths, st.integers(0, 2**32))
@settings(max_examples=50)
def test_who_is_led_again_stands_and_begins_afresh(rows: Lengths, seed: int) -> None:
    chance = Random(seed)
    team = on_rows(rows, chance)
    for _ in range(chance.randrange(150)):
        team.live(turning=False)
    for robot in team.robots:
        team.turn(robot)
    for _ in range(chance.randrange(8)):
        team.talk()
        for robot in team.robots:
            team.drive(robot, 0.3)
    later = motion(rows, plan=1, released=len(rows[0]) - 1)
    for robot, mine in team.robots.items():
        assert "turned back" in mine.object_to(EPOCH, team.order, team.places[robot])
        assert not mine.has(EPOCH, team.order) and mine.steer(team.places[robot]) == STANDING
        mine.halt()
        assert mine.progress is None and mine.retreat is None
        objection = mine.object_to(EPOCH, later, team.places[robot])
        assert (objection == "") == (team.places[robot][0] <= ASTRAY_M), objection
        if not objection:
            mine.accept(EPOCH, later)
            assert mine.progress == said(0, plan=1)


def pillars() -> Environment:
    """A room with two pillars; who goes past one of them is out of somebody's sight."""
    blocks = [[(3, 2), (4, 2), (4, 4), (3, 4)], [(8, 2), (9, 2), (9, 4), (8, 4)]]
    return Environment([(0, 0), (12, 0), (12, 6), (0, 6)], blocks)


def check_ground(team: Orphans, room: Environment, radius_m: float) -> None:
    """Discs are apart, and base station and robots are one network: by distances and lines of sight alone."""
    bodies = np.array(list(team.places.values()))
    gaps_m = np.hypot(*(bodies[:, None] - bodies).transpose(2, 0, 1))[np.triu_indices(len(bodies), 1)]
    assert gaps_m.min() >= 2 * radius_m - 1e-6
    base = next(way.waypoints[0] for way in team.order.ways if way.member == "base")
    assert connected(room.visibility_matrix(np.vstack([base, bodies])))


@pytest.fixture(scope="module")
def moving_on() -> tuple[Environment, Motion]:
    """A chain of three goes from one side of the pillars to the other; the base station stays."""
    room = pillars()
    starts = [(1.0, 3.0), (2.0, 1.0), (2.0, 5.0), (2.0, 3.0)]
    goals = [(1.0, 3.0), (2.5, 1.2), (7.0, 1.0), (11.0, 2.0)]
    names = ["base", "robot0", "robot1", "robot2"]
    found = plan_motion(room, starts, goals, [0.0, 0.2, 0.2, 0.2], members=names, joined=names)
    assert found.arrives, found.reason
    assert certify(found.schedule, room, ends=names).valid
    order = to_motion(
        found.schedule, plan=0, revision=0, first_stage=0, released=found.schedule.stage_count - 1, connection="none"
    )
    return room, order


@given(seed=st.integers(0, 2**32))
@settings(max_examples=25)
def test_discs_are_apart_and_the_network_holds_at_every_instant(
    moving_on: tuple[Environment, Motion], seed: int
) -> None:
    room, order = moving_on
    team = Orphans(order, Random(seed))
    for _ in range(team.chance.randrange(900)):
        team.live(turning=False)
    for step in range(500):
        team.live(turning=True)
        if step % 5 == 0:
            check_ground(team, room, 0.2)


def retreat(*others: str, stage: int = 2, pieces: Iterable[Iterable[Point]] = (((2.0, 0.0), (1.0, 0.0)),)) -> Retreat:
    return Retreat(
        (EPOCH, 0), others, stage=stage, pieces=[tuple(piece) for piece in pieces], position=(2.0, 0.0),
        speed_m_s=1.0, silence_s=SILENCE_S,
    )  # fmt: skip


def test_alone_it_stands() -> None:
    mine = retreat()
    assert mine.others == ()
    assert mine.steer((2.0, 0.0), 0.0) == STANDING


def test_nobody_moves_before_all_have_turned_and_nobody_passes_who_is_farther() -> None:
    mine = retreat("robot1", "robot2")
    assert mine.missing(0.0) == ("robot1", "robot2")
    mine.hear("robot1", back(4), 0.0)
    mine.hear("robot2", said(3), 0.0)
    assert mine.missing(0.0) == ("robot2",)
    assert mine.steer((2.0, 0.0), 0.0) == STANDING
    mine.hear("robot2", back(3), 0.1)
    assert mine.missing(0.1) == ()
    assert mine.steer((2.0, 0.0), 0.1) == STANDING  # robot1 has stage 3 to go back through
    mine.hear("robot1", back(3), 0.2)
    assert mine.steer((2.0, 0.0), 0.2) == Leg((-1.0, 0.0), 1.0)
    mine.hear("robot1", back(4), 0.3)  # overtaken
    assert mine.steer((1.5, 0.0), 0.3) == Leg((-1.0, 0.0), 0.5)
    assert mine.steer((1.0, 0.0), 0.4) == STANDING
    assert (mine.stage, mine.ahead) == (1, ())


def test_who_is_silent_comes_back_and_who_has_left_does_not() -> None:
    mine = retreat("robot1")
    mine.hear("robot1", back(2), 0.0)
    assert mine.steer((2.0, 0.0), SILENCE_S) != STANDING
    assert mine.steer((2.0, 0.0), 1.01 * SILENCE_S) == STANDING
    mine.hear("robot1", back(2), 1.5)
    assert mine.steer((2.0, 0.0), 1.5) != STANDING
    mine.hear("robot1", back(0, plan=-1), 1.6)  # of a plan before: says nothing
    mine.hear("robot9", None, 1.6)  # no member
    assert mine.steer((2.0, 0.0), 1.6) != STANDING
    mine.hear("robot1", said(0, plan=1), 1.7)
    mine.hear("robot1", back(2), 1.8)  # overtaken
    assert mine.steer((2.0, 0.0), 1.8) == STANDING
    assert mine.missing(1.8) == ("robot1",)


def test_off_its_way_it_stands() -> None:
    mine = retreat("robot1")
    mine.hear("robot1", back(2), 0.0)
    assert mine.steer((2.0, 0.0), 0.0) != STANDING
    assert mine.steer((1.5, 0.9 * ASTRAY_M), 0.0) != STANDING
    assert mine.steer((1.5, 1.1 * ASTRAY_M), 0.0) == STANDING
    astray = follower(motion([[2], [0]], released=0))
    astray.steer((1.0, 0.0))
    astray.turn_back(BASE, (1.0, 0.5), SILENCE_S)
    assert astray.retreat is None


def test_it_turns_in_the_middle_of_a_stage_and_says_how_far_it_is() -> None:
    mine = follower(motion([[1, 2, 1], [1, 1, 1]], released=2))
    mine.hear("robot1", said(2))
    mine.steer((1.0, 0.0))
    mine.steer((2.5, 0.0))
    mine.turn_back(BASE, (2.5, 0.0), SILENCE_S)
    assert mine.progress == Progress(epoch=EPOCH, plan=0, revision=0, finished=1, retreat=2)
    assert mine.remaining((2.5, 0.0)) == ((2.5, 0.0), (1.0, 0.0), (0.0, 0.0))
    assert (mine.target, mine.arrived, mine.waits_for()) == ((0.0, 0.0), False, ())
    assert mine.retreat is not None
    mine.retreat.hear("robot1", back(3), 0.0)
    assert mine.retreat.steer((2.5, 0.0), 0.0) == Leg((-1.0, 0.0), 1.5)


def test_it_remembers_no_more_than_so_many_stages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("agents.stage_follower.MEMORY", 3)
    assert going_back.MEMORY > 100
    mine = follower(motion([[1] * 6, [0] * 6], released=5))
    for place in range(7):
        mine.steer((float(place), 0.0))
    mine.turn_back(BASE, (6.0, 0.0), SILENCE_S)
    assert mine.retreat is not None
    ahead = mine.retreat.ahead
    assert (ahead[0], ahead[-1], len(ahead)) == ((6.0, 0.0), (3.0, 0.0), 4)
    assert all(a > b for a, b in pairwise(ahead))
