"""Cut: the ellipsoid of least volume around what a strip leaves of an ellipsoid, in closed form.

It takes the place of the thesis' search over λ (§2.1.2), and is smaller: the strip is clipped to the ellipsoid first.
In coordinates where the ellipsoid is the unit ball and the strip lo ≤ u·v ≤ hi, the smallest ellipsoid around the slab
of the ball has its centre on u and is round across it; with M, d the middle and half-width of [lo, hi],

    B = ½[(1 − lo²) + (1 − hi²)],  R = B + √(B² + 4(n² − 1)M²d²),  q = 2(n − 1)d² / R,  a² = M²q + R / (2(n − 1)) + B,

the centre is M(1 − q)u, the semi-axis along u is a√q and the others are a. The ball itself is the smallest if
lo · hi ≤ −1/n. These are the parallel cuts of the ellipsoid method: Bland, Goldfarb and Todd, "The ellipsoid method: a
survey", doi:10.1287/opre.29.6.1039.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from estimation.ellipsoid import EPSILON, Ellipsoid, EmptyIntersection, NotAnEllipsoid
from estimation.fusion import PADDING, fuse
from estimation.kernel import kernel
from estimation.strip import Strip

Floats = NDArray[np.float64]

CUT, REDUNDANT, EMPTY = 0, 1, 2

THINNEST = 1e-9
"""Half-width below which a slab of the unit ball is taken as this thick: what is flatter than that is lost in rounding
when it is turned."""


@dataclass(frozen=True)
class Cut:
    """What a strip did to an ellipsoid.

    Attributes:
        outcome: "cut"; "redundant": the ellipsoid itself is the smallest one around what is left; "empty": no point of
            the ellipsoid lies in the strip.
        ellipsoid: bounds all that is left; the ellipsoid as it was if redundant, None if empty.
        volume_ratio: volume after ÷ before, without directions that are free in both; 1 if redundant, 0 if empty or if
            a free direction became bounded.
        low: where the strip begins in units of the ellipsoid's reach along h: −1 and 1 are its ends; -inf if free.
        high: where it ends.
    """

    outcome: Literal["cut", "redundant", "empty"]
    ellipsoid: Ellipsoid | None
    volume_ratio: float
    low: float
    high: float


def cut(ellipsoid: Ellipsoid, strip: Strip) -> Cut:
    """The smallest ellipsoid around the part of an ellipsoid that lies in a strip or half-space.

    Directions that are free and along the strip stay free, and the cut is the closed form across them. A free direction
    that crosses the strip becomes bounded: the part is then a sheared product of an ellipsoid of r dimensions and an
    interval, whose smallest ellipsoid is the member λ = r / (r + 1) of the thesis' family; a half-space does nothing
    there, since no smaller ellipsoid contains what it leaves. O(n³).

    Args:
        ellipsoid: in n dimensions, unbounded or flat ones included.
        strip: in the same space.

    Raises:
        NotAnEllipsoid: different dimensions.
        FlatEllipsoid: a free direction crosses the strip, and the ellipsoid is flat or the strip has no width.
    """
    h = strip.direction
    if len(h) != ellipsoid.dimension:
        raise NotAnEllipsoid(f"a strip in {len(h)} dimensions cannot cut an ellipsoid in {ellipsoid.dimension}")
    if np.isinf(ellipsoid.support(h)):
        if np.isinf(strip.half_width):
            return Cut("redundant", ellipsoid, 1.0, -math.inf, math.inf)
        known = int(np.isfinite(ellipsoid.semi_axes).sum())
        bounded = fuse(ellipsoid, Ellipsoid.from_strip(strip), known / (known + 1))
        if isinstance(bounded, EmptyIntersection) or np.isfinite(bounded.semi_axes).sum() <= known:
            # It crosses at so small an angle that rounding cannot tell: nothing is lost by leaving it out.
            return Cut("redundant", ellipsoid, 1.0, -math.inf, math.inf)
        return Cut("cut", bounded, 0.0, -math.inf, math.inf)
    known_axes = np.isfinite(ellipsoid.semi_axes)
    wide = known_axes & (ellipsoid.semi_axes > 0)
    factor = ellipsoid.axes[:, wide] * ellipsoid.semi_axes[wide]
    outcome, ratio, low, high, center, smaller = cut_factor(ellipsoid.center, factor, h, strip.low, strip.high)
    if outcome == EMPTY:
        return Cut("empty", None, 0.0, low, high)
    if outcome == REDUNDANT:
        return Cut("redundant", ellipsoid, 1.0, low, high)
    part = Ellipsoid.from_generators(center, smaller, ellipsoid.axes[:, ~known_axes])
    return Cut("cut", part, ratio, low, high)


@kernel
def cut_factor(
    center: Floats, factor: Floats, direction: Floats, low: float, high: float
) -> tuple[int, float, float, float, Floats, Floats]:
    """The closed form above for {c + L v : |v| ≤ 1} and low ≤ h·x ≤ high. O(n r), r the columns of L.

    Args:
        center: (n,) float, c.
        factor: (n, r) float, L; r is the dimension of the ball, n of the formulas above.
        direction: (n,) float, h.
        low: may be -inf.
        high: may be inf.

    Returns:
        outcome (:data:`CUT`, :data:`REDUNDANT` or :data:`EMPTY`), volume ratio, lo and hi before clipping, centre (n,)
        and factor (n, r); the last two are the old ones unless cut, and otherwise enlarged by the fusion's padding.
    """
    n = factor.shape[1]
    u = factor.T @ direction
    reach = math.sqrt(np.dot(u, u))
    middle = np.dot(direction, center)
    # What rounding may have done to h·c and will do to the new centre; a set far from the origin and thinner than
    # that would be cut wrongly.
    rounding = 4.0 * EPSILON * len(center) * (np.dot(np.abs(direction), np.abs(center)) + reach)
    low, high = low - rounding, high + rounding
    if reach == 0.0:
        inside = low <= middle <= high
        return (REDUNDANT if inside else EMPTY), (1.0 if inside else 0.0), -np.inf, np.inf, center, factor
    first, last = (low - middle) / reach, (high - middle) / reach
    if first > 1.0 or last < -1.0:
        return EMPTY, 0.0, first, last, center, factor
    lo, hi = max(first, -1.0), min(last, 1.0)
    if lo * hi <= -1.0 / n:
        return REDUNDANT, 1.0, first, last, center, factor
    M, d = 0.5 * (lo + hi), 0.5 * (hi - lo)
    if d < THINNEST:
        M, d = min(max(M, THINNEST - 1.0), 1.0 - THINNEST), THINNEST
        lo, hi = M - d, M + d
    if n == 1:
        q, across, along = 0.0, 1.0, d
    else:
        B = 0.5 * ((1.0 - lo) * (1.0 + lo) + (1.0 - hi) * (1.0 + hi))
        R = B + math.sqrt(B * B + 4.0 * (n * n - 1.0) * M * M * d * d)
        q = 2.0 * (n - 1.0) * d * d / R
        across = math.sqrt(M * M * q + R / (2.0 * (n - 1.0)) + B)
        along = across * math.sqrt(q)
    along += rounding / reach
    ratio = across ** (n - 1) * along
    if ratio >= 1.0:
        return REDUNDANT, 1.0, first, last, center, factor
    u = u / reach
    pull = factor @ u
    moved = center + M * (1.0 - q) * pull
    smaller = np.empty_like(factor)
    for i in range(factor.shape[0]):
        for j in range(n):
            smaller[i, j] = (1.0 + PADDING) * (across * factor[i, j] - (across - along) * pull[i] * u[j])
    return CUT, ratio, first, last, moved, smaller
