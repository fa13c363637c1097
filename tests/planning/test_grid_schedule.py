"""Schedules on the grid of box limits: certified, found where dense sampling finds a way, refused in words."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from planning.certificate import certify
from planning.coordination_diagram import CoordinationDiagram, measure_path, place_on_path
from planning.diagram_schedule import Team, schedule_in
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from planning.grid_schedule import grid_schedule
from planning.motion_plan import Schedule
from planning.no_schedule import NoSchedule
from tests.planning.polygons import environment_of, free_points

Floats = NDArray[np.float64]

FIELD = Environment([(-20, -20), (25, -20), (25, 25), (-20, 25)], name="field")


def names(robots: int) -> list[str]:
    return [f"robot_{i}" for i in range(robots)]


def plan(paths: list[Floats], radii: Floats, env: Environment | None = None, **asked: object) -> Schedule:
    asked.setdefault("speed_m_s", np.ones(len(paths)))
    return grid_schedule(paths, radii, env, members=names(len(paths)), **asked)


def random_paths(rng: np.random.Generator, robots: int) -> list[Floats]:
    """Polylines in the open, some on whole coordinates, some that stand, turn back or repeat a point."""
    paths = []
    for _ in range(robots):
        path = rng.uniform(0.0, 5.0, (int(rng.integers(1, 4)), 2))
        path = np.round(path) if rng.uniform() < 0.4 else path
        path = np.repeat(path, 2, axis=0) if rng.uniform() < 0.2 else path
        paths.append(np.concatenate([path, path[-2::-1]]) if rng.uniform() < 0.2 else path)
    return paths


def leads_through(paths: list[Floats], separation: float, step_m: float) -> bool:
    """Whether two robots find a way on a dense raster that keeps them apart between its points too."""
    along = [np.linspace(0.0, m, int(np.ceil(m / step_m)) + 1) for m in (measure_path(path)[-1] for path in paths)]
    places = [place_on_path(path, at) for path, at in zip(paths, along, strict=True)]
    distance = np.linalg.norm(places[0][:, None] - places[1][None], axis=-1)
    parts, _ = ndimage.label(distance > separation + step_m)
    return bool(parts[0, 0] == parts[-1, -1] > 0)


@given(seed=st.integers(0, 2**32 - 1), robots=st.sampled_from([2, 3, 4]))
def test_schedules_keep_robots_apart(seed: int, robots: int) -> None:
    """By the certificate, whether they get to the ends or not; and nobody is faster than it can be."""
    rng = np.random.default_rng(seed)
    paths = random_paths(rng, robots)
    radii, speeds = rng.choice([0.0, 0.2, 0.4], robots), rng.choice([0.3, 1.0, 2.0], robots)
    fastest = max(measure_path(path)[-1] / speed for path, speed in zip(paths, speeds, strict=True))
    try:
        found = plan(paths, radii, speed_m_s=speeds)
        for timed, path in zip(found.paths, paths, strict=True):
            np.testing.assert_allclose(timed.waypoints[-1], path[-1], atol=1e-12)
        assert found.end_s >= fastest - 1e-9
    except NoSchedule as refusal:
        found = refusal.best
        if "starts" in refusal.text:
            assert found.end_s == 0.0
            return
    assert found.stages is None
    assert found.start_s == 0.0
    np.testing.assert_array_equal([timed.waypoints[0] for timed in found.paths], [path[0] for path in paths])
    certificate = certify(found, FIELD, links=[])
    assert certificate.valid, certificate.violations[0].text


@settings(max_examples=35)
@given(seed=st.integers(0, 2**32 - 1))
def test_two_robots_find_a_way_where_a_dense_raster_has_one(seed: int) -> None:
    """Robots in one box of pieces no longer than 1 m are nearer to each other than their radii and that."""
    rng = np.random.default_rng(seed)
    paths = random_paths(rng, 2)
    possible = leads_through(paths, 0.8 + 1.0, 0.05)
    try:
        plan(paths, np.array([0.4, 0.4]))
    except NoSchedule as refusal:
        assert refusal.proven
        assert not possible


def test_two_robots_that_cross() -> None:
    """The one way round the box or the other: one robot waits for as long as the box is wide. Known by hand."""
    paths = [np.array([(0.0, 0.0), (4.0, 0.0)]), np.array([(2.0, -2.0), (2.0, 2.0)])]
    found = plan(paths, np.array([0.3, 0.3]))
    assert found.end_s == pytest.approx(4.0 + 1.2)
    assert certify(found, FIELD, links=[]).valid


def test_robots_far_from_each_other_go_at_once() -> None:
    paths = [np.array([(0.0, 3.0 * i), (1.0 + i, 3.0 * i)]) for i in range(5)]
    speeds = np.array([1.0, 1.0, 2.0, 1.0, 2.0])
    found = plan(paths, np.full(5, 0.3), speed_m_s=speeds)
    assert found.end_s == pytest.approx(4.0)
    assert [len(path.waypoints) for path in found.paths] == [2] * 5


def test_robots_follow_each_other_though_their_box_is_all_of_the_way() -> None:
    """By that box the second starts when the first is out of it; by those of short pieces it follows."""
    lane = np.array([(0.0, 0.0), (10.0, 0.0)])
    paths = [lane, lane - [1.0, 0.0]]
    boxes = CoordinationDiagram.of(paths, [0.3, 0.3])
    assert schedule_in(boxes, Team(names(2), np.full(2, 0.3), np.ones(2)), 10_000).end_s == pytest.approx(9.6 + 9.6)
    found = plan(paths, np.array([0.3, 0.3]))
    assert certify(found, FIELD, links=[]).valid
    assert found.end_s < 10.5


def test_robots_of_which_one_must_wait_for_two() -> None:
    """Three meet at a place that one fits into: no two of them are there together."""
    paths = [np.array([(3 * np.cos(a), 3 * np.sin(a)), (0, 0), (3 * np.cos(a + 1), 3 * np.sin(a + 1))])
             for a in (0.0, 2.1, 4.2)]  # fmt: skip
    found = plan(paths, np.full(3, 0.4))
    assert certify(found, FIELD, links=[]).valid
    assert found.end_s > 6.5


ROOMS = Environment(
    [(0, 0), (8, 0), (8, 3), (10, 3), (10, 0), (18, 0), (18, 8), (10, 8), (10, 5), (8, 5), (8, 8), (0, 8)], name="rooms"
)


def journeys(seed: int, robots: int) -> tuple[Environment, list[Floats]]:
    """A map, and geodesics of points between random places."""
    environment = environment_of(seed)
    rng = np.random.default_rng(seed)
    geodesics = GeodesicMap(environment)
    ends = free_points(environment, 2 * robots, rng).reshape(robots, 2, 2)
    return environment, [geodesics.path(start, goal) for start, goal in ends]


@settings(max_examples=35)
@given(seed=st.integers(0, 400), asked=st.sampled_from(["network", "links", "joined"]))
def test_schedules_keep_the_sight_that_is_asked_for(seed: int, asked: str) -> None:
    environment, paths = journeys(seed, 3)
    radii = np.array([0.0, 0.05, 0.05])
    demands: dict[str, dict[str, object]] = {
        "network": {}, "links": {"links": [(1, 0)]}, "joined": {"joined": (0, 2)}
    }  # fmt: skip
    judged: dict[str, dict[str, object]] = {
        "network": {}, "links": {"links": [("robot_0", "robot_1")]}, "joined": {"ends": ("robot_0", "robot_2")}
    }  # fmt: skip
    try:
        found = plan(paths, radii, environment, **demands[asked])
    except NoSchedule as refusal:
        if "starts" in refusal.text:
            return
        found = refusal.best
    broken = [
        violation.text
        for violation in certify(found, environment, **judged[asked]).violations
        if violation.kind != "wall"  # these bodies do not care for walls
    ]
    assert not broken


def test_a_convoy_through_a_door_is_found_and_a_separation_refused() -> None:
    start, goal = np.array([(2.0, 4.0), (3.0, 4.0), (4.0, 4.0)]), np.array([(14.0, 4.0), (15.0, 4.0), (16.0, 4.0)])
    paths = [np.array(ends) for ends in zip(start, goal, strict=True)]
    found = plan(paths, np.full(3, 0.2), ROOMS)
    assert certify(found, ROOMS).valid
    assert found.end_s == pytest.approx(12.0)
    apart = [np.array([(4.0, 4.0), (4.0, 1.0)]), np.array([(14.0, 4.0), (14.0, 1.0)])]
    with pytest.raises(NoSchedule, match=r"robot_0 at \(4, 1\) and robot_1 at \(14, 1\) would be parted") as refusal:
        plan(apart, np.full(2, 0.2), ROOMS)
    assert refusal.value.between == ("robot_0", "robot_1")
    assert refusal.value.proven
    assert certify(refusal.value.best, ROOMS).valid
    assert refusal.value.best.end_s > 0.0
    assert plan(apart, np.full(2, 0.2), ROOMS, links=[]).end_s == pytest.approx(3.0)
    assert plan(apart, np.full(2, 0.2)).end_s == pytest.approx(3.0)


def test_members_that_may_be_anywhere_are_waited_for_nowhere() -> None:
    rng = np.random.default_rng(0)
    paths = [np.array([(4.0, 2.0), (4.0, 6.0)]), np.array([(2.0, 4.0), (6.0, 4.0)]), np.array([(1.0, 1.0), (6.0, 1.0)])]
    found = plan([paths[0], paths[2]], np.full(2, 0.3), ROOMS, unscheduled=(0,))
    assert found.unscheduled == {"robot_0"}
    assert found.paths[0].times_s[-1] == pytest.approx(4.0)
    for at in rng.uniform(0.0, found.end_s, 200):
        anywhere = place_on_path(paths[0], rng.uniform(0.0, 4.0, 1))[0]
        other = found.paths[1].positions([at])[0]
        assert np.linalg.norm(anywhere - other) >= 0.6
        assert ROOMS.line_of_sight(anywhere, other)
    with pytest.raises(NoSchedule, match="robot_0 and robot_1 alone cannot") as refusal:
        plan(paths[:2], np.full(2, 0.3), ROOMS, unscheduled=(0,))
    assert refusal.value.proven
    with pytest.raises(NoSchedule, match=r"robot_0 somewhere on its way and robot_1 at \(4, 4\)"):
        plan([paths[0], np.array([(4.0, 4.0), (6.0, 4.0)])], np.full(2, 0.3), ROOMS, unscheduled=(0,))


def test_refusals_name_who_and_where() -> None:
    near = [np.array([(1.0, 1.0), (5.0, 1.0)]), np.array([(1.2, 1.0), (1.2, 5.0)])]
    with pytest.raises(NoSchedule, match=r"starts where robot_0 at \(1, 1\) and robot_1 at \(1.2, 1\)") as refusal:
        plan(near, np.full(2, 0.2))
    assert refusal.value.best.end_s == 0.0
    swap = [np.array([(0.0, 0.0), (9.0, 0.0)]), np.array([(9.0, 0.0), (0.0, 0.0)])]
    with pytest.raises(NoSchedule, match="robot_0 and robot_1 alone cannot both get to the ends") as refusal:
        plan(swap, np.full(2, 0.2))
    assert refusal.value.proven
    assert refusal.value.between == ("robot_0", "robot_1")
    assert refusal.value.best.end_s > 3.0
    crossing = [
        np.array([(3 * np.cos(a), 3 * np.sin(a)), (-3 * np.cos(a), -3 * np.sin(a))]) for a in np.arange(4) * 0.6
    ]
    with pytest.raises(NoSchedule, match="was given up") as refusal:
        plan(crossing, np.full(4, 0.3), most_nodes=50)
    assert not refusal.value.proven
    assert certify(refusal.value.best, FIELD, links=[]).valid
    assert certify(plan(crossing, np.full(4, 0.3), most_nodes=50_000), FIELD, links=[]).valid
