"""Paths of different classes against all paths of the visibility graph, sorted into classes by their winding."""

from __future__ import annotations

import math
from itertools import combinations, pairwise

import networkx as nx
import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from planning.environment import Environment
from planning.geodesic import GeodesicMap
from planning.homotopy import TautPaths
from tests.planning.polygons import environment_of, free_points

Floats = NDArray[np.float64]


def length_of(path: Floats) -> float:
    return sum(math.dist(a, b) for a, b in pairwise(path.tolist()))


def pillars(seed: int) -> tuple[Environment, Floats, Floats]:
    """A room with one to three pillars, none above another, and two points at its left and right end."""
    rng = np.random.default_rng(seed)
    count = 1 + seed % 3
    holes = []
    for i in range(count):
        x, y = 2.0 + 10.0 / count * i + rng.uniform(0.0, 1.0), rng.uniform(1.0, 6.5)
        w, h = rng.uniform(0.5, 2.0), rng.uniform(0.5, 2.5)
        holes.append([(x, y), (x + w, y), (x + w, y + h), (x, y + h)])
    room = Environment([(0, 0), (14, 0), (14, 10), (0, 10)], holes)
    return room, rng.uniform((0.2, 0.2), (1.8, 9.8)), rng.uniform((12.6, 0.2), (13.8, 9.8))


def winding(path: Floats, centres: Floats) -> tuple[int, ...]:
    """How often a path, closed over a point far below, goes around each centre: in whole turns."""
    closed = np.concatenate([path, [[path[-1, 0], -1000.0], [path[0, 0], -1000.0], path[0]]])
    angles = np.arctan2(*(closed[:, None] - centres).transpose(2, 0, 1)[::-1])
    turns = np.diff(angles, axis=0)
    turns = (turns + np.pi) % (2.0 * np.pi) - np.pi
    return tuple(np.round(turns.sum(axis=0) / (2.0 * np.pi)).astype(int).tolist())


def best_of_each_class(room: Environment, p: Floats, q: Floats, longest: float) -> dict[tuple[int, ...], float]:
    """Of all simple paths over the pillars' corners: the length of the shortest of each winding."""
    points = np.array([p, q, *room.reflex_vertices])
    solid = shapely.union_all([shapely.Polygon(hole) for hole in room.holes]).buffer(-1e-9)
    graph: nx.Graph[int] = nx.Graph()
    for i, j in combinations(range(len(points)), 2):
        if not shapely.LineString(points[[i, j]]).intersects(solid):
            graph.add_edge(i, j, weight=math.dist(points[i], points[j]))
    bound = longest * nx.dijkstra_path_length(graph, 0, 1)
    centres = np.array([np.mean(hole, axis=0) for hole in room.holes])
    best: dict[tuple[int, ...], float] = {}

    def extend(way: list[int], covered: float) -> None:
        for node, data in graph[way[-1]].items():
            further = covered + data["weight"]
            if node in way or further + math.dist(points[node], q) > bound:
                continue
            if node == 1 and shapely.LineString(points[[*way, 1]]).is_simple:
                kind = winding(points[[*way, 1]], centres)
                best[kind] = min(best.get(kind, math.inf), further)
            elif node != 1:
                extend([*way, node], further)

    extend([0], 0.0)
    return best


@pytest.mark.parametrize("seed", range(8))
def test_the_shortest_of_each_class_against_all_paths(seed: int) -> None:
    room, p, q = pillars(seed)
    expected = sorted(best_of_each_class(room, p, q, 1.6).values())
    found = TautPaths(GeodesicMap(room)).paths(p, q, 50, longest=1.6)
    assert [length_of(path) for path in found] == pytest.approx(expected)


def test_around_each_pillar_on_either_side() -> None:
    room = Environment(
        [(0, 0), (12, 0), (12, 6), (0, 6)], [[(3, 2), (4, 2), (4, 4), (3, 4)], [(8, 2), (9, 2), (9, 4), (8, 4)]]
    )
    taut = TautPaths(GeodesicMap(room))
    found = taut.paths((1, 3), (11, 3), 4)
    assert {taut.word(path) for path in found} == {(), (1,), (2,), (1, 2)}
    assert [length_of(path) for path in found] == sorted(length_of(path) for path in found)
    # Once around the first pillar, and on below the second.
    loop = [(1, 3), (1, 5), (5, 5), (5, 1), (1, 1), (1, 5), (5, 5), (5, 1), (11, 1)]
    assert taut.word(loop) == (1, 1)
    assert taut.word([*reversed(loop)]) == (-1, -1)
    assert taut.word(loop[:3] + loop[:3][::-1]) == ()


def test_classes_that_wind_alike_are_told_apart() -> None:
    """Around a, around b, and back around each: no turn in all, yet it cannot be pulled straight."""
    room = Environment(
        [(0, 0), (12, 0), (12, 6), (0, 6)], [[(3, 2), (4, 2), (4, 4), (3, 4)], [(8, 2), (9, 2), (9, 4), (8, 4)]]
    )
    taut = TautPaths(GeodesicMap(room))
    a, b = [(6, 3), (6, 5), (2, 5), (2, 1), (6, 1), (6, 3)], [(6, 3), (6, 5), (10, 5), (10, 1), (6, 1), (6, 3)]
    commutator = [*a, *b, *a[::-1], *b[::-1]]
    assert winding(np.array(commutator, dtype=np.float64), np.array([[3.5, 3.0], [8.5, 3.0]])) == (0, 0)
    assert taut.word(commutator) == (-1, 2, 1, -2)


@pytest.mark.parametrize("seed", range(6))
def test_on_any_map_paths_are_free_taut_and_of_different_classes(seed: int) -> None:
    room = environment_of(seed)
    rng = np.random.default_rng(seed)
    geodesics = GeodesicMap(room)
    taut = TautPaths(geodesics)
    for p, q in free_points(room, 12, rng).reshape(-1, 2, 2):
        found = taut.paths(p, q, 4, longest=3.0)
        assert length_of(found[0]) == pytest.approx(geodesics.length(p, q))
        assert len({taut.word(path) for path in found}) == len(found)
        lengths = [length_of(path) for path in found]
        assert lengths == sorted(lengths) and lengths[-1] <= 3.0 * lengths[0] + 1e-6
        for path in found:
            assert np.array_equal(path[0], p) and np.array_equal(path[-1], q)
            for a, b in pairwise(path):
                assert room.line_of_sight(a, b)


def test_no_holes_no_classes_and_effort_is_a_bound() -> None:
    room = Environment([(0, 0), (6, 0), (6, 6), (4, 6), (4, 2), (2, 2), (2, 6), (0, 6)])
    assert len(TautPaths(GeodesicMap(room)).paths((1, 5), (5, 5), 5)) == 1
    pillar, p, q = pillars(0)
    assert len(TautPaths(GeodesicMap(pillar)).paths(p, q, 5, effort=0)) == 1
