"""Virtual weights against a plain double loop over the thesis' formulas, and what the robot penalty promises."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, cast

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.sparse import csr_array

from planning.edge_weights import SMALLEST_AREA_SHARE, virtual_weights


@dataclass(frozen=True)
class CellsLike:
    """As much of a decomposition as the weights look at."""

    areas: NDArray[np.float64]
    centroids: NDArray[np.float64]


def _instance(seed: int, number: int = 12, share: float = 0.4) -> tuple[Any, csr_array]:
    """Random cells, slivers among them, and a connected random visibility graph."""
    random = np.random.default_rng(seed)
    areas = 10.0 ** random.uniform(-14, 1, number)
    seen = random.random((number, number)) < share
    seen |= seen.T
    for cell in range(1, number):
        neighbour = random.integers(cell)
        seen[cell, neighbour] = seen[neighbour, cell] = True
    np.fill_diagonal(seen, True)
    return CellsLike(areas, random.uniform(0, 20, (number, 2))), csr_array(seen)


def _distance(cells: CellsLike, i: int, j: int) -> float:
    return math.dist(cells.centroids[i], cells.centroids[j])


def _negative_exponential(cells: CellsLike, i: int, j: int) -> float:
    return math.exp(-cells.areas[i]) + math.exp(-cells.areas[j])


def _inverse(cells: CellsLike, i: int, j: int) -> float:
    smallest = SMALLEST_AREA_SHARE * sum(cells.areas)
    return 1 / max(cells.areas[i], smallest) + 1 / max(cells.areas[j], smallest)


def _by_double_loop(cells: CellsLike, seen: csr_array, cost: Any) -> NDArray[np.float64]:
    visible = seen.toarray()
    number = len(cells.areas)
    W = np.full((number, number), math.inf)
    for i in range(number):
        for j in range(number):
            if i == j:
                W[i, j] = 0.0
            elif visible[i, j]:
                W[i, j] = cost(i, j)
    return W


@pytest.mark.parametrize("seed", range(4))
def test_normalised_form_is_equation_25_and_26(seed: int) -> None:
    cells, seen = _instance(seed)
    pairs = [(i, j) for i, j in zip(*seen.nonzero(), strict=True) if i != j]
    farthest = max(_distance(cells, i, j) for i, j in pairs)
    smallest = max(_negative_exponential(cells, i, j) for i, j in pairs)

    def cost(i: int, j: int) -> float:
        return 0.5 * (_distance(cells, i, j) / farthest + _negative_exponential(cells, i, j) / smallest) + 1.01

    W = virtual_weights(cells, seen)
    np.testing.assert_allclose(W, _by_double_loop(cells, seen, cost), rtol=1e-13)
    np.testing.assert_array_equal(W, W.T)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("area_cost", "area"), [("negative-exponential", _negative_exponential), ("inverse", _inverse)]
)
def test_combined_form_is_equation_19_to_23(seed: int, area_cost: Any, area: Any) -> None:
    cells, seen = _instance(seed)

    def cost(i: int, j: int) -> float:
        return 0.7 * _distance(cells, i, j) + 5.0 * cast(float, area(cells, i, j)) + 3.0

    W = virtual_weights(
        cells, seen, form="combined", distance_weight=0.7, area_weight=5.0, area_cost=area_cost, robot_penalty=3.0
    )
    np.testing.assert_allclose(W, _by_double_loop(cells, seen, cost), rtol=1e-13)


def test_combined_form_has_no_penalty_unless_asked() -> None:
    cells, seen = _instance(5)
    W = virtual_weights(cells, seen, form="combined", area_weight=0.0)
    expected = _by_double_loop(cells, seen, lambda i, j: _distance(cells, i, j))
    np.testing.assert_allclose(W, expected, rtol=1e-13)


@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    form=st.sampled_from(["normalised", "combined"]),
    area_cost=st.sampled_from(["negative-exponential", "inverse"]),
)
def test_with_the_pairwise_penalty_one_hop_beats_two(seed: int, form: Any, area_cost: Any) -> None:
    cells, seen = _instance(seed)
    W = virtual_weights(cells, seen, form=form, area_cost=area_cost, robot_penalty="pairwise")
    two_hops = (W[:, :, None] + W[None, :, :] + np.where(np.eye(len(W)), np.inf, 0.0)[:, :, None]).min(axis=1)
    assert np.all(W[seen.toarray()] <= two_hops[seen.toarray()])


@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    form=st.sampled_from(["normalised", "combined"]),
    area_cost=st.sampled_from(["negative-exponential", "inverse"]),
)
def test_with_the_greater_penalty_fewest_hops_always_win(seed: int, form: Any, area_cost: Any) -> None:
    cells, seen = _instance(seed, number=16, share=0.12)
    W = virtual_weights(cells, seen, form=form, area_cost=area_cost, robot_penalty="fewest")
    rows, columns = np.nonzero(np.isfinite(W))
    graph: Any = nx.Graph()
    graph.add_weighted_edges_from(
        (int(i), int(j), float(W[i, j])) for i, j in zip(rows, columns, strict=True) if i != j
    )
    by_weight = dict(nx.all_pairs_dijkstra_path(graph))
    by_hops = dict(nx.all_pairs_shortest_path_length(graph))
    for source, paths in by_weight.items():
        for target, nodes in paths.items():
            assert len(nodes) - 1 == by_hops[source][target]


def test_the_penalty_of_equation_26_does_not_always_give_fewest_hops() -> None:
    """The exception that the module's docstring tells of: three short hops against two long ones."""
    # 0 and 2 are joined by the far-away sliver 1, and by the large cells 3 and 4 close by.
    centroids = np.array([(0.0, 0.0), (20.0, 0.0), (0.0, 0.3), (0.0, 0.1), (0.0, 0.2)])
    cells = CellsLike(np.array([20.0, 0.01, 20.0, 20.0, 20.0]), centroids)
    seen = np.eye(5, dtype=bool)
    for i, j in [(0, 1), (1, 2), (0, 3), (3, 4), (4, 2)]:
        seen[i, j] = seen[j, i] = True
    graph: Any = nx.Graph()
    W = virtual_weights(cast(Any, cells), csr_array(seen))
    graph.add_weighted_edges_from((i, j, W[i, j]) for i in range(5) for j in range(i) if seen[i, j])
    assert nx.shortest_path(graph, 0, 2) == [0, 1, 2]
    assert nx.dijkstra_path(graph, 0, 2) == [0, 3, 4, 2]


