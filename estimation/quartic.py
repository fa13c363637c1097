"""Where a polynomial of degree up to four is negative on an interval.

No closed forms: the roots of each derivative bracket those of the one above, and inside a bracket Newton's steps are
kept from leaving it. That finds every root that rounding lets exist, whatever the sizes of the coefficients.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from estimation.kernel import kernel

Floats = NDArray[np.float64]


@kernel
def value(c: Floats, degree: int, x: float) -> float:
    """Σ c[i] xⁱ up to the degree."""
    total: float = c[degree]
    for i in range(degree - 1, -1, -1):
        total = total * x + c[i]
    return total


@kernel
def root_between(c: Floats, degree: int, low: float, high: float, rising: bool) -> float:
    """The root of a polynomial that changes its sign once between two points, from below to above zero if rising."""
    x = 0.5 * (low + high)
    for _ in range(80):
        total, slope = c[degree], 0.0
        for i in range(degree - 1, -1, -1):
            slope = slope * x + total
            total = total * x + c[i]
        if total == 0.0:
            return x
        if (total > 0.0) == rising:
            high = x
        else:
            low = x
        following = x - total / slope if slope != 0.0 else low
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - x) <= 1e-16 * (abs(low) + abs(high)) or following in (low, high):
            return following
        x = following
    return x


@kernel
def _roots(c: Floats, degree: int, turning: Floats, turns: int, low: float, high: float, found: Floats) -> int:
    """Roots strictly inside (low, high), ascending, given the turning points there; their number."""
    n = 0
    left, at_left = low, value(c, degree, low)
    for i in range(turns + 1):
        right = turning[i] if i < turns else high
        at_right = value(c, degree, right)
        if (at_left < 0.0) != (at_right < 0.0):
            found[n] = root_between(c, degree, left, right, at_right >= 0.0)
            n += 1
        left, at_left = right, at_right
    return n


@kernel
def negative_intervals(c: Floats, low: float, high: float, ends: Floats) -> int:
    """Ends of the intervals on which c₀ + c₁x + … + c₄x⁴ < 0, for a quartic that is not negative at low and high.

    Args:
        c: (5,) float.
        low: where to look.
        high: where to look; values at both that are negative by rounding count as zero.
        ends: (4,) float, receives the ends in ascending order, in pairs.

    Returns:
        0, 2 or 4.
    """
    c1 = np.array([c[1], 2.0 * c[2], 3.0 * c[3], 4.0 * c[4]])
    c2 = np.array([c1[1], 2.0 * c1[2], 3.0 * c1[3]])
    # The roots of the second derivative, a parabola, in the form that does not cancel.
    bends, turns = np.empty(2), np.empty(3)
    n = 0
    discriminant = c2[1] * c2[1] - 4.0 * c2[0] * c2[2]
    if discriminant > 0.0:
        half = -0.5 * (c2[1] + math.copysign(math.sqrt(discriminant), c2[1]))
        first = half / c2[2] if c2[2] != 0.0 else np.inf
        second = c2[0] / half if half != 0.0 else np.inf
        for root in (min(first, second), max(first, second)):
            if low < root < high:
                bends[n] = root
                n += 1
    n = _roots(c1, 3, bends, n, low, high, turns)
    count = 0
    left, inside = low, False
    for i in range(n + 1):
        right = turns[i] if i < n else high
        below = value(c, 4, right) < 0.0 if i < n else False
        if below != inside:
            ends[count] = root_between(c, 4, left, right, inside)
            count += 1
        left, inside = right, below
    return count
