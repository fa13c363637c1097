"""How much cheaper a redeployment could be: robots counted instead of named, at a price for each.

The subset programme is exact where each robot is a kind of its own, and its work doubles with each. Where that is too
much, several robots are counted as one *kind*, whose cost in placement v is that of its cheapest member,

    C(v) = min over members i of move_i(v) − λ_i

Every tree of the named robots is one of the counted ones, at a cost no greater but for Σ λ_i; so

    least cost of the counted trees + Σ λ_i

is a lower bound for any prices λ: the Lagrangian relaxation of "each robot stands in one place". Where a robot is
counted twice its price has to fall, where it is not counted it has to rise: that is a subgradient of the bound, and a
few dozen steps along it, of the length that Polyak proposed, come close to the best prices. If at any prices each robot
is counted once, the tree is optimal. Robots that may idle are counted once *at most*, so their prices are not positive.

Which robots are counted together: those whose costs differ least, until the states are few enough. Robots with the
same costs lose nothing by it, and are always counted.

State-space relaxation: N. Christofides, A. Mingozzi, P. Toth, Networks 11 (1981), doi:10.1002/net.3230110207. Steps:
B. T. Polyak, USSR Comput. Math. Math. Phys. 9 (1969), doi:10.1016/0041-5553(69)90061-5.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from planning.deployment import identify_robots
from planning.min_plus import Links
from planning.subset_programme import ROOT, PlacedTree, SubsetProgramme, solve_subsets, states_of
from planning.tree import Floats

ROUNDING: Final = 1e-12
"""Relative: bounds are lowered by this, so that they hold in spite of rounding."""

AGREEMENT: Final = 1e-9
"""Relative: a bound and a cost that are added up in different orders differ by less."""

PATIENCE: Final = 3
"""Steps without a better bound after which they become half as long."""


@dataclass(frozen=True, slots=True, eq=False)
class Counted:
    """Nodes by kind, and whether counting them loses anything."""

    root: int
    """The node that is the root; it has a name."""
    kinds: list[list[int]]
    """The other nodes."""
    needed: list[bool]
    """Of each kind, whether its nodes all have to be in the tree."""
    exact: bool
    """Nodes of one kind have the same costs."""


@dataclass(frozen=True, slots=True, eq=False)
class Relaxation:
    """The cheapest counted tree at some prices."""

    bound: float
    """No tree of the named nodes costs less; inf if there is none."""
    tree: PlacedTree
    """Nodes are those of a `Counted`; empty if there is no tree."""
    used: list[int]
    """For each node of the tree, the named node that is the cheapest there."""


def count_nodes(move: Floats, ends: list[int], most_states: int) -> Counted:
    """Count nodes together until the programme has no more states than asked for, or until no two kinds are left.

    Args:
        move: (k, N) float: what it costs node i to go to placement v.
        ends: nodes that are needed, the first of them the root; these and the others are never one kind.
        most_states: of the subset programme.

    Complexity: O(k² N + k³).
    """
    root = ends[0]
    kinds = [[i] for i in range(len(move)) if i != root]
    needed = [kind[0] in ends for kind in kinds]
    finite = np.isfinite(move)
    costs = np.delete(np.where(finite, move, 1.0 + move[finite].max(initial=0.0)), root, axis=0)
    apart = np.abs(costs[:, None] - costs[None]).mean(axis=2)
    apart[np.not_equal.outer(needed, needed)] = np.inf
    np.fill_diagonal(apart, np.inf)
    exact = True
    while len(kinds) > 1:
        first, second = divmod(int(np.argmin(apart)), len(kinds))
        enough = states_of([len(kind) for kind in kinds]) <= most_states
        if np.isinf(apart[first, second]) or (enough and apart[first, second] > 0):
            break
        exact &= bool(apart[first, second] == 0)
        # Kinds are as far apart as those of their members that are farthest apart.
        apart[first] = apart[:, first] = np.maximum(apart[first], apart[second])
        apart = np.delete(np.delete(apart, second, axis=0), second, axis=1)
        kinds[first] += kinds.pop(second)
        needed.pop(second)
    return Counted(root, kinds, needed, exact)


def relax(links: Links, move: Floats, counted: Counted, prices: Floats) -> Relaxation:
    """The cheapest counted tree at these prices.

    Args:
        links: of N placements.
        move: (k, N) float, not negative.
        counted: its k nodes.
        prices: (k,) float: λ; not positive for nodes that may idle.

    Complexity: that of `planning.subset_programme.solve_subsets`.
    """
    reduced = move - prices[:, None]
    programme = _solve(links, reduced, counted)
    if np.isinf(programme.cost):
        return Relaxation(np.inf, PlacedTree([], [], []), [])
    tree = programme.tree()
    used = [counted.root]
    for kind, cell in zip(tree.kinds[1:], tree.cells[1:], strict=True):
        members = counted.kinds[kind]
        used.append(members[int(np.argmin(reduced[members, cell]))])
    return Relaxation(_lowered(programme.cost, prices), tree, used)


def bound_below(links: Links, move: Floats, ends: list[int], most_states: int) -> float:
    """What no tree costs less than, at no prices; inf if there is no tree.

    Args:
        links: of N placements.
        move: (k, N) float, not negative.
        ends: nodes that are needed.
        most_states: of the programme; where it can tell all nodes apart, the bound is the optimum less rounding.
    """
    programme = _solve(links, move, count_nodes(move, ends, most_states))
    return _lowered(programme.cost, np.zeros(len(move)))


def _solve(links: Links, costs: Floats, counted: Counted) -> SubsetProgramme:
    cheapest = np.array([costs[kind].min(axis=0) for kind in counted.kinds]).reshape(-1, links.number)
    return solve_subsets(links, costs[counted.root], cheapest, [len(kind) for kind in counted.kinds], counted.needed)


def _lowered(cost: float, prices: Floats) -> float:
    """The bound that a relaxed cost stands for, less what rounding may have added."""
    if np.isinf(cost):
        return np.inf
    return cost + float(prices.sum()) - ROUNDING * (abs(cost) + float(np.abs(prices).sum()))


def without_rounding(bound: float, cost: float) -> float:
    """The bound, or the cost of a tree where that is less by rounding. What is less by more contradicts the bound."""
    return cost if cost < bound <= cost * (1.0 + AGREEMENT) else bound


def name_nodes(move: Floats, counted: Counted, tree: PlacedTree) -> list[int]:
    """Give each node of a counted tree a name of its own, so that the cost of moving is the least (thesis eq. 38).

    Args:
        move: (k, N) float: what it costs node i to go to placement v.
        counted: its k nodes.
        tree: made of these.

    Returns:
        The names of the tree's nodes. Needed nodes stay needed, but the kinds are free.

    Raises:
        TooFewRobots: there are no names at a finite cost.
    """
    names = [counted.root] * len(tree.kinds)
    for needed in (True, False):
        members = [i for kind, flag in zip(counted.kinds, counted.needed, strict=True) if flag == needed for i in kind]
        places = [n for n, kind in enumerate(tree.kinds) if kind != ROOT and counted.needed[kind] == needed]
        if places:
            chosen = identify_robots(move[np.ix_(members, [tree.cells[n] for n in places])])
            for n, member in zip(places, chosen.tolist(), strict=True):
                names[n] = members[member]
    return names


class PriceAscent:
    """Prices, raised and lowered step by step after Polyak."""

    def __init__(self, counted: Counted) -> None:
        self._idling = [
            i for kind, needed in zip(counted.kinds, counted.needed, strict=True) if not needed for i in kind
        ]
        self._length = 1.0
        self._waited = 0
        self.prices: Floats = np.zeros(1 + sum(map(len, counted.kinds)))
        """(k,) float: λ."""
        self.bound = -np.inf
        """The best of the bounds so far."""

    def step(self, relaxation: Relaxation, known: float) -> bool:
        """Change the prices.

        Args:
            relaxation: at the present prices.
            known: the cost of the best tree that is known; inf if none is.

        Returns:
            Whether there is something to gain: not where the bound is infinite or reaches what is known, nor where
            each robot is counted once.
        """
        if relaxation.bound > self.bound:
            self.bound, self._waited = relaxation.bound, 0
        else:
            self._waited += 1
        if self._waited >= PATIENCE:
            self._length, self._waited = 0.5 * self._length, 0
        goal = known if np.isfinite(known) else 1.0 + 1.1 * relaxation.bound
        wanting = 1.0 - np.bincount(relaxation.used, minlength=len(self.prices))
        wanting[self._idling] = np.minimum(wanting[self._idling], -self.prices[self._idling])
        if not wanting.any() or goal - relaxation.bound <= 2.0 * ROUNDING * goal:
            return False
        self.prices = self.prices + self._length * (goal - relaxation.bound) / (wanting @ wanting) * wanting
        self.prices[self._idling] = np.minimum(self.prices[self._idling], 0.0)
        return True
