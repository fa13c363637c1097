"""Who advances when: a search in the product of the members' elements.

A state is the node that each member is at. In a *step* some members go on by one piece, the *movers*; the others stay
at their nodes. A step is allowed if all combinations of places on the way are in order: robots apart, and the team
connected by links that hold throughout. What several may do together each of them may do alone, in any order; so
steps of one mover are enough to find whatever can be found, and steps of many make it fast and the schedule short.

The search goes depth first, each state once: from every state first as many together as can, those first that have
longest to go; where that ends nowhere, one by one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel
from planning.pair_tables import APART, SEES, PairTables

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class Demand:
    """What has to be connected: sets of members are bits of numbers."""

    joined: int
    """Members that have to be in one component."""
    links: Ints
    """(k,) int: the members that each member has to see."""


@dataclass(frozen=True, slots=True, eq=False)
class Order:
    """The states (n + 1, k) that the members go through, node by node, and whether they get to their goals."""

    states: Ints
    complete: bool


def search_order(tables: PairTables, demand: Demand, durations: Floats, last: Ints, most_states: int) -> Order:
    """Find steps that bring all members from their first nodes to their last ones.

    Args:
        tables: of all pairs.
        demand: what has to be connected at any time.
        durations: (k, n) float, seconds: how long each member takes for each of its pieces; 0 beyond its last.
        last: (k,) int: each member's last node; 0 for one that stands, or is anywhere on its path.
        most_states: give up after so many.

    Returns:
        The order; if none was found, that to the state with the least left to go.
    """
    remaining = np.zeros((len(durations), durations.shape[1] + 1))
    remaining[:, :-1] = np.cumsum(durations[:, ::-1], axis=1)[:, ::-1]
    states, complete = _search(
        tables.bits, tables.starts, tables.sizes, demand.joined, demand.links, remaining, last, most_states
    )
    return Order(states, bool(complete))


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
def _look(bits: Bytes, starts: Ints, sizes: Ints, elements: Ints, i: int) -> int:
    """Whom member i sees with all members on these elements, as bits; −1 if it is too near to one."""
    seen = 0
    for j in range(elements.shape[0]):
        if j != i:
            pair = bits[starts[i, j] + elements[i] * sizes[j] + elements[j]]
            if pair & APART == 0:
                return -1
            if pair & SEES:
                seen |= 1 << j
    return seen


@kernel
def _set_row(adjacent: Ints, i: int, seen: int) -> None:
    adjacent[i] = seen
    for j in range(adjacent.shape[0]):
        adjacent[j] = adjacent[j] & ~(1 << i) | ((seen >> j & 1) << i)


@kernel
def _is_connected(adjacent: Ints, joined: int, links: Ints) -> bool:
    for i in range(links.shape[0]):
        if links[i] & ~adjacent[i]:
            return False
    return is_joined(adjacent, joined)


@kernel
def _stand(
    bits: Bytes, starts: Ints, sizes: Ints, state: Ints, joined: int, links: Ints, elements: Ints, adjacent: Ints
) -> bool:
    """Whether all is in order with all members at their nodes; writes their elements and whom they see."""
    for i in range(state.shape[0]):
        elements[i] = 2 * state[i]
    apart = True
    for i in range(state.shape[0]):
        adjacent[i] = _look(bits, starts, sizes, elements, i)
        if adjacent[i] < 0:
            apart = False
    return apart and _is_connected(adjacent, joined, links)


@kernel
def _add_mover(
    bits: Bytes, starts: Ints, sizes: Ints, i: int, joined: int, links: Ints, elements: Ints, adjacent: Ints,
    trial: Ints,
) -> bool:  # fmt: skip
    """Let member i go on by one piece if it may, together with those that go already."""
    elements[i] += 1
    seen = _look(bits, starts, sizes, elements, i)
    if seen >= 0:
        if seen == adjacent[i]:
            return True
        trial[:] = adjacent
        _set_row(trial, i, seen)
        if _is_connected(trial, joined, links):
            adjacent[:] = trial
            return True
    elements[i] -= 1
    return False


@kernel
def _rank(state: Ints, last: Ints, remaining: Floats, ranked: Ints) -> int:
    """Write the members that are not at their goals, longest to go first; how many."""
    count = 0
    for i in range(state.shape[0]):
        if state[i] < last[i]:
            k = count
            while k > 0 and remaining[ranked[k - 1], state[ranked[k - 1]]] < remaining[i, state[i]]:
                ranked[k] = ranked[k - 1]
                k -= 1
            ranked[k] = i
            count += 1
    return count


@kernel
def _find_slot(state: Ints, known: Ints, slots: Ints) -> int:
    """Where a state is, or would be, in a table of hashes; ``slots`` holds rows of ``known``, −1 where empty."""
    h = np.uint64(1469598103934665603)
    for i in range(state.shape[0]):
        h = (h ^ np.uint64(state[i] + 1)) * np.uint64(1099511628211)
        h ^= h >> np.uint64(29)
    mask = slots.shape[0] - 1
    slot = int(np.int64(h & np.uint64(mask)))
    while slots[slot] >= 0:
        row = slots[slot]
        same = True
        for i in range(state.shape[0]):
            if known[row, i] != state[i]:
                same = False
                break
        if same:
            return slot
        slot = (slot + 1) & mask
    return slot


@kernel
def _search(
    bits: Bytes, starts: Ints, sizes: Ints, joined: int, links: Ints, remaining: Floats, last: Ints, most_states: int
) -> tuple[Ints, bool]:
    k = last.shape[0]
    capacity = 1024
    known = np.zeros((capacity, k), np.int64)
    before = np.full(capacity, -1, np.int64)
    tried = np.zeros(capacity, np.int64)
    slots = np.full(4 * capacity, -1, np.int64)
    state, elements, adjacent, trial, ranked = (
        np.zeros(k, np.int64), np.zeros(k, np.int64), np.zeros(k, np.int64), np.zeros(k, np.int64),
        np.zeros(k, np.int64),
    )  # fmt: skip
    slots[_find_slot(state, known, slots)] = 0
    found = 1
    best, least = 0, np.inf
    top = 0
    if not _stand(bits, starts, sizes, state, joined, links, elements, adjacent):
        return known[:1].copy(), False
    while top >= 0 and found < most_states:
        left = 0.0
        for i in range(k):
            left += remaining[i, known[top, i]]
        if left < least:
            best, least = top, left
        count = _rank(known[top], last, remaining, ranked)
        if count == 0:
            break
        if tried[top] > count:
            top = before[top]
            continue
        _stand(bits, starts, sizes, known[top], joined, links, elements, adjacent)
        state[:] = known[top]
        if tried[top] == 0:
            moved = False
            for r in range(count):
                if _add_mover(bits, starts, sizes, ranked[r], joined, links, elements, adjacent, trial):
                    state[ranked[r]] += 1
                    moved = True
            if not moved:
                top = before[top]
                continue
            tried[top] = 1
        else:
            i = ranked[tried[top] - 1]
            tried[top] += 1
            if not _add_mover(bits, starts, sizes, i, joined, links, elements, adjacent, trial):
                continue
            state[i] += 1
        slot = _find_slot(state, known, slots)
        if slots[slot] >= 0:
            continue
        if found == capacity:
            capacity *= 2
            known, before, tried, slots = _grow(known, before, tried, capacity)
            slot = _find_slot(state, known, slots)
        known[found] = state
        before[found] = top
        slots[slot] = found
        top = found
        found += 1
    length = 0
    row = best
    while row >= 0:
        length += 1
        row = before[row]
    states = np.empty((length, k), np.int64)
    row = best
    while row >= 0:
        length -= 1
        states[length] = known[row]
        row = before[row]
    complete = True
    for i in range(k):
        if states[-1, i] < last[i]:
            complete = False
    return states, complete


@kernel
def _grow(known: Ints, before: Ints, tried: Ints, capacity: int) -> tuple[Ints, Ints, Ints, Ints]:
    found = known.shape[0]
    more_known = np.zeros((capacity, known.shape[1]), np.int64)
    more_before, more_tried = np.full(capacity, -1, np.int64), np.zeros(capacity, np.int64)
    more_known[:found], more_before[:found], more_tried[:found] = known, before, tried
    slots = np.full(4 * capacity, -1, np.int64)
    for row in range(found):
        slots[_find_slot(more_known[row], more_known, slots)] = row
    return more_known, more_before, more_tried, slots
