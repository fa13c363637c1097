"""Trees in a graph of placements: the value, and what is asked of the weights and terminals they are made from.

A *placement* is where a member of the team can be: a cell, or a point with its field of view. Placements are the
indices of W, the (N, N) weights of the direct links between them. *Terminals* are the placements that a tree has to
join: those of the tracked agents and of the base station (thesis §3.3.3).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

ROUNDING: Final = 1e-12
"""Relative: weights of the two directions of a link that differ by no more are the same, summed in different orders."""

TILE = 16
"""Rows and columns compared at once with their mirror image, so that both stay in the cache."""


class InvalidWeights(ValueError):
    """The weights are no symmetric matrix of numbers that are not negative; the text says where."""


class InvalidRequest(ValueError):
    """The terminals, or what else is asked of a tree, make no sense for this graph; the text says which."""


class NoTree(ValueError):
    """No tree joins the terminals; the text names one that cannot be joined, or what is missing."""


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """A tree whose nodes stand in placements; ``cost`` is the sum of W[u, v] over its edges.

    A Steiner tree of free size has distinct nodes: terminals in one placement are one node. A tree of fixed size has
    as many nodes as were asked for, each terminal and each robot one, and several may share a placement; an edge
    between two of those is (v, v) and costs 0.
    """

    cost: float
    edges: Ints
    """(n − 1, 2) int: pairs of placements, without direction."""
    nodes: Ints
    """(n,) int: placements; the terminals first, in the order they were given."""


def checked_weights(W: ArrayLike) -> Floats:
    """W as a C-contiguous (N, N) float array.

    Args:
        W: (N, N), symmetric but for rounding, not negative; inf where there is no link. The diagonal is not used.

    Returns:
        W itself where it is such an array, else a copy; exactly symmetric, of two weights that differ the smaller.

    Raises:
        InvalidWeights: it is not.

    Complexity: O(N²).
    """
    try:
        # Writable too, for kernels are compiled anew for arrays that are not.
        weights = np.require(W, np.float64, ["C_CONTIGUOUS", "WRITEABLE"])
    except (TypeError, ValueError):
        raise InvalidWeights(f"edge weights form a matrix of numbers; this is {type(W).__name__}") from None
    if weights.ndim != 2 or weights.shape[0] != weights.shape[1]:
        raise InvalidWeights(f"edge weights form a square matrix, not one of shape {weights.shape}")
    if not _faults(weights):
        return weights
    faults = ~((weights >= 0) & (weights <= weights.T * (1.0 + ROUNDING)) & (weights * (1.0 + ROUNDING) >= weights.T))
    if not faults.any():
        return np.ascontiguousarray(np.minimum(weights, weights.T))
    row, column = np.argwhere(faults)[0]
    weight, mirrored = weights[row, column], weights[column, row]
    if weight < 0:
        raise InvalidWeights(f"edge weights are not negative, but W[{row}, {column}] is {weight}")
    if np.isnan(weight):
        raise InvalidWeights(f"edge weights are numbers, but W[{row}, {column}] is {weight}: say inf for no link")
    raise InvalidWeights(
        f"edge weights are symmetric, but W[{row}, {column}] is {weight} and W[{column}, {row}] is {mirrored}: "
        "take numpy.minimum(W, W.T) if either holds for both"
    )


def checked_terminals(terminals: ArrayLike, number: int) -> Ints:
    """Terminals as (t,) int.

    Args:
        terminals: (t,) int, t ≥ 1: placements, which may repeat.
        number: how many placements there are.

    Raises:
        InvalidRequest: there is none, or one is no placement.
    """
    try:
        given = np.asarray(terminals)
    except ValueError:
        given = np.empty((0, 0))
    if given.ndim == 1 and len(given) == 0:
        raise InvalidRequest("a tree joins at least one terminal; none was given")
    if given.ndim != 1 or given.dtype.kind not in "iu":
        raise InvalidRequest(f"terminals are a list of placements, which are whole numbers; this is {terminals!r}")
    outside = np.flatnonzero((given < 0) | (given >= number))
    if len(outside):
        raise InvalidRequest(
            f"terminal {outside[0]} is placement {given[outside[0]]}, but the placements are 0 to {number - 1}"
        )
    return given.astype(np.int64)


def without_repetition(terminals: Ints) -> Ints:
    """The different ones, in the order of their first occurrence."""
    return np.array(list(dict.fromkeys(terminals.tolist())), dtype=np.int64)


def joining_tree(W: Floats, edges: Iterable[tuple[int, int]], terminals: Ints) -> Tree:
    """The cheapest spanning tree of some edges, without leaves that are no terminals (thesis §3.3.3, alg. 2, 4–5).

    Args:
        W: (N, N) float, symmetric.
        edges: pairs of placements that join the terminals; they may repeat and form cycles.
        terminals: (t,) int, all different.

    Complexity: O(m log m) for m edges (Kruskal), and as much again for each layer of leaves.
    """
    component = {int(terminal): {int(terminal)} for terminal in terminals}
    kept = []
    for u, v in sorted({(min(edge), max(edge)) for edge in edges}, key=lambda edge: float(W[edge])):
        one, other = component.setdefault(u, {u}), component.setdefault(v, {v})
        if one is not other:
            kept.append((u, v))
            one |= other
            component.update(dict.fromkeys(other, one))
    while True:
        joined = np.array(kept, dtype=np.int64).reshape(-1, 2)
        degrees = np.bincount(joined.ravel(), minlength=len(W))
        degrees[terminals] = 2  # They stay, as if they were no leaves.
        kept = [(u, v) for u, v in kept if degrees[u] > 1 and degrees[v] > 1]
        if len(kept) == len(joined):
            break
    others = sorted({v for edge in kept for v in edge}.difference(terminals.tolist()))
    nodes = np.concatenate((terminals, np.array(others, dtype=np.int64)))
    return Tree(float(W[joined[:, 0], joined[:, 1]].sum()), joined, nodes)


@kernel
def _faults(W: Floats) -> int:
    """How many weights of the upper half are negative, no number, or not their mirror image, those near it included.

    Counts without a branch, tile by tile.
    """
    number = len(W)
    faults = 0
    for top in range(0, number, TILE):
        for left in range(top, number, TILE):
            for row in range(top, min(top + TILE, number)):
                for column in range(left, min(left + TILE, number)):
                    faults += (not W[row, column] >= 0.0) | (W[row, column] != W[column, row])
    return faults
