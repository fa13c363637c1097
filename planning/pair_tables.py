"""What is true of every pair of elements of the members' paths: are their robots apart, and do they see each other.

All pairs of members lie in one array, so that a search looks up a pair of elements in a nanosecond or two. The tables
are exact of elements, and so of every product of ranges of elements.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.pair_clearance import mark_clearance
from planning.pair_sight import mark_sight
from planning.path_elements import PathElements

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]

APART: Final = 1
"""Bit: robots anywhere on the two elements do not overlap."""

SEES: Final = 2
"""Bit: every point of the one element sees every point of the other."""


@dataclass(frozen=True, slots=True, eq=False)
class PairTables:
    """Pair tables of k members.

    Attributes:
        sizes: (k,) int: elements of each member; 1 for one that stands, or that may be anywhere on its path.
        starts: (k, k) int: where the table of members i and j begins in ``bits``: row by row, element of i by element
            of j.
        bits: (n,) uint8, of `APART` and `SEES`; the table of (j, i) is that of (i, j) transposed.
    """

    sizes: Ints
    starts: Ints
    bits: Bytes

    def table(self, i: int, j: int) -> Bytes:
        """The table (sizes[i], sizes[j]) of two members."""
        rows, columns = int(self.sizes[i]), int(self.sizes[j])
        return self.bits[self.starts[i, j] : self.starts[i, j] + rows * columns].reshape(rows, columns)


def make_tables(
    elements: Sequence[PathElements],
    separations_m: Floats,
    anywhere: Sequence[int],
    walls: Floats | None,
    tolerance_m: float,
) -> PairTables:
    """Tables of all pairs of members.

    Args:
        elements: of each path.
        separations_m: (k, k) float: how far apart two members have to be; 0 where they cannot collide.
        anywhere: the members that may be anywhere on their paths at any time: each is one element.
        walls: (w, 2, 2) float, metres: of the map; None where sight is not asked for, and nobody sees anybody.
        tolerance_m: what is nearer than that touches.

    Complexity: O(k² n²) to fill in, and a few tests for each piece along the borders within the tables.
    """
    k = len(elements)
    sizes = np.array([2 * path.pieces + 1 for path in elements], dtype=np.int64)
    bits = []
    starts = np.zeros((k, k), dtype=np.int64)
    tables = {}
    for i in range(k):
        for j in range(i):
            p, q = elements[i], elements[j]
            table = np.zeros((sizes[i], sizes[j]), dtype=np.uint8)
            if separations_m[i, j] > 0.0:
                mark_clearance(
                    p.nodes, p.corners, q.nodes, q.corners, float(separations_m[i, j]) - tolerance_m, table, APART
                )
            else:
                table |= APART
            if walls is not None:
                mark_sight(p.nodes, p.corners, q.nodes, q.corners, walls, tolerance_m, table, SEES)
            for axis, member in enumerate((i, j)):
                if member in anywhere:
                    table = np.bitwise_and.reduce(table, axis=axis, keepdims=True)
            tables[i, j], tables[j, i] = table, table.T
    sizes[list(anywhere)] = 1
    total = 0
    for i in range(k):
        for j in range(k):
            starts[i, j] = total
            if i != j:
                bits.append(tables[i, j].ravel())
                total += bits[-1].size
    return PairTables(sizes, starts, np.concatenate(bits) if bits else np.zeros(0, np.uint8))
