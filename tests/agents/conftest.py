"""A small mission on a small map, and roads that are straight lines."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from agents.mission import Mission, OnDemand, RosterEntry
from planning.environment import Environment
from protocol.messages import Point


class StraightRoutes:
    """Geodesics of a square of 100 m without walls in it."""

    def path(self, p: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
        places = np.array([p, q], dtype=np.float64)
        if np.abs(places).max() > 50.0:
            raise ValueError("not in free space")
        return places


@pytest.fixture
def routes() -> StraightRoutes:
    return StraightRoutes()


@pytest.fixture
def corner() -> Environment:
    """An L: the square of 10 m without its upper right quarter. The corner is at (5, 5)."""
    return Environment([(0, 0), (10, 0), (10, 5), (5, 5), (5, 10), (0, 10)], name="corner")


@pytest.fixture
def mission() -> Mission:
    return make_mission()


def make_mission() -> Mission:
    def enlist(name: str, role: str, start: Point) -> RosterEntry:
        return RosterEntry(name=name, role=role, start=start)  # type: ignore[arg-type]

    return Mission(
        team="team",
        map_path="corner.json",
        roster=(
            enlist("base", "base_station", (1.0, 1.0)),
            enlist("agent", "tracked_agent", (2.0, 1.0)),
            enlist("robot1", "robot", (1.0, 2.0)),
            enlist("robot2", "robot", (1.0, 3.0)),
        ),
        behaviour=OnDemand(),
        robot_radius_m=0.2,
        agent_radius_m=0.2,
        robot_speed_m_s=1.0,
        agent_speed_m_s=0.5,
        control_hz=10.0,
        heartbeat_hz=2.0,
        planning_period_s=0.5,
        decomposition="inflection",
        duration_s=30.0,
        seed=1,
        epoch_unix_s=1.7e9,
    )
