"""The certificate by progress against motions known by hand, and against networkx and shapely on random ones."""

from __future__ import annotations

from itertools import combinations

import networkx as nx
import numpy as np
import pytest
import shapely
from numpy.typing import ArrayLike

import maps
from planning.certificate import certify
from planning.certificate_hull import see_throughout
from planning.certificate_sight import recede_walls
from planning.certificate_window import find_networks
from planning.environment import Environment
from planning.motion_plan import InvalidSchedule, Schedule, TimedPath
from planning.visible_interval import sees_throughout
from tests.planning.polygons import environment_of, free_points, wall_points
from tests.planning.schedule_mutants import Ground
from tests.planning.stage_mutants import breaks_by_turns, breaks_the_rule, random_staged, staged_mutants

PILLAR = Environment([(0, 0), (8, 0), (8, 8), (0, 8)], [[(3, 3), (5, 3), (5, 5), (3, 5)]])
ROOM = Environment([(0, 0), (20, 0), (20, 20), (0, 20)])
ROOM_AROUND = Environment(ROOM.outer - 10.0)


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


def test_two_unscheduled_are_not_held_against_each_other() -> None:
    """Robots that were lost, whose ways cross: nobody can keep them apart, and the others must be able to go on."""
    ways = [TimedPath.standing((1, 1)), TimedPath([(1, 7), (7, 7)], [0, 6]), TimedPath([(7, 7), (1, 7)], [0, 6])]
    stages = [[0] * 5, [0, 0, 0, 0, 1], [0, 0, 0, 0, 1]]
    names = ["robot", "lost", "lost too"]
    assert certify(Schedule(names, ways, 0.2, 1.0, stages, names[1:]), PILLAR, links=[]).valid
    assert not certify(Schedule(names, ways, 0.2, 1.0, stages, names[2:]), PILLAR, links=[]).valid


@pytest.mark.parametrize("names", [("robot", 2), (0, -1), ("robot", "walker")])
def test_rows_and_names_that_do_not_exist_are_refused(names: tuple[str | int, str | int]) -> None:
    schedule = Schedule(["robot", "agent"], [TimedPath.standing((1, 1))] * 2, 0.0)
    with pytest.raises(InvalidSchedule, match="is no member of the schedule: it has robot, agent"):
        certify(schedule, PILLAR, ends=names)


def test_pieces_are_those_of_the_schedule_and_their_distances_those_of_shapely() -> None:
    rng = np.random.default_rng(3)
    for _ in range(40):
        count = int(rng.integers(2, 5))
        points = [np.round(rng.uniform(0.0, 4.0, (rng.integers(1, 5), 2)), int(rng.integers(0, 3))) for _ in range(4)]
        stages = [np.sort(rng.integers(0, len(way), count + 1)) for way in points]
        for row, way in zip(stages, points, strict=True):
            row[0], row[-1] = 0, len(way) - 1
        paths = [TimedPath(way, np.arange(len(way)) * 1e3) for way in points]
        schedule = Schedule(list("abcd"), paths, 0.3, 1.0, stages, ["d"])
        found = {
            (violation.stage, violation.members): violation
            for violation in certify(schedule, ROOM_AROUND, links=[]).violations
            if violation.kind == "collision"
        }
        for i, j in combinations(range(4), 2):
            near = []
            for n in range(count - 1):
                one, other = (schedule.piece(row, n, n + 1) for row in (i, j))
                lines = [shapely.LineString(way[[0, *range(len(way))]]) for way in (one, other)]
                near.append(shapely.distance(*lines) < 0.6)
                violation = found.pop((n, ("abcd"[i], "abcd"[j])), None)
                # One for each run of stages.
                assert (violation is not None) == (near[-1] and not any(near[-2:-1]))
                if violation is not None:
                    x, y = (float(word.strip("(),")) for word in violation.text.split()[-2:])
                    at = shapely.Point(x, y)
                    assert shapely.distance(at, lines[0]) < 1e-4
                    assert shapely.distance(at, lines[1]) < shapely.distance(*lines) + 1e-4
        assert not found


