"""The search in random diagrams against a flood of all elements, and against the best way over all grid points."""

from __future__ import annotations

from itertools import combinations, pairwise, product

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from planning.coordination_diagram import CoordinationDiagram, spread_pieces
from planning.diagram_search import Route, search_diagram

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def random_diagram(seed: int, robots: int, most_pieces: int, share: float, joined: bool = False) -> CoordinationDiagram:
    """A maze: pieces of random lengths, a share of the pairs of pieces blocked, start and goal left open."""
    rng = np.random.default_rng(seed)
    counts = rng.integers(1, most_pieces + 1, robots)
    limits = tuple(np.append(0.0, np.cumsum(rng.choice([0.5, 1.0, rng.uniform(0.1, 3.0)], n))) for n in counts)
    paths = tuple(np.array([(0.0, float(i)), (along[-1], float(i))]) for i, along in enumerate(limits))
    tables = []
    for _ in range(2):
        drawn = {}
        for i, j in combinations(range(robots), 2):
            blocked = rng.uniform(size=(counts[i], counts[j])) < share
            blocked[0, 0] = blocked[-1, -1] = False
            drawn[i, j] = spread_pieces(blocked, counts[i] + 1, counts[j] + 1)
        tables.append(drawn)
    seen = {pair: ~table for pair, table in tables[1].items()}
    plain = CoordinationDiagram(paths, limits, tables[0], {}, frozenset(), ())
    return plain.with_sight(seen, joined=range(robots)) if joined else plain


def can_reach(diagram: CoordinationDiagram) -> bool:
    """Whether the goal is in the start's part of the array of all combinations of elements of two or three robots."""
    sizes = [2 * len(limits) - 1 for limits in diagram.limits_m]

    def expand(table: NDArray[np.bool_], i: int, j: int) -> NDArray[np.bool_]:
        return table.reshape([sizes[robot] if robot in (i, j) else 1 for robot in range(len(sizes))])

    free = np.ones(sizes, dtype=np.bool_)
    links = np.zeros(sizes, dtype=np.int64)
    for (i, j), table in diagram.collides.items():
        free &= ~expand(table, i, j)
        links += expand(diagram.seen[i, j], i, j) if diagram.joined else 1
    parts, _ = ndimage.label(free & (links >= len(sizes) - 1))
    return bool(parts.flat[0] == parts.flat[-1] > 0)


def duration(diagram: CoordinationDiagram, speeds: Floats, start: Ints, end: Ints) -> float:
    steps = [abs(limits[b] - limits[a]) for limits, a, b in zip(diagram.limits_m, start, end, strict=True)]
    return float(np.max(steps / speeds))


def line_is_free(diagram: CoordinationDiagram, start: Ints, end: Ints) -> bool:
    """By points on the line: its ends, and one between any two limits that it crosses."""
    first, last = (
        np.array([limits[a] for limits, a in zip(diagram.limits_m, turn, strict=True)]) for turn in (start, end)
    )
    crossed = [(limits - a) / (b - a) for limits, a, b in zip(diagram.limits_m, first, last, strict=True) if a != b]
    shares = np.unique(np.concatenate([*crossed, [0.0, 1.0]]))
    shares = shares[(shares >= 0.0) & (shares <= 1.0)]
    shares = shares[np.append(True, np.diff(shares) > 1e-12)]
    return all(
        diagram.find_trouble(diagram.find_elements(first + 0.5 * (a + b) * (last - first))) is None
        for a, b in pairwise(shares)
    )


def check(diagram: CoordinationDiagram, speeds: Floats, route: Route) -> float:
    """That a way leads from the start along free lines; how long it takes."""
    assert np.all(route.turns[0] == 0)
    assert route.complete == all(np.array(route.turns[-1]) == [len(limits) - 1 for limits in diagram.limits_m])
    assert all(line_is_free(diagram, start, end) for start, end in pairwise(route.turns))
    return sum(duration(diagram, speeds, start, end) for start, end in pairwise(route.turns))


@given(
    seed=st.integers(0, 2**32 - 1),
    robots=st.sampled_from([2, 3]),
    share=st.sampled_from([0.1, 0.35, 0.6]),
    joined=st.booleans(),
    haste=st.sampled_from([0.0, 1.0]),
)
def test_a_way_is_found_exactly_where_there_is_one(
    seed: int, robots: int, share: float, joined: bool, haste: float
) -> None:
    diagram = random_diagram(seed, robots, 5 if robots == 2 else 3, share, joined)
    if diagram.find_trouble([0] * robots) is not None:
        return
    speeds = np.random.default_rng(seed).choice([0.5, 1.0, 2.0], robots)
    route = search_diagram(diagram, speeds, 100_000, haste)
    assert route.complete == can_reach(diagram)
    assert route.exhausted != route.complete
    check(diagram, speeds, route)


