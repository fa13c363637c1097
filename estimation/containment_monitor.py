"""Containment monitor: tells from the ranges alone when the bound ε is too small.

Nobody sees the target, so nobody sees a broken promise. But what a wrong ε leaves behind can be seen: ranges that no
point of the set agrees with. With a right ε there are none, or as many as there are corrupt ranges. The monitor counts
them over a window of ranges, and says that ε is too small when more have come than the stated share of corrupt ranges
explains. It also says what ε would have done.

Watch the *tight* set: the slack of an ellipsoid swallows ranges that are a good deal outside their bounds.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

FALSE_ALARM = 1e-6
"""Chance of an alarm at any one range while the promise is kept. Windows overlap: over 10⁴ ranges, 1e-2 at most."""


class NotMonitored(ValueError):
    """A monitor cannot be set up so; the text says why and what to do."""


@dataclass(frozen=True)
class Verdict:
    """What the last ranges say about the bound.

    Attributes:
        too_small: ε is too small, or corrupt ranges are more frequent than was stated.
        contradictions: ranges in the window that no point of the set agreed with.
        ranges: ranges in the window.
        chance: how likely so many contradictions are if the promise is kept.
        suggested_bound_m: an ε with which the ranges of the window would have agreed with the sets they met, metres;
            a lower bound, since a wrong set has also misplaced the ones after. The largest ε in use when all agreed.
    """

    too_small: bool
    contradictions: int
    ranges: int
    chance: float
    suggested_bound_m: float


class ContainmentMonitor:
    """Counts contradictions over a window of ranges.

    Args:
        corrupt_share: share of ranges that may break their bound without ε being wrong, in [0, 0.5).
        window: ranges to look back over, at least 10.

    Raises:
        NotMonitored: a number is outside those limits.
    """

    def __init__(self, corrupt_share: float = 0.01, window: int = 200) -> None:
        if not 0 <= corrupt_share < 0.5 or window < 10:
            raise NotMonitored(
                f"a monitor needs a share of corrupt ranges in [0, 0.5) and a window of at least 10 ranges, "
                f"not {corrupt_share} and {window}"
            )
        self._corrupt_share = corrupt_share
        self._needed: deque[float] = deque(maxlen=window)
        self._bounds: deque[float] = deque(maxlen=window)

    def observe(self, range_m: float, bound_m: float, nearest_m: float, farthest_m: float) -> Verdict:
        """Compare one range with the set *before* it is told.

        Args:
            range_m: what was measured.
            bound_m: ε that it is taken with.
            nearest_m: least distance of the set from the anchor.
            farthest_m: greatest distance of it.

        Returns:
            The verdict over the window, this range included.

        Raises:
            NotMonitored: a number is not finite. It would count as agreement; the window is as it was.
        """
        if not all(map(math.isfinite, (range_m, bound_m, nearest_m, farthest_m))):
            raise NotMonitored(
                f"a range of {range_m} m ± {bound_m} m and a set {nearest_m} to {farthest_m} m away tell nothing: "
                "numbers must be finite, and the set have begun"
            )
        self._needed.append(max(nearest_m - range_m, range_m - farthest_m, 0.0))
        self._bounds.append(bound_m)
        return self.verdict()

    def verdict(self) -> Verdict:
        """What the window says now."""
        over = sum(needed > bound for needed, bound in zip(self._needed, self._bounds, strict=True))
        ranges = len(self._needed)
        chance = _at_least(over, ranges, self._corrupt_share)
        # Unexplained ranges only: the corrupt share may be as far off as it likes.
        forgiven = min(over, math.floor(self._corrupt_share * ranges))
        worst = sorted(self._needed, reverse=True)[forgiven : forgiven + 1]
        bound = max([*self._bounds, *worst], default=0.0)
        return Verdict(chance < FALSE_ALARM, over, ranges, chance, bound)


def _at_least(count: int, of: int, share: float) -> float:
    """Chance of at least so many successes of so many, each with the chance ``share``: the binomial tail."""
    if count == 0:
        return 1.0
    if share == 0.0:
        return 0.0
    logs = (
        math.lgamma(of + 1)
        - math.lgamma(k + 1)
        - math.lgamma(of - k + 1)
        + k * math.log(share)
        + (of - k) * math.log1p(-share)
        for k in range(count, of + 1)
    )
    return min(1.0, math.fsum(math.exp(log) for log in logs))
