"""Where robots can be sent, who sees whom from there, and how far it is: what every deployment is planned on.

Two kinds. *Cells* (thesis §3.2): a placement stands for a convex cell, and two placements see each other if their cells
are mutually visible, wholly and from every point. *Points*: corners and a grid, and two placements see each other if
the straight line between them is free. Mutual visibility of cells promises more than a chain needs, and pays for it
with robots: between the worst two places of the thesis' room3 a chain takes 7 relays over cells and 4 over points.

Weights of the links. Cells: the normalised virtual weights, ½ (a / max a + b / max b) + 1.01 (eq. 25–26). Points:

    W(u, v) = ½ |u − v| / max |u − v| + 1.01

the same without the area cost b, for a point has no area; the maximum is taken over the pairs that see each other. So a
link costs between 1.01 and 1.51, and one link less is worth more than two shorter ones, as with cells (eq. 24).

The ends of a chain, base station and agent, need not stand at placements: :meth:`PlacementGraph.link_weights` joins any
point to the placements that see it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.deployment import NO_CHAIN
from planning.edge_weights import NORMALISED_PENALTY, virtual_weights
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from planning.geodesic_table import GeodesicTable
from planning.placement import reachable_positions
from planning.placement_points import choose_points, choose_spacing

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from planning.decomposition import Cells

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


class NoPlacement(ValueError):
    """A robot of this radius can stand in none of the cells."""


class Sight(Protocol):
    """How a kind of placements judges lines of sight from any point."""

    def weights(self, points: Floats) -> Floats:
        """Weights of the links between points (m, 2) and placements: (m, N), inf where there is none."""

    def direct(self, p: Floats, points: Floats) -> Floats:
        """Weights of the links between p (2,) and points (m, 2): (m,), inf where there is none."""

    @property
    def probes(self) -> Floats:
        """Places that stand for all others: (m, 2)."""

    @property
    def outlines(self) -> tuple[Floats, ...]:
        """Polygons that tile the map."""


@dataclass(frozen=True, eq=False, repr=False)
class PlacementGraph:
    """N placements of robots of one radius on one map.

    Attributes:
        kind: ``"cells"`` or ``"points"``.
        environment: the map as drawn; robots see through it.
        radius_m: of the robots, metres.
        free: the map inflated by that radius: where a robot's centre can be. One component.
        positions: (N, 2) float, metres, map frame, all in ``free``.
        visible: (N, N) bool, symmetric, True on the diagonal.
        weights: (N, N) float, symmetric, without unit: of the links (see the module), inf where two placements do not
            see each other, 0 on the diagonal.
        cells: (N,) int: the cell that each placement stands for; -1 where they are points.
    """

    kind: Literal["cells", "points"]
    environment: Environment
    radius_m: float
    free: Environment
    positions: Floats
    visible: Bools
    weights: Floats
    cells: Ints
    _sight: Sight

    def __len__(self) -> int:
        return len(self.positions)

    def __repr__(self) -> str:
        return f"PlacementGraph({self.environment.name!r}, {len(self)} {self.kind})"

    @classmethod
    def from_cells(
        cls,
        cells: Cells,
        seen: csr_array,
        environment: Environment,
        radius_m: float,
        *,
        containing: ArrayLike | None = None,
    ) -> PlacementGraph:
        """A placement for each cell that a robot can stand in.

        Args:
            cells: of ``environment``.
            seen: their mutual visibility, (number of cells)² bool.
            environment: the map as drawn.
            radius_m: of the robots, metres.
            containing: (2,) metres: robots are in the part of the free space at this point. None: in the largest.

        Raises:
            NothingLeft: there is no room for such a robot.
            NoPlacement: there is, but no cell reaches into it.

        Complexity: O(N²) besides the inflation.
        """
        free = environment.inflated(radius_m, containing=containing)
        positions = reachable_positions(cells, free)
        kept = np.flatnonzero(~np.isnan(positions[:, 0]))
        if len(kept) == 0:
            raise NoPlacement(f"a robot of radius {radius_m:g} m can stand in no cell of the map {environment.name!r}")
        weights = virtual_weights(cells, seen)
        among = np.ascontiguousarray(weights[np.ix_(kept, kept)])
        return cls(
            "cells", environment, radius_m, free, positions[kept], np.isfinite(among), among, kept,
            _CellSight(cells, weights, kept),
        )  # fmt: skip

    @classmethod
    def from_points(
        cls,
        environment: Environment,
        radius_m: float,
        spacing_m: float | None = None,
        *,
        containing: ArrayLike | None = None,
    ) -> PlacementGraph:
        """Placements at the corners of the free space and on a hexagonal grid, with exact visibility.

        Args:
            environment: the map as drawn.
            radius_m: of the robots, metres.
            spacing_m: of the grid, metres. None: such that there are about
                :data:`~planning.placement_points.NUMBER` points.
            containing: as in :meth:`from_cells`.

        Raises:
            NothingLeft: there is no room for such a robot.
            UnfitSpacing: the spacing is not positive and finite, or makes too many points.

        Complexity: O(N² w) for w walls.
        """
        free = environment.inflated(radius_m, containing=containing)
        points, visible = choose_points(
            environment, free, choose_spacing(environment, free) if spacing_m is None else spacing_m
        )
        distances = np.hypot(*(points[:, None] - points).transpose(2, 0, 1))
        # A single placement has no link to measure by.
        sight = _PointSight(environment, free, points, float(distances[visible].max()) or 1.0)
        weights = np.where(visible, sight.weigh(distances), np.inf)
        np.fill_diagonal(weights, 0.0)
        return cls("points", environment, radius_m, free, points, visible, weights, np.full(len(points), -1), sight)

    @property
    def outlines(self) -> tuple[Floats, ...]:
        """The cells of the map, those without a placement included, each (m, 2) float, metres; none for points."""
        return self._sight.outlines

    @cached_property
    def geodesics(self) -> GeodesicMap:
        """Shortest paths of the robots' centres."""
        return GeodesicMap(self.free)

    @cached_property
    def _table(self) -> GeodesicTable:
        return GeodesicTable(self.geodesics, self.positions)

    @property
    def distances(self) -> Floats:
        """(N, N) float, metres: geodesics between placements in ``free``. Computed when first asked for, O(N² w)."""
        return self._table.between

    def distances_from(self, point: ArrayLike) -> Floats:
        """Geodesic lengths from a point (2,), metres, in ``free`` to each placement: (N,) float. O(N w).

        Raises:
            NotInFreeSpace: no robot can stand there.
        """
        return self._table.lengths(point)

    def link_weights(self, points: ArrayLike) -> Floats:
        """Weights of the links between points (m, 2) or one (2,), metres, and placements: (m, N) or (N,) float.

        inf where a placement does not see the point. For cells that is a question of the point's cell, which all of the
        placement's cell must see; a point in the placement's own cell is joined for 0. Points: O(m N w).
        """
        places = np.array(points, dtype=np.float64, order="C")
        weights = self._sight.weights(places.reshape(-1, 2))
        return weights[0] if places.ndim == 1 else weights

    def sees(self, points: ArrayLike) -> Bools:
        """Which placements see points (m, 2) or one (2,), metres: (m, N) or (N,) bool. As :meth:`link_weights`."""
        return np.isfinite(self.link_weights(points))

    def direct_weights(self, p: ArrayLike, points: ArrayLike) -> Floats:
        """Weights of the links between p (2,) and points (m, 2), metres, without a relay: (m,) float, inf for none."""
        return self._sight.direct(
            np.array(p, dtype=np.float64).reshape(2), np.array(points, dtype=np.float64, order="C").reshape(-1, 2)
        )

    def relays_from(self, point: ArrayLike) -> Ints:
        """Fewest relays of a chain from a point (2,), metres, whose last relay stands at each placement: (N,) int.

        1 where the point is seen; :data:`NO_CHAIN` where no chain leads. O(N²), breadth first.
        """
        relays = np.full(len(self), NO_CHAIN)
        frontier = self.sees(point)
        number = 0
        while frontier.any():
            number += 1
            relays[frontier] = number
            frontier = self.visible[frontier].any(axis=0) & (relays == NO_CHAIN)
        return relays

    @property
    def probes(self) -> Floats:
        """Places to ask for all where an agent can be: (m, 2) float, metres.

        Cells: the centroid of each, which is as good as all its points. Points: the placements and the vertices of
        ``free``, among which are the corners of rooms that are hardest to see into.
        """
        return self._sight.probes


