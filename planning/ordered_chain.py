"""The cheapest chain of robots that keep an order: a shortest path through robots and places at once.

With the robots in an order, spares among them left out, the chain is a shortest path in the layered graph of (robot,
place):

    G_i(v) = c_i(v) + min(W(base, v), min over j < i and u of G_j(u) + W(u, v))

is the cheapest chain from the base whose last relay is robot i in place v. O(k N²) instead of the exponential search
of `planning.chain` over all orders, so it serves where there are many robots. A chain in motion stretches and shrinks
like a snake: the order of the chain that stands loses little.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_BASE = -1
_NOBODY = -2


def search_in_order(
    W: Floats, costs: Floats, from_base: Floats, to_agent: Floats
) -> tuple[list[int], list[int], float] | None:
    """Robots, places and cost of the cheapest chain whose robots are in the order of their rows, from the base outward.

    Args:
        W: (N, N) float, weights of the links, not negative; inf where there is none.
        costs: (k, N) float, what it costs that robot i is the relay in place v; inf where it cannot be.
        from_base: (N,) float, weight of the first link; inf where the base is not seen.
        to_agent: (N,) float, weight of the last link; inf where the agent is not seen.

    Returns:
        None if the robots cannot form a chain in this order.

    Complexity: O(k N²).
    """
    last, place, cost, robots_before, places_before = _search(W, costs, from_base, to_agent)
    if last < 0:
        return None
    robots, places = [], []
    while last >= 0:
        robots.append(int(last))
        places.append(int(place))
        last, place = robots_before[last, place], places_before[last, place]
    return robots[::-1], places[::-1], float(cost)


@kernel
def _search(W: Floats, costs: Floats, from_base: Floats, to_agent: Floats) -> tuple[int, int, float, Ints, Ints]:
    """Last robot (-1: no chain) and its place, cost, and for each robot and place the robot and place before."""
    robots, number = costs.shape
    robots_before = np.empty((robots, number), dtype=np.int32)
    places_before = np.empty((robots, number), dtype=np.int32)
    # What it costs to see a place from the best chain of the robots so far, and how that chain ends.
    seen = from_base.copy()
    seen_robot = np.full(number, _BASE, dtype=np.int32)
    seen_place = np.full(number, _BASE, dtype=np.int32)
    best, best_robot, best_place = np.inf, _NOBODY, _NOBODY
    reached = np.empty(number)
    for i in range(robots):
        for v in range(number):
            reached[v] = seen[v] + costs[i, v]
            robots_before[i, v] = seen_robot[v]
            places_before[i, v] = seen_place[v]
            if reached[v] + to_agent[v] < best:
                best, best_robot, best_place = reached[v] + to_agent[v], i, v
        if i == robots - 1:
            break
        for u in range(number):
            # Weights are not negative, so a chain as dear as a complete one leads to nothing better.
            if reached[u] >= best:
                continue
            for v in range(number):
                if reached[u] + W[u, v] < seen[v]:
                    seen[v] = reached[u] + W[u, v]
                    seen_robot[v] = i
                    seen_place[v] = u
    return best_robot, best_place, best, robots_before, places_before
