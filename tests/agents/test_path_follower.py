from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from agents.path_follower import ARRIVED_M, STANDING, PathFollower, Unreachable
from protocol.messages import Point


class Road:
    """One path, whatever is asked for."""

    def __init__(self, *corners: Point) -> None:
        self.corners = corners

    def path(self, *_: Point) -> NDArray[np.float64]:
        return np.array(self.corners, dtype=np.float64)


class NoRoad:
    def path(self, *_: Point) -> NDArray[np.float64]:
        raise ValueError("(9, 9) is in a wall")


def travel(follower: PathFollower, start: Point) -> tuple[list[Point], float]:
    """Drive leg by leg as the roles do; where it was at each turn, and how long all took."""
    places, time_s = [start], 0.0
    while (leg := follower.steer(places[-1])) != STANDING:
        x, y = places[-1]
        places.append((x + leg.velocity[0] * leg.lasts_s, y + leg.velocity[1] * leg.lasts_s))
        time_s += leg.lasts_s
    return places, time_s


def length(corners: Sequence[Point]) -> float:
    return sum(math.dist(a, b) for a, b in pairwise(corners))


coordinates = st.floats(-50.0, 50.0)


@settings(deadline=None)
@given(st.lists(st.tuples(coordinates, coordinates), min_size=2, max_size=8), st.floats(0.1, 5.0))
def test_drives_the_whole_path_exactly_at_full_speed(corners: list[Point], speed_m_s: float) -> None:
    follower = PathFollower(Road(*corners), speed_m_s)
    follower.go(corners[0], corners[-1])
    places, time_s = travel(follower, corners[0])
    assert follower.arrived
    assert math.dist(places[-1], corners[-1]) <= ARRIVED_M
    assert time_s == pytest.approx(length(corners) / speed_m_s, abs=2 * len(corners) * ARRIVED_M / speed_m_s)
    for corner in corners:
        assert min(math.dist(corner, place) for place in places) <= ARRIVED_M


def test_remaining_path_shrinks_from_its_front() -> None:
    follower = PathFollower(Road((0, 0), (2, 0), (2, 1)), 1.0)
    follower.go((0.0, 0.0), (2.0, 1.0))
    assert follower.remaining((0.5, 0.0)) == ((0.5, 0.0), (2.0, 0.0), (2.0, 1.0))
    follower.steer((2.0, 0.0))
    assert follower.remaining((2.0, 0.5)) == ((2.0, 0.5), (2.0, 1.0))
    follower.steer((2.0, 1.0))
    assert follower.remaining((2.0, 1.0)) == ()


def test_going_where_one_stands_is_arriving() -> None:
    follower = PathFollower(Road((1, 1), (1, 1)), 1.0)
    follower.go((1.0, 1.0), (1.0, 1.0))
    assert follower.arrived
    assert follower.steer((1.0, 1.0)) == STANDING


def test_says_why_a_target_cannot_be_reached_and_stands() -> None:
    follower = PathFollower(NoRoad(), 1.0)
    with pytest.raises(Unreachable, match=r"\(9, 9\) is in a wall"):
        follower.go((0.0, 0.0), (9.0, 9.0))
    assert follower.target is None
    assert follower.steer((0.0, 0.0)) == STANDING
