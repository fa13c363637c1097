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
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.deployment import NO_CHAIN
from planning.edge_weights import virtual_weights
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from planning.geodesic_table import GeodesicTable
from planning.placement import reachable_positions
from planning.placement_points import choose_points, choose_spacing
from planning.placement_sight import CellSight, PointSight, Sight
from planning.relays import count_links
from planning.tree import InvalidWeights, checked_weights

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from planning.decomposition import Cells

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


class NoPlacement(ValueError):
    """A robot of this radius can stand in none of the cells."""


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
        sight: how placements see points that are none of them.
        known_table: geodesics to the placements, if they are known already.
    """

    kind: Literal["cells", "points"]
    environment: Environment
    radius_m: float
    free: Environment
    positions: Floats
    visible: Bools
    weights: Floats
    cells: Ints
    sight: Sight
    known_table: GeodesicTable | None = None

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
        weights: ArrayLike | None = None,
        containing: ArrayLike | None = None,
    ) -> PlacementGraph:
        """A placement for each cell that a robot can stand in.

        Args:
            cells: of ``environment``.
            seen: their mutual visibility, (number of cells)² bool.
            environment: the map as drawn.
            radius_m: of the robots, metres.
            weights: of the links between all cells, as :func:`~planning.edge_weights.virtual_weights` makes them. None:
                the normalised ones.
            containing: (2,) metres: robots are in the part of the free space at this point. None: in the largest.

        Raises:
            NothingLeft: there is no room for such a robot.
            NoPlacement: there is, but no cell reaches into it.
            InvalidWeights: the weights are no symmetric matrix, or one for another number of cells.

        Complexity: O(N²) besides the inflation.
        """
        free = environment.inflated(radius_m, containing=containing)
        positions = reachable_positions(cells, free)
        kept = np.flatnonzero(~np.isnan(positions[:, 0]))
        if len(kept) == 0:
            raise NoPlacement(f"a robot of radius {radius_m:g} m can stand in no cell of the map {environment.name!r}")
        between = virtual_weights(cells, seen) if weights is None else _checked_between(weights, len(cells))
        among = np.ascontiguousarray(between[np.ix_(kept, kept)])
        return cls(
            "cells", environment, radius_m, free, positions[kept], np.isfinite(among), among, kept,
            CellSight(cells, between, kept),
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
        sight = PointSight(environment, free, points, float(distances[visible].max()) or 1.0)
        weights = np.where(visible, sight.weigh(distances), np.inf)
        np.fill_diagonal(weights, 0.0)
        return cls("points", environment, radius_m, free, points, visible, weights, np.full(len(points), -1), sight)

    @property
    def outlines(self) -> tuple[Floats, ...]:
        """The cells of the map, those without a placement included, each (m, 2) float, metres; none for points."""
        return self.sight.outlines

    @cached_property
    def geodesics(self) -> GeodesicMap:
        """Shortest paths of the robots' centres."""
        return GeodesicMap(self.free) if self.known_table is None else self.known_table.geodesics

    @cached_property
    def _table(self) -> GeodesicTable:
        return self.known_table or GeodesicTable(self.geodesics, self.positions)

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

    def link_weights(self, point: ArrayLike) -> Floats:
        """Weights of the links between a point (2,), metres, and each placement: (N,) float, inf where there is none.

        For cells that is a question of the point's cell, which all of the placement's cell must see; a point in the
        placement's own cell is joined for 0. O(1) for cells, O(N w) for points.
        """
        return self.sight.weights(np.array(point, dtype=np.float64).reshape(2))

    def sees(self, point: ArrayLike) -> Bools:
        """Which placements see a point (2,), metres: (N,) bool. As :meth:`link_weights`."""
        return np.isfinite(self.link_weights(point))

    def sees_all(self, points: ArrayLike) -> Bools:
        """Which placements see every one of ``points`` (m, 2), metres: (N,) bool. As :meth:`link_weights`."""
        return self.sight.sees_all(np.array(points, dtype=np.float64, order="C").reshape(-1, 2))

    def direct_weights(self, p: ArrayLike, points: ArrayLike) -> Floats:
        """Weights of the links between p (2,) and points (m, 2), metres, without a relay: (m,) float, inf for none."""
        return self.sight.direct(
            np.array(p, dtype=np.float64).reshape(2), np.array(points, dtype=np.float64, order="C").reshape(-1, 2)
        )

    def relays_from(self, point: ArrayLike) -> Ints:
        """Fewest relays of a chain from a point (2,), metres, whose last relay stands at each placement: (N,) int.

        1 where the point is seen; :data:`NO_CHAIN` where no chain leads. O(N²), breadth first.
        """
        links = count_links(self.visible, self.sees(point))
        return np.where(links < 0, NO_CHAIN, links + 1)

    @property
    def probes(self) -> Floats:
        """Places to ask for all where an agent can be: (m, 2) float, metres.

        Cells: the centroid of each, which is as good as all its points. Points: the placements and the vertices of
        ``free``, among which are the corners of rooms that are hardest to see into.
        """
        return self.sight.probes


def _checked_between(weights: ArrayLike, number: int) -> Floats:
    """Weights of the links between cells, 0 on the diagonal."""
    between = checked_weights(weights).copy()
    if len(between) != number:
        raise InvalidWeights(
            f"weights are for {len(between)} cells, but the map has {number}: give one row for each cell"
        )
    np.fill_diagonal(between, 0.0)
    return between
