"""One range, one prediction, one boundary, one decision: on runs of 40 ranges from a moving robot, ε = 0.5 m."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import cycle

import numpy as np

from estimation.information_control import covariance_direction, information_gradient
from estimation.look_ahead import Limits, look_ahead
from estimation.range_filter import RangeFilter
from estimation.spread import spread_points
from estimation.tight_set import TightSet

BOUND_M = 0.5
RANGES = 40


def cases() -> Iterator[tuple[str, float, Callable[[], object]]]:
    """Name, target in seconds, what to time."""
    rng = np.random.default_rng(1)
    target = np.array([3.0, 4.0])
    anchors = np.array([10.0, 0.0]) + np.cumsum(rng.uniform(-1, 1, (RANGES, 2)), axis=0)
    ranges = np.hypot(*(anchors - target).T) + rng.uniform(-BOUND_M, BOUND_M, RANGES)
    run = [(anchor, float(z)) for anchor, z in zip(anchors, ranges, strict=True)]

    def told(kind: type[RangeFilter] | type[TightSet]) -> RangeFilter | TightSet:
        held = kind()
        for anchor, z in run:
            held.measure(anchor, z, BOUND_M)
        return held

    yield f"{RANGES} ranges into the ellipsoid", RANGES * 25e-6, lambda: told(RangeFilter)
    yield f"{RANGES} ranges into the tight set", RANGES * 40e-6, lambda: told(TightSet)

    for kind, name in ((RangeFilter, "ellipsoid"), (TightSet, "tight set")):
        moving, heard = told(kind), cycle(run)

        def follow(moving: RangeFilter | TightSet = moving, heard: Iterator[tuple[object, float]] = heard) -> None:
            moving.predict(0.1)
            moving.measure(*next(heard), BOUND_M)

        yield f"prediction and range, {name}", 60e-6 + (25e-6 if kind is RangeFilter else 40e-6), follow

    early = RangeFilter()
    for anchor, z in run[:6]:
        early.measure(anchor, z, BOUND_M)
    ellipsoid, tight = told(RangeFilter), told(TightSet)
    assert isinstance(ellipsoid, RangeFilter)
    assert isinstance(tight, TightSet)
    yield "boundary of a feasible set after 6 ranges", 1e-3, lambda: early.feasible_set().regions
    yield "boundary of a feasible set after 40 ranges", 1e-3, lambda: ellipsoid.feasible_set().regions

    place = np.array([9.0, 1.0])
    center, covariance = tight.centroid, tight.covariance
    yield "direction: thesis' gradient", 200e-6, lambda: information_gradient(ellipsoid, place)
    yield "direction: covariance", 200e-6, lambda: covariance_direction(center, covariance, place)
    limits = Limits(step_m=1.0, bound_m=BOUND_M)

    def look(steps: int) -> object:
        return look_ahead(spread_points(tight.polygons, 64), place, limits, steps)

    yield "direction: 1 step ahead", 5e-3, lambda: look(1)
    yield "direction: 5 steps ahead", 5e-3, lambda: look(5)
    wide = TightSet()
    wide.measure(*run[0], BOUND_M)
    wide_points = spread_points(wide.polygons, 64)
    yield "direction: 5 steps ahead, after one range", 5e-3, lambda: look_ahead(wide_points, place, limits, 5)
