"""Moves on roadmaps: against all deployments, with shapely to say who sees whom and who touches whom."""

from __future__ import annotations

from collections import deque
from itertools import pairwise

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from planning.connectivity import connected
from planning.environment import Environment
from planning.move_search import Crew, search_moves
from planning.team_roadmap import TeamRoadmap, extend_roadmap, find_mitres, make_roadmap, ring, watches
from tests.planning.polygons import environment_of, free_points

Floats = NDArray[np.float64]
RADIUS = 0.2


class Oracle:
    """What is allowed on a roadmap, by shapely alone."""

    def __init__(self, roadmap: TeamRoadmap, crew: Crew) -> None:
        room = roadmap.environment
        self._space = shapely.Polygon(room.outer, room.holes).buffer(1e-7)
        self._roadmap, self._crew = roadmap, crew

    def covers(self, *points: Floats) -> bool:
        return bool(self._space.covers(shapely.MultiPoint(np.concatenate(points)).convex_hull))

    def allows(self, at: tuple[int, ...], mover: int, to: int) -> bool:
        places, crew = self._roadmap.places, self._crew
        leg = places[[at[mover], to]]
        bodies = [leg if i == mover else places[[spot]] for i, spot in enumerate(at)]
        for i, body in enumerate(bodies):
            if i != mover and min(crew.radii_m[i], crew.radii_m[mover]) > 0.0:
                apart = shapely.LineString(leg).distance(shapely.Point(body[0]))
                if apart < crew.radii_m[i] + crew.radii_m[mover] - 1e-9:
                    return False
        if len(crew.joined) < 2:
            return True
        everybody: list[list[Floats]] = [[body] for body in bodies]
        everybody += [[path[i : i + 2] for i in range(len(path) - 1)] for path in crew.paths]
        n = len(everybody)
        links = np.zeros((n, n), dtype=bool)
        for i in range(n):
            for j in range(i):
                links[i, j] = links[j, i] = all(
                    self.covers(one, other) for one in everybody[i] for other in everybody[j]
                )
        reach = np.linalg.matrix_power(links.astype(int) + np.eye(n, dtype=int), n) > 0
        return bool(reach[np.ix_(list(crew.joined), list(crew.joined))].all())

    def reach(self, movers: int) -> dict[tuple[int, ...], int]:
        start = tuple(int(place) for place in self._crew.at)
        steps, waiting = {start: 0}, deque([start])
        while waiting:
            at = waiting.popleft()
            for mover in range(movers):
                for edge in self._roadmap.edges[np.any(self._roadmap.edges == at[mover], axis=1)]:
                    to = int(edge.sum()) - at[mover]
                    after = (*at[:mover], to, *at[mover + 1 :])
                    if after not in steps and self.allows(at, mover, to):
                        steps[after] = steps[at] + 1
                        waiting.append(after)
        return steps


def small_roadmap(seed: int, number: int) -> TeamRoadmap:
    room = environment_of(seed)
    free = room.inflated(RADIUS)
    return make_roadmap(room, free, free_points(free, number, np.random.default_rng(seed)))


@pytest.mark.parametrize("seed", range(6))
def test_every_deployment_that_can_be_reached_is_found_and_no_other(seed: int) -> None:
    roadmap = small_roadmap(seed, 9)
    rng = np.random.default_rng(seed)
    path = free_points(roadmap.environment, 1, rng)
    crew = next(
        crew
        for at in rng.permuted(np.tile(np.arange(9), (1000, 1)), axis=1)[:, :3]
        for crew in [Crew(at, np.array([RADIUS, RADIUS, 0.0]), (0, 1, 2), [path[[0, 0]]][: seed % 2])]
        if len(Oracle(roadmap, crew).reach(2)) > 4
    )
    reached = Oracle(roadmap, crew).reach(2)
    goals = [(a, b) for a in range(9) for b in range(9) if a != b]
    for goal in (goals[i] for i in rng.choice(len(goals), 25, replace=False)):
        moves = search_moves(roadmap, crew, np.array(goal), 10_000)
        assert moves.complete == ((*goal, int(crew.at[2])) in reached)
        oracle = Oracle(roadmap, crew)
        assert moves.places[0].tolist() == crew.at[:2].tolist()
        for before, after in pairwise(moves.places):
            (mover,) = np.flatnonzero(before != after)
            assert oracle.allows((*before.tolist(), int(crew.at[2])), int(mover), int(after[mover]))


@pytest.mark.parametrize("seed", range(4))
def test_a_place_watches_an_edge_if_the_triangle_is_free(seed: int) -> None:
    roadmap = small_roadmap(seed, 25)
    room = roadmap.environment
    space = shapely.Polygon(room.outer, room.holes)
    seen = 0
    for edge, (u, v) in enumerate(roadmap.edges):
        for place in range(edge % 5, 25, 5):
            points = roadmap.places[[u, v, place]]
            hull = shapely.MultiPoint(points).convex_hull
            watched = watches(
                edge, place, roadmap.places, roadmap.visible, roadmap.edges, room.vertices, room.tolerance_m,
                roadmap.watched,
            )  # fmt: skip
            # Where shapely is not sure either way nothing is said.
            if watched:
                assert space.buffer(1e-6).covers(hull)
                seen += 1
            else:
                assert not space.buffer(-1e-6).covers(hull)
    assert seen > 25


