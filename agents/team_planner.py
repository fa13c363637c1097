"""What the leader computes beside its control loop: where everybody is to stand, and how everybody gets there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from agents.assignment import assign
from agents.movement_authority import Onset
from planning.foresight import length, walk
from protocol.messages import Point

if TYPE_CHECKING:
    from agents.leader import DeploymentPlanner, Plan
    from agents.motion_planner import Course, MotionPlanner

Floats = NDArray[np.float64]

EXCHANGED: Final = "; robots exchange places, so that none has to overtake"
"""Added to the reason of a plan."""


@dataclass(frozen=True, eq=False)
class Question:
    """What is known when a plan is asked for."""

    way: tuple[Point, ...]
    """The agent's, from where it is."""
    onset: Onset
    """Where the robots will be when a new motion can begin."""
    lead_s: float
    """How long it is until then."""
    previous: Plan | None
    """The plan before."""
    heading: Mapping[str, Point]
    """Where the motion under way leads; empty if there is none, or it does not lead to the goals."""
    lost: Mapping[str, Floats] = field(default_factory=dict)
    """(m, 2) each: where robots may be that are not heard any more."""


@dataclass(frozen=True, eq=False)
class Answer:
    """A plan and the motion to it."""

    plan: Plan
    course: Course | None
    """None: the motion under way leads there."""
    failure: str = ""
    """Why there is no course, if there should be one."""


class TeamPlanner:
    """Both planners, one after the other. Every answer is a function of the question alone."""

    def __init__(self, deployments: DeploymentPlanner, motions: MotionPlanner, agent_speed_m_s: float) -> None:
        self._deployments, self._motions = deployments, motions
        self._agent_speed_m_s = agent_speed_m_s

    def plan(self, question: Question) -> Answer:
        """Who is to stand where, for the agent as it will be when the robots can begin to go there, and how."""
        onset = question.onset
        way = _without(np.array(question.way, dtype=np.float64), question.lead_s * self._agent_speed_m_s)
        robots = {name: place for name, place in onset.places.items() if name != self._motions.base}
        obstacles = [place for lost in question.lost.values() for place in _points(lost)]
        plan = self._deployments.plan(_point(way[0]), _points(way), robots, question.previous, obstacles)
        plan = self._exchange(plan, robots, question.previous)
        goals = {placement.robot: placement.position for placement in plan.placements}
        if not robots or goals == question.heading:
            return Answer(plan, None)
        ends = tuple(
            dict.fromkeys(
                relays[-1]
                for known in (plan, question.previous)
                if known is not None
                and (relays := [place.robot for place in known.placements if not place.spare and place.robot in robots])
            )
        )
        try:
            return Answer(plan, self._motions.plan(onset, goals, ends, way, question.lost))
        except ValueError as problem:
            return Answer(plan, None, str(problem))

    def _exchange(self, plan: Plan, robots: Mapping[str, Point], previous: Plan | None) -> Plan:
        """The same places, and nobody overtakes: the search for relays has not looked at who is in whose way."""
        before = {} if previous is None else {place.robot: place.position for place in previous.placements}
        names = assign(self._motions.geodesics, robots, [place.position for place in plan.placements], before)
        renamed = {place.robot: name for place, name in zip(plan.placements, names, strict=True)}
        if all(old == new for old, new in renamed.items()):
            return plan
        placements = tuple(structs.replace(place, robot=renamed[place.robot]) for place in plan.placements)
        edges = tuple((renamed.get(one, one), renamed.get(other, other)) for one, other in plan.edges)
        reason = plan.reason.removesuffix(EXCHANGED) + EXCHANGED
        return replace(plan, placements=placements, edges=edges, reason=reason)


def _without(way: Floats, length_m: float) -> Floats:
    """What is left of a way (m, 2) after its first metres, at least its end."""
    passed_m = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))))
    length_m = min(length_m, length(way))
    return np.concatenate((walk(way, np.array([length_m])), way[passed_m > length_m]))


def _points(places: Floats) -> list[Point]:
    return [_point(place) for place in places]


def _point(place: Floats) -> Point:
    return float(place[0]), float(place[1])
