"""Followers keep the rule of progress by themselves, whatever becomes of their messages, and lose no time by it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import accumulate, pairwise
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from agents.motion_message import to_schedule
from agents.path_follower import STANDING, Leg
from agents.stage_follower import ASTRAY_M, StageFollower
from protocol.messages import MemberWay, Motion, Point, Progress

EPOCH = 5
Lengths = list[list[int]]
"""Of each robot, metres that it goes in each stage: to the right, on a row of its own."""


def name(robot: int) -> str:
    return f"robot{robot}"


def motion(lengths: Lengths, *, plan: int = 0, revision: int = 0, first_stage: int = 0, released: int = -1) -> Motion:
    """Of the base station (at y = -1) and robots on rows of their own (y = 0, 1, …), from ``first_stage`` on."""
    stages = len(lengths[0])
    still = (0,) * (stages + 1 - first_stage)
    ways = [MemberWay(member="base", radius_m=0.2, speed_m_s=0.0, waypoints=((0.0, -1.0),), stages=still)]
    for robot, row in enumerate(lengths):
        ends = [float(x) for x in accumulate(row, initial=0)][first_stage:]
        marks = [0]
        for before, end in pairwise(ends):
            marks.append(marks[-1] + (end > before))
        ways.append(
            MemberWay(
                member=name(robot), radius_m=0.2, speed_m_s=1.0, stages=tuple(marks),
                waypoints=tuple((x, float(robot)) for x in dict.fromkeys(ends)),
            )
        )  # fmt: skip
    return Motion(
        plan=plan, revision=revision, first_stage=first_stage, released=released, ways=tuple(ways), connection="none"
    )


def follower(first: Motion | None = None, robot: int = 0, position: Point = (0.0, 0.0)) -> StageFollower:
    """One that has been told to hold, and then a motion."""
    made = StageFollower(name(robot), 1.0)
    made.halt()
    if first is not None:
        assert made.object_to(EPOCH, first, position) == ""
        made.accept(EPOCH, first)
    return made


def said(finished: int, *, plan: int = 0, epoch: int = EPOCH) -> Progress:
    return Progress(epoch=epoch, plan=plan, revision=0, finished=finished)


def end(leg: Leg, position: Point) -> Point:
    return position[0] + leg.velocity[0] * leg.lasts_s, position[1] + leg.velocity[1] * leg.lasts_s


@dataclass
class Team:
    """A leader and robots whose messages are lost, doubled and overtaken, and who stand still now and then."""

    lengths: Lengths
    chance: Random
    plan: int = 0
    revision: int = 0
    released: int = -1
    sequence: int = 0
    places: list[float] = field(default_factory=list)
    followers: list[StageFollower] = field(default_factory=list)
    on_the_way: list[tuple[int, int, Motion | Progress]] = field(default_factory=list)
    """Receiver (-1: the leader), sender or sequence, and what is said."""
    heard: list[int] = field(default_factory=list)
    """How far the leader knows each robot to be."""
    latest: list[int] = field(default_factory=list)
    """Sequence of the latest command that each robot has heard."""

    def __post_init__(self) -> None:
        count = len(self.lengths)
        self.places, self.heard, self.latest = [0.0] * count, [0] * count, [-1] * count
        self.followers = [follower(robot=robot) for robot in range(count)]

    def lead(self) -> None:
        """Release more, or plan other stages behind what has been released; say it."""
        if self.chance.random() < 0.5 and self.released + 1 < len(self.lengths[0]):
            self.released += 1
        elif self.chance.random() < 0.2:
            self.revision += 1
            stages = self.chance.randint(1, 4)
            for row in self.lengths:
                row[self.released + 1 :] = [self.chance.choice([0, 0, 1, 2]) for _ in range(stages)]
        self.command()

    def command(self) -> None:
        self.sequence += 1
        first = min(*self.heard, len(self.lengths[0]) - 1)
        said = motion(self.lengths, plan=self.plan, revision=self.revision, first_stage=first, released=self.released)
        for robot in range(len(self.lengths)):
            self.send(robot, self.sequence, said)

    def send(self, receiver: int, sender: int, said: Motion | Progress) -> None:
        for _ in range(self.chance.choice([0, 1, 1, 2])):
            self.on_the_way.append((receiver, sender, said))

    def tell(self, robot: int) -> None:
        progress = self.followers[robot].progress
        if progress is not None:
            for other in range(-1, len(self.lengths)):
                if other != robot:
                    self.send(other, robot, progress)

    def deliver(self) -> None:
        if not self.on_the_way:
            return
        receiver, sender, said = self.on_the_way.pop(self.chance.randrange(len(self.on_the_way)))
        if isinstance(said, Motion):
            self.obey(receiver, sender, said)
        elif receiver >= 0:
            self.followers[receiver].hear(name(sender), said)
        else:
            self.heard[sender] = max(self.heard[sender], said.finished)

    def obey(self, robot: int, sequence: int, said: Motion) -> None:
        """As a robot does whose certificates are all good."""
        if sequence <= self.latest[robot]:
            return
        self.latest[robot], mine = sequence, self.followers[robot]
        if mine.has(EPOCH, said):
            mine.release(said)
        else:
            assert mine.object_to(EPOCH, said, (self.places[robot], float(robot))) == ""
            mine.accept(EPOCH, said)

    def drive(self, robot: int, for_s: float) -> None:
        leg = self.followers[robot].steer((self.places[robot], float(robot)))
        assert leg.velocity in ((1.0, 0.0), (0.0, 0.0))
        self.places[robot] += leg.velocity[0] * min(for_s, leg.lasts_s)

    def check(self) -> None:
        """All are in two successive stages, and none of them is beyond what is released: by places alone."""
        ends = [list(accumulate(row, initial=0)) for row in self.lengths]
        for place, own in zip(self.places, ends, strict=True):
            assert place <= own[self.released + 1] + 1e-6
        assert any(
            all(
                own[stage] - 1e-6 <= place <= own[min(stage + 2, len(own) - 1)] + 1e-6
                for place, own in zip(self.places, ends, strict=True)
            )
            for stage in range(len(ends[0]) - 1)
        ), (self.places, ends)

    def live(self) -> None:
        """One thing happens."""
        robot = self.chance.randrange(len(self.lengths))
        match self.chance.choices(range(4), [1, 4, 8, 4])[0]:
            case 0:
                self.lead()
            case 1:
                self.tell(robot)
            case 2:
                self.deliver()
            case 3:
                self.drive(robot, self.chance.choice([0.125, 0.75, 5.0]))


lengths = st.integers(1, 6).flatmap(
    lambda stages: st.lists(
        st.lists(st.sampled_from([0, 0, 1, 2]), min_size=stages, max_size=stages), min_size=2, max_size=5
    )
)


@given(lengths, st.integers(0, 2**32))
def test_all_are_within_two_stages_whatever_becomes_of_messages(rows: Lengths, seed: int) -> None:
    team = Team([list(row) for row in rows], Random(seed))
    for _ in range(250):
        team.live()
        team.check()
    team.released = len(team.lengths[0]) - 1
    for _ in range(2000):  # from here on they talk until they have come to the end
        if all(mine.arrived for mine in team.followers):
            break
        team.command()
        for robot in range(len(rows)):
            team.tell(robot)
            team.drive(robot, 1.0)
        while team.on_the_way:
            team.deliver()
        team.check()
    assert all(mine.arrived for mine in team.followers)
    assert team.places == [sum(row) for row in team.lengths]


@given(lengths)
def test_with_good_ears_all_arrive_when_the_schedule_says(rows: Lengths) -> None:
    order = motion(rows, released=len(rows[0]) - 1)
    places = [(0.0, float(robot)) for robot in range(len(rows))]
    team = [follower(order, robot, places[robot]) for robot in range(len(rows))]
    time_s = 0.0
    while True:
        before: list[Progress | None] = []
        while before != (now := [mine.progress for mine in team]):  # news makes more news, at the same time
            before = now
            legs = [mine.steer(place) for mine, place in zip(team, places, strict=True)]
            for robot, mine in enumerate(team):
                for other in team:
                    if (progress := mine.progress) is not None:
                        other.hear(name(robot), progress)
        if all(leg == STANDING for leg in legs):
            break
        step_s = min(leg.lasts_s for leg in legs if leg != STANDING)
        time_s += step_s
        places = [
            (x + leg.velocity[0] * step_s, y + leg.velocity[1] * step_s)
            for (x, y), leg in zip(places, legs, strict=True)
        ]
    assert all(mine.arrived for mine in team)
    assert time_s == pytest.approx(to_schedule(order).end_s, abs=1e-6)


def test_passes_the_end_of_a_stage_without_a_stop() -> None:
    mine = follower(motion([[1, 1], [1, 1]], released=1))
    assert mine.steer((0.5, 0.0)) == Leg((1.0, 0.0), 0.5)
    assert mine.steer((1.0, 0.0)) == Leg((1.0, 0.0), 1.0)  # nobody need have finished more than stage -1
    assert mine.progress == said(1)


def test_waits_for_the_slowest_and_says_for_whom() -> None:
    mine = follower(motion([[1, 1, 1], [1, 1, 1], [1, 1, 1]], released=2))
    for place in (0.0, 1.0, 2.0):
        leg = mine.steer((place, 0.0))
    assert leg == STANDING
    assert mine.progress == said(2)
    assert mine.waits_for() == ("robot1", "robot2")
    mine.hear("robot1", said(1))
    assert mine.waits_for() == ("robot2",)
    mine.hear("robot2", said(9, plan=1))
    mine.hear("robot2", said(9, epoch=EPOCH + 1))
    assert mine.waits_for() == ("robot2",)


def test_news_of_another_plan_counts_when_that_plan_has_come() -> None:
    mine = follower(motion([[1], [1]], released=0))
    mine.steer((1.0, 0.0))
    assert mine.arrived
    mine.hear("robot1", said(2, plan=1))
    mine.accept(EPOCH, structs.replace(motion([[0, 0, 2], [1, 1, 1]], released=2), plan=1))
    assert mine.steer((1.0, 0.0)) != STANDING


def test_progress_only_rises() -> None:
    mine = follower(motion([[0, 0, 1], [1, 1, 1]], released=2))
    assert mine.hear("robot1", said(1))
    assert not mine.hear("robot1", said(0))
    assert not mine.hear("robot1", said(1))
    assert mine.steer((0.0, 0.0)) != STANDING


def test_who_does_not_move_is_not_waited_for() -> None:
    rows = [[1, 1, 1], [1, 0, 0], [0, 0, 0]]
    mine = follower(motion(rows, released=2))
    mine.steer((0.0, 0.0))
    mine.steer((1.0, 0.0))
    assert mine.steer((2.0, 0.0)) == STANDING
    assert mine.waits_for() == ("robot1",)
    mine.hear("robot1", said(1))
    assert mine.steer((2.0, 0.0)) != STANDING


def test_takes_the_leaders_word_for_what_all_have_finished() -> None:
    rows = [[1, 1, 1], [1, 1, 1]]
    mine = follower(motion(rows, released=2))
    for place in (0.0, 1.0):
        mine.steer((place, 0.0))
    mine.hear("robot1", said(0))
    assert mine.steer((2.0, 0.0)) == STANDING
    mine.release(motion(rows, first_stage=1, released=2))
    assert mine.steer((2.0, 0.0)) == Leg((1.0, 0.0), 1.0)


def test_nobody_waits_for_the_unscheduled() -> None:
    order = motion([[1, 1, 1], [1, 1, 1]], released=2)
    *others, agent = order.ways
    order = structs.replace(order, ways=(*others, structs.replace(agent, scheduled=False)))
    mine = follower(order)
    for place in (0.0, 1.0):
        mine.steer((place, 0.0))
    assert mine.steer((2.0, 0.0)) == Leg((1.0, 0.0), 1.0)


def test_goes_no_farther_than_released_and_on_as_soon_as_more_is() -> None:
    mine = follower(motion([[1, 1], [0, 0]]))
    assert mine.steer((0.0, 0.0)) == STANDING
    mine.release(motion([[1, 1], [0, 0]], released=0))
    assert mine.steer((0.0, 0.0)) == Leg((1.0, 0.0), 1.0)
    assert mine.steer((1.0, 0.0)) == STANDING
    assert mine.waits_for() == ()
    mine.release(motion([[1, 1], [0, 0]], released=99))
    mine.release(motion([[1, 1], [0, 0]], released=0))
    assert mine.steer((1.0, 0.0)) == Leg((1.0, 0.0), 1.0)
    assert mine.steer((2.0, 0.0)) == STANDING
    assert mine.arrived


def test_drives_no_faster_than_the_motion_asks_for() -> None:
    order = motion([[1], [0]], released=0)
    base, way, other = order.ways
    mine = follower(structs.replace(order, ways=(base, structs.replace(way, speed_m_s=0.5), other)))
    assert mine.steer((0.0, 0.0)) == Leg((0.5, 0.0), 2.0)


def test_a_halted_follower_stands_and_has_no_plan() -> None:
    mine = follower(motion([[1], [1]], released=0))
    mine.halt()
    assert mine.steer((0.0, 0.0)) == STANDING
    assert (mine.progress, mine.target, mine.remaining((0.0, 0.0)), mine.arrived) == (None, None, (), False)


def test_what_is_left_of_its_way_shrinks_from_its_front() -> None:
    mine = follower(motion([[1, 2], [0, 0]], released=1))
    assert mine.target == (3.0, 0.0)
    assert mine.remaining((0.5, 0.0)) == ((0.5, 0.0), (1.0, 0.0), (3.0, 0.0))
    mine.steer((1.0, 0.0))
    assert mine.remaining((1.0, 0.0)) == ((1.0, 0.0), (3.0, 0.0))
    mine.steer((3.0, 0.0))
    assert mine.remaining((3.0, 0.0)) == ()


def test_stands_when_it_is_off_its_way() -> None:
    mine = follower(motion([[2], [0]], released=0))
    assert mine.steer((1.0, 0.9 * ASTRAY_M)) != STANDING
    assert mine.steer((1.0, 1.1 * ASTRAY_M)) == STANDING
    assert mine.astray_m((1.0, 0.5)) == pytest.approx(0.5)
    assert mine.astray_m((-3.0, 4.0)) == pytest.approx(5.0)
    assert mine.steer((1.0, 0.0)) != STANDING


def started() -> StageFollower:
    """Has finished two of four stages, and may begin the third."""
    mine = follower(motion([[1, 1, 1, 1], [1, 1, 1, 1]], revision=3, released=2))
    for place in (0.0, 1.0, 2.0):
        mine.steer((place, 0.0))
    assert mine.progress == structs.replace(said(2), revision=3)
    return mine


SAME = [[1, 1, 1, 1], [1, 1, 1, 1]]


@pytest.mark.parametrize(
    ("order", "text"),
    [
        (motion(SAME, revision=2), "revision 2 comes after revision 3"),
        (motion(SAME, revision=4, first_stage=3), "begins at stage 3, and robot0 has finished 2"),
        (motion([[1, 1], [1, 1]], revision=4), "ends before stage 2, which was released"),
        (motion([*SAME, [0, 0, 0, 0]], revision=4), "has other members"),
        (motion([[1, 1, 2, 1], [1, 1, 1, 1]], revision=4), "changes stage 2 of robot0"),
        (motion([[1, 1, 1, 1], [1, 2, 1, 1]], revision=4, first_stage=1), "changes stage 1 of robot1"),
        (motion([[1, 1, 1, 1], [1, 1, 0, 1]], revision=4), "changes stage 2 of robot1"),
        (motion(SAME, plan=1), "plan 1 is new, and robot0 has not been told to hold"),
        (
            structs.replace(motion(SAME, revision=4), ways=(*motion(SAME).ways, motion(SAME).ways[0])),
            "two ways",
        ),
    ],
)
def test_refuses_a_revision_that_does_not_go_on_from_where_it_is(order: Motion, text: str) -> None:
    mine = started()
    assert text in mine.object_to(EPOCH, order, (2.0, 0.0))
    assert mine.steer((2.0, 0.0)) == STANDING  # as before: robot1 has finished nothing
    mine.hear("robot1", said(1))
    assert mine.steer((2.0, 0.0)) == Leg((1.0, 0.0), 1.0)


@pytest.mark.parametrize("first_stage", [0, 1, 2])
def test_accepts_a_revision_that_goes_on_from_what_is_released(first_stage: int) -> None:
    mine = started()
    mine.hear("robot1", said(2))
    assert mine.steer((2.25, 0.0)) == Leg((1.0, 0.0), 0.75)
    order = motion([[1, 1, 1, 0, 5], [1, 1, 1, 2, 0]], revision=4, first_stage=first_stage, released=4)
    assert mine.object_to(EPOCH, order, (2.25, 0.0)) == ""
    mine.accept(EPOCH, order)
    assert mine.has(EPOCH, order)
    assert mine.steer((2.25, 0.0)) == Leg((1.0, 0.0), 0.75)
    assert mine.remaining((2.25, 0.0)) == ((2.25, 0.0), (3.0, 0.0), (8.0, 0.0))


@pytest.mark.parametrize(
    ("order", "position", "text"),
    [
        (motion(SAME, plan=3), (0.0, 0.0), "plan 3 comes after plan 3, but has no greater number"),
        (motion(SAME, plan=2), (0.0, 0.0), "has no greater number"),
        (motion(SAME, plan=4, first_stage=1), (1.0, 0.0), "plan 4 is at stage 1"),
        (motion(SAME, plan=4), (0.0, 0.02), "0.02 m from where it is"),
        (motion(SAME, plan=4), (0.0, 0.009), ""),
    ],
)
def test_begins_a_new_plan_only_from_its_beginning(order: Motion, position: Point, text: str) -> None:
    mine = follower(motion(SAME, plan=3))
    mine.halt()
    objection = mine.object_to(EPOCH, order, position)
    assert text in objection
    assert bool(text) == bool(objection)


def test_a_revision_goes_on_from_where_the_released_stages_end() -> None:
    mine = follower(motion([[2, 1], [0, 0]], released=0))
    mine.steer((2.0, 0.0))
    assert mine.progress == said(1)
    assert mine.object_to(EPOCH, motion([[2, 3], [0, 0]], revision=1, first_stage=1), (2.0, 0.0)) == ""
    through = motion([[1, 3], [0, 0]], revision=1, first_stage=1)  # leads through its place, but begins before it
    assert "1.00 m" in mine.object_to(EPOCH, through, (2.0, 0.0))


def test_a_robot_that_was_started_again_takes_no_part_in_what_goes_on() -> None:
    mine = StageFollower("robot0", 1.0)
    assert "has not been told to hold" in mine.object_to(EPOCH, motion(SAME), (0.0, 0.0))
    mine.halt()
    assert mine.object_to(EPOCH, motion(SAME), (0.0, 0.0)) == ""


def test_a_new_epoch_may_count_plans_anew() -> None:
    mine = follower(motion(SAME, plan=3))
    mine.halt()
    assert mine.object_to(EPOCH + 1, motion(SAME, plan=0), (0.0, 0.0)) == ""
    assert "no greater number" in mine.object_to(EPOCH - 1, motion(SAME, plan=9), (0.0, 0.0))


def test_a_new_plan_may_follow_on_the_end_of_another() -> None:
    mine = follower(motion([[1], [0]], released=0))
    mine.steer((1.0, 0.0))
    order = motion([[1, 1], [0, 0]], plan=1, released=1)
    assert "1.00 m" in mine.object_to(EPOCH, order, (1.0, 0.0))
    moved = [structs.replace(way, waypoints=tuple((x + 1.0, y) for x, y in way.waypoints)) for way in order.ways]
    order = structs.replace(order, ways=tuple(moved))
    assert mine.object_to(EPOCH, order, (1.0, 0.0)) == ""
    mine.accept(EPOCH, order)
    assert mine.progress == said(0, plan=1)
    assert end(mine.steer((1.0, 0.0)), (1.0, 0.0)) == (2.0, 0.0)


def test_takes_part_only_where_others_wait_for_it() -> None:
    mine = follower()
    order = motion([[1], [0]])
    base, way, other = order.ways
    assert mine.takes_part(order)
    assert not mine.takes_part(structs.replace(order, ways=(base, other)))
    assert not mine.takes_part(structs.replace(order, ways=(base, structs.replace(way, scheduled=False), other)))


def test_turns_corners_exactly_on_them() -> None:
    corners = ((0.0, 0.0), (0.3, 0.4), (0.3, 1.7), (-2.0, 1.1), (-2.0, 0.0))
    order = Motion(
        plan=0, revision=0, first_stage=0, released=1, connection="none",
        ways=(MemberWay(member="robot0", radius_m=0.2, speed_m_s=1.0, waypoints=corners, stages=(0, 2, 4)),),
    )  # fmt: skip
    mine, place, turned, time_s = follower(order), corners[0], [corners[0]], 0.0
    while (leg := mine.steer(place)) != STANDING:
        place = end(leg, place)
        time_s += leg.lasts_s
        turned.append(place)
    assert len(turned) == len(corners)
    assert all(math.dist(a, b) < 1e-9 for a, b in zip(turned, corners, strict=True))
    assert time_s == pytest.approx(sum(math.dist(a, b) for a, b in pairwise(corners)))
