"""Fusion: an ellipsoid around the intersection of two, from the thesis' one-parameter family (§2.1.2, eq. 5).

For every λ ∈ [0, 1] the points of both sets satisfy λ q₁ + (1 − λ) q₂ ≤ 1, q the quadratics of eq. 4, and this is the
ellipsoid X = λE₁ + (1 − λ)E₂, E = X / k. λ = 1 is the first set alone, λ = 0 the second. Ros, Sabater and Thomas,
"An ellipsoidal calculus based on propagation and fusion", IEEE Trans. SMC B 32(4), pp. 430–442, 2002.

*Emptiness.* k(λ) is convex with k(0) = k(1) = 1, and 1 − min k = max over λ of min over x of λ q₁ + (1 − λ) q₂, which
by the minimax theorem is min over x of max(q₁, q₂). So the two sets have no common point if, and only if, some
k(λ) < 0: the least k is looked for first, and the answer is then an EmptyIntersection, never a matrix E.

*Minimum volume where there is none.* With common free directions (E₁ + E₂ singular; fewer than n independent strips)
the volume is infinite for every λ and the thesis' choice undefined. The rule here: count the volume without the
directions that are free in both, in the r dimensions that are left: minimise (r/2) log k − ½ log det of X there. It is
the thesis' choice in the quotient by the common free directions, does not depend on coordinates, is continuous with the
regular case (r = n), and gives what one expects: the whole space fused with a set is that set, two crossing
strips get λ = ½, and r crossing strips fused with one more get λ = r / (r + 1) and k = 1.

The family is not the smallest ellipsoid around an intersection; for a strip that is :func:`estimation.strip_cut.cut`.
"""

from __future__ import annotations

import math
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from estimation.ellipsoid import EPSILON, Ellipsoid, EmptyIntersection, NotAnEllipsoid
from estimation.kernel import kernel

Floats = NDArray[np.float64]
Size: TypeAlias = Literal["volume", "trace"]

PADDING = 1e-10
"""Share by which bounding operations enlarge their result, against rounding."""


def fuse(
    first: Ellipsoid, second: Ellipsoid, weight: float | None = None, *, size: Size = "volume"
) -> Ellipsoid | EmptyIntersection:
    """An ellipsoid that contains every common point of two (thesis eq. 5), unbounded sets included.

    Args:
        first: ε(x₁, E₁) in n dimensions.
        second: ε(x₂, E₂).
        weight: λ, the first set's weight; None chooses the λ that makes the result smallest.
        size: what is smallest: the volume, or the trace of E⁻¹, which is the sum of the squared semi-axes; both
            without the directions that are free in the two sets.

    Returns:
        The ellipsoid, enlarged by :data:`PADDING`; or EmptyIntersection with the λ and k < 0 that prove that the two
        sets have no common point. With a given λ, k ≥ 0 proves nothing: an empty intersection may come out as a set.

    Raises:
        FlatEllipsoid: one of them has a semi-axis of length 0.
        NotAnEllipsoid: different dimensions, or λ outside [0, 1].
    """
    if weight is None:
        choice = choose_weight(first, second, size=size)
        return choice if isinstance(choice, EmptyIntersection) else fuse(first, second, choice)
    if not 0 <= weight <= 1:
        raise NotAnEllipsoid(f"the weight λ of a fusion must lie between 0 and 1, not at {weight}")
    _check_dimensions(first, second)
    # The first centre is the origin of the computation, so that large coordinates cancel only once.
    G2 = second.information
    rows = np.vstack([math.sqrt(weight) * first.information, math.sqrt(1 - weight) * G2])
    offset = second.center - first.center
    away = math.sqrt(1 - weight) * (G2 @ offset)
    fused = Ellipsoid.from_least_squares(rows, np.concatenate([np.zeros(len(rows) - len(away)), away]))
    if isinstance(fused, EmptyIntersection):
        return EmptyIntersection(fused.k, weight)
    return Ellipsoid(first.center + fused.center, fused.axes, fused.semi_axes * (1 + PADDING))


