"""How robots get to placements, by the kind of movement that is asked for: what it costs, and along which line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.adjacency_path import AdjacencyPaths
from planning.physical_weights import adjacency_path_weights, euclidean_weights, geodesic_weights

if TYPE_CHECKING:
    from planning.decomposition import Cells
    from planning.placement_graph import PlacementGraph
    from protocol.messages import Point

Line: TypeAlias = tuple["Point", ...]


class Ways:
    """Ways of robots to the placements of a graph.

    Args:
        robots: where they are, metres.
        graph: the placements.
        movement: round walls, straight through them, or by adjacent cells.
        cells: which the placements stand for; ``adjacency`` needs them.
        jump_penalty_m: of ``adjacency``, metres.
    """

    def __init__(
        self,
        robots: Sequence[Point],
        graph: PlacementGraph,
        movement: Literal["geodesic", "euclidean", "adjacency"],
        cells: Cells | None = None,
        jump_penalty_m: float = 0.0,
    ) -> None:
        self._robots = robots
        self._graph = graph
        self._movement = movement
        self._adjacency = None
        if movement == "adjacency" and cells is not None:
            self._adjacency = AdjacencyPaths(cells, graph.free, jump_penalty_m)

    def lengths(self) -> NDArray[np.float64]:
        """(k, N) float, metres: how far each robot has to go to each placement; inf where it cannot go.

        By adjacent cells that is the way from the stop of its cell, wherever in it the robot is (thesis §3.4.1).
        """
        if self._adjacency is not None:
            return adjacency_path_weights(self._adjacency, self._robots)[:, self._graph.cells]
        if self._movement == "euclidean":
            return euclidean_weights(self._robots, self._graph.positions)
        return geodesic_weights(self._graph.geodesics, self._robots, self._graph.positions)

    def line(self, robot: int, placement: int) -> Line:
        """The way of a robot to a placement that it can reach, both ends included."""
        start, end = self._robots[robot], self._graph.positions[placement]
        if self._adjacency is not None:
            before = int(self._adjacency.cells.locate([start])[0])
            path = self._adjacency.path(before, int(self._graph.cells[placement]))
            to_stop = self._graph.geodesics.path(start, path.points[0])
            return _line(np.concatenate([to_stop, path.points[1:]]))
        if self._movement == "euclidean":
            return _line([start, end])
        return _line(self._graph.geodesics.path(start, end))


def _line(points: ArrayLike) -> Line:
    return tuple((float(x), float(y)) for x, y in np.asarray(points))
