"""Fixed-size Steiner trees against every placement of the robots."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import maps
import planning.fixed_size_steiner
from planning import Environment, decompose, mutual_visibility, steiner_tree, virtual_weights
from planning.fixed_size_steiner import fixed_size_programme
from planning.tree import InvalidRequest, NoTree
from tests.planning.tree_checker import check_tree, least_cost_of_size, random_weights

Floats = NDArray[np.float64]


@pytest.fixture(scope="module")
def cells() -> Floats:
    """Virtual weights of a map of a hundred and fifty cells."""
    decomposed = decompose(Environment.load(maps.path("room3")), "inflection")
    return virtual_weights(decomposed, mutual_visibility(decomposed))


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), number=st.integers(1, 5), terminals=st.integers(1, 4), robots=st.integers(0, 4))
def test_no_placement_of_the_robots_is_cheaper(seed: int, number: int, terminals: int, robots: int) -> None:
    random = np.random.default_rng(seed)
    for _ in range(10):
        W = random_weights(random, number)
        chosen = random.integers(0, number, terminals).tolist()
        node_cost = np.where(random.random(number) < 0.8, random.integers(0, 3, number), np.inf)
        programme = fixed_size_programme(W, chosen, terminals + robots, node_cost)
        assert programme.costs.shape == (robots + 1,)
        for count, cost in enumerate(programme.costs):
            assert cost == pytest.approx(least_cost_of_size(W, chosen, count, node_cost))
            if np.isfinite(cost):
                tree = programme.tree(count)
                check_tree(W, tree, chosen, terminals + count, np.isfinite(node_cost))
                assert tree.cost + node_cost[tree.nodes[terminals:]].sum() == pytest.approx(cost)
            else:
                with pytest.raises(NoTree, match=f"no tree with {count} robots"):
                    programme.tree(count)


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), number=st.integers(1, 5), terminals=st.integers(1, 4), robots=st.integers(0, 4))
def test_a_tree_of_given_size_is_the_cheapest_wherever_robots_may_stand(
    seed: int, number: int, terminals: int, robots: int
) -> None:
    random = np.random.default_rng(seed)
    for _ in range(10):
        W = random_weights(random, number)
        chosen = random.integers(0, number, terminals).tolist()
        standing = random.random(number) < 0.7
        least = least_cost_of_size(W, chosen, robots, np.where(standing, 0.0, np.inf))
        if np.isfinite(least):
            tree = steiner_tree(W, chosen, vertices=terminals + robots, placements=standing)
            check_tree(W, tree, chosen, terminals + robots, standing)
            assert tree.cost == pytest.approx(least)
        else:
            with pytest.raises(NoTree):
                steiner_tree(W, chosen, vertices=terminals + robots, placements=standing)


@pytest.mark.parametrize("terminals", [2, 3, 4])
def test_more_nodes_never_cost_more_and_enough_of_them_are_free(cells: Floats, terminals: int) -> None:
    random = np.random.default_rng(terminals)
    for _ in range(3):
        chosen = random.permutation(len(cells))[:terminals].tolist()
        free = steiner_tree(cells, chosen)
        most = len(free.nodes) + 2
        programme = fixed_size_programme(cells, chosen, most)
        assert (np.diff(programme.costs[np.isfinite(programme.costs)]) <= 1e-12).all()
        assert programme.costs[-3:] == pytest.approx(free.cost)
        assert (programme.costs[:-3] >= free.cost - 1e-12).all()
        for vertices in range(terminals, most + 1):
            cost = programme.costs[vertices - terminals]
            if np.isfinite(cost):
                tree = steiner_tree(cells, chosen, vertices=vertices)
                check_tree(cells, tree, chosen, vertices)
                assert tree.cost == pytest.approx(cost)
        check_tree(cells, steiner_tree(cells, chosen, vertices=500), chosen, 500)


def test_too_few_nodes_are_told_how_many_it_takes() -> None:
    W = np.full((5, 5), np.inf)
    for u in range(4):
        W[u, u + 1] = W[u + 1, u] = 1.0
    with pytest.raises(NoTree, match=r"4 nodes do not join the terminals in placements \[0, 4, 0\]: it takes 6"):
        steiner_tree(W, [0, 4, 0], vertices=4)
    assert steiner_tree(W, [0, 4, 0], vertices=6).cost == 4.0
    with pytest.raises(NoTree, match="placement 4 cannot be reached"):
        steiner_tree(W, [0, 4], vertices=9, placements=np.array([True, True, False, True, True]))


def test_robots_that_can_only_stand_aside_hang_from_the_tree() -> None:
    W = np.array([[0.0, 1.0, 5.0], [1.0, 0.0, 3.0], [5.0, 3.0, 0.0]])
    tree = steiner_tree(W, [0, 1], vertices=4, placements=np.array([False, False, True]))
    assert (tree.cost, sorted(tree.nodes.tolist())) == (4.0, [0, 1, 2, 2])
    check_tree(W, tree, [0, 1], 4)


@pytest.mark.parametrize(
    ("node_cost", "words"), [([0.0], "3 numbers"), ([0.0, np.nan, 0.0], "3 numbers"), ("none", "3 numbers")]
)
def test_bad_node_costs_are_said_in_a_sentence(node_cost: object, words: str) -> None:
    with pytest.raises(InvalidRequest, match=words):
        fixed_size_programme(np.ones((3, 3)), [0, 1], 3, node_cost)


def test_tables_that_would_not_fit_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planning.fixed_size_steiner, "LARGEST_TABLE", 2 * 3 * 9)
    fixed_size_programme(np.ones((9, 9)), [0, 1], 4)
    with pytest.raises(InvalidRequest, match="2 terminals, 3 robots and 9 placements are too many"):
        fixed_size_programme(np.ones((9, 9)), [0, 1], 5)
