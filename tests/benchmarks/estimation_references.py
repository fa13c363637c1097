"""The benchmark's ranges, told to other people's estimators: filterpy's particle filter and codac's paving.

Neither is a dependency; ``make bench`` installs them, of the versions in ``references.lock``, where they install. What
is not there, or does not load, gives no row, and a line says so.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Sequence
from types import ModuleType

import numpy as np

Heard = Sequence[tuple[np.ndarray, float]]
"""Ranges: from where, how far, metres."""


def optional_module(name: str) -> ModuleType | None:
    """A module that need not be there, and a line on standard error if it is not."""
    try:
        return importlib.import_module(name)
    except ImportError as problem:
        package = name.partition(".")[0]
        print(f"no comparison with {package}: {problem}; pip install --no-deps {package}", file=sys.stderr)
        return None


def particle_filter(
    heard: Heard, bound_m: float, particles: int, moved_m: float = 0.0
) -> Callable[[], np.ndarray] | None:
    """Sampling, importance, resampling: filterpy's own pieces put together as its book does; returns the mean.

    Errors even in ±ε are given as a normal of the same variance; particles begin on the ring of the first range.
    """
    monte_carlo = optional_module("filterpy.monte_carlo")
    if monte_carlo is None:
        return None

    def follow() -> np.ndarray:
        rng = np.random.default_rng(0)
        (anchor, z), *rest = heard
        turns, radii = rng.uniform(0.0, 2.0 * np.pi, particles), z + rng.uniform(-bound_m, bound_m, particles)
        cloud = anchor + radii[:, None] * np.column_stack([np.cos(turns), np.sin(turns)])
        weights = np.full(particles, 1.0 / particles)
        for anchor, z in rest:
            # A target that stands is given a little noise too, or all particles soon are one.
            cloud = cloud + rng.normal(0.0, max(moved_m, 0.1 * bound_m), cloud.shape)
            miss = np.hypot(cloud[:, 0] - anchor[0], cloud[:, 1] - anchor[1]) - z
            weights = weights * np.exp(-1.5 * (miss / bound_m) ** 2) + 1e-300
            weights /= weights.sum()
            if 1.0 / np.sum(weights**2) < particles / 2:
                cloud = cloud[monte_carlo.systematic_resample(weights)]
                weights = np.full(particles, 1.0 / particles)
        return np.asarray(weights @ cloud)

    return follow


def paving(heard: Heard, bound_m: float, finest_m: float) -> Callable[[], object] | None:
    """The intersection of all rings, paved with boxes down to a size."""
    codac = optional_module("codac")
    if codac is None:
        return None

    def pave() -> object:
        place, contractor = codac.VectorVar(2), None
        for anchor, z in heard:
            x, y = map(float, anchor)
            squared = codac.AnalyticFunction([place], codac.sqr(place[0] - x) + codac.sqr(place[1] - y))
            ring = codac.CtcInverse(squared, codac.Interval(max(0.0, z - bound_m) ** 2, (z + bound_m) ** 2))
            contractor = ring if contractor is None else contractor & ring
        (x, y), reach = map(float, heard[0][0]), heard[0][1] + bound_m
        box = codac.IntervalVector([[x - reach, x + reach], [y - reach, y + reach]])
        return codac.pave(box, contractor, finest_m)

    return pave
