"""A team whose planning costs next to nothing, so that thousands of missions can be looked at: the roles are complete.

The room is empty and convex, so that everybody sees everybody. Each robot has a lane of its own along the room, and
never leaves it; so nobody is in anybody's way, and every motion is safe. What is planned is who are the relays, and how
far along its lane each robot goes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from random import Random
from typing import Any, Final

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from agents.casting import Casting
from agents.driver import DiscDriver
from agents.leader import Plan
from agents.mission import Mission
from agents.motion_planner import Course, Option
from agents.planning_job import Answer, Question
from agents.role import Role
from planning.compiled_map import CompiledMap
from planning.environment import Environment
from protocol.messages import MemberWay, Motion, Placement, Point, Reign

WIDTH_M: Final = 24.0
DEPTH_M: Final = 12.0
RADIUS_M: Final = 0.2
LINK_M: Final = 5.0
"""Relays are to be no farther apart than this."""
KEPT_M: Final = 1.0
"""Places that are off by less are kept."""
STAGES_M: Final = (0.5, 0.5, 0.2)
"""Lengths of stages; short ones are released several at a time."""


class OpenRoom(Environment):
    """A rectangle with nothing in it: it says at once who sees whom."""

    def __init__(self) -> None:
        super().__init__([(0, 0), (WIDTH_M, 0), (WIDTH_M, DEPTH_M), (0, DEPTH_M)], name="open room")

    def line_of_sight(self, p: Any, q: Any) -> Any:
        """Always."""
        shape = np.broadcast_shapes(np.shape(p)[:-1], np.shape(q)[:-1])
        return np.ones(shape, dtype=bool) if shape else True

    def visibility_matrix(self, points: Any) -> NDArray[np.bool_]:
        """All of them."""
        return np.ones((len(points), len(points)), dtype=bool)


ROOM: Final = OpenRoom()
_SPACES: Final[list[CompiledMap]] = []
"""The room inflated by the radii, for all missions."""


def lane(robot: int) -> Point:
    """Where a robot starts, the first being number 0: the lanes are a metre apart."""
    return 1.0, 1.0 + robot


class LightPlanner:
    """Relays at equal distances between base station and agent, those first that are far along already."""

    def __init__(self, mission: Mission) -> None:
        self._base, self._agent = mission.base_station, mission.tracked_agent.name
        self._speed_m_s = mission.robot_speed_m_s
        self._stage_m = Random(f"{mission.seed}/stages").choice(STAGES_M)

    def prepare(self) -> None:
        """Nothing is wanted."""

    def plan(self, question: Question) -> Answer:
        """Who goes where, and how."""
        robots = {name: place for name, place in question.onset.places.items() if name != self._base.name}
        plan = self._deploy(self._ahead_m(question), robots, question.previous)
        goals = {place.robot: place.position for place in plan.placements}
        if not robots or goals == question.heading:
            return Answer(plan, None)
        motion = self._move(question.onset.places, goals, question.lost)
        return Answer(plan, Course(question.onset.continued(motion), Option(goals, ()), arrives=True))

    def _ahead_m(self, question: Question) -> float:
        """How far the agent is from the base station, along the lanes."""
        if question.way:
            return question.way[0][0]
        return self._base.start[0] if question.target is None else question.target.center[0]

    def _deploy(self, agent_m: float, robots: Mapping[str, Point], previous: Plan | None) -> Plan:
        base_m = self._base.start[0]
        needed = max(0, math.ceil(abs(agent_m - base_m) / LINK_M) - 1)
        chain = sorted(robots, key=lambda name: (-robots[name][0], name))[:needed]
        chain.reverse()
        before = {place.robot: place.position[0] for place in previous.placements} if previous is not None else {}
        placements = []
        for number, name in enumerate((*chain, *sorted(robots.keys() - set(chain)))):
            spare = number >= len(chain)
            place_m = base_m if spare else base_m + (agent_m - base_m) * (number + 1) / (len(chain) + 1)
            if abs(before.get(name, math.inf) - place_m) < KEPT_M:
                place_m = before[name]
            placements.append(Placement(robot=name, position=(place_m, robots[name][1]), spare=spare))
        serves = len(chain) == needed
        names = (self._base.name, *chain, *([self._agent] if serves else []))
        reason = f"the agent is {agent_m:.1f} m along"
        return Plan(tuple(placements), tuple(pairwise(names)), float(needed), needed, serves, reason)

    def _move(
        self, starts: Mapping[str, Point], goals: Mapping[str, Point], lost: Mapping[str, NDArray[np.float64]]
    ) -> Motion:
        goals = {name: goals.get(name, place) for name, place in starts.items()}
        longest_m = max(math.dist(place, goals[name]) for name, place in starts.items())
        stages = max(1, math.ceil(longest_m / self._stage_m))
        ways = [self._way(name, place, goals[name], stages) for name, place in starts.items()]
        ways += [
            structs.replace(self._way(name, _point(way[0]), _point(way[-1]), stages), scheduled=False)
            for name, way in lost.items()
        ]
        return Motion(plan=0, revision=0, first_stage=0, released=-1, ways=tuple(ways), connection="none")

    def _way(self, name: str, start: Point, goal: Point, stages: int) -> MemberWay:
        marks = range(stages + 1) if start != goal else (0,) * (stages + 1)
        shares = [mark / stages for mark in dict.fromkeys(marks)]
        (ax, ay), (bx, by) = start, goal
        waypoints = [(ax + share * (bx - ax), ay + share * (by - ay)) for share in shares]
        waypoints[-1] = goal if start != goal else start
        radius_m = 0.0 if name == self._base.name else RADIUS_M
        return MemberWay(
            member=name, radius_m=radius_m, speed_m_s=self._speed_m_s, waypoints=tuple(waypoints), stages=tuple(marks)
        )


class LightCasting(Casting):
    """Casts the roles of the live system, with this planner, and bodies that nothing keeps from going where they go."""

    def __init__(self, mission: Mission) -> None:
        super().__init__(mission, ROOM)
        self._spaces = _SPACES
        self._judge = _approve
        self._light = LightPlanner(mission)

    def team_planner(self) -> Any:
        """The light one."""
        return self._light

    def cast(
        self, name: str, *, incarnation: int = 0, promise: Reign | None = None, now_s: float = 0.0
    ) -> tuple[Role, DiscDriver]:
        """Role and body of a peer."""
        role, _ = super().cast(name, incarnation=incarnation, promise=promise, now_s=now_s)
        entry = self._mission.entry(name)
        speeds = {"robot": self._mission.robot_speed_m_s, "tracked_agent": self._mission.agent_speed_m_s}
        return role, DiscDriver(entry.start, speeds.get(entry.role, 0.0))


def _approve(_motion: Motion) -> str:
    return ""


def _point(place: Sequence[float] | NDArray[np.float64]) -> Point:
    return float(place[0]), float(place[1])
