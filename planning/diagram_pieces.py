"""What is true of the pieces of paths that the limits of a coordination diagram make, beyond boxes and cells.

A box is larger than the region in it. Of two robots that follow each other along a corridor it is all of the corridor,
so that none may enter; and two that start side by side may start in a box. So what lies in a box is judged once more,
piece by piece: forbidden is only where the robots can truly collide.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planning.coordination_diagram import OVERLAP, CoordinationDiagram, Pair, measure_path
from planning.environment import Environment
from planning.pair_clearance import mark_clearance
from planning.pair_sight import mark_sight

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Bytes = NDArray[np.uint8]


class DiagramPieces:
    """The pieces of all paths of a diagram, straight as all bends are limits.

    Args:
        diagram: of collisions, with every bend of every path among its limits.
    """

    def __init__(self, diagram: CoordinationDiagram) -> None:
        self._diagram = diagram
        self._nodes: list[Floats] = []
        self._corners: list[Ints] = []
        for robot, limits in enumerate(diagram.limits_m):
            bends = measure_path(diagram.paths[robot])
            # A robot that may be anywhere is on all pieces at once; it has but one limit.
            nodes = limits if len(limits) > 1 or bends[-1] == 0.0 else bends
            self._nodes.append(diagram.places(robot, nodes))
            self._corners.append(np.unique(np.searchsorted(0.5 * (nodes[1:] + nodes[:-1]), bends)))

    def find_collisions(self, radii_m: Floats) -> dict[Pair, Bools]:
        """On which elements each pair can truly collide: within boxes only, of the form of the diagram's ``collides``.

        Args:
            radii_m: (k,) float, those of the diagram.
        """
        found = dict(self._diagram.collides)
        for (i, j), boxed in self._diagram.collides.items():
            if boxed.any():
                table = self._make_table(i, j)
                apart = float(radii_m[i] + radii_m[j]) * (1.0 - OVERLAP)
                mark_clearance(self._nodes[i], self._corners[i], self._nodes[j], self._corners[j], apart, table, 1)
                found[i, j] = boxed & ~self._reduce(i, j, table)
        return found

    def find_sight(self, pair: Pair, environment: Environment) -> Bools:
        """Which elements of two robots i < j see each other throughout: (2 n_i − 1, 2 n_j − 1)."""
        i, j = pair
        table = self._make_table(i, j)
        mark_sight(
            self._nodes[i], self._corners[i], self._nodes[j], self._corners[j],
            environment.walls, environment.tolerance_m, table, 1,
        )  # fmt: skip
        return self._reduce(i, j, table)

    def _make_table(self, i: int, j: int) -> Bytes:
        return np.zeros((2 * len(self._nodes[i]) - 1, 2 * len(self._nodes[j]) - 1), dtype=np.uint8)

    def _reduce(self, i: int, j: int, table: Bytes) -> Bools:
        """Of robots with one limit what is true of all their elements."""
        for axis, robot in enumerate((i, j)):
            if len(self._diagram.limits_m[robot]) == 1:
                table = np.minimum.reduce(table, axis=axis, keepdims=True)
        return table.astype(np.bool_)
