"""The rule on bodies: whatever robots are told, and whoever of them lives, their discs never overlap."""

from __future__ import annotations

from typing import Final

import numpy as np

from agents.mission import Mission
from launcher.simulation import SimulatedTeam
from launcher.violation import Violation

LOOK_S: Final = 0.1
"""How often it is looked where bodies are: robots that pass through one another at 2.4 m/s overlap for longer."""

ROUNDING_M: Final = 1e-6


class BodyRules:
    """Compares the true places of all robots, every two of them, whenever one has moved. O(n²) a look.

    Args:
        mission: of the team; says how large robots are.
        team: has not begun.
    """

    def __init__(self, mission: Mission, team: SimulatedTeam) -> None:
        self._team = team
        self._robots = [team.peers[robot.name] for robot in mission.robots]
        self._apart_m = 2.0 * mission.robot_radius_m
        self._pairs = np.triu_indices(len(self._robots), 1)
        self._places = np.empty((0, 2))
        """(n, 2) when that was looked at last, metres."""
        team.time.call_at(LOOK_S, self._look)

    def _look(self) -> None:
        places = np.array([peer.place for peer in self._robots]).reshape(-1, 2)
        if not np.array_equal(places, self._places):
            self._places = places
            one, other = self._pairs
            apart_m = np.hypot(*(places[one] - places[other]).T)
            for pair in np.flatnonzero(apart_m < self._apart_m - ROUNDING_M):
                names = f"{self._robots[one[pair]].name} and {self._robots[other[pair]].name}"
                raise Violation("robots do not touch", f"{names} are {apart_m[pair]:.3f} m apart, centre to centre")
        self._team.time.call_at(self._team.time.now_s + LOOK_S, self._look)
