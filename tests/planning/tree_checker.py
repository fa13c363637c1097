"""What makes a tree a tree, asked without the code that made it; and small oracles for its cost."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import combinations, combinations_with_replacement

import numpy as np
import pytest
from numpy.typing import NDArray

from planning.tree import Tree

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


def check_tree(
    W: Floats, tree: Tree, terminals: Sequence[int], vertices: int | None = None, standing: Bools | None = None
) -> None:
    """The tree joins the terminals by links of W at the cost it says, in one piece, with nothing superfluous."""
    nodes, edges = tree.nodes.tolist(), [tuple(edge) for edge in tree.edges.tolist()]
    assert tree.nodes.shape == (len(nodes),)
    assert tree.edges.shape == (len(nodes) - 1, 2)
    assert tree.nodes.dtype.kind == tree.edges.dtype.kind == "i"
    links = [0.0 if u == v else W[u, v] for u, v in edges]
    assert np.isfinite(links).all()
    assert isinstance(tree.cost, float)
    assert tree.cost == pytest.approx(sum(links), rel=1e-12)
    expected = list(dict.fromkeys(terminals)) if vertices is None else list(terminals)
    assert nodes[: len(expected)] == expected
    others = nodes[len(expected) :]
    if standing is not None:
        assert all(standing[v] for v in others)
    joined = {nodes[0]}
    while more := {w for edge in edges for w in edge if joined.intersection(edge)} - joined:
        joined |= more
    assert joined == set(nodes), "in pieces"
    ends = Counter(v for edge in edges for v in edge)
    if vertices is None:
        # As many edges as make a tree, and in one piece: no cycle either.
        assert len(joined) == len(nodes)
        assert all(ends[v] >= 2 for v in others), "a leaf that is no terminal"
        return
    assert len(nodes) == vertices
    for v in joined:
        # Nodes in one placement are told apart by nothing, but there have to be ends of edges for all of them, and
        # the edges between them must not close a cycle.
        assert edges.count((v, v)) < nodes.count(v) <= max(1, ends[v])


def random_weights(random: np.random.Generator, number: int, share: float = 0.6) -> Floats:
    """Links between some pairs; small whole numbers or not, so that ties and zeros occur."""
    W = random.integers(0, 4, (number, number)).astype(float)
    if random.random() < 0.5:
        W += random.random((number, number))
    W[random.random((number, number)) >= share] = np.inf
    W = np.minimum(W, W.T)
    np.fill_diagonal(W, 0.0)
    return W


def spanning_cost(W: Floats, nodes: Sequence[int]) -> float:
    """Cost of the minimum spanning tree of the direct links between these nodes, which may repeat (Prim)."""
    links = W[np.ix_(nodes, nodes)].tolist()
    nearest, cost = links[0], 0.0
    waiting = set(range(1, len(nodes)))
    while waiting:
        joined = min(waiting, key=nearest.__getitem__)
        cost += nearest[joined]
        waiting.remove(joined)
        nearest = list(map(min, nearest, links[joined]))
    return cost


def least_cost(W: Floats, terminals: Sequence[int], standing: Bools | None = None) -> float:
    """Cost of the Steiner tree, over all sets of placements besides the terminals."""
    distinct = list(dict.fromkeys(terminals))
    others = [v for v in range(len(W)) if v not in distinct and (standing is None or standing[v])]
    return min(
        spanning_cost(W, [*distinct, *chosen])
        for size in range(len(others) + 1)
        for chosen in combinations(others, size)
    )


def least_cost_as_printed(distances: Floats, terminals: Sequence[int]) -> float:
    """Cost of the Steiner tree by algorithm 1 of the thesis, all placements at once; distances are of all pairs."""
    last = len(terminals) - 1
    s = {1 << i: distances[terminals[i]] for i in range(last)}
    for X in range(1, 1 << last):
        if X not in s:
            split = np.min([s[Y] + s[X ^ Y] for Y in range(1, X) if Y & X == Y], axis=0)
            s[X] = (distances + split).min(axis=1)
    return float(s[(1 << last) - 1][terminals[last]])


def least_cost_of_size(W: Floats, terminals: Sequence[int], robots: int, standing: Bools) -> float:
    """Cost of the fixed-size Steiner tree, over all placements of the robots."""
    chosen = combinations_with_replacement(np.flatnonzero(standing).tolist(), robots)
    return min((spanning_cost(W, [*terminals, *cells]) for cells in chosen), default=np.inf)
