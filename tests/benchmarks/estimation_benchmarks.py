"""One range, one prediction, one boundary, one decision: on runs of 40 ranges from a moving robot, ε = 0.5 m.

References are other people's estimators, told the same ranges; see `tests.benchmarks.estimation_references`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import islice
from typing import Any

import numpy as np

from estimation.information_control import Limits, covariance_direction, information_gradient
from estimation.look_ahead import look_ahead
from estimation.range_filter import RangeFilter
from estimation.tight_set import TightSet
from tests.benchmarks.estimation_references import particle_filter, paving

BOUND_M = 0.5
RANGES = 40
MOVED_M = 0.1

Case = tuple[Any, ...]
"""As in `tests.benchmarks.__main__`."""


def ranges_of_a_walk(moved_m: float) -> Iterator[tuple[np.ndarray, float]]:
    """Without end, from a robot that keeps 5 to 15 m away from a target that stands, or walks so far between ranges."""
    rng = np.random.default_rng(1)
    target, heading, bearing, away = np.array([3.0, 4.0]), 0.0, -0.5, 9.0
    while True:
        anchor = target + away * np.array([np.cos(bearing), np.sin(bearing)])
        yield anchor, away + rng.uniform(-BOUND_M, BOUND_M)
        heading, bearing = heading + rng.normal(0.0, 0.2), bearing + rng.normal(0.0, 0.1)
        away = min(15.0, max(5.0, away + rng.normal(0.0, 0.5)))
        target = target + moved_m * np.array([np.cos(heading), np.sin(heading)])


def cases() -> Iterator[Case]:
    """All cases of the estimation."""
    run, walk = (list(islice(ranges_of_a_walk(moved_m), RANGES)) for moved_m in (0.0, MOVED_M))

    def told(kind: type[RangeFilter] | type[TightSet]) -> RangeFilter | TightSet:
        held = kind()
        for anchor, z in run:
            held.measure(anchor, z, BOUND_M)
        return held

    def follow(kind: type[RangeFilter] | type[TightSet]) -> None:
        held = kind()
        for anchor, z in walk:
            held.predict(MOVED_M)
            held.measure(anchor, z, BOUND_M)

    standing = _present(
        ("filterpy, 1000 particles", particle_filter(run, BOUND_M, 1000)),
        ("filterpy, 5000 particles", particle_filter(run, BOUND_M, 5000)),
        ("codac, boxes of 0.1 m", paving(run, BOUND_M, 0.1)),
    )
    walking = _present(("filterpy, 1000 particles", particle_filter(walk, BOUND_M, 1000, MOVED_M)))
    for kind, name, range_s in ((RangeFilter, "ellipsoid", 25e-6), (TightSet, "tight set", 40e-6)):
        yield f"{RANGES} ranges into the {name}", RANGES * range_s, partial(told, kind), *standing
        yield f"{RANGES} predictions and ranges, {name}", RANGES * (60e-6 + range_s), partial(follow, kind), *walking
        yield f"prediction of the {name}", 60e-6, _follower(kind)

    early = RangeFilter()
    for anchor, z in run[:6]:
        early.measure(anchor, z, BOUND_M)
    ellipsoid, tight, wide = told(RangeFilter), told(TightSet), TightSet()
    assert isinstance(ellipsoid, RangeFilter)
    assert isinstance(tight, TightSet)
    wide.measure(*run[0], BOUND_M)
    yield "boundary of a feasible set after 6 ranges", 1e-3, lambda: early.feasible_set().regions
    yield "boundary of a feasible set after 40 ranges", 1e-3, lambda: ellipsoid.feasible_set().regions

    place, limits = np.array([9.0, 1.0]), Limits(step_m=1.0, bound_m=BOUND_M)
    yield "direction: thesis' gradient", 200e-6, lambda: information_gradient(ellipsoid, place, limits)
    yield "direction: covariance", 200e-6, lambda: covariance_direction(tight, place, limits)
    yield "direction: 1 step ahead", 5e-3, lambda: look_ahead(tight, place, limits, 1)
    yield "direction: 5 steps ahead", 5e-3, lambda: look_ahead(tight, place, limits, 5)
    yield "direction: 5 steps ahead, after one range", 5e-3, lambda: look_ahead(wide, place, limits, 5)


def _present(*references: tuple[str, Callable[[], object] | None]) -> tuple[Any, ...]:
    """Names and works, one after the other, of the references that are there."""
    return tuple(part for reference in references if reference[1] is not None for part in reference)


def _follower(kind: type[RangeFilter] | type[TightSet]) -> Callable[[], float]:
    """Goes on following a walking target; says what one prediction takes, in the mean of twenty ranges."""
    moving, heard = kind(), ranges_of_a_walk(MOVED_M)

    def follow() -> float:
        spent = 0.0
        for anchor, z in islice(heard, 20):
            begin = time.perf_counter()
            moving.predict(MOVED_M)
            spent += time.perf_counter() - begin
            moving.measure(anchor, z, BOUND_M)
        return spent / 20

    follow()
    return follow
