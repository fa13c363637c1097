"""The cheapest chain for robots that are already somewhere: who takes which place, in which order, and who takes none.

Robots move to their places, so besides the weights of its links a chain costs what the robots drive. With c_j(v) what
it costs that robot j is the relay in place v, the cheapest chain whose relays are the robots S, the last of them in v:

    F[{j}](v) = W(base, v) + c_j(v)
    G[S](w)   = min over v of F[S](v) + W(v, w)
    F[S](w)   = min over j in S of G[S without j](w) + c_j(w)

and the answer is the least F[S](v) + W(v, agent) over all S and v: exact over all choices and orders of robots and all
places, in O(2^k N² + 2^k k N). A bound makes most of that work needless. If robots could serve several times, every
place would get its cheapest robot, and going on from a relay in v to the agent over at most r more would cost

    onward_r(v) = min(onward_{r-1}(v), min over w of W(v, w) + min over j of c_j(w) + onward_{r-1}(w))

with onward_0(v) = W(v, agent). So F[S](v) leads to nothing better where F[S](v) + onward_{k-|S|}(v) is no less than a
chain that is known. One is known from the start: the way of that bound, its places given to different robots.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.deployment import TooFewRobots, identify_robots
from planning.kernel import kernel
from planning.ordered_chain import search_in_order

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_IN_SUBSETS: Final = 12
"""Robots of which all subsets are searched; each one more can take twice as long."""


@dataclass(frozen=True, slots=True)
class Chain:
    """Robots in a row, each in sight of the next."""

    robots: tuple[int, ...]
    """Rows of ``move``, all different, in the order of the chain."""
    cells: tuple[int, ...]
    """Where they stand; as many."""
    cost: float
    lower_bound: float
    """No chain of these robots costs less. Equal to ``cost`` where that is proven to be the least."""


def cheapest_chain(W: Floats, move: Floats, from_base: Floats, to_agent: Floats, relay_cost: float) -> Chain | None:
    """The cheapest chain of at least one relay between a base station and an agent, relays from the base outward.

    Where the base sees the agent no relay is needed; that case is left to the caller.

    Args:
        W: (N, N) float, weights of the links, symmetric, not negative; inf where there is none.
        move: (k, N) float, not negative: what it costs robot i to go to cell v; inf where it cannot, or not in time.
        from_base: (N,) float, not negative: weight of the first link; inf where the base is not seen.
        to_agent: (N,) float, not negative: weight of the last link; inf where the agent is not seen.
        relay_cost: what every relay costs by itself, not negative; above 0, no two relays share a cell.

    Returns:
        The cheapest chain; None if the robots cannot form one. Of more than :data:`MOST_IN_SUBSETS` robots this is so
        if no more than these can be part of a chain cheaper than the one known from the start. Otherwise the answer is
        the better of that one and the cheapest in the order of rows (None if neither exists), and its lower bound says
        how much may be missed.

    Complexity: O(2^k N² + 2^k k N) at worst, about O(k N²) where the bound is close. Beyond the thesis.
    """
    if len(move) == 0:
        return None
    W, costs = np.ascontiguousarray(W), np.ascontiguousarray(move) + relay_cost
    least = costs.min(axis=0)
    onward = _look_onward(W, to_agent, least, len(costs))
    bounds = from_base + least + onward[-1]
    lower_bound = float(bounds.min())
    if np.isinf(lower_bound):
        return None

    def manned(cells: list[int]) -> Chain | None:
        """The chain in these cells with the robots that are cheapest there."""
        try:
            robots = identify_robots(costs[:, cells])
        except TooFewRobots:
            return None
        links = from_base[cells[0]] + sum(W[hop] for hop in pairwise(cells)) + to_agent[cells[-1]]
        cost = float(links + costs[robots, cells].sum())
        return Chain(tuple(robots.tolist()), tuple(cells), cost, min(lower_bound, cost))

    known = manned(_follow(W, least, onward, int(bounds.argmin())))
    candidates = np.arange(len(costs))
    if known is None or len(costs) > MOST_IN_SUBSETS:
        ordered = search_in_order(W, costs, from_base, to_agent)
        if ordered is not None:
            known = min(filter(None, (known, manned(ordered[1]))), key=lambda chain: chain.cost)
    if len(costs) > MOST_IN_SUBSETS and known is not None:
        outward = _look_onward(W, from_base, least, len(costs))[-1]
        candidates = np.flatnonzero((outward + costs + onward[-1] < known.cost).any(axis=1))
    if len(candidates) > MOST_IN_SUBSETS:
        return known
    best = np.inf if known is None else known.cost
    robots, places, cost = _search(W, costs[candidates], from_base, to_agent, onward, best)
    if len(robots) > 0:
        known = Chain(tuple(candidates[robots].tolist()), tuple(places.tolist()), cost, cost)
    return None if known is None else replace(known, lower_bound=known.cost)


def chain_between(move: Floats, W: Floats, ends: tuple[int, int]) -> Chain | None:
    """The cheapest chain between two of the robots (or terminals), as few of the others in between as is cheapest.

    Args:
        move: (k, N) float, not negative: what it costs robot i to go to cell v; inf where it cannot. A terminal has 0
            in one place and inf elsewhere.
        W: (N, N) float as in :func:`cheapest_chain`, 0 on the diagonal, in the unit of ``move``.
        ends: the two rows that the chain begins and ends with.

    Returns:
        The chain with both ends; None if they cannot be joined. Proven as in :func:`cheapest_chain`.
    """
    first, last = ends
    from_first, first_cells = _see(move[first], W)
    to_last, last_cells = _see(move[last], W)
    others = np.delete(np.arange(len(move)), ends)
    relayed = cheapest_chain(W, move[others], from_first, to_last, 0.0)
    met = from_first + move[last]
    cell = int(met.argmin())
    direct = float(met[cell])
    if relayed is None or direct <= relayed.cost:
        if np.isinf(direct):
            return None
        bound = direct if relayed is None else min(direct, relayed.lower_bound)
        return Chain((first, last), (int(first_cells[cell]), cell), direct, bound)
    robots = (first, *others[list(relayed.robots)].tolist(), last)
    cells = (int(first_cells[relayed.cells[0]]), *relayed.cells, int(last_cells[relayed.cells[-1]]))
    return Chain(robots, cells, relayed.cost, min(direct, relayed.lower_bound))


def _see(move: Floats, W: Floats) -> tuple[Floats, Ints]:
    """What it costs that an end, where it likes best, sees each cell: (N,), and where it then stands: (N,)."""
    places = np.flatnonzero(np.isfinite(move))
    if len(places) == 0:
        return np.full(len(W), np.inf), np.zeros(len(W), dtype=np.int64)
    costs = move[places, None] + W[places]
    chosen = costs.argmin(axis=0)
    return costs[chosen, np.arange(len(W))], places[chosen]


@kernel
def _look_onward(W: Floats, to_end: Floats, least: Floats, relays: int) -> Floats:
    """Row r: what going on to an end costs at least from each cell, over at most r more relays: (rounds, N).

    The rows end where the next ones would be the same, or with ``relays - 1``.
    """
    number = len(to_end)
    onward = np.empty((relays, number))
    onward[0] = to_end
    changed = np.isfinite(to_end)
    for r in range(1, relays):
        onward[r] = onward[r - 1]
        for w in range(number):
            if changed[w] and least[w] < np.inf:
                _improve(onward[r], W[w], least[w] + onward[r - 1, w])
        changed = onward[r] < onward[r - 1]
        if not changed.any():
            return onward[:r]
    return onward


@kernel
def _improve(seen: Floats, weights: Floats, cost: float) -> None:
    """Lower ``seen`` to ``cost + weights`` where that is less; without a branch, so that it becomes vector code."""
    for v in range(len(seen)):
        value = cost + weights[v]
        seen[v] = value if value < seen[v] else seen[v]


def _follow(W: Floats, least: Floats, onward: Floats, start: int) -> list[int]:
    """The cells of the way that the last row of ``onward`` is the cost of, from ``start`` on."""
    cells = [start]
    for r in range(len(onward) - 1, 0, -1):
        if onward[r, cells[-1]] < onward[r - 1, cells[-1]]:
            cells.append(int(np.argmin(W[cells[-1]] + least + onward[r - 1])))
    return cells


@kernel
def _search(
    W: Floats, costs: Floats, from_base: Floats, to_agent: Floats, onward: Floats, best: float
) -> tuple[Ints, Ints, float]:
    """Robots, cells and cost of the cheapest chain below ``best``; empty if there is none."""
    robots, number = costs.shape
    # Sets of robots are bits of numbers. Rows of F are made when they are first reached, which most never are.
    sets = 1 << robots
    F = np.empty((sets, number))
    reached = np.zeros(sets, dtype=np.bool_)
    size = np.zeros(sets, dtype=np.int64)
    seen = from_base.copy()
    best_set, best_cell = 0, -1
    for S in range(sets):
        if S > 0:
            size[S] = size[S >> 1] + (S & 1)
            if not reached[S]:
                continue
            for v in range(number):
                if F[S, v] + to_agent[v] < best:
                    best, best_set, best_cell = F[S, v] + to_agent[v], S, v
            rest = onward[min(robots - size[S], len(onward) - 1)]
            promising = False
            seen[:] = np.inf
            for v in range(number):
                if F[S, v] + rest[v] < best:
                    promising = True
                    _improve(seen, W[v], F[S, v])
            if not promising:
                continue
        for j in range(robots):
            larger = S | 1 << j
            if larger == S:
                continue
            if not reached[larger]:
                reached[larger] = True
                F[larger] = np.inf
            for w in range(number):
                cost = seen[w] + costs[j, w]
                F[larger, w] = cost if cost < F[larger, w] else F[larger, w]
    chosen, cells = np.empty(size[best_set], dtype=np.int64), np.empty(size[best_set], dtype=np.int64)
    S, v = best_set, best_cell
    for place in range(size[best_set] - 1, -1, -1):
        least, robot, before = np.inf, -1, -1
        for j in range(robots):
            smaller = S & ~(1 << j)
            if smaller == 0:
                robot = j
            elif smaller != S and reached[smaller]:
                for u in range(number):
                    cost = F[smaller, u] + W[u, v] + costs[j, v]
                    if cost < least:
                        least, robot, before = cost, j, u
        chosen[place], cells[place] = robot, v
        S, v = S & ~(1 << robot), before
    return chosen, cells, best
