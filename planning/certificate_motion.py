"""Two members of a schedule on common times, between which both move evenly.

Part of the certificate, and written apart from all planners.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel

Floats = NDArray[np.float64]


@kernel
def _interpolate(times: Floats, points: Floats, at: Floats) -> Floats:
    """Places (n, 2) at the rising times ``at`` (n,): those of the waypoints exactly, still before and after them."""
    places = np.empty((at.shape[0], 2))
    last = times.shape[0] - 1
    i = 0
    for k in range(at.shape[0]):
        while i < last and times[i + 1] <= at[k]:
            i += 1
        share = 0.0
        if i < last and at[k] > times[i]:
            share = (at[k] - times[i]) / (times[i + 1] - times[i])
        j = min(i + 1, last)
        places[k, 0] = points[i, 0] + share * (points[j, 0] - points[i, 0])
        places[k, 1] = points[i, 1] + share * (points[j, 1] - points[i, 1])
    return places


@kernel
def join_motions(
    times_p: Floats, points_p: Floats, times_q: Floats, points_q: Floats, start: float, end: float
) -> tuple[Floats, Floats, Floats]:
    """Two paths on the times of both.

    Args:
        times_p: (m,) float, seconds, rising.
        points_p: (m, 2) float, metres: waypoints at these times.
        times_q: (n,) the same of the other.
        points_q: (n, 2).
        start: of the schedule, seconds: no later than any of these times.
        end: of the schedule: no earlier.

    Returns:
        times: (l,) float, rising, l ≥ 2, from ``start`` to ``end``; twice the same if these are one instant.
        places_p: (l, 2) float, metres.
        places_q: (l, 2) float, metres.

    Complexity: O(m + n).
    """
    times = np.empty(times_p.shape[0] + times_q.shape[0] + 2)
    times[0] = start
    n = 1
    i = j = 0
    while i < times_p.shape[0] or j < times_q.shape[0]:
        if j == times_q.shape[0] or (i < times_p.shape[0] and times_p[i] <= times_q[j]):
            following = times_p[i]
            i += 1
        else:
            following = times_q[j]
            j += 1
        if following > times[n - 1]:
            times[n] = following
            n += 1
    if end > times[n - 1] or n == 1:
        times[n] = end
        n += 1
    times = times[:n].copy()
    return times, _interpolate(times_p, points_p, times), _interpolate(times_q, points_q, times)
