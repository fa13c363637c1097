from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from agents.driver import DiscDriver
from planning.environment import Environment


def test_drives_straight_for_as_long_as_it_was_told() -> None:
    driver = DiscDriver((1.0, 2.0), 2.0)
    driver.advance(10.0)
    driver.drive((1.0, -0.5), 0.4)
    driver.advance(10.3)
    assert driver.pose() == pytest.approx((1.3, 1.85))
    driver.advance(99.0)
    assert driver.pose() == pytest.approx((1.4, 1.8))


def test_a_late_look_does_not_overshoot() -> None:
    early, late = DiscDriver((0.0, 0.0), 1.0), DiscDriver((0.0, 0.0), 1.0)
    for driver, looks in ((early, (0.1, 0.2, 0.25)), (late, (7.0,))):
        driver.advance(0.0)
        driver.drive((1.0, 0.0), 0.25)
        for now_s in looks:
            driver.advance(now_s)
    assert late.pose() == pytest.approx((0.25, 0.0))
    assert early.pose() == pytest.approx(late.pose())


def test_speed_is_limited_and_its_direction_kept() -> None:
    driver = DiscDriver((0.0, 0.0), 0.5)
    driver.advance(0.0)
    driver.drive((30.0, 40.0), 1.0)
    driver.advance(1.0)
    assert driver.pose() == pytest.approx((0.3, 0.4))


def test_time_does_not_run_backwards() -> None:
    driver = DiscDriver((0.0, 0.0), 1.0)
    driver.advance(1.0)
    driver.drive((1.0, 0.0), 1.0)
    driver.advance(1.5)
    driver.advance(1.2)
    driver.advance(1.5)
    assert driver.pose() == pytest.approx((0.5, 0.0))


def test_stops_at_a_wall(corner: Environment) -> None:
    driver = DiscDriver((4.0, 8.0), 100.0, corner)
    driver.advance(0.0)
    driver.drive((2.0, -0.5), 2.0)
    driver.advance(2.0)
    assert driver.pose() == pytest.approx((5.0, 7.75), abs=1e-6)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_never_leaves_free_space_nor_passes_its_speed_limit(seed: int) -> None:
    chance = np.random.default_rng(seed)
    free = Environment([(0, 0), (10, 0), (10, 5), (5, 5), (5, 10), (0, 10)], [[(2, 2), (2, 3), (3, 3), (3, 2)]])
    polygon = shapely.Polygon(free.outer, free.holes).buffer(1e-6)
    driver = DiscDriver((1.0, 1.0), 3.0, free)
    now_s, before = 0.0, driver.pose()
    driver.advance(now_s)
    for _ in range(40):
        driver.drive(tuple(chance.uniform(-6.0, 6.0, 2)), chance.uniform(0.0, 2.0))
        pause_s = chance.uniform(0.0, 2.0)
        now_s += pause_s
        driver.advance(now_s)
        after = driver.pose()
        assert polygon.covers(shapely.LineString([before, after])), f"seed {seed}"
        assert math.dist(before, after) <= 3.0 * pause_s + 1e-9
        before = after
