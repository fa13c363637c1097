"""The information filter against the Kalman filter in its usual form, and its law against a numerical gradient."""

from __future__ import annotations

import numpy as np
import pytest

from estimation.information_control import Limits
from estimation.information_filter import InformationFilter, NotInformative


def kalman_update(x, P, anchor, z, deviation):
    away = x - anchor
    r = np.hypot(*away)
    H = (away / r)[None]
    S = H @ P @ H.T + deviation**2
    K = P @ H.T / S
    return x + (K * (z - r)).ravel(), (np.eye(2) - K @ H) @ P


def test_one_range_is_the_kalman_filters_update():
    rng = np.random.default_rng(1)
    for _ in range(50):
        x, A = rng.uniform(-10, 10, 2), rng.normal(size=(2, 2))
        P, anchor, z = A @ A.T + 0.1 * np.eye(2), rng.uniform(-20, 20, 2), rng.uniform(1, 30)
        filter_ = InformationFilter.from_guess(x, P).measure([anchor], [z], 0.4)
        mean, covariance = kalman_update(x, P, anchor, z, 0.4)
        np.testing.assert_allclose(filter_.mean, mean, rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(filter_.covariance, covariance, rtol=1e-8, atol=1e-10)


def test_ranges_add_in_any_order():
    start = InformationFilter.from_guess((1, 2), np.eye(2))
    anchors, ranges = np.array([(5.0, 0), (0, 7), (-3, 1)]), np.array([4.0, 6, 5])
    one, other = start.measure(anchors, ranges, 0.5), start.measure(anchors[::-1], ranges[::-1], 0.5)
    np.testing.assert_allclose(one.mean, other.mean)
    np.testing.assert_allclose(one.matrix, other.matrix)


def test_prediction_is_the_kalman_filters():
    F, Q, P = np.array([[1.0, 0.2], [0, 0.9]]), np.diag([0.3, 0.1]), np.array([[2.0, 0.4], [0.4, 1]])
    filter_ = InformationFilter.from_guess((3, -1), P).predict(Q, F)
    np.testing.assert_allclose(filter_.mean, F @ (3, -1))
    np.testing.assert_allclose(filter_.covariance, F @ P @ F.T + Q)


def test_it_finds_a_target_from_a_good_guess_and_loses_it_from_a_bad_one():
    rng = np.random.default_rng(3)
    target, errors = np.array([4.0, 9.0]), {}
    for name, guess in {"good": (5, 8), "mirror": (4, -9)}.items():
        filter_ = InformationFilter.from_guess(guess, 25 * np.eye(2))
        for x in np.linspace(0, 10, 20):
            z = np.hypot(*(target - (x, 0))) + rng.uniform(-0.5, 0.5)
            filter_ = filter_.measure([(x, 0.0)], [z], 0.5 / np.sqrt(3))
        errors[name] = np.hypot(*(filter_.mean - target))
    assert errors["good"] < 0.5
    assert errors["mirror"] > 10


def test_the_law_is_the_gradient_of_the_information_rate():
    P, x = np.array([[5.0, 1.0], [1.0, 2.0]]), np.array([1.0, 1.0])
    filter_ = InformationFilter.from_guess(x, P)

    def rate(a):
        u = (x - a) / np.hypot(*(x - a))
        return 0.5 * u @ P @ u

    for a in np.random.default_rng(4).uniform(-9, 9, (20, 2)):
        gradient = np.array([(rate(a + d) - rate(a - d)) / 2e-5 for d in 1e-5 * np.eye(2)])
        np.testing.assert_allclose(filter_.direction(a, Limits(1, 0.5)), gradient / np.hypot(*gradient), atol=1e-4)


def test_nothing_known():
    nothing = InformationFilter.uninformed()
    assert not nothing.direction((1, 1), Limits(1, 0.5)).any()
    assert nothing.predict(np.eye(2)) is nothing
    with pytest.raises(NotInformative, match="start from a guess"):
        nothing.measure([(0, 0)], [3], 0.5)
    with pytest.raises(NotInformative, match="positive definite"):
        InformationFilter.from_guess((0, 0), np.zeros((2, 2)))
    with pytest.raises(NotInformative, match="deviation"):
        InformationFilter.from_guess((0, 0), np.eye(2)).measure([(1, 0)], [1], 0)


def test_a_range_from_the_estimate_tells_no_direction():
    filter_ = InformationFilter.from_guess((2, 2), np.eye(2))
    np.testing.assert_allclose(filter_.measure([(2, 2)], [0.3], 0.5).matrix, filter_.matrix)


@pytest.mark.parametrize(
    "work",
    [
        lambda held: held.from_guess((float("nan"), 0), np.eye(2)),
        lambda held: held.from_guess((0, 0), [[1, 0.5], [0, 1]]),
        lambda held: held.from_guess((0, 0), np.full((2, 2), np.inf)),
        lambda held: held.measure([(0, 0)], [float("nan")], 0.5),
        lambda held: held.measure([(0, float("inf"))], [5], 0.5),
        lambda held: held.measure([(0, 0), (1, 0)], [5], 0.5),
        lambda held: held.measure([(0, 0)], [5], float("inf")),
        lambda held: held.predict(np.diag([-1.0, 1])),
        lambda held: held.predict(np.eye(2), np.full((2, 2), np.nan)),
    ],
)
def test_numbers_that_would_leave_no_gaussian_are_refused(work):
    with pytest.raises(NotInformative, match="not"):
        work(InformationFilter.from_guess((1, 2), np.eye(2)))
