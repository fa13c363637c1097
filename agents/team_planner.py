"""What the leader computes beside its control loop: where everybody is to stand, and how everybody gets there."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np
import shapely
from msgspec import structs
from numpy.typing import NDArray

from agents.assignment import assign
from agents.lot import Lot
from agents.motion_planner import Option
from agents.planning_job import Answer, Question
from agents.roaming import Roaming
from agents.whereabouts import Whereabouts, announce, name_place
from planning.foresight import tail
from planning.reach_in_sight import time_in_sight
from protocol.messages import Offer, Point

if TYPE_CHECKING:
    from agents.leader import DeploymentPlanner, Plan
    from agents.motion_planner import MotionPlanner
    from planning.environment import Environment

Floats = NDArray[np.float64]

LOOKED_AHEAD_S: Final = 60.0

EXCHANGED: Final = "; places exchanged, so that none has to overtake"
"""Added to the reason of a plan."""


class TeamPlanner:
    """Both planners, one after the other. Every answer is a function of the question alone.

    Args:
        environment: the map as drawn.
        deployments: who stands where.
        motions: who goes how.
        agent_speed_m_s: the most that the agent can go.
        roaming: where it can go if it does not announce its way; None: it does.
    """

    def __init__(
        self,
        environment: Environment,
        deployments: DeploymentPlanner,
        motions: MotionPlanner,
        agent_speed_m_s: float,
        roaming: Roaming | None = None,
    ) -> None:
        self._environment, self._deployments, self._motions = environment, deployments, motions
        self._agent_speed_m_s, self._roaming = agent_speed_m_s, roaming
        self._radius_m = deployments.graph.radius_m

    def plan(self, question: Question) -> Answer:
        """Who is to stand where, for the agent as it will be when the robots can begin to go there, and how.

        Robots that say that they are where no robot can be are left out, and the answer says so.
        """
        question, nowhere = self._set_right(question)
        answer = self._answer(question)
        if not nowhere:
            return answer
        if answer.course is None:
            return replace(answer, plan=replace(answer.plan, reason=f"{answer.plan.reason}; {nowhere}"))
        reasons = [reason for reason in (answer.course.reason, nowhere) if reason]
        return replace(answer, course=replace(answer.course, reason="; ".join(reasons)))

    def _answer(self, question: Question) -> Answer:
        onset = question.onset
        agent = self._expect(question)
        robots = {name: place for name, place in onset.places.items() if name != self._motions.base}
        obstacles = [place for lost in question.lost.values() for place in _points(lost)]
        plan = self._deployments.plan(agent, robots, question.previous, obstacles, question.bids)
        last = _last_relay(plan)
        watcher = onset.places[self._motions.base if last is None else last]
        in_sight_s = min(LOOKED_AHEAD_S, self._time_in_sight(watcher, question))
        if not robots or _goals(plan) == question.heading:
            return Answer(plan, None, in_sight_s=in_sight_s)
        going = {name for name, place in _goals(plan).items() if place != robots[name]}
        plans = [plan, *(self._exchange(plan, robots, among, question.previous) for among in (going, robots))]
        options = {_option(choice, question.previous, robots): choice for choice in dict.fromkeys(plans)}
        try:
            course = self._motions.plan(onset, list(options), agent, question.lost)
        except ValueError as problem:
            return Answer(plan, None, str(problem), in_sight_s)
        return Answer(options[course.option], course, in_sight_s=in_sight_s)

    def lot(self, question: Question) -> Lot:
        """What to auction before the question is answered."""
        question, _ = self._set_right(question)
        robots = {name: place for name, place in question.onset.places.items() if name != self._motions.base}
        obstacles = [place for lost in question.lost.values() for place in _points(lost)]
        return self._deployments.lot(self._expect(question), robots, question.previous, obstacles)

    def bid(self, lot: Lot, bidder: str) -> tuple[Offer, ...]:
        """What a member of the team offers in an auction."""
        return self._deployments.bid(lot, bidder)

    def _set_right(self, question: Question) -> tuple[Question, str]:
        """The question with everybody where a robot can be, and who is left out, in words; empty: nobody."""
        places: dict[str, Point] = {}
        nowhere = []
        for name, place in question.onset.places.items():
            inside = place if name == self._motions.base else self._nearest(place)
            if inside is None:
                nowhere.append(f"{name} says that it is at {name_place(place)}, where no robot can be, and is left out")
            else:
                places[name] = inside
        lost = {}
        for name, where in question.lost.items():
            inside_too = [place for place in map(self._nearest, _points(where)) if place is not None]
            if inside_too:
                lost[name] = np.array(inside_too)
        previous = question.previous
        if previous is not None:  # of a leader before, who may have said anything
            kept = tuple(place for place in previous.placements if self._nearest(place.position) == place.position)
            gone = [place for place in previous.placements if place not in kept]
            previous = None if any(not place.spare for place in gone) else replace(previous, placements=kept)
        onset = replace(question.onset, places=places)
        return replace(question, onset=onset, lost=lost, previous=previous), "; ".join(nowhere)

    def _nearest(self, place: Point) -> Point | None:
        """Where a robot is that says that it is there; None if no robot can be so near to it as its radius."""
        x, y = self._motions.geodesics.nearest(place).tolist()
        return (x, y) if math.dist((x, y), place) <= self._radius_m else None

    def _time_in_sight(self, watcher: Point, question: Question) -> float:
        """From the onset on; the agent may have gone anywhere until then."""
        speed_m_s = self._agent_speed_m_s
        target = question.way[:1] if question.target is None else _hull(question.target.samples)
        if not len(target):
            return 0.0
        return time_in_sight(self._environment, watcher, target, speed_m_s, question.lead_s * speed_m_s)

    def _expect(self, question: Question) -> Whereabouts:
        """Where the agent may be when the robots can begin to go."""
        if self._roaming is None:
            return announce(tail(question.way, question.lead_s * self._agent_speed_m_s))
        return self._roaming.whereabouts(question.target, question.drift_m_s, question.lead_s)

    def _exchange(self, plan: Plan, robots: Mapping[str, Point], among: Collection[str], previous: Plan | None) -> Plan:
        """The same places, but none of some robots overtakes another: the search for relays does not ask that."""
        before = {} if previous is None else {place.robot: place.position for place in previous.placements}
        theirs = [place for place in plan.placements if place.robot in among]
        starts = {name: place for name, place in robots.items() if name in among}
        names = assign(self._motions.geodesics, starts, [place.position for place in theirs], before)
        renamed = {place.robot: name for place, name in zip(theirs, names, strict=True)}
        if all(old == new for old, new in renamed.items()):
            return plan
        placements = tuple(
            structs.replace(place, robot=renamed.get(place.robot, place.robot)) for place in plan.placements
        )
        edges = tuple((renamed.get(one, one), renamed.get(other, other)) for one, other in plan.edges)
        reason = plan.reason.removesuffix(EXCHANGED) + EXCHANGED
        return replace(plan, placements=placements, edges=edges, reason=reason)


def _goals(plan: Plan) -> dict[str, Point]:
    return {placement.robot: placement.position for placement in plan.placements}


def _option(plan: Plan, before: Plan | None, robots: Collection[str]) -> Option:
    relays = [_last_relay(known) for known in (plan, before) if known is not None]
    return Option(_goals(plan), [name for name in dict.fromkeys(relays) if name is not None and name in robots])


def _last_relay(plan: Plan) -> str | None:
    relays = [placement.robot for placement in plan.placements if not placement.spare]
    return relays[-1] if relays else None


def _hull(places: Sequence[Point]) -> Floats:
    """The corners of the convex hull, (n, 2)."""
    return np.asarray(shapely.get_coordinates(shapely.MultiPoint(places).convex_hull))


def _points(places: Floats) -> list[Point]:
    return [_point(place) for place in places]


def _point(place: Floats) -> Point:
    return float(place[0]), float(place[1])
