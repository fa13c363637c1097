from __future__ import annotations

from itertools import combinations

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import maps
from planning.decomposition import decompose
from planning.deployment import NO_CHAIN
from planning.environment import Environment
from planning.mutual_visibility import mutual_visibility
from planning.placement_graph import PlacementGraph
from planning.relays import count_links, fewest_relays, join_terminals, most_relays
from planning.tree import InvalidRequest, NoTree
from tests.planning.polygons import free_points

Bools = NDArray[np.bool_]


def graph_of(n: int, share: float, seed: int) -> Bools:
    rng = np.random.default_rng(seed)
    visible: Bools = np.triu(rng.random((n, n)) < share, 1)
    return visible | visible.T | np.eye(n, dtype=np.bool_)


def points_of(name: str) -> PlacementGraph:
    return PlacementGraph.from_points(Environment.load(maps.path(name)), 0.2)


@given(n=st.integers(1, 90), degree=st.floats(0.3, 6.0), seed=st.integers(0, 10_000))
@settings(max_examples=300)
def test_most_relays_is_the_diameter_less_one(n: int, degree: float, seed: int) -> None:
    visible = graph_of(n, degree / n, seed)
    graph = nx.from_numpy_array(visible)
    lengths = {v: nx.single_source_shortest_path_length(graph, v) for v in graph}
    most = most_relays(visible)
    assert most.relays == max(0, max(max(of.values()) for of in lengths.values()) - 1)
    assert max(0, lengths[most.ends[0]][most.ends[1]] - 1) == most.relays
    assert most.parts == nx.number_connected_components(graph)


# A prototype found the same for room3, cityblocks and maze: 7, 3, 3 over cells and 4, 2, 3 over points.
@pytest.mark.parametrize(
    ("name", "over_cells", "over_points"),
    [("room3", 7, 4), ("cityblocks", 3, 2), ("maze", 3, 3), ("l457mod", 3, 2), ("l457", 7, 4)],
)
def test_what_the_maps_ask_for(name: str, over_cells: int, over_points: int) -> None:
    environment = Environment.load(maps.path(name))
    cells = decompose(environment)
    graph = PlacementGraph.from_cells(cells, mutual_visibility(cells), environment, 0.2)
    most = most_relays(graph.visible)
    assert (most.relays, most.parts) == (over_cells, 1)
    farthest = [count_links(graph.visible, one).max() for one in np.eye(len(graph), dtype=np.bool_)]
    assert max(farthest) == over_cells + 1
    assert most_relays(points_of(name).visible).relays == over_points


@given(n=st.integers(1, 90), degree=st.floats(0.3, 6.0), share=st.floats(0.0, 0.3), seed=st.integers(0, 10_000))
@settings(max_examples=50)
def test_links_are_counted_from_the_nearest_source(n: int, degree: float, share: float, seed: int) -> None:
    visible = graph_of(n, degree / n, seed)
    sources = np.random.default_rng(seed).random(n) < share
    graph = nx.from_numpy_array(visible)
    graph.add_node("all sources")
    graph.add_edges_from(("all sources", int(source)) for source in np.flatnonzero(sources))
    hops = nx.single_source_shortest_path_length(graph, "all sources")
    assert count_links(visible, sources).tolist() == [hops.get(v, 0) - 1 for v in range(n)]


@pytest.mark.parametrize("name", ["room3", "l457"])
def test_any_two_places_need_at_most_two_relays_more_than_two_placements(name: str) -> None:
    graph = points_of(name)
    most = most_relays(graph.visible).relays
    places = free_points(graph.free, 40, np.random.default_rng(2))
    for p, q in zip(places[::2], places[1::2], strict=True):
        ends = np.stack([p, q])
        direct = np.isfinite(np.array([graph.direct_weights(end, ends) for end in ends]))
        assert len(fewest_relays(graph.visible, np.array([graph.sees(end) for end in ends]), direct).relays) <= most + 2


def count_by_enumeration(visible: Bools, seen: Bools, direct: Bools) -> int | None:
    """The least number of placements with which the terminals are connected; None if all are not enough."""
    whole = nx.from_numpy_array(np.block([[visible, seen.T], [seen, direct]]))
    n, t = len(visible), len(seen)
    for number in range(n + 1):
        for relays in combinations(range(n), number):
            if nx.is_connected(whole.subgraph([*relays, *range(n, n + t)])):
                return number
    return None


@given(
    n=st.integers(1, 8), t=st.integers(1, 4), share=st.floats(0.1, 0.5), seen_share=st.floats(0.1, 0.5),
    seed=st.integers(0, 10_000),
)  # fmt: skip
@settings(max_examples=300)
def test_fewest_relays_equals_enumeration(n: int, t: int, share: float, seen_share: float, seed: int) -> None:
    visible, direct = graph_of(n, share, seed), graph_of(t, 0.2, seed + 1)
    seen = np.random.default_rng(seed + 2).random((t, n)) < seen_share
    expected = count_by_enumeration(visible, seen, direct)
    if expected is None:
        with pytest.raises(NoTree, match="terminal"):
            fewest_relays(visible, seen, direct)
        return
    found = fewest_relays(visible, seen, direct)
    assert len(found.relays) == expected
    tree: nx.Graph[int] = nx.Graph(found.links.tolist())
    tree.add_nodes_from(range(n, n + t))
    assert nx.is_tree(tree)
    assert set(tree) == {*found.relays.tolist(), *range(n, n + t)}
    whole = np.block([[visible, seen.T], [seen, direct]])
    assert all(whole[u, v] for u, v in found.links)


def test_two_terminals_are_a_chain() -> None:
    graph = points_of("room3")
    base, agent = (10.0, 36.0), (70.0, 10.0)
    ends = np.array([base, agent])
    chain = fewest_relays(graph.visible, np.array([graph.sees(end) for end in ends]), np.eye(2, dtype=np.bool_))
    hops = graph.relays_from(base)[graph.sees(agent)]
    assert len(chain.relays) == hops[hops != NO_CHAIN].min()
    assert len(chain.links) == len(chain.relays) + 1


def test_terminals_that_see_each_other_need_no_relay() -> None:
    none = fewest_relays(graph_of(3, 0.0, 0), np.zeros((2, 3), np.bool_), np.ones((2, 2), np.bool_))
    assert none.relays.tolist() == []
    assert np.sort(none.links).tolist() == [[3, 4]]


def test_joined_terminals_keep_the_weights_of_both() -> None:
    W, links = np.array([[0.0, 2.0], [2.0, 0.0]]), np.array([[1.0, np.inf]])
    joined = join_terminals(W, links, np.full((1, 1), np.inf))
    assert joined.tolist() == [[0.0, 2.0, 1.0], [2.0, 0.0, np.inf], [1.0, np.inf, 0.0]]


def test_weights_in_place_of_sight_are_refused_in_a_sentence() -> None:
    with pytest.raises(InvalidRequest, match="isfinite"):
        most_relays(np.array([[0.0, 1.0], [1.0, 0.0]]))
