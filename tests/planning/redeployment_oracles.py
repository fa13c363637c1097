"""What judges a redeployment: every tree with every placement, algorithm 7 as printed (corrected), and a checker.

Plain Python and numpy, without anything of `planning`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import combinations, pairwise, permutations, product
from math import inf

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Pairs = list[tuple[int, int]]


@dataclass(frozen=True)
class Case:
    """An instance: k nodes, N placements."""

    move: Floats
    W: Floats
    mu: float
    tree: Pairs
    """A topology to start from."""
    ends: tuple[int, ...]


def cases(nodes: tuple[int, int] = (1, 5), placements: tuple[int, int] = (1, 8)) -> st.SearchStrategy[Case]:
    """Small instances; few draws, so that thousands are cheap."""
    return st.builds(random_case, st.integers(*nodes), st.integers(*placements), st.integers(0, 2**32 - 1))


def random_case(k: int, number: int, seed: int) -> Case:
    """Links missing, terminals, places out of reach, ties, weights of zero, μ = 0, equal rows."""
    rng = np.random.default_rng(seed)
    whole = rng.random() < 0.5  # whole numbers: ties

    def numbers(shape: tuple[int, ...], greatest: int) -> Floats:
        return np.floor(rng.uniform(0, greatest + 1, shape)) if whole else rng.uniform(0, greatest, shape)

    W = numbers((number, number), 4)
    W = np.triu(W, 1) + np.triu(W, 1).T
    missing = np.triu(rng.random((number, number)) < rng.choice([0.0, 0.4, 0.7]), 1)
    W[missing | missing.T] = inf
    move = numbers((k, number), 5)
    move[rng.random(move.shape) < rng.choice([0.0, 0.3])] = inf
    for node in range(k):
        kind = rng.random()
        if kind < 0.3:  # a terminal
            move[node] = inf
            move[node, rng.integers(number)] = 0.0
        elif kind < 0.45 and node:  # where another one starts
            move[node] = move[rng.integers(node)]
    tree = [(int(rng.integers(node)), node) for node in range(1, k)]
    ends = rng.permutation(k)[: rng.integers(1, k + 1)]
    return Case(move, W, float(rng.choice([0.0, 0.5, 1.0, 3.0])), tree, tuple(ends.tolist()))


@cache
def all_trees(nodes: tuple[int, ...]) -> list[Pairs]:
    """Every tree on these nodes, by the sequences of Prüfer."""
    if len(nodes) == 1:
        return [[]]
    return [_tree_of(list(sequence), nodes) for sequence in product(nodes, repeat=len(nodes) - 2)]


def _tree_of(sequence: list[int], nodes: tuple[int, ...]) -> Pairs:
    degrees = {node: 1 + sequence.count(node) for node in nodes}
    edges = []
    for node in sequence:
        leaf = min(other for other in nodes if degrees[other] == 1)
        edges.append((leaf, node))
        degrees[leaf] -= 1
        degrees[node] -= 1
    first, second = (node for node in nodes if degrees[node] == 1)
    return [*edges, (first, second)]


def placed_cost(case: Case, nodes: tuple[int, ...], edges: Pairs) -> float:
    """The least cost of a topology over *all* placements of its nodes, each looked at."""
    links = np.where(np.isinf(case.W), inf, case.mu * np.where(np.isinf(case.W), 0.0, case.W))

    def along(values: Floats, *axes: int) -> Floats:
        return values.reshape([len(case.W) if axis in axes else 1 for axis in range(len(nodes))])

    total = np.zeros((len(case.W),) * len(nodes))
    for axis, node in enumerate(nodes):
        total += along(case.move[node], axis)
    for i, j in edges:
        total += along(links, nodes.index(i), nodes.index(j))
    return float(total.min())


def node_sets(case: Case, idle: bool) -> Iterator[tuple[int, ...]]:
    """The sets of nodes that a tree may be made of."""
    k = len(case.move)
    others = [node for node in range(k) if node not in case.ends]
    if not idle:
        yield tuple(range(k))
        return
    for size in range(len(others) + 1):
        for chosen in combinations(others, size):
            yield tuple(sorted((*case.ends, *chosen)))


def least_cost(case: Case, idle: bool) -> float:
    """The optimum over all topologies and placements."""
    return min(placed_cost(case, nodes, edges) for nodes in node_sets(case, idle) for edges in all_trees(nodes))


def least_chain(case: Case, ends: tuple[int, int]) -> float:
    """The optimum over all chains between two ends: every order of every choice of the others."""
    others = [node for node in range(len(case.move)) if node not in ends]
    chains = ((ends[0], *between, ends[1]) for size in range(len(others) + 1) for between in permutations(others, size))
    return min(placed_cost(case, chain, list(pairwise(chain))) for chain in chains)


def hull(edges: Pairs, ends: tuple[int, ...]) -> tuple[tuple[int, ...], Pairs]:
    """What is left of a tree when leaves that are no ends are plucked until none is."""
    edges = list(edges)
    while True:
        named = [node for edge in edges for node in edge]
        leaf = next((node for node in named if named.count(node) == 1 and node not in ends), None)
        if leaf is None:
            return tuple(sorted({*named, *ends})), edges
        edges = [edge for edge in edges if leaf not in edge]


def kept_cost(case: Case, edges: Pairs, idle: bool) -> float:
    """The least cost of a topology; with ``idle``, of the part that joins the ends."""
    nodes, kept = hull(edges, case.ends) if idle else (tuple(range(len(case.move))), edges)
    return placed_cost(case, nodes, kept)


def single_edge_modifications(edges: Pairs, k: int) -> Iterator[Pairs]:
    """Thesis algorithm 7, line 3 corrected: an edge out, another in between the two sides; the given tree first."""
    yield edges
    for cut in edges:
        rest = [edge for edge in edges if edge != cut]
        side = {cut[0]}
        while any((i in side) != (j in side) for i, j in rest):
            side |= {node for edge in rest if {*edge} & side for node in edge}
        yield from ([*rest, (m, n)] for m in side for n in range(k) if n not in side and (m, n) not in (cut, cut[::-1]))


def one_edge_cost(case: Case, idle: bool) -> float:
    """The least cost of all single-edge modifications, each solved by looking at all placements."""
    return min(kept_cost(case, edges, idle) for edges in single_edge_modifications(case.tree, len(case.move)))


def naive_one_edge(move: Floats, W: Floats, mu: float, edges: Pairs) -> float:
    """Algorithm 7 as the thesis solves it: algorithm 5 in numpy for each modification; fit for hundreds of cells."""
    links = np.where(np.isinf(W), inf, mu * np.where(np.isinf(W), 0.0, W))
    return min(tree_programme(move, links, tree) for tree in single_edge_modifications(edges, len(move)))


def tree_programme(move: Floats, links: Floats, edges: Pairs) -> float:
    """Thesis algorithm 5, corrected, from node 0; (N, N) links are scaled by μ."""

    def rooted(node: int, ancestor: int) -> Floats:
        cost: Floats = move[node].copy()
        for i, j in edges:
            if node in (i, j) and ancestor not in (i, j):
                child = j if i == node else i
                cost += (rooted(child, node) + links).min(axis=1)
        return cost

    return float(rooted(0, -1).min())


def check_redeployment(case: Case, found: object, idle: bool) -> None:
    """That tree and cells are what they are to be, and that the cost is theirs, counted anew."""
    cost, bound, tree, cells = (getattr(found, name) for name in ("cost", "lower_bound", "tree", "cells"))
    k = len(case.move)
    assert bound <= cost
    assert cells.shape == (k,)
    if tree is None:
        assert cost == inf
        assert (cells == -1).all()
        return
    standing = np.flatnonzero(cells >= 0)
    assert ((cells >= -1) & (cells < case.W.shape[0])).all()
    if idle:
        assert {*case.ends} <= {*standing.tolist()}
    else:
        assert len(standing) == k
    assert tree.shape == (len(standing) - 1, 2)
    assert {*tree.ravel().tolist()} <= {*standing.tolist()}
    joined = {int(standing[0])}
    for _ in range(k):
        joined |= {int(node) for edge in tree if {*edge.tolist()} & joined for node in edge}
    assert joined == {*standing.tolist()}  # joined by one edge less than nodes: a tree
    links = [0.0 if cells[i] == cells[j] else case.mu * case.W[cells[i], cells[j]] for i, j in tree]
    assert np.isclose(cost, sum(links) + case.move[standing, cells[standing]].sum(), rtol=1e-12, atol=1e-12)