def choose_weight(first: Ellipsoid, second: Ellipsoid, *, size: Size = "volume") -> float | EmptyIntersection:
    """The λ of eq. 5 that gives the smallest ellipsoid, or the proof that two ellipsoids have no common point.

    In the coordinates that make E₁ + E₂ the identity and E₁ diagonal, X is diagonal for all λ, and one evaluation costs
    O(n); about 170 of them, by golden sections over log(λ / (1 − λ)). See :func:`fuse` for arguments and errors.
    """
    _check_dimensions(first, second)
    G1, G2 = first.information, second.information
    left, sigma, right = np.linalg.svd(np.vstack([G1, G2]), full_matrices=False)
    known = sigma > 4 * max(left.shape) * EPSILON * sigma.max(initial=0.0)
    left, sigma, right = left[:, known], sigma[known], right[known]
    # The cosine-sine split: rows of E₁ and E₂ in these coordinates have squares that add up to the identity.
    _, cosines, turn = np.linalg.svd(left[: len(G1)])
    shares = np.zeros(len(sigma))
    shares[: len(cosines)] = np.minimum(cosines**2, 1.0)
    other = np.sum((left[len(G1) :] @ turn.T) ** 2, axis=0)
    distances = turn @ (sigma * (right @ (second.center - first.center)))
    spreads = np.sum((turn / sigma) ** 2, axis=1)
    weight, k = _search_weight(shares, other, distances**2, spreads, size == "trace")
    if k < -1e-12:
        return EmptyIntersection(k, weight)
    return float(weight)


def _check_dimensions(first: Ellipsoid, second: Ellipsoid) -> None:
    if first.dimension != second.dimension:
        raise NotAnEllipsoid(
            f"ellipsoids of {first.dimension} and {second.dimension} dimensions have no common space: "
            "bring both into one by image or preimage"
        )


@kernel
def _k_and_size(
    weight: float, rest: float, first: Floats, second: Floats, squares: Floats, spreads: Floats, trace: bool
) -> tuple[float, float]:
    """The k of eq. 5, and the logarithm of the size, up to a constant, for λ = weight and 1 − λ = rest."""
    k, log_determinant, total = 1.0, 0.0, 0.0
    for i in range(len(first)):
        entry = weight * first[i] + rest * second[i]
        if entry <= 0.0:
            return k, np.inf
        k -= weight * rest * squares[i] * first[i] * second[i] / entry
        log_determinant += math.log(entry)
        total += spreads[i] / entry
    if k <= 0.0:
        return k, -np.inf
    if trace:
        return k, math.log(k) + math.log(total) if len(first) > 0 else 0.0
    return k, len(first) * math.log(k) - log_determinant


@kernel
def _golden(
    first: Floats, second: Floats, squares: Floats, spreads: Floats, trace: bool, column: int
) -> tuple[float, float]:
    """Least k (column 0) or size (column 1) by golden sections over θ = log(λ / (1 − λ)): θ and the value there.

    k is convex in λ, and the volume has one minimum (Ros et al., theorem 3), so that both have one in θ as well.
    """
    ratio = 0.5 * (math.sqrt(5.0) - 1.0)
    low, high = -36.0, 36.0
    a, b = high - ratio * (high - low), low + ratio * (high - low)
    rest_a, rest_b = 1.0 / (1.0 + math.exp(a)), 1.0 / (1.0 + math.exp(b))
    at_a = _k_and_size(1.0 / (1.0 + math.exp(-a)), rest_a, first, second, squares, spreads, trace)[column]
    at_b = _k_and_size(1.0 / (1.0 + math.exp(-b)), rest_b, first, second, squares, spreads, trace)[column]
    while high - low > 1e-9:
        if at_a < at_b:
            high, b, at_b = b, a, at_a
            a = high - ratio * (high - low)
            rest = 1.0 / (1.0 + math.exp(a))
            at_a = _k_and_size(1.0 / (1.0 + math.exp(-a)), rest, first, second, squares, spreads, trace)[column]
        else:
            low, a, at_a = a, b, at_b
            b = low + ratio * (high - low)
            rest = 1.0 / (1.0 + math.exp(b))
            at_b = _k_and_size(1.0 / (1.0 + math.exp(-b)), rest, first, second, squares, spreads, trace)[column]
    if at_a < at_b:
        return a, at_a
    return b, at_b


@kernel
def _search_weight(first: Floats, second: Floats, squares: Floats, spreads: Floats, trace: bool) -> tuple[float, float]:
    """λ of the smallest ellipsoid and its k; or, where the least k is negative, that λ and k."""
    middle, least = _golden(first, second, squares, spreads, trace, 0)
    if least < -1e-12:
        return 1.0 / (1.0 + math.exp(-middle)), least
    best, size = _golden(first, second, squares, spreads, trace, 1)
    weight = 1.0 / (1.0 + math.exp(-best))
    k = _k_and_size(weight, 1.0 - weight, first, second, squares, spreads, trace)[0]
    # The ends are the sets themselves, and the answer wherever one lies in the other.
    for end in (1.0, 0.0):
        at_end = _k_and_size(end, 1.0 - end, first, second, squares, spreads, trace)[1]
        if at_end <= size + 1e-12:
            weight, k, size = end, 1.0, at_end
    return weight, k
