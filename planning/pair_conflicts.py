"""Who still has to do with whom: what makes the order of moves matter, and what lets most of it be left alone.

The next piece of a member is in *conflict* with an element of another if their robots are not apart there, or if it
loses a sight of that element which the member has at its node. A piece that is in conflict with nothing on the ways
that others have left can be driven at once: it is in nobody's way, and takes no sight from anybody, whatever they do.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel
from planning.pair_tables import APART, SEES

Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]


@kernel
def find_last_conflicts(bits: Bytes, starts: Ints, sizes: Ints, last: Ints) -> Ints:
    """(k, k, most nodes) int: the last element of member j in conflict with the piece of i after a node; −1 for none.

    Args:
        bits: of the pair tables.
        starts: likewise.
        sizes: likewise.
        last: (k,) int: each member's last node.
    """
    k = sizes.shape[0]
    found = np.full((k, k, last.max() + 1), -1, np.int64)
    for i in range(k):
        for j in range(k):
            if j == i:
                continue
            for a in range(last[i]):
                node = starts[i, j] + 2 * a * sizes[j]
                piece = node + sizes[j]
                for f in range(sizes[j] - 1, -1, -1):
                    if bits[piece + f] & APART == 0 or bits[node + f] & ~bits[piece + f] & SEES != 0:
                        found[i, j, a] = f
                        break
    return found


@kernel
def find_last_ahead(conflicts: Ints) -> Ints:
    """The same of all pieces of i from a node on: (k, k, most nodes) int."""
    ahead = conflicts.copy()
    for a in range(conflicts.shape[2] - 2, -1, -1):
        ahead[:, :, a] = np.maximum(ahead[:, :, a], ahead[:, :, a + 1])
    return ahead


@kernel
def move_freely(conflicts: Ints, state: Ints, last: Ints, moved: Ints) -> bool:
    """Let all members go on by one piece whose piece is in conflict with nothing that is left; whether any does.

    ``state`` (k,): their nodes; ``moved`` (k,) is where they come to.
    """
    k = state.shape[0]
    any_moves = False
    for i in range(k):
        free = state[i] < last[i]
        for j in range(k):
            if free and conflicts[i, j, state[i]] >= 2 * state[j]:
                free = False
        moved[i] = state[i] + 1 if free else state[i]
        any_moves = any_moves or free
    return any_moves


@kernel
def find_cluster(ahead: Ints, state: Ints, member: int) -> int:
    """The members that have to do with one another on the ways that are left, a given one among them, as bits."""
    cluster = 1 << member
    fresh = cluster
    while fresh:
        found = 0
        for i in range(state.shape[0]):
            if fresh >> i & 1:
                for j in range(state.shape[0]):
                    if ahead[i, j, state[i]] >= 2 * state[j] or ahead[j, i, state[j]] >= 2 * state[i]:
                        found |= 1 << j
        fresh = found & ~cluster
        cluster |= fresh
    return cluster
