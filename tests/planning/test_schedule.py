"""Schedules against the certificate, against places drawn at random within two stages, and against the thesis' grid."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import maps
from planning.certificate import certify
from planning.connectivity import component_labels
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from planning.motion_plan import InvalidSchedule, Schedule
from planning.no_schedule import NoSchedule
from planning.schedule import schedule
from tests.planning.polygons import free_points

Floats = NDArray[np.float64]
Paths = list[Floats]

RADIUS = 0.2

# A room, a corridor of 1 m with a bay half way, and another room.
CORRIDOR = Environment(
    [(0, 0), (6, 0), (6, 2), (10, 2), (10, 0), (12, 0), (12, 2), (16, 2), (16, 0), (22, 0), (22, 5), (16, 5), (16, 3),
     (6, 3), (6, 5), (0, 5)]
)  # fmt: skip
OPEN_FIELD = Environment([(-50, -50), (50, -50), (50, 50), (-50, 50)])


@cache
def team_of(name: str, members: int, number: int) -> tuple[Environment, list[Paths]]:
    """A base station that stands and members near each other, in one network at the start and at their goals.

    On a map of the thesis, their geodesics; drawn until there are so many.
    """
    environment = Environment.load(maps.path(name))
    free = environment.inflated(RADIUS)
    geodesics = GeodesicMap(free)
    rng = np.random.default_rng(members)
    base = free_points(free, 1, rng)[0]

    def deploy() -> Floats:
        while True:
            places = [base]
            while len(places) < members:
                near = places[rng.integers(len(places))] + rng.normal(0.0, 4.0, (20, 2))
                near = near[free.contains(near)]
                gaps = np.hypot(*(near[:, None] - places).transpose(2, 0, 1))
                near = near[np.all(gaps > 2.0 * RADIUS, axis=1)]
                if len(near) > 0:
                    places.append(near[0])
            if np.all(component_labels(environment.visibility_matrix(np.array(places))) == 0):
                return np.array(places)

    found = []
    for _ in range(number):
        starts, goals = deploy(), deploy()
        found.append([base[None], *(geodesics.path(a, b) for a, b in zip(starts[1:], goals[1:], strict=True))])
    return environment, found


def check(plan: Schedule, environment: Environment, paths: Sequence[Floats], **demand: object) -> None:
    """The certificate accepts it; it follows the paths to their ends; and its times are the earliest."""
    certificate = certify(plan, environment, **demand)  # type: ignore[arg-type]
    assert certificate.valid, certificate.violations[0].text
    assert plan.stages is not None
    for path, timed in zip(paths, plan.paths, strict=True):
        assert timed.waypoints[[0, -1]] == pytest.approx(np.asarray(path, dtype=np.float64)[[0, -1]])
        assert timed.length_m == pytest.approx(np.hypot(*np.diff(path, axis=0).T).sum())
    check_times(plan)


def check_times(plan: Schedule) -> None:
    """Nobody begins a stage before all have finished the last but one, and nobody waits for anything else."""
    assert plan.stages is not None
    rows = [i for i, name in enumerate(plan.members) if name not in plan.unscheduled]
    finish = np.zeros((len(plan), plan.stage_count + 1))
    for n in range(plan.stage_count):
        done = max((finish[i, n - 1] for i in rows), default=0.0) if n > 0 else 0.0
        for i in rows:
            way = np.hypot(*np.diff(plan.piece(i, n, n), axis=0).T).sum()
            finish[i, n + 1] = max(finish[i, n], done) + way / plan.speeds_m_s[i] if way > 0.0 else finish[i, n]
    for i in rows:
        times = plan.paths[i].times_s[plan.stages[i]]
        assert times == pytest.approx(finish[i])


def check_by_sampling(plan: Schedule, environment: Environment, rng: np.random.Generator, draws: int) -> None:
    """Members anywhere within two stages that follow each other: apart, and one network."""
    for n in range(plan.stage_count):
        ways = [plan.piece(i, n, min(n + 1, plan.stage_count - 1)) for i in range(len(plan))]
        places = np.stack([draw_on(way, draws, rng) for way in ways], axis=1)
        for i, j in combinations(range(len(plan)), 2):
            if min(plan.radii_m[[i, j]]) > 0.0:
                gaps = np.hypot(*(places[:, i] - places[:, j]).T)
                assert gaps.min() >= plan.radii_m[i] + plan.radii_m[j] - 1e-6
        for team in places:
            assert np.all(component_labels(environment.visibility_matrix(team)) == 0)


def draw_on(way: Floats, count: int, rng: np.random.Generator) -> Floats:
    """Places (count, 2) on a way, its ends among them."""
    covered = np.append(0.0, np.cumsum(np.hypot(*np.diff(way, axis=0).T)))
    at = rng.uniform(0.0, covered[-1], count)
    at[:2] = 0.0, covered[-1]
    at = rng.permutation(at)
    return np.stack([np.interp(at, covered, way[:, axis]) for axis in (0, 1)], axis=1)


@pytest.mark.parametrize(("name", "members"), [("room3", 5), ("office", 6), ("cityblocks", 4)])
def test_the_whole_team_stays_one_network_on_the_maps_of_the_thesis(name: str, members: int) -> None:
    environment, teams = team_of(name, members, 10)
    rng = np.random.default_rng(0)
    radii = np.append(0.0, np.full(members - 1, RADIUS))
    names = ["base", *(f"robot_{i}" for i in range(1, members))]
    found = 0
    for paths in teams:
        try:
            plan = schedule(paths, radii, environment, members=names)
        except NoSchedule as refusal:
            plan = refusal.best
            assert refusal.between is None or set(refusal.between) <= set(names)
            check_times(plan)
            assert certify(plan, environment).valid, refusal.text
        else:
            found += 1
            check(plan, environment, paths)
        check_by_sampling(plan, environment, rng, 8)
    assert found >= 4


@pytest.mark.parametrize("seed", range(6))
def test_many_cross_an_open_field(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ring = 6.0 * np.exp(2j * np.pi * (np.arange(10) / 10 + rng.uniform(-0.02, 0.02, 10)))
    goals = np.roll(ring, rng.integers(3, 7))
    paths = [np.array([[a.real, a.imag], [b.real, b.imag]]) for a, b in zip(ring, goals, strict=True)]
    plan = schedule(paths, 0.3)
    check(plan, OPEN_FIELD, paths, links=[])
    again = schedule(paths, 0.3)
    assert all(np.array_equal(p.times_s, q.times_s) for p, q in zip(plan.paths, again.paths, strict=True))


@pytest.mark.parametrize("seed", range(12))
def test_schedules_end_little_later_than_the_best_on_the_grid(seed: int) -> None:
    """Three members that cross; on the grid of box limits the search is complete."""
    rng = np.random.default_rng(seed)
    paths = [np.append(rng.uniform(0, 6, (1, 2)), rng.uniform(0, 6, (1, 2)), axis=0) for _ in range(3)]
    try:
        grid = schedule(paths, 0.3, search="grid")
    except NoSchedule:
        with pytest.raises(NoSchedule):
            schedule(paths, 0.3)
        return
    plan = schedule(paths, 0.3)
    check(plan, OPEN_FIELD, paths, links=[])
    assert plan.end_s <= 1.25 * grid.end_s


def test_robots_that_meet_in_a_corridor_block_each_other() -> None:
    paths = [[(3, 2.5), (18, 2.5)], [(18, 2.6), (3, 2.6)]]
    with pytest.raises(NoSchedule, match=r"^west .* and east are in each other's way, whichever goes first$") as caught:
        schedule(paths, RADIUS, CORRIDOR, members=["west", "east"])
    refusal = caught.value
    assert refusal.proven
    assert refusal.between == ("west", "east")
    assert certify(refusal.best, CORRIDOR).valid
    assert refusal.best.end_s > 1.0


def test_one_turns_off_into_the_bay_before_the_other_passes() -> None:
    paths = [np.array([(3, 2.5), (18, 2.5)]), np.array([(15, 2.5), (11, 2.5), (11, 0.5)])]
    plan = schedule(paths, RADIUS, CORRIDOR, [])
    check(plan, CORRIDOR, paths, links=[])
    assert plan.end_s == pytest.approx(15.0)
    late = schedule(paths, RADIUS, CORRIDOR, [], speed_m_s=[1.0, 0.2])
    check(late, CORRIDOR, paths, links=[])
    # 6 m at 0.2 m/s; the other is past the bay long before.
    assert late.end_s == pytest.approx(30.0)


def test_who_goes_around_a_corner_does_not_wait_for_long_pieces() -> None:
    """Four robots leave a room through its door, one behind the other, around a corner of many short pieces."""
    office = Environment.load(maps.path("office"))
    geodesics = GeodesicMap(office.inflated(RADIUS))
    starts = [(20.05, 14.71), (17.2, 15.5), (17.2, 15.93), (17.71, 16.02)]
    goals = [(26.5, 13.9), (24.7, 14.5), (22.8, 14.8), (21.8, 14.8)]
    paths = [geodesics.path(start, goal) for start, goal in zip(starts, goals, strict=True)]
    plan = schedule(paths, RADIUS, office, [])
    check(plan, office, paths, links=[])
    assert plan.end_s < 15.0  # 18.8 s where every robot drives one piece in each step


def test_a_relay_waits_at_the_corner_until_the_others_are_past() -> None:
    """The base sees no more than the corridor, so the relay must stand where it sees both ends."""
    paths = [np.array([(7.0, 2.5)]), np.array([(8, 2.5), (17, 2.5)]), np.array([(9, 2.5), (18, 2.5), (18, 0.5)])]
    plan = schedule(paths, RADIUS, CORRIDOR, members=["base", "relay", "scout"])
    check(plan, CORRIDOR, paths)
    with pytest.raises(NoSchedule) as caught:
        schedule([paths[0], paths[1][:1], paths[2]], RADIUS, CORRIDOR, members=["base", "relay", "scout"])
    assert caught.value.proven
    assert caught.value.between in {("scout", "base"), ("scout", "relay")}
    assert "scout" in str(caught.value)
    assert "would have to part where scout comes to (18, " in caught.value.text
    assert certify(caught.value.best, CORRIDOR).valid


def test_connection_may_be_asked_of_some_members_or_links_or_not_at_all() -> None:
    base, relay, away = np.array([(1, 2.5)]), np.array([(2, 2.5), (5, 2.5)]), np.array([(3, 2.5), (17, 2.5), (21, 4.5)])
    paths, names = [base, relay, away], ["base", "relay", "away"]
    with pytest.raises(NoSchedule):
        schedule(paths, RADIUS, CORRIDOR, members=names)
    plan = schedule(paths, RADIUS, CORRIDOR, members=names, joined=["base", "relay"])
    check(plan, CORRIDOR, paths, ends=["base", "relay"])
    linked = schedule(paths, RADIUS, CORRIDOR, [("base", "relay")], members=names)
    check(linked, CORRIDOR, paths, links=[(0, 1)])
    assert np.array_equal(linked.stages, schedule(paths, RADIUS, CORRIDOR, [(1, 0)]).stages)
    with pytest.raises(NoSchedule) as caught:
        schedule(paths, RADIUS, CORRIDOR, [("base", "away")], members=names)
    assert set(caught.value.between or ()) == {"base", "away"}
    check(schedule(paths, RADIUS, CORRIDOR, [], members=names), CORRIDOR, paths, links=[])
    check(schedule(paths, RADIUS, members=names), CORRIDOR, paths, links=[])


def test_who_goes_as_it_pleases_is_waited_for_nowhere_and_avoided_everywhere() -> None:
    paths = [np.array([(1.0, 2.5)]), np.array([(2, 2.5), (2, 4.5)]), np.array([(3, 1), (5, 1), (5, 4)])]
    names = ["base", "robot", "agent"]
    plan = schedule(paths, RADIUS, CORRIDOR, members=names, unscheduled=["agent"])
    check(plan, CORRIDOR, paths)
    assert plan.unscheduled == {"agent"}
    assert plan.paths[2].times_s[-1] == pytest.approx(5.0)
    crossing = np.array([(2, 2.5), (4, 2.5), (5.5, 2.5)])
    with pytest.raises(NoSchedule) as caught:
        schedule([paths[0], crossing, paths[2]], RADIUS, CORRIDOR, members=names, unscheduled=[2])
    assert caught.value.between == ("robot", "agent")
    schedule([paths[0], crossing, paths[2]], RADIUS, CORRIDOR, members=names)


def test_speeds_are_each_ones_own() -> None:
    paths = [np.array([(0, 0), (4, 0)]), np.array([(0, 2), (4, 2)])]
    plan = schedule(paths, 0.2, speed_m_s=[0.5, 2.0])
    assert [path.times_s[-1] for path in plan.paths] == pytest.approx([8.0, 2.0])
    assert plan.stage_count == 1
    still = schedule([[(0, 0)], [(1, 1)]], 0.2)
    assert (still.stage_count, still.end_s) == (1, 0.0)


@pytest.mark.parametrize(
    ("paths", "text"),
    [
        ([[(3, 2.5), (5, 2.5)], [(3.1, 2.5)]], r"^0 at \(3, 2.5\) and 1 at \(3.1, 2.5\) overlap at the start$"),
        ([[(3, 2.5), (5, 2.5)], [(21, 0.5)]], r"^0 at .* and 1 at .* are not in one network at the start$"),
        ([[(3, 2.5), (5, 2.5)], [(5, 2.5), (5.1, 2.5)]], r"^0 near .* and 1 are in each other's way, whichever"),
    ],
)
def test_refusals_name_the_pair_and_the_place(paths: list[list[tuple[float, float]]], text: str) -> None:
    with pytest.raises(NoSchedule, match=text) as caught:
        schedule(paths, RADIUS, CORRIDOR)
    assert caught.value.between == ("0", "1")
    assert caught.value.text == str(caught.value)
    assert caught.value.best.paths[0].waypoints[0] == pytest.approx(paths[0][0])


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"paths": []}, "give each one path"),
        ({"members": ["a"]}, "give each one path"),
        ({"members": ["a", "a"]}, "give each one path"),
        ({"paths": [[(0, 0)], []]}, "the path of 1 has no points"),
        ({"paths": [[(0, 0)], [(np.nan, 1)]]}, "the path of 1 has a point that is not finite"),
        ({"radius_m": -0.1}, "the radius of 0 is -0.1"),
        ({"radius_m": [0.1, np.inf]}, "the radius of 1 is inf"),
        ({"radius_m": [0.1] * 3}, "2 members have 3 values of radius"),
        ({"speed_m_s": [1.0, 0.0]}, "the greatest speed of 1 is 0: give a finite number, greater than 0"),
        ({"links": [("0", "2")]}, "on no map"),
        ({"links": [("0", "2")], "env": CORRIDOR}, "'2' is no member"),
        ({"links": [(1, 1)], "env": CORRIDOR}, "1 is asked to see itself"),
        ({"joined": [0, 1]}, "on no map"),
        ({"unscheduled": [5]}, "5 is no member of the schedule: it has 0, 1"),
    ],
)
def test_arguments_that_make_no_sense_are_refused_in_words(changed: dict[str, Any], text: str) -> None:
    arguments: dict[str, Any] = {"paths": [[(0, 0), (1, 0)], [(3, 3)]], "radius_m": 0.2}
    with pytest.raises(InvalidSchedule, match=text):
        schedule(**(arguments | changed))


def test_there_are_two_searches() -> None:
    with pytest.raises(ValueError, match="use 'order' or 'grid'"):
        schedule([[(0, 0)]], 0.2, search="best")  # type: ignore[arg-type]
    grid = schedule([[(0, 0), (5, 0)], [(2, -2), (2, 3)]], 0.2, search="grid")
    assert grid.stages is None
