"""Random ellipsoids of every kind, and points of them, for the tests of the calculus."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation.ellipsoid import Ellipsoid

Floats = NDArray[np.float64]


def random_rotation(dimension: int, rng: np.random.Generator) -> Floats:
    return np.linalg.qr(rng.normal(size=(dimension, dimension)))[0]


def random_ellipsoid(
    rng: np.random.Generator, dimension: int, *, free: int = 0, flat: int = 0, away: float = 3.0
) -> Ellipsoid:
    """Semi-axes within two decades; the given numbers of them free and flat."""
    semi_axes = 10 ** rng.uniform(-1, 1, dimension)
    semi_axes[:free] = np.inf
    semi_axes[dimension - flat :] = 0.0
    axes = random_rotation(dimension, rng)
    known = np.isfinite(semi_axes)
    center = away * rng.normal(size=dimension)
    return Ellipsoid.from_generators(center, axes[:, known] * semi_axes[known], axes[:, ~known])


def random_kind(rng: np.random.Generator, *, flat: bool = True) -> Ellipsoid:
    """Up to five dimensions, bounded, unbounded or flat."""
    dimension = int(rng.integers(1, 6))
    free = int(rng.integers(0, dimension + 1)) if rng.random() < 0.5 else 0
    zero = int(rng.integers(0, dimension - free + 1)) if flat and rng.random() < 0.3 else 0
    return random_ellipsoid(rng, dimension, free=free, flat=zero)


def sample(ellipsoid: Ellipsoid, count: int, rng: np.random.Generator) -> Floats:
    """(count, n) points of an ellipsoid, half of them on its boundary; far out along free directions."""
    known = np.isfinite(ellipsoid.semi_axes)
    number = int(known.sum())
    ball = rng.normal(size=(count, number))
    if number:
        ball /= np.linalg.norm(ball, axis=1, keepdims=True)
        ball[count // 2 :] *= rng.random((count - count // 2, 1)) ** (1 / number)
    along = np.zeros((count, ellipsoid.dimension))
    along[:, known] = ball * ellipsoid.semi_axes[known]
    along[:, ~known] = 10 * rng.normal(size=(count, ellipsoid.dimension - number))
    return ellipsoid.center + along @ ellipsoid.axes.T