def best_duration(diagram: CoordinationDiagram, speeds: Floats) -> float:
    """Of a way over any grid points, along any free lines between them."""
    points = [np.array(point) for point in product(*(range(len(limits)) for limits in diagram.limits_m))]
    graph = nx.Graph()
    for (a, start), (b, end) in combinations(enumerate(points), 2):
        if line_is_free(diagram, start, end):
            graph.add_edge(a, b, time=duration(diagram, speeds, start, end))
    return float(nx.shortest_path_length(graph, 0, len(points) - 1, weight="time"))


def test_ways_take_little_longer_than_the_best() -> None:
    longer = []
    for seed in range(40):
        diagram = random_diagram(seed, 2, 4, 0.25)
        speeds = np.ones(2)
        route = search_diagram(diagram, speeds, 100_000)
        took = check(diagram, speeds, route)
        if route.complete:
            best = best_duration(diagram, speeds)
            assert took >= best - 1e-9
            assert took >= max(limits[-1] for limits in diagram.limits_m) - 1e-9
            longer.append(took / best)
    assert len(longer) > 25
    assert np.mean(np.array(longer) < 1.0 + 1e-9) > 0.8
    assert max(longer) < 1.4


def test_where_nothing_is_in_the_way_all_go_straight() -> None:
    diagram = random_diagram(1, 4, 6, 0.0)
    route = search_diagram(diagram, np.ones(4), 10_000)
    assert route.turns.tolist() == [[0] * 4, [len(limits) - 1 for limits in diagram.limits_m]]


def test_robots_go_back_where_they_must() -> None:
    """A winding passage: robot 1 goes on, lets robot 2 go on, goes back, and so on."""
    blocked = np.ones((3, 5), dtype=np.bool_)
    for at in [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 3), (0, 4), (1, 4), (2, 4)]:
        blocked[at] = False
    diagram = CoordinationDiagram(
        (np.array([(0.0, 0.0), (3.0, 0.0)]), np.array([(0.0, 1.0), (5.0, 1.0)])),
        (np.arange(4.0), np.arange(6.0)),
        {(0, 1): spread_pieces(blocked, 4, 6)},
        {},
        frozenset(),
        (),
    )
    route = search_diagram(diagram, np.ones(2), 10_000)
    check(diagram, np.ones(2), route)
    assert route.complete
    assert np.any(np.diff(route.turns[:, 0]) < 0)


@pytest.mark.parametrize("most_nodes", [1, 20, 200])
def test_a_search_that_is_given_up_says_so_and_how_far_it_got(most_nodes: int) -> None:
    diagram = random_diagram(5, 4, 6, 0.35)
    route = search_diagram(diagram, np.ones(4), most_nodes)
    assert not route.complete
    assert not route.exhausted
    check(diagram, np.ones(4), route)


def test_a_search_that_was_cut_short_has_proven_nothing() -> None:
    blocked = np.zeros((2, 2), dtype=np.bool_)
    blocked[0, 1] = blocked[1, 0] = blocked[0, 0] = True
    limits = (np.arange(3.0), np.arange(3.0))
    paths = (np.array([(0.0, 0.0), (2.0, 0.0)]), np.array([(0.0, 1.0), (2.0, 1.0)]))
    diagram = CoordinationDiagram(paths, limits, {(0, 1): spread_pieces(blocked, 3, 3)}, {}, frozenset(), ())
    assert not search_diagram(diagram, np.ones(2), 1).exhausted
    assert search_diagram(diagram, np.ones(2), 100).exhausted


def test_one_robot_and_robots_that_stand() -> None:
    alone = CoordinationDiagram.of([[(0, 0), (3, 0), (3, 4)]], [0.2])
    assert search_diagram(alone, [1.0], 100).turns.tolist() == [[0], [1]]
    standing = CoordinationDiagram.of([[(0, 0)], [(1, 0)]], [0.2, 0.2])
    route = search_diagram(standing, [1.0, 1.0], 100)
    assert route.complete
    assert route.turns.tolist() == [[0, 0]]
