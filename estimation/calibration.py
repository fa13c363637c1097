"""Calibration: from ranges at known positions, how a range is to be read, and how wrong it can then still be.

A range z is read as r = scale · z + offset, and the bound ε is such that |r − distance| ≤ ε. Everything the set filters
promise rests on ε: too large costs area, too small costs the promise, and the slack of an ellipsoid hides that (see
:mod:`estimation.containment_monitor`). So ε is measured, not guessed.

Two lines are offered, since two users want different things:

- ``"unbiased"``: least squares. Its errors average to zero, which is what the centre of a set and a least-squares
  position profit from. On Plaza 1, calibrated on the other beacons, positions by it are 0.04 m off, by the other 0.09.
- ``"narrowest"``: the line with the least ε there is, which is what areas profit from: a linear programme in (scale,
  offset, ε), minimise ε subject to |scale · zᵢ + offset − dᵢ| ≤ ε. It is decided by three extreme ranges.

Both are made robust in the same way. With ``coverage`` below 1 that share of the ranges is to be bounded and the rest
may be outliers: fit, keep the share that fits best, fit again, until the same are kept (concentration steps, P.
Rousseeuw and K. Van Driessen, doi:10.1007/s10618-005-0024-4; each step lowers the criterion, and the end is a local
minimum). The start is the repeated-median line, which half of the data cannot mislead (A. Siegel,
doi:10.1093/biomet/69.1.242).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

Line = Literal["unbiased", "narrowest"]

_MOST_MEDIANS = 400
"""The repeated median looks at all pairs: of more ranges than this, an even sample."""


class NotCalibrated(ValueError):
    """Data that say nothing about how to read a range; the text says why and what to do."""


@dataclass(frozen=True)
class Calibration:
    """How to read a range.

    Attributes:
        scale: true metres per measured metre.
        offset_m: added after scaling.
        bound_m: ε: no kept range was further off than this.
        kept: ranges that ε bounds.
        left_out: ranges that it does not (0 when the coverage is 1).
    """

    scale: float
    offset_m: float
    bound_m: float
    kept: int
    left_out: int

    def read(self, ranges: ArrayLike) -> Floats:
        """Distances that measured ranges stand for: (...) float, metres, at least 0."""
        return np.maximum(0.0, self.scale * np.asarray(ranges, dtype=np.float64) + self.offset_m)

    @property
    def risk(self) -> float:
        """Chance that the next range, drawn like the others, is outside ε.

        Of n + 1 exchangeable ranges each is equally likely to be the one that is furthest off: 1/(n + 1), whatever
        their distribution; and as many more as were left out. Ranges in a row are not exchangeable: take it as a size.
        """
        return (self.left_out + 1) / (self.kept + self.left_out + 1)


def calibrate(
    distances: ArrayLike,
    ranges: ArrayLike,
    *,
    line: Line = "unbiased",
    scale: float | None = None,
    coverage: float = 1.0,
) -> Calibration:
    """Scale, offset and bound of ranges, from data with known positions.

    Args:
        distances: (n,) float, metres: true distances.
        ranges: (n,) float, metres: what was measured.
        line: which line is wanted; see the module.
        scale: a known scale, so that the offset alone is learned (with data from too few distances, learn no scale).
        coverage: share of the ranges that ε is to bound, in (0.5, 1].

    Raises:
        NotCalibrated: fewer than 3 ranges, different numbers of them, a number that is not finite, a coverage that is
            no such share, a line of another name, or a scale asked of ranges that are all alike.

    Complexity: O(n) per step; the narrowest line O(n log n) or so (HiGHS).
    """
    d, z = np.asarray(distances, dtype=np.float64), np.asarray(ranges, dtype=np.float64)
    if d.shape != z.shape or d.ndim != 1 or len(d) < 3:
        raise NotCalibrated(
            f"calibration takes as many distances as ranges, and at least 3, not {d.shape} and {z.shape}"
        )
    if not (np.isfinite(d).all() and np.isfinite(z).all()):
        raise NotCalibrated("a distance or range is not a finite number: leave that measurement out")
    if line not in get_args(Line):
        raise NotCalibrated(f"the line is one of {', '.join(get_args(Line))}, not {line!r}")
    if not 0.5 < coverage <= 1:
        raise NotCalibrated(f"the coverage must be above 0.5 and at most 1, not {coverage}: most data must be right")
    if scale is None and np.ptp(z) < 1e-6 * (1 + np.abs(z).max()):
        raise NotCalibrated("all ranges are alike, which tells no scale: give the scale, or move between ranges")
    kept_count = math.ceil(coverage * len(z))
    fit = _fit_least_squares if line == "unbiased" else _fit_narrowest
    keep = np.arange(len(z))
    if kept_count < len(z):
        keep = _best(d, z, _repeated_median(d, z, scale), kept_count)
    for _ in range(100):
        slope, offset = fit(d[keep], z[keep], scale)
        best = _best(d, z, (slope, offset), kept_count)
        if np.array_equal(best, keep):
            break
        keep = best
    bound = float(np.abs(slope * z[keep] + offset - d[keep]).max())
    return Calibration(slope, offset, bound, kept_count, len(z) - kept_count)


def _best(d: Floats, z: Floats, fit: tuple[float, float], count: int) -> NDArray[np.intp]:
    """The ranges that fit best, in their own order."""
    off = np.abs(fit[0] * z + fit[1] - d)
    return np.sort(np.argsort(off, kind="stable")[:count])


def _fit_least_squares(d: Floats, z: Floats, scale: float | None) -> tuple[float, float]:
    if scale is not None:
        return scale, float(np.mean(d - scale * z))
    middle = z.mean()
    slope = float((z - middle) @ d / ((z - middle) @ (z - middle)))
    return slope, float(d.mean() - slope * middle)


def _fit_narrowest(d: Floats, z: Floats, scale: float | None) -> tuple[float, float]:
    if scale is not None:
        off = d - scale * z
        return scale, float(0.5 * (off.min() + off.max()))
    from scipy.optimize import linprog

    # Distances less ranges, about their middle: small numbers, for which the solver's tolerances are tight enough.
    middle, off = float(z.mean()), d - z
    ones = np.ones((len(z), 1))
    side = np.hstack([z[:, None] - middle, ones])
    constraints = np.vstack([np.hstack([side, -ones]), np.hstack([-side, -ones])])
    answer = linprog([0, 0, 1], A_ub=constraints, b_ub=np.concatenate([off, -off]), bounds=[(None, None)] * 3)
    slope, shift, _ = np.asarray(answer.x)
    return 1 + float(slope), float(shift - slope * middle)


def _repeated_median(d: Floats, z: Floats, scale: float | None) -> tuple[float, float]:
    if scale is None:
        some = np.linspace(0, len(z) - 1, min(len(z), _MOST_MEDIANS)).astype(int)
        across, up = z[some] - z[some][:, None], d[some] - d[some][:, None]
        slopes = np.full(across.shape, np.nan)
        np.divide(up, across, out=slopes, where=across != 0)
        some_differ = ~np.isnan(slopes).all(axis=1)
        scale = float(np.median(np.nanmedian(slopes[some_differ], axis=1)))
    return scale, float(np.median(d - scale * z))
