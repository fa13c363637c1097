"""The remainder against dense samples, exactness on polynomials, and a target found by what has no other embedding."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.bernstein_embedding import BernsteinEmbedding
from estimation.range_embedding import NotAMeasurement
from estimation.strip import Strip
from estimation.strip_cut import cut

SEEDS = st.integers(0, 100_000)


def random_box(rng: np.random.Generator, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    lower = rng.normal(scale=5, size=dimension)
    return lower, lower + rng.uniform(0.5, 8, dimension)


@given(seed=SEEDS, dimension=st.integers(1, 2), degree=st.integers(1, 5))
@settings(deadline=None, max_examples=30)
def test_polynomials_of_the_degree_are_returned_exactly(seed: int, dimension: int, degree: int) -> None:
    rng = np.random.default_rng(seed)
    lower, upper = random_box(rng, dimension)
    embedding = BernsteinEmbedding(lower, upper, degree)
    weights = rng.normal(size=(degree + 1,) * dimension)

    def polynomial(points: np.ndarray) -> np.ndarray:
        t = ((points - lower) / (upper - lower)).T
        return (
            np.polynomial.polynomial.polyval(t[0], weights)
            if dimension == 1
            else (np.polynomial.polynomial.polyval2d(*t, weights))
        )

    approximation = embedding.approximate(polynomial, slopes=[1e3] * dimension)
    points = rng.uniform(lower, upper, (200, dimension))
    linear = embedding.lift(points) @ approximation.row + approximation.offset
    assert linear == pytest.approx(polynomial(points), abs=1e-8)


def test_the_square_of_a_range_is_exact() -> None:
    """Degree 2 holds the embedding of §2.3: what is left of the remainder is the grid's share."""
    embedding = BernsteinEmbedding([-3.0, 1.0], [5.0, 6.0], 2)  # type: ignore[arg-type]
    anchor = np.array([7.0, -2.0])
    approximation = embedding.approximate(lambda x: ((x - anchor) ** 2).sum(axis=1), curvatures=[2.0, 2.0])
    steps = np.array([8.0, 5.0]) / 140
    assert approximation.remainder == pytest.approx((4.0 * steps**2).sum() / 8, rel=1e-3)


@given(seed=SEEDS, dimension=st.integers(1, 2), degree=st.integers(1, 6), by_slope=st.booleans())
@settings(deadline=None, max_examples=40)
def test_the_remainder_is_rigorous_and_not_idle(seed: int, dimension: int, degree: int, by_slope: bool) -> None:
    """f = a sin(k·x + φ) has |∂ᵢf| ≤ |a kᵢ| and |∂ᵢᵢf| ≤ |a| kᵢ²."""
    rng = np.random.default_rng(seed)
    lower, upper = random_box(rng, dimension)
    embedding = BernsteinEmbedding(lower, upper, degree)
    a, k, phase = rng.uniform(0.5, 5), rng.normal(scale=0.8, size=dimension), rng.uniform(0, 7)

    def wave(points: np.ndarray) -> np.ndarray:
        return a * np.sin(points @ k + phase)

    if by_slope:
        approximation = embedding.approximate(wave, slopes=np.abs(a * k))
    else:
        approximation = embedding.approximate(wave, curvatures=a * k**2)
    points = rng.uniform(lower, upper, (3000, dimension))
    errors = wave(points) - embedding.lift(points) @ approximation.row - approximation.offset
    assert approximation.error_low <= errors.min() <= errors.max() <= approximation.error_high
    if not by_slope:
        assert approximation.remainder <= 1.5 * np.abs(errors).max() + 0.01 * a
        classical = (a * k**2 * (upper - lower) ** 2).sum() / (8 * degree)
        assert approximation.remainder <= 2 * classical + 0.01 * a


