"""The fixed-size Steiner tree: the cheapest tree with a given number of nodes, exactly, by counting robots.

The thesis poses the problem (§1.2.3, §3.6) and searches one edge away from a given tree. Robots that are not told
apart need not be named: a subtree is known by the *terminals* in it, the *number* of robots in it and the placement
of its root. With a[{t}, 0, v] = 0 where terminal t stands, and a[∅, 1, v] what it costs a robot to stand in v,

    h[Y, k, v] = min over u of a[Y, k, u] + W[u, v]
    a[X, m, v] = min over Y ⊆ X, k ≤ m, (∅, 0) ≠ (Y, k) ≠ (X, m), of a[X∖Y, m − k, v] + h[Y, k, v]

is the cheapest tree on the terminals X and m robots rooted in v: its last branch holds Y and k robots and hangs by
one edge from the root of the rest. Every tree can be taken apart in this way, and everything the recurrence puts
together is a tree, so the least is the optimum over all topologies and placements. W is 0 on the diagonal: nodes in
one placement cost nothing between them.

The first terminal is the root of the whole and needs no table of its own: its branches are gathered where it stands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from planning.distance_network import distance_network
from planning.dreyfus_wagner import exact_tree
from planning.kernel import kernel
from planning.tree import (
    Bools,
    Floats,
    Ints,
    InvalidRequest,
    NoTree,
    Tree,
    checked_terminals,
    checked_weights,
    without_repetition,
)

LARGEST_TABLE = 2**27
"""Entries of a table (1 GiB). There are two, and beyond it a question would take hours to answer."""


@dataclass(frozen=True, slots=True, eq=False)
class FixedSizeProgramme:
    """The solved recurrence: t terminals, and every number of robots from 0 to a greatest one, r."""

    costs: Floats
    """(r + 1,) float: the least cost of a tree with 0 … r robots, links and standing; inf where there is none."""
    weights: Floats
    """(N, N) float: W, 0 on the diagonal."""
    terminals: Ints
    """(t,) int: placements; the first is the root. Bit i of a set of terminals is the terminal i + 1."""
    rooted: Floats
    """(2^(t−1), r + 1, N) float: a[X, m, v]."""
    hooked: Floats
    """(2^(t−1), r + 1, N) float: h[Y, k, v]."""
    gathered: Floats
    """(2^(t−1), r + 1) float: the cheapest tree on the first terminal, which is its root, X and m robots."""

    def tree(self, robots: int) -> Tree:
        """A cheapest tree with this number of robots; its cost is that of the links alone.

        Raises:
            NoTree: there is none.

        Complexity: O((t + r) (2^t r + N)).
        """
        if not np.isfinite(self.costs[robots]):
            raise NoTree(f"no tree with {robots} robots joins the terminals in {self.terminals.tolist()}")
        root = int(self.terminals[0])
        edges: list[tuple[int, int]] = []
        standing: list[int] = []
        branches, _ = _branches(self.gathered, self.hooked[:, :, root], len(self.gathered) - 1, robots, own=0)
        hanging = [(root, branch) for branch in branches]
        while hanging:
            v, (Y, k) = hanging.pop()
            u = int(np.argmin(self.rooted[Y, k] + self.weights[:, v]))
            edges.append((v, u))
            branches, is_robot = _branches(self.rooted[:, :, u], self.hooked[:, :, u], Y, k, own=1)
            hanging += [(u, branch) for branch in branches]
            if is_robot:
                standing.append(u)
        joined = np.array(edges, dtype=np.int64).reshape(-1, 2)
        nodes = np.concatenate((self.terminals, np.array(standing, dtype=np.int64)))
        return Tree(float(self.weights[joined[:, 0], joined[:, 1]].sum()), joined, nodes)


def fixed_size_programme(
    W: ArrayLike, terminals: ArrayLike, vertices: int, node_cost: ArrayLike | None = None
) -> FixedSizeProgramme:
    """Solve for all trees of up to ``vertices`` nodes on these terminals.

    Args:
        W: (N, N) float, symmetric, not negative; inf where there is no link. The diagonal is not looked at.
        terminals: (t,) int: placements; those that coincide are a node each.
        vertices: number of nodes of the largest tree, terminals included.
        node_cost: (N,) float: what it costs a robot to stand in each placement, inf where none may. Terminals stand
            where they are for nothing. None: 0 everywhere.

    Raises:
        InvalidWeights, InvalidRequest: W, terminals, vertices or node_cost are not that, or the tables would be
            larger than :data:`LARGEST_TABLE`.

    Complexity: O(3^t r² N + 2^t r N²) time and O(2^t r N) memory for r = vertices − t robots.
    """
    weights = checked_weights(W).copy()
    np.fill_diagonal(weights, 0.0)
    number = len(weights)
    joined = checked_terminals(terminals, number)
    robots = vertices - len(joined)
    if robots < 0:
        raise InvalidRequest(f"a tree of {vertices} nodes cannot hold {len(joined)} terminals: ask for more nodes")
    standing = np.zeros(number) if node_cost is None else np.asarray(node_cost)
    if standing.shape != (number,) or standing.dtype.kind not in "iuf" or np.isnan(standing).any():
        raise InvalidRequest(f"node costs are {number} numbers, one for each placement")
    shape = (2 ** (len(joined) - 1), robots + 1, number)
    if np.prod(np.array(shape, dtype=np.float64)) > LARGEST_TABLE:
        raise InvalidRequest(
            f"{len(joined)} terminals, {robots} robots and {number} placements are too many for an exact tree of fixed "
            "size: take fewer"
        )
    rooted, hooked = np.full(shape, np.inf), np.full(shape, np.inf)
    gathered = np.full((shape[0], shape[1], 1), np.inf)
    for i, v in enumerate(joined[1:]):
        rooted[1 << i, 0, v] = 0.0
    if robots:
        rooted[0, 1] = standing
    gathered[0, 0] = 0.0
    _solve(weights, rooted, hooked)
    _gather(gathered, np.ascontiguousarray(hooked[:, :, joined[:1]]))
    costs = gathered[-1, :, 0].copy()
    return FixedSizeProgramme(costs, weights, joined, rooted, hooked, gathered[:, :, 0])


def fixed_size_tree(W: Floats, terminals: Ints, vertices: int, standing: Bools) -> Tree:
    """A cheapest tree of exactly this number of nodes.

    A tree of free size that needs no more is one, for the robots that are left stand where another node is. So the
    programme is run for those numbers only that are a restriction.

    Args:
        W: (N, N) float, checked.
        terminals: (t,) int, checked; those that coincide are a node each.
        vertices: number of nodes, terminals included.
        standing: (N,) bool: where robots can stand.

    Raises:
        InvalidRequest: more terminals than vertices, or too many for an exact tree.
        NoTree: a terminal cannot be reached, or only with more vertices.
    """
    if vertices < len(terminals):
        raise InvalidRequest(
            f"a tree of {vertices} nodes cannot hold {len(terminals)} terminals: ask for more vertices"
        )
    distinct = without_repetition(terminals)
    coinciding = list(terminals)
    for v in distinct:
        coinciding.remove(v)
    free = exact_tree(W, distance_network(W, distinct))
    places = free.nodes[standing[free.nodes]]
    spare = vertices - len(free.nodes) - len(coinciding)
    if spare == 0 or (spare > 0 and len(places)):
        doubled = np.array([*coinciding, *places[:1].repeat(spare)], dtype=np.int64)
        nodes = np.concatenate((terminals, free.nodes[len(distinct) :], doubled[len(coinciding) :]))
        return Tree(free.cost, np.concatenate((free.edges, np.column_stack((doubled, doubled)))), nodes)
    programme = fixed_size_programme(W, terminals, vertices, np.where(standing, 0.0, np.inf))
    if np.isfinite(programme.costs[-1]):
        return programme.tree(vertices - len(terminals))
    links = np.where(np.isfinite(W), 1.0, np.inf)
    fewest = len(exact_tree(links, distance_network(links, distinct)).nodes) + len(coinciding)
    raise NoTree(
        f"{vertices} nodes do not join the terminals in placements {terminals.tolist()}: it takes {fewest} at least"
    )


def _branches(rooted: Floats, hooked: Floats, X: int, m: int, *, own: int) -> tuple[list[tuple[int, int]], bool]:
    """Take a tree apart at its root: the branches (Y, k) that hang from it, and whether a robot is left standing.

    Args:
        rooted: (2^(t−1), r + 1) float: a in the root's placement.
        hooked: (2^(t−1), r + 1) float: h in the root's placement.
        X: terminals of the tree.
        m: robots of the tree.
        own: how many of its nodes are left at last: 1, or 0 where the root counts as neither terminal nor robot.
    """
    branches = []
    while X.bit_count() + m > own:
        subsets = np.arange(X + 1)
        subsets = subsets[subsets & ~X == 0]
        totals = rooted[X ^ subsets, m::-1] + hooked[subsets, : m + 1]
        place, k = np.unravel_index(np.argmin(totals), totals.shape)
        branches.append((int(subsets[place]), int(k)))
        X, m = X ^ int(subsets[place]), m - int(k)
    return branches, m == 1


@kernel
def _solve(W: Floats, rooted: Floats, hooked: Floats) -> None:
    """Fill both tables; rooted holds the trees of one node, all else is infinite."""
    for X in range(rooted.shape[0]):
        for m in range(rooted.shape[1]):
            _join(rooted, hooked, X, m)
            _hook(W, rooted[X, m], hooked[X, m])


@kernel
def _gather(gathered: Floats, hooked: Floats) -> None:
    """Join branches at the first terminal, where there is nothing to hook."""
    for X in range(gathered.shape[0]):
        for m in range(gathered.shape[1]):
            _join(gathered, hooked, X, m)


@kernel
def _join(rooted: Floats, hooked: Floats, X: int, m: int) -> None:
    """The least over the last branch (Y, k). Where there is no rest, or no branch, the tables are infinite."""
    total = rooted[X, m]
    Y = X
    while True:
        for k in range(m + 1):
            rest, branch = rooted[X ^ Y, m - k], hooked[Y, k]
            for v in range(len(total)):
                total[v] = min(total[v], rest[v] + branch[v])
        if Y == 0:
            break
        Y = (Y - 1) & X


@kernel
def _hook(W: Floats, rooted: Floats, hooked: Floats) -> None:
    """Branches from trees: one min-plus product."""
    for u in range(len(W)):
        if rooted[u] < np.inf:
            for v in range(len(W)):
                hooked[v] = min(hooked[v], rooted[u] + W[u, v])
