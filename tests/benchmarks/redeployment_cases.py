"""Redeployments on room3 with bitangents, cut down to the numbers of cells that the targets name."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

import maps
from planning import Environment, decompose, mutual_visibility, redeploy, virtual_weights
from tests.benchmarks.timing import Case, seconds_of
from tests.planning.redeployment_oracles import naive_one_edge

MU = 5.0
"""Metres that a robot moves for one unit of virtual weight."""


def cases() -> Iterator[Case]:
    """Name, target in seconds, what to time; then a name and the same work done as the thesis does it."""
    cells = decompose(Environment.load(maps.path("room3")), "aspect")
    weights = virtual_weights(cells, mutual_visibility(cells))
    lengths = np.hypot(*(cells.centroids[:, None] - cells.centroids[None]).T)
    rng = np.random.default_rng(3)

    def instance(k: int, number: int) -> tuple[np.ndarray, np.ndarray]:
        """A base, an agent and k - 2 robots, moving in straight lines."""
        places = rng.integers(0, number, k)
        move = lengths[places, :number]
        move[:2] = np.where(np.arange(number) == places[:2, None], 0.0, np.inf)
        return move, np.ascontiguousarray(weights[:number, :number])

    for k, target_s in ((4, 0.002), (6, 0.005), (8, 0.010)):
        move, W = instance(k, 570)
        line = [(0, 2), *((i, i + 1) for i in range(2, k - 1)), (k - 1, 1)]
        if k == 8:
            yield f"fixed topology, line of k = {k}, 570 cells", 0.005, partial(redeploy, move, W, MU, "fixed", line)
        yield (
            f"one-edge, line of k = {k}, 570 cells",
            target_s,
            partial(redeploy, move, W, MU, "one-edge", line),
            "algorithm 7 in numpy",
            partial(seconds_of, naive_one_edge, move, W, MU, line),
        )
    for k, target_s in ((6, 0.020), (8, 0.080), (10, 0.400)):
        move, W = instance(k, 638)
        yield f"exact, k = {k}, 638 cells", target_s, partial(redeploy, move, W, MU)
