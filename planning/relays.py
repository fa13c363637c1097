"""The fewest robots that can keep a line-of-sight connection: what a map asks for, and what given places ask for.

Robots between the ends of a chain are *relays*. A chain of h links has h − 1 of them, so the number that any two
placements of a graph need is its diameter less one. How far that speaks of *all* places on the map depends on the
placements:

- Cells: every place lies in a cell, and what the cell sees it sees. The figure holds for any two places that robots can
  be at, as far as mutual visibility of cells is asked for; with exact sight fewer relays may do.
- Points: the figure holds for any two placements. Any other two places need at most two relays more, one at a
  placement that each of them sees, and often one or none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.steiner import steiner_tree
from planning.tree import InvalidRequest

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Words = NDArray[np.uint64]


@dataclass(frozen=True, slots=True)
class MostRelays:
    """What the worst two placements of a graph ask for.

    Attributes:
        relays: the most relays that a pair needs, of all pairs that a chain can join at all.
        ends: such a pair.
        parts: into how many parts the graph falls; no chain joins placements of two parts.
    """

    relays: int
    ends: tuple[int, int]
    parts: int


@dataclass(frozen=True, slots=True, eq=False)
class RelayTree:
    """A tree of the fewest relays that joins terminals.

    Attributes:
        relays: (m,) int: placements where the relays stand.
        links: (t + m − 1, 2) int: pairs of nodes; 0 to N − 1 are placements, N + i is terminal i.
    """

    relays: Ints
    links: Ints


def most_relays(visible: Bools) -> MostRelays:
    """The number of relays that any two placements need: the diameter of the graph, less one.

    Bounds of the eccentricities leave most of them to be guessed: after a search from v, one from w reaches at least
    as far as max(d(v, w), ecc(v) − d(v, w)) and at most as far as d(v, w) + ecc(v) (F. W. Takes, W. A. Kosters 2011,
    doi:10.1145/2063576.2063748). Searches start in turn where the upper bound is greatest and the lower bound is least.

    Args:
        visible: (N, N) bool, symmetric, True on the diagonal, N ≥ 1.

    Raises:
        InvalidRequest: it is no such matrix.

    Complexity: O(N² / 64) words for each search; N searches at worst, a few dozen on floor plans.
    """
    if not (isinstance(visible, np.ndarray) and visible.dtype == np.bool_ and visible.ndim == 2 and len(visible) > 0):
        raise InvalidRequest("who sees whom is an (N, N) array of bool: of edge weights W give numpy.isfinite(W)")
    n = len(visible)
    rows = _pack(visible)
    lower, upper = np.zeros(n, np.int64), np.full(n, n)
    greatest, ends, parts = 0, (0, 0), 0
    met = np.zeros(n, np.bool_)
    from_far = True
    while True:
        unsure = upper > greatest
        if not unsure.any():
            return MostRelays(max(greatest - 1, 0), ends, parts)
        source = int(np.argmax(upper) if from_far else np.argmin(np.where(unsure, lower, n)))
        from_far = not from_far
        hops = _count_hops(rows, n, np.array([source]))
        reached = hops >= 0
        parts += not met[source]
        met |= reached
        eccentricity = int(hops.max())
        if eccentricity > greatest:
            greatest, ends = eccentricity, (source, int(np.argmax(hops)))
        lower = np.where(reached, np.maximum(lower, np.maximum(hops, eccentricity - hops)), lower)
        upper = np.where(reached, np.minimum(upper, hops + eccentricity), upper)
        upper[source] = eccentricity


def count_links(visible: Bools, sources: Bools) -> Ints:
    """The fewest links from any of some nodes to each node, breadth first.

    Args:
        visible: (N, N) bool, symmetric.
        sources: (N,) bool.

    Returns:
        (N,) int: 0 for the sources, -1 where no links lead.

    Complexity: O(N²).
    """
    return _count_hops(_pack(visible), len(visible), np.flatnonzero(sources))


def join_terminals(W: Floats, links: Floats, direct: Floats) -> Floats:
    """A graph of placements with terminals as further nodes, joined to what they see.

    Args:
        W: (N, N) float: weights of the links between placements, inf where there is none, 0 on the diagonal.
        links: (t, N) float: of the links between terminals and placements, inf where there is none.
        direct: (t, t) float, symmetric: of the links between terminals, inf where there is none.

    Returns:
        (N + t, N + t) float as W; terminal i is node N + i.
    """
    joined = np.block([[W, links.T], [links, direct]])
    np.fill_diagonal(joined, 0.0)
    return joined


def fewest_relays(visible: Bools, seen: Bools, direct: Bools) -> RelayTree:
    """The fewest relays that join terminals, and where they can stand: a Steiner tree with as few nodes as there are.

    Terminals stand anywhere: the base station, agents. They pass on what they receive as relays do.

    Args:
        visible: (N, N) bool, symmetric: which placements see each other.
        seen: (t, N) bool: which placements each terminal sees.
        direct: (t, t) bool, symmetric: which terminals see each other.

    Raises:
        NoTree: a terminal cannot be joined; its number is told.
        InvalidRequest: more terminals than exact trees are made for.

    Complexity: O(3^t N + 2^t N²), the exact programme of :func:`~planning.steiner.steiner_tree`.
    """
    unit = join_terminals(*(np.where(joined, 1.0, np.inf) for joined in (visible, seen, direct)))
    tree = steiner_tree(unit, len(visible) + np.arange(len(seen)))
    return RelayTree(np.sort(tree.nodes[tree.nodes < len(visible)]), tree.edges)


def _pack(visible: Bools) -> Words:
    """Rows of a matrix of truth values as words of 64: (N, ⌈N / 64⌉)."""
    n = len(visible)
    wide = np.zeros((n, 8 * (-(-n // 64))), np.uint8)
    packed = np.packbits(visible, axis=1, bitorder="little")
    wide[:, : packed.shape[1]] = packed
    return wide.view(np.uint64)


def _count_hops(rows: Words, n: int, frontier: Ints) -> Ints:
    """Links from the nodes of a frontier to each of n, -1 where none lead: (n,) int. Breadth first, 64 at a time."""
    hops = np.full(n, -1)
    number = 0
    while frontier.size:
        hops[frontier] = number
        number += 1
        next_ = np.bitwise_or.reduce(rows[frontier], axis=0)
        near = np.unpackbits(next_.view(np.uint8), count=n, bitorder="little").view(np.bool_)
        frontier = np.flatnonzero(near & (hops < 0))
    return hops
