"""When a network of lines of sight that come and go is in parts.

Part of the certificate, and written apart from all planners. Between two neighbouring beginnings and ends of sight the
links stay the same; at such an instant itself, for sight is closed, there are those of both neighbours. So it is enough
to look between.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Break:
    """A time in which the network does not join what it should."""

    start_s: float
    end_s: float
    parts: tuple[int, ...]
    """The part that each member is in at the start, numbered by its lowest member."""
    lost: tuple[tuple[int, int], ...]
    """Links that end at the start and join different parts."""
    between: tuple[int, int]
    """Two of the ends that should be joined; of a team a link that was lost, or the lowest members of two parts."""


def find_gaps(intervals: Floats, start_s: float, end_s: float) -> list[tuple[float, float]]:
    """What closed intervals (n, 2), in order, leave open of a time from start to end, which may be one instant."""
    if start_s == end_s:
        return [] if len(intervals) else [(start_s, end_s)]
    edges = np.concatenate([[start_s], intervals.ravel(), [end_s]]).reshape(-1, 2)
    return [(float(start), float(end)) for start, end in edges if start < end]


def find_breaks(
    sight: dict[tuple[int, int], Floats], members: int, start_s: float, end_s: float, ends: Sequence[int] | None
) -> list[Break]:
    """When the network does not join what it should: some members, the ends, or all.

    Args:
        sight: for every pair of members (i < j) the closed intervals (n, 2), seconds, in which they see each other.
        members: how many there are.
        start_s: of the time to look at.
        end_s: the same, or later.
        ends: two members or more; None for all.

    Complexity: O(l k³) for k members and l beginnings and ends of sight.
    """
    if start_s == end_s:
        times = np.array([start_s, end_s])
    else:
        times = np.unique(np.concatenate([[start_s, end_s], *(intervals.ravel() for intervals in sight.values())]))
    pairs = np.array(list(sight), dtype=np.int64).reshape(-1, 2)
    held = np.zeros((len(pairs), len(times) - 1), dtype=np.bool_)
    for row, intervals in zip(held, sight.values(), strict=True):
        if start_s == end_s:
            row[:] = len(intervals) > 0
        for start, end in np.searchsorted(times, intervals):
            row[start:end] = True
    labels: Ints = _label_parts(held, pairs, members)
    asked = np.arange(members) if ends is None else np.array(ends)
    joined = np.all(labels[:, asked] == labels[:, asked[:1]], axis=1)
    found = []
    for first in np.flatnonzero(~joined & np.append(True, joined[:-1])):
        last = first + int(np.argmax(np.append(joined[first:], True)))
        label = labels[first]
        outer = label[pairs[:, 0]] != label[pairs[:, 1]]
        lost = [(int(i), int(j)) for i, j in pairs[outer & held[:, first - 1]]] if first > 0 else []
        apart = (int(asked[0]), int(asked[np.argmax(label[asked] != label[asked[0]])]))
        between = lost[0] if lost and ends is None else apart
        parts = tuple(int(part) for part in label)
        found.append(Break(float(times[first]), float(times[last]), parts, tuple(lost), between))
    return found


@kernel
def _label_parts(held: Bools, pairs: Ints, members: int) -> Ints:
    """The part that each member is in, numbered by its lowest member: (pieces, members).

    ``held`` (n, pieces) bool: which of the n ``pairs`` see each other in each piece of time.
    """
    pieces = held.shape[1]
    labels = np.empty((pieces, members), np.int64)
    for t in range(pieces):
        root = np.arange(members)
        for k in range(pairs.shape[0]):
            if held[k, t]:
                one, other = root[pairs[k, 0]], root[pairs[k, 1]]
                low, high = min(one, other), max(one, other)
                if low < high:
                    for i in range(members):
                        if root[i] == high:
                            root[i] = low
        parts = 0
        for i in range(members):
            if root[i] == i:
                labels[t, i] = parts
                parts += 1
            else:
                labels[t, i] = labels[t, root[i]]
    return labels
