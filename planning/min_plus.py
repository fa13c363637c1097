"""Min-plus products with the weights of the links: what it costs to hang a tree by one edge.

Every search for a redeployment asks the same question over and over: with c(u) the cost of a tree whose root stands in
placement u, what does it cost to hang that tree from a node in placement v?

    (W ⊗ c)(v) = min over u of c(u) + μ W[u, v]

Most placements do not see each other, so only the finite weights are kept, row by row. They are read from memory once
for many c at a time: that, and not the additions, is what limits a single product.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel
from planning.tree import Floats, Ints

Places = NDArray[np.uint32]

STRIDE: Final = 4
"""Links taken at once; rows are filled up to a multiple of it with links that do not exist."""

LANES: Final = 32
"""Products computed at once: more would no longer fit into the cache."""

FEW: Final = 6
"""Fewer products than this are faster one by one."""


@dataclass(frozen=True, slots=True, eq=False)
class Links:
    """The finite entries of μ W, 0 on the diagonal, in compressed rows."""

    starts: Ints
    """(N + 1,) int: where the links of each placement begin."""
    neighbours: Places
    """(m,) uint32: the other end of each link; without a sign, so that no kernel has to look for negative indices."""
    weights: Floats
    """(m,) float: μ W; inf where the row is only filled up."""

    @property
    def number(self) -> int:
        """N, how many placements there are."""
        return len(self.starts) - 1

    def of(self, v: int) -> tuple[Places, Floats]:
        """The other ends of the links of a placement, and their weights; the placement itself at weight 0 included."""
        span = slice(self.starts[v], self.starts[v + 1])
        return self.neighbours[span], self.weights[span]


def scaled_links(W: Floats, mu: float) -> Links:
    """The links of a graph of placements.

    Args:
        W: (N, N) float, C-contiguous, symmetric, not negative, inf where there is no link. The diagonal is taken as 0.
        mu: μ, not negative and finite: what a unit of W costs. 0 leaves the links and makes them free.

    Complexity: O(N²).
    """
    return Links(*_compress(W, mu))


def min_plus(links: Links, costs: Floats) -> Floats:
    """The products of some cost vectors with the links.

    Args:
        links: of N placements.
        costs: (n, N) float, C-contiguous: c of each tree, inf where its root cannot stand.

    Returns:
        (n, N) float: W ⊗ c of each.

    Complexity: O(n m) for m links, at most n N².
    """
    products = np.empty(costs.shape)
    if len(costs) < FEW:
        _one_by_one(links.starts, links.neighbours, links.weights, costs, products)
        return products
    for begin in range(0, len(costs), LANES):
        lanes = np.ascontiguousarray(costs[begin : begin + LANES].T)
        hung = np.empty(lanes.shape)
        _side_by_side(links.starts, links.neighbours, links.weights, lanes, hung)
        products[begin : begin + LANES] = hung.T
    return products


@kernel
def _compress(W: Floats, mu: float) -> tuple[Ints, Places, Floats]:
    number = len(W)
    starts = np.zeros(number + 1, dtype=np.int64)
    for v in range(number):
        finite = 1
        for u in range(number):
            finite += (W[v, u] < np.inf) & (u != v)
        starts[v + 1] = starts[v] + (finite + STRIDE - 1) // STRIDE * STRIDE
    neighbours = np.empty(starts[number], dtype=np.uint32)
    weights = np.empty(starts[number])
    for v in range(number):
        place = starts[v]
        for u in range(number):
            if u == v or W[v, u] < np.inf:
                neighbours[place] = u
                weights[place] = 0.0 if u == v else mu * W[v, u]
                place += 1
        neighbours[place : starts[v + 1]] = v
        weights[place : starts[v + 1]] = np.inf
    return starts, neighbours, weights


@kernel
def _one_by_one(starts: Ints, neighbours: Places, weights: Floats, costs: Floats, products: Floats) -> None:
    """Four minima at a time, so that none has to wait for the one before."""
    for n in range(len(costs)):
        cost = costs[n]
        for v in range(len(starts) - 1):
            to, weight = neighbours[starts[v] : starts[v + 1]], weights[starts[v] : starts[v + 1]]
            a, b, c, d = np.inf, np.inf, np.inf, np.inf
            for stride in range(len(to) // STRIDE):
                e = stride * STRIDE
                x = cost[to[e]] + weight[e]
                a = x if x < a else a
                x = cost[to[e + 1]] + weight[e + 1]
                b = x if x < b else b
                x = cost[to[e + 2]] + weight[e + 2]
                c = x if x < c else c
                x = cost[to[e + 3]] + weight[e + 3]
                d = x if x < d else d
            products[n, v] = min(min(a, b), min(c, d))


@kernel
def _side_by_side(starts: Ints, neighbours: Places, weights: Floats, costs: Floats, products: Floats) -> None:
    """The same for costs and products (N, n), so that each weight is read once for n of them."""
    for v in range(len(starts) - 1):
        to, weight = neighbours[starts[v] : starts[v + 1]], weights[starts[v] : starts[v + 1]]
        least = products[v]
        least[:] = np.inf
        for stride in range(len(to) // STRIDE):
            e = stride * STRIDE
            w, x, y, z = weight[e], weight[e + 1], weight[e + 2], weight[e + 3]
            c, d, f, g = costs[to[e]], costs[to[e + 1]], costs[to[e + 2]], costs[to[e + 3]]
            for lane in range(len(least)):
                first = c[lane] + w
                other = d[lane] + x
                first = first if first < other else other
                third = f[lane] + y
                other = g[lane] + z
                third = third if third < other else other
                first = first if first < third else third
                least[lane] = first if first < least[lane] else least[lane]
