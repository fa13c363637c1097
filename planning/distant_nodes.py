"""How much a redeployment costs at least, seen from a few nodes that are far apart: what it takes to join these.

Counting robots together (`planning.redeployment_bound`) says little where they are many, for a robot that is counted
for all of its kind is everywhere at no cost. This bound keeps the names of a few nodes S, and lets all others serve in
any number. The part of a redeployment that joins S is a tree whose leaves are in S; of the others

- those with two neighbours are relays on a way between two nodes: they make links of more than one hop,

      W*(u, v) = min over ways u, w1, …, wn, v of μ W[u, w1] + c(w1) + … + c(wn) + μ W[wn, v]

- those with more are where it branches, and there are at most |S| − 2 of these.

c(v) is what it costs the cheapest of the others to go to v. So the subset programme over W*, with the nodes of S and
|S| − 2 others at c, of which any number may be left out, gives a lower bound. What others that may not idle pay in any
case, wherever they go, is added; c counts only what is beyond that.

The nodes that are chosen are those that are dearest to join: first the root, then always the one that is the farthest
from those chosen (T. F. Gonzalez 1985, doi:10.1016/0304-3975(85)90224-5).
"""

from __future__ import annotations

import numpy as np

from planning.min_plus import Links, min_plus, scaled_links
from planning.redeployment_bound import ROUNDING
from planning.shortest_paths import all_pairs
from planning.subset_programme import solve_subsets
from planning.tree import Floats

DEAR = 10.0
"""Times the greatest cost there is: what going costs where none of the others can go. Any finite number gives a bound,
and a small one little rounding."""


def bound_by_distant(links: Links, move: Floats, ends: list[int], number: int) -> float:
    """What no tree costs less than; inf if it finds that there is none.

    Args:
        links: of N placements.
        move: (k, N) float, not negative: what it costs node i to go to placement v; inf where it cannot.
        ends: nodes that are needed, the first of them the root; all nodes if none may idle.
        number: |S| − 1, how many needed nodes are chosen besides the root, if there are as many.

    Complexity: O(N³ + k N² + k² N), and O(3^|S| |S|² N + 2^|S| |S| N²) for the programme.
    """
    always = np.where(np.isin(np.arange(len(move)), ends), move.min(axis=1), 0.0)
    if np.isinf(always).any():
        return np.inf
    beyond = move - always[:, None]
    chosen = _choose(_join_by_ways(links, beyond.min(axis=0)), beyond, ends, number)
    costs, numbers, needed = beyond[chosen[1:]], [1] * (len(chosen) - 1), [True] * (len(chosen) - 1)
    others = np.delete(beyond, chosen, axis=0)
    if len(others):
        links = _join_by_ways(links, others.min(axis=0))
        if len(chosen) > 2:
            costs = np.concatenate((costs, others.min(axis=0, keepdims=True)))
            numbers, needed = [*numbers, len(chosen) - 2], [*needed, False]
    cost = solve_subsets(links, beyond[chosen[0]], costs, numbers, needed).cost
    if np.isinf(cost):
        return np.inf
    return float(always.sum() + cost - ROUNDING * (always.sum() + cost + _greatest(links, beyond)))


def _choose(links: Links, move: Floats, ends: list[int], number: int) -> list[int]:
    """The root, and the needed nodes that are the farthest from those chosen before."""
    candidates = np.array(ends)
    hung = min_plus(links, np.ascontiguousarray(move[candidates]))
    chosen, far = [0], np.full(len(candidates), np.inf)
    while len(chosen) <= min(number, len(candidates) - 1):
        far = np.minimum(far, (hung[chosen[-1]] + move[candidates]).min(axis=1))
        far[chosen] = -1.0
        chosen.append(int(np.argmax(far)))
    return [ends[place] for place in chosen]


def _join_by_ways(links: Links, cost: Floats) -> Links:
    """W*, of relays that cost (N,) float."""
    W = np.full((links.number, links.number), np.inf)
    rows = np.repeat(np.arange(links.number), np.diff(links.starts))
    W[rows, links.neighbours] = links.weights
    np.fill_diagonal(W, 0.0)
    half = 0.5 * np.where(np.isfinite(cost), cost, DEAR * _greatest(links, cost))
    halves = half[:, None] + half
    ways, _ = all_pairs(W + halves)
    return scaled_links(np.minimum(W, np.maximum(ways - halves, 0.0)), 1.0)


def _greatest(links: Links, costs: Floats) -> float:
    """Of the finite costs and weights."""
    return float(
        max(costs.max(where=costs < np.inf, initial=0.0), links.weights.max(where=links.weights < np.inf, initial=0.0))
    )