@given(seed=SEEDS, dimension=st.integers(1, 2), degree=st.integers(1, 3))
@settings(deadline=None, max_examples=20)
def test_the_start_contains_the_lifted_box(seed: int, dimension: int, degree: int) -> None:
    rng = np.random.default_rng(seed)
    lower, upper = random_box(rng, dimension)
    embedding = BernsteinEmbedding(lower, upper, degree)
    corners = np.array(np.meshgrid(*zip(lower, upper, strict=True))).reshape(dimension, -1).T
    points = np.concatenate([corners, rng.uniform(lower, upper, (300, dimension))])
    states = embedding.lift(points)
    assert states[:, :dimension] == pytest.approx(points)
    start = embedding.start()
    assert start.bounded
    assert start.contains(states, 1e-6).all()


def test_degree_one_starts_with_the_smallest_ellipse() -> None:
    start = BernsteinEmbedding([2.0], [6.0], 1).start()  # type: ignore[arg-type]
    assert start.bounding_box() == (pytest.approx([2.0]), pytest.approx([6.0]))


@pytest.mark.parametrize("seed", range(2))
def test_a_target_is_located_by_differences_of_ranges(seed: int) -> None:
    """Differences of two ranges (time difference of arrival) have no embedding by inspection; the bounds are rigorous.

    |∂ᵢᵢ|x − a|| ≤ 1 / |x − a|, and every beacon is at least 3 m outside the box.
    """
    rng = np.random.default_rng(seed)
    lower, upper = np.array([-2.0, -2.0]), np.array([2.0, 2.0])
    embedding = BernsteinEmbedding(lower, upper, 3)
    truth = rng.uniform(lower, upper)
    lifted = embedding.lift(truth)
    state = embedding.start()
    for axis in range(2):
        state = cut(state, Strip(np.eye(embedding.size)[axis], lower[axis], upper[axis])).ellipsoid or state
    before, bound = state.project(2).volume, 0.03
    beacons = np.array([[5, 5], [-5, 5], [-5, -5], [5, -5], [0, 6], [6, 0], [-6, 1], [1, -6]], dtype=float)
    for first in range(len(beacons)):
        for second in range(first):

            def difference(
                x: np.ndarray, a: np.ndarray = beacons[first], b: np.ndarray = beacons[second]
            ) -> np.ndarray:
                return np.hypot(*(x - a).T) - np.hypot(*(x - b).T)

            approximation = embedding.approximate(difference, curvatures=[2 / 3, 2 / 3])
            assert approximation.remainder < 0.05
            z = float(difference(truth[None])[0]) + rng.choice([-bound, bound])
            strip = approximation.strip(z - bound, z + bound)
            assert strip.contains(lifted)
            result = cut(state, strip)
            assert result.ellipsoid is not None
            state = result.ellipsoid
            assert state.contains(lifted, 1e-6), f"seed {seed}"
    after = state.project(2)
    assert after.contains(truth, 1e-6)
    assert after.volume < 0.2 * before
    assert math.isfinite(after.volume)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: BernsteinEmbedding([0, 0], [1], 2), "two finite corners"),
        (lambda: BernsteinEmbedding([0, 0], [1, 0], 2), "lower corner first"),
        (lambda: BernsteinEmbedding([0, 0], [1, 1], 0), "1 to 12"),
        (lambda: BernsteinEmbedding([0], [1], 2).approximate(lambda x: x[:, 0]), "greatest curvatures"),
        (lambda: BernsteinEmbedding([0], [1], 2).approximate(lambda x: x[:, 0], slopes=[-1]), "at least 0"),
        (lambda: BernsteinEmbedding([0], [1], 2).approximate(lambda x: x[:, 0] * np.nan, slopes=[1]), "gaps"),
        (lambda: BernsteinEmbedding([0], [1], 2).approximate(lambda x: x, slopes=[1]), "shape"),
    ],
)
def test_bad_input_is_refused_in_a_sentence(make: object, sentence: str) -> None:
    with pytest.raises(NotAMeasurement, match=sentence):
        make()  # type: ignore[operator]
