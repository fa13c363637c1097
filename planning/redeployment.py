"""Redeployment: where the members of a team go, and who is to see whom, at the least cost (thesis §3.5–3.6, eq. 42).

The *minimal movement Steiner tree* joins all members, each of which pays to move, by links, each of which costs μ times
its weight:

    minimise   sum over nodes i of move_i(m_i)  +  μ sum over edges (i, j) of W[m_i, m_j]

over the placements m and, as far as the search goes, over the tree. There are four searches:

- ``fixed``: the given topology (thesis algorithms 4–6). Without costs of moving it is the deployment with known
  topology of §3.3.4.
- ``one-edge``: the given topology and all that differ from it in one edge (algorithm 7).
- ``exact``: all k^(k−2) topologies, which the thesis leaves open. Up to 14 nodes it is the optimum; beyond, a local
  optimum and a bound that says how far from the optimum it can be.
- ``chain``: a chain between two ends, of the others as many as is cheapest.

Robots that are not needed stay in the tree at the least cost, or may idle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike

from planning.chain import chain_between
from planning.distant_nodes import bound_by_distant
from planning.edge_modification import best_modification
from planning.iterated_modification import search_with_bound
from planning.known_topology import neighbours_of, place_nodes
from planning.min_plus import Links, scaled_links
from planning.redeployment_bound import bound_below, count_nodes, name_nodes, relax, without_rounding
from planning.subset_programme import ROOT
from planning.tree import Floats, Ints, checked_weights

Search: TypeAlias = Literal["exact", "one-edge", "fixed", "chain"]

EXACT_STATES: Final = 2**13
"""States of the subset programme up to which a search is exact: 14 nodes, or more if some have the same costs."""

RELAXED_STATES: Final = 2**11
"""States of its relaxation where it is not."""

BOUND_STATES: Final = 2**5
"""States that the lower bound of the other searches may take: 6 nodes are told apart, of more some counted together."""

MANY: Final = 9
"""Nodes from which on their lower bound is also one by distant nodes: counting many together says next to nothing."""

BOUND_DISTANT: Final = 4
"""Nodes, besides the root, of that bound."""

MOST_JOINED: Final = 1000
"""Placements up to which that bound, O(N³), takes no longer than the search."""


FIRST_TWO: Final = (0, 1)
"""Base and agent, where nobody says otherwise."""


class InvalidRedeployment(ValueError):
    """What is asked makes no sense; the text says which argument, where in it, and what to do."""


@dataclass(frozen=True, slots=True, eq=False)
class Redeployment:
    """Who is to see whom, and where each one goes."""

    cost: float
    """Costs of moving and μ times the weights of the edges; inf if no redeployment was found."""
    lower_bound: float
    """No tree costs less, whatever its topology, with the same nodes free to idle. Equal to ``cost`` where that is the
    optimum by the search itself; inf where it is proven that there is no redeployment at all."""
    tree: Ints | None
    """(m, 2) int: pairs of nodes, one less than the nodes that do not idle; None if none was found."""
    cells: Ints
    """(k,) int: the placement of each node; -1 for nodes that idle, and for all if none was found."""


def redeploy(
    move: ArrayLike,
    W: ArrayLike,
    mu: float = 1.0,
    search: Search = "exact",
    tree: ArrayLike | None = None,
    ends: ArrayLike = FIRST_TWO,
    idle: bool = False,
) -> Redeployment:
    """The cheapest redeployment: thesis §3.5.1 and §3.6, and beyond them.

    Args:
        move: (k, N) float, not negative: what it costs node i to go to placement v, in any unit; inf where it cannot
            go, or not in time. Nodes are all members of the tree, base and agent included; a terminal has 0 in one
            place and inf elsewhere.
        W: (N, N) float, symmetric, not negative: weights of the direct links; inf where there is none. The diagonal is
            taken as 0: two nodes may share a placement.
        mu: μ, not negative: what a unit of W costs in the unit of ``move``.
        search: see above.
        tree: (k − 1, 2) int: pairs of nodes, the present topology. ``fixed`` and ``one-edge`` need it; ``exact`` begins
            with it where it cannot search everything; ``chain`` has no use for it. With ``idle``, nodes that are not
            ends may be missing.
        ends: nodes that stay in the tree when others may idle. ``chain`` takes exactly two; no other search looks at
            them without ``idle``.
        idle: nodes that are not ends may be left out, at no cost. ``fixed`` then keeps the part of the tree that joins
            the ends, and ``one-edge`` that part of each modified tree; nodes missing in ``tree`` count as leaves at the
            first end. A chain leaves nodes out in any case.

    Returns:
        The optimum of the search. Without any redeployment: cost inf, no tree, all cells -1.

    Raises:
        InvalidRedeployment: arguments as above, in one sentence.
        InvalidWeights: W is not a symmetric matrix of weights.

    Complexity: ``fixed`` O(k N²); ``one-edge`` O(k² N²); both with a lower bound of O(32 N²), which is the optimum for
        at most 6 nodes, and from 9 nodes on with a better one, O(N³), if there are at most 1000 placements. ``exact``
        O(3^(k−1) N + 2^(k−1) N²) time and O(2^k N) memory for up to 14 different nodes; for more, bounded
        work (`planning.iterated_modification`). ``chain`` as `planning.chain.chain_between`.

    What ``exact`` takes on 236 points of the thesis' room3, all nodes needed and no two starting together, median of
    six random starts on one core, and how far at most the optimum may be below the cost: 12 nodes 0.05 s, 14 nodes
    0.4 s, both proven; 16 nodes 0.9 s, cost / bound 1.2; 20 nodes 1.1 s, 1.4; 30 nodes 2.1 s, 1.9; 42 nodes 1.0 s,
    2.6. Where nodes may idle, bounds are close whatever k: what is not needed is not counted.
    """
    costs, weights = _checked_costs(move), checked_weights(W)
    number = len(costs)
    if costs.shape[1] != len(weights):
        raise InvalidRedeployment(
            f"move is for {costs.shape[1]} placements and W for {len(weights)}: give both for the same placements"
        )
    single = isinstance(mu, int | float | np.number | np.ndarray) and np.ndim(mu) == 0
    if not (single and np.asarray(mu).dtype.kind in "iuf" and 0 <= mu < np.inf):
        raise InvalidRedeployment(f"mu is a finite number of at least 0, not {mu!r}")
    if search not in get_args(Search):
        raise InvalidRedeployment(f"there is no search {search!r}: use one of {', '.join(get_args(Search))}")
    staying = _checked_ends(ends, number, search) if idle or search == "chain" else list(range(number))
    topology = None if tree is None or search == "chain" else _checked_tree(tree, number, staying)
    links = scaled_links(weights, float(mu))
    if search == "chain":
        return _chain(links, costs, weights, float(mu), staying)
    if search == "exact":
        return _exact(links, costs, weights, float(mu), staying, topology)
    if topology is None:
        raise InvalidRedeployment(f"a {search} search starts from a topology: give tree, or search='exact'")
    if search == "one-edge":
        _, topology = best_modification(links, costs, topology, staying)
    bound = bound_below(links, costs, staying, BOUND_STATES)
    if number >= MANY and len(weights) <= MOST_JOINED:
        bound = max(bound, bound_by_distant(links, costs, staying, BOUND_DISTANT))
    placed = place_nodes(links, costs, topology, staying)
    return _result(costs, weights, float(mu), placed, bound)


def _exact(links: Links, move: Floats, W: Floats, mu: float, ends: list[int], tree: Ints | None) -> Redeployment:
    """The optimum where the states are not too many, else a search with a bound."""
    counted = count_nodes(move, ends, EXACT_STATES)
    if not counted.exact:
        found = search_with_bound(links, move, ends, tree, RELAXED_STATES)
        placed = None if np.isinf(found.cost) else (found.edges, found.cells)
        return _result(move, W, mu, placed, found.lower_bound)
    relaxation = relax(links, move, counted, np.zeros(len(move)))
    if np.isinf(relaxation.bound):
        return _result(move, W, mu, None, np.inf)
    names = name_nodes(move, counted, relaxation.tree)
    cells = np.full(len(move), -1, dtype=np.int64)
    cells[names] = relaxation.tree.cells
    edges = [
        (names[parent], name) for name, parent in zip(names, relaxation.tree.parents, strict=True) if parent != ROOT
    ]
    return _result(move, W, mu, (np.array(edges, dtype=np.int64).reshape(-1, 2), cells), np.inf)


def _chain(links: Links, move: Floats, W: Floats, mu: float, ends: list[int]) -> Redeployment:
    """A chain between two ends."""
    scaled = np.where(np.isinf(W), np.inf, mu * np.where(np.isinf(W), 0.0, W))
    np.fill_diagonal(scaled, 0.0)
    chain = chain_between(move, scaled, (ends[0], ends[1]))
    if chain is None:
        return _result(move, W, mu, None, bound_below(links, move, ends, BOUND_STATES))
    cells = np.full(len(move), -1, dtype=np.int64)
    cells[list(chain.robots)] = chain.cells
    edges = np.array([chain.robots[:-1], chain.robots[1:]], dtype=np.int64).T
    return _result(move, W, mu, (edges, cells), np.inf if chain.lower_bound >= chain.cost else chain.lower_bound)


def _result(move: Floats, W: Floats, mu: float, placed: tuple[Ints, Ints] | None, bound: float) -> Redeployment:
    """The value, with the cost added up from what is returned; a bound of inf says that this is the optimum."""
    if placed is None:
        return Redeployment(np.inf, bound, None, np.full(len(move), -1, dtype=np.int64))
    tree, cells = placed
    nodes = np.flatnonzero(cells >= 0)
    first, second = cells[tree].T
    cost = math.fsum((*move[nodes, cells[nodes]], *(mu * np.where(first == second, 0.0, W[first, second]))))
    return Redeployment(cost, cost if np.isinf(bound) else without_rounding(bound, cost), tree, cells)


def _checked_costs(move: ArrayLike) -> Floats:
    try:
        costs = np.ascontiguousarray(move, dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidRedeployment(f"move is a table of numbers, not {type(move).__name__}") from None
    if costs.ndim != 2 or costs.size == 0:
        raise InvalidRedeployment(
            f"move has a row for each node and a column for each placement, at least one; its shape is {costs.shape}"
        )
    wrong = np.argwhere(~(costs >= 0))
    if len(wrong):
        node, cell = wrong[0]
        raise InvalidRedeployment(
            f"costs of moving are not negative, but move[{node}, {cell}] is {costs[node, cell]}: "
            "say inf where a node cannot go"
        )
    return costs


def _checked_ends(ends: ArrayLike, number: int, search: Search) -> list[int]:
    if search == "chain" and number < 2:
        raise InvalidRedeployment(f"a chain joins two nodes, and move has {number}: give a row for each end")
    if ends is FIRST_TWO and number == 1:
        return [0]
    given = _whole_numbers(ends)
    if given is None or given.ndim != 1 or len(given) == 0:
        raise InvalidRedeployment(f"ends are the nodes that stay, at least one; they are {ends!r}")
    outside = given[(given < 0) | (given >= number)]
    if len(outside):
        raise InvalidRedeployment(f"node {outside[0]} cannot be an end: nodes are 0 to {number - 1}")
    if len(np.unique(given)) < len(given):
        raise InvalidRedeployment(f"ends are different nodes, but {given.tolist()} repeats one")
    if search == "chain" and len(given) != 2:
        raise InvalidRedeployment(f"a chain has two ends, not {len(given)}: give two, or search='exact' with idle=True")
    return [int(end) for end in given]


def _checked_tree(tree: ArrayLike, number: int, staying: list[int]) -> Ints:
    """The tree as (k − 1, 2) int; nodes that are missing and need not stay are leaves at the first that stays."""
    edges = _whole_numbers(tree)
    if edges is not None and edges.size == 0:
        edges = edges.reshape(0, 2)
    if edges is None or edges.ndim != 2 or edges.shape[1] != 2:
        raise InvalidRedeployment("tree is a list of pairs of nodes, which are whole numbers")
    outside = edges[(edges < 0) | (edges >= number)]
    if len(outside):
        raise InvalidRedeployment(f"tree names node {outside[0]}, but nodes are 0 to {number - 1}")
    missing = sorted({*range(number)} - {*staying} - {*edges.ravel().tolist()})
    edges = np.concatenate((edges, np.array([(staying[0], i) for i in missing], dtype=np.int64).reshape(-1, 2)))
    _check_edges(edges)
    neighbours = neighbours_of(edges, number)
    reached = [staying[0]]
    for i in reached:
        reached += [j for j in neighbours[i] if j not in reached]
    if len(reached) < number:
        left = min({*range(number)} - {*reached})
        raise InvalidRedeployment(
            f"tree joins all nodes, but node {left} is not joined to node {staying[0]}: add an edge"
        )
    if len(edges) != number - 1:
        raise InvalidRedeployment(
            f"tree has {len(edges)} edges between {number} nodes and so a cycle: a tree has {number - 1}"
        )
    return edges


def _check_edges(edges: Ints) -> None:
    """Refuse loops and edges that come twice: the count of edges would take them for what joins other nodes."""
    met = set()
    for i, j in edges.tolist():
        if i == j:
            raise InvalidRedeployment(f"tree joins node {i} to itself: leave that edge out")
        if frozenset((i, j)) in met:
            raise InvalidRedeployment(f"tree joins nodes {min(i, j)} and {max(i, j)} twice: leave one of the edges out")
        met.add(frozenset((i, j)))


def _whole_numbers(given: ArrayLike) -> Ints | None:
    """An array of what is given; None if that is anything but whole numbers in rows of one length."""
    try:
        array = np.asarray(given)
    except ValueError:
        return None
    return array.astype(np.int64) if array.dtype.kind in "iu" or array.size == 0 else None
