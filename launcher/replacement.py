"""Starting a peer of a running team that is gone: the same body again, or another one that takes over its name.

Votes are by name, so a replacement changes no majority: it is another incarnation of the peer that it replaces, rests
as every voter that starts again, and keeps what the one before has promised.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from agents.mission import Mission
from launcher.ground import Ground
from launcher.scenario import ScenarioFault
from launcher.supervisor import Supervisor
from launcher.wording import text_of
from protocol.messages import Point

CLEAR_M: Final = 1.0
"""Another body is put down no nearer to the others' discs: who drives stops when it is heard of, not before."""

AT: Final = "--at"


class Replacements:
    """Starts peers that have no process.

    Args:
        mission: the team's.
        ground: its map.
        supervisor: of its processes.
        find: where the body of a peer is.
    """

    def __init__(
        self, mission: Mission, ground: Ground, supervisor: Supervisor, find: Callable[[str], Point | None]
    ) -> None:
        self._mission = mission
        self._ground = ground
        self._supervisor = supervisor
        self._find = find

    def start(self, name: str, at: Point | None) -> str:
        """Start a peer; a sentence if that cannot be done as asked, and nothing has been done then.

        Args:
            name: on the roster.
            at: where its body is, metres; where it was when the last process ended if None.
        """
        try:
            if at is not None:
                self._check_place(name, at)
        except ScenarioFault as problem:
            return str(problem)
        return "" if self._supervisor.start(name, at) else f"{name} has a process; start those that have none"

    def _check_place(self, name: str, at: Point) -> None:
        mission = self._mission
        if name not in {robot.name for robot in mission.robots}:
            raise ScenarioFault(f"{AT} {text_of(at)} is for robots, and {name} is none; leave it out")
        self._ground.check_walk(
            "robots.radius_m", {AT: at}, mission.robot_radius_m, mission.base_station.start, "base.position"
        )
        for entry in (mission.tracked_agent, *mission.robots):
            place = self._find(entry.name) or entry.start
            radius_m = mission.agent_radius_m if entry is mission.tracked_agent else mission.robot_radius_m
            least_m = mission.robot_radius_m + radius_m + CLEAR_M
            if entry.name != name and math.dist(at, place) < least_m:
                raise ScenarioFault(
                    f"{AT} {text_of(at)} is {math.dist(at, place):.2f} m from {entry.name}, which may be driving; "
                    f"keep {least_m:.2f} m away from everybody"
                )
