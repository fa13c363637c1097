"""Chains by subsets of robots: on points of room3 with exact visibility, and on its 681 aspect cells.

Base station and agent are as far apart as places are, and the robots anywhere, so that chains are long and who goes
where matters.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

import maps
from planning.chain import cheapest_chain
from planning.decomposition import decompose
from planning.edge_weights import virtual_weights
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from planning.mutual_visibility import mutual_visibility
from tests.benchmarks.timing import Case, seconds_of

Floats = NDArray[np.float64]

POINTS = 240
RELAY_M = 1.5
METRES_PER_WEIGHT = 3.0


def cases() -> Iterator[Case]:
    """Name, target in seconds, what to time; and where it takes no minute, the same without bounds in numpy."""
    room3 = Environment.load(maps.path("room3"))
    geodesics = GeodesicMap(room3)
    cells = decompose(room3, "aspect")
    rng = np.random.default_rng(1)
    drawn = rng.uniform(room3.bounds[:2], room3.bounds[2:], (4 * POINTS, 2))
    points = drawn[room3.contains(drawn)][:POINTS]
    for what, places, weights in (
        ("points", points, _weigh(room3, points)),
        ("cells", cells.centroids, virtual_weights(cells, mutual_visibility(cells))),
    ):
        for robots, target_s in ((4, 1e-3), (6, 1e-3), (8, 2e-3), (10, 5e-3)):
            asked = _ask(geodesics, places, METRES_PER_WEIGHT * weights, robots)
            name = f"chain by subsets, {robots} robots, {len(places)} {what}"
            if robots <= 6:
                yield name, target_s, partial(cheapest_chain, *asked), "numpy", partial(seconds_of, least_cost, *asked)
            else:
                yield name, target_s, partial(cheapest_chain, *asked)


def least_cost(W: Floats, move: Floats, from_base: Floats, to_agent: Floats, relay_cost: float) -> float:
    """The cost of the cheapest chain by the recursion over subsets as it is written, without any bound."""
    robots, number = move.shape
    F = np.full((1 << robots, number), np.inf)
    for S in range(1, 1 << robots):
        for j in range(robots):
            if S >> j & 1:
                before = S & ~(1 << j)
                seen = from_base if before == 0 else np.min(F[before][:, None] + W, axis=0)
                F[S] = np.minimum(F[S], seen + move[j] + relay_cost)
    return float(np.min(F + to_agent))


def _weigh(environment: Environment, points: Floats) -> Floats:
    """Weights between points that see each other: half a link and what share of the greatest distance it spans."""
    distances = np.hypot(*(points[:, None] - points).transpose(2, 0, 1))
    weights = np.where(environment.visibility_matrix(points), 0.5 + distances / distances.max(), np.inf)
    np.fill_diagonal(weights, 0.0)
    return weights


def _ask(
    geodesics: GeodesicMap, places: Floats, W: Floats, robots: int
) -> tuple[Floats, Floats, Floats, Floats, float]:
    """The arguments of a chain between the place farthest from the first one and the one farthest from that."""
    base = int(geodesics.lengths(places[0], places).argmax())
    agent = int(geodesics.lengths(places[base], places).argmax())
    stand = np.random.default_rng(robots).choice(len(places), robots, replace=False)
    move = np.array([geodesics.lengths(places[place], places) for place in stand])
    return W, move, W[base], W[agent], RELAY_M
