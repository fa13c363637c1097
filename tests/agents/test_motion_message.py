"""A schedule that crosses the wire comes back as it was, but for stops and the times that follow from the rest."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from agents.motion_message import InvalidMotion, end_stage, to_motion, to_schedule
from planning.continuation import assemble
from planning.motion_plan import Schedule, TimedPath
from protocol.messages import MemberWay, Motion, Point

coordinates = st.integers(-20, 20).map(float)
points = st.tuples(coordinates, coordinates)


@st.composite
def schedules(draw: st.DrawFn) -> Schedule:
    members = [f"robot{i}" for i in range(draw(st.integers(1, 4)))]
    stages = draw(st.integers(1, 5))
    pieces = []
    for _ in members:
        place, own = draw(points), []
        for _ in range(stages):
            own.append([place, *draw(st.lists(points, max_size=3))])
            place = own[-1][-1]
        pieces.append(own)
    unscheduled = {"agent": TimedPath([(0, 0), (3, 4), (3, 5)], [0.0, 2.5, 3.0])} if draw(st.booleans()) else {}
    speeds = [1.0, 0.5, 2.0, 1.0][: len(members)] + [2.0] * len(unscheduled)
    return assemble(members, pieces, 0.25, speeds, unscheduled=unscheduled)


def message(schedule: Schedule, first_stage: int = 0) -> Motion:
    return to_motion(
        schedule, plan=3, revision=2, first_stage=first_stage, released=first_stage + 1, connection="joined",
        joined=["robot0"],
    )  # fmt: skip


@given(schedules())
def test_a_schedule_comes_back(schedule: Schedule) -> None:
    motion = message(schedule)
    back = to_schedule(motion)
    assert back.members == schedule.members
    assert back.unscheduled == schedule.unscheduled
    assert back.stage_count == schedule.stage_count == end_stage(motion)
    np.testing.assert_array_equal(back.radii_m, schedule.radii_m)
    np.testing.assert_array_equal(back.speeds_m_s, schedule.speeds_m_s)
    times_s = np.linspace(0.0, schedule.end_s, 50)
    np.testing.assert_allclose(back.positions(times_s), schedule.positions(times_s), atol=1e-9)
    assert message(back) == motion


def way(member: str, *waypoints: Point, stages: tuple[int, ...], speed_m_s: float = 1.0) -> MemberWay:
    return MemberWay(member=member, radius_m=0.2, speed_m_s=speed_m_s, waypoints=waypoints, stages=stages)


GOOD = Motion(
    plan=0, revision=0, first_stage=0, released=0, connection="none",
    ways=(way("a", (0.0, 0.0), (1.0, 0.0), stages=(0, 1, 1)), way("b", (0.0, 5.0), stages=(0, 0, 0))),
)  # fmt: skip


@pytest.mark.parametrize(
    ("ways", "text"),
    [
        ((GOOD.ways[0], GOOD.ways[0]), "two ways: a, a"),
        ((GOOD.ways[0], way("b", (0.0, 5.0), stages=(0, 0))), "b has 1 stages, a 2"),
        ((way("a", (0.0, 0.0), (1.0, 0.0), stages=(0, 0)),), "begin at waypoint 0 and end at 0"),
        ((way("a", (0.0, 0.0), (1.0, 0.0), stages=(1, 1)),), "begin at waypoint 1"),
        ((way("a", (0.0, 0.0), (1.0, 0.0), stages=(0, 1, 0, 1)),), "must rise"),
        ((way("a", (0.0, 0.0), (1.0, 0.0), stages=(0, 2**50)),), "must rise"),
        ((way("a", (0.0, 0.0), (1.0, 0.0), stages=(0, 1), speed_m_s=1e-320),), "a is to move at .* give at least"),
        ((structs.replace(GOOD.ways[0], scheduled=False),), "nobody"),
    ],
)
def test_what_is_no_schedule_is_refused_in_words(ways: tuple[MemberWay, ...], text: str) -> None:
    to_schedule(GOOD)
    with pytest.raises(InvalidMotion, match=text):
        to_schedule(structs.replace(GOOD, ways=ways))
