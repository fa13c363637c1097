"""Control laws against numerical gradients, symmetry, and brute force over measured sets."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.information_control import Limits, NotAnEstimate, covariance_direction, information_gradient
from estimation.information_filter import InformationFilter
from estimation.look_ahead import best_heading, look_ahead, predict_shares
from estimation.range_filter import RangeFilter
from estimation.spread import spread_points
from estimation.tight_set import TightSet

LIMITS = Limits(step_m=1.0, bound_m=0.5)
places = st.tuples(st.floats(-30, 30), st.floats(-30, 30))


@dataclass(frozen=True)
class Spot:
    """An estimate as any set in the plane states it."""

    centroid: np.ndarray
    covariance: np.ndarray


def measured(target, anchors, bound=0.5, noise=0.0):
    filter_ = RangeFilter()
    for anchor in anchors:
        filter_.measure(anchor, float(np.hypot(*np.subtract(target, anchor))) + noise, bound)
    return filter_


def rate(filter_, position, bound=0.5):
    """Eq. 17 written out with matrices, in the map's frame."""
    ellipsoid = filter_.ellipsoid()
    H = np.array([-2 * position[0], -2 * position[1], 1.0])
    r = np.hypot(*(np.asarray(position) - ellipsoid.center[:2]))
    return 0.5 * H @ ellipsoid.factor @ ellipsoid.factor.T @ H / (2 * r * bound) ** 2


def numerical_gradient(value, position, step=1e-5):
    position = np.asarray(position, dtype=float)
    return np.array([(value(position + d) - value(position - d)) / (2 * step) for d in step * np.eye(2)])


