"""Ranges made linear: positions together with their dot products (thesis §2.1.1 and §2.3).

The squared distance of two nodes, xᵢ·xᵢ + xⱼ·xⱼ − 2xᵢ·xⱼ, is linear in the dot products, and that to an anchor of
known position a, xᵢ·xᵢ − 2a·xᵢ + a·a, is linear in position and dot product. So a range between bounds is a strip in
the state

    x* = [x₁, …, xₙ,  x₁·x₁, …, xₙ·xₙ,  xᵢ·xⱼ for pairs i < j].

Nothing is lost: a position satisfies the strip exactly if it satisfies the range. What a range of z with an error in
[−ε, ε] says is that the distance lies in [max(0, z − ε), z + ε]; the thesis squares z − ε also where it is negative,
which excludes true ranges (corrected). Bounds need not be symmetric.

Coordinates should be relative to a point near the nodes: the products grow with the square of the distance to the
origin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.strip import Strip

Floats = NDArray[np.float64]


class NotAMeasurement(ValueError):
    """A measurement that cannot be: of a node that is not there, or with bounds that hold nothing."""


def range_bounds(range_m: float, below_m: float, above_m: float) -> tuple[float, float]:
    """Least and greatest distance that a measured range allows, metres.

    Args:
        range_m: the measured range z, metres.
        below_m: ε_low ≥ 0, how much less than z the distance may be.
        above_m: ε_high ≥ 0, how much more.

    Returns:
        max(0, z − ε_low) and z + ε_high.

    Raises:
        NotAMeasurement: a bound is negative, a number is not finite, or no distance remains.
    """
    if not (math.isfinite(range_m) and 0 <= below_m < math.inf and 0 <= above_m < math.inf):
        raise NotAMeasurement(
            f"a range of {range_m} m with bounds {below_m} and {above_m} m is no measurement: "
            "the range must be finite and the bounds at least 0"
        )
    if range_m + above_m < 0:
        raise NotAMeasurement(f"a range of {range_m} m and at most {above_m} m more is negative: leave it out")
    return max(0.0, range_m - below_m), range_m + above_m


@dataclass(frozen=True)
class RangeEmbedding:
    """Layout of the state of n nodes with unknown positions, and the strips that ranges are in it.

    Attributes:
        nodes: n, how many nodes have unknown positions.
        dimension: of the space they live in, 2 or 3.
        pairs: the pairs (i, j), i < j, whose product xᵢ·xⱼ is part of the state; every pair if not given. Give those
            that measure each other: each costs one dimension.
    """

    nodes: int = 1
    dimension: int = 2
    pairs: tuple[tuple[int, int], ...] | None = None
    _pair_index: dict[tuple[int, int], int] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.nodes < 1 or self.dimension < 1:
            raise NotAMeasurement(
                f"an embedding needs at least one node and one dimension, not {self.nodes} and {self.dimension}"
            )
        pairs = self.pairs
        if pairs is None:
            pairs = tuple((i, j) for i in range(self.nodes) for j in range(i + 1, self.nodes))
        if len(set(pairs)) < len(pairs):
            raise NotAMeasurement("a pair of nodes is given twice: its product is one coordinate of the state")
        for i, j in pairs:
            if not 0 <= i < j < self.nodes:
                raise NotAMeasurement(f"({i}, {j}) is no pair of {self.nodes} nodes: give i < j, counted from 0")
        object.__setattr__(self, "pairs", tuple(pairs))
        first = self.nodes * (self.dimension + 1)
        object.__setattr__(self, "_pair_index", {pair: first + k for k, pair in enumerate(pairs)})

    @property
    def size(self) -> int:
        """Dimension of the state: n d + n + the number of pairs."""
        return self.nodes * (self.dimension + 1) + len(self._pair_index)

    @property
    def base_size(self) -> int:
        """Number of leading coordinates that are positions, n d; the base projection is on these."""
        return self.nodes * self.dimension

    def position(self, node: int) -> slice:
        """Where the state holds xᵢ."""
        self._check(node)
        return slice(node * self.dimension, (node + 1) * self.dimension)

    def square(self, node: int) -> int:
        """Where the state holds xᵢ·xᵢ."""
        self._check(node)
        return self.base_size + node

    def product(self, i: int, j: int) -> int:
        """Where the state holds xᵢ·xⱼ, in either order."""
        index = self._pair_index.get((min(i, j), max(i, j)))
        if index is None:
            raise NotAMeasurement(f"nodes {i} and {j} have no product in this state: give the pair to the embedding")
        return index

    def lift(self, positions: ArrayLike) -> Floats:
        """States on the manifold, g(x) of eq. 9.

        Args:
            positions: (..., n, d) float, metres; the axis of the nodes is there for one node too.

        Returns:
            (..., size) float; metres, then square metres.
        """
        x = np.asarray(positions, dtype=np.float64)
        if x.shape[-2:] != (self.nodes, self.dimension):
            raise NotAMeasurement(
                f"{self.nodes} positions of {self.dimension} numbers are needed, not an array of shape {x.shape}"
            )
        state = np.empty((*x.shape[:-2], self.size))
        state[..., : self.base_size] = x.reshape(*x.shape[:-2], self.base_size)
        state[..., self.base_size : self.base_size + self.nodes] = (x * x).sum(axis=-1)
        for (i, j), index in self._pair_index.items():
            state[..., index] = (x[..., i, :] * x[..., j, :]).sum(axis=-1)
        return state

    def strip_to_anchor(self, node: int, anchor: ArrayLike, low_m: float, high_m: float) -> Strip:
        """The range from node to a point of known position (eq. 2), as a strip.

        Args:
            node: i.
            anchor: (d,) float, a, metres, same frame as the positions.
            low_m: least distance; below 0 counts as 0. See :func:`range_bounds`.
            high_m: greatest distance; inf for "at least low_m away", a half-space.

        Returns:
            {x* : low² − |a|² ≤ xᵢ·xᵢ − 2a·xᵢ ≤ high² − |a|²}.

        Raises:
            NotAMeasurement: no such node, an anchor of another dimension, or high_m below 0 or low_m.
        """
        a = np.asarray(anchor, dtype=np.float64)
        if a.shape != (self.dimension,) or not np.isfinite(a).all():
            raise NotAMeasurement(f"an anchor is {self.dimension} finite numbers, not {anchor!r}")
        low, high = _squares(low_m, high_m)
        direction = np.zeros(self.size)
        direction[self.position(node)] = -2 * a
        direction[self.square(node)] = 1.0
        away = float(a @ a)
        return Strip(direction, low - away, high - away)

    def strip_between(self, i: int, j: int, low_m: float, high_m: float) -> Strip:
        """The range between two nodes of unknown position (eq. 1), as a strip.

        Args:
            i: one node.
            j: the other, in either order.
            low_m: least distance; below 0 counts as 0.
            high_m: greatest distance; may be inf.

        Returns:
            {x* : low² ≤ xᵢ·xᵢ + xⱼ·xⱼ − 2xᵢ·xⱼ ≤ high²}.

        Raises:
            NotAMeasurement: no such pair in the state, or high_m below 0 or low_m.
        """
        low, high = _squares(low_m, high_m)
        direction = np.zeros(self.size)
        direction[self.product(i, j)] = -2.0
        direction[[self.square(i), self.square(j)]] = 1.0
        return Strip(direction, low, high)

    def _check(self, node: int) -> None:
        if not 0 <= node < self.nodes:
            raise NotAMeasurement(f"there is no node {node}: the {self.nodes} nodes are counted from 0")


def _squares(low_m: float, high_m: float) -> tuple[float, float]:
    low = max(0.0, low_m)
    if not low <= high_m or math.isinf(low) or (low == 0 and math.isinf(high_m)):
        raise NotAMeasurement(f"no distance or any distance lies between {low_m} and {high_m} m: leave it out")
    return low * low, high_m * high_m