@dataclass(frozen=True, eq=False)
class _CellSight:
    """Mutual visibility of the cells that points lie in."""

    cells: Cells
    all_weights: Floats
    """Between all cells, those without a placement included: an agent may be there."""
    kept: Ints

    def weights(self, points: Floats) -> Floats:
        located = self.cells.locate(points)
        weights = np.ascontiguousarray(self.all_weights[np.ix_(located, self.kept)])
        weights[located < 0] = np.inf
        return weights

    def direct(self, p: Floats, points: Floats) -> Floats:
        here, there = int(self.cells.locate(p[None])[0]), self.cells.locate(points)
        return np.where((there >= 0) & (here >= 0), self.all_weights[here, there], np.inf)

    @property
    def probes(self) -> Floats:
        return self.cells.centroids

    @property
    def outlines(self) -> tuple[Floats, ...]:
        return self.cells.polygons


@dataclass(frozen=True, eq=False)
class _PointSight:
    """Lines of sight through the map as drawn."""

    environment: Environment
    free: Environment
    positions: Floats
    greatest_m: float
    """Length of the longest link between placements."""

    def weigh(self, distances: Floats) -> Floats:
        """The weight of a link of such a length; farther than any placements from one another counts as far."""
        return NORMALISED_PENALTY + 0.5 * np.minimum(distances / self.greatest_m, 1.0)

    def weights(self, points: Floats) -> Floats:
        return np.array([self.direct(point, self.positions) for point in points]).reshape(len(points), -1)

    def direct(self, p: Floats, points: Floats) -> Floats:
        seen = np.asarray(self.environment.line_of_sight(p[None], points))
        return np.where(seen, self.weigh(np.hypot(*(points - p).T)), np.inf)

    @property
    def probes(self) -> Floats:
        return np.concatenate([self.positions, self.free.vertices])

    @property
    def outlines(self) -> tuple[Floats, ...]:
        return ()
