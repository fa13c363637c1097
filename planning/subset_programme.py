"""The cheapest tree over all topologies and all placements: the subset programme, exact.

k nodes, k^(k−2) trees on them, N^k placements of each: yet the optimum takes 2^(k−1) min-plus products. Let F[B](v) be
the least cost of hanging the nodes B below a node that stands in v, in any shape. What hangs there falls into branches,
and the branch that holds the lowest node of B holds some set A. A branch is a tree that one of its nodes is the root
of, hung by one edge:

    h[A](v) = min over u of μ W[u, v] + min over i in A of C_i(u) + F[A without i](u)
    F[B](v) = min over A ⊆ B with the lowest of B of h[A](v) + F[B without A](v),      F[∅] = 0

C_i(u) is what it costs that node i goes to u. Every tree can be taken apart in this way, and all that is put together
is a tree; so min over v of C_r(v) + F[all but r](v), with any node r as the root of the whole, is the optimum over all
topologies. As F does not say which node stands in v, this is a factor k cheaper than keeping a table for each root.

Nodes with the same costs need no names. A *kind* is a number of nodes with the same C; sets become counts of each kind,
and Π(n_i + 1) of those stand for 2^(k−1) sets. Robots that start from one place are one kind. The same programme with
robots of *different* costs counted as one kind, each placement at the cost of the cheapest, gives a lower bound
(`planning.redeployment_bound`), and with all robots as one kind at no cost it is the Steiner tree of fixed size.

Nodes that are not needed may be left out: then the least over all counts that hold what is needed. As costs are not
negative, no leaf of an optimum is a node that is not needed, so only branches with something needed are looked at.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel
from planning.min_plus import Links, min_plus
from planning.tree import Floats, Ints

Bools = NDArray[np.bool_]

ROOT: Final = -1
"""Kind of the root, and the parent that it has."""


@dataclass(frozen=True, slots=True, eq=False)
class PlacedTree:
    """A tree whose nodes are told apart by their kinds only; node 0 is the root."""

    kinds: list[int]
    """Kind of each node."""
    cells: list[int]
    """Placement of each node."""
    parents: list[int]
    """The node that each one hangs from."""


@dataclass(frozen=True, slots=True, eq=False)
class SubsetProgramme:
    """The solved recurrence. A *state* counts the nodes of each kind; it is the index of the tables' first axis."""

    cost: float
    """The least cost; inf if there is no tree."""
    links: Links
    root_costs: Floats
    """(N,) float: C of the root."""
    costs: Floats
    """(c, N) float: C of each kind."""
    counts: Ints
    """(s, c) int: how many nodes of each kind a state holds."""
    strides: Ints
    """(c,) int: how much further on the state is that holds one more of a kind."""
    hanging: Floats
    """(s, N) float: F."""
    branches: Floats
    """(s, N) float: h."""
    best: int
    """The state that the cheapest tree holds below its root."""

    def tree(self) -> PlacedTree:
        """A cheapest tree, by taking the optimum apart again; only if the cost is finite.

        Complexity: O(k s c + k N) for k nodes, s states and c kinds.
        """
        tree = PlacedTree([ROOT], [int(np.argmin(self.root_costs + self.hanging[self.best]))], [ROOT])
        below = [(self.best, 0)]
        while below:
            state, parent = below.pop()
            v = tree.cells[parent]
            while state:
                branch = self._first_branch(state, v)
                state -= branch
                kind, cell = self._root_of(branch, v)
                tree.kinds.append(kind)
                tree.cells.append(cell)
                tree.parents.append(parent)
                below.append((branch - int(self.strides[kind]), len(tree.cells) - 1))
        return tree

    def _first_branch(self, state: int, v: int) -> int:
        """The A of a state B whose h[A](v) + F[B without A](v) is the least."""
        lowest = int(np.flatnonzero(self.counts[state])[0])
        within = (self.counts[: state + 1] <= self.counts[state]).all(axis=1)
        choices = np.flatnonzero(within & (self.counts[: state + 1, lowest] > 0))
        return int(choices[np.argmin(self.branches[choices, v] + self.hanging[state - choices, v])])

    def _root_of(self, branch: int, v: int) -> tuple[int, int]:
        """Kind and placement of the root of a branch that hangs from a node in v."""
        cells, weights = self.links.of(v)
        kinds = np.flatnonzero(self.counts[branch])
        totals = self.costs[kinds][:, cells] + self.hanging[branch - self.strides[kinds]][:, cells] + weights
        kind, cell = np.unravel_index(np.argmin(totals), totals.shape)
        return int(kinds[kind]), int(cells[cell])


