"""Deployments against networkx, assignments against all permutations."""

from __future__ import annotations

from itertools import pairwise, permutations
from typing import Any

import networkx as nx
import numpy as np
import pytest
from numpy.typing import NDArray

from planning.deployment import (
    NO_CHAIN,
    NoChain,
    TooFewRobots,
    identify_robots,
    relays_needed,
    shortest_path_deployment,
)


def _graph(seed: int, number: int = 30) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Weights of a sparse random graph, in several parts for some seeds, and which cells are placements."""
    random = np.random.default_rng(seed)
    W = np.where(random.random((number, number)) < 0.08, random.uniform(1, 2, (number, number)), np.inf)
    W = np.minimum(W, W.T)
    np.fill_diagonal(W, 0.0)
    return W, random.random(number) < 0.7


def _through(W: NDArray[np.float64], placements: NDArray[np.bool_], base: int, agent: int) -> Any:
    """The graph of the placements and two ends."""
    keep = [int(cell) for cell in np.flatnonzero(placements)] + [base, agent]
    graph: Any = nx.Graph()
    graph.add_nodes_from(keep)
    graph.add_weighted_edges_from((u, v, W[u, v]) for u in keep for v in keep if u < v and np.isfinite(W[u, v]))
    return graph


@pytest.mark.parametrize("seed", range(6))
def test_chain_is_the_shortest_path_through_placements(seed: int) -> None:
    W, placements = _graph(seed)
    base = seed
    for agent in range(len(W)):
        graph = _through(W, placements, base, agent)
        if not nx.has_path(graph, base, agent):
            with pytest.raises(NoChain, match=f"the agent's cell {agent}"):
                shortest_path_deployment(W, base, agent, placements)
            continue
        found = shortest_path_deployment(W, base, agent, placements)
        assert found.cost == pytest.approx(nx.dijkstra_path_length(graph, base, agent))
        assert found.nodes[0] == "base"
        assert found.nodes[-1] == "agent"
        assert (found.cells[0], found.cells[-1]) == (base, agent)
        assert placements[list(found.cells[1:-1])].all()
        assert found.edges == tuple(pairwise(found.nodes))
        cell = dict(zip(found.nodes, found.cells, strict=True))
        assert found.cost == pytest.approx(sum(W[cell[a], cell[b]] for a, b in found.edges))


@pytest.mark.parametrize("seed", range(6))
def test_fewest_relays_are_the_hops_of_a_breadth_first_search(seed: int) -> None:
    W, placements = _graph(seed)
    base = seed
    needed = relays_needed(W, base, placements)
    for agent in range(len(W)):
        graph = _through(W, placements, base, agent)
        if agent == base:
            assert needed[agent] == 0
        elif nx.has_path(graph, base, agent):
            assert needed[agent] == nx.shortest_path_length(graph, base, agent) - 1
        else:
            assert needed[agent] == NO_CHAIN


def test_no_relay_within_one_cell() -> None:
    W = np.full((2, 2), np.inf)
    np.fill_diagonal(W, 0.0)
    found = shortest_path_deployment(W, 1, 1)
    assert found.nodes == ("base", "agent")
    assert found.edges == (("base", "agent"),)
    assert found.cells == (1, 1)
    assert found.cost == 0.0


@pytest.mark.parametrize("cell", [-1, 2])
def test_cells_outside_the_map_are_named(cell: int) -> None:
    with pytest.raises(NoChain, match=f"cell {cell} does not exist"):
        shortest_path_deployment(np.zeros((2, 2)), 0, cell)


@pytest.mark.parametrize("seed", range(8))
def test_robots_are_identified_at_the_least_cost(seed: int) -> None:
    random = np.random.default_rng(seed)
    robots, places = 5, seed % 5
    costs = random.uniform(0, 10, (robots, places))
    costs[random.random(costs.shape) < 0.2] = np.inf
    least = min(sum(costs[robot, place] for place, robot in enumerate(p)) for p in permutations(range(robots), places))
    if np.isinf(least):
        with pytest.raises(TooFewRobots, match="no assignment"):
            identify_robots(costs)
        return
    chosen = identify_robots(costs)
    assert len(set(chosen.tolist())) == places
    assert costs[chosen, np.arange(places)].sum() == pytest.approx(least)


def test_too_few_robots_are_counted() -> None:
    with pytest.raises(TooFewRobots, match="2 too few"):
        identify_robots(np.zeros((1, 3)))
