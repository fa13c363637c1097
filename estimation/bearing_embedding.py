"""Bearings made linear: from a known heading, a wedge is two half-planes (thesis §2.3, bearing-only sensors).

A bearing β with error in [−ε, ε], ε < 90°, says that the target x lies in the wedge at the sensor a between the rays of
angle β − ε and β + ε. With r = (cos(β − ε), sin(β − ε)) and l the same for β + ε these are two conditions,

    r × (x − a) ≥ 0  and  (x − a) × l ≥ 0,

linear in x: the state needs no coordinates beside the positions. With a sensor whose own position is unknown they are
linear in the difference of both. Written as one equation, z* = H x + w, the noise w grows with the distance, which is
why no *strip* bounds a wedge until the distance is bounded: half-planes cut sets that are bounded already, and
:meth:`BearingEmbedding.strips_within` starts one from a greatest distance.

Angles are in the map frame, counter-clockwise from its x-axis: add the sensor's heading first, and the bound of the
heading to ε.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.range_embedding import NotAMeasurement
from estimation.strip import Strip

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class BearingEmbedding:
    """The strips and half-spaces that bearings between nodes in the plane are.

    Attributes:
        nodes: n, how many nodes have unknown positions; they are the first 2n coordinates of the state.
        size: dimension of the state, 2n if not given; that of a :class:`~estimation.range_embedding.RangeEmbedding`
            lets ranges and bearings cut the same set.
    """

    nodes: int = 1
    size: int | None = None

    def __post_init__(self) -> None:
        if self.nodes < 1:
            raise NotAMeasurement(f"an embedding needs at least one node, not {self.nodes}")
        if self.size is None:
            object.__setattr__(self, "size", 2 * self.nodes)
        elif self.size < 2 * self.nodes:
            raise NotAMeasurement(f"the positions of {self.nodes} nodes do not fit into {self.size} numbers")

    def wedge_from_sensor(
        self, node: int, sensor: ArrayLike, bearing_rad: float, bound_rad: float
    ) -> tuple[Strip, Strip]:
        """A node seen from a known position: the two half-spaces whose intersection is the wedge, exactly.

        Args:
            node: which node is seen.
            sensor: (2,) float, metres, map frame.
            bearing_rad: direction from the sensor to the node, radians, map frame.
            bound_rad: ε, 0 ≤ ε < π/2.

        Raises:
            NotAMeasurement: no such node, or ε outside [0, π/2).
        """
        a = _point(sensor)
        right, left = self._edges(bearing_rad, bound_rad)
        # The sensor's coordinates go to the other side of the inequality.
        return (
            Strip(self._at(node, right), float(right @ a), math.inf),
            Strip(self._at(node, left), float(left @ a), math.inf),
        )

    def wedge_between(self, i: int, j: int, bearing_rad: float, bound_rad: float) -> tuple[Strip, Strip]:
        """Node j seen from node i, both at unknown positions, in a known direction: two half-spaces.

        Raises:
            NotAMeasurement: no such nodes, the same node twice, or ε outside [0, π/2).
        """
        if i == j:
            raise NotAMeasurement(f"node {i} cannot see itself: give two nodes")
        right, left = self._edges(bearing_rad, bound_rad)
        return (
            Strip(self._at(j, right) - self._at(i, right), 0.0, math.inf),
            Strip(self._at(j, left) - self._at(i, left), 0.0, math.inf),
        )

    def strips_within(
        self, node: int, sensor: ArrayLike, bearing_rad: float, bound_rad: float, reach_m: float
    ) -> tuple[Strip, Strip]:
        """Two crossing strips around the part of the wedge within a distance, to start a set from nothing.

        With d the unit vector along the bearing and e across it, a node at distance ρ ≤ reach has |e·(x − a)| ≤ ρ sin ε
        and 0 ≤ d·(x − a) ≤ ρ. See :meth:`wedge_from_sensor` for the arguments.

        Args:
            node: which node is seen.
            sensor: (2,) float, metres, map frame.
            bearing_rad: radians, map frame.
            bound_rad: ε, radians.
            reach_m: greatest distance of the node, > 0 and finite.

        Returns:
            The strip along and the strip across the bearing.
        """
        if not 0 < reach_m < math.inf:
            raise NotAMeasurement(f"the greatest distance must be above 0 and finite, not {reach_m} m")
        a = _point(sensor)
        self._edges(bearing_rad, bound_rad)
        along = np.array([math.cos(bearing_rad), math.sin(bearing_rad)])
        across = np.array([-along[1], along[0]])
        half = reach_m * math.sin(bound_rad)
        return (
            Strip(self._at(node, along), float(along @ a), float(along @ a) + reach_m),
            Strip(self._at(node, across), float(across @ a) - half, float(across @ a) + half),
        )

    def _edges(self, bearing_rad: float, bound_rad: float) -> tuple[Floats, Floats]:
        """Unit normals, into the wedge, of its right and its left edge."""
        if not (math.isfinite(bearing_rad) and 0 <= bound_rad < 0.5 * math.pi):
            raise NotAMeasurement(
                f"a bearing of {bearing_rad} ± {bound_rad} rad is no wedge: the bound must be at least 0 and below π/2"
            )
        right, left = bearing_rad - bound_rad, bearing_rad + bound_rad
        return np.array([-math.sin(right), math.cos(right)]), np.array([math.sin(left), -math.cos(left)])

    def _at(self, node: int, direction: Floats) -> Floats:
        if not 0 <= node < self.nodes:
            raise NotAMeasurement(f"there is no node {node}: the {self.nodes} nodes are counted from 0")
        assert self.size is not None
        state = np.zeros(self.size)
        state[2 * node : 2 * node + 2] = direction
        return state


def _point(position: ArrayLike) -> Floats:
    point = np.asarray(position, dtype=np.float64)
    if point.shape != (2,) or not np.isfinite(point).all():
        raise NotAMeasurement(f"a sensor's position is two finite numbers, not {position!r}")
    return point
