"""Who advances when: a search in the product of the members' elements (`planning.step_rules`).

First all go on together, in every step as many as can, those first that have longest to go: that is mostly all, and
short. Where it ends nowhere, a search goes depth first, each state once, and needs few of the many orders:

- No pair of members goes where the two have no way on (`planning.pair_prospects`).
- A piece that is in nobody's way is driven at once, and nothing else is tried instead (`planning.pair_conflicts`).
- Where only collisions count, members that have nothing more to do with each other are searched one group after the
  other: an order among groups changes nothing.

What the search finds is one after the other; then every move is made as early as it can be.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel
from planning.pair_conflicts import find_cluster, find_last_ahead, find_last_conflicts, move_freely
from planning.pair_prospects import OPEN, mark_prospects
from planning.pair_tables import PairTables
from planning.step_rules import Demand, add_mover, is_joined, stand

__all__ = ["Demand", "Order", "is_joined", "search_order"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]

SAME_TIME_S: Final = 1e-9
"""Times that differ by less are rounded."""

STATES_IN_VAIN: Final = 1000
"""Of a search for the best effort, where it is proven that not all get to their goals."""


@dataclass(frozen=True, slots=True, eq=False)
class Order:
    """What a search found.

    Attributes:
        states: (n + 1, k) int: the nodes that the members go through; to their last ones, or to the state found with
            the least left to go.
        complete: whether they are at their last nodes in the end.
        proven: where not, whether no order is.
        closed: (m, 2) int: pairs of members that have no way to their last nodes even without the others.
    """

    states: Ints
    complete: bool
    proven: bool
    closed: Ints


def search_order(tables: PairTables, demand: Demand, durations: Floats, last: Ints, most_states: int) -> Order:
    """Find steps that bring all members from their first nodes to their last ones.

    Args:
        tables: of all pairs; the bits for prospects are set.
        demand: what has to be connected at any time.
        durations: (k, n) float, seconds: how long each member takes for each of its pieces; 0 beyond its last.
        last: (k,) int: each member's last node; 0 for one that stands, or is anywhere on its path.
        most_states: of the depth-first search; then it gives up.

    Complexity: O(k² n²) for n elements each; each step or state O(k²).
    """
    bits, starts, sizes = tables.bits, tables.starts, tables.sizes
    remaining = _sum_up(durations)
    closed = mark_prospects(bits, starts, sizes, last, demand.joined, demand.links)
    for i, j in (*closed, *closed[:, ::-1]):
        tables.table(i, j)[...] |= OPEN
    states = _go_together(bits, starts, sizes, demand.joined, demand.links, remaining, last, False)
    if np.array_equal(states[-1], last):
        return Order(states, True, False, closed)
    most = min(most_states, STATES_IN_VAIN) if len(closed) > 0 else most_states
    found, exhausted = _search(bits, starts, sizes, demand.joined, demand.links, remaining, last, most)
    if np.array_equal(found[-1], last):
        return Order(_hasten(found, bits, starts, sizes, demand.joined, demand.links), True, False, closed)
    rows = np.arange(len(last))
    if remaining[rows, found[-1]].sum() < remaining[rows, states[-1]].sum():
        states = found
    return Order(states, False, bool(exhausted) or len(closed) > 0, closed)


def order_in_time(tables: PairTables, demand: Demand, durations: Floats, last: Ints) -> Ints:
    """Another way for all to go on together: nobody goes along in a step before it can be where the step begins.

    Of an order found by :func:`search_order`, all pieces of a step are driven at once, however long they are. So robots
    on the short pieces around a corner go at the pace of those on long ones; here they do not. Where all come by each
    other at every step, the first is better.

    Args:
        tables: of all pairs, marked by that search.
        demand: as there, and so are the others.
        durations: (k, n) float, seconds.
        last: (k,) int.

    Returns:
        (n + 1, k) int: the nodes that the members go through, until nobody can go on.

    Complexity: O(k² n) for n elements each.
    """
    remaining = _sum_up(durations)
    states: Ints = _go_together(
        tables.bits, tables.starts, tables.sizes, demand.joined, demand.links, remaining, last, True
    )
    return states


def _sum_up(durations: Floats) -> Floats:
    """How long each member takes from each of its nodes on: (k, n + 1), seconds."""
    remaining = np.zeros((len(durations), durations.shape[1] + 1))
    remaining[:, :-1] = np.cumsum(durations[:, ::-1], axis=1)[:, ::-1]
    return remaining


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
def _go_together(
    bits: Bytes, starts: Ints, sizes: Ints, joined: int, links: Ints, remaining: Floats, last: Ints, in_time: bool
) -> Ints:
    """Steps of as many movers as can, until nobody can: states (n + 1, k).

    In time: of as many as can and are at their nodes when those set out that are there first.
    """
    k = last.shape[0]
    states = np.zeros((last.sum() + 1, k), np.int64)
    state, elements, adjacent, trial, ranked = (
        np.zeros(k, np.int64), np.zeros(k, np.int64), np.zeros(k, np.int64), np.zeros(k, np.int64),
        np.zeros(k, np.int64),
    )  # fmt: skip
    there = np.zeros(k)  # when each is at its node
    n = 0
    moved = stand(bits, starts, sizes, state, joined, links, elements, adjacent)
    while moved:
        moved = False
        count = _rank(states[n], last, remaining, ranked)
        stand(bits, starts, sizes, state, joined, links, elements, adjacent)
        begun = np.inf
        for r in np.argsort(there[ranked[:count]], kind="mergesort"):
            i = ranked[r]
            if there[i] > begun + SAME_TIME_S:
                break
            if add_mover(bits, starts, sizes, i, joined, links, elements, state, adjacent, trial):
                moved = True
                if in_time:
                    begun = min(begun, there[i])
        if moved:
            if in_time:
                for i in range(k):
                    if state[i] > states[n, i]:
                        there[i] = max(there[i], begun) + remaining[i, states[n, i]] - remaining[i, state[i]]
            n += 1
            states[n] = state
    return states[: n + 1].copy()


@kernel
def _find_slot(state: Ints, known: Ints, slots: Ints) -> int:
    """Where a state is, or would be, in a table of hashes; ``slots`` holds rows of ``known``, −1 where empty."""
    h = np.uint64(1469598103934665603)
    for i in range(state.shape[0]):
        h = (h ^ np.uint64(state[i])) * np.uint64(1099511628211)
        h ^= h >> np.uint64(29)
    slot = np.int64(h & np.uint64(slots.shape[0] - 1))
    while slots[slot] >= 0 and not np.array_equal(known[slots[slot]], state):
        slot = (slot + 1) % slots.shape[0]
    return int(slot)


@kernel
def _search(
    bits: Bytes, starts: Ints, sizes: Ints, joined: int, links: Ints, remaining: Floats, last: Ints, most_states: int
) -> tuple[Ints, bool]:
    """Steps of one mover after the other, or of all that are free: states (n + 1, k), and whether all were tried."""
    k = last.shape[0]
    known = np.zeros((most_states + 1, k), np.int64)
    before, tried = np.full(most_states + 1, -1, np.int64), np.zeros(most_states + 1, np.int64)
    size = 64
    while size < 2 * most_states:
        size *= 2
    slots = np.full(size, -1, np.int64)
    state, elements, adjacent, trial, ranked = (
        np.zeros(k, np.int64), np.zeros(k, np.int64), np.zeros(k, np.int64), np.zeros(k, np.int64),
        np.zeros(k, np.int64),
    )  # fmt: skip
    conflicts = find_last_conflicts(bits, starts, sizes, last)
    ahead = find_last_ahead(conflicts)
    grouped = joined == 0 and not links.any()
    slots[_find_slot(state, known, slots)] = 0
    found, top, best, least = 1, 0, 0, np.inf
    if not stand(bits, starts, sizes, state, joined, links, elements, adjacent):
        top = -1
    while top >= 0 and found <= most_states:
        here = known[top]
        count = _rank(here, last, remaining, ranked)
        if tried[top] == 0:
            left = 0.0
            for i in range(k):
                left += remaining[i, here[i]]
            if left < least:
                best, least = top, left
            if count == 0:
                break
        if tried[top] > count:
            top = before[top]
            continue
        if tried[top] == 0 and move_freely(conflicts, here, last, state):
            tried[top] = count + 1
        else:
            tried[top] = max(1, tried[top])
            i = ranked[tried[top] - 1]
            tried[top] += 1
            if grouped and not find_cluster(ahead, here, ranked[0]) >> i & 1:
                continue
            state[:] = here
            stand(bits, starts, sizes, state, joined, links, elements, adjacent)
            if not add_mover(bits, starts, sizes, i, joined, links, elements, state, adjacent, trial):
                continue
        slot = _find_slot(state, known, slots)
        if slots[slot] < 0:
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
    return states, top < 0


@kernel
def _hasten(states: Ints, bits: Bytes, starts: Ints, sizes: Ints, joined: int, links: Ints) -> Ints:
    """The same moves, each in the earliest step in which its mover may go along: states (n + 1, k)."""
    k = states.shape[1]
    states = states.copy()
    state, elements, adjacent, trial = (
        np.zeros(k, np.int64), np.zeros(k, np.int64), np.zeros(k, np.int64), np.zeros(k, np.int64)
    )  # fmt: skip
    for t in range(1, states.shape[0] - 1):
        for i in range(k):
            # A step that several go along with is in order without one of them too: it may have gone before.
            u = t
            while u > 0 and states[u, i] < states[u + 1, i] and states[u - 1, i] == states[u, i]:
                state[:] = states[u - 1]
                stand(bits, starts, sizes, state, joined, links, elements, adjacent)
                for j in range(k):
                    if states[u - 1, j] < states[u, j]:
                        add_mover(bits, starts, sizes, j, joined, links, elements, state, adjacent, trial)
                if not add_mover(bits, starts, sizes, i, joined, links, elements, state, adjacent, trial):
                    break
                states[u, i] += 1
                u -= 1
    kept = 1
    for t in range(1, states.shape[0]):
        if not np.array_equal(states[t], states[kept - 1]):
            states[kept] = states[t]
            kept += 1
    return states[:kept].copy()
