"""Fixed-size Steiner trees against every placement of the robots."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import maps
import planning.fixed_size_steiner
from planning import Environment, decompose, mutual_visibility, steiner_tree
from planning.fixed_size_steiner import _counted_tree
from planning.tree import InvalidRequest, NoTree
from tests.planning.tree_checker import check_tree, least_cost_of_size, random_weights

Floats = NDArray[np.float64]


@pytest.fixture(scope="module")
def cells() -> Floats:
    """Squared lengths of the links between a hundred cells: as of a radio's power, the cheaper the more robots."""
    decomposed = decompose(Environment.load(maps.path("room3")), "inflection")
    lengths = np.hypot(*(decomposed.centroids[:, None] - decomposed.centroids).transpose(2, 0, 1))
    return np.where(mutual_visibility(decomposed).toarray(), lengths**2, np.inf)


@settings(max_examples=80)
@given(seed=st.integers(0, 2**32 - 1), number=st.integers(1, 5), terminals=st.integers(1, 4), robots=st.integers(0, 4))
def test_no_placement_of_the_robots_is_cheaper(seed: int, number: int, terminals: int, robots: int) -> None:
    random = np.random.default_rng(seed)
    for _ in range(10):
        W = random_weights(random, number)
        chosen = random.integers(0, number, terminals).tolist()
        standing = random.random(number) < 0.7
        least = least_cost_of_size(W, chosen, robots, standing)
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
        costs = []
        for vertices in range(terminals, len(free.nodes) + 3):
            try:
                tree = steiner_tree(cells, chosen, vertices=vertices)
            except NoTree:
                assert not costs
                continue
            check_tree(cells, tree, chosen, vertices)
            costs.append(tree.cost)
        assert (np.diff(costs) <= 1e-9).all()
        assert costs[-3:] == pytest.approx([free.cost] * 3)
        assert costs[0] > 1.4 * free.cost
        check_tree(cells, steiner_tree(cells, chosen, vertices=500), chosen, 500)


def test_the_counted_tree_is_the_free_one_when_robots_are_enough(cells: Floats) -> None:
    chosen = np.array([3, 60, 91, 20])
    free = steiner_tree(cells, chosen)
    for robots in range(len(free.nodes) - 4, len(free.nodes) - 1):
        tree = _counted_tree(cells, chosen, robots, np.ones(len(cells), dtype=bool))
        assert tree is not None
        check_tree(cells, tree, chosen.tolist(), 4 + robots)
        assert tree.cost == pytest.approx(free.cost)


def test_too_few_nodes_are_told_how_many_it_takes() -> None:
    W = np.full((5, 5), np.inf)
    for u in range(4):
        W[u, u + 1] = W[u + 1, u] = 1.0
    with pytest.raises(NoTree, match=r"4 nodes do not join the terminals in placements \[0, 4, 0\]: it takes 6"):
        steiner_tree(W, [0, 4, 0], vertices=4)
    assert steiner_tree(W, [0, 4, 0], vertices=6).cost == 4.0
    with pytest.raises(NoTree, match="placement 4 cannot be reached"):
        steiner_tree(W, [0, 4], vertices=9, placements=np.array([True, True, False, True, True]))


def test_robots_that_can_stand_nowhere_make_no_larger_tree() -> None:
    with pytest.raises(NoTree, match=r"2 nodes join .*, and robots can stand nowhere in sight, so there cannot be 3"):
        steiner_tree(np.ones((2, 2)), [0, 1], vertices=3, placements=np.zeros(2, dtype=bool))


def test_robots_that_can_only_stand_aside_hang_from_the_tree() -> None:
    W = np.array([[0.0, 1.0, 5.0], [1.0, 0.0, 3.0], [5.0, 3.0, 0.0]])
    tree = steiner_tree(W, [0, 1], vertices=4, placements=np.array([False, False, True]))
    assert (tree.cost, sorted(tree.nodes.tolist())) == (4.0, [0, 1, 2, 2])
    check_tree(W, tree, [0, 1], 4)


def test_tables_that_would_not_fit_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    W = np.full((9, 9), np.inf)
    for u in range(8):
        W[u, u + 1] = W[u + 1, u] = 1.0
    monkeypatch.setattr(planning.fixed_size_steiner, "LARGEST_TABLE", 2 * 3 * 9)
    with pytest.raises(NoTree, match="it takes 9"):
        steiner_tree(W, [0, 8], vertices=4)
    with pytest.raises(InvalidRequest, match="2 terminals, 3 robots and 9 placements are too many"):
        steiner_tree(W, [0, 8], vertices=5)
