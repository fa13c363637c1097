"""Ellipsoids in n dimensions, with semi-axes of any length from zero to infinity (thesis §2.1.2).

The thesis writes an ellipsoid as ε(c, E) = {x : (x − c)ᵀ E (x − c) ≤ 1} (eq. 4). E is the *inverse* shape matrix: the
semi-axis along an eigenvector is λ^(−1/2), and a zero eigenvalue leaves its direction free (the thesis calls the
eigenvalues lengths; corrected). E = 0 is the whole space. The other form, {c + L v : |v| ≤ 1}, has a factor L with
L Lᵀ = E⁻¹; it holds bounded sets only, flat ones included, and loses half as many digits.

Both are views of what is kept here: the centre c, an orthonormal matrix V of axes and the semi-axes a ∈ [0, ∞]ⁿ,
E = V diag(a⁻²) Vᵀ and L = V diag(a). Which directions are free or flat is decided once, where the ellipsoid is made,
and every operation can ask. Intersections need no inverse of a nearly singular matrix: they all are least squares,
{x : |M x − y| ≤ 1} with the rows of M from diag(1/a) Vᵀ, and 1 − (the least square) is the k of eq. 5 and 6.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.strip import Strip

Floats = NDArray[np.float64]

EPSILON = float(np.finfo(np.float64).eps)


class NotAnEllipsoid(ValueError):
    """Numbers that describe no ellipsoid; the text says which and what to do."""


class UnboundedEllipsoid(ValueError):
    """A free direction where only bounded ellipsoids will do."""


class FlatEllipsoid(ValueError):
    """A semi-axis of length zero where E would be infinite."""


@dataclass(frozen=True)
class EmptyIntersection:
    """Two sets that have no point in common, in the place of the ellipsoid that would bound their intersection.

    It is a value, so that a filter can report it, and no ellipsoid, so that nobody can go on with it by mistake.

    Attributes:
        k: the k of eq. 5 or 6, below 0; the more, the further apart.
        weight: the λ of eq. 5 that proves it; nan for a slice or a pre-image.
    """

    k: float
    weight: float = math.nan


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """An ellipsoid; made by one of the class methods, which are also where bad input is refused.

    Attributes:
        center: (n,) float; along free directions it is one representative point.
        axes: (n, n) float, orthonormal columns.
        semi_axes: (n,) float, descending, of the columns of axes; inf where free, 0 where flat.
    """

    center: Floats
    axes: Floats
    semi_axes: Floats

    def __post_init__(self) -> None:
        for values in (self.center, self.axes, self.semi_axes):
            values.flags.writeable = False

    @classmethod
    def from_inverse_shape(cls, center: ArrayLike, inverse_shape: ArrayLike) -> Ellipsoid:
        """The thesis' ε(c, E), eq. 4.

        Args:
            center: (n,) float.
            inverse_shape: (n, n) float, E, symmetric and positive semi-definite, 0 allowed. Eigenvalues below 4 n
                machine epsilons of the largest cannot be told from zero and count as free, which enlarges the set.

        Raises:
            NotAnEllipsoid: E is not finite, not symmetric or has a negative eigenvalue, or the shapes do not fit.
        """
        c, E = _array(center, 1, "centre"), _array(inverse_shape, 2, "inverse shape matrix")
        n = len(c)
        if E.shape != (n, n):
            raise NotAnEllipsoid(f"a centre of {n} numbers needs an inverse shape matrix of {n} by {n}, not {E.shape}")
        scale = float(np.abs(E).max(initial=0.0))
        if np.abs(E - E.T).max(initial=0.0) > 1e-9 * scale:
            raise NotAnEllipsoid("the inverse shape matrix is not symmetric: use (E + Eᵀ) / 2 if that is rounding")
        values, axes = np.linalg.eigh(0.5 * (E + E.T))
        zero = 4 * n * EPSILON * max(float(np.abs(values).max(initial=0.0)), 0.0)
        if values.min(initial=0.0) < -max(1e-9 * scale, zero):
            raise NotAnEllipsoid(
                f"the inverse shape matrix has a negative eigenvalue, {values.min():.3g}: it bounds no set "
                "(a fusion with k < 0 makes such matrices: the two sets have no common point)"
            )
        semi_axes = np.full(n, np.inf)
        semi_axes[values > zero] = values[values > zero] ** -0.5
        return cls(c, axes, semi_axes)

    @classmethod
    def from_factor(cls, center: ArrayLike, factor: ArrayLike) -> Ellipsoid:
        """{c + L v : |v| ≤ 1}.

        Args:
            center: (n,) float.
            factor: (n, r) float, L, any rank.

        Raises:
            NotAnEllipsoid: L is not finite, or the shapes do not fit.
        """
        c, L = _array(center, 1, "centre"), _array(factor, 2, "factor")
        if len(L) != len(c):
            raise NotAnEllipsoid(f"a centre of {len(c)} numbers needs a factor of as many rows, not {len(L)}")
        return cls.from_generators(c, L, np.empty((len(c), 0)))

    @classmethod
    def ball(cls, center: ArrayLike, radius: float) -> Ellipsoid:
        """The points at most radius ≥ 0 from the centre."""
        c = _array(center, 1, "centre")
        if not 0 <= radius < np.inf:
            raise NotAnEllipsoid(f"the radius of a ball must be finite and at least 0, not {radius}")
        return cls(c, np.eye(len(c)), np.full(len(c), float(radius)))

    @classmethod
    def whole_space(cls, dimension: int) -> Ellipsoid:
        """ε(0, 0): nothing is known (thesis §2.2.2)."""
        return cls(np.zeros(dimension), np.eye(dimension), np.full(dimension, np.inf))

    @classmethod
    def strip(cls, h: ArrayLike, m: float, w: float) -> Ellipsoid:
        """{x : |h·x − m| ≤ w}, ε(H† m, HᵀH / w²) of thesis §2.1.2; h (n,), w ≥ 0. See :meth:`from_strip`."""
        return cls.from_strip(Strip(_array(h, 1, "direction"), m - w, m + w))

    @classmethod
    def from_strip(cls, strip: Strip) -> Ellipsoid:
        """A strip as the ellipsoid of rank 1 it is; a half-space lies in no ellipsoid but the whole space."""
        h = strip.direction
        if not np.isfinite(strip.half_width):
            return cls.whole_space(len(h))
        length = float(np.linalg.norm(h))
        # Any orthonormal basis whose last vector is h/|h| will do: the left singular vectors of hᵀ, reversed.
        axes = np.linalg.svd((h / length)[:, None])[0][:, ::-1].copy()
        semi_axes = np.full(len(h), np.inf)
        semi_axes[-1] = strip.half_width / length
        return cls(h / length * (strip.middle / length), axes, semi_axes)

    @classmethod
    def from_generators(
        cls, center: Floats, bounded: Floats, free: Floats, scales: tuple[float, float] | None = None
    ) -> Ellipsoid:
        """{c + B v + F t : |v| ≤ 1, t any}: every ellipsoid there is.

        Args:
            center: (n,) float, c.
            bounded: (n, r) float, B.
            free: (n, k) float, F.
            scales: the size of the numbers of which B and F were computed; what is in the rounding of that counts as
                0. The size of B and F themselves if not given.
        """
        n = len(center)
        sizes = scales or (float(np.linalg.norm(bounded)), float(np.linalg.norm(free)))
        rounding = 4 * n * EPSILON * np.array(sizes)
        basis, values, _ = np.linalg.svd(free) if free.shape[1] else (np.eye(n), np.empty(0), None)
        k = int((values > rounding[1]).sum())
        across = basis[:, k:]
        inner, lengths, _ = np.linalg.svd(across.T @ bounded) if k < n else (np.empty((0, 0)), np.empty(0), None)
        semi_axes = np.zeros(n)
        semi_axes[:k] = np.inf
        semi_axes[k : k + len(lengths)] = np.where(lengths > rounding[0], lengths, 0.0)
        return cls(center, np.hstack([basis[:, :k], across @ inner]), semi_axes)

    @classmethod
    def from_least_squares(cls, matrix: Floats, values: Floats) -> Ellipsoid | EmptyIntersection:
        """{x : |M x − y| ≤ 1}; M (r, n), y (r,). Centre M⁺ y, k = 1 − |M M⁺ y − y|², E = MᵀM / k (eq. 5, 6).

        Where |k| is below the rounding of its own computation the sets touch, and k counts as that much above 0.
        """
        n = matrix.shape[1]
        left, sigma, right = np.linalg.svd(matrix)
        rank = int((sigma > 4 * max(matrix.shape) * EPSILON * sigma.max(initial=0.0)).sum())
        center = right[:rank].T @ ((left[:, :rank].T @ values) / sigma[:rank])
        # The part of y that M cannot reach, taken from the basis: a difference of large numbers would lose it.
        missed = left[:, rank:].T @ values
        rounding = 1e-12 + 64 * EPSILON * float(values @ values)
        k = 1.0 - float(missed @ missed)
        if k < -rounding:
            return EmptyIntersection(k)
        semi_axes = np.full(n, np.inf)
        semi_axes[:rank] = math.sqrt(max(k, rounding)) / sigma[:rank]
        order = np.argsort(-semi_axes, kind="stable")
        return cls(center, right.T[:, order], semi_axes[order])

    @property
    def dimension(self) -> int:
        """How many numbers a point has, n."""
        return len(self.center)

    @property
    def bounded(self) -> bool:
        """Whether no direction is free."""
        return bool(np.isfinite(self.semi_axes).all())

    @property
    def inverse_shape(self) -> Floats:
        """(n, n) float: the thesis' E, singular where unbounded. Raises FlatEllipsoid."""
        rows = self.information
        return rows.T @ rows

    @property
    def information(self) -> Floats:
        """(r, n) float: G with E = GᵀG, a row for every direction that is not free. Raises FlatEllipsoid."""
        if self.semi_axes.min(initial=np.inf) <= 0:
            raise FlatEllipsoid(
                "the ellipsoid has a semi-axis of length 0, where E is infinite: give it the width you can vouch for"
            )
        known = np.isfinite(self.semi_axes)
        return np.ascontiguousarray((self.axes[:, known] / self.semi_axes[known]).T)

    @property
    def factor(self) -> Floats:
        """(n, n) float: L of {c + L v : |v| ≤ 1}. Raises UnboundedEllipsoid."""
        if not self.bounded:
            raise UnboundedEllipsoid(
                f"{int(np.isinf(self.semi_axes).sum())} directions of the ellipsoid are free and it has no factor: "
                "use inverse_shape, or fuse it with more measurements first"
            )
        return self.axes * self.semi_axes

    @property
    def log_volume(self) -> float:
        """Natural logarithm of the volume; -inf where flat, else inf where unbounded. −2 log_volume ~ log det E."""
        if self.semi_axes.min(initial=np.inf) <= 0:
            return -math.inf
        n = self.dimension
        return float(np.log(self.semi_axes).sum()) + 0.5 * n * math.log(math.pi) - math.lgamma(0.5 * n + 1)

    @property
    def volume(self) -> float:
        """Volume in n dimensions; 0 where flat, else inf where unbounded."""
        return math.exp(self.log_volume) if self.log_volume < 709 else math.inf

    def contains(self, points: ArrayLike, tolerance: float = 1e-9) -> NDArray[np.bool_]:
        """Which points lie inside.

        Args:
            points: (..., n) float.
            tolerance: by which share the ellipsoid is scaled about its centre before asking; a flat semi-axis counts
                as this share of the numbers it is computed from, the points' and the longest bounded semi-axis.

        Returns:
            (...) bool.
        """
        states = np.asarray(points, dtype=np.float64)
        along = (states - self.center) @ self.axes
        wide = np.isfinite(self.semi_axes) & (self.semi_axes > 0)
        scaled = along[..., wide] / (self.semi_axes[wide] * (1 + tolerance))
        inside: NDArray[np.bool_] = np.asarray((scaled**2).sum(axis=-1) <= 1)
        if (self.semi_axes == 0).any():
            size = self.semi_axes[wide].max(initial=0.0) + np.abs(states).max(axis=-1) + np.abs(self.center).max()
            inside &= (np.abs(along[..., self.semi_axes == 0]) <= tolerance * size[..., None]).all(axis=-1)
        return inside

    def support(self, directions: ArrayLike) -> Floats:
        """Largest h·x over the set, for h in directions (..., n) float. Returns (...) float.

        It is inf unless h is perpendicular to what is free, up to a part of 1e-12.
        """
        h = np.asarray(directions, dtype=np.float64)
        along = h @ self.axes
        known = np.isfinite(self.semi_axes)
        reach = h @ self.center + np.linalg.norm(along[..., known] * self.semi_axes[known], axis=-1)
        rounding = 1e-12 * np.linalg.norm(h, axis=-1)
        return np.asarray(np.where(np.linalg.norm(along[..., ~known], axis=-1) > rounding, np.inf, reach))

    def bounding_box(self) -> tuple[Floats, Floats]:
        """Smallest box around the set: lower and upper corner, (n,) float each, infinite where unbounded."""
        unit = np.eye(self.dimension)
        return -self.support(-unit), self.support(unit)

    def image(self, matrix: ArrayLike, offset: ArrayLike | None = None) -> Ellipsoid:
        """{A x + b : x in the set}, exactly; for an invertible A it is ε(A c + b, A⁻ᵀ E A⁻¹).

        Thesis §2.1.2 prints A E Aᵀ, which is the rule of the shape matrix E⁻¹ (corrected).

        Args:
            matrix: (m, n) float, A; of any rank: the image may be flat or lie in fewer dimensions.
            offset: (m,) float, b; zero if not given.
        """
        A = _array(matrix, 2, "matrix")
        known = np.isfinite(self.semi_axes)
        moved = A @ self.center + (0.0 if offset is None else np.asarray(offset, dtype=np.float64))
        gain = float(np.linalg.norm(A))
        bounded = A @ (self.axes[:, known] * self.semi_axes[known])
        scales = gain * float(self.semi_axes[known].max(initial=0.0)), gain
        return self.from_generators(moved, bounded, A @ self.axes[:, ~known], scales)

    def preimage(self, matrix: ArrayLike, offset: ArrayLike | None = None) -> Ellipsoid | EmptyIntersection:
        """{x : H x + d in the set}, exactly: thesis §2.1.2 for a measurement of any number of components.

        Args:
            matrix: (n, m) float, H; m may be smaller or larger than n. Where H does not reach every point of the
                set (m < n), it is the slice of the set by the range of H, which may be empty.
            offset: (n,) float, d; zero if not given.

        Raises:
            FlatEllipsoid: a semi-axis is 0.
        """
        H = _array(matrix, 2, "matrix")
        shift = self.center if offset is None else self.center - np.asarray(offset, dtype=np.float64)
        G = self.information
        return self.from_least_squares(G @ H, G @ shift)

    def slice_by(self, origin: ArrayLike, directions: ArrayLike) -> Ellipsoid | EmptyIntersection:
        """{t : y₀ + Y t in the set}: the set's intersection with an affine set, in its coordinates (eq. 6).

        Args:
            origin: (n,) float, y₀.
            directions: (n, m) float, Y; the coordinates t are lengths if its columns are orthonormal.

        Raises:
            FlatEllipsoid: a semi-axis is 0.
        """
        return self.preimage(directions, origin)

    def project(self, dimension: int) -> Ellipsoid:
        """The shadow on the first coordinates, as many as dimension (eq. 7); free directions cast free shadows."""
        if not 0 < dimension <= self.dimension:
            raise NotAnEllipsoid(f"{self.dimension} dimensions can be projected on 1 to as many, not {dimension}")
        return self.image(np.eye(dimension, self.dimension))

    def project_onto(self, basis: ArrayLike) -> Ellipsoid:
        """The shadow {Yᵀx} on a subspace with orthonormal basis Y, (n, m) float: the Schur complement of eq. 8.

        The thesis admits any basis, but its formula holds for orthonormal Y and Z only (corrected).

        Raises:
            NotAnEllipsoid: the columns of Y are not orthonormal; use those of numpy.linalg.qr(Y).
        """
        Y = _array(basis, 2, "basis")
        if not np.allclose(Y.T @ Y, np.eye(Y.shape[1]), rtol=0, atol=1e-9):
            raise NotAnEllipsoid("the basis is not orthonormal: project onto the columns of numpy.linalg.qr(Y)[0]")
        return self.image(Y.T)


def _array(values: ArrayLike, dimensions: int, name: str) -> Floats:
    """A copy as floats, refused if not finite or of the wrong number of dimensions."""
    array = np.array(values, dtype=np.float64)
    if array.ndim != dimensions or not np.isfinite(array).all():
        raise NotAnEllipsoid(f"the {name} must be a finite {'vector' if dimensions == 1 else 'matrix'}, not {values!r}")
    return array
