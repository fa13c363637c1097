"""Ellipsoids as messages: 14 numbers and a time that stand for all ranges so far (spec E9).

Where ranges cannot be kept or sent, sets can. Fusion of two ellipsoids does not commute, and fusing what has been fused
before gains little, so peers that exchange ellipsoids do not end with the same one; but each fusion contains the
intersection, so each holds the target. On the same runs the area is 2.3 times that of a log of ranges.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation import range_cut
from estimation.ellipsoid import Ellipsoid, EmptyIntersection
from estimation.fusion import fuse
from estimation.range_filter import FilterSnapshot

Floats = NDArray[np.float64]


class NotASnapshot(ValueError):
    """Numbers from which no set can be made; the text says which and what to do."""


@dataclass(frozen=True)
class TimedSnapshot:
    """A set and when it held.

    Attributes:
        time_s: by the sender's clock, seconds of mission time.
        held: the set.
    """

    time_s: float
    held: FilterSnapshot


def predict_snapshot(
    snapshot: TimedSnapshot, time_s: float, speed_m_s: float, clock_bound_s: float = 0.0
) -> TimedSnapshot:
    """The set at another time, grown by v (|Δt| + clock bound).

    Args:
        snapshot: a set at a time of the sender's clock.
        time_s: a time of the receiver's clock, later or earlier.
        speed_m_s: v, the most that the target can walk.
        clock_bound_s: the most by which the two clocks differ; 0 for one's own.

    Raises:
        NotASnapshot: a number is not finite, or speed or bound negative.
    """
    distance = speed_m_s * (abs(time_s - snapshot.time_s) + clock_bound_s)
    if not (0 <= distance < math.inf and speed_m_s >= 0 and clock_bound_s >= 0):
        raise NotASnapshot(
            f"a set cannot be predicted from {snapshot.time_s} s to {time_s} s at {speed_m_s} m/s with clocks "
            f"{clock_bound_s} s apart: times must be finite, speed and bound at least 0"
        )
    state = _state(snapshot)
    if distance > 0:
        range_cut.grow(state, distance)
    return TimedSnapshot(time_s, _held(state))


def fuse_snapshots(
    own: TimedSnapshot, other: TimedSnapshot, speed_m_s: float = 0.0, clock_bound_s: float = 0.0
) -> TimedSnapshot | EmptyIntersection:
    """A set around what both leave, at the time of ``own``, which is on the receiver's clock.

    Both are brought into one frame at the first, fused by the thesis' family (§2.1.2), and tightened on the paraboloid.

    Returns:
        The set; EmptyIntersection when they have no common point: one of them does not hold the target.
    """
    moved = predict_snapshot(other, own.time_s, speed_m_s, clock_bound_s)
    first, second = _state(own), _state(moved)
    range_cut.recentre(first)
    dx, dy = first[0] - second[0], first[1] - second[1]
    range_cut.move_origin(second, dx, dy)
    sets = [Ellipsoid.from_factor(state[2:5], state[5:].reshape(3, 3)) for state in (first, second)]
    fused = fuse(sets[0], sets[1])
    if isinstance(fused, EmptyIntersection):
        return fused
    state = np.concatenate([first[:2], fused.center, fused.factor.ravel()])
    empty, _ = range_cut.tighten(state)
    if empty:
        return EmptyIntersection(-1.0)
    # Nearly equal sets come out of the family no smaller: keep one's own then.
    if range_cut.volume(state) >= range_cut.volume(first):
        return own
    return TimedSnapshot(own.time_s, _held(state))


def _state(snapshot: TimedSnapshot) -> Floats:
    held = snapshot.held
    state = np.array([*held.origin, *held.center, *held.factor], dtype=np.float64)
    if state.shape != (range_cut.STATE,) or not np.isfinite(state).all() or range_cut.volume(state) == 0:
        raise NotASnapshot(f"a snapshot is 14 finite numbers with a regular factor, not {held}: leave it out")
    return state


def _held(state: Floats) -> FilterSnapshot:
    numbers: list[float] = state.tolist()
    return FilterSnapshot((numbers[0], numbers[1]), (numbers[2], numbers[3], numbers[4]), tuple(numbers[5:]))
