"""The feasible set: where the target can be on the map, ellipsoid ∩ paraboloid exactly (Thesis §2.2.3, eq. 10).

Its boundary is a quartic curve; the set is one region, two regions (the mirror images that ranges from one line leave)
or an annulus (after one range). The thesis' approximations are here too: base projection, which contains the set, and
tangent slice, which need not; and its metrics, determinant and trace of E.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation import range_cut
from estimation.ellipsoid import Ellipsoid, EmptyIntersection
from estimation.feasible_boundary import NormalForm, Panel, extents, first_lines, moments, sweep, trace

Floats = NDArray[np.float64]

MOST_NODES = 1024
"""Lines in a panel, at most; only annuli thousands of times wider than thick want more."""


class EmptyFeasibleSet(ValueError):
    """A question about the points of a set that has none."""


@dataclass(frozen=True, eq=False)
class Region:
    """A piece of the plane.

    Attributes:
        outer: (n, 2) float, counter-clockwise, metres, map frame, open ring.
        holes: tuple of (m, 2) float, clockwise.
    """

    outer: Floats
    holes: tuple[Floats, ...] = ()


class FeasibleSet:
    """All (x, y) with (x, y, x² + y²) in {c + L v : |v| ≤ 1}, in a frame with its origin at o on the map.

    Everything is worked out when it is first asked for.

    Args:
        origin: (2,) float, o, metres, map frame. Near the set, else the numbers lose their digits.
        center: (3,) float, c, metres and square metres relative to o.
        factor: (3, 3) float, L, regular.

    Raises:
        ValueError: the factor is singular or not finite: such an ellipsoid has no bounded feasible set with an inside.
    """

    def __init__(self, origin: ArrayLike, center: ArrayLike, factor: ArrayLike) -> None:
        state = np.concatenate([np.ravel(np.asarray(part, dtype=np.float64)) for part in (origin, center, factor)])
        if len(state) != range_cut.STATE or not np.isfinite(state).all() or range_cut.volume(state) == 0.0:
            raise ValueError(
                "a feasible set needs an origin (2,), a centre (3,) and a regular factor (3, 3), all finite"
            )
        range_cut.recentre(state)
        self._origin, self._center, self._factor = state[:2], state[2:5], state[5:].reshape(3, 3)
        e, V = range_cut.spectrum(self._factor)
        c, L = self._center, self._factor
        g = V.T @ (L[:2].T @ c[:2] - 0.5 * L[2])
        self._form = NormalForm(
            float(c[0] ** 2 + c[1] ** 2 - c[2]) / (-2.0 * g[2]), g[:2] / -g[2], e[:2] / (-2.0 * g[2])
        )
        self._to_map = (L @ V)[:2, :2]

    @cached_property
    def _panels(self) -> list[Panel]:
        nodes, lines = 32, first_lines(self._form)
        while True:
            panels, lines = sweep(self._form, nodes, lines)
            if not panels or nodes >= MOST_NODES:
                return panels
            wanted, gap = self._accuracy(panels)
            if gap <= wanted:
                return panels
            steps = 2 ** math.ceil(0.5 * math.log2(gap / wanted))
            nodes = min(MOST_NODES, nodes * max(2, steps))

    def _accuracy(self, panels: list[Panel]) -> tuple[float, float]:
        """How near the polygons are to come to the true boundary, and how near they do, metres."""
        area = sum(moments(*panel)[0] for panel in panels) * abs(np.linalg.det(self._to_map))
        measured = [extents(*panel, self._to_map) for panel in panels]
        length = sum(length for length, _ in measured)
        # Halving the steps divides the distance between curve and chord by four.
        gap = max(gap for _, gap in measured) / 4.0
        return min(2e-3 * math.sqrt(area), 4e-2 * area / length), gap

    @cached_property
    def tolerance_m(self) -> float:
        """How far the polygons of `regions` stay from the true boundary, at most, metres (estimated).

        At most 0.2 % of the square root of the area and 2 % of the mean width. Their vertices are on the boundary.
        """
        return self._accuracy(self._panels)[1] if self._panels else 0.0

    @cached_property
    def _moments(self) -> tuple[float, Floats, Floats]:
        total = np.sum([moments(*panel) for panel in self._panels], axis=0) if self._panels else np.zeros(6)
        if total[0] <= 0.0:
            return 0.0, np.full(2, np.nan), np.full((2, 2), np.nan)
        area, mean, second = total[0], total[1:3] / total[0], total[[[3, 4], [4, 5]]] / total[0]
        covariance = self._to_map @ (second - np.outer(mean, mean)) @ self._to_map.T
        centroid = self._origin + self._center[:2] + self._to_map @ mean
        return float(area) * abs(float(np.linalg.det(self._to_map))), centroid, covariance

    @property
    def is_empty(self) -> bool:
        """Whether the ellipsoid misses the paraboloid."""
        return not self._panels

    @property
    def area_m2(self) -> float:
        """Area, m²; 0 if empty. Integrated, not taken from the polygons."""
        return self._moments[0]

    @property
    def centroid(self) -> Floats:
        """(2,) float, metres, map frame; of two regions it lies between them. Raises EmptyFeasibleSet."""
        self._refuse_if_empty()
        return self._moments[1]

    @property
    def covariance(self) -> Floats:
        """(2, 2) float, m², of a point spread evenly over the set. Raises EmptyFeasibleSet."""
        self._refuse_if_empty()
        return self._moments[2]

    @cached_property
    def regions(self) -> tuple[Region, ...]:
        """Boundary polygons, the largest region first; see `tolerance_m`."""
        base = self._origin + self._center[:2]
        turned = np.linalg.det(self._to_map) < 0.0
        outers: list[tuple[float, Floats]] = []
        holes: list[tuple[float, Floats]] = []
        for loop in trace(self._panels):
            offsets = loop @ self._to_map.T
            points = offsets[::-1] if turned else offsets
            area = _signed_area(points)
            (outers if area > 0.0 else holes).append((area, base + points))
        outers.sort(key=lambda pair: -pair[0])
        # A hole of any size only occurs in an annulus, which is the only region there is.
        return tuple(
            Region(ring, tuple(hole for _, hole in holes) if i == 0 else ()) for i, (_, ring) in enumerate(outers)
        )

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Which points are in the set, exactly.

        Args:
            points: (..., 2) float, metres, map frame.

        Returns:
            (...) bool.
        """
        offsets = np.asarray(points, dtype=np.float64) - self._origin
        lifted = np.concatenate([offsets, (offsets**2).sum(axis=-1, keepdims=True)], axis=-1)
        v = np.linalg.solve(self._factor, np.moveaxis(lifted - self._center, -1, 0).reshape(3, -1))
        inside: NDArray[np.bool_] = (v**2).sum(axis=0).reshape(offsets.shape[:-1]) <= 1.0
        return inside

    def farthest_point(self, start: ArrayLike) -> Floats:
        """(2,) float, the vertex of the boundary farthest from a point (2,), metres, map frame.

        Raises EmptyFeasibleSet. Points of the set are at most `tolerance_m` farther away.
        """
        self._refuse_if_empty()
        ring = np.concatenate([region.outer for region in self.regions])
        point: Floats = ring[np.argmax(np.hypot(*(ring - np.asarray(start, dtype=np.float64)).T))]
        return point

    def base_projection(self) -> Ellipsoid:
        """The ellipsoid's shadow on the plane, an outer bound (Thesis §2.2.3, fig. 8); metres, map frame."""
        return Ellipsoid.from_factor(self._origin + self._center[:2], self._factor[:2])

    def tangent_slice(self) -> Ellipsoid | EmptyIntersection:
        """The slice by the plane that touches the paraboloid above or below the centre (Thesis §2.2.3, fig. 9).

        In (x, y), metres, map frame. It is no bound. Empty where that plane misses the ellipsoid. The thesis takes the
        point of the paraboloid that is closest to the centre (corrected): which one that is depends on the unit and the
        frame, as x and y are metres and s is square metres. The one above or below depends on neither.
        """
        x, y = self._center[:2]
        raised = np.array([[1.0, 0.0], [0.0, 1.0], [2.0 * x, 2.0 * y]])
        inverse = np.linalg.inv(self._factor)
        height = self._center[2] - x * x - y * y
        flat = Ellipsoid.from_least_squares(inverse @ raised, inverse @ np.array([0.0, 0.0, height]))
        if isinstance(flat, EmptyIntersection):
            return flat
        return Ellipsoid(flat.center + self._origin + self._center[:2], flat.axes.copy(), flat.semi_axes.copy())

    @property
    def determinant(self) -> float:
        """Det E, m⁻⁸: the inverse square of the volume, up to a constant (Thesis §2.2.3: "the inverse"; corrected)."""
        return float((4.0 / 3.0 * np.pi / range_cut.volume(np.concatenate([np.zeros(5), self._factor.ravel()]))) ** 2)

    @property
    def trace(self) -> float:
        """Tr E, the sum of the inverse squares of the semi-axes, in the frame at the set (it depends on the frame)."""
        return float((np.linalg.inv(self._factor) ** 2).sum())

    def _refuse_if_empty(self) -> None:
        if self.is_empty:
            raise EmptyFeasibleSet("the ellipsoid and the paraboloid have no point in common: nothing is feasible")


def _signed_area(ring: Floats) -> float:
    x, y = ring.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
