"""How times grow: processor times, the shortest of some runs, fitted by straight lines in logarithms."""

from __future__ import annotations

import math
import os
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

RUNS = 3
"""Fewest runs that a time is the shortest of; the first is not counted."""

BUDGET_S = 0.05
"""Seconds until which further runs are made."""

MOST_RUNS = 30


@dataclass(frozen=True, slots=True)
class Fit:
    """A straight line through logarithms: y = factor · x^slope, or y = factor · slope^x."""

    slope: float
    """Exponent of the power law; the base of the exponential."""
    error: float
    """Standard error of the slope; nan for fewer than three points."""
    factor: float
    share: float
    """R²: how much of the variance of log y the line explains."""
    points: int


def fit_power(x: ArrayLike, y: ArrayLike) -> Fit:
    """Fit y = factor · x^slope by least squares in log x and log y.

    Args:
        x: (n,) positive, at least two different.
        y: (n,) positive.
    """
    slope, error, intercept, share, points = _fit_line(np.log(x), np.log(y))
    return Fit(slope, error, math.exp(intercept), share, points)


def fit_exponential(x: ArrayLike, y: ArrayLike) -> Fit:
    """Fit y = factor · slope^x by least squares in log y.

    Args:
        x: (n,), at least two different.
        y: (n,) positive.
    """
    slope, error, intercept, share, points = _fit_line(np.asarray(x, dtype=float), np.log(y))
    return Fit(math.exp(slope), error * math.exp(slope), math.exp(intercept), share, points)


def _fit_line(x: np.ndarray, y: np.ndarray) -> tuple[float, float, float, float, int]:
    """Slope, its standard error, intercept and R² of a line by least squares."""
    n = len(x)
    away = x - x.mean()
    spread = float(away @ away)
    slope = float(away @ y) / spread
    intercept = float(y.mean() - slope * x.mean())
    left = y - intercept - slope * x
    total = float((y - y.mean()) @ (y - y.mean()))
    error = math.sqrt(float(left @ left) / (n - 2) / spread) if n > 2 else math.nan
    return slope, error, intercept, 1.0 - float(left @ left) / total if total else 1.0, n


def shortest_time(work: Callable[[], object]) -> float:
    """Seconds of processor time that some work of one thread takes at its quickest.

    What else runs on the machine takes its turns between and is not counted, though it slows memory down. A first run,
    in which caches are filled, counts only where it alone takes more than a second.
    """
    begin = time.thread_time()
    work()
    first = time.thread_time() - begin
    if first > 1.0:
        return first
    times: list[float] = []
    while len(times) < RUNS or (sum(times) < BUDGET_S and len(times) < MOST_RUNS):
        begin = time.thread_time()
        work()
        times.append(time.thread_time() - begin)
    return min(times)


def describe_machine() -> str:
    """Processor, cores and Python, for what times are worth."""
    model = platform.processor() or platform.machine()
    known = Path("/proc/cpuinfo")
    if known.exists():
        names = [line for line in known.read_text(encoding="utf-8").splitlines() if line.startswith("model name")]
        model = names[0].partition(":")[2].strip() if names else model
    return f"{model}, {os.cpu_count()} cores, Python {platform.python_version()}, numpy {np.__version__}"
