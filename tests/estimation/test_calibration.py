"""Calibration against known lines, enumeration of the narrowest band, and the chance of the next range."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.calibration import NotCalibrated, calibrate


def ranges_of(rng, n, scale, offset, bound):
    distances = rng.uniform(2, 60, n)
    return distances, (distances + rng.uniform(-bound, bound, n) - offset) / scale


@settings(max_examples=40, deadline=None)
@given(st.floats(0.7, 1.4), st.floats(-2, 2), st.floats(0.01, 3), st.integers(0, 1000))
def test_finds_scale_offset_and_bound(scale, offset, bound, seed):
    distances, measured = ranges_of(np.random.default_rng(seed), 600, scale, offset, bound)
    for line in ("unbiased", "narrowest"):
        found = calibrate(distances, measured, line=line)
        assert found.scale == pytest.approx(scale, abs=0.01 * bound * scale + 1e-9)
        assert found.offset_m == pytest.approx(offset, abs=0.5 * bound + 1e-9)
        assert 0.9 * bound <= found.bound_m <= 1.2 * bound
        assert np.abs(found.read(measured) - distances).max() <= found.bound_m * (1 + 1e-9)


def test_the_narrowest_line_is_the_narrowest():
    """Against all lines that three ranges can decide."""
    rng = np.random.default_rng(8)
    for _ in range(5):
        d, z = ranges_of(rng, 12, 0.93, 0.4, 1.0)
        widths = []
        for i, j in itertools.combinations(range(12), 2):
            slope = (d[i] - d[j]) / (z[i] - z[j])
            widths.append(0.5 * np.ptp(d - slope * z))
        found = calibrate(d, z, line="narrowest")
        assert found.bound_m == pytest.approx(min(widths), rel=1e-7)
        assert found.bound_m <= calibrate(d, z).bound_m


@pytest.mark.parametrize("line", ["unbiased", "narrowest"])
def test_outliers_are_left_out(line):
    rng = np.random.default_rng(11)
    d, z = ranges_of(rng, 500, 0.9345, 0.01, 1.5)
    corrupt = rng.choice(500, 50, replace=False)
    z[corrupt] += rng.uniform(10, 80, 50)
    found = calibrate(d, z, line=line, coverage=0.9)
    assert found.scale == pytest.approx(0.9345, abs=0.01)
    assert found.bound_m < 1.7
    assert (found.kept, found.left_out) == (450, 50)
    assert calibrate(d, z, line=line).bound_m > 4


def test_a_known_scale_leaves_the_offset():
    d, z = ranges_of(np.random.default_rng(1), 300, 1.0, -0.2, 0.1)
    found = calibrate(d, z, scale=1.0)
    assert found.scale == 1.0
    assert found.offset_m == pytest.approx(-0.2, abs=0.02)
    one_distance = calibrate([5.0, 5, 5], [5.3, 5.3, 5.3], scale=1.0, line="narrowest")
    assert one_distance.offset_m == pytest.approx(-0.3)
    assert one_distance.bound_m == pytest.approx(0, abs=1e-12)


def test_the_risk_is_the_share_of_next_ranges_outside():
    rng = np.random.default_rng(21)
    outside, risk = [], 0.0
    for _ in range(1500):
        d, z = ranges_of(rng, 40, 1.0, 0.0, 1.0)
        found = calibrate(d[:-1], z[:-1], scale=1.0)
        risk = found.risk
        outside.append(abs(found.read(z[-1]) - d[-1]) > found.bound_m)
    assert risk == pytest.approx(1 / 40)
    assert np.mean(outside) == pytest.approx(risk, abs=0.015)


def test_data_that_say_nothing_are_refused():
    with pytest.raises(NotCalibrated, match="at least 3"):
        calibrate([1, 2], [1, 2])
    with pytest.raises(NotCalibrated, match="all ranges are alike"):
        calibrate([1, 2, 3], [5, 5, 5])
    with pytest.raises(NotCalibrated, match="finite"):
        calibrate([1, 2, 3], [5, np.nan, 5])
    with pytest.raises(NotCalibrated, match="coverage"):
        calibrate([1, 2, 3], [1, 2, 3], coverage=0.4)
    with pytest.raises(NotCalibrated, match="unbiased, narrowest, not 'straight'"):
        calibrate([1, 2, 3], [1, 2, 3], line="straight")
