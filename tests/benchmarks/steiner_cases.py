"""Steiner trees on the virtual weights of room3 with bitangents: all 681 cells, and 570 of them.

A case answers for several sets of terminals, because some are several times as hard as others, and says what one took
on the average. References: networkx' approximation, and the thesis' programme in numpy with all shortest paths given.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import Any

import networkx as nx
import numpy as np
from numpy.typing import NDArray

import maps
from planning.decomposition import decompose
from planning.edge_weights import virtual_weights
from planning.environment import Environment
from planning.mutual_visibility import mutual_visibility
from planning.shortest_paths import all_pairs
from planning.steiner import steiner_tree
from planning.tree import NoTree
from tests.planning.tree_checker import least_cost_as_printed

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Case = tuple[str, float, Callable[[], object]] | tuple[str, float, Callable[[], object], str, Callable[[], object]]

QUESTIONS = 10
"""Sets of terminals that a case answers for."""


def cases() -> Iterator[Case]:
    """Name, target in seconds, what to time; and what to compare it with, where there is something."""
    room3 = decompose(Environment.load(maps.path("room3")), "aspect")
    whole = virtual_weights(room3, mutual_visibility(room3))
    rng = np.random.default_rng(1)
    kept = np.sort(rng.permutation(len(whole))[:570])
    for W, targets in ((whole[np.ix_(kept, kept)], (3e-3, 12e-3)), (whole, (4e-3, 17e-3))):
        distances, _ = all_pairs(W)
        graph: Any = nx.Graph()
        graph.add_weighted_edges_from((u, v, W[u, v]) for u, v in combinations(range(len(W)), 2) if W[u, v] < np.inf)
        for terminals, target_s in zip((5, 8), targets, strict=True):
            asked = [rng.permutation(len(W))[:terminals] for _ in range(QUESTIONS)]
            size = f"{len(W)} cells, {terminals} terminals"

            def exact(terminals: Ints, W: Floats = W) -> object:
                return steiner_tree(W, terminals)

            def printed(terminals: Ints, distances: Floats = distances) -> object:
                return least_cost_as_printed(distances, terminals)

            def spanning(terminals: Ints, W: Floats = W) -> object:
                return steiner_tree(W, terminals, "mst")

            def growing(terminals: Ints, W: Floats = W) -> object:
                return steiner_tree(W, terminals, "takahashi-matsuyama")

            def networkx(terminals: Ints, graph: Any = graph) -> object:
                return nx.algorithms.approximation.steiner_tree(graph, terminals.tolist(), method="mehlhorn")

            yield f"Steiner tree, exact, {size}", target_s, _mean(exact, asked), "numpy", _mean(printed, asked[:2])
            yield f"Steiner tree, MST, {size}", 3e-3, _mean(spanning, asked), "networkx", _mean(networkx, asked[:1])
            yield f"Steiner tree, T.–M., {size}", 3e-3, _mean(growing, asked), "networkx", _mean(networkx, asked[:1])

    # Squared lengths, as of the power that a radio needs: the more robots, the cheaper, so that their number counts.
    lengths = np.hypot(*(room3.centroids[:, None] - room3.centroids).transpose(2, 0, 1))
    squared = np.where(np.isfinite(whole), lengths**2, np.inf)
    for terminals, robots, target_s in ((2, 6, 15e-3), (5, 6, 30e-3)):
        asked = [rng.permutation(len(whole))[:terminals] for _ in range(QUESTIONS)]

        def counted(terminals: Ints, robots: int = robots) -> object:
            try:
                return steiner_tree(squared, terminals, vertices=len(terminals) + robots)
            except NoTree:
                return None

        size = f"{len(whole)} cells, {terminals} terminals, {robots} robots"
        yield f"Steiner tree of fixed size, {size}", target_s, _mean(counted, asked)


def _mean(answer: Callable[[Ints], object], asked: Sequence[Ints]) -> Callable[[], float]:
    """Seconds that one of these questions takes on the average."""

    def run() -> float:
        begin = time.perf_counter()
        for terminals in asked:
            answer(terminals)
        return (time.perf_counter() - begin) / len(asked)

    return run
