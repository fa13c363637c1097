"""The calculus against the thesis' formulas (corrected), against sampled points, and against support functions.

Two closed convex sets are equal where their support functions are; that of an image is that of the set under Aᵀ, so
equality is tested without any of the formulas under test.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.ellipsoid import (
    Ellipsoid,
    EmptyIntersection,
    FlatEllipsoid,
    NotAnEllipsoid,
    UnboundedEllipsoid,
)
from estimation.strip import NotAStrip, Strip
from tests.estimation.ellipsoids import random_ellipsoid, random_kind, sample

SEEDS = st.integers(0, 100_000)


def directions_of(ellipsoid: Ellipsoid, rng: np.random.Generator) -> np.ndarray:
    """Random directions, some of them made perpendicular to what is free, where the support is finite."""
    h = rng.normal(size=(8, ellipsoid.dimension))
    free = ellipsoid.axes[:, np.isinf(ellipsoid.semi_axes)]
    h[4:] -= h[4:] @ free @ free.T
    return h[np.linalg.norm(h, axis=1) > 0.1]


@given(seed=SEEDS)
@settings(deadline=None, max_examples=80)
def test_inverse_shape_and_factor_describe_the_same_set(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ellipsoid = random_kind(rng, flat=False)
    again = Ellipsoid.from_inverse_shape(ellipsoid.center, ellipsoid.inverse_shape)
    assert again.semi_axes == pytest.approx(ellipsoid.semi_axes, rel=1e-6)
    points = sample(ellipsoid, 30, rng)
    assert again.contains(points, 1e-6).all()
    quadratic = np.einsum("pi,ij,pj->p", points - ellipsoid.center, ellipsoid.inverse_shape, points - ellipsoid.center)
    assert quadratic.max() <= 1 + 1e-6
    if ellipsoid.bounded:
        factor = Ellipsoid.from_factor(ellipsoid.center, ellipsoid.factor)
        assert factor.semi_axes == pytest.approx(ellipsoid.semi_axes, rel=1e-9)
        assert factor.contains(points).all()
        assert np.linalg.inv(ellipsoid.factor @ ellipsoid.factor.T) == pytest.approx(ellipsoid.inverse_shape, rel=1e-6)


@given(seed=SEEDS)
@settings(deadline=None, max_examples=80)
def test_membership_is_the_quadratic_form(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ellipsoid = random_kind(rng)
    points = sample(ellipsoid, 20, rng)
    assert ellipsoid.contains(points).all()
    widest = ellipsoid.semi_axes[np.isfinite(ellipsoid.semi_axes)].max(initial=0.0)
    for axis, length in zip(ellipsoid.axes.T, ellipsoid.semi_axes, strict=True):
        if np.isfinite(length):
            beyond = max(1.01 * length, 1e-3 * widest, 1e-6)
            assert not ellipsoid.contains(ellipsoid.center + beyond * axis)
            assert not ellipsoid.contains(ellipsoid.center - beyond * axis)
        else:
            assert ellipsoid.contains(ellipsoid.center + 1e6 * axis, 1e-6)


@given(seed=SEEDS)
@settings(deadline=None, max_examples=80)
def test_support_and_box_are_reached_and_not_passed(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ellipsoid = random_kind(rng)
    points = sample(ellipsoid, 50, rng)
    for h in directions_of(ellipsoid, rng):
        reach = float(ellipsoid.support(h))
        assert (points @ h <= reach + 1e-9 * (1 + np.abs(points).max())).all()
        if np.isfinite(reach):
            known = np.isfinite(ellipsoid.semi_axes)
            scaled = ellipsoid.axes[:, known] * ellipsoid.semi_axes[known]
            pull = scaled.T @ h
            touching = ellipsoid.center + scaled @ pull / max(np.linalg.norm(pull), 1e-300)
            assert ellipsoid.contains(touching)
            assert touching @ h == pytest.approx(reach, abs=1e-9)
    lower, upper = ellipsoid.bounding_box()
    assert ((points >= lower - 1e-9) & (points <= upper + 1e-9)).all()
    assert (lower <= upper).all()


@given(seed=SEEDS, rows=st.integers(1, 6), singular=st.booleans())
@settings(deadline=None, max_examples=120)
def test_image_is_exact_for_every_matrix(seed: int, rows: int, singular: bool) -> None:
    rng = np.random.default_rng(seed)
    ellipsoid = random_kind(rng)
    A, b = rng.normal(size=(rows, ellipsoid.dimension)), rng.normal(size=rows)
    if singular:
        A[-1] = A[0]
    image = ellipsoid.image(A, b)
    assert image.dimension == rows
    assert image.contains(sample(ellipsoid, 30, rng) @ A.T + b, 1e-7).all()
    for h in directions_of(image, rng):
        back = A.T @ h
        expected = float(ellipsoid.support(back)) if np.linalg.norm(back) > 1e-12 else 0.0
        if np.isfinite(expected):
            assert float(image.support(h)) == pytest.approx(expected + h @ b, abs=1e-8)
        else:
            # A direction computed to be perpendicular to what is free is so up to rounding only.
            free = ellipsoid.axes[:, np.isinf(ellipsoid.semi_axes)]
            assert np.isinf(image.support(h)) or np.linalg.norm(free.T @ back) < 1e-10


def test_image_by_an_invertible_matrix_is_the_corrected_formula() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        ellipsoid = random_ellipsoid(rng, 3, free=int(rng.integers(0, 3)))
        A, b = rng.normal(size=(3, 3)), rng.normal(size=3)
        image = ellipsoid.image(A, b)
        inverse = np.linalg.inv(A)
        E = inverse.T @ ellipsoid.inverse_shape @ inverse
        assert image.inverse_shape == pytest.approx(E, rel=1e-6, abs=1e-7 * np.abs(E).max())
        if ellipsoid.bounded:
            assert image.volume == pytest.approx(abs(np.linalg.det(A)) * ellipsoid.volume)


@given(seed=SEEDS, columns=st.integers(1, 6))
@settings(deadline=None, max_examples=120)
def test_preimage_is_exact_for_every_matrix(seed: int, columns: int) -> None:
    rng = np.random.default_rng(seed)
    ellipsoid = random_kind(rng, flat=False)
    H = rng.normal(size=(ellipsoid.dimension, columns))
    d = ellipsoid.center + rng.uniform(0, 0.6) * (sample(ellipsoid, 1, rng)[0] - ellipsoid.center) + 0.0
    preimage = ellipsoid.preimage(H, d)
    assert isinstance(preimage, Ellipsoid)
    points = np.concatenate([sample(preimage, 30, rng), rng.normal(size=(30, columns))])
    inside, outside = preimage.contains(points, 1e-7), ~preimage.contains(points, -1e-7)
    assert ellipsoid.contains(points[inside] @ H.T + d, 1e-6).all()
    assert not ellipsoid.contains(points[outside] @ H.T + d, -1e-6).any()


def test_preimage_of_an_interval_is_the_strip_of_the_thesis() -> None:
    h, z, bound = np.array([1.0, -2.0, 0.5]), 3.0, 0.25
    interval = Ellipsoid.from_inverse_shape([z], [[bound**-2]])
    preimage = interval.preimage(h[None, :])
    assert isinstance(preimage, Ellipsoid)
    strip = Ellipsoid.strip(h, z, bound)
    for ellipsoid in (preimage, strip):
        assert ellipsoid.inverse_shape == pytest.approx(np.outer(h, h) / bound**2)
        assert ellipsoid.center == pytest.approx(np.linalg.pinv(h[None, :])[:, 0] * z)
        assert np.isinf(ellipsoid.semi_axes).sum() == 2
        assert np.isinf(ellipsoid.volume)


@given(seed=SEEDS)
@settings(deadline=None, max_examples=80)
def test_strip_and_its_ellipsoid_hold_the_same_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    h = rng.normal(size=int(rng.integers(1, 6)))
    strip = Strip(h, *np.sort(rng.normal(size=2)))
    points = rng.normal(size=(60, len(h)))
    assert (Ellipsoid.from_strip(strip).contains(points) == strip.contains(points)).all()
    half = Strip(h, strip.low, np.inf)
    assert Ellipsoid.from_strip(half).contains(points).all()
    assert (half.contains(points) == (points @ h >= strip.low)).all()


@given(seed=SEEDS)
@settings(deadline=None, max_examples=80)
def test_slice_is_exact(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ellipsoid = random_kind(rng, flat=False)
    n = ellipsoid.dimension
    Y = rng.normal(size=(n, int(rng.integers(1, n + 1))))
    y0 = ellipsoid.center + 0.5 * (sample(ellipsoid, 1, rng)[0] - ellipsoid.center)
    part = ellipsoid.slice_by(y0, Y)
    assert isinstance(part, Ellipsoid)
    assert ellipsoid.contains(y0 + sample(part, 30, rng) @ Y.T, 1e-6).all()
    outside = part.center + 1.01 * (sample(part, 15, rng)[:7] - part.center)
    if part.bounded:
        assert not ellipsoid.contains(y0 + outside @ Y.T, 1e-6).any()


def test_slice_is_equation_6() -> None:
    rng = np.random.default_rng(2)
    for _ in range(40):
        ellipsoid = random_ellipsoid(rng, 4, free=int(rng.integers(0, 2)), away=0.3)
        E, x0 = ellipsoid.inverse_shape, ellipsoid.center
        Y, y0 = rng.normal(size=(4, 2)), rng.normal(size=4)
        F = Y.T @ E @ Y
        eta = np.linalg.pinv(F) @ Y.T @ E @ (x0 - y0)
        k = 1 - (x0 - y0) @ E @ (x0 - y0) + eta @ F @ eta
        part = ellipsoid.slice_by(y0, Y)
        if k < 0:
            assert isinstance(part, EmptyIntersection)
            assert part.k == pytest.approx(k, rel=1e-6)
        else:
            assert isinstance(part, Ellipsoid)
            assert part.center == pytest.approx(eta, rel=1e-6, abs=1e-6)
            assert part.inverse_shape == pytest.approx(F / k, rel=1e-6)


def test_slice_beside_the_set_is_empty_and_touching_is_not() -> None:
    ball = Ellipsoid.ball([0, 0, 0], 2.0)
    plane = np.array([[1.0, 0], [0, 1], [0, 0]])
    beside = ball.slice_by([0, 0, 2.0001], plane)
    assert isinstance(beside, EmptyIntersection)
    assert beside.k == pytest.approx(1 - 2.0001**2 / 4)
    touching = ball.slice_by([0, 0, 2.0], plane)
    assert isinstance(touching, Ellipsoid)
    assert touching.semi_axes.max() < 1e-5
    middle = ball.slice_by([0, 0, 1.0], plane)
    assert isinstance(middle, Ellipsoid)
    assert middle.semi_axes == pytest.approx([math.sqrt(3)] * 2)


@given(seed=SEEDS)
@settings(deadline=None, max_examples=80)
def test_projection_is_the_shadow(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ellipsoid = random_kind(rng)
    m = int(rng.integers(1, ellipsoid.dimension + 1))
    basis = np.linalg.qr(rng.normal(size=(ellipsoid.dimension, m)))[0]
    for shadow, Y in ((ellipsoid.project(m), np.eye(ellipsoid.dimension, m)), (ellipsoid.project_onto(basis), basis)):
        assert shadow.contains(sample(ellipsoid, 30, rng) @ Y, 1e-7).all()
        for h in directions_of(shadow, rng):
            reach = float(shadow.support(h))
            if np.isfinite(reach) and np.isfinite(ellipsoid.support(Y @ h)):
                assert reach == pytest.approx(float(ellipsoid.support(Y @ h)), abs=1e-8)


def test_projection_is_equations_7_and_8() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        ellipsoid = random_ellipsoid(rng, 4)
        E = ellipsoid.inverse_shape
        first = ellipsoid.project(2)
        assert first.center == pytest.approx(ellipsoid.center[:2])
        schur = E[:2, :2] - E[:2, 2:] @ np.linalg.inv(E[2:, 2:]) @ E[:2, 2:].T
        assert first.inverse_shape == pytest.approx(schur, rel=1e-6, abs=1e-8 * np.abs(E).max())
        basis = np.linalg.qr(rng.normal(size=(4, 4)))[0]
        Y, Z = basis[:, :2], basis[:, 2:]
        EY = Y.T @ E @ Y - Y.T @ E @ Z @ np.linalg.inv(Z.T @ E @ Z) @ Z.T @ E @ Y
        assert ellipsoid.project_onto(Y).inverse_shape == pytest.approx(EY, rel=1e-6, abs=1e-8 * np.abs(E).max())


def test_projection_of_strips_keeps_what_is_free() -> None:
    shadow = Ellipsoid.strip([1.0, 2.0, 3.0], 1.0, 0.5).project(2)
    assert np.isinf(shadow.semi_axes).all()
    cylinder = Ellipsoid.strip([3.0, 4.0, 0.0], 10.0, 5.0).project(2)
    assert cylinder.semi_axes == pytest.approx([np.inf, 1.0])
    assert np.isinf(Ellipsoid.whole_space(4).project(1).semi_axes).all()


def test_volumes_in_closed_form() -> None:
    assert Ellipsoid.ball([0, 0], 2.0).volume == pytest.approx(4 * math.pi)
    assert Ellipsoid.from_inverse_shape([0, 0, 0], np.diag([1.0, 1 / 4, 1 / 9])).volume == pytest.approx(8 * math.pi)
    assert Ellipsoid.from_inverse_shape([5.0], [[4.0]]).volume == pytest.approx(1.0)
    assert Ellipsoid.whole_space(3).volume == math.inf
    assert Ellipsoid.from_factor([0, 0], [[1.0], [1.0]]).volume == 0
    assert Ellipsoid.from_factor([0, 0], [[1.0], [1.0]]).semi_axes == pytest.approx([math.sqrt(2), 0])
    assert Ellipsoid.ball(np.zeros(3), 1e-150).log_volume == pytest.approx(
        math.log(4 / 3 * math.pi) - 450 * math.log(10)
    )


def test_semi_axes_come_from_the_eigenvalues() -> None:
    assert Ellipsoid.from_inverse_shape([0, 0], [[25.0, 0], [0, 0.0]]).semi_axes == pytest.approx([np.inf, 0.2])
    assert np.isinf(Ellipsoid.from_inverse_shape([1, 2], np.zeros((2, 2))).semi_axes).all()
    # Rank one up to rounding: the other eigenvalues are noise, and freeing them enlarges the set.
    h = np.array([1e6, -1e6, 1.0])
    assert np.isinf(Ellipsoid.from_inverse_shape([0, 0, 0], np.outer(h, h)).semi_axes).sum() == 2


def test_values_cannot_be_written() -> None:
    ellipsoid = Ellipsoid.ball([0, 0], 1.0)
    with pytest.raises(ValueError, match="read-only"):
        ellipsoid.center[0] = 1.0


@pytest.mark.parametrize(
    ("make", "error", "sentence"),
    [
        (lambda: Ellipsoid.from_inverse_shape([0, 0], [[1, 0], [0, -1]]), NotAnEllipsoid, "negative eigenvalue"),
        (lambda: Ellipsoid.from_inverse_shape([0, 0], [[1, 1], [0, 1]]), NotAnEllipsoid, "not symmetric"),
        (lambda: Ellipsoid.from_inverse_shape([0, 0], np.eye(3)), NotAnEllipsoid, "2 by 2"),
        (lambda: Ellipsoid.from_inverse_shape([0, np.nan], np.eye(2)), NotAnEllipsoid, "finite vector"),
        (lambda: Ellipsoid.from_factor([0, 0], np.eye(3)), NotAnEllipsoid, "as many rows"),
        (lambda: Ellipsoid.ball([0, 0], -1), NotAnEllipsoid, "at least 0"),
        (lambda: Ellipsoid.ball([0, 0], 1).project(3), NotAnEllipsoid, "2 dimensions"),
        (lambda: Ellipsoid.ball([0, 0], 1).project_onto([[1.0], [1.0]]), NotAnEllipsoid, "qr"),
        (lambda: Ellipsoid.strip([1, 0], 0, 1).factor, UnboundedEllipsoid, "1 directions of the ellipsoid are free"),
        (lambda: Ellipsoid.ball([0, 0], 0).inverse_shape, FlatEllipsoid, "length 0"),
        (lambda: Ellipsoid.strip([0, 0], 0, 1), NotAStrip, "other than zero"),
        (lambda: Ellipsoid.strip([1, 0], 0, -1), NotAStrip, "low ≤ high"),
        (lambda: Strip([1, 0], -np.inf, np.inf), NotAStrip, "low ≤ high"),  # type: ignore[arg-type]
        (lambda: Strip([1, 0], np.inf, np.inf), NotAStrip, "infinity"),  # type: ignore[arg-type]
    ],
)
def test_bad_input_is_refused_in_a_sentence(make: object, error: type[ValueError], sentence: str) -> None:
    with pytest.raises(error, match=sentence):
        make()  # type: ignore[operator]
