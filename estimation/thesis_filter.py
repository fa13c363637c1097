"""The thesis' own range filter (§2.2.2, §2.3, eq. 5), kept as it is for comparison: do not navigate by it.

The state is (x, y, s = x² + y²) in one fixed frame, the set ε(x₀, E) with the matrix E itself, fully degenerate at the
start, ε(0, 0). Every range is a strip, and is fused by the λ of least volume. A strip has rank one, so everything about
λ follows from two numbers, with ĥ = h/w of the strip |h·x* − m| ≤ w:

    g = ĥᵀE⁻¹ĥ,  ν = m/w − ĥ·x₀,  β(λ) = λ + (1 − λ)g,  N(λ) = β − λ(1 − λ)ν²,
    k = N / β,  det E_new = det E · λ^(r−1) β^(r+1) / N^r,

r the rank of E, everything within its range. The volume is stationary (Ros et al., theorem 3) where
(r − 1)βN + (r + 1)λβ'N − rλβN' = 0, a cubic. With fewer than three independent strips, a new one that crosses
the others gets λ = r / (r + 1) and k = 1: the rule of :mod:`estimation.fusion` for what the thesis leaves undefined.

*What is kept, faults included.* Where the strip misses the set, k < 0 and E = X / k is negative definite, then
indefinite: no set at all. The thesis fuses on (figs. 12, 13), and so does this filter. With no minimum of the volume to
look for, λ is the stationary point with the greatest |det E|, and 1 where there is none; for a true set that is the
minimum of the volume. It shows what the thesis reports: |E| below zero, small λ that throw the bad estimate away, and a
determinant that comes back without reaching its old height. The sign of the determinant shows only an odd number of
negative eigenvalues: ``definite`` tells all. In a fixed frame E also loses its digits with the square of the distance
to the origin: some kilometres away the target falls out of the set by rounding alone.

Corrected: the lower end of the range interval, max(0, z − ε).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.ellipsoid import Ellipsoid
from estimation.range_embedding import NotAMeasurement, RangeEmbedding, range_bounds

Floats = NDArray[np.float64]

CROSSING = 1e-9
"""Part of a strip's direction that must lie outside those before it, for it to count as independent."""


@dataclass(frozen=True)
class ThesisReport:
    """What one range did to the thesis' filter: the curves of figs. 13, 14, 16 and 18.

    Attributes:
        weight: λ; 1 left the estimate as it was, 0 threw it away.
        k: of eq. 5; below 0, if E was definite, the range and the estimate have no common point.
        determinant: of E, 1/m⁸; 0 while fewer than three strips are independent.
        definite: E is positive semi-definite, and the filter holds a set.
    """

    weight: float
    k: float
    determinant: float
    definite: bool


