"""Any smooth measurement made linear, over a box, by polynomials with a rigorous remainder (thesis §2.2.4).

The state is a point of the box with all its monomials up to a degree n per axis,

    x* = [x₁, …, x_d,  t^α for the other α ∈ {0, …, n}^d],  t = (x − lower) / (upper − lower) ∈ [0, 1]^d,

so that a polynomial p is linear in x*, and a measurement z = f(x) with f ≈ p is a strip, widened by what f − p can be.

*Why in Bernstein form.* p is written in the basis b_ν(t) = Π C(n, νᵢ) tᵢ^νᵢ (1 − tᵢ)^(n − νᵢ), which is positive and
sums to 1, so that a polynomial lies between its least and greatest coefficient. That bounds its derivatives (their
coefficients are n and n(n − 1) times first and second differences), and it bounds the lifted box: the vector of all
b_ν lies in a simplex, around which the smallest ellipsoid is known. So a set starts bounded, and no guess is needed.

*Which polynomial.* Bernstein's own, with the coefficients f(ν / n), converges like 1/n and does not even return
quadratics. Here p is the interpolation at Chebyshev nodes in the same basis: it returns every polynomial of the degree
exactly, the square of a range among them.

*Why the remainder is rigorous.* e = f − p is computed on a grid with steps hᵢ. If |∂ᵢᵢf| ≤ Mᵢ on the box, then
|∂ᵢᵢe| ≤ Kᵢ = Mᵢ + (the bound on |∂ᵢᵢp| from its coefficients), and between grid points e differs from its multilinear
interpolation by at most Σ Kᵢhᵢ²/8. If only slopes |∂ᵢf| ≤ Lᵢ are known, the nearest grid point is at most hᵢ/2 away per
axis, and the bound is Σ (Lᵢ + |∂ᵢp|) hᵢ/2. The bounds M or L are the user's promise, as ε is: from analysis by
hand, or from interval arithmetic. (Hanebeck's framework in the thesis' [38] suggests the basis.)

The state has (n + 1)^d − 1 numbers: meant for d of 1 to 3 and small degrees.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.ellipsoid import Ellipsoid
from estimation.range_embedding import NotAMeasurement
from estimation.strip import Strip
from estimation.strip_cut import cut

Floats = NDArray[np.float64]

GRID_POINTS = 20_000
"""About how many points of the box the remainder is computed on."""


@dataclass(frozen=True, eq=False)
class LinearApproximation:
    """A function as a linear one of the state, and how far off it can be anywhere in the box.

    Attributes:
        row: (size,) float.
        offset: the approximation is row·x* + offset.
        error_low: least possible value of f(x) − (row·x* + offset) in the box.
        error_high: greatest.
    """

    row: Floats
    offset: float
    error_low: float
    error_high: float

    @property
    def remainder(self) -> float:
        """Greatest distance between function and approximation."""
        return max(-self.error_low, self.error_high)

    def strip(self, low: float, high: float) -> Strip:
        """The measurement low ≤ f(x) ≤ high as a strip of the state; contains every x of the box that satisfies it.

        Args:
            low: least value, in the unit of f; may be -inf.
            high: greatest value; may be inf.
        """
        return Strip(self.row, low - self.error_high - self.offset, high - self.error_low - self.offset)


@dataclass(frozen=True, eq=False)
class BernsteinEmbedding:
    """State and measurements for positions in a box.

    Attributes:
        lower: (d,) float, metres, lower corner of the box.
        upper: (d,) float, metres, upper corner.
        degree: n ≥ 1, greatest exponent per axis.
        exponents: (size, d) int, α of every coordinate of the state; the first d are the positions themselves.
    """

    lower: Floats
    upper: Floats
    degree: int
    exponents: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        lower, upper = np.array(self.lower, dtype=np.float64), np.array(self.upper, dtype=np.float64)
        if lower.ndim != 1 or lower.shape != upper.shape or not (np.isfinite(lower) & np.isfinite(upper)).all():
            raise NotAMeasurement(f"a box has two finite corners of the same length, not {self.lower} and {self.upper}")
        if not (lower < upper).all():
            raise NotAMeasurement(f"the box from {lower} to {upper} is empty: give the lower corner first")
        if not 1 <= self.degree <= 12:
            raise NotAMeasurement(
                f"the degree must be 1 to 12, not {self.degree}: beyond, rounding eats what is gained"
            )
        units = [tuple(row) for row in np.eye(len(lower), dtype=np.int64).tolist()]
        others = itertools.product(range(self.degree + 1), repeat=len(lower))
        rest = [alpha for alpha in others if any(alpha) and alpha not in units]
        object.__setattr__(self, "lower", lower)
        object.__setattr__(self, "upper", upper)
        object.__setattr__(self, "exponents", np.array(units + rest, dtype=np.int64))

    @property
    def size(self) -> int:
        """Dimension of the state, (n + 1)^d − 1."""
        return len(self.exponents)

    def lift(self, positions: ArrayLike) -> Floats:
        """States of positions (..., d) float, metres: (..., size) float."""
        x = np.asarray(positions, dtype=np.float64)
        t = (x - self.lower) / (self.upper - self.lower)
        powers = np.stack([t**exponent for exponent in range(self.degree + 1)], axis=-1)
        state: Floats = np.ones((*t.shape[:-1], self.size))
        for axis in range(len(self.lower)):
            state *= powers[..., axis, self.exponents[:, axis]]
        state[..., : len(self.lower)] = x
        return state

    def approximate(
        self,
        function: Callable[[Floats], Floats],
        *,
        curvatures: ArrayLike | None = None,
        slopes: ArrayLike | None = None,
    ) -> LinearApproximation:
        """A measurement function as a linear one of the state, with its remainder.

        Args:
            function: f, from (k, d) float metres to (k,) float.
            curvatures: (d,) float, M with |∂²f/∂xᵢ²| ≤ Mᵢ everywhere in the box; or
            slopes: (d,) float, L with |∂f/∂xᵢ| ≤ Lᵢ. With both, the smaller remainder counts.

        Raises:
            NotAMeasurement: neither bound is given, one is negative or not finite, or f is not finite in the box.
        """
        d, n = len(self.lower), self.degree
        nodes = 0.5 - 0.5 * np.cos(np.pi * (np.arange(n + 1) + 0.5) / (n + 1))
        values = self._evaluate(function, [nodes] * d)
        collocation = np.array([[_basis(n, nu, t) for nu in range(n + 1)] for t in nodes])
        coefficients = values
        for axis in range(d):
            coefficients = np.moveaxis(np.tensordot(np.linalg.inv(collocation), coefficients, (1, axis)), 0, axis)
        row, offset = self._linear(coefficients)

        count = max(3, round(GRID_POINTS ** (1 / d)))
        grid = [np.linspace(0, 1, count)] * d
        points = self._points(grid)
        states = self.lift(points)
        errors = self._evaluate(function, grid).ravel() - (states @ row + offset)
        rounding = 1e-14 * self.size * float(np.max(np.abs(states) @ np.abs(row)) + abs(offset))
        steps = (self.upper - self.lower) / (count - 1)
        between = self._between(coefficients, steps, curvatures, slopes) + rounding
        return LinearApproximation(row, offset, float(errors.min()) - between, float(errors.max()) + between)

    def start(self) -> Ellipsoid:
        """A bounded ellipsoid that contains the lifted box: where a set begins before any measurement.

        The basis vectors of the box lie in a standard simplex, whose smallest ellipsoid is a ball; it is brought into
        the state, and cut by 0 ≤ b_ν ≤ max b_ν, which is well below 1 inside.
        """
        d, n = len(self.lower), self.degree
        indices = np.array(list(itertools.product(range(n + 1), repeat=d)))
        # Control points: monomial t^i has the Bernstein coefficients C(ν, i) / C(n, i).
        single = np.array([[math.comb(nu, i) / math.comb(n, i) for i in range(n + 1)] for nu in range(n + 1)])
        control = np.ones((len(indices), self.size))
        for axis in range(d):
            control *= single[indices[:, axis]][:, self.exponents[:, axis]]
        control[:, :d] = self.lower + control[:, :d] * (self.upper - self.lower)
        center = control.mean(axis=0)
        number = len(indices)
        across = np.linalg.svd(np.ones((number, 1)))[0][:, 1:]
        ellipsoid = Ellipsoid.from_factor(center, math.sqrt(1 - 1 / number) * (control - center).T @ across)
        for _ in range(2):
            for index in indices:
                coefficients = np.zeros((n + 1,) * d)
                coefficients[tuple(index)] = 1.0
                row, offset = self._linear(coefficients)
                greatest = math.prod(_basis(n, int(nu), nu / n) for nu in index)
                smaller = cut(ellipsoid, Strip(row, -offset, greatest * (1 + 1e-12) - offset)).ellipsoid
                assert smaller is not None
                ellipsoid = smaller
        return ellipsoid

    def _linear(self, coefficients: Floats) -> tuple[Floats, float]:
        """A polynomial in Bernstein form, (n + 1,)·d float, as row and offset of the state."""
        n, d = self.degree, len(self.lower)
        powers = np.zeros((n + 1, n + 1))
        for nu in range(n + 1):
            for i in range(nu, n + 1):
                powers[i, nu] = math.comb(n, i) * math.comb(i, nu) * (-1) ** (i - nu)
        monomials = coefficients
        for axis in range(d):
            monomials = np.moveaxis(np.tensordot(powers, monomials, (1, axis)), 0, axis)
        row: Floats = monomials[tuple(self.exponents.T)]
        row[:d] /= self.upper - self.lower
        return row, float(monomials[(0,) * d] - row[:d] @ self.lower)

    def _between(
        self, coefficients: Floats, steps: Floats, curvatures: ArrayLike | None, slopes: ArrayLike | None
    ) -> float:
        """By how much f − p can pass its values on the grid."""
        n, d = self.degree, len(self.lower)
        widths = self.upper - self.lower
        bounds = []
        for given, order in ((curvatures, 2), (slopes, 1)):
            if given is None:
                continue
            promised = np.asarray(given, dtype=np.float64)
            if promised.shape != (d,) or not (np.isfinite(promised) & (promised >= 0)).all():
                raise NotAMeasurement(f"a bound on derivatives is {d} finite numbers, at least 0, not {given!r}")
            factor = n * (n - 1) if order == 2 else n
            own = [factor * np.abs(np.diff(coefficients, order, axis)).max(initial=0.0) for axis in range(d)]
            total = promised + np.array(own) / widths**order
            bounds.append(float(total @ steps**2) / 8 if order == 2 else float(total @ steps) / 2)
        if not bounds:
            raise NotAMeasurement(
                "values on a grid bound no function: give its greatest curvatures or slopes in the box"
            )
        return min(bounds)

    def _points(self, axes: list[Floats]) -> Floats:
        """(k, d) float, metres: the grid with the given shares of the box per axis, the last axis running fastest."""
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
        return self.lower + grid * (self.upper - self.lower)

    def _evaluate(self, function: Callable[[Floats], Floats], axes: list[Floats]) -> Floats:
        """Values of f on a grid, one axis of the result per axis of the box."""
        points = self._points(axes)
        values = np.asarray(function(points), dtype=np.float64)
        if values.shape != (len(points),) or not np.isfinite(values).all():
            raise NotAMeasurement(
                f"the function must return {len(points)} finite numbers for as many points of the box, "
                f"not an array of shape {values.shape}{'' if np.isfinite(values).all() else ' with gaps'}"
            )
        return values.reshape([len(axis) for axis in axes])


def _basis(n: int, nu: int, t: float) -> float:
    """The Bernstein polynomial b_ν,n at t (thesis §2.2.4)."""
    return float(math.comb(n, nu) * t**nu * (1 - t) ** (n - nu))
