"""Paths and schedules as values."""

from __future__ import annotations

import numpy as np
import pytest

from planning.motion_plan import InvalidSchedule, Schedule, TimedPath


def test_a_path_is_straight_between_waypoints_and_still_outside_of_its_times() -> None:
    path = TimedPath([(0, 0), (4, 0), (4, 0), (4, 3)], [1.0, 3.0, 4.0, 7.0])
    expected = [(0, 0), (0, 0), (1, 0), (4, 0), (4, 0), (4, 2), (4, 3), (4, 3)]
    assert path.positions([0.0, 1.0, 1.5, 3.0, 3.7, 6.0, 7.0, 99.0]) == pytest.approx(np.array(expected))
    assert path.length_m == pytest.approx(7.0)
    assert TimedPath.standing((2, 5)).positions([-1.0, 3.0]).tolist() == [[2, 5], [2, 5]]


def test_a_schedule_puts_paths_on_one_clock() -> None:
    schedule = Schedule(
        ["base", "robot"], [TimedPath.standing((1, 1), 2.0), TimedPath([(0, 0), (2, 0)], [1.0, 5.0])], [0.0, 0.2], 1.0
    )
    assert (len(schedule), schedule.start_s, schedule.end_s) == (2, 1.0, 5.0)
    assert schedule.positions([3.0]).tolist() == [[[1, 1], [1, 0]]]
    assert schedule.radii_m.tolist() == [0.0, 0.2]
    assert schedule.speeds_m_s.tolist() == [1.0, 1.0]


def test_values_cannot_be_written_to_and_do_not_follow_what_they_were_made_of() -> None:
    points = np.array([(0.0, 0.0), (1.0, 0.0)])
    path = TimedPath(points, [0.0, 1.0])
    points[0] = 9.0
    assert path.waypoints[0].tolist() == [0.0, 0.0]
    with pytest.raises(ValueError, match="read-only"):
        path.waypoints[0] = 1.0


@pytest.mark.parametrize(
    ("waypoints", "times", "message"),
    [
        ([(0, 0)], [0, 1], "1 waypoints and 2 times"),
        ([], [], "0 waypoints"),
        ([(0, np.nan)], [0], "not finite"),
        ([(0, 0)], [np.inf], "not finite"),
        ([(0, 0), (1, 0), (2, 0)], [0, 2, 2], r"from waypoint 1 \(2 s\) to waypoint 2 \(2 s\)"),
    ],
)
def test_paths_that_are_none_are_refused(waypoints: object, times: object, message: str) -> None:
    with pytest.raises(InvalidSchedule, match=message):
        TimedPath(waypoints, times)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("members", "radii", "speeds", "message"),
    [
        (["a"], 0.2, 1.0, "2 paths of 1 different"),
        (["a", "a"], 0.2, 1.0, "2 paths of 1 different"),
        (["a", "b"], [0.2, 0.2, 0.2], 1.0, "3 values of radius"),
        (["a", "b"], [0.2, -0.1], 1.0, "radius of b is -0.1"),
        (["a", "b"], [0.2, np.inf], 1.0, "b has no finite radius"),
        (["a", "b"], 0.2, [np.nan, 1.0], "greatest speed of a is nan"),
    ],
)
def test_schedules_that_are_none_are_refused(members: list[str], radii: object, speeds: object, message: str) -> None:
    paths = [TimedPath.standing((0, 0)), TimedPath.standing((1, 1))]
    with pytest.raises(InvalidSchedule, match=message):
        Schedule(members, paths, radii, speeds)  # type: ignore[arg-type]


def test_stages_cut_paths_into_pieces() -> None:
    paths = [TimedPath([(0, 0), (1, 0), (1, 0), (2, 0)], [0, 1, 3, 4]), TimedPath([(5, 5), (5, 7)], [1, 3])]
    schedule = Schedule(["a", "b"], paths, 0.2, 1.0, stages=[[0, 1, 2, 3], [0, 0, 1, 1]])
    assert schedule.stage_count == 3
    assert schedule.piece(0, 0, 1).tolist() == [[0, 0], [1, 0], [1, 0]]
    assert schedule.piece(1, 2, 2).tolist() == [[5, 7]]
    assert Schedule(["a", "b"], paths, 0.2, 1.0).stage_count == 0


def test_whoever_is_unscheduled_has_one_piece() -> None:
    paths = [TimedPath([(0, 0), (1, 0)], [0, 1]), TimedPath([(5, 5), (5, 7)], [1, 3])]
    schedule = Schedule(["a", "b"], paths, 0.2, 1.0, stages=[[0, 1, 1], [0, 0, 1]], unscheduled=["b"])
    assert schedule.piece(1, 0, 0).tolist() == [[5, 5], [5, 7]]


@pytest.mark.parametrize(
    ("stages", "message"),
    [
        ([[0, 1]], "stages of shape"),
        ([[0], [0]], "stages of shape"),
        ([[0, 1], [0, 1]], "stages of b are"),
        ([[1, 1], [0, 0]], "stages of a are"),
        ([[0, 2, 1], [0, 0, 0]], "never fall"),
    ],
)
def test_stages_that_are_none_are_refused(stages: list[list[int]], message: str) -> None:
    paths = [TimedPath([(0, 0), (1, 0)], [0, 1]), TimedPath.standing((1, 1))]
    with pytest.raises(InvalidSchedule, match=message):
        Schedule(["a", "b"], paths, 0.2, stages=stages)
