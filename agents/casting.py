"""Who plays what: the role and the body of each peer of a mission, the same for both worlds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from agents.base_station import BaseStation
from agents.behaviour import begin
from agents.driver import DiscDriver
from agents.mission import Mission
from agents.robot import Robot
from agents.role import Role
from agents.tracked_agent import TrackedAgent
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from protocol.messages import Point

if TYPE_CHECKING:
    from agents.leader import DeploymentPlanner

CLEARANCE_M = 1e-3
"""Bodies may come this much nearer to walls than their paths do, so that rounding never stops them on a path."""


class Casting:
    """Casts the peers of one mission, and builds only once what several of them need.

    Args:
        mission: as all peers know it.
        environment: its map, as drawn.
        planner: of a casting of the same team on the same map; planners are pure, and large maps take long to prepare.
    """

    def __init__(self, mission: Mission, environment: Environment, planner: DeploymentPlanner | None = None) -> None:
        self._mission = mission
        self._environment = environment
        self._known_planner = planner
        self._inflated: list[tuple[float, Environment]] = []
        self._routes: list[tuple[Environment, GeodesicMap]] = []

    def cast(self, name: str) -> tuple[Role, DiscDriver]:
        """Role and body of a peer.

        Raises:
            KeyError: the name is not on the roster.
            ValueError: the map leaves no room for a disc of its radius where it starts, or cannot be planned on.
        """
        mission, entry = self._mission, self._mission.entry(name)
        match entry.role:
            case "base_station":
                return BaseStation(mission, self._environment, self.planner()), DiscDriver(entry.start, 0.0)
            case "tracked_agent":
                radius_m, speed_m_s = mission.agent_radius_m, mission.agent_speed_m_s
                free = self._free(radius_m, entry.start)
                role: Role = TrackedAgent(mission, free, self._geodesics(free), begin(mission, free))
            case "robot":
                radius_m, speed_m_s = mission.robot_radius_m, mission.robot_speed_m_s
                role = Robot(mission, name, self._geodesics(self._free(radius_m, entry.start)))
        room = self._free(max(radius_m - CLEARANCE_M, 0.0), entry.start)
        return role, DiscDriver(entry.start, speed_m_s, room)

    def planner(self) -> DeploymentPlanner:
        """The planner of the team's leader; built when it is first asked for.

        Raises:
            ValueError: the map cannot be planned on.
        """
        if self._known_planner is None:
            self._known_planner = self._build_planner()
        return self._known_planner

    def _build_planner(self) -> DeploymentPlanner:
        from agents.leader import DeploymentPlanner  # its imports take a quarter of a second, and one peer needs them

        mission = self._mission
        return DeploymentPlanner(
            self._environment,
            mission.base_station.start,
            mission.robot_radius_m,
            mission.decomposition,
            placements=mission.placements,
            search=mission.search,
            spacing_m=mission.spacing_m,
            base_name=mission.base_station.name,
            agent_name=mission.tracked_agent.name,
            robot_speed_m_s=mission.robot_speed_m_s,
            agent_speed_m_s=mission.agent_speed_m_s,
        )

    def _free(self, radius_m: float, start: Point) -> Environment:
        """The map inflated by a radius; the component that holds the start."""
        for known_radius_m, free in self._inflated:
            if known_radius_m == radius_m and free.contains([start])[0]:
                return free
        free = self._environment.inflated(radius_m, containing=start)
        self._inflated.append((radius_m, free))
        return free

    def _geodesics(self, free: Environment) -> GeodesicMap:
        for known, routes in self._routes:
            if known is free:
                return routes
        routes = GeodesicMap(free)
        self._routes.append((free, routes))
        return routes
