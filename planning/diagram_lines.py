"""Straight lines in a coordination diagram: whether robots may go along them together, and how long that takes.

Rows of robots and of tables are as in `planning.diagram_search`: ``limits`` (l,) of all robots, one after the other,
metres; ``firsts`` (k + 1,) where those of each begin; ``pace`` (k,) seconds a metre; ``sizes`` (k,) how many elements
each path has; ``starts`` (k, k), for i < j, where the table of a pair begins in ``blocked`` and ``seen``.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_AT_ONCE: Final = 1e-12
"""Of a line: robots that reach limits so shortly after each other reach them together."""


@kernel
def admits(elements: Ints, sizes: Ints, starts: Ints, blocked: Bools, seen: Bools, joined: Bools, part: Ints) -> bool:
    """Whether robots may be in these elements (k,) together; ``part`` (k,) is scratch."""
    k = elements.shape[0]
    for i in range(k):
        for j in range(i + 1, k):
            if blocked[starts[i, j] + elements[i] * sizes[j] + elements[j]]:
                return False
    if seen.shape[0] == 0:
        return True
    for i in range(k):
        part[i] = i
    for i in range(k):
        for j in range(i + 1, k):
            if part[i] != part[j] and seen[starts[i, j] + elements[i] * sizes[j] + elements[j]]:
                mine, other = part[i], part[j]
                for m in range(k):
                    if part[m] == other:
                        part[m] = mine
    first = -1
    for i in range(k):
        if joined[i]:
            if first >= 0 and part[i] != first:
                return False
            first = part[i]
    return True


@kernel
def line_is_free(
    a: Ints, b: Ints, limits: Floats, firsts: Ints, sizes: Ints, starts: Ints, blocked: Bools, seen: Bools,
    joined: Bools, elements: Ints, part: Ints,
) -> bool:  # fmt: skip
    """Whether all robots may go evenly from their limits ``a`` (k,) to ``b``; the last two are scratch.

    Between two limits that any robot crosses the elements stay the same. At a limit itself they border those before
    and after it, and are allowed as these are.
    """
    k = a.shape[0]
    way = np.empty(k, np.int64)
    for i in range(k):
        way[i] = 1 if b[i] > a[i] else -1 if b[i] < a[i] else 0
        elements[i] = 2 * a[i] + way[i]
    while True:
        if not admits(elements, sizes, starts, blocked, seen, joined, part):
            return False
        # The share of the line after which the next robots reach a limit; those of one share do at once.
        following = 1.0
        for i in range(k):
            if way[i] != 0:
                following = min(following, _share(i, a[i], b[i], elements[i] + way[i], limits, firsts))
        if following >= 1.0 - _AT_ONCE:
            return True
        for i in range(k):
            if way[i] != 0 and _share(i, a[i], b[i], elements[i] + way[i], limits, firsts) <= following + _AT_ONCE:
                elements[i] += 2 * way[i]


@kernel
def _share(i: int, start: int, end: int, element: int, limits: Floats, firsts: Ints) -> float:
    """How far the limit that an even element stands for is on robot i's way from one limit to another, 0 to 1."""
    first = limits[firsts[i] + start]
    return float((limits[firsts[i] + element // 2] - first) / (limits[firsts[i] + end] - first))


@kernel
def span(a: Ints, b: Ints, limits: Floats, firsts: Ints, pace: Floats) -> float:
    """Seconds that the slowest robot takes from its limit in ``a`` (k,) to that in ``b``."""
    longest = 0.0
    for i in range(a.shape[0]):
        longest = max(longest, abs(limits[firsts[i] + b[i]] - limits[firsts[i] + a[i]]) * pace[i])
    return longest


@kernel
def measure_left(a: Ints, limits: Floats, firsts: Ints, pace: Floats) -> float:
    """Seconds that all robots together have left from their limits in ``a`` (k,)."""
    total = 0.0
    for i in range(a.shape[0]):
        total += (limits[firsts[i + 1] - 1] - limits[firsts[i] + a[i]]) * pace[i]
    return total