def test_one_cell_has_no_edges() -> None:
    cells = CellsLike(np.array([2.0]), np.array([[1.0, 1.0]]))
    for penalty in (None, "pairwise", "fewest"):
        W = virtual_weights(cast(Any, cells), csr_array(np.ones((1, 1), dtype=bool)), robot_penalty=cast(Any, penalty))
        np.testing.assert_array_equal(W, [[0.0]])


def test_cells_too_large_for_the_exponential_still_have_finite_weights() -> None:
    cells = CellsLike(np.array([1e4, 2e4]), np.array([[0.0, 0.0], [30.0, 0.0]]))
    W = virtual_weights(cast(Any, cells), csr_array(np.ones((2, 2), dtype=bool)))
    np.testing.assert_allclose(W, [[0.0, 1.51], [1.51, 0.0]])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"form": "normalized"}, "unknown form"),
        ({"distance_weight": 2.0}, "no coefficients"),
        ({"form": "combined", "area_weight": -1.0}, "at least 0"),
        ({"form": "combined", "distance_weight": math.nan}, "at least 0"),
        ({"area_cost": "area"}, "unknown area cost"),
        ({"robot_penalty": "many"}, "robot penalty"),
        ({"robot_penalty": -1.0}, "robot penalty"),
    ],
)
def test_what_makes_no_sense_is_refused(arguments: dict[str, Any], words: str) -> None:
    cells, seen = _instance(1)
    with pytest.raises(ValueError, match=words):
        virtual_weights(cells, seen, **arguments)
