"""Kernels: the ellipsoid of least volume around the Minkowski sum of two in three dimensions, as factors.

The sum of {L v} and {D v}, |v| ≤ 1, is bounded by (1 + 1/p) L Lᵀ + (1 + p) D Dᵀ for every p > 0. Its volume is least
where 3/(p(p + 1)) = Σ λᵢ/(1 + pλᵢ), λᵢ the eigenvalues of A Aᵀ with A = L⁻¹ D. (Kurzhanskiy and Varaiya, "Ellipsoidal
Toolbox", section 2.2.)
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from estimation.fusion import PADDING
from estimation.kernel import kernel

Floats = NDArray[np.float64]


@kernel
def enlarge(L: Floats, D: Floats) -> None:
    """Replace L (3, 3), regular, in place by a lower triangular factor of the bound for a diagonal D (3,) > 0."""
    p = summing_parameter(L, D)
    stacked = np.zeros((6, 3))
    for i in range(3):
        for j in range(3):
            stacked[j, i] = math.sqrt(1.0 + 1.0 / p) * L[i, j]
        stacked[3 + i, i] = math.sqrt(1.0 + p) * D[i]
    _triangularise(stacked)
    for i in range(3):
        for j in range(3):
            L[i, j] = (1.0 + PADDING) * stacked[j, i] if j <= i else 0.0


@kernel
def summing_parameter(L: Floats, D: Floats) -> float:
    """The p of least volume; λᵢ are the eigenvalues of A Aᵀ, A = L⁻¹ D with a diagonal D (3,).

    With the symmetric functions E₁, E₂, E₃ of λ, sums of squared minors of A, the condition reads
    3E₃p⁴ + 2E₂p³ + (E₁ − E₂)p² − 2E₁p − 3 = 0: one change of sign, so one positive root. The minors of A are those of
    L⁻¹ times entries of D: cofactors of L for one row and column, entries of L for two.
    """
    determinant = 0.0
    E1, E2 = 0.0, 0.0
    for i in range(3):
        for j in range(3):
            a, b, c, d = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            cofactor = L[a, c] * L[b, d] - L[a, d] * L[b, c]
            if i == 0:
                determinant += L[0, j] * cofactor
            E1 += (cofactor * D[i]) ** 2
            E2 += (L[i, j] * D[a] * D[b]) ** 2
    square = determinant * determinant
    E1, E2, E3 = E1 / square, E2 / square, (D[0] * D[1] * D[2]) ** 2 / square
    low, high = -60.0, 60.0
    for _ in range(52):
        middle = 0.5 * (low + high)
        p = math.exp(middle)
        if (((3.0 * E3 * p + 2.0 * E2) * p + E1 - E2) * p - 2.0 * E1) * p > 3.0:
            high = middle
        else:
            low = middle
    return math.exp(0.5 * (low + high))


@kernel
def _triangularise(A: Floats) -> None:
    """Householder QR of (m, n) in place: R above the diagonal, zeros below. Stable column by column."""
    m, n = A.shape
    v = np.empty(m)
    for k in range(n):
        length = 0.0
        for i in range(k, m):
            v[i] = A[i, k]
            length += v[i] * v[i]
        length = math.sqrt(length)
        v[k] += length if v[k] >= 0.0 else -length
        square = 0.0
        for i in range(k, m):
            square += v[i] * v[i]
        for j in range(k, n):
            along = 0.0
            for i in range(k, m):
                along += v[i] * A[i, j]
            along *= 2.0 / square
            for i in range(k, m):
                A[i, j] -= along * v[i]
