"""The certificate against motions known by hand, against sampling, and against the planners' own geometry."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import maps
from planning import line_of_sight
from planning.certificate import Certificate, certify
from planning.certificate_sight import recede_walls, watch
from planning.environment import Environment
from planning.motion_plan import InvalidSchedule, Schedule, TimedPath
from planning.visible_interval import visible_intervals
from tests.planning.polygons import environment_of, free_points, wall_points
from tests.planning.schedule_mutants import (
    Ground,
    broken_rules,
    drive,
    mutants,
    random_schedule,
    sample_times,
    truly_broken,
)

Floats = NDArray[np.float64]
FOLDER = Path(__file__).parents[2] / "planning"

PILLAR = Environment([(0, 0), (8, 0), (8, 8), (0, 8)], [[(3, 3), (5, 3), (5, 5), (3, 5)]])
ROOM = Environment([(0, 0), (20, 0), (20, 20), (0, 20)])


def test_the_certificate_shares_no_code_with_the_planners() -> None:
    files = sorted(FOLDER.glob("certificate*.py"))
    assert len(files) >= 3
    for file in [*files, FOLDER / "motion_plan.py"]:
        tree = ast.parse(file.read_text(encoding="utf-8"))
        ours = {
            node.module or ""
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("planning")
        }
        assert not any(isinstance(node, ast.Import) and "planning" in ast.unparse(node) for node in ast.walk(tree))
        allowed = {"planning.kernel", "planning.motion_plan"} if file in files else set()
        # Of the map only its walls are used; the class is named for the type checker alone.
        assert {name for name in ours if not name.startswith("planning.certificate")} <= allowed | {
            "planning.environment"
        }
        for node in tree.body:
            assert not (isinstance(node, ast.ImportFrom) and node.module == "planning.environment"), file


def team(*paths: TimedPath, radii: object = 0.2, speeds: object = 1.0) -> Schedule:
    return Schedule([f"robot_{i}" for i in range(len(paths))], paths, radii, speeds)  # type: ignore[arg-type]


def only(certificate: Certificate) -> tuple[str, float, float, tuple[str, ...]]:
    assert len(certificate.violations) == 1, certificate
    violation = certificate.violations[0]
    assert certificate.holds_until_s == violation.time_s
    assert not certificate.valid
    return violation.kind, violation.time_s, violation.until_s, violation.members


def test_a_link_around_a_pillar_is_lost_and_found() -> None:
    one, other = TimedPath([(1, 1), (1, 7)], [0, 6]), TimedPath([(7, 1), (7, 7)], [0, 6])
    lost = ("connection", pytest.approx(2.0), pytest.approx(4.0), ("robot_0", "robot_1"))
    assert only(certify(team(one, other), PILLAR)) == lost
    assert only(certify(team(one, other), PILLAR, links=[("robot_1", "robot_0")])) == lost
    assert only(certify(team(one, other), PILLAR, ends=("robot_0", "robot_1"))) == lost
    assert certify(team(one, other), PILLAR, links=[]).valid
    assert certify(team(one, other, TimedPath.standing((4, 1))), PILLAR).valid  # below the pillar: sees both


# Up around the pillar and down behind it: out of sight of (1, 7) below y = 4, in sight of (1, 1) from there on.
AROUND = TimedPath([(2, 7), (7, 7), (7, 1)], [0, 5, 11])


def test_who_parts_is_named() -> None:
    base, near = TimedPath.standing((1, 3.5)), TimedPath.standing((1, 7))
    certificate = certify(Schedule(["base", "near", "far"], [base, near, AROUND], [0, 0.2, 0.2], 1.0), PILLAR)
    found = ("connection", pytest.approx(8.0), pytest.approx(10.0), ("near", "far"))
    assert only(certificate) == found
    assert certificate.violations[0].text == (
        "as near and far lose sight of each other, the team is parted from 8 s on: base + near | far"
    )


def test_links_may_take_over_from_each_other_in_one_instant() -> None:
    near = TimedPath.standing((1, 7))
    for ends in (None, ("robot_0", "robot_2")):
        schedule = team(TimedPath.standing((1, 1)), near, AROUND)
        assert certify(schedule, PILLAR, ends=ends).valid
        schedule = team(TimedPath.standing((1, 1 + 1e-5)), near, AROUND)
        assert only(certify(schedule, PILLAR, ends=ends))[1] == pytest.approx(8.0)


def test_without_motion_the_places_are_judged() -> None:
    places = [(1, 1), (1, 7), (7, 7)]
    assert certify(team(*map(TimedPath.standing, places)), PILLAR).valid
    assert only(certify(team(*map(TimedPath.standing, places[::2])), PILLAR))[:3] == ("connection", 0.0, np.inf)
    assert (
        only(certify(team(*map(TimedPath.standing, places[::2])), PILLAR, links=[("robot_0", "robot_1")]))[2] == np.inf
    )


@pytest.mark.parametrize("offset", [0.0, 5e5])
@pytest.mark.parametrize(
    ("p", "q", "holds"),
    [
        ([(1, 3), (1, 3)], [(7, 3), (7, 3)], True),  # along a wall for good
        ([(1, 3), (2, 3)], [(7, 3), (6, 3)], True),  # and moving along it
        ([(2, 2), (1, 1)], [(6, 6), (7, 7)], False),  # through two corners into the pillar, touching no wall's inside
        ([(1, 5), (2, 4)], [(5, 1), (4, 2)], True),  # through a corner past it
        ([(1, 1), (1, 3)], [(7, 1), (7, 3)], True),  # until the wall is reached
        ([(1, 1), (1, 3.00001)], [(7, 1), (7, 3.00001)], False),  # and a hundredth of a millimetre farther
        ([(3, 3), (1, 3)], [(3, 3), (3, 1)], True),  # parting from a corner
        ([(0, 0), (0, 8)], [(8, 8), (8, 0)], False),  # crosswise along outer walls
        ([(0, 0), (0, 8)], [(0, 8), (0, 8)], True),  # along an outer wall
    ],
)
def test_sight_is_closed(
    p: list[tuple[float, float]], q: list[tuple[float, float]], holds: bool, offset: float
) -> None:
    walls = Environment(PILLAR.outer + offset, [PILLAR.holes[0] + offset])
    paths = [TimedPath(np.array(points) + offset, [0, 10]) for points in (p, q)]
    assert certify(team(*paths, radii=0.0), walls).valid is holds


def test_collisions_are_found_to_the_instant() -> None:
    one, other = TimedPath([(1, 10), (11, 10)], [0, 10]), TimedPath([(6, 5), (6, 15)], [0, 10])
    kind, start, end, members = only(certify(team(one, other, radii=0.5), ROOM))
    assert (kind, members) == ("collision", ("robot_0", "robot_1"))
    half = 1.0 / np.sqrt(2.0)  # they near each other at √2 m/s and are 1 m apart at 5 ± 1/√2 s
    assert (start, end) == (pytest.approx(5.0 - half), pytest.approx(5.0 + half))
    assert certify(team(one, other, radii=[0.5, 0.0]), ROOM).valid  # the other has no body
    later = TimedPath(other.waypoints, other.times_s + np.sqrt(2.0))
    assert certify(team(one, later, radii=0.5), ROOM).valid  # they touch
    sooner = TimedPath(other.waypoints, other.times_s + np.sqrt(2.0) - 1e-6)
    assert only(certify(team(one, sooner, radii=0.5), ROOM))[0] == "collision"


def test_those_who_stand_on_each_other_do_so_for_good() -> None:
    one, other = TimedPath.standing((5, 5)), TimedPath([(9, 5), (5.5, 5)], [0, 7])
    assert only(certify(team(one, other, radii=0.4), ROOM))[2] == np.inf
    assert only(certify(team(one, TimedPath.standing((5.5, 5)), radii=0.4), ROOM))[1:3] == (0.0, np.inf)


def test_walls_are_kept_away_from() -> None:
    beside = TimedPath([(1, 0.5), (19, 0.5)], [0, 18])
    assert certify(team(beside, radii=0.5), ROOM).valid
    assert only(certify(team(beside, radii=0.50001), ROOM)) == ("wall", 0.0, np.inf, ("robot_0",))
    past = TimedPath([(1, 2.8), (7, 2.8)], [5, 11])
    kind, start, end, _ = only(certify(team(past, radii=0.5), PILLAR))
    reach = np.sqrt(0.25 - 0.04)
    assert (kind, start, end) == ("wall", pytest.approx(7.0 - reach), pytest.approx(9.0 + reach))
    through = TimedPath([(1, 4), (7, 4)], [0, 6])
    for radius in (0.0, 0.5):
        kind, start, end, _ = only(certify(team(through, radii=radius), PILLAR))
        assert (kind, start, end) == ("wall", pytest.approx(2.0 - radius), pytest.approx(4.0 + radius))
    for outside in ((4, 4), (9, 9), (-1, 3)):
        assert only(certify(team(TimedPath.standing(outside), radii=0.0), PILLAR)) == (
            "wall",
            0.0,
            np.inf,
            ("robot_0",),
        )
    for on_wall in ((3, 4), (3, 3), (0, 0), (8, 4)):
        assert certify(team(TimedPath.standing(on_wall), radii=0.0), PILLAR).valid


def test_speeds_are_kept() -> None:
    quick = TimedPath([(1, 1), (2, 1), (4, 1), (4, 3)], [0, 1, 2, 4])
    assert only(certify(team(quick), ROOM)) == ("speed", 1.0, 2.0, ("robot_0",))
    assert certify(team(quick, speeds=2.0), ROOM).valid
    assert not certify(team(quick, speeds=2.0), ROOM, speed_m_s=1.9).valid


def test_the_judge_may_have_radii_of_its_own() -> None:
    beside = team(TimedPath([(1, 0.5), (19, 0.5)], [0, 18]), radii=0.1)
    assert certify(beside, ROOM).valid
    assert not certify(beside, ROOM, 0.6).valid


def test_what_is_no_member_is_refused() -> None:
    schedule = team(TimedPath.standing((1, 1)))
    with pytest.raises(InvalidSchedule, match="'base' is no member of the schedule: it has robot_0"):
        certify(schedule, ROOM, links=[("robot_0", "base")])
    with pytest.raises(InvalidSchedule, match="'robot_0' is asked to be joined to itself"):
        certify(schedule, ROOM, ends=("robot_0", "robot_0"))
    with pytest.raises(InvalidSchedule, match="radius"):
        certify(schedule, ROOM, -1.0)


def test_a_sight_line_that_stays_undecided_is_refused_soon() -> None:
    """Both move along the very line of a receded wall: no bound can tell, and nothing is halved without end."""
    depth = 2.0 * PILLAR.tolerance_m
    walls = recede_walls(PILLAR.walls, PILLAR.successors, depth)
    y = walls[PILLAR.walls[:, :, 1].tolist().index([3.0, 3.0]), 0, 1]
    p, q = np.array([(1.0, y), (2.0, y)]), np.array([(7.0, y), (6.0, y)])
    assert len(watch(np.array([0.0, 1.0]), p, q, walls, depth)) == 0


@given(seed=st.integers(0, 10_000))
@settings(max_examples=30)
def test_sight_agrees_with_the_closed_form_of_the_planners(seed: int) -> None:
    """Not below it, so that what planners find passes; not above it by more than the depth makes."""
    environment = environment_of(seed)
    rng = np.random.default_rng(seed)
    depth = 2.0 * environment.tolerance_m
    walls = recede_walls(environment.walls, environment.successors, depth)
    ends = np.concatenate([free_points(environment, 30, rng), wall_points(environment, 10, rng)])
    for _ in range(40):
        p, q = ends[rng.integers(0, len(ends), (2, 2))]
        if not environment.line_of_sight(np.stack([p[0], q[0]]), np.stack([p[1], q[1]])).all():
            continue
        certain = watch(np.array([0.0, 1.0]), p, q, walls, depth)
        for start, end in visible_intervals(environment, p, q):
            assert np.any((certain[:, 0] <= start + 1e-12) & (end - 1e-12 <= certain[:, 1])), (seed, p, q)
        times = rng.uniform(0.0, 1.0, 300)
        inside = ((certain[:, :1] <= times) & (times <= certain[:, 1:])).any(axis=0)
        places = [points[0] + times[:, None] * (points[1] - points[0]) for points in (p, q)]
        wide = line_of_sight.segments_are_visible(*places, environment.walls, 20.0 * environment.tolerance_m)
        assert not np.any(inside & ~wide)


@pytest.mark.parametrize("name", ["room3", "maze", "l457", "office"])
def test_receded_walls_enclose_free_space_closely(name: str) -> None:
    environment = Environment.load(maps.path(name))
    depth = 1e-3
    walls = recede_walls(environment.walls, environment.successors, depth)
    rings = [walls[a:b, 0] for a, b in zip(environment.ring_starts[:-1], environment.ring_starts[1:], strict=True)]
    wider = shapely.Polygon(rings[0], rings[1:])
    assert wider.is_valid
    assert wider.contains(environment.polygon.buffer(0.05 * depth))
    assert environment.polygon.buffer(10.1 * depth, join_style="mitre", mitre_limit=20.0).contains(wider)


@pytest.mark.parametrize("seed", range(4))
def test_no_mutant_is_accepted_that_sampling_refutes_and_none_is_refused_without_cause(seed: int) -> None:
    rng = np.random.default_rng(seed)
    name, radius = [("cityblocks", 0.2), ("office", 0.2), ("", 0.12), ("", 0.1)][seed % 4]
    ground = Ground(Environment.load(maps.path(name)) if name else environment_of(seed), radius)
    accepted = refused = 0
    while accepted + refused < 42:
        schedule = random_schedule(ground, 3, rng)
        if schedule is None:
            continue
        for kind, mutant in [("none", schedule), *mutants(schedule, rng, 6)]:
            certificate = certify(mutant, ground.environment)
            if certificate.valid:
                accepted += 1
                broken = broken_rules(ground, mutant, sample_times(mutant, 1e-3))
                assert not broken, (kind, broken)
            else:
                refused += 1
                assert truly_broken(ground, mutant, certificate), (kind, certificate)
    assert min(accepted, refused) >= 4


def test_schedules_that_stop_at_the_last_instant_pass() -> None:
    """A robot goes as far as the closed form of the planners says, and stays: its sight grazes a corner for good."""
    rng = np.random.default_rng(5)
    judged = 0
    for seed in range(1, 30):
        environment = environment_of(seed)
        for p, q in free_points(environment, 120, rng).reshape(-1, 2, 2, 2):
            seen = visible_intervals(environment, p, q[[0, 0]])
            if not environment.line_of_sight(*p) or len(seen) == 0 or not 0.01 < seen[0, 1] < 0.99 or seen[0, 0] > 0.0:
                continue
            judged += 1
            stop = p[0] + seen[0, 1] * (p[1] - p[0])
            beyond = stop + 1e-4 * (p[1] - p[0])
            until = TimedPath([p[0], stop, stop], [0, 1, 2]), TimedPath.standing(q[0])
            assert certify(team(*until, radii=0.0, speeds=np.inf), environment).valid
            after = drive(np.array([p[0], beyond]), 0.0), TimedPath.standing(q[0])
            assert not certify(team(*after, radii=0.0, speeds=np.inf), environment).valid
    assert judged > 50
