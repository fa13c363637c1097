"""A strip: the points between two parallel hyperplanes, which is what one linear measurement with bounds leaves.

Thesis §2.1.2: a measurement z = H x with |error| ≤ ε has as pre-image the degenerate ellipsoid of rank 1 between two
hyperplanes. Kept as (h, low, high), a strip may also be open to one side, which no ellipsoid can be: a half-space.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


class NotAStrip(ValueError):
    """A direction or an interval does not make a strip; the text says which and what to do."""


@dataclass(frozen=True, eq=False)
class Strip:
    """The set {x : low ≤ h·x ≤ high} in n dimensions.

    Attributes:
        direction: (n,) float, h; not zero, of any length.
        low: lower end, in the unit of h·x; may be -inf.
        high: upper end, not below low; may be inf.

    Raises:
        NotAStrip: h is zero or not finite, or the interval is empty or unbounded on both sides.
    """

    direction: Floats
    low: float
    high: float

    def __post_init__(self) -> None:
        direction = np.array(self.direction, dtype=np.float64)
        if direction.ndim != 1 or not np.isfinite(direction).all() or not direction.any():
            raise NotAStrip(f"the direction of a strip must be one finite vector other than zero, not {direction}")
        if not self.low <= self.high or (self.low == -np.inf and self.high == np.inf):
            raise NotAStrip(f"a strip from {self.low} to {self.high} holds nothing or everything: give low ≤ high")
        if self.low == np.inf or self.high == -np.inf:
            raise NotAStrip(f"a strip from {self.low} to {self.high} lies at infinity: give finite bounds")
        direction.flags.writeable = False
        object.__setattr__(self, "direction", direction)
        object.__setattr__(self, "low", float(self.low))
        object.__setattr__(self, "high", float(self.high))

    @property
    def middle(self) -> float:
        """Middle m of the interval; infinite for a half-space."""
        return self.low + 0.5 * (self.high - self.low)

    @property
    def half_width(self) -> float:
        """Half of the interval's length, w; infinite for a half-space."""
        return 0.5 * (self.high - self.low)

    def contains(self, points: ArrayLike, tolerance: float = 1e-12) -> NDArray[np.bool_]:
        """Which points lie between the two hyperplanes.

        Args:
            points: (..., n) float.
            tolerance: slack, as a share of the numbers that are added and compared; covers rounding.

        Returns:
            (...) bool.
        """
        states = np.asarray(points, dtype=np.float64)
        values = states @ self.direction
        ends = max(abs(end) for end in (self.low, self.high) if np.isfinite(end))
        slack = tolerance * (np.abs(states) @ np.abs(self.direction) + ends)
        inside: NDArray[np.bool_] = (values >= self.low - slack) & (values <= self.high + slack)
        return inside