@pytest.mark.parametrize("seed", range(6))
def test_hulls_are_free_where_the_planners_say_so_and_nowhere_else(seed: int) -> None:
    """Not stricter than they are, and not laxer by more than the depth makes."""
    environment = environment_of(seed)
    rng = np.random.default_rng(seed)
    depth = 2.0 * environment.tolerance_m
    walls = recede_walls(environment.walls, environment.successors, depth)
    wider = environment.polygon.buffer(2.0 * depth, join_style="mitre", mitre_limit=20.0)
    ends = np.concatenate([free_points(environment, 20, rng), wall_points(environment, 20, rng)])
    free = 0
    for _ in range(200):
        one = ends[rng.integers(0, len(ends), 1 + int(rng.integers(2)))]
        near = ends[np.argsort(np.hypot(*(ends - one[0]).T))[:12]]
        other = near[rng.integers(0, len(near), 1 + int(rng.integers(2)))]
        if not all(environment.line_of_sight(way[0], way[-1]) for way in (one, other)):
            continue
        certain = see_throughout(one, other, walls)
        assert certain >= sees_throughout(environment, one[[0, -1]], other[[0, -1]])
        hull = shapely.MultiPoint(np.concatenate([one, other])).convex_hull
        assert not certain or shapely.distance(wider.boundary, hull) > 0.0
        free += certain
    assert free > 20


def test_networks_are_those_of_all_links_that_hold() -> None:
    rng = np.random.default_rng(4)
    parted = 0
    for seed in range(6):
        environment = environment_of(seed)
        depth = 2.0 * environment.tolerance_m
        walls = recede_walls(environment.walls, environment.successors, depth)
        for _ in range(10):
            ways = [np.repeat(place, 2, axis=0) for place in free_points(environment, 6, rng)[:, None]]
            for way in ways:
                farther = way[1] + rng.normal(0.0, 0.5, 2)
                way[1] = farther if environment.line_of_sight(way[0], farther) else way[1]
            points = np.concatenate(ways)
            first, last = 2 * np.arange(6)[:, None], 2 * np.arange(6)[:, None] + 1
            asked = rng.permutation(6)[: rng.integers(2, 7)]
            pairs = rng.permutation(np.column_stack(np.triu_indices(6, 1)))[None]
            parts, links = find_networks(points, first, last, pairs, asked, walls)
            network = nx.empty_graph(6)
            network.add_edges_from(
                (i, j) for i, j in combinations(range(6), 2) if see_throughout(ways[i], ways[j], walls)
            )
            joined = nx.node_connected_component(network, int(asked[0])) >= set(asked.tolist())
            assert joined == (len({int(parts[0, i]) for i in asked}) == 1)
            assert all(network.has_edge(i, j) for i, j in links[0] if i >= 0)
            if not joined:
                parted += 1
                assert parts[0].tolist() == [min(nx.node_connected_component(network, i)) for i in range(6)]
    assert 10 < parted < 50


@pytest.mark.parametrize("seed", range(3))
def test_no_mutant_is_accepted_that_breaks_the_rule_and_none_is_refused_without_cause(seed: int) -> None:
    rng = np.random.default_rng(seed)
    name, radius = [("cityblocks", 0.2), ("", 0.12), ("", 0.1)][seed]
    ground = Ground(Environment.load(maps.path(name)) if name else environment_of(seed), radius)
    accepted = refused = 0
    while accepted + refused < 14:
        schedule = random_staged(ground, 3, rng)
        if schedule is None:
            continue
        for kind, mutant in [("none", schedule), *staged_mutants(schedule, rng, 6)]:
            certificate = certify(mutant, ground.environment)
            broken = breaks_the_rule(ground, mutant)
            assert certificate.valid == (not broken), (kind, broken, certificate)
            if certificate.valid:
                accepted += 1
                assert not breaks_by_turns(ground, mutant, rng), kind
            else:
                refused += 1
    assert min(accepted, refused) >= 1
