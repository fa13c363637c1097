"""Something that is due at a steady rate, on a grid that neither drifts nor catches up after a pause."""

from __future__ import annotations

import math

EARLY_S = 1e-6
"""A wake-up this much before its time counts as in time: clocks round."""


class Rhythm:
    """Due at ``start_s`` and every ``period_s`` after it."""

    def __init__(self, period_s: float, start_s: float) -> None:
        self._period_s = period_s
        self._start_s = start_s
        self._beats = 0
        self.next_s = start_s
        """When it is due next."""

    def due(self, now_s: float) -> bool:
        """Whether it is due now; if so, its next time comes after now, and beats that were missed are skipped."""
        if now_s < self.next_s - EARLY_S:
            return False
        self._beats = max(self._beats, math.floor((now_s + EARLY_S - self._start_s) / self._period_s)) + 1
        self.next_s = self._start_s + self._beats * self._period_s
        return True
