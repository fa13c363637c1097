"""From where two members can still get to their goals, as far as these two go.

For every pair of members the others are thought away: they are in nobody's way, and whoever can be seen from anywhere
on their paths sees them, all the time. What two members cannot do then they cannot do at all. So a state with a pair
that has no way on is a dead end, however the others stand; and a pair that has none from its start proves that there is
no schedule over these elements, and is to blame.

With only two members left, the states from which a way leads on are found by one pass over the table of the two, from
their goals back.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel
from planning.pair_tables import APART, SEES

Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]

OPEN: Final = 4
"""Bit, of pairs of nodes: a way leads on from there for both."""


@kernel
def find_seen(bits: Bytes, starts: Ints, sizes: Ints) -> Ints:
    """Whom each member sees from each of its elements, anywhere on their paths, as bits: (k, most elements)."""
    k = sizes.shape[0]
    seen = np.zeros((k, sizes.max()), np.int64)
    for i in range(k):
        for j in range(k):
            if j == i:
                continue
            for e in range(sizes[i]):
                row = starts[i, j] + e * sizes[j]
                for f in range(sizes[j]):
                    if bits[row + f] & SEES:
                        seen[i, e] |= 1 << j
                        break
    return seen


@kernel
def _spread(reached: int, whole: Ints, among: int) -> int:
    """All members of a set that are joined to some of them by members of the set; ``whole`` (k,): who can see whom."""
    fresh = reached
    while fresh:
        found = 0
        for m in range(whole.shape[0]):
            if fresh >> m & 1:
                found |= whole[m]
        fresh = found & among & ~reached
        reached |= fresh
    return reached


@kernel
def _join_all(seen: Ints) -> Ints:
    """Whom each member can see at all, (k,)."""
    whole = np.zeros(seen.shape[0], np.int64)
    for i in range(seen.shape[0]):
        for e in range(seen.shape[1]):
            whole[i] |= seen[i, e]
    return whole


@kernel
def _may_be_joined(linked: bool, one: int, other: int, joined: int) -> bool:
    """Whether a set may be in one component: of a member with all that it reaches, of another, or of neither."""
    if linked or one & other:
        one = other = one | other
    return joined & ~one == 0 or joined & ~other == 0 or joined & (one | other) == 0


@kernel
def find_isolation(seen: Ints, sizes: Ints, joined: int) -> tuple[int, int]:
    """A member and its first element on which it cannot be joined with the set, wherever the others are; or −1, −1.

    Args:
        seen: by `find_seen`.
        sizes: of the pair tables.
        joined: members that have to be in one component, as bits.
    """
    whole = _join_all(seen)
    for i in range(sizes.shape[0]):
        if joined >> i & 1:
            for e in range(sizes[i]):
                if joined & ~(1 << i | _spread(seen[i, e], whole, ~(1 << i))):
                    return i, e
    return -1, -1


@kernel
def mark_prospects(bits: Bytes, starts: Ints, sizes: Ints, last: Ints, joined: int, links: Ints) -> Ints:
    """Set `OPEN` in all tables.

    Args:
        bits: of the pair tables.
        starts: likewise.
        sizes: likewise.
        last: (k,) int: each member's last node.
        joined: members that have to be in one component, as bits.
        links: (k,) int: the members that each member has to see.

    Returns:
        (m, 2) int: the pairs that have no way on from their start.

    Complexity: O(k² n²) for n elements each.
    """
    k = sizes.shape[0]
    seen = find_seen(bits, starts, sizes)
    whole = _join_all(seen)
    reach = np.empty((2, seen.shape[1]), np.int64)
    closed = np.empty((k * k, 2), np.int64)
    found = 0
    for i in range(k):
        for j in range(i):
            among = ~(1 << i | 1 << j)
            for side, member in enumerate((i, j)):
                for e in range(sizes[member]):
                    reach[side, e] = 1 << member | _spread(seen[member, e] & among, whole, among)
            required = links[i] >> j & 1 == 1
            if not required and _is_open(bits, starts[i, j], sizes, i, j, reach, joined):
                for at, count in ((starts[i, j], sizes[i] * sizes[j]), (starts[j, i], sizes[i] * sizes[j])):
                    for entry in range(at, at + count):
                        bits[entry] |= OPEN
                continue
            for a in range(last[i], -1, -1):
                for b in range(last[j], -1, -1):
                    if _leads_on(bits, starts[i, j], sizes[j], a, b, last[i], last[j], reach, joined, required):
                        bits[starts[i, j] + 2 * a * sizes[j] + 2 * b] |= OPEN
                        bits[starts[j, i] + 2 * b * sizes[i] + 2 * a] |= OPEN
            if bits[starts[i, j]] & OPEN == 0:
                closed[found, 0], closed[found, 1] = i, j
                found += 1
    return closed[:found].copy()


@kernel
def _is_open(bits: Bytes, start: int, sizes: Ints, i: int, j: int, reach: Ints, joined: int) -> bool:
    """Whether two members have nothing to do with each other: never near, and joined over others wherever they are."""
    for side, member in enumerate((i, j)):
        for e in range(sizes[member]):
            if joined & ~reach[side, e]:
                return False
    return bool(np.all(bits[start : start + sizes[i] * sizes[j]] & APART))


@kernel
def _leads_on(
    bits: Bytes, start: int, width: int, a: int, b: int, last_a: int, last_b: int, reach: Ints, joined: int,
    required: bool,
) -> bool:  # fmt: skip
    """Whether two members may be at nodes a and b and one of them can go on to where it is open, or both are done."""
    if not _is_free(bits, start, width, 2 * a, 2 * b, reach, joined, required):
        return False
    if a == last_a and b == last_b:
        return True
    if (
        a < last_a
        and bits[start + 2 * (a + 1) * width + 2 * b] & OPEN
        and _is_free(bits, start, width, 2 * a + 1, 2 * b, reach, joined, required)
    ):
        return True
    return (
        b < last_b
        and bits[start + 2 * a * width + 2 * (b + 1)] & OPEN != 0
        and _is_free(bits, start, width, 2 * a, 2 * b + 1, reach, joined, required)
    )


@kernel
def _is_free(bits: Bytes, start: int, width: int, e: int, f: int, reach: Ints, joined: int, required: bool) -> bool:
    """Whether two members may be on elements e and f, as far as these two go."""
    pair = bits[start + e * width + f]
    linked = pair & SEES != 0
    return pair & APART != 0 and (linked or not required) and _may_be_joined(linked, reach[0, e], reach[1, f], joined)
