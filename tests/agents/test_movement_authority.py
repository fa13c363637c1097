"""The leader's account against a team that hears and is heard late, twice, or not at all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.motion_message import check, end_stage, piece, to_schedule
from agents.movement_authority import Discontinuity, MovementAuthority, Onset
from protocol.messages import MemberWay, Motion, Point, Progress

ROBOTS = ("a", "b", "c")
SPEED_M_S = 2.0


def make_motion(places: Sequence[Point], steps: Sequence[Sequence[float]]) -> Motion:
    """Robots that start at ``places`` and go so many metres east in each stage; base stands, and the agent is free."""
    ways = [
        MemberWay(member="base", radius_m=0.0, speed_m_s=1.0, waypoints=((0.0, 0.0),), stages=(0,) * (len(steps) + 1))
    ]
    for row, (name, (x, y)) in enumerate(zip(ROBOTS, places, strict=True)):
        waypoints, marks = [(x, y)], [0]
        for step in steps:
            if step[row] > 0.0:
                x += step[row]
                waypoints.append((x, y))
            marks.append(len(waypoints) - 1)
        ways.append(
            MemberWay(member=name, radius_m=0.2, speed_m_s=SPEED_M_S, waypoints=tuple(waypoints), stages=tuple(marks))
        )
    agent = MemberWay(
        member="agent", radius_m=0.0, speed_m_s=1.0, waypoints=((9.0, 9.0), (9.0, 8.0)),
        stages=(0, *[1] * len(steps)), scheduled=False,
    )  # fmt: skip
    return Motion(
        plan=0, revision=0, first_stage=0, released=-1, ways=(*ways, agent), connection="joined", joined=("a", "base")
    )


START = [(0.0, 1.0), (0.0, 2.0), (0.0, 3.0)]


def begin(steps: Sequence[Sequence[float]]) -> MovementAuthority:
    return MovementAuthority(7, make_motion(START, steps), ROBOTS)


def report(robot: str, finished: int, revision: int = 0, plan: int = 0, epoch: int = 7) -> Progress:
    return Progress(epoch=epoch, plan=plan, revision=revision, finished=finished)


def accept(authority: MovementAuthority, finished: int = 0) -> None:
    for robot in ROBOTS:
        authority.hear(robot, report(robot, finished, authority.motion.revision))


def test_nothing_is_released_before_everybody_accepts() -> None:
    authority = begin([[1, 1, 1]] * 3)
    assert not authority.release(10.0)
    authority.hear("a", report("a", 0))
    authority.hear("b", report("b", 0))
    assert authority.undecided == ("c",)
    assert not authority.release(10.0)
    authority.hear("c", report("c", 0))
    assert authority.release(10.0)
    assert authority.released == 2


def test_releases_what_begins_within_the_horizon_of_the_slowest() -> None:
    # At 2 m/s: stages of 0.5 s, 0 s and 1 s for the slowest; a, which has less to do, begins later stages sooner.
    authority = begin([[0.5, 1, 1], [0, 0, 0], [1, 2, 2], [1, 1, 1], [1, 1, 1]])
    accept(authority)
    authority.release(0.0)
    assert authority.released == 1
    authority.release(0.4)
    assert authority.released == 1  # stage 2 begins when all have finished stage 0, at 0.5 s
    authority.release(0.5)
    assert authority.released == 2
    for robot in "ab":
        authority.hear(robot, report(robot, 2))
    assert not authority.release(0.5)
    authority.hear("c", report("c", 2))
    assert authority.lead_s() == pytest.approx(1.0)
    authority.release(0.5)
    assert authority.released == 3


def test_late_doubled_and_foreign_reports_change_nothing() -> None:
    authority = begin([[1, 1, 1]] * 4)
    accept(authority)
    authority.release(0.6)
    assert authority.hear("a", report("a", 2))
    assert not authority.hear("a", report("a", 2))
    assert not authority.hear("a", report("a", 1))
    assert not authority.hear("b", report("b", 3, plan=1))
    assert not authority.hear("b", report("b", 3, epoch=8))
    assert not authority.hear("stranger", report("stranger", 3))
    accept(authority, 99)
    assert authority.finished == authority.released + 1  # nobody can have finished what was not released


def test_a_revision_goes_on_where_the_released_ends() -> None:
    authority = begin([[1, 2, 3]] * 5)
    accept(authority)
    authority.release(0.6)
    assert authority.released == 1
    onset = authority.onset()
    assert onset.places == {"base": (0.0, 0.0), "a": (2.0, 1.0), "b": (4.0, 2.0), "c": (6.0, 3.0)}
    after = make_motion([onset.places[name] for name in ROBOTS], [[1, 1, 1], [0, 1, 0]])
    authority.revise(onset.continued(after))
    motion = authority.motion
    assert (motion.plan, motion.revision, motion.first_stage, motion.released) == (0, 1, 0, 1)
    check(motion)
    schedule = to_schedule(motion)
    assert schedule.unscheduled == {"agent"}
    assert schedule.stage_count == 2 + 1 + 2  # released, a stop, the new ones
    assert not authority.release(99.0)
    accept(authority, 1)
    assert authority.release(99.0)
    authority.prune()
    assert authority.motion.first_stage == 1
    check(authority.motion)
    assert np.array_equal(to_schedule(authority.motion).positions(99.0), schedule.positions(99.0))


def test_a_team_that_stands_begins_anew_without_what_is_over() -> None:
    authority = begin([[1, 1, 1]])
    accept(authority)
    authority.release(1.0)
    accept(authority, 1)
    assert authority.over
    onset = authority.onset()
    assert onset.kept is None
    authority.revise(onset.continued(make_motion([(1.0, 1.0), (1.0, 2.0), (1.0, 3.0)], [[1, 0, 0]])))
    assert (authority.motion.first_stage, end_stage(authority.motion), authority.over) == (1, 2, False)


def test_a_motion_from_elsewhere_is_refused() -> None:
    onset = begin([[1, 1, 1]]).onset()
    with pytest.raises(Discontinuity, match="has a at"):
        onset.continued(make_motion([(0.5, 1.0), *START[1:]], [[1, 1, 1]]))


def test_where_a_robot_may_be_that_is_lost() -> None:
    authority = begin([[1, 1, 1]] * 6)
    assert authority.way("b") == ((0.0, 2.0),)
    accept(authority)
    authority.release(1.0)
    assert authority.way("b") == ((0.0, 2.0), (1.0, 2.0), (2.0, 2.0), (3.0, 2.0))
    authority.hear("b", report("b", 2))
    assert authority.way("b") == ((2.0, 2.0), (3.0, 2.0))
    authority.hear("b", report("b", 3))
    assert authority.way("b") == ((3.0, 2.0),)


class Robot:
    """Goes by the rule, with what it has heard."""

    def __init__(self, name: str) -> None:
        self.name, self.motion, self.released = name, make_motion(START, [[0, 0, 0]]), -1
        self.finished, self.heard = 0, dict.fromkeys(ROBOTS, 0)
        self.revision = -1
        self.place: Point = START[ROBOTS.index(name)]

    def take(self, motion: Motion) -> None:
        if motion.revision >= self.revision:
            self.motion, self.revision = motion, motion.revision
            self.released = max(self.released, motion.released)
            # All have finished what the message does not contain any more.
            self.heard = {name: max(known, motion.first_stage) for name, known in self.heard.items()}

    def go(self) -> int | None:
        """Finish the next stage if it may; its number."""
        stage = self.finished
        others = min(known for name, known in self.heard.items() if name != self.name)
        if stage > self.released or others < stage - 1 or self.revision < 0:
            return None
        way = next(way for way in self.motion.ways if way.member == self.name)
        went = piece(way, stage - self.motion.first_stage)
        assert math.dist(went[0], self.place) < 1e-9, "a released stage begins where the last one ended"
        self.place, self.finished = went[-1], stage + 1
        return stage


steps = st.lists(st.lists(st.sampled_from([0.0, 0.5, 1.0]), min_size=3, max_size=3), min_size=1, max_size=4)
acts = st.one_of(
    st.tuples(st.just("hear orders"), st.integers(0, 2), st.integers(0, 5)),
    st.tuples(st.just("go"), st.integers(0, 2), st.just(0)),
    st.tuples(st.just("tell"), st.integers(0, 2), st.integers(0, 3)),
    st.tuples(st.just("release"), st.integers(0, 3), st.just(0)),
    st.tuples(st.just("revise"), steps, st.just(0)),
    st.tuples(st.just("prune"), st.just(0), st.just(0)),
)


@given(first=steps, script=st.lists(acts, max_size=50))
def test_whatever_is_lost_or_late_nobody_leaves_what_was_released(first: list, script: list) -> None:  # type: ignore[type-arg]
    """Orders and reports reach some and not others, in any order and repeatedly. What has been released never changes,
    everybody drives just that, nobody is two stages ahead of another, and at last all get to the end."""
    authority = begin(first)
    robots = {name: Robot(name) for name in ROBOTS}
    orders: list[Motion] = [authority.motion]
    reports: list[list[Progress]] = [[] for _ in ROBOTS]
    tape: dict[tuple[str, int], tuple[Point, ...]] = {}
    starts = dict(zip(ROBOTS, START, strict=True))
    released = -1

    def note() -> None:
        """The leader's orders as they stand; what was released before is as it was, and known for ways back."""
        nonlocal released
        motion = authority.motion
        assert motion.released >= released
        for way in motion.ways:
            for stage in range(motion.first_stage, motion.released + 1):
                if way.scheduled:
                    assert tape.setdefault((way.member, stage), piece(way, stage - motion.first_stage)) == piece(
                        way, stage - motion.first_stage
                    )
        released = motion.released
        orders.append(motion)
        for name, finished in authority.advance().finished.items():
            been = [place for stage in range(finished) for place in tape[name, stage]] or [starts[name]]
            assert [place for place, _ in groupby(authority.way_back(name))] == [place for place, _ in groupby(been)]

    def go(robot: Robot) -> None:
        place = robot.place
        stage = robot.go()
        if stage is not None:
            assert tape[robot.name, stage][0] == pytest.approx(place)
            assert tape[robot.name, stage][-1] == robot.place
            assert all(other.finished >= stage - 1 for other in robots.values())

    def tell(name: str, which: int) -> None:
        robot = robots[name]
        row = reports[ROBOTS.index(name)]
        if robot.revision >= 0:
            row.append(report(name, robot.finished, robot.revision))
        for told in row[-1 - which :][:1]:  # an old one now and then
            authority.hear(name, told)
            for other in robots.values():
                other.heard[name] = max(other.heard[name], told.finished)

    for act, what, which in script:
        match act:
            case "hear orders":
                robots[ROBOTS[what]].take(orders[max(-1 - which, -len(orders))])
            case "go":
                go(robots[ROBOTS[what]])
            case "tell":
                tell(ROBOTS[what], which)
            case "release":
                authority.release(0.3 * what)
            case "revise":
                onset = authority.onset()
                motion = make_motion([onset.places[name] for name in ROBOTS], what)
                authority.revise(onset.continued(motion))
            case "prune":
                authority.prune()
        note()
    for _ in range(200):
        for name, robot in robots.items():
            robot.take(authority.motion)
            go(robot)
            tell(name, 0)
        authority.release(0.1)
        note()
        if authority.over:
            break
    assert authority.over
    ends = {way.member: way.waypoints[-1] for way in authority.motion.ways}
    assert {name: robot.place for name, robot in robots.items()} == {name: ends[name] for name in ROBOTS}


def test_an_onset_without_anything_kept_is_the_motion_itself() -> None:
    motion = make_motion(START, [[1, 1, 1]])
    onset = Onset(3, 0, 0, {"base": (0.0, 0.0), **dict(zip(ROBOTS, START, strict=True))})
    assert onset.continued(motion).ways == motion.ways
    assert onset.continued(motion).plan == 3
