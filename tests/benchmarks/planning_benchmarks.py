"""Decomposition, mutual visibility, all pairs and point location on room3 with bitangents (681 cells)."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

import maps
from planning.decomposition import decompose
from planning.edge_weights import virtual_weights
from planning.environment import Environment
from planning.mutual_visibility import mutual_visibility
from planning.shortest_paths import all_pairs


def cases() -> Iterator[tuple[str, float, Callable[[], object]]]:
    """Name, target in seconds, what to time."""
    room3 = Environment.load(maps.path("room3"))
    cells = decompose(room3, "aspect")
    size = f"room3 aspect, {len(cells)} cells"
    weights = virtual_weights(cells, mutual_visibility(cells))
    low, high = room3.bounds[:2], room3.bounds[2:]
    points = np.random.default_rng(1).uniform(low, high, (1000, 2))

    yield f"decomposition, {size}", 0.030, lambda: decompose(room3, "aspect")
    yield f"mutual visibility, {size}", 0.080, lambda: mutual_visibility(cells)
    yield f"all pairs, {size}", 0.400, lambda: all_pairs(weights)
    yield f"locate 1000 points, {size}", 0.001, lambda: cells.locate(points)
