"""Deployments against networkx, assignments against all permutations."""

from __future__ import annotations

from itertools import pairwise, permutations
from typing import Any

import networkx as nx
import numpy as np
import pytest
from numpy.typing import NDArray

from planning.deployment import (
    IDLE,
    Deployment,
    InvalidDeployment,
    NoChain,
    TooFewRobots,
    identify_robots,
    shortest_path_deployment,
)
from planning.tree import Tree


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
        assert found.virtual_cost(W) == pytest.approx(nx.dijkstra_path_length(graph, base, agent))
        assert found.is_mutually_visible(W)
        assert found.is_tree
        assert found.robots == found.nodes[1:-1]
        assert found.nodes[0] == "base"
        assert found.nodes[-1] == "agent"
        assert (found.cells[0], found.cells[-1]) == (base, agent)
        assert placements[list(found.cells[1:-1])].all()
        assert found.edges == tuple(pairwise(found.nodes))
        cell = dict(zip(found.nodes, found.cells, strict=True))
        assert found.virtual_cost(W) == pytest.approx(sum(W[cell[a], cell[b]] for a, b in found.edges))


def test_no_relay_within_one_cell() -> None:
    W = np.full((2, 2), np.inf)
    np.fill_diagonal(W, 0.0)
    found = shortest_path_deployment(W, 1, 1)
    assert found.nodes == ("base", "agent")
    assert found.edges == (("base", "agent"),)
    assert found.cells == (1, 1)
    assert found.robots == ()
    assert found.virtual_cost(W) == 0.0


def test_a_deployment_is_mutually_visible_if_all_edges_are() -> None:
    W = np.array([[0.0, 1.0, np.inf], [1.0, 0.0, 2.0], [np.inf, 2.0, 0.0]])
    nodes, robots = ("base", "a", "b", "agent"), ("a", "b")
    chain = (("base", "a"), ("a", "b"), ("b", "agent"))
    seen = Deployment(nodes, chain, (0, 1, 1, 2), robots)
    assert seen.virtual_cost(W) == 3.0
    assert seen.is_mutually_visible(W)
    assert seen.is_tree
    hidden = Deployment(nodes, chain, (0, 0, 2, 2), robots)
    assert hidden.virtual_cost(W) == np.inf
    assert not hidden.is_mutually_visible(W)
    ring = Deployment(nodes, (*chain, ("base", "b")), (0, 1, 1, 2), robots)
    assert ring.virtual_cost(W) == 4.0
    assert not ring.is_tree


def test_robots_that_idle_are_in_no_relation() -> None:
    waiting = Deployment(("base", "a", "agent"), (("base", "agent"),), (0, IDLE, 0), ("a",))
    assert waiting.is_tree
    assert waiting.cell_of("a") == IDLE
    assert waiting.virtual_cost(np.zeros((1, 1))) == 0.0


@pytest.mark.parametrize(
    ("nodes", "edges", "cells", "robots", "words"),
    [
        (("a", "a"), (("a", "a"),), (0, 0), (), "node 'a' comes twice"),
        (("a", "b"), (("a", "b"),), (0, 0), ("b", "b"), "robot 'b' comes twice"),
        (("a", "b"), (("a", "b"),), (0, 0), ("c",), "robot 'c' is none of the nodes a, b"),
        (("a", "b"), (("a", "b"),), (0,), (), "2 nodes have as many cells, not 1"),
        (("a", "b"), (("a", "b"),), (0, -2), ("b",), "node 'b' is in cell -2"),
        (("a", "b"), (), (0, IDLE), (), "node 'b' is in cell -1"),
        (("a", "b"), (("a", "c"),), (0, 0), (), "edge 'a'-'c' joins 'c', which is no node"),
        (("a", "b"), (("a", "b"), ("b", "a")), (0, 0), (), "edge 'b'-'a' comes twice"),
        (("a", "b"), (("a", "a"),), (0, 0), (), "edge 'a'-'a' joins a node to itself"),
        (("a", "b"), (("a", "b"),), (0, IDLE), ("b",), "edge 'a'-'b' joins a robot that idles"),
        (("a", "b", "c"), (("a", "b"),), (0, 0, 0), (), "nodes 'a' and 'c' are not connected"),
    ],
)
def test_what_is_no_deployment_is_refused(nodes: Any, edges: Any, cells: Any, robots: Any, words: str) -> None:
    with pytest.raises(InvalidDeployment, match=words):
        Deployment(nodes, edges, cells, robots)


@pytest.mark.parametrize("seed", range(6))
def test_a_tree_becomes_a_deployment_of_its_cost(seed: int) -> None:
    """A random tree over some placements of a complete graph; two of the terminals share a placement."""
    random = np.random.default_rng(seed)
    W = random.uniform(1, 2, (9, 9))
    W = np.minimum(W, W.T)
    np.fill_diagonal(W, 0.0)
    nodes = random.permutation(9)[:6]
    edges = np.array([(nodes[i], nodes[random.integers(i)]) for i in range(1, 6)])
    tree = Tree(float(W[edges[:, 0], edges[:, 1]].sum()), edges, nodes)
    terminals = {"base": int(nodes[0]), "north": int(nodes[1]), "south": int(nodes[1])}
    deployment = Deployment.from_tree(tree, terminals)
    assert deployment.is_tree
    assert deployment.robots == ("relay1", "relay2", "relay3", "relay4")
    assert {name: deployment.cell_of(name) for name in terminals} == terminals
    assert sorted({*deployment.cells}) == sorted(nodes.tolist())
    assert deployment.virtual_cost(W) == pytest.approx(tree.cost)


def test_trees_that_name_no_deployment_are_refused() -> None:
    tree = Tree(0.0, np.array([(0, 1), (1, 1)]), np.array([0, 1, 1]))
    with pytest.raises(InvalidDeployment, match="several nodes of the tree are in one placement"):
        Deployment.from_tree(tree, {"base": 0})
    with pytest.raises(InvalidDeployment, match="terminal 'agent' is in placement 7"):
        Deployment.from_tree(tree, {"agent": 7})


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
