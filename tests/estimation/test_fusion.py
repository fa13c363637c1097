"""Fusion against eq. 5 written out, a scalar minimiser, sampled points, and pairs whose distance is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from estimation.ellipsoid import Ellipsoid, EmptyIntersection, FlatEllipsoid, NotAnEllipsoid
from estimation.fusion import choose_weight, fuse
from tests.estimation.ellipsoids import random_ellipsoid, random_kind, sample

SEEDS = st.integers(0, 100_000)


def equation_5(first: Ellipsoid, second: Ellipsoid, weight: float) -> tuple[float, np.ndarray, np.ndarray]:
    """k, x₀ and X as printed, for regular X."""
    E1, E2, x1, x2 = first.inverse_shape, second.inverse_shape, first.center, second.center
    X = weight * E1 + (1 - weight) * E2
    inverse = np.linalg.inv(X)
    k = 1 - weight * (1 - weight) * (x2 - x1) @ E2 @ inverse @ E1 @ (x2 - x1)
    return k, inverse @ (weight * E1 @ x1 + (1 - weight) * E2 @ x2), X


def overlapping(rng: np.random.Generator, *, free: tuple[int, int] = (0, 0)) -> tuple[Ellipsoid, Ellipsoid, np.ndarray]:
    """Two ellipsoids with a common point, and that point."""
    n = int(rng.integers(max(1, *free), 6))
    first = random_ellipsoid(rng, n, free=free[0])
    second = random_ellipsoid(rng, n, free=free[1])
    common = sample(first, 4, rng)[-1]
    shift = common - sample(second, 4, rng)[-1]
    return first, Ellipsoid(second.center + shift, second.axes, second.semi_axes), common


def common_points(first: Ellipsoid, second: Ellipsoid, known: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Points of both: where segments from a known common point leave one of them, and what samples hit."""
    points = np.concatenate([sample(first, 60, rng), sample(second, 60, rng)])
    shares = np.linspace(0, 1, 60)[:, None, None]
    along = (known + shares * (points - known)).reshape(-1, len(known))
    return along[first.contains(along, 0.0) & second.contains(along, 0.0)]


@given(seed=SEEDS, free=st.tuples(st.integers(0, 2), st.integers(0, 2)), trace=st.booleans())
@settings(deadline=None, max_examples=120)
def test_fusion_contains_every_common_point(seed: int, free: tuple[int, int], trace: bool) -> None:
    rng = np.random.default_rng(seed)
    first, second, known = overlapping(rng, free=free)
    points = common_points(first, second, known, rng)
    fused = [fuse(first, second, size="trace" if trace else "volume")]
    fused += [fuse(first, second, weight) for weight in (0.0, 0.3, 0.999, 1.0)]
    for ellipsoid in fused:
        assert isinstance(ellipsoid, Ellipsoid)
        assert ellipsoid.contains(points, 1e-6).all()
    best = fused[0]
    assert isinstance(best, Ellipsoid)
    if not trace:
        smaller = min(first.log_volume, second.log_volume)
        assert best.log_volume <= smaller + 1e-6 or np.isinf(smaller)


@given(seed=SEEDS, weight=st.floats(0.01, 0.99))
@settings(deadline=None, max_examples=80)
def test_given_weight_is_equation_5(seed: int, weight: float) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 6))
    first, second = random_ellipsoid(rng, n, away=0.5), random_ellipsoid(rng, n, away=0.5)
    k, x0, X = equation_5(first, second, weight)
    fused = fuse(first, second, weight)
    if k < 0:
        assert isinstance(fused, EmptyIntersection)
        assert fused.k == pytest.approx(k, rel=1e-6)
        assert fused.weight == weight
    else:
        assert isinstance(fused, Ellipsoid)
        assert fused.center == pytest.approx(x0, rel=1e-6, abs=1e-6)
        assert fused.inverse_shape == pytest.approx(X / k, rel=1e-6, abs=1e-6 * np.abs(X).max() / k)


@given(seed=SEEDS, trace=st.booleans())
@settings(deadline=None, max_examples=60)
def test_chosen_weight_is_the_best_of_the_family(seed: int, trace: bool) -> None:
    rng = np.random.default_rng(seed)
    first, second, _ = overlapping(rng)

    def size(weight: float) -> float:
        k, _, X = equation_5(first, second, weight)
        if trace:
            return float(np.log(k * np.trace(np.linalg.inv(X))))
        return float(len(X) * np.log(k) - np.linalg.slogdet(X)[1])

    chosen = choose_weight(first, second, size="trace" if trace else "volume")
    assert not isinstance(chosen, EmptyIntersection)
    grid = min(size(weight) for weight in np.linspace(0, 1, 101))
    searched = minimize_scalar(size, bounds=(0, 1), method="bounded", options={"xatol": 1e-10})
    assert size(chosen) <= min(grid, float(searched.fun)) + 1e-7