def states_of(numbers: list[int]) -> int:
    """How many states a programme with these numbers of nodes per kind has; 1 for none."""
    return math.prod(number + 1 for number in numbers)


def solve_subsets(
    links: Links, root_costs: Floats, costs: Floats, numbers: list[int], needed: list[bool]
) -> SubsetProgramme:
    """Solve the programme.

    Args:
        links: of N placements.
        root_costs: (N,) float: C of the root, a node that is always needed.
        costs: (c, N) float: C of each kind but the root; inf where it cannot go. Not negative for what is not needed.
        numbers: how many nodes of each kind there are.
        needed: whether the nodes of each kind all have to be in the tree; of the others any number may be left out.

    Complexity: O(3^(k−1) N + 2^(k−1) (k N + N²)) time and O(2^k N) memory for k nodes of as many kinds; less where
    kinds have several nodes.
    """
    digits = np.indices([number + 1 for number in numbers], dtype=np.int64).reshape(len(numbers), states_of(numbers))
    counts = np.ascontiguousarray(digits.T)
    strides = np.array([states_of(numbers[kind + 1 :]) for kind in range(len(numbers))], dtype=np.int64)
    wanted = np.array(needed, dtype=np.bool_)
    sizes = np.where(counts[:, wanted].any(axis=1), counts.sum(axis=1), 0)

    hanging, branches = np.full((len(counts), links.number), np.inf), np.full((len(counts), links.number), np.inf)
    hanging[0] = 0.0
    finite_hanging, finite_branches = np.zeros(len(counts), dtype=np.bool_), np.zeros(len(counts), dtype=np.bool_)
    finite_hanging[0] = True
    for size in range(1, int(sizes.max(initial=0)) + 1):
        states = np.flatnonzero(sizes == size)
        rooted = np.full((len(states), links.number), np.inf)
        _root(rooted, states, costs, counts, strides, hanging, finite_hanging)
        branches[states] = min_plus(links, rooted)
        finite_branches[states] = np.isfinite(branches[states]).any(axis=1)
        _hang(states, counts, strides, hanging, finite_hanging, branches, finite_branches)

    complete = np.flatnonzero((counts[:, wanted] == counts[-1, wanted]).all(axis=1))
    totals = (root_costs + hanging[complete]).min(axis=1)
    best = int(np.argmin(totals))
    return SubsetProgramme(
        float(totals[best]), links, root_costs, costs, counts, strides, hanging, branches, int(complete[best])
    )


@kernel
def _root(
    rooted: Floats, states: Ints, costs: Floats, counts: Ints, strides: Ints, hanging: Floats, finite_hanging: Bools
) -> None:
    """Choose the root of each branch: min over kinds i in A of C_i + F[A without one i]."""
    for place in range(len(states)):
        least = rooted[place]
        for kind in range(len(costs)):
            rest = states[place] - strides[kind]
            if counts[states[place], kind] > 0 and finite_hanging[rest]:
                cost, below = costs[kind], hanging[rest]
                for v in range(len(least)):
                    total = cost[v] + below[v]
                    least[v] = total if total < least[v] else least[v]


@kernel
def _hang(
    states: Ints,
    counts: Ints,
    strides: Ints,
    hanging: Floats,
    finite_hanging: Bools,
    branches: Floats,
    finite_branches: Bools,
) -> None:
    """F of some states from h of these and smaller ones: the least over the branch that holds the lowest kind."""
    kinds = len(strides)
    taken = np.empty(kinds, dtype=np.int64)
    for state in states:
        held, least = counts[state], hanging[state]
        lowest = 0
        while held[lowest] == 0:
            lowest += 1
        # All parts of the state that hold the lowest kind, counted up like the digits of a number.
        taken[:] = 0
        taken[lowest] = 1
        part = strides[lowest]
        while True:
            rest = state - part
            if finite_branches[part] and finite_hanging[rest]:
                branch, others = branches[part], hanging[rest]
                for v in range(len(least)):
                    total = branch[v] + others[v]
                    least[v] = total if total < least[v] else least[v]
            kind = kinds - 1
            while kind >= 0 and taken[kind] == held[kind]:
                smallest = 1 if kind == lowest else 0
                part -= (taken[kind] - smallest) * strides[kind]
                taken[kind] = smallest
                kind -= 1
            if kind < 0:
                break
            taken[kind] += 1
            part += strides[kind]
        finite_hanging[state] = least.min() < np.inf