@pytest.mark.parametrize("seed", range(4))
def test_whoever_goes_as_it_pleases_is_watched_on_its_whole_path(seed: int) -> None:
    roadmap = small_roadmap(seed, 20)
    room = roadmap.environment
    space = shapely.Polygon(room.outer, room.holes)
    rng = np.random.default_rng(seed)
    a, b = next(pair for pair in rng.permutation(roadmap.edges) if np.ptp(roadmap.places[pair]) > 0.5)
    path = np.array([roadmap.places[a], roadmap.places[[a, b]].mean(axis=0), roadmap.places[b]])
    by_place, by_edge = roadmap.watch_path(path)
    bodies = [*roadmap.places[:, None], *roadmap.places[roadmap.edges]]
    assert by_place[[a, b]].all()
    for body, watched in zip(bodies, [*by_place, *by_edge], strict=True):
        hull = shapely.MultiPoint(np.concatenate([body, path])).convex_hull
        assert space.buffer(1e-6).covers(hull) if watched else not space.buffer(-1e-6).covers(hull)


@pytest.mark.parametrize("seed", range(4))
def test_an_extended_roadmap_is_connected_and_keeps_what_it_had(seed: int) -> None:
    room = environment_of(seed)
    free = room.inflated(RADIUS)
    rng = np.random.default_rng(seed)
    places = np.concatenate([free_points(free, 30, rng), find_mitres(room, free, RADIUS)])
    roadmap = make_roadmap(room, free, places)
    more = free_points(free, 10, rng)
    extended = extend_roadmap(roadmap, free, more)
    n, e = len(places), len(roadmap.edges)
    assert np.array_equal(extended.places, [*places, *more])
    assert np.array_equal(extended.edges[:e], roadmap.edges)
    assert np.array_equal(extended.visible, room.visibility_matrix(extended.places))
    assert (extended.edges[e:].max(axis=1) >= n).all()
    for u, v in extended.edges:
        assert free.line_of_sight(extended.places[u], extended.places[v])
    for place in range(n + 10):
        at = extended.at[extended.starts[place] : extended.starts[place + 1]]
        assert sorted(at) == sorted(np.flatnonzero(np.any(extended.edges == place, axis=1)))
    # As far as the places see each other in free space they are joined, if not too many are nearer.
    links = np.zeros((n, n), dtype=bool)
    links[roadmap.edges[:, 0], roadmap.edges[:, 1]] = links[roadmap.edges[:, 1], roadmap.edges[:, 0]] = True
    assert connected(links) == connected(free.visibility_matrix(places))


def test_mitres_see_along_both_walls_and_rings_go_around() -> None:
    room = Environment([(0, 0), (10, 0), (10, 4), (4, 4), (4, 10), (0, 10)])
    free = room.inflated(RADIUS)
    mitres = find_mitres(room, free, RADIUS)
    assert mitres == pytest.approx(np.array([[3.8, 3.8]]), abs=1e-3)
    assert free.line_of_sight(mitres[0], (9, 3.79)) and free.line_of_sight(mitres[0], (3.79, 9))
    around = ring(np.array([2.0, 2.0]), 0.4, free)
    assert len(around) == 6
    for a, b in pairwise([*around, around[0]]):
        assert 0.4 <= shapely.LineString([a, b]).distance(shapely.Point(2, 2)) < 0.41
    assert len(ring(np.array([0.3, 2.0]), 0.4, free)) < 6


def test_a_given_effort_ends_the_search_with_the_nearest_deployment() -> None:
    roadmap = small_roadmap(0, 30)
    crew = Crew(np.array([0, 1]), np.array([RADIUS, RADIUS]), ())
    ways = roadmap.lengths_to([2, 3])
    found = [search_moves(roadmap, crew, np.array([2, 3]), effort) for effort in (0, 2, 1000)]
    left = [ways[0, moves.places[-1][0]] + ways[1, moves.places[-1][1]] for moves in found]
    assert left[0] == ways[0, 0] + ways[1, 1] and left[0] > left[1] > left[2] == 0.0
    assert [moves.complete for moves in found] == [False, False, True]
    # With no greed the plan is as short as any on the roadmap.
    moves = search_moves(roadmap, crew, np.array([2, 3]), 100_000, greed=1.0)
    gone = sum(float(np.hypot(*(roadmap.places[b] - roadmap.places[a]).T).sum()) for a, b in pairwise(moves.places))
    assert gone == pytest.approx(left[0])
