"""One bounded range: what a measurement promises about the distance, and what a set says when it is told.

A range z with the bound ε says that the target is at a distance r₀ ≤ r ≤ r₁ of the anchor, r₀ = max(0, z − ε) and
r₁ = z + ε (Thesis §2.3; the lower end corrected: for z < ε the printed (z − ε)² excludes true ranges). Both ends are
padded by :data:`PADDING_M`. Noise that touches its bounds again and again leaves a set as thin as rounding, and without
the padding rounding alone would prove it empty.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, SupportsFloat

from numpy.typing import ArrayLike

PADDING_M = 1e-6
"""By how much an annulus is widened on either side."""

Bound = float | tuple[float, float]
"""ε in metres, or (below, above): the true distance lies in [z − below, z + above]."""


class BadRange(ValueError):
    """A measurement that says nothing; the text says which number and what to do."""


class NothingMeasured(ValueError):
    """A question about the set before its first range: nothing is known, and the whole plane is no answer."""


@dataclass(frozen=True, slots=True)
class MeasurementReport:
    """What a range did to a set.

    Attributes:
        accepted: the set has taken the range into account.
        redundant: it changed nothing.
        empty: no point of the set is at such a distance: the range, or one before it, breaks its bound.
        restarted: the set was thrown away and begun again from this range.
    """

    accepted: bool
    redundant: bool
    empty: bool
    restarted: bool


class Annulus(NamedTuple):
    """Where a range leaves the target: at distances from inner to outer of (x, y), metres, map frame, padded."""

    x: float
    y: float
    inner: float
    outer: float
    """Below 0 if no point is at such a distance."""


def annulus(anchor_xy: ArrayLike, range_m: float, bound_m: Bound) -> Annulus:
    """What a range leaves possible.

    Args:
        anchor_xy: (2,) float, metres, map frame.
        range_m: z, metres.
        bound_m: ε, or (below, above), metres.

    Raises:
        BadRange: a number is none or not finite, or a bound is negative.
    """
    try:
        below, above = map(float, bound_m if isinstance(bound_m, tuple) else (bound_m, bound_m))
    except (TypeError, ValueError):
        raise BadRange(f"a bound is a number or a pair (below, above) in metres, not {bound_m!r}") from None
    if not (isinstance(range_m, SupportsFloat) and math.isfinite(range_m)):
        raise BadRange(f"a range of {range_m} m says nothing: leave the measurement out")
    if not (0.0 <= below < math.inf and 0.0 <= above < math.inf):
        raise BadRange(f"the bound of a range must be finite and at least 0 m on either side, not {bound_m}")
    try:
        x, y = (float(value) for value in anchor_xy)  # type: ignore[union-attr,arg-type]
    except (TypeError, ValueError):
        raise BadRange(f"an anchor is a point (x, y) in metres, not {anchor_xy!r}") from None
    if not (math.isfinite(x) and math.isfinite(y)):
        raise BadRange(f"the anchor ({x}, {y}) is nowhere: give finite coordinates")
    return Annulus(x, y, max(0.0, float(range_m) - below - PADDING_M), float(range_m) + above + PADDING_M)


def moved_distance(distance_m: float) -> float:
    """A distance that a target may have moved, metres.

    Raises:
        BadRange: not finite, or negative.
    """
    if not 0.0 <= distance_m < math.inf:
        raise BadRange(f"a target moves a finite distance of at least 0 m, not {distance_m} m")
    return float(distance_m)
