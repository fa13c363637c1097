"""Who plays what: the role and the body of each peer of a mission, the same for both worlds."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from agents.base_station import BaseStation
from agents.behaviour import begin
from agents.certificate_judge import certificate_judge
from agents.driver import DiscDriver
from agents.mission import Mission
from agents.robot import Robot
from agents.role import Role
from agents.tracked_agent import TrackedAgent
from planning.compiled_map import CompiledMap
from planning.environment import Environment
from planning.inflation import NothingLeft
from protocol.messages import Point

if TYPE_CHECKING:
    from agents.leader import DeploymentPlanner
    from agents.team_planner import TeamPlanner

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
        self._spaces: list[CompiledMap] = []
        self._judge = certificate_judge(mission, environment)

    def cast(self, name: str) -> tuple[Role, DiscDriver]:
        """Role and body of a peer.

        Raises:
            KeyError: the name is not on the roster.
            ValueError: the map leaves no room for a disc of its radius where it starts, or cannot be planned on.
        """
        mission, entry = self._mission, self._mission.entry(name)
        match entry.role:
            case "base_station":
                return BaseStation(mission, self._environment, self.team_planner()), DiscDriver(entry.start, 0.0)
            case "tracked_agent":
                radius_m, speed_m_s = mission.agent_radius_m, mission.agent_speed_m_s
                space = self._space(radius_m, entry.start)
                role: Role = TrackedAgent(mission, space.free, space.geodesics, begin(mission, space.free))
            case "robot":
                radius_m, speed_m_s = mission.robot_radius_m, mission.robot_speed_m_s
                role = Robot(mission, name, self._judge)
        room = self._space(max(radius_m - CLEARANCE_M, 0.0), entry.start).free
        return role, DiscDriver(entry.start, speed_m_s, room)

    def planner(self) -> DeploymentPlanner:
        """The planner of the team's leader; built when it is first asked for.

        Raises:
            ValueError: the map cannot be planned on.
        """
        if self._known_planner is None:
            self._known_planner = self._build_planner()
        return self._known_planner

    def team_planner(self) -> TeamPlanner:
        """What the leader plans with. Raises as :meth:`planner`."""
        from agents.motion_planner import MotionPlanner
        from agents.roaming import Roaming
        from agents.team_planner import TeamPlanner

        mission, deployments = self._mission, self.planner()
        motions = MotionPlanner(mission, self._environment, deployments.graph, self._judge)
        speed_m_s, agent = mission.agent_speed_m_s, mission.tracked_agent
        space = self._space(mission.agent_radius_m, agent.start)
        roaming = None if mission.announces else Roaming(space.geodesics, speed_m_s)
        return TeamPlanner(self._environment, deployments, motions, speed_m_s, roaming)

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

    def _space(self, radius_m: float, start: Point) -> CompiledMap:
        """Where a disc of this radius can go from its start, compiled.

        Where the base station's part of the map holds the start too, it is that one, which is then kept for the team
        and not for every start.
        """
        for known in self._spaces:
            if known.radius_m == radius_m and known.free.contains([start])[0]:
                return known
        space = CompiledMap(self._environment, radius_m=radius_m, containing=self._mission.base_station.start)
        with suppress(NothingLeft):
            if space.free.contains([start])[0]:
                self._spaces.append(space)
                return space
        space = CompiledMap(self._environment, radius_m=radius_m, containing=start)
        self._spaces.append(space)
        return space
