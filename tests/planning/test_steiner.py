"""Steiner trees against enumeration, an integer programme, and Dreyfus and Wagner's programme as it is printed."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import coo_array

import maps
import planning.dreyfus_wagner
from planning import Environment, decompose, mutual_visibility, steiner_tree, virtual_weights
from planning.distance_network import distance_network, lower
from planning.shortest_paths import NO_PREDECESSOR, all_pairs, from_source
from planning.tree import InvalidRequest, InvalidWeights, NoTree, joining_tree
from tests.planning.tree_checker import check_tree, least_cost, least_cost_as_printed, random_weights, spanning_cost

Floats = NDArray[np.float64]

METHODS = ("exact", "mst", "takahashi-matsuyama")


@pytest.fixture(scope="module")
def cells() -> Floats:
    """Virtual weights of a map of two hundred cells."""
    decomposed = decompose(Environment.load(maps.path("room1")), "aspect")
    return virtual_weights(decomposed, mutual_visibility(decomposed))


@settings(max_examples=100)
@given(seed=st.integers(0, 2**32 - 1), number=st.integers(1, 7), terminals=st.integers(1, 5))
def test_no_set_of_steiner_nodes_is_cheaper(seed: int, number: int, terminals: int) -> None:
    random = np.random.default_rng(seed)
    for _ in range(20):
        W = random_weights(random, number)
        chosen = random.integers(0, number, terminals).tolist()
        standing = random.random(number) < 0.7 if random.random() < 0.5 else None
        least = least_cost(W, chosen, standing)
        if np.isinf(least):
            for method in METHODS:
                with pytest.raises(NoTree, match="cannot be reached"):
                    steiner_tree(W, chosen, method, placements=standing)
            continue
        exact, *approximations = (steiner_tree(W, chosen, method, placements=standing) for method in METHODS)
        check_tree(W, exact, chosen, standing=standing)
        assert exact.cost == pytest.approx(least)
        for tree in approximations:
            check_tree(W, tree, chosen, standing=standing)
            assert least - 1e-9 <= tree.cost <= 2 * (1 - 1 / terminals) * least + 1e-9


@pytest.mark.parametrize("seed", range(12))
def test_an_integer_programme_finds_nothing_cheaper(seed: int) -> None:
    random = np.random.default_rng(seed)
    W = random_weights(random, 13, 0.35)
    terminals = random.permutation(13)[: 3 + seed % 4].tolist()
    least = _least_cost_by_integer_programme(W, terminals)
    if np.isinf(least):
        with pytest.raises(NoTree):
            steiner_tree(W, terminals)
    else:
        assert steiner_tree(W, terminals).cost == pytest.approx(least)


@pytest.mark.parametrize("terminals", [3, 5, 6, 8])
def test_dropping_labels_loses_nothing_on_a_map(cells: Floats, terminals: int) -> None:
    distances, _ = all_pairs(cells)
    random = np.random.default_rng(terminals)
    for _ in range(6):
        chosen = random.permutation(len(cells))[:terminals].tolist()
        least = least_cost_as_printed(distances, chosen)
        for method in METHODS:
            tree = steiner_tree(cells, chosen, method)
            check_tree(cells, tree, chosen)
            assert least - 1e-9 <= tree.cost <= 2 * least
        assert steiner_tree(cells, chosen).cost == pytest.approx(least)


@pytest.mark.parametrize("free", ["nothing", "everything"])
def test_links_that_cost_nothing_or_all_the_same(cells: Floats, free: str) -> None:
    W = np.where(np.isfinite(cells), 0.0 if free == "everything" else 1.0, np.inf)
    np.fill_diagonal(W, 0.0)
    distances, _ = all_pairs(W)
    chosen = np.random.default_rng(1).permutation(len(W))[:6].tolist()
    for method in METHODS:
        check_tree(W, steiner_tree(W, chosen, method), chosen)
    assert steiner_tree(W, chosen).cost == least_cost_as_printed(distances, chosen)


def test_the_order_and_the_number_of_mentions_of_terminals_do_not_matter(cells: Floats) -> None:
    chosen = [3, 150, 77, 12, 190]
    for method in METHODS:
        cost = steiner_tree(cells, chosen, method).cost
        tree = steiner_tree(cells, [190, 12, 190, 3, 77, 150, 3], method)
        check_tree(cells, tree, [190, 12, 3, 77, 150])
        assert tree.cost == pytest.approx(cost)


@pytest.mark.parametrize("method", METHODS)
def test_one_terminal_is_a_tree_and_two_are_a_shortest_path(cells: Floats, method: Any) -> None:
    alone = steiner_tree(cells, [5, 5], method)
    assert (alone.cost, alone.edges.shape, alone.nodes.tolist()) == (0.0, (0, 2), [5])
    distances, _ = from_source(cells, 5)
    for target in (0, 60, 130):
        pair = steiner_tree(cells, [5, target], method)
        check_tree(cells, pair, [5, target])
        assert pair.cost == pytest.approx(distances[target])


def test_three_spokes_need_the_hub_and_a_hub_without_room_is_gone_around() -> None:
    W = np.full((4, 4), np.inf)
    W[3, :3] = W[:3, 3] = 1.0
    W[0, 1] = W[1, 0] = W[1, 2] = W[2, 1] = 1.9
    np.fill_diagonal(W, 0.0)
    assert steiner_tree(W, [0, 1, 2]).nodes.tolist() == [0, 1, 2, 3]
    assert steiner_tree(W, [0, 1, 2], "mst").cost == pytest.approx(3.8)
    around = steiner_tree(W, [0, 1, 2], placements=np.array([True, True, True, False]))
    assert sorted(map(sorted, around.edges.tolist())) == [[0, 1], [1, 2]]
    # A terminal may stand where no robot can, and links lead on from it.
    assert steiner_tree(W, [0, 2, 3], placements=np.zeros(4, dtype=bool)).cost == pytest.approx(2.0)


def test_an_island_is_named() -> None:
    W = np.full((5, 5), np.inf)
    W[1, 2] = W[2, 1] = W[3, 4] = W[4, 3] = 1.0
    for method in METHODS:
        with pytest.raises(NoTree, match="terminal in placement 4 cannot be reached from the one in placement 1"):
            steiner_tree(W, [1, 2, 4], method)


@pytest.mark.parametrize(
    ("W", "words"),
    [
        (np.zeros((2, 3)), "square matrix, not one of shape"),
        (np.zeros(4), "square"),
        ("weights", "matrix of numbers"),
        ([[0.0, 1.0], [1.0]], "matrix of numbers"),
        ([[0.0, -1.0], [-1.0, 0.0]], r"not negative, but W\[0, 1\] is -1"),
        ([[0.0, np.nan], [np.nan, 0.0]], r"numbers, but W\[0, 1\] is nan"),
        ([[-1.0, 1.0], [1.0, 0.0]], r"not negative, but W\[0, 0\]"),
        ([[0.0, 1.0], [1.0 + 1e-9, 0.0]], r"symmetric, but W\[0, 1\] is 1.0"),
        ([[0.0, 1.0], [np.inf, 0.0]], r"symmetric, but W\[0, 1\] is 1.0 and W\[1, 0\] is inf"),
    ],
)
def test_bad_weights_are_said_in_a_sentence(W: Any, words: str) -> None:
    with pytest.raises(InvalidWeights, match=words):
        steiner_tree(W, [0, 1])


def test_every_bad_weight_is_found_wherever_it_stands() -> None:
    W = random_weights(np.random.default_rng(0), 35)
    for row, column in [(0, 34), (34, 0), (17, 16), (15, 16), (33, 34), (20, 20)]:
        for bad in (-1.0, np.nan):
            broken = W.copy()
            broken[row, column] = bad
            with pytest.raises(InvalidWeights):
                steiner_tree(broken, [0])
    broken = W.copy()
    broken[31, 2] = 17.0
    with pytest.raises(InvalidWeights, match=r"W\[2, 31\] is .* and W\[31, 2\] is 17.0"):
        steiner_tree(broken, [0])


@pytest.mark.parametrize(
    ("terminals", "options", "words"),
    [
        ([], {}, "at least one terminal"),
        ([0, 4], {}, "terminal 1 is placement 4, but the placements are 0 to 3"),
        ([-1], {}, "terminal 0 is placement -1"),
        ([0.5], {}, "whole numbers"),
        ([[0, 1]], {}, "list of placements"),
        ([0, [1]], {}, "list of placements"),
        ([0, 1], {"method": "greedy"}, "unknown method 'greedy'"),
        ([0, 1], {"method": "mst", "vertices": 3}, "always exact"),
        ([0, 1], {"vertices": 1}, "1 nodes cannot hold 2 terminals"),
        ([0, 1], {"vertices": 2.5}, "whole number"),
        ([0], {"vertices": True}, "whole number, not True"),
        ([0, 1], {"placements": [True]}, "4 times true or false"),
        ([0, 1], {"placements": [0, 1, 2, 3]}, "4 times true or false"),
    ],
)
def test_bad_requests_are_said_in_a_sentence(terminals: Any, options: Any, words: str) -> None:
    with pytest.raises(InvalidRequest, match=words):
        steiner_tree(np.ones((4, 4)), terminals, **options)


def test_too_many_terminals_for_an_exact_tree_are_refused(monkeypatch: pytest.MonkeyPatch, cells: Floats) -> None:
    monkeypatch.setattr(planning.dreyfus_wagner, "LARGEST_TABLE", 2**4 * len(cells))
    steiner_tree(cells, range(5))
    with pytest.raises(InvalidRequest, match=r"6 terminals among 200 placements .* method='takahashi-matsuyama'"):
        steiner_tree(cells, range(6))
    check_tree(cells, steiner_tree(cells, range(40), "takahashi-matsuyama"), range(40))


def test_weights_may_be_read_only_whole_numbers_and_are_left_alone() -> None:
    W = np.array([[0, 2, 9], [2, 0, 2], [9, 2, 0]])
    W.flags.writeable = False
    for vertices in (None, 4):
        assert steiner_tree(W, (0, 2), vertices=vertices).cost == 4.0


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), number=st.integers(2, 60), step=st.sampled_from([None, 0.0, 0.7, np.inf]))
def test_the_distance_network_is_dijkstras_whatever_the_step(seed: int, number: int, step: float | None) -> None:
    random = np.random.default_rng(seed)
    W = random_weights(random, number, 0.2)
    W[0, 1] = W[1, 0] = 1.0
    network = distance_network(W, np.array([0, 1]))
    for row, terminal in enumerate(network.terminals):
        expected, _ = from_source(W, int(terminal))
        distances, predecessors = network.distances[row], network.predecessors[row]
        if step is not None:
            distances, predecessors = np.full(number, np.inf), np.full(number, NO_PREDECESSOR, dtype=np.int32)
            distances[terminal] = 0.0
            lower(W, distances, predecessors, np.full(number, np.inf), step)
        np.testing.assert_allclose(distances, expected)
        for v in np.flatnonzero(predecessors != NO_PREDECESSOR):
            assert distances[v] == distances[predecessors[v]] + W[predecessors[v], v]
        assert ((predecessors == NO_PREDECESSOR) == (np.isinf(expected) | (np.arange(number) == terminal))).all()


def test_costs_above_their_limit_are_not_passed_on() -> None:
    W = np.full((4, 4), np.inf)
    for u in range(3):
        W[u, u + 1] = W[u + 1, u] = 1.0
    costs, predecessors = np.array([0.0, np.inf, np.inf, np.inf]), np.full(4, NO_PREDECESSOR, dtype=np.int32)
    lower(W, costs, predecessors, np.array([0.0, 1.0, 1.5, 9.0]), 1.0)
    assert costs.tolist() == [0.0, 1.0, 2.0, np.inf]


def test_joining_tree_breaks_cycles_at_the_dearest_edge_and_drops_dead_ends() -> None:
    W = np.array([[0, 1, 5, 9, 9], [1, 0, 2, 9, 9], [5, 2, 0, 1, 9], [9, 9, 1, 0, 1], [9, 9, 9, 1, 0]], dtype=float)
    tree = joining_tree(W, [(0, 1), (1, 2), (2, 0), (1, 0), (3, 2), (4, 3)], np.array([0, 2]))
    assert (tree.cost, tree.nodes.tolist()) == (3.0, [0, 2, 1])
    check_tree(W, tree, [0, 2])


def test_the_oracle_prim_is_networkx_spanning_tree() -> None:
    for seed in range(30):
        W = random_weights(np.random.default_rng(seed), 7, 0.8) + 0.125
        nodes = [0, 2, 3, 5, 6]
        graph: Any = nx.Graph()
        graph.add_nodes_from(nodes)
        graph.add_weighted_edges_from((u, v, W[u, v]) for u, v in combinations(nodes, 2) if np.isfinite(W[u, v]))
        expected = nx.minimum_spanning_tree(graph).size("weight") if nx.is_connected(graph) else np.inf
        assert spanning_cost(W, nodes) == pytest.approx(expected)


def _least_cost_by_integer_programme(W: Floats, terminals: list[int]) -> float:
    """Edges are bought; a unit of flow goes from the first terminal to each other one over bought edges only."""
    number = len(W)
    edges = [(u, v) for u, v in combinations(range(number), 2) if np.isfinite(W[u, v])]
    arcs = edges + [(v, u) for u, v in edges]
    flows = len(terminals) - 1
    # Variables: whether each edge is bought, then the flows over the arcs, one target after the other.
    size = len(edges) + flows * len(arcs)
    rows: list[int] = []
    columns: list[int] = []
    values: list[float] = []
    low: list[float] = []
    high: list[float] = []

    def constrain(terms: list[tuple[int, float]], least: float, most: float) -> None:
        for column, value in terms:
            rows.append(len(low))
            columns.append(column)
            values.append(value)
        low.append(least)
        high.append(most)

    for flow, target in enumerate(terminals[1:]):
        first = len(edges) + flow * len(arcs)
        for node in range(number):
            balance = float(node == terminals[0]) - float(node == target)
            terms = [(first + i, float(u == node) - float(v == node)) for i, (u, v) in enumerate(arcs)]
            constrain([term for term in terms if term[1]], balance, balance)
        for i in range(len(edges)):
            constrain([(first + i, 1.0), (first + len(edges) + i, 1.0), (i, -1.0)], -np.inf, 0.0)
    done = milp(
        np.concatenate(([W[edge] for edge in edges], np.zeros(flows * len(arcs)))),
        integrality=np.arange(size) < len(edges),
        bounds=Bounds(0.0, 1.0),
        constraints=LinearConstraint(coo_array((values, (rows, columns)), shape=(len(low), size)), low, high),
    )
    assert done.status in (0, 2), done.message
    return float(done.fun) if done.status == 0 else np.inf
