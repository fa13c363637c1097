"""The certificate by progress against motions known by hand, and against networkx and shapely on random ones."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike

from planning.certificate import certify
from planning.environment import Environment
from planning.motion_plan import InvalidSchedule, Schedule, TimedPath

PILLAR = Environment([(0, 0), (8, 0), (8, 8), (0, 8)], [[(3, 3), (5, 3), (5, 5), (3, 5)]])
ROOM = Environment([(0, 0), (20, 0), (20, 20), (0, 20)])


def staged(*rows: tuple[list[tuple[float, float]], list[float], list[int]], radii: ArrayLike = 0.2) -> Schedule:
    """Members robot_0, robot_1 … of waypoints, times and stages."""
    paths = [TimedPath(points, times) for points, times, _ in rows]
    return Schedule([f"robot_{i}" for i in range(len(rows))], paths, radii, 1.0, [stages for *_, stages in rows])


ALONG = [(1.0, 10.0), (5.0, 10.0), (15.0, 10.0)]
ACROSS = [(10.0, 5.0), (10.0, 15.0)]


def test_two_who_cross_have_a_stage_between_them() -> None:
    """One crosses in its stages 0 and 1, the other in its stage 3: stage 2 is empty, so that no window holds both."""
    passing = staged((ALONG, [0, 4, 14], [0, 1, 2, 2, 2]), (ACROSS, [14, 24], [0, 0, 0, 0, 1]))
    assert certify(passing, ROOM).valid
    tight = staged((ALONG, [0, 4, 14], [0, 1, 2, 2]), (ACROSS, [8, 18], [0, 0, 0, 1]))
    (violation,) = certify(tight, ROOM).violations
    assert (violation.kind, violation.stage, violation.members) == ("collision", 1, ("robot_0", "robot_1"))
    assert (violation.time_s, violation.until_s) == (4.0, np.inf)
    assert violation.text == (
        "in stages 1 and 2 robot_0 and robot_1 can come nearer than 0.4 m to each other, at (10, 10)"
    )
    # On the clock nothing is wrong with it.
    assert certify(Schedule(tight.members, tight.paths, 0.2, 1.0), ROOM).valid


def test_nominal_times_keep_the_rule_of_progress() -> None:
    early = staged((ALONG, [0, 4, 14], [0, 1, 2, 2, 2]), (ACROSS, [13, 23], [0, 0, 0, 0, 1]))
    (violation,) = certify(early, ROOM).violations
    assert (violation.kind, violation.stage, violation.members) == ("progress", 1, ("robot_1", "robot_0"))
    assert violation.text == ("robot_1 would begin stage 3 at 13 s, before robot_0 has finished stage 1 at 14 s")


def test_stops_belong_to_the_stage_that_the_planner_likes() -> None:
    for border in (1, 2, 3):
        passing = staged(
            (ALONG, [0, 4, 14], [0, 1, 2, 2, 2]),
            ([*ACROSS[:1] * 4, ACROSS[1]], [0, 2, 13, 14, 24], [0, 0, 0, border, 4]),
        )
        assert certify(passing, ROOM).valid


def test_a_link_holds_for_all_places_on_both_pieces() -> None:
    """Both go up beside the pillar, from below to above: together they would see each other half of the way."""
    one, other = [(1.0, 1.0), (1.0, 2.9)], [(7.0, 1.0), (7.0, 2.9)]
    assert certify(staged((one, [0, 1.9], [0, 1]), (other, [0, 1.9], [0, 1])), PILLAR).valid
    one, other = [(1.0, 1.0), (1.0, 3.1)], [(7.0, 1.0), (7.0, 2.9)]
    (violation,) = certify(staged((one, [0, 2.1], [0, 1]), (other, [0, 1.9], [0, 1])), PILLAR).violations
    assert (violation.kind, violation.time_s, violation.until_s) == ("connection", 0.0, np.inf)
    assert violation.text == "in stage 0 the team can be parted: robot_0 | robot_1"


def test_who_can_part_is_named() -> None:
    around = [(2.0, 7.0), (7.0, 7.0), (7.0, 1.0)]
    schedule = staged(([(1.0, 1.0)], [0], [0] * 5), ([(1.0, 7.0)], [0], [0] * 5), (around, [0, 5, 11], [0, 1, 1, 2, 2]))
    (violation,) = certify(schedule, PILLAR).violations
    assert violation.text == (
        "in stages 1 and 2, as robot_1 and robot_2 can lose sight of each other, the team can be parted: "
        "robot_0 + robot_1 | robot_2"
    )
    assert certify(schedule, PILLAR, ends=("robot_0", "robot_1")).valid
    assert certify(schedule, PILLAR, ends=(1, 0), links=[("robot_0", 1)]).valid
    assert certify(schedule, PILLAR, links=[]).valid
    assert certify(schedule, PILLAR, ends={2, 1}).violations[0].members == ("robot_1", "robot_2")
    (violation,) = certify(schedule, PILLAR, links=[(2, 1), (0, 1)]).violations
    assert (violation.time_s, violation.stage) == (5.0, 1)


def test_the_unscheduled_may_be_anywhere_all_the_time() -> None:
    robot, agent = TimedPath.standing((1, 1)), TimedPath([(1, 7), (7, 7)], [0, 6])
    schedule = Schedule(["robot", "agent"], [robot, agent], 0.2, 1.0, [[0] * 5, [0, 0, 0, 0, 1]], ["agent"])
    (violation,) = certify(schedule, PILLAR).violations
    assert (violation.time_s, violation.stage) == (0.0, 0)
    with pytest.raises(InvalidSchedule, match="1 members are asked to be joined"):
        certify(schedule, PILLAR, ends=("robot",))


@pytest.mark.parametrize("names", [("robot", 2), (0, -1), ("robot", "walker")])
def test_rows_and_names_that_do_not_exist_are_refused(names: tuple[str | int, str | int]) -> None:
    schedule = Schedule(["robot", "agent"], [TimedPath.standing((1, 1))] * 2, 0.0)
    with pytest.raises(InvalidSchedule, match="is no member of the schedule: it has robot, agent"):
        certify(schedule, PILLAR, ends=names)
