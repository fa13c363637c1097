"""What a team may do in one step on its way, and what has to be connected all the time.

A state is the node that each member is at. In a *step* some members go on by one piece, the *movers*; the others stay
at their nodes. A step is allowed if all combinations of places on the way are in order: robots apart, and the team
connected by links that hold throughout. What several may do together each of them may do alone, in any order; so
steps of one mover are enough to find whatever can be found.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel
from planning.pair_prospects import OPEN
from planning.pair_tables import APART, SEES

Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class Demand:
    """What has to be connected: sets of members are bits of numbers."""

    joined: int
    """Members that have to be in one component."""
    links: Ints
    """(k,) int: the members that each member has to see."""


@kernel
def is_joined(adjacent: Ints, joined: int) -> bool:
    """Whether a set of members is in one component; ``adjacent`` (k,): whom each sees, as bits."""
    reached = joined & -joined
    fresh = reached
    while joined & ~reached:
        found = 0
        for i in range(adjacent.shape[0]):
            if fresh >> i & 1:
                found |= adjacent[i]
        fresh = found & ~reached
        if fresh == 0:
            return False
        reached |= fresh
    return True


@kernel
def _is_connected(adjacent: Ints, joined: int, links: Ints) -> bool:
    for i in range(links.shape[0]):
        if links[i] & ~adjacent[i]:
            return False
    return is_joined(adjacent, joined)


@kernel
def _look(bits: Bytes, starts: Ints, sizes: Ints, elements: Ints, state: Ints, i: int) -> int:
    """Whom member i sees with all members on these elements, as bits.

    −1 if it is too near to one, or the state that they come to is a dead end for it and another.
    """
    seen = 0
    for j in range(elements.shape[0]):
        if j != i:
            pair = bits[starts[i, j] + elements[i] * sizes[j] + elements[j]]
            if pair & APART == 0 or bits[starts[i, j] + 2 * (state[i] * sizes[j] + state[j])] & OPEN == 0:
                return -1
            if pair & SEES:
                seen |= 1 << j
    return seen


@kernel
def stand(
    bits: Bytes, starts: Ints, sizes: Ints, state: Ints, joined: int, links: Ints, elements: Ints, adjacent: Ints
) -> bool:
    """Whether all is in order with all members at their nodes; writes their elements and whom they see."""
    for i in range(state.shape[0]):
        elements[i] = 2 * state[i]
    apart = True
    for i in range(state.shape[0]):
        adjacent[i] = _look(bits, starts, sizes, elements, state, i)
        apart = apart and adjacent[i] >= 0
    return apart and _is_connected(adjacent, joined, links)


@kernel
def add_mover(
    bits: Bytes, starts: Ints, sizes: Ints, i: int, joined: int, links: Ints, elements: Ints, state: Ints,
    adjacent: Ints, trial: Ints,
) -> bool:  # fmt: skip
    """Let member i go on by one piece if it may, together with those that go already: ``state`` is where they come."""
    elements[i] += 1
    state[i] += 1
    seen = _look(bits, starts, sizes, elements, state, i)
    if seen >= 0:
        trial[:] = adjacent
        trial[i] = seen
        for j in range(trial.shape[0]):
            trial[j] = trial[j] & ~(1 << i) | (seen >> j & 1) << i
        if seen == adjacent[i] or _is_connected(trial, joined, links):
            adjacent[:] = trial
            return True
    elements[i] -= 1
    state[i] -= 1
    return False
