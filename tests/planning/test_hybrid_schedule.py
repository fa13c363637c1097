"""Paths cut at cell borders against shapely; schedules that keep links from cell to cell against the certificate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from scipy.sparse import csr_array

import maps
from planning import (
    AdjacencyPaths,
    Cells,
    Environment,
    adjacency_schedule,
    decompose,
    hybrid_schedule,
    mutual_visibility,
)
from planning.certificate import certify
from planning.coordination_diagram import measure_path, place_on_path
from planning.geodesic import GeodesicMap
from planning.hybrid_schedule import cut_at_cells
from planning.motion_plan import Schedule
from planning.no_schedule import NoSchedule
from tests.planning.polygons import environment_of, free_points

Floats = NDArray[np.float64]

RADIUS_M = 0.2


@dataclass(frozen=True)
class Ground:
    """A map, its cells, and the free space of the robots' centres."""

    environment: Environment
    free: Environment
    cells: Cells
    seen: csr_array
    geodesics: GeodesicMap

    @classmethod
    def of(cls, environment: Environment, radius_m: float, kind: str = "inflection") -> Ground:
        cells = decompose(environment, kind)
        free = environment.inflated(radius_m)
        return cls(environment, free, cells, mutual_visibility(cells), GeodesicMap(free))


@cache
def ground(name: str) -> Ground:
    return Ground.of(Environment.load(maps.path(name)), RADIUS_M)


def draw_paths(of: Ground, robots: int, rng: np.random.Generator) -> list[Floats]:
    """Geodesics of robots that are near each other at the start and at the end, and do not overlap there."""
    ends = []
    for _ in range(2):
        while True:
            places = free_points(of.free, 1, rng) + np.vstack([np.zeros(2), rng.normal(0.0, 1.5, (robots - 1, 2))])
            gaps = np.linalg.norm(places[:, None] - places, axis=-1)[np.triu_indices(robots, 1)]
            if of.free.contains(places).all() and gaps.min() > 2.5 * RADIUS_M:
                break
        ends.append(places)
    return [of.geodesics.path(start, goal) for start, goal in zip(*ends, strict=True)]


@pytest.mark.parametrize("seed", range(8))
def test_pieces_lie_in_one_cell_each_and_no_cut_is_idle(seed: int) -> None:
    """By shapely: on rectilinear maps many ways run along borders and through corners."""
    environment = environment_of(seed)
    cells = decompose(environment, "aspect" if seed < 2 else "inflection")
    polygons = np.array([shapely.Polygon(polygon) for polygon in cells.polygons])
    geodesics = GeodesicMap(environment)
    rng = np.random.default_rng(seed)
    ends = free_points(environment, 8, rng)
    ends[::2] = environment.reflex_vertices[rng.integers(0, len(environment.reflex_vertices), 4)]
    for start, goal in ends.reshape(4, 2, 2):
        path = geodesics.path(start, goal)
        cuts = cut_at_cells(path, cells)
        bends = measure_path(path)
        assert set(bends) <= set(cuts)
        assert np.all(np.diff(cuts) > 0.0)
        homes = []
        for first, last in pairwise(cuts):
            ends_of_piece = place_on_path(path, np.array([first, last]))
            distances = shapely.distance(polygons[:, None], shapely.points(ends_of_piece)[None]).max(axis=1)
            homes.append(set(np.flatnonzero(distances < 1e-8)))
            assert homes[-1], (first, last)
        for cut, before, after in zip(cuts[1:-1], homes, homes[1:], strict=False):
            assert before != after or cut in bends


def test_a_robot_that_stands_has_one_place() -> None:
    cells = ground("room1").cells
    assert cut_at_cells([(1.0, 1.0)], cells).tolist() == [0.0]
    assert cut_at_cells([(1.0, 1.0), (1.0, 1.0)], cells).tolist() == [0.0]


def judge(of: Ground, found: Schedule, links: list[tuple[int, int]] | None) -> list[str]:
    named = None if links is None else [(found.members[i], found.members[j]) for i, j in links]
    return [violation.text for violation in certify(found, of.environment, links=named).violations]


@pytest.mark.parametrize("name", ["room1", "room3"])
@pytest.mark.parametrize("required", [True, False])
def test_schedules_are_certified(name: str, required: bool) -> None:
    """With the links of a line of robots, and with any links; a certificate knows nothing of cells."""
    of = ground(name)
    rng = np.random.default_rng(3)
    members = ["a", "b", "c"]
    found_any = refused_any = 0
    for _ in range(10):
        paths = draw_paths(of, 3, rng)
        links = [(1, 0), (1, 2)] if required else None
        try:
            found = hybrid_schedule(paths, RADIUS_M, of.cells, of.seen, links, members=members, most_nodes=20_000)
            found_any += 1
            ends = [path.waypoints[-1] for path in found.paths]
            np.testing.assert_allclose(ends, [path[-1] for path in paths], atol=1e-9)
        except NoSchedule as refusal:
            refused_any += 1
            if "starts" in refusal.text:
                continue
            found = refusal.best
        assert not judge(of, found, links)
    assert found_any > 1
    assert refused_any > 1


