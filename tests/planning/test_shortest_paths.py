"""Shortest paths against scipy and networkx."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.sparse.csgraph import floyd_warshall

from planning.shortest_paths import BLOCK, NO_PREDECESSOR, NoPath, all_pairs, from_source, path


def _weights(
    seed: int, number: int, share: float, directed: bool = False, shortest: float = 0.0
) -> NDArray[np.float64]:
    """Random edges; many weights are small integers above the shortest, so that ties and zeros occur."""
    random = np.random.default_rng(seed)
    W = np.where(random.random((number, number)) < 0.5, random.random((number, number)) * 3, 0.0)
    W += random.integers(0, 3, (number, number)) + shortest
    W[random.random((number, number)) >= share] = np.inf
    if not directed:
        W = np.minimum(W, W.T)
    np.fill_diagonal(W, 0.0)
    return W


def _length(W: NDArray[np.float64], nodes: list[int]) -> float:
    return float(sum(W[u, v] for u, v in pairwise(nodes)))


@settings(max_examples=120)
@given(
    seed=st.integers(0, 2**32 - 1),
    number=st.integers(1, 2 * BLOCK + 3),
    share=st.sampled_from([0.0, 0.03, 0.1, 0.5, 1.0]),
    directed=st.booleans(),
    shortest=st.sampled_from([0.0, 1e-10, 0.1, 1.0]),
)
def test_distances_are_those_of_floyd_and_warshall(
    seed: int, number: int, share: float, directed: bool, shortest: float
) -> None:
    W = _weights(seed, number, share, directed, shortest)
    distances, predecessors = all_pairs(W)
    # scipy takes zeros, and what is close to them, for missing edges.
    expected = floyd_warshall(np.where(W < 1e-7, 1e-7, W))
    np.testing.assert_allclose(distances, expected, atol=1e-4)
    for source in range(0, number, 7):
        for target in range(number):
            if np.isfinite(distances[source, target]):
                nodes = path(predecessors[source], source, target)
                assert nodes[0] == source
                assert nodes[-1] == target
                assert _length(W, nodes) == pytest.approx(distances[source, target])
            else:
                assert predecessors[source, target] == NO_PREDECESSOR


@pytest.mark.parametrize("seed", range(5))
def test_paths_pass_through_relays_only(seed: int) -> None:
    number = 40
    W = _weights(seed, number, 0.15)
    relays = np.random.default_rng(seed).random(number) < 0.5
    source = seed
    graph: Any = nx.DiGraph()
    graph.add_nodes_from(range(number))
    for u in range(number):
        for v in range(number):
            # Edges leave the source and the relays only, so whatever else is reached is an end.
            if u != v and np.isfinite(W[u, v]) and (relays[u] or u == source):
                graph.add_edge(u, v, weight=W[u, v])
    expected = nx.single_source_dijkstra_path_length(graph, source)
    distances, predecessors = from_source(W, source, relays)
    for target in range(number):
        assert distances[target] == pytest.approx(expected.get(target, np.inf))
        if target in expected:
            assert all(relays[node] for node in path(predecessors, source, target)[1:-1])


@pytest.mark.parametrize("shortest", [0.0, 1.0])
def test_from_source_is_a_row_of_all_pairs(shortest: float) -> None:
    W = _weights(3, 90, 0.1, shortest=shortest)
    distances, predecessors = all_pairs(W)
    for source in (0, 17, 89):
        row = from_source(W, source)
        np.testing.assert_allclose(row[0], distances[source], rtol=1e-14)
        for target in np.flatnonzero(np.isfinite(row[0])):
            nodes = path(predecessors[source], source, int(target))
            assert _length(W, nodes) == pytest.approx(row[0][target], rel=1e-14)


def test_path_to_oneself_is_one_node_and_an_island_is_named() -> None:
    W = np.full((3, 3), np.inf)
    W[0, 1] = W[1, 0] = 1.0
    _, predecessors = from_source(W, 0)
    assert path(predecessors, 0, 0) == [0]
    assert path(predecessors, 0, 1) == [0, 1]
    with pytest.raises(NoPath, match="from node 0 to node 2"):
        path(predecessors, 0, 2)


@pytest.mark.parametrize(
    ("W", "words"),
    [
        (np.zeros((2, 3)), "square"),
        (np.array([[0.0, -1.0], [1.0, 0.0]]), r"W\[0, 1\] is -1"),
        (np.array([[0.0, 1.0], [np.nan, 0.0]]), r"W\[1, 0\] is nan"),
    ],
)
def test_what_is_no_matrix_of_weights_is_refused(W: NDArray[np.float64], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        all_pairs(W)


def test_a_source_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ValueError, match="node 2 does not exist"):
        from_source(np.zeros((2, 2)), 2)