class ThesisRangeFilter:
    """The filter of thesis chapter 2 for one static target. See the module for its faults; it keeps them.

    Attributes:
        center: (3,) float, x₀: x and y in metres, map frame, and s in square metres.
        inverse_shape: (3, 3) float, E.
    """

    def __init__(self) -> None:
        self.center: Floats = np.zeros(3)
        self.inverse_shape: Floats = np.zeros((3, 3))
        self._spanned: Floats = np.zeros((3, 0))
        self._embedding = RangeEmbedding()

    @property
    def definite(self) -> bool:
        """Whether E is positive semi-definite, so that there is a set."""
        within = self._spanned.T @ self.inverse_shape @ self._spanned
        return bool((np.linalg.eigvalsh(within) > 0).all()) if within.size else True

    def measure(self, anchor_xy: ArrayLike, range_m: float, bound_m: float) -> ThesisReport:
        """Fuse one range, whatever comes of it.

        Args:
            anchor_xy: (2,) float, metres, map frame.
            range_m: z, metres.
            bound_m: ε > 0, metres.

        Raises:
            NotAMeasurement: the range or the anchor is not finite, or the bound not above 0.
        """
        if not bound_m > 0:
            raise NotAMeasurement(f"the bound of a range must be above 0, not {bound_m} m: E would be infinite")
        strip = self._embedding.strip_to_anchor(0, anchor_xy, *range_bounds(range_m, bound_m, bound_m))
        direction = strip.direction / strip.half_width
        middle = strip.middle / strip.half_width
        rank = self._spanned.shape[1]
        across = direction - self._spanned @ (self._spanned.T @ direction)
        length = float(np.linalg.norm(across))
        if rank < 3 and length > CROSSING * float(np.linalg.norm(direction)):
            weight, k = self._cross(direction, middle, across / length), 1.0
        else:
            weight, k = self._fuse(direction, middle)
        determinant = float(np.linalg.det(self.inverse_shape)) if self._spanned.shape[1] == 3 else 0.0
        return ThesisReport(weight, k, determinant, self.definite)

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Which positions satisfy eq. 10, (..., 2) float metres, map frame; what it says of no set is kept too."""
        away = self._embedding.lift(np.asarray(points, dtype=np.float64)[..., None, :]) - self.center
        return np.asarray(np.einsum("...i,ij,...j->...", away, self.inverse_shape, away) <= 1)

    def ellipsoid(self) -> Ellipsoid | None:
        """The estimate in the calculus, for projections and slices; None where E bounds no set."""
        return Ellipsoid.from_inverse_shape(self.center, self.inverse_shape) if self.definite else None

    def _cross(self, direction: Floats, middle: float, outward: Floats) -> float:
        """A strip that bounds a direction so far free: λ = r / (r + 1), k = 1."""
        rank = self._spanned.shape[1]
        weight: float = rank / (rank + 1)
        self._spanned = np.column_stack([self._spanned, outward])
        pulled = weight * self.inverse_shape @ self.center + (1 - weight) * middle * direction
        self.inverse_shape = weight * self.inverse_shape + (1 - weight) * np.outer(direction, direction)
        within = self._spanned.T @ self.inverse_shape @ self._spanned
        self.center = self._spanned @ np.linalg.solve(within, self._spanned.T @ pulled)
        return weight

    def _fuse(self, direction: Floats, middle: float) -> tuple[float, float]:
        """Eq. 5 for a strip within the range of E; returns λ and k."""
        within = self._spanned.T @ self.inverse_shape @ self._spanned
        solved = np.linalg.lstsq(within, self._spanned.T @ direction)[0]
        pull = self._spanned @ solved
        g, nu = float(direction @ pull), middle - float(direction @ self.center)
        weight = _stationary_weight(g, nu, self._spanned.shape[1])
        beta = weight + (1 - weight) * g
        k = 1 - weight * (1 - weight) * nu * nu / beta
        self.center = self.center + (1 - weight) * nu / beta * pull
        fused = (weight * self.inverse_shape + (1 - weight) * np.outer(direction, direction)) / k
        self.inverse_shape = 0.5 * (fused + fused.T)
        return weight, k


def _stationary_weight(g: float, nu: float, rank: int) -> float:
    """λ in (0, 1) where det E is stationary and its size greatest; an end of [0, 1] where it is stationary nowhere."""
    # Coefficients by rising powers of λ: β = g + bλ, N = g + cλ + ν²λ².
    b, square = 1 - g, nu * nu
    c = b - square
    cubic = (rank - 1) * np.array([g * g, g * (b + c), g * square + b * c, b * square])
    cubic[1:] += (rank + 1) * b * np.array([g, c, square])
    cubic[1:] -= rank * np.array([g * c, 2 * g * square + b * c, 2 * b * square])
    roots = np.roots(cubic[::-1])
    real = roots.real[np.abs(roots.imag) <= 1e-9 * np.abs(roots)]
    inside = [float(root) for root in real if 0 < root < 1]

    def logarithm_of_determinant(at: float) -> float:
        beta = g + b * at
        if beta == 0.0:  # at λ = 0 for a direction that the set does not bound in floating point
            return -math.inf
        k = abs((g + c * at + square * at * at) / beta)
        shares: float = abs(beta) * at ** (rank - 1)
        return math.log(shares) - rank * math.log(k) if shares > 0 and k > 0 else -math.inf

    return max(inside or [1.0, 0.0], key=logarithm_of_determinant)
