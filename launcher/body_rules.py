"""The rule on bodies: whatever robots are told, and whoever of them lives, their discs never overlap."""

from __future__ import annotations

import math
from typing import Final

from agents.mission import Mission
from launcher.simulation import SimulatedTeam
from launcher.violation import Violation
from protocol.messages import Point

LOOK_S: Final = 0.1
"""How often it is looked where bodies are: robots that pass through one another at 2.4 m/s overlap for longer."""

ROUNDING_M: Final = 1e-6


class BodyRules:
    """Compares the true place of every robot that has moved with those of all others. O(m n) a look for m that have.

    Args:
        mission: of the team; says how large robots are.
        team: has not begun.
    """

    def __init__(self, mission: Mission, team: SimulatedTeam) -> None:
        self._team = team
        self._robots = [team.peers[robot.name] for robot in mission.robots]
        self._apart_m = 2.0 * mission.robot_radius_m - ROUNDING_M
        self._places: dict[str, Point] = {}
        """When that was looked at last."""
        team.time.call_at(LOOK_S, self._look)

    def _look(self) -> None:
        places = {peer.name: peer.place for peer in self._robots}
        if places != self._places:
            before, self._places = self._places, places
            for name, place in places.items():
                if before.get(name) != place:
                    self._judge(name, place)
        self._team.time.call_at(self._team.time.now_s + LOOK_S, self._look)

    def _judge(self, name: str, place: Point) -> None:
        for other, where in self._places.items():
            if other != name and (apart_m := math.dist(place, where)) < self._apart_m:
                text = f"{name} and {other} are {apart_m:.3f} m apart, centre to centre"
                raise Violation("robots do not touch", text)
