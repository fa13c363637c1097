"""Who plays what: the role and the body of each peer of a mission, the same for both worlds."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from typing import TYPE_CHECKING

from agents.agent_knowledge import AgentKnowledge
from agents.allegiance import Allegiance
from agents.auction import Auctioneer
from agents.base_station import BaseStation
from agents.behaviour import begin
from agents.certificate_judge import certificate_judge
from agents.collection import Collection
from agents.driver import DiscDriver
from agents.leadership import Leadership
from agents.lot import Lot
from agents.mind import Mind, Part
from agents.mission import Mission, RosterEntry
from agents.planning_job import Answer, Question
from agents.ranging import Ranging, Transponder
from agents.robot import Robot
from agents.role import Role
from agents.shared_estimate import SharedEstimate
from agents.sighted_set import Sight
from agents.standing_orders import StandingOrders
from agents.topology import TeamTree
from agents.tracked_agent import TrackedAgent
from planning.compiled_map import CompiledMap
from planning.environment import Environment
from planning.inflation import NothingLeft
from protocol.messages import Offer, Point, Reign

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
        self._known_team_planner: TeamPlanner | None = None
        self._spaces: list[CompiledMap] = []
        self._judge = certificate_judge(mission, environment)

    def cast(
        self, name: str, *, incarnation: int = 0, promise: Reign | None = None, now_s: float = 0.0
    ) -> tuple[Role, DiscDriver]:
        """Role and body of a peer.

        Args:
            name: of the peer.
            incarnation: of its process.
            promise: the last one on its disk.
            now_s: the present time by its clock.

        Raises:
            KeyError: the name is not on the roster.
            ValueError: the map leaves no room for a disc of its radius where it starts; or the roster is none.
        """
        mission, entry = self._mission, self._mission.entry(name)
        if entry.role == "tracked_agent":
            radius_m, speed_m_s = mission.agent_radius_m, mission.agent_speed_m_s
            space = self._space(radius_m, entry.start)
            body = TrackedAgent(mission, space.free, space.geodesics, begin(mission, space.free), now_s)
            role: Role = Mind([body] if mission.announces else [body, Transponder(mission, self._environment)])
        else:
            allegiance = Allegiance(
                mission.voters, team=mission.team, name=name, incarnation=incarnation, promise=promise,
                seed=mission.seed, heartbeat_s=1.0 / mission.heartbeat_hz, now_s=now_s,
            )  # fmt: skip
            role = self._compose(entry, allegiance, incarnation, now_s)
            radius_m, speed_m_s = mission.robot_radius_m, mission.robot_speed_m_s
        if entry.role == "base_station":
            return role, DiscDriver(entry.start, 0.0)
        room = self._space(max(radius_m - CLEARANCE_M, 0.0), entry.start).free
        return role, DiscDriver(entry.start, speed_m_s, room)

    def _compose(self, entry: RosterEntry, allegiance: Allegiance, incarnation: int, now_s: float) -> Mind:
        """The mind of a peer with a vote: whom it follows, what it knows, body, tree, leading. In this order."""
        mission = self._mission
        orders, collection = StandingOrders(allegiance), Collection(allegiance, mission.tracked_agent.name)
        body: Robot | BaseStation
        if entry.role == "robot":
            robot = body = Robot(mission, entry.name, self._judge, allegiance, orders, collection, now_s)
        else:
            robot, body = None, BaseStation(mission, self._environment, orders, collection, now_s)
        knowing: list[Part] = [allegiance, orders, collection]
        estimate = None
        if not mission.announces:
            estimate = SharedEstimate(mission, entry.name, incarnation, self.sight)
            knowing += [estimate, Ranging(mission, entry.name, estimate)]
        planner = _Planner(self.team_planner)
        negotiating: list[Part] = [
            tree := TeamTree(mission, self._environment, allegiance, orders, collection, robot, estimate)
        ]
        auctioneer = None
        if mission.topology == "auction":
            auctioneer = Auctioneer(allegiance, planner, mission.base_station.name)
            negotiating.append(auctioneer)
        agent = AgentKnowledge(collection, estimate)
        leadership = Leadership(mission, allegiance, tree, orders, collection, agent, planner, auctioneer, robot, now_s)
        return Mind([*knowing, body, *negotiating, leadership])

    @cached_property
    def sight(self) -> Sight:
        """For the estimate: where the agent's body can be, and from where it is seen."""
        mission = self._mission
        room = self._space(max(mission.agent_radius_m - CLEARANCE_M, 0.0), mission.tracked_agent.start).free
        return Sight(self._environment, room)

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
        if self._known_team_planner is None:
            self._known_team_planner = self._build_team_planner()
        return self._known_team_planner

    def _build_team_planner(self) -> TeamPlanner:
        from agents.motion_planner import MotionPlanner
        from agents.roaming import Roaming
        from agents.team_planner import TeamPlanner

        mission, deployments = self._mission, self.planner()
        motions = MotionPlanner(mission, self._environment, deployments.graph, self._judge)
        speed_m_s, agent = mission.agent_speed_m_s, mission.tracked_agent
        space = self._space(mission.agent_radius_m, agent.start)
        home = mission.base_station.start
        roaming = None if mission.announces else Roaming(space.geodesics, speed_m_s, home)
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
            search="one-edge" if mission.topology == "auction" else mission.search,
            spacing_m=mission.spacing_m,
            base_name=mission.base_station.name,
            agent_name=mission.tracked_agent.name,
            robot_speed_m_s=mission.robot_speed_m_s,
            agent_speed_m_s=mission.agent_speed_m_s,
            range_bound_m=mission.ranging.bound_m,
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


class _Planner:
    """The team's planner, built when it is first wanted: beside the control loop of whoever wants it."""

    def __init__(self, build: Callable[[], TeamPlanner]) -> None:
        self._build = build

    def prepare(self) -> None:
        self._build()

    def lot(self, question: Question) -> Lot:
        return self._build().lot(question)

    def bid(self, lot: Lot, bidder: str) -> tuple[Offer, ...]:
        return self._build().bid(lot, bidder)

    def plan(self, question: Question) -> Answer:
        return self._build().plan(question)
