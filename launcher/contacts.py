"""Discs that lay over each other, as far as recorded places can tell."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import TYPE_CHECKING, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from launcher.mission_trace import Trail

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

TOUCHING_M: Final = 1e-5
"""Discs that overlap by less touch: certificates are as exact as the map is."""


class Overlap(msgspec.Struct, frozen=True, kw_only=True):
    """Two discs that lay over each other."""

    peers: tuple[str, str]
    episodes: int
    seconds: float


def find_overlaps(
    trails: tuple[Trail, ...], places: Floats, there: Bools, times_s: Floats, lengths_s: Floats
) -> Iterator[Overlap]:
    """Pairs of robots and agent that lay over each other for certain; the base station takes no room.

    Between two records a body was somewhere on a way that its greatest speed allows, not farther than this from the
    straight between them: half the short axis of an ellipse about the two places. Who drove at full speed went
    straight; who turned, or stopped, may have been beside it, and is given the benefit of the doubt.

    Args:
        trails: of n peers.
        places: (t, n, 2) float, metres: where they were, interpolated.
        there: (t, n) bool: whether anything is known of that.
        times_s: (t,) float, mission time of each.
        lengths_s: (t,) float: how long each stands for, seconds.

    Complexity: O(t n²).
    """
    doubts_m = np.column_stack([_doubt(trail, times_s) for trail in trails])
    bodies = [index for index, trail in enumerate(trails) if trail.role != "base_station"]
    for i, j in combinations(bodies, 2):
        touching_m = trails[i].radius_m + trails[j].radius_m - doubts_m[:, i] - doubts_m[:, j] - TOUCHING_M
        over = (np.hypot(*(places[:, i] - places[:, j]).T) < touching_m) & there[:, i] & there[:, j]
        if over.any():
            episodes = int(over[0]) + int(np.count_nonzero(over[1:] & ~over[:-1]))
            yield Overlap(
                peers=(trails[i].peer, trails[j].peer), episodes=episodes, seconds=float(lengths_s[over].sum())
            )


def _doubt(trail: Trail, times_s: Floats) -> Floats:
    """How far a peer may have been from the straight between the records around each time: (t,) float, metres."""
    if len(trail.times_s) < 2:
        return np.zeros(len(times_s))
    straight_m = np.hypot(*np.diff(trail.positions, axis=0).T)
    farthest_m = np.maximum(trail.speed_m_s * np.diff(trail.times_s), straight_m)
    # Who is where it was has not moved: nobody goes and comes back within a control period.
    beside_m = np.where(straight_m > 0.0, 0.5 * np.sqrt(farthest_m**2 - straight_m**2), 0.0)
    between = np.clip(np.searchsorted(trail.times_s, times_s, side="right") - 1, 0, len(beside_m) - 1)
    return np.asarray(beside_m[between])
