"""Steps made into stages, as long as they can be, and the earliest times at which they are driven.

A schedule in stages is a row of *cuts*: the nodes at which each stage begins and the last one ends. Members are always
within two stages that follow each other, so the rule for cuts c is: the box of all places between c_n and c_(n+2) is in
order, for every n. Cuts are taken from the states of an order; the fewer, the less the members wait for each other.
Where only the box of a single step is in order, an empty stage follows it (a cut given twice), and all wait for all.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel
from planning.motion_plan import TimedPath
from planning.pair_tables import APART, SEES, PairTables
from planning.path_elements import PathElements
from planning.step_rules import Demand, is_joined

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]


def choose_cuts(states: Ints, tables: PairTables, demand: Demand) -> Ints:
    """Which states of an order are cuts.

    Args:
        states: (m, k) int, m ≥ 2: nodes, never falling; from each to the next all places in between are in order.
        tables: of all pairs.
        demand: what has to be connected.

    Returns:
        (n + 1,) int: rows of ``states``, rising or staying, n ≥ 1.

    Complexity: O(k² (n² + m)) for n elements each.
    """
    faults = _count_faults(tables.bits, tables.starts, tables.sizes)
    cuts: Ints = _choose(states, faults, tables.starts, tables.sizes, demand.joined, demand.links)
    return cuts


@kernel
def _count_faults(bits: Bytes, starts: Ints, sizes: Ints) -> Ints:
    """How many elements before each one, in both directions, are not apart, and how many do not see each other.

    (n, 2) int, in place of ``bits`` (n,): the sums are inclusive.
    """
    faults = np.zeros((bits.shape[0], 2), np.int64)
    k = sizes.shape[0]
    for i in range(k):
        for j in range(i):
            at = starts[i, j]
            width = sizes[j]
            for a in range(sizes[i]):
                near, hidden = 0, 0
                for _ in range(width):
                    pair = bits[at]
                    near += pair & APART == 0
                    hidden += pair & SEES == 0
                    faults[at, 0] = near + (faults[at - width, 0] if a > 0 else 0)
                    faults[at, 1] = hidden + (faults[at - width, 1] if a > 0 else 0)
                    at += 1
    return faults


@kernel
def _sum_faults(faults: Ints, start: int, width: int, a: int, b: int, c: int, d: int, kind: int) -> int:
    """Of the elements from a to b of one member and from c to d of another."""
    total = int(faults[start + b * width + d, kind])
    if a > 0:
        total -= faults[start + (a - 1) * width + d, kind]
    if c > 0:
        total -= faults[start + b * width + c - 1, kind]
    if a > 0 and c > 0:
        total += faults[start + (a - 1) * width + c - 1, kind]
    return total


@kernel
def _box_is_free(
    low: Ints, high: Ints, faults: Ints, starts: Ints, sizes: Ints, joined: int, links: Ints, adjacent: Ints
) -> bool:
    """Whether all is in order wherever from node ``low`` to node ``high`` each member may be."""
    k = low.shape[0]
    adjacent[:] = 0
    for i in range(k):
        for j in range(i):
            a, b, c, d = 2 * low[i], 2 * high[i], 2 * low[j], 2 * high[j]
            if _sum_faults(faults, starts[i, j], sizes[j], a, b, c, d, 0) > 0:
                return False
            if _sum_faults(faults, starts[i, j], sizes[j], a, b, c, d, 1) == 0:
                adjacent[i] |= 1 << j
                adjacent[j] |= 1 << i
    for i in range(k):
        if links[i] & ~adjacent[i]:
            return False
    return is_joined(adjacent, joined)


@kernel
def _choose(states: Ints, faults: Ints, starts: Ints, sizes: Ints, joined: int, links: Ints) -> Ints:
    """Each stage goes half as far as the box of two stages could; the second of the two then mostly fits in."""
    n = states.shape[0] - 1
    adjacent = np.empty(states.shape[1], np.int64)
    cuts = np.empty(2 * n + 2, np.int64)
    cuts[0] = 0
    count = 1
    before = here = 0  # how far the boxes that begin at the last cut but one, and at the last, may reach
    while cuts[count - 1] < n:
        cut = cuts[count - 1]
        here = max(here, cut)
        while here < n and _box_is_free(
            states[cut], states[here + 1], faults, starts, sizes, joined, links, adjacent
        ):  # fmt: skip
            here += 1
        if count == 1:
            before = here
        cuts[count] = max(cut, min(before, n if here == n else (cut + here + 1) // 2))
        count += 1
        before = here
    return cuts[:count].copy()


def time_stages(
    states: Ints, elements: Sequence[PathElements], speeds_m_s: Floats, anywhere: Sequence[int]
) -> tuple[list[TimedPath], Ints]:
    """The earliest execution of stages under the rule of progress.

    Args:
        states: (n + 1, k) int: the nodes at which each stage begins, and the last one ends, never falling.
        elements: of each path.
        speeds_m_s: (k,) float, positive.
        anywhere: the members that go along their whole paths as they please, and wait for nobody.

    Returns:
        paths: k paths; they start at 0 s.
        stages: (k, n + 1) int: their waypoints at the cuts.
    """
    cuts = states.T.tolist()
    ways = [_Way(path, float(speed)) for path, speed in zip(elements, speeds_m_s, strict=True)]
    scheduled = [i for i in range(len(ways)) if i not in anywhere]
    done = [0.0, 0.0]  # when all have finished the stage before the last one, and the last one
    for n in range(len(states) - 1):
        for i in scheduled:
            ways[i].drive(cuts[i][n + 1], done[0])
        done = [done[1], max((ways[i].times[-1] for i in scheduled), default=0.0)]
    for i in anywhere:
        ways[i].drive(elements[i].pieces, 0.0)
        ways[i].rows = [0] * (len(states) - 1) + ways[i].rows[-1:]
    paths = [TimedPath(way.waypoints, way.times) for way in ways]
    return paths, np.array([way.rows for way in ways], dtype=np.int64)


class _Way:
    """What a member drives, stage by stage, at full speed."""

    def __init__(self, path: PathElements, speed_m_s: float) -> None:
        self.nodes, self.corners = path.nodes.tolist(), path.corners.tolist()
        self.speed_m_s = speed_m_s
        self.node = 0
        self.waypoints, self.times, self.rows = [self.nodes[0]], [0.0], [0]

    def drive(self, node: int, earliest_s: float) -> None:
        """Go on to a node in one stage."""
        if node > self.node:
            if earliest_s > self.times[-1]:
                self.waypoints.append(self.waypoints[-1])
                self.times.append(earliest_s)
            for turn in (*(corner for corner in self.corners if self.node < corner < node), node):
                way = math.dist(self.waypoints[-1], self.nodes[turn])
                self.waypoints.append(self.nodes[turn])
                self.times.append(self.times[-1] + way / self.speed_m_s)
            self.node = node
        self.rows.append(len(self.waypoints) - 1)
