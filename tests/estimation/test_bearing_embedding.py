"""Half-planes and strips against the angles themselves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.bearing_embedding import BearingEmbedding
from estimation.ellipsoid import Ellipsoid
from estimation.range_embedding import NotAMeasurement, RangeEmbedding
from estimation.strip_cut import cut

SEEDS = st.integers(0, 100_000)


def angles_from(sensor: np.ndarray, points: np.ndarray, bearing: float) -> np.ndarray:
    """Angle from the bearing to the points as seen from the sensor, in [-π, π]."""
    away = points - sensor
    return np.angle(np.exp(1j * (np.arctan2(away[..., 1], away[..., 0]) - bearing)))


@given(seed=SEEDS, bearing=st.floats(-10, 10), bound=st.floats(0.01, 1.5))
@settings(deadline=None, max_examples=100)
def test_the_half_planes_are_the_wedge(seed: int, bearing: float, bound: float) -> None:
    rng = np.random.default_rng(seed)
    embedding = BearingEmbedding(nodes=2)
    sensor, points = rng.normal(scale=10, size=2), rng.normal(scale=10, size=(80, 2, 2))
    right, left = embedding.wedge_from_sensor(1, sensor, bearing, bound)
    states = points.reshape(80, 4)
    inside = right.contains(states) & left.contains(states)
    assert (inside == (np.abs(angles_from(sensor, points[:, 1], bearing)) <= bound)).all()
    right, left = embedding.wedge_between(0, 1, bearing, bound)
    inside = right.contains(states) & left.contains(states)
    assert (inside == (np.abs(angles_from(points[:, 0], points[:, 1], bearing)) <= bound)).all()


@given(seed=SEEDS, bearing=st.floats(-10, 10), bound=st.floats(0, 1.5), reach=st.floats(0.1, 100))
@settings(deadline=None, max_examples=100)
def test_strips_contain_the_wedge_within_reach(seed: int, bearing: float, bound: float, reach: float) -> None:
    rng = np.random.default_rng(seed)
    sensor = rng.normal(scale=10, size=2)
    angles, distances = bearing + rng.uniform(-bound, bound, 60), reach * rng.random(60)
    points = sensor + distances[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    for strip in BearingEmbedding().strips_within(0, sensor, bearing, bound, reach):
        assert strip.contains(points).all()
        assert np.isfinite(strip.half_width)


@pytest.mark.parametrize("seed", range(6))
def test_a_target_is_located_by_bearings_alone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    embedding = BearingEmbedding()
    truth, bound = rng.uniform(-5, 5, 2), math.radians(3)
    state = Ellipsoid.whole_space(2)
    for step in range(30):
        sensor = rng.uniform(-15, 15, 2)
        away = truth - sensor
        bearing = math.atan2(away[1], away[0]) + rng.uniform(-bound, bound)
        strips = embedding.wedge_from_sensor(0, sensor, bearing, bound)
        if step == 0:
            strips = embedding.strips_within(0, sensor, bearing, bound, 40.0)
        for strip in strips:
            result = cut(state, strip)
            assert result.ellipsoid is not None
            state = result.ellipsoid
        assert state.contains(truth, 1e-6), f"seed {seed}"
    assert state.semi_axes.max() < 1.0


def test_bearings_and_ranges_cut_the_same_set() -> None:
    ranges = RangeEmbedding()
    bearings = BearingEmbedding(size=ranges.size)
    truth = np.array([3.0, 4.0])
    state = Ellipsoid.whole_space(ranges.size)
    for anchor in ([0.0, 0.0], [10.0, 0.0], [0.0, 9.0]):
        z = float(np.linalg.norm(truth - anchor))
        strip = ranges.strip_to_anchor(0, anchor, z - 0.5, z + 0.5)
        state = cut(state, strip).ellipsoid or state
    before = state.project(2).volume
    for strip in bearings.wedge_from_sensor(0, [0.0, 0.0], math.atan2(4, 3), 0.01):
        state = cut(state, strip).ellipsoid or state
    assert state.contains(ranges.lift(truth[None]))
    assert state.project(2).volume < 0.8 * before


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: BearingEmbedding(0), "at least one node"),
        (lambda: BearingEmbedding(2, 3), "do not fit"),
        (lambda: BearingEmbedding().wedge_from_sensor(1, [0, 0], 0, 0.1), "no node 1"),
        (lambda: BearingEmbedding().wedge_from_sensor(0, [0, 0], 0, 1.6), "below π/2"),
        (lambda: BearingEmbedding().wedge_from_sensor(0, [0, 0], np.nan, 0.1), "no wedge"),
        (lambda: BearingEmbedding().wedge_from_sensor(0, [0, 0, 0], 0, 0.1), "two finite numbers"),
        (lambda: BearingEmbedding(2).wedge_between(1, 1, 0, 0.1), "cannot see itself"),
        (lambda: BearingEmbedding().strips_within(0, [0, 0], 0, 0.1, 0), "greatest distance"),
    ],
)
def test_bad_input_is_refused_in_a_sentence(make: object, sentence: str) -> None:
    with pytest.raises(NotAMeasurement, match=sentence):
        make()  # type: ignore[operator]
