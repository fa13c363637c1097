"""Adjacency paths against networkx, and their lines against shapely."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import networkx as nx
import numpy as np
import pytest
import shapely

import maps
from planning.adjacency_path import AdjacencyPaths
from planning.decomposition import Cells, decompose
from planning.environment import Environment
from planning.placement import reachable_positions
from planning.shortest_paths import NoPath
from tests.planning.polygons import environment_of

MAPS = ["room1", "room3", "office"]


def _cells(name: str) -> Cells:
    return decompose(Environment.load(maps.path(name)), "inflection")


def _graph(cells: Cells, penalty_m: float) -> Any:
    """The adjacency graph: an edge costs the distance of the centroids and the penalty."""
    graph: Any = nx.Graph()
    graph.add_nodes_from(range(len(cells)))
    for u, v in zip(*cells.adjacency.nonzero(), strict=True):
        length = float(np.linalg.norm(cells.centroids[u] - cells.centroids[v]))
        graph.add_edge(int(u), int(v), length=length, cost=length + penalty_m)
    return graph


@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("penalty_m", [0.0, 0.5])
def test_paths_are_the_shortest_in_the_adjacency_graph(name: str, penalty_m: float) -> None:
    cells = _cells(name)
    graph = _graph(cells, penalty_m)
    paths = AdjacencyPaths(cells, jump_penalty_m=penalty_m)
    lengths = paths.lengths
    assert lengths.shape == (len(cells), len(cells))
    for start in range(0, len(cells), len(cells) // 6):
        least = nx.single_source_dijkstra_path_length(graph, start, weight="cost")
        np.testing.assert_allclose(paths.lengths_from(start), lengths[start], rtol=1e-12)
        for goal in range(0, len(cells), 3):
            found = paths.path(start, goal)
            assert (found.cells[0], found.cells[-1]) == (start, goal)
            assert nx.is_simple_path(graph, found.cells)
            length = nx.path_weight(graph, found.cells, "length")
            assert found.length_m == pytest.approx(length)
            assert length + penalty_m * (len(found.cells) - 1) == pytest.approx(least[goal])
            assert lengths[start, goal] == pytest.approx(length)


def test_a_penalty_makes_fewer_jumps_of_longer_ways() -> None:
    cells = _cells("office")
    graph = _graph(cells, 0.0)
    plain, smooth, smoothest = (AdjacencyPaths(cells, jump_penalty_m=penalty) for penalty in (0.0, 1.0, 1e6))
    fewer = 0
    for goal in range(1, len(cells), 5):
        jumps = [len(paths.path(0, goal).cells) - 1 for paths in (plain, smooth, smoothest)]
        assert jumps[0] >= jumps[1] >= jumps[2] == nx.shortest_path_length(graph, 0, goal)
        fewer += jumps[0] > jumps[2]
    assert fewer > 0
    # Pair by pair: each length is the least for its own penalty, so it grows with the penalty.
    assert np.all(plain.lengths <= smooth.lengths + 1e-6)
    assert np.all(smooth.lengths <= smoothest.lengths + 1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_a_point_stays_in_the_cells_of_its_path(seed: int) -> None:
    """Stop, border, stop, …: the two halves of a jump are in the two cells, by shapely."""
    cells = decompose(environment_of(seed), "aspect" if seed < 2 else "inflection")
    paths = AdjacencyPaths(cells)
    random = np.random.default_rng(seed)
    tolerance = 1e-9
    for start, goal in random.integers(0, len(cells), (25, 2)).tolist():
        found = paths.path(start, goal)
        np.testing.assert_array_equal(found.points[::2], cells.centroids[list(found.cells)])
        for jump, (u, v) in enumerate(pairwise(found.cells)):
            assert cells.adjacency[u, v]
            stop, passage, onward = (shapely.Point(point) for point in found.points[2 * jump : 2 * jump + 3])
            first, second = shapely.Polygon(cells.polygons[u]), shapely.Polygon(cells.polygons[v])
            assert max(first.distance(stop), first.distance(passage)) < tolerance
            assert max(second.distance(passage), second.distance(onward)) < tolerance


def test_borders_are_those_of_the_adjacency() -> None:
    """Every adjacent pair can be crossed, in the middle of what its cells share."""
    cells = _cells("room3")
    paths = AdjacencyPaths(cells)
    for u, v in zip(*cells.adjacency.nonzero(), strict=True):
        found = paths.path(int(u), int(v))
        if len(found.cells) == 2:
            first, second = (shapely.Polygon(cells.polygons[cell]).buffer(1e-9) for cell in (u, v))
            shared = first.intersection(second)
            assert shapely.Point(found.points[1]).distance(shared.centroid) < 1e-6


@pytest.mark.parametrize(("name", "radius_m"), [("room1", 0.3), ("office", 0.2), ("office", 0.4)])
def test_a_disc_stays_in_its_free_space(name: str, radius_m: float) -> None:
    cells = _cells(name)
    free = cells.environment.inflated(radius_m)
    paths = AdjacencyPaths(cells, free)
    stops = reachable_positions(cells, free)
    np.testing.assert_array_equal(paths.stops, stops)
    inside = free.polygon.buffer(1e-6)
    random = np.random.default_rng(1)
    reached = 0
    for start, goal in random.integers(0, len(cells), (30, 2)).tolist():
        if not np.isfinite(paths.lengths_from(start)[goal]):
            with pytest.raises(NoPath):
                paths.path(start, goal)
            continue
        found = paths.path(start, goal)
        reached += 1
        np.testing.assert_allclose(found.points[[0, -1]], stops[[start, goal]], atol=1e-12)
        assert found.length_m == pytest.approx(paths.lengths_from(start)[goal])
        assert all(cells.adjacency[hop] for hop in pairwise(found.cells))
        assert len(found.points) == 1 or inside.covers(shapely.LineString(found.points))
    assert reached > 15


def test_a_disc_goes_round_by_a_wide_door() -> None:
    """Two rooms with a door of 0.5 m and one of 2 m: a disc of 0.4 m takes the wide one, a point the near one."""
    outline = [
        (0, 0), (5, 0), (5, 0.5), (5.2, 0.5), (5.2, 0), (10, 0), (10, 9), (5.2, 9), (5.2, 8), (5, 8), (5, 9), (0, 9),
    ]  # fmt: skip
    rooms = Environment(outline, [[(5, 1), (5.2, 1), (5.2, 6), (5, 6)]])
    cells = decompose(rooms, "inflection")
    start, goal = cells.locate([(4.0, 0.4), (6.2, 0.4)]).tolist()
    point, disc = AdjacencyPaths(cells), AdjacencyPaths(cells, rooms.inflated(0.4))

    def through_narrow(paths: AdjacencyPaths) -> bool:
        line = shapely.LineString(paths.path(start, goal).points)
        return bool(line.intersects(shapely.box(5, 0.5, 5.2, 1)))

    assert through_narrow(point)
    assert not through_narrow(disc)
    assert disc.lengths_from(start)[goal] > point.lengths_from(start)[goal] + 5.0


def test_faults_are_said() -> None:
    cells = _cells("room1")
    with pytest.raises(ValueError, match="penalty of a jump"):
        AdjacencyPaths(cells, jump_penalty_m=-1.0)
    paths = AdjacencyPaths(cells)
    with pytest.raises(ValueError, match="cell -1 does not exist"):
        paths.path(-1, 0)
    with pytest.raises(ValueError, match=f"cell {len(cells)} does not exist"):
        paths.lengths_from(len(cells))
