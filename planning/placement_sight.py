"""Which placements see a point that is none of them, and what the link to it weighs: by cells, or by lines of sight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from planning.edge_weights import NORMALISED_PENALTY
from planning.environment import Environment
from planning.kernel import kernel
from planning.line_of_sight import free_points_see, point_is_free

if TYPE_CHECKING:
    from planning.decomposition import Cells

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


class Sight(Protocol):
    """How a kind of placements sees."""

    def weights(self, point: Floats) -> Floats:
        """Weights of the links between a point (2,) and placements: (N,), inf where there is none."""

    def sees_all(self, points: Floats) -> Bools:
        """Which placements see all of these points (m, 2): (N,)."""

    def direct(self, p: Floats, points: Floats) -> Floats:
        """Weights of the links between p (2,) and points (m, 2): (m,), inf where there is none."""

    @property
    def probes(self) -> Floats:
        """Places that stand for all others: (m, 2)."""

    @property
    def outlines(self) -> tuple[Floats, ...]:
        """Polygons that tile the map."""


@dataclass(frozen=True, eq=False)
class CellSight:
    """Mutual visibility of the cells that points lie in."""

    cells: Cells
    all_weights: Floats
    """Between all cells, those without a placement included: an agent may be there."""
    kept: Ints
    """(N,) int: the cells of the placements."""

    def weights(self, point: Floats) -> Floats:
        """Those of the point's cell. O(N)."""
        cell = int(self.cells.locate(point)[0])
        return self.all_weights[cell, self.kept] if cell >= 0 else np.full(len(self.kept), np.inf)

    def sees_all(self, points: Floats) -> Bools:
        """Which placements' cells see all of the points' cells. O(m N)."""
        located = np.unique(self.cells.locate(points))
        if np.any(located < 0):
            return np.zeros(len(self.kept), dtype=np.bool_)
        return np.asarray(np.isfinite(self.all_weights[np.ix_(located, self.kept)]).all(axis=0))

    def direct(self, p: Floats, points: Floats) -> Floats:
        """Between the points' cells. O(m)."""
        here, there = int(self.cells.locate(p)[0]), self.cells.locate(points)
        return np.where((there >= 0) & (here >= 0), self.all_weights[here, there], np.inf)

    @property
    def probes(self) -> Floats:
        """The centroid of each cell, which is as good as all its points."""
        return self.cells.centroids

    @property
    def outlines(self) -> tuple[Floats, ...]:
        """All cells."""
        return self.cells.polygons


@dataclass(frozen=True, eq=False)
class PointSight:
    """Lines of sight through the map as drawn."""

    environment: Environment
    free: Environment
    positions: Floats
    """(N, 2) float, metres: of the placements, all in ``free``."""
    greatest_m: float
    """Length of the longest link between placements."""

    def weigh(self, distances: Floats) -> Floats:
        """The weight of a link of such a length; farther than any placements from one another counts as far."""
        return NORMALISED_PENALTY + 0.5 * np.minimum(distances / self.greatest_m, 1.0)

    def weights(self, point: Floats) -> Floats:
        """Of what is in line of sight. O(N w)."""
        return np.where(self.sees_all(point[None]), self.weigh(np.hypot(*(self.positions - point).T)), np.inf)

    def sees_all(self, points: Floats) -> Bools:
        """By lines of sight. O(m N w), less where few placements see the first points."""
        seen: Bools = _see_all(self.positions, points, self.environment.walls, self.environment.tolerance_m)
        return seen

    def direct(self, p: Floats, points: Floats) -> Floats:
        """By lines of sight. O(m w)."""
        seen = np.asarray(self.environment.line_of_sight(p[None], points))
        return np.where(seen, self.weigh(np.hypot(*(points - p).T)), np.inf)

    @property
    def probes(self) -> Floats:
        """The placements and the vertices of ``free``."""
        return np.concatenate([self.positions, self.free.vertices])

    @property
    def outlines(self) -> tuple[Floats, ...]:
        """None."""
        return ()


@kernel
def _see_all(positions: Floats, points: Floats, walls: Floats, tolerance: float) -> Bools:
    """Which of the positions, known to be free, see all of the points."""
    seen = np.ones(len(positions), np.bool_)
    for p in range(len(points)):
        x, y = points[p, 0], points[p, 1]
        free = point_is_free(x, y, walls, tolerance)
        for v in range(len(positions)):
            if seen[v]:
                seen[v] = free and free_points_see(positions[v, 0], positions[v, 1], x, y, walls, tolerance)
    return seen
