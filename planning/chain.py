"""The cheapest chain for robots that are already somewhere: a shortest path through cells and robots at once.

Robots move to their places, so besides the virtual weights of its links a chain costs what the robots drive. Which
robot takes which place is part of the question. Here the robots keep an order (that of the chain they form, spares
last) and any of them may be left out, which makes the question a shortest path in the layered graph of (robot, cell):

    G_i(v) = move_i(v) + r + min(W(base, v), min over j < i and u of G_j(u) + W(u, v))

is the cheapest chain from the base whose last relay is robot i in cell v; r is what a relay costs by itself. A chain in
motion stretches and shrinks like a snake, so little is lost by the order, and k robots take O(k N²) instead of the
O(2^k k N²) of a search over all orders.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_BASE = -1
_NOBODY = -2


@dataclass(frozen=True, slots=True)
class Chain:
    """Relays from the base outward."""

    robots: tuple[int, ...]
    """Rows of ``move``, rising."""
    cells: tuple[int, ...]
    """Where they stand; as many."""
    cost: float


def cheapest_chain(W: Floats, move: Floats, from_base: Floats, to_agent: Floats, relay_cost: float) -> Chain | None:
    """The cheapest chain of at least one relay.

    Args:
        W: (N, N) float, weights of the links, not negative; inf where there is none.
        move: (k, N) float, what it costs robot i to go to cell v; inf where it cannot. Relays keep the order of rows.
        from_base: (N,) float, weight of the first link; inf where the base is not seen.
        to_agent: (N,) float, weight of the last link; inf where the agent is not seen.
        relay_cost: what every relay costs by itself; above 0, so that no two relays share a cell.

    Returns:
        None if k robots cannot form a chain.

    Complexity: O(k N²).
    """
    last, cell, cost, robots_before, cells_before = _search(
        np.ascontiguousarray(W), np.ascontiguousarray(move), from_base, to_agent, relay_cost
    )
    if last < 0:
        return None
    robots, cells = [], []
    while last >= 0:
        robots.append(int(last))
        cells.append(int(cell))
        last, cell = robots_before[last, cell], cells_before[last, cell]
    return Chain(tuple(reversed(robots)), tuple(reversed(cells)), float(cost))


@kernel
def _search(
    W: Floats, move: Floats, from_base: Floats, to_agent: Floats, relay_cost: float
) -> tuple[int, int, float, Ints, Ints]:
    """Last robot (-1: no chain) and its cell, cost, and for each robot and cell the robot and cell before."""
    robots, number = move.shape
    robots_before = np.empty((robots, number), dtype=np.int32)
    cells_before = np.empty((robots, number), dtype=np.int32)
    # What it costs to see a cell from the best chain of the robots so far, and how that chain ends.
    seen = from_base.copy()
    seen_robot = np.full(number, _BASE, dtype=np.int32)
    seen_cell = np.full(number, _BASE, dtype=np.int32)
    best, best_robot, best_cell = np.inf, _NOBODY, _NOBODY
    reached = np.empty(number)
    for i in range(robots):
        for v in range(number):
            reached[v] = seen[v] + move[i, v] + relay_cost
            robots_before[i, v] = seen_robot[v]
            cells_before[i, v] = seen_cell[v]
            if reached[v] + to_agent[v] < best:
                best, best_robot, best_cell = reached[v] + to_agent[v], i, v
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
                    seen_cell[v] = u
    return best_robot, best_cell, best, robots_before, cells_before
