"""The closed form against numerical minimum-volume ellipsoids, and as an outer bound of what the strip leaves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from estimation.ellipsoid import Ellipsoid, NotAnEllipsoid
from estimation.fusion import fuse
from estimation.strip import Strip
from estimation.strip_cut import cut
from tests.estimation.ellipsoids import random_ellipsoid, random_kind, sample

SEEDS = st.integers(0, 100_000)


def smallest_around_slab(n: int, lo: float, hi: float) -> float:
    """Volume, in unit balls, of the smallest ellipsoid of revolution around {|v| ≤ 1, lo ≤ v₁ ≤ hi}, by search.

    With its centre at τ and semi-axis α along the axis, points at height t force the other semi-axis to be at least
    √((1 − t²) / (1 − ((t − τ) / α)²)); two searches, one inside the other. Convexity and symmetry make it round.
    """
    heights = np.linspace(lo, hi, 4001)

    def volume(tau: float, alpha: float) -> float:
        room = 1 - ((heights - tau) / alpha) ** 2
        if room.min() <= 0:
            return 1e6 * (1 - float(room.min()))
        return float(((1 - heights**2) / room).max() ** ((n - 1) / 2) * alpha)

    def best_for(tau: float) -> float:
        least = max(hi - tau, tau - lo)
        return float(
            minimize_scalar(
                lambda log: volume(tau, least * (1 + math.exp(log))),
                bounds=(-25, 3),
                method="bounded",
                options={"xatol": 1e-9},
            ).fun
        )

    found = minimize_scalar(best_for, bounds=(lo, hi), method="bounded", options={"xatol": 1e-9})
    return float(found.fun)


def khachiyan(points: np.ndarray) -> float:
    """Volume, in unit balls, of the minimum-volume ellipsoid of points; a dual ascent, within 1e-4 from below."""
    count, n = points.shape
    lifted = np.column_stack([points, np.ones(count)])
    weights = np.full(count, 1 / count)
    for _ in range(4000):
        scores = np.einsum("pi,ij,pj->p", lifted, np.linalg.inv(lifted.T * weights @ lifted), lifted)
        if scores.max() < (1 + 1e-5) * (n + 1):
            break
        weights *= scores / (n + 1)
    center = weights @ points
    return float(np.sqrt(np.linalg.det(n * ((points.T * weights) @ points - np.outer(center, center)))))


@pytest.mark.parametrize("n", [2, 3, 5])
@pytest.mark.parametrize(("lo", "hi"), [(-0.2, 0.1), (0.1, 0.6), (-0.05, 1.0), (0.7, 0.71), (-0.9, -0.3), (0.5, 1.0)])
def test_volume_is_the_least_there_is(n: int, lo: float, hi: float) -> None:
    result = cut(Ellipsoid.ball(np.zeros(n), 1.0), Strip(np.eye(n)[1], lo, hi))
    assert result.ellipsoid is not None
    expected = smallest_around_slab(n, lo, hi)
    assert result.volume_ratio <= expected * (1 + 1e-7)
    assert result.volume_ratio == pytest.approx(expected, rel=1e-3)
    assert result.ellipsoid.volume == pytest.approx(result.volume_ratio * Ellipsoid.ball(np.zeros(n), 1.0).volume)


@pytest.mark.parametrize("n", [2, 3])
def test_no_other_shape_is_smaller(n: int) -> None:
    """Sampled points of the rest have a minimum-volume ellipsoid of any shape; ours is that much and no more."""
    rng = np.random.default_rng(n)
    ellipsoid = random_ellipsoid(rng, n)
    h = rng.normal(size=n)
    low, high = ellipsoid.center @ h + np.array([0.1, 0.4]) * (ellipsoid.support(h) - ellipsoid.center @ h)
    strip = Strip(h, low, high)
    # Points of the boundary in slices, the two rims included: the smallest ellipsoid touches only there.
    u = ellipsoid.factor.T @ h
    u /= np.linalg.norm(u)
    across = np.linalg.svd(u[:, None])[0][:, 1:]
    circle = rng.normal(size=(150, n - 1)) if n > 2 else np.array([[1.0], [-1.0]])
    circle /= np.linalg.norm(circle, axis=1, keepdims=True)
    heights = np.linspace(0.1, 0.4, 9)
    ball = [t * u + math.sqrt(1 - t * t) * circle @ across.T for t in heights]
    points = ellipsoid.center + np.concatenate(ball) @ ellipsoid.factor.T
    result = cut(ellipsoid, strip)
    assert result.ellipsoid is not None
    assert result.ellipsoid.contains(points).all()
    units = Ellipsoid.ball(np.zeros(n), 1.0).volume
    ratio = result.ellipsoid.volume / units / khachiyan(points)
    assert 1 - 1e-6 <= ratio <= 1.01


@given(seed=SEEDS)
@settings(deadline=None, max_examples=200)
def test_cut_contains_what_the_strip_leaves(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ellipsoid = random_kind(rng)
    h = rng.normal(size=ellipsoid.dimension)
    if rng.random() < 0.3:
        h -= ellipsoid.axes[:, np.isinf(ellipsoid.semi_axes)] @ (ellipsoid.axes[:, np.isinf(ellipsoid.semi_axes)].T @ h)
    if np.linalg.norm(h) < 0.1 or ((ellipsoid.semi_axes == 0).any() and np.isinf(ellipsoid.support(h))):
        return
    points = sample(ellipsoid, 200, rng)
    low, high = np.sort(points[:2] @ h)
    low, high = (low, high) if rng.random() < 0.7 and high - low > 1e-6 else (low, np.inf)
    result = cut(ellipsoid, Strip(h, low, high))
    left = points[(points @ h >= low) & (points @ h <= high)]
    assert result.outcome != "empty"
    assert result.ellipsoid is not None
    assert result.ellipsoid.contains(left, 1e-6).all()
    assert 0 <= result.volume_ratio <= 1
    if np.isfinite(ellipsoid.log_volume):
        change = result.ellipsoid.log_volume - ellipsoid.log_volume
        assert change == pytest.approx(math.log(result.volume_ratio), abs=1e-6)


@given(seed=SEEDS)
@settings(deadline=None, max_examples=60)
def test_cut_is_never_larger_than_the_best_fusion(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ellipsoid = random_ellipsoid(rng, int(rng.integers(2, 6)))
    h = rng.normal(size=ellipsoid.dimension)
    low, high = np.sort(sample(ellipsoid, 2, rng) @ h)
    if high - low > 1e-6:
        fused = fuse(ellipsoid, Ellipsoid.from_strip(Strip(h, low, high)))
        result = cut(ellipsoid, Strip(h, low, high))
        assert isinstance(fused, Ellipsoid)
        assert result.ellipsoid is not None
        assert result.ellipsoid.log_volume <= fused.log_volume + 1e-7


def test_outcomes() -> None:
    ball = Ellipsoid.ball([1.0, 0.0, 0.0], 2.0)
    beside = cut(ball, Strip([1, 0, 0], 3.1, 4.0))  # type: ignore[arg-type]
    assert (beside.outcome, beside.ellipsoid, beside.volume_ratio) == ("empty", None, 0.0)
    assert (beside.low, beside.high) == pytest.approx((1.05, 1.5))
    around = cut(ball, Strip([2, 0, 0], -5.0, 7.0))  # type: ignore[arg-type]
    assert (around.outcome, around.volume_ratio) == ("redundant", 1.0)
    assert around.ellipsoid is ball
    # lo · hi ≤ −1/n: the strip cuts the ball, and still no smaller ellipsoid holds the rest.
    assert cut(ball, Strip([1, 0, 0], -0.2, 2.2)).outcome == "redundant"  # type: ignore[arg-type]
    assert cut(ball, Strip([1, 0, 0], -0.1, 2.1)).outcome == "cut"  # type: ignore[arg-type]
    touching = cut(ball, Strip([1, 0, 0], 3.0, 4.0))  # type: ignore[arg-type]
    assert touching.ellipsoid is not None
    assert touching.ellipsoid.contains([3.0, 0.0, 0.0])
    half = cut(ball, Strip([1, 0, 0], 1.0, np.inf))  # type: ignore[arg-type]
    assert half.volume_ratio == pytest.approx(27 / 32)  # the half-ball of three dimensions, known in closed form


def test_intervals_are_cut_exactly() -> None:
    result = cut(Ellipsoid.ball([1.0], 2.0), Strip([2.0], 1.0, 100.0))  # type: ignore[arg-type]
    assert result.ellipsoid is not None
    assert result.ellipsoid.bounding_box() == (pytest.approx([0.5]), pytest.approx([3.0]))


def test_free_directions() -> None:
    slab = Ellipsoid.strip([1, 0, 0], 0.0, 1.0)
    across = cut(slab, Strip([1, 0, 0], 0.5, 9.0))  # type: ignore[arg-type]
    assert across.ellipsoid is not None
    assert across.ellipsoid.semi_axes == pytest.approx([np.inf, np.inf, 0.25])
    assert across.volume_ratio == pytest.approx(0.25)
    crossing = cut(slab, Strip([0, 1, 0], 0.0, 2.0))  # type: ignore[arg-type]
    assert crossing.ellipsoid is not None
    assert crossing.ellipsoid.semi_axes == pytest.approx([np.inf, math.sqrt(2), math.sqrt(2)])
    assert cut(slab, Strip([0, 1, 0], 0.0, np.inf)).outcome == "redundant"  # type: ignore[arg-type]
    assert cut(slab, Strip([1, 0, 0], 1.5, np.inf)).outcome == "empty"  # type: ignore[arg-type]


@pytest.mark.parametrize("angle", [10.0**-k for k in range(2, 12)])
def test_a_strip_almost_along_the_free_direction_loses_nothing(angle: float) -> None:
    slab = Ellipsoid.strip([1, 0], 0.0, 1e-6)
    result = cut(slab, Strip([1, angle], 5.0, 6.0))  # type: ignore[arg-type]
    assert result.ellipsoid is not None
    assert result.ellipsoid.contains([[0.0, 5.0 / angle], [0.0, 6.0 / angle]], 1e-3).all()


def test_flat_sets_stay_flat() -> None:
    disc = Ellipsoid.from_factor([0, 0, 1.0], [[1.0, 0], [0, 1.0], [0, 0]])
    result = cut(disc, Strip([1, 0, 5], 5.0, 6.0))  # type: ignore[arg-type]
    assert result.ellipsoid is not None
    assert result.ellipsoid.semi_axes[-1] == 0
    # In its own plane it is the half-disc of two dimensions: 4 / (3√3) of the area.
    assert result.volume_ratio == pytest.approx(4 / (3 * math.sqrt(3)))
    assert cut(disc, Strip([0, 0, 1], 1.0, 2.0)).outcome == "redundant"  # type: ignore[arg-type]
    assert cut(disc, Strip([0, 0, 1], 1.1, 2.0)).outcome == "empty"  # type: ignore[arg-type]


def test_thousands_of_cuts_around_one_point_never_lose_it() -> None:
    rng = np.random.default_rng(9)
    point = np.array([5e5, -3e5, 2e5, 7.0])
    ellipsoid = Ellipsoid.ball(point + 0.3, 10.0)
    for _ in range(400):
        h = rng.normal(size=4)
        width = 10 ** rng.uniform(-4, 0)
        offset = rng.choice([-1, 1]) * width
        result = cut(ellipsoid, Strip(h, h @ point - width + offset, h @ point + width + offset))
        assert result.ellipsoid is not None
        ellipsoid = result.ellipsoid
        assert ellipsoid.contains(point, 1e-6)
    assert ellipsoid.semi_axes.max() < 0.1


def test_bad_input_is_refused_in_a_sentence() -> None:
    with pytest.raises(NotAnEllipsoid, match="2 dimensions cannot cut"):
        cut(Ellipsoid.ball([0, 0, 0], 1), Strip([1, 0], 0, 1))  # type: ignore[arg-type]
