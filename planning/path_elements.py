"""Paths cut into elements: nodes, where a member can wait, and the straight pieces between them.

Element 2 a of a path is node a, element 2 a + 1 the piece from node a to node a + 1, both ends included. A path of n
pieces has 2 n + 1 elements; a member that stands has one, its node.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class PathElements:
    """The nodes of one path.

    Attributes:
        nodes: (n + 1, 2) float, metres, map frame.
        corners: (l + 1,) int: the nodes at which the path's l straight legs begin, and the last one ends.
    """

    nodes: Floats
    corners: Ints

    @property
    def pieces(self) -> int:
        """Their number n."""
        return len(self.nodes) - 1


def cut_path(path: Floats, longest_m: float, halvings: int = 0) -> PathElements:
    """Cut a path at its corners, and each leg into equal pieces.

    Args:
        path: (m, 2) float, metres, map frame, m ≥ 1; points that repeat their predecessor are left out.
        longest_m: no piece is longer, metres.
        halvings: how often all these pieces are halved after that; so what is possible with fewer halvings is possible
            with more.
    """
    steps = np.hypot(*np.diff(path, axis=0).T)
    path = path[np.append(True, steps > 0.0)]
    counts = np.ceil(steps[steps > 0.0] / longest_m).astype(np.int64) << halvings
    corners = np.append(0, np.cumsum(counts))
    # Node a lies on the path at coordinate a of a piecewise linear chart; corners are met exactly.
    at = np.arange(corners[-1] + 1)
    nodes = np.stack([np.interp(at, corners, path[:, axis]) for axis in (0, 1)], axis=1)
    return PathElements(nodes, corners)


@kernel
def divide_block(a: int, b: int, c: int, d: int, count: int, waiting: Ints, top: int) -> int:
    """Write the halves of a block onto a stack, of a pair of elements their ends; its new top.

    The block holds what lies from node a to node b of one path and from c to d of another. ``waiting`` (n, 5): these
    four, and ``count``, which is handed on.
    """
    first, second = (a, b, c, d), (a, b, c, d)
    if b - a > 1 and b - a >= d - c:
        middle = (a + b) // 2
        first, second = (a, middle, c, d), (middle, b, c, d)
    elif d - c > 1:
        middle = (c + d) // 2
        first, second = (a, b, c, middle), (a, b, middle, d)
    elif b > a:
        first, second = (a, a, c, d), (b, b, c, d)
    elif d > c:
        first, second = (a, b, c, c), (a, b, d, d)
    else:
        return top
    for block in (first, second):
        waiting[top, 0], waiting[top, 1], waiting[top, 2], waiting[top, 3] = block
        waiting[top, 4] = count
        top += 1
    if b - a == 1 and d - c == 1:
        for node in (c, d):
            waiting[top, 0], waiting[top, 1], waiting[top, 2], waiting[top, 3] = a, b, node, node
            waiting[top, 4] = count
            top += 1
    return top
