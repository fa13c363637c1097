"""Plain searches and judges over the elements of paths: what the kernels of the planner are held against."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from planning.pair_tables import APART, SEES, PairTables
from planning.step_rules import Demand

Ints = NDArray[np.int64]
State = tuple[int, ...]


class Oracle:
    """Rules of a team, asked one combination of elements at a time."""

    def __init__(self, tables: PairTables, demand: Demand, last: Ints) -> None:
        self.last: State = tuple(last.tolist())
        self.k = len(self.last)
        self.tables = {
            (i, j): tables.table(i, j).tolist() for i in range(self.k) for j in range(self.k) if i != j
        }  # fmt: skip
        self.joined = {i for i in range(self.k) if demand.joined >> i & 1}
        self.links = [(i, j) for i in range(self.k) for j in range(i) if demand.links[i] >> j & 1]

    def apart(self, ranges: Sequence[range]) -> bool:
        return all(
            self.tables[i, j][e][f] & APART
            for i in range(self.k)
            for j in range(i)
            for e, f in product(ranges[i], ranges[j])
        )

    def connected(self, ranges: Sequence[range]) -> bool:
        """By links that hold throughout the box of these elements."""
        links = {
            (i, j)
            for i in range(self.k)
            for j in range(self.k)
            if i != j and all(self.tables[i, j][e][f] & SEES for e, f in product(ranges[i], ranges[j]))
        }
        if not links.issuperset(self.links):
            return False
        reached = set(sorted(self.joined)[:1])
        while fresh := {j for i, j in links if i in reached} - reached:
            reached |= fresh
        return self.joined <= reached

    def allows(self, before: State, after: State) -> bool:
        """Whether all is in order wherever between two states each member may be."""
        ranges = [range(2 * a, 2 * b + 1) for a, b in zip(before, after, strict=True)]
        return self.apart(ranges) and self.connected(ranges)

    def search(self) -> bool:
        """Whether steps of one mover lead from the first nodes to the last ones: complete, breadth first."""
        start = (0,) * self.k
        if not self.allows(start, start):
            return False
        seen, level = {start}, [start]
        while level:
            following = []
            for state in level:
                for i in range(self.k):
                    if state[i] < self.last[i]:
                        after = (*state[:i], state[i] + 1, *state[i + 1 :])
                        if after not in seen and self.allows(state, after):
                            seen.add(after)
                            following.append(after)
            level = following
        return self.last in seen


def random_tables(k: int, most_pieces: int, boxes: int, rng: np.random.Generator) -> tuple[PairTables, Ints]:
    """Tables of members that keep out of boxes in each other's diagrams, and do not see each other in others.

    None of these touches the start or the goal of a pair, but for some in which two do not see each other.
    """
    last = rng.integers(0, most_pieces + 1, k)
    sizes = 2 * last + 1
    starts = np.zeros((k, k), dtype=np.int64)
    bits = np.zeros(int(sizes.sum() ** 2), dtype=np.uint8)
    at = 0
    for i in range(k):
        for j in range(i):
            table = np.full((sizes[i], sizes[j]), APART | SEES, dtype=np.uint8)
            for bit in (APART, SEES):
                for _ in range(rng.integers(0, boxes + 1)):
                    first = rng.integers(0, (sizes[i], sizes[j]))
                    after = first + rng.integers(1, 2 + most_pieces, 2)
                    if bit == SEES and rng.uniform() < 0.7:
                        # In sight only when both are early, or both late, or as long as one of them stands still.
                        first, after = (first, np.array([99, 99])) if rng.uniform() < 0.5 else (np.zeros(2, int), after)
                    box = np.zeros_like(table, dtype=np.bool_)
                    box[first[0] : after[0], first[1] : after[1]] = True
                    if bit == SEES or not (box[0, 0] or box[-1, -1]):
                        table[_closed(box)] &= np.uint8(0xFF ^ bit)
            for row, column, one in ((i, j, table), (j, i, table.T)):
                starts[row, column] = at
                bits[at : at + table.size] = one.ravel()
                at += table.size
    return PairTables(sizes, starts, bits), last


def _closed(box: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """With a node all pieces that end there."""
    grown = box.copy()
    for axis in (0, 1):
        source = np.moveaxis(grown, axis, 0)
        target = source.copy()
        target[1::2] |= source[:-1:2] | source[2::2]
        grown = np.moveaxis(target, 0, axis)
    return grown


def random_demand(k: int, rng: np.random.Generator) -> Demand:
    """Nothing, the whole team, some members, or some links."""
    kind = rng.integers(4)
    links = np.zeros(k, dtype=np.int64)
    if kind == 3:
        i, j = rng.choice(k, 2, replace=False)
        links[i] |= 1 << int(j)
        links[j] |= 1 << int(i)
    joined = (0, (1 << k) - 1, 0b11, 0)[kind]
    return Demand(joined, links)