def turned(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@settings(max_examples=60, deadline=None)
@given(places, st.floats(0, 7), st.floats(2, 20))
def test_the_thesis_law_is_the_gradient_of_eq_17(target, heading, distance):
    anchors = np.add(target, [(20, 3), (18, 9), (-7, 13)])
    filter_ = measured(target, anchors)
    position = filter_.center + distance * np.array([np.cos(heading), np.sin(heading)])
    expected = numerical_gradient(lambda p: rate(filter_, p), position)
    direction = information_gradient(filter_, position, LIMITS)
    assert np.hypot(*direction) == pytest.approx(1)
    # Where next to nothing pulls across the line of sight the law circles instead.
    sight = (filter_.center - position) / distance
    aside = np.hypot(*(expected - sight * (expected @ sight)))
    if aside * distance / rate(filter_, position) > 0.02:
        assert direction @ expected / np.hypot(*expected) == pytest.approx(1, abs=1e-4)


def test_the_thesis_law_does_not_depend_on_where_the_map_begins():
    target, anchors = np.array([3.0, 4.0]), np.array([(20.0, 3.0), (18.0, 9.0), (-7.0, 13.0)])
    here = information_gradient(measured(target, anchors), (10.0, -5.0), LIMITS)
    shift = np.array([500_000.0, -300_000.0])
    there = information_gradient(measured(target + shift, anchors + shift), np.add(shift, (10.0, -5.0)), LIMITS)
    np.testing.assert_allclose(there, here, atol=1e-6)


@settings(max_examples=60, deadline=None)
@given(st.floats(0.01, 20), st.floats(0.01, 20), st.floats(0, 7), places, st.floats(0, 7))
def test_the_covariance_law_climbs_the_variance_of_the_predicted_range(long, short, tilt, position, turn):
    C = turned(tilt) @ np.diag([long, short]) @ turned(tilt).T
    center = np.array([1.0, 2.0])
    position = np.asarray(position)
    if np.hypot(*(position - center)) < 0.1:
        position = center + 3.0

    def variance(p):
        u = (center - p) / np.hypot(*(center - p))
        return u @ C @ u

    expected = numerical_gradient(variance, position)
    direction = covariance_direction(Spot(center, C), position, LIMITS)
    assert np.hypot(*direction) == pytest.approx(1)
    assert abs(direction @ (position - center)) < 1e-9 * np.hypot(*(position - center))
    if np.hypot(*expected) * np.hypot(*(position - center)) > 4e-3 * np.trace(C):
        assert direction @ expected > 0
    R = turned(turn)
    turned_too = covariance_direction(Spot(R @ center, R @ C @ R.T), R @ position, LIMITS)
    np.testing.assert_allclose(turned_too, R @ direction, atol=1e-6)


def all_laws(ellipsoid, tight, gaussian, position, limits):
    """The direction by every law, on sets that have something to say."""
    return {
        "gradient": information_gradient(ellipsoid, position, limits),
        "covariance, ellipsoid": covariance_direction(ellipsoid.feasible_set(), position, limits),
        "covariance, tight": covariance_direction(tight, position, limits),
        "one step": look_ahead(tight, position, limits),
        "five steps": look_ahead(tight, position, limits, 5),
        "worst case": look_ahead(tight, position, limits, 2, "worst"),
        "Gaussian": gaussian.direction(position, limits),
    }


@settings(max_examples=25)
@given(places, places, st.integers(1, 5))
def test_every_law_is_a_pure_function_to_a_unit_vector(target, position, ranges):
    ellipsoid, tight = RangeFilter(), TightSet()
    gaussian = InformationFilter.from_guess(np.add(target, (0.5, -0.2)), np.diag([2.0, 1.0]))
    for anchor in np.add(target, [(20, 3), (18, 9), (-7, 13), (2, -11), (5, 5)])[:ranges]:
        r = float(np.hypot(*(anchor - target)))
        ellipsoid.measure(anchor, r, 0.5)
        tight.measure(anchor, r, 0.5)
    before = ellipsoid.snapshot(), tight.area_m2
    # Here, at the estimate, and wherever the mirror line may be.
    for place in (position, ellipsoid.center, tight.centroid, gaussian.mean):
        first = all_laws(ellipsoid, tight, gaussian, place, LIMITS)
        again = all_laws(ellipsoid, tight, gaussian, place, LIMITS)
        for law, direction in first.items():
            assert np.hypot(*direction) == pytest.approx(1), law
            np.testing.assert_array_equal(direction, again[law])
        standing = all_laws(ellipsoid, tight, gaussian, place, Limits(step_m=0.0, bound_m=0.5))
        assert not np.any(list(standing.values()))
    assert before == (ellipsoid.snapshot(), tight.area_m2)


def test_nothing_known_is_no_direction():
    assert not information_gradient(RangeFilter(), (1, 2), LIMITS).any()
    assert not covariance_direction(None, (1, 2), LIMITS).any()
    assert not look_ahead(TightSet(), (1, 2), LIMITS).any()
    assert not InformationFilter.uninformed().direction((1, 2), LIMITS).any()


def test_a_point_is_no_direction():
    assert not covariance_direction(Spot(np.zeros(2), np.zeros((2, 2))), (1, 2), LIMITS).any()
    assert not best_heading(np.array([[3.0, 4.0]]), np.array([1.0, 2.0]), LIMITS, 1, "expected").any()


def test_at_the_estimate_the_robot_leaves_along_the_long_axis():
    C = turned(0.3) @ np.diag([4.0, 1.0]) @ turned(0.3).T
    leaving = covariance_direction(Spot(np.array([5.0, 5.0]), C), (5, 5), LIMITS)
    np.testing.assert_allclose(leaving, [np.cos(0.3), np.sin(0.3)], atol=1e-12)
    # After the first range the estimate is where it was measured from.
    after_one = measured((10, 0), [(0, 0)])
    assert np.hypot(*information_gradient(after_one, (0, 0), LIMITS)) == pytest.approx(1)
    assert np.hypot(*covariance_direction(after_one.feasible_set(), (0, 0), LIMITS)) == pytest.approx(1)


def test_on_the_mirror_line_the_robot_circles():
    # Two ranges from the x axis leave two mirror images; seen from the axis nothing pulls to either side.
    filter_ = measured((6, 8), [(0, 0), (4, 0), (10, 0)])
    feasible = filter_.feasible_set()
    np.testing.assert_allclose(covariance_direction(feasible, (12, 0), LIMITS), [0, -1], atol=1e-6)
    np.testing.assert_allclose(information_gradient(filter_, (12, 0), LIMITS), [0, -1], atol=1e-6)
    # Off the line it goes further off.
    assert covariance_direction(feasible, (12, 0.5), LIMITS)[1] > 0.9


def test_bad_numbers_are_named():
    after_one = measured((10, 0), [(0, 0)])
    for law in (
        lambda place: information_gradient(RangeFilter(), place, LIMITS),
        lambda place: covariance_direction(after_one.feasible_set(), place, LIMITS),
        lambda place: look_ahead(TightSet(), place, LIMITS),
        lambda place: InformationFilter.uninformed().direction(place, LIMITS),
    ):
        with pytest.raises(NotAnEstimate, match="two finite numbers"):
            law((np.nan, 0))
    with pytest.raises(NotAnEstimate, match="positive"):
        Limits(step_m=1.0, bound_m=0.0)
    with pytest.raises(NotAnEstimate, match="at least 0"):
        Limits(step_m=-1.0, bound_m=0.5)
    with pytest.raises(NotAnEstimate, match="at least 1 step"):
        look_ahead(TightSet(), (0, 0), LIMITS, steps=0)


def test_predicted_shares_are_what_measuring_leaves():
    """The closed form against drawing targets and noise and counting."""
    rng = np.random.default_rng(5)
    points = rng.uniform(-5, 5, (40, 2))
    path = np.array([[8.0, 1.0], [8.0, 3.0], [7.0, 4.0]])
    bound, counted = 0.8, []
    distances = np.hypot(*(points[:, None] - path).transpose(2, 0, 1))
    for i in range(40):
        noise = rng.uniform(-bound, bound, (2000, 1, 3))
        counted.append(np.all(np.abs(distances[i] + noise - distances) <= bound, axis=2).mean())
    share = predict_shares(points, path[None], bound, False)[0]
    assert share == pytest.approx(np.mean(counted), rel=0.03)
    most = predict_shares(points, path[None], bound, True)[0]
    assert most == max(np.all(np.abs(distances[i] - distances) < 2 * bound, axis=1).mean() for i in range(40))


def test_one_step_finds_the_heading_of_a_full_search():
    rng = np.random.default_rng(2)
    limits = Limits(step_m=2, bound_m=0.4, headings=16)
    for _ in range(10):
        points = rng.normal(size=(30, 2)) * [6, 1] @ turned(rng.uniform(0, 6)).T
        a = rng.uniform(-10, 10, 2)
        left = []
        for angle in 2 * np.pi * np.arange(16) / 16:
            r = np.hypot(*(points - a - 2 * np.array([np.cos(angle), np.sin(angle)])).T)
            left.append(np.maximum(0, 1 - np.abs(r[:, None] - r) / 0.8).sum())
        best = 2 * np.pi * np.argmin(left) / 16
        np.testing.assert_allclose(
            best_heading(points, a, limits, 1, "expected"), [np.cos(best), np.sin(best)], atol=1e-12
        )


def test_looking_ahead_leaves_the_mirror_line():
    blob = np.array(list(itertools.product([-0.4, 0, 0.4], repeat=2)))
    points = np.concatenate([np.add(blob, (6, 8)), np.add(blob, (6, -8))])
    direction = best_heading(points, np.array([10.0, 0.0]), Limits(1, 0.3), 3, "expected")
    assert abs(direction[1]) > 0.5


def test_points_are_spread_by_area():
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    band = np.array([[5.0, 0], [105, 0], [105, 0.01], [5, 0.01]])
    points = spread_points([square, band], 400)
    assert points.shape == (400, 2)
    in_square = points[:, 0] < 2
    assert in_square.sum() == 200
    assert np.histogram2d(*points[in_square].T, bins=4, range=[[0, 1], [0, 1]])[0].min() >= 8
    assert np.histogram(points[~in_square, 0], bins=10, range=(5, 105))[0].min() >= 15
    assert spread_points([], 5).shape == (0, 2)
    assert spread_points([np.zeros((4, 2))], 5).shape == (0, 2)