def test_at_every_time_the_cells_of_the_team_are_connected() -> None:
    """The visibility chain of thesis §4.3.4, by networkx, for adjacency paths of points."""
    environment = Environment.load(maps.path("room1"))
    cells = decompose(environment, "inflection")
    seen = mutual_visibility(cells)
    graph = nx.from_scipy_sparse_array(seen)
    planner = AdjacencyPaths(cells)
    rng = np.random.default_rng(1)
    found_any = 0
    for _ in range(25):
        first, last = rng.integers(0, len(cells), 2)
        starts, goals = (rng.choice(seen[[cell]].indices, 3) for cell in (first, last))
        ways = [planner.path(int(a), int(b)) for a, b in zip(starts, goals, strict=True)]
        try:
            found = adjacency_schedule(ways, 0.0, cells, seen, members=["a", "b", "c"], most_nodes=20_000)
        except NoSchedule:
            continue
        found_any += 1
        for places in found.positions(np.linspace(0.0, found.end_s, 60)):
            assert nx.is_connected(graph.subgraph(cells.locate(places).tolist()))
        assert certify(found, environment).valid
    assert found_any > 5


def test_adjacency_paths_of_discs_are_scheduled_apart() -> None:
    of = ground("office")
    planner = AdjacencyPaths(of.cells, of.free)
    rng = np.random.default_rng(2)
    usable = np.flatnonzero(np.isfinite(planner.stops[:, 0]))
    found_any = 0
    for _ in range(12):
        ends = rng.choice(usable, 4, replace=False).reshape(2, 2).tolist()
        ways = [planner.path(*pair) for pair in ends]
        try:
            found = adjacency_schedule(ways, RADIUS_M, of.cells, of.seen, [], members=["a", "b"])
        except NoSchedule as refusal:
            assert refusal.proven
            continue
        found_any += 1
        assert not judge(of, found, [])
        assert [path.length_m >= way.length_m - 1e-9 for path, way in zip(found.paths, ways, strict=True)] == [True] * 2
    assert found_any > 5


def test_what_cells_do_not_see_is_refused_with_the_pair() -> None:
    """Two rooms and a door: who stays in his room loses the one who leaves through the door and goes aside."""
    rooms = Environment(
        [(0, 0), (8, 0), (8, 3), (8.2, 3), (8.2, 0), (16, 0), (16, 8), (8.2, 8), (8.2, 5), (8, 5), (8, 8), (0, 8)]
    )
    of = Ground.of(rooms, RADIUS_M)
    stays, leaves = np.array([(2.0, 4.0)]), np.array([(7.0, 4.0), (9.0, 4.0), (9.0, 7.0)])
    members = ["base", "robot"]
    with pytest.raises(NoSchedule, match=r"base at \(2, 4\) and robot at \(9, 7\) would have to part") as refusal:
        hybrid_schedule([stays, leaves], RADIUS_M, of.cells, of.seen, [(0, 1)], members=members)
    assert refusal.value.between == ("base", "robot")
    assert refusal.value.proven
    assert not judge(of, refusal.value.best, [(0, 1)])
    assert refusal.value.best.end_s > 0.0
    # A third that follows as far as the door keeps the network, and nobody keeps all links.
    paths = [stays, leaves, np.array([(6.0, 4.0), (10.0, 4.0)])]
    found = hybrid_schedule(paths, RADIUS_M, of.cells, of.seen, None, members=[*members, "relay"])
    assert not judge(of, found, None)
    with pytest.raises(NoSchedule):
        hybrid_schedule(paths, RADIUS_M, of.cells, of.seen, [(0, 1), (1, 2)], members=[*members, "relay"])
    joined = hybrid_schedule(paths, RADIUS_M, of.cells, of.seen, joined=(0, 2), members=[*members, "relay"])
    assert not judge(of, joined, [(0, 2)])


def test_a_member_that_may_be_anywhere_is_seen_wherever_it_is() -> None:
    of = ground("room1")
    rng = np.random.default_rng(5)
    kept = 0
    for _ in range(15):
        paths = draw_paths(of, 2, rng)
        try:
            found = hybrid_schedule(
                paths, 0.0, of.cells, of.seen, [(0, 1)], members=["agent", "robot"], unscheduled=(0,)
            )
        except NoSchedule:
            continue
        kept += 1
        length = measure_path(paths[0])[-1]
        anywhere = place_on_path(paths[0], rng.uniform(0.0, length, 300))
        there = found.positions(rng.uniform(0.0, found.end_s, 300))[:, 1]
        assert of.environment.line_of_sight(anywhere, there).all()
    assert kept > 1