@given(seed=SEEDS, gap=st.sampled_from([1e-6, 1e-3, 0.5]))
@settings(deadline=None, max_examples=80)
def test_emptiness_is_decided_exactly(seed: int, gap: float) -> None:
    """Two ellipsoids that touch in one point p from either side, then moved apart or together along the normal."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 6))
    first, second = random_ellipsoid(rng, n), random_ellipsoid(rng, n)
    p = sample(first, 2, rng)[0]
    outward = first.inverse_shape @ (p - first.center)
    outward /= np.linalg.norm(outward)
    # The point of the second with normal −g is its centre − E₂⁻¹g / √(gᵀE₂⁻¹g).
    pull = second.factor @ second.factor.T @ outward
    center = p + pull / np.sqrt(outward @ pull)
    apart = Ellipsoid(center + gap * outward, second.axes.copy(), second.semi_axes.copy())
    # Not so far that it comes out behind the first: half of the first's chord at p.
    depth = outward @ first.inverse_shape @ (p - first.center) / (outward @ first.inverse_shape @ outward)
    together = Ellipsoid(center - min(gap, depth) * outward, second.axes.copy(), second.semi_axes.copy())
    proof = fuse(first, apart)
    assert isinstance(proof, EmptyIntersection)
    assert proof.k < 0
    assert equation_5(first, apart, proof.weight)[0] == pytest.approx(proof.k, rel=1e-4, abs=1e-8)
    assert isinstance(fuse(first, together), Ellipsoid)


def test_the_whole_space_changes_nothing() -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        ellipsoid = random_kind(rng, flat=False)
        space = Ellipsoid.whole_space(ellipsoid.dimension)
        for fused in (fuse(space, ellipsoid), fuse(ellipsoid, space)):
            assert isinstance(fused, Ellipsoid)
            assert fused.semi_axes == pytest.approx(ellipsoid.semi_axes, rel=1e-8)
            if ellipsoid.bounded:
                assert fused.center == pytest.approx(ellipsoid.center)
                assert fused.inverse_shape == pytest.approx(ellipsoid.inverse_shape, rel=1e-6, abs=1e-8)
    assert np.isinf(fuse(Ellipsoid.whole_space(2), Ellipsoid.whole_space(2)).semi_axes).all()  # type: ignore[union-attr]


def test_crossing_strips_get_equal_shares() -> None:
    """The rule for degenerate E: r strips fused with one more that crosses them give λ = r / (r + 1) and k = 1."""
    rng = np.random.default_rng(6)
    state = Ellipsoid.whole_space(5)
    inside = rng.normal(size=5)
    for r in range(5):
        h = rng.normal(size=5)
        strip = Ellipsoid.strip(h, h @ inside + 0.1, 0.3)
        weight = choose_weight(state, strip)
        assert weight == pytest.approx(r / (r + 1), abs=1e-6)
        fused = fuse(state, strip)
        assert isinstance(fused, Ellipsoid)
        state = fused
        assert np.isinf(state.semi_axes).sum() == 5 - (r + 1)
        assert state.contains(inside)
    assert state.bounded


@given(seed=SEEDS, free=st.tuples(st.integers(0, 2), st.integers(0, 2)))
@settings(deadline=None, max_examples=40)
def test_chosen_weight_does_not_depend_on_coordinates(seed: int, free: tuple[int, int]) -> None:
    rng = np.random.default_rng(seed)
    first, second, _ = overlapping(rng, free=free)
    A, b = rng.normal(size=(first.dimension,) * 2) + 2 * np.eye(first.dimension), rng.normal(size=first.dimension)
    if np.linalg.cond(A) < 100:
        weights = choose_weight(first, second), choose_weight(first.image(A, b), second.image(A, b))
        assert weights[0] == pytest.approx(weights[1], abs=1e-5)
        if not np.isinf([first.semi_axes, second.semi_axes]).all():
            assert choose_weight(second, first) == pytest.approx(1 - float(weights[0]), abs=1e-5)  # type: ignore[arg-type]


def test_parallel_strips() -> None:
    wide, narrow = Ellipsoid.strip([1, 2, 0], 0.0, 4.0), Ellipsoid.strip([1, 2, 0], 1.0, 1.0)
    fused = fuse(wide, narrow)
    assert isinstance(fused, Ellipsoid)
    assert fused.semi_axes == pytest.approx(narrow.semi_axes, rel=1e-8)
    apart = fuse(wide, Ellipsoid.strip([1, 2, 0], 6.0, 1.0))
    assert isinstance(apart, EmptyIntersection)
    assert apart.k < 0


def test_far_from_the_origin() -> None:
    """500 km away and a millimetre wide: the first centre is the origin of the computation."""
    c = np.array([5e5, -5e5, 1.0])
    first, second = Ellipsoid.ball(c, 1e-3), Ellipsoid.ball(c + np.array([1e-3, 0, 0]), 1e-3)
    fused = fuse(first, second)
    assert isinstance(fused, Ellipsoid)
    near = fuse(Ellipsoid.ball([0, 0, 0], 1e-3), Ellipsoid.ball(second.center - c, 1e-3))
    assert isinstance(near, Ellipsoid)
    assert fused.semi_axes == pytest.approx(near.semi_axes, rel=1e-6)
    assert isinstance(fuse(first, Ellipsoid.ball(c + np.array([2.001e-3, 0, 0]), 1e-3)), EmptyIntersection)


def test_bad_input_is_refused_in_a_sentence() -> None:
    with pytest.raises(NotAnEllipsoid, match="2 and 3 dimensions"):
        fuse(Ellipsoid.ball([0, 0], 1), Ellipsoid.ball([0, 0, 0], 1))
    with pytest.raises(NotAnEllipsoid, match="between 0 and 1"):
        fuse(Ellipsoid.ball([0, 0], 1), Ellipsoid.ball([0, 0], 1), 1.5)
    with pytest.raises(FlatEllipsoid):
        fuse(Ellipsoid.ball([0, 0], 0), Ellipsoid.ball([0, 0], 1))
