from __future__ import annotations

import pytest

from agents.mission import Mission, OnDemand, RosterEntry


@pytest.fixture
def mission() -> Mission:
    """A base station, an agent and two robots in a room."""
    roster = (
        RosterEntry(name="base", role="base_station", start=(1.0, 1.0)),
        RosterEntry(name="agent", role="tracked_agent", start=(2.0, 1.0)),
        RosterEntry(name="robot1", role="robot", start=(1.0, 2.0)),
        RosterEntry(name="robot2", role="robot", start=(2.0, 2.0)),
    )
    return Mission(
        team="team",
        map_path="map.json",
        roster=roster,
        behaviour=OnDemand(),
        robot_radius_m=0.2,
        agent_radius_m=0.2,
        robot_speed_m_s=1.0,
        agent_speed_m_s=1.0,
        control_hz=10.0,
        heartbeat_hz=2.0,
        planning_period_s=0.5,
        decomposition="inflection",
        duration_s=10.0,
        seed=0,
        epoch_unix_s=0.0,
    )
