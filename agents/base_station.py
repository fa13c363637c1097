"""The base station: the fixed end of the chain, and in this version the leader.

It hears where robots and agent are, has deployments planned beside its control loop, and publishes them. A *decision*
is a choice of links and relay places. While one stands it is repeated, with a rising authority sequence and the spares'
places brought up to date; the decision's number rises only when links or relay places change.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Final, Literal, Protocol

from msgspec import structs

from agents.mission import Mission
from agents.records import Connectivity, Decision, LogLine, Planned, Track
from agents.rhythm import EARLY_S, Rhythm
from agents.role import (
    Compute,
    Effect,
    Event,
    Heard,
    JobDone,
    Publish,
    Record,
    WakeAt,
    Woken,
)
from planning.connectivity import algebraic_connectivity, component_labels
from planning.environment import Environment
from protocol.bus import PeerAppeared, PeerVanished
from protocol.messages import AnyBody, Authority, Deployment, Heartbeat, Intent, Mode, Placement, Point, State

if TYPE_CHECKING:
    from agents.leader import Plan

GRACE_S: Final = 1.5
"""The first deployment waits so long for robots that have not been heard yet."""

REPETITIONS: Final = 4
"""A deployment is said so often within its validity: a robot holds only when all of these are lost."""

PLANNING: Final = "planning"
"""Name of the planning job."""


def silence_s(control_hz: float) -> float:
    """Who has not said where it is for so long is not counted on: another robot gets its place."""
    return max(1.0, 3.0 / control_hz)


class Planner(Protocol):
    """What is used of :class:`agents.leader.DeploymentPlanner`. Pure, so that it can run beside the control loop."""

    def plan(
        self, agent: Point, agent_path: Sequence[Point], robots: Mapping[str, Point], previous: Plan | None
    ) -> Plan:
        """Who is to stand where, now that agent and robots are there."""


@dataclass(frozen=True, slots=True)
class Known:
    """What was last heard of a peer."""

    body: State | Intent
    heard_s: float


class BaseStation:
    """Leads the team.

    The epoch is the mission time, in milliseconds, at which this incarnation began: a base station that was started
    again outranks what its predecessor said, without a file.

    Args:
        mission: roster, rates and periods.
        environment: the map as drawn, for the true lines of sight between the places heard.
        planner: decides on deployments.
    """

    hears = frozenset({"state", "intent"})

    def __init__(self, mission: Mission, environment: Environment, planner: Planner) -> None:
        self._mission = mission
        self._environment = environment
        self._planner = planner
        self._name = mission.base_station.name
        self._position = mission.base_station.start
        self._agent = mission.tracked_agent.name
        self._robots = tuple(robot.name for robot in mission.robots)
        self._silent_s = silence_s(mission.control_hz)
        self._known: dict[str, Known] = {}
        self._epoch = self._sequence = self._decisions = 0
        self._plan: Plan | None = None
        self._said: Deployment | None = None
        self._planning = self._urgent = False
        self._failure = ""
        """Of planning; said once, however often it happens."""
        self._effects: list[Effect] = []

    def start(self, now_s: float, position: Point) -> Sequence[Effect]:
        """Begin the rhythms: control with state, heartbeat, planning."""
        self._epoch = max(0, round(1000.0 * now_s))
        self._grace_until_s = now_s + GRACE_S
        self._control = Rhythm(1.0 / self._mission.control_hz, now_s)
        self._heartbeat = Rhythm(1.0 / self._mission.heartbeat_hz, now_s)
        self._replanning = Rhythm(self._mission.planning_period_s, now_s)
        self._repeat_at_s = math.inf
        return self.handle(Woken(position), now_s)

    def handle(self, event: Event, now_s: float) -> Sequence[Effect]:
        """Listen; plan and speak when it is time or when something has happened."""
        match event:
            case Woken(position):
                self._position = position
            case Heard(_, envelope):
                self._listen(envelope.sender, envelope.body, now_s)
            case PeerVanished(peer):
                self._lose(peer, "its process has ended or cannot be reached")
            case JobDone(job=name) if name == PLANNING:
                self._planned(event, now_s)
            case JobDone() | PeerAppeared():
                pass
        if not isinstance(event, Woken) and not self._urgent and not self._effects:
            return ()
        self._live(now_s)
        effects, self._effects = self._effects, []
        return effects

    def _listen(self, peer: str, body: AnyBody, now_s: float) -> None:
        """Learn where a robot or the agent is. Whoever is new, and a new goal of the agent, ask for a plan at once."""
        if not (
            (isinstance(body, State) and peer in self._robots) or (isinstance(body, Intent) and peer == self._agent)
        ):
            return
        before = self._known.get(peer)
        self._known[peer] = Known(body, now_s)
        if before is None:
            self._log("info", f"hears {peer}")
            self._urgent = True
        elif isinstance(body, Intent) and isinstance(before.body, Intent) and body.goal != before.body.goal:
            self._urgent = True

    def _lose(self, peer: str, why: str) -> None:
        if self._known.pop(peer, None) is not None:
            self._log("warning", f"has lost {peer}: {why}")
            self._urgent = True

    def _live(self, now_s: float) -> None:
        """Do what is due and ask to be woken for the next of it."""
        for peer in [peer for peer, known in self._known.items() if now_s - known.heard_s > self._silent_s]:
            self._lose(peer, f"silent for {self._silent_s:g} s")
        self._plan_if_due(now_s)
        if self._said is not None and now_s >= self._repeat_at_s - EARLY_S:
            self._say(structs.replace(self._said, authority=self._next_authority()), now_s)
        if self._control.due(now_s):
            self._report()
        if self._heartbeat.due(now_s):
            self._effects.append(Publish(Heartbeat(role="base_station", mode=self._mode)))
        wake_s = min(self._control.next_s, self._heartbeat.next_s, self._replanning.next_s, self._repeat_at_s)
        self._effects.append(WakeAt(wake_s))

    def _plan_if_due(self, now_s: float) -> None:
        """Ask for a plan, one at a time, as soon as the agent and enough of the team are known."""
        due = self._replanning.due(now_s) or self._urgent
        agent = self._known.get(self._agent)
        robots = {name: self._known[name].body.position for name in self._robots if name in self._known}
        complete = len(robots) == len(self._robots) or now_s >= self._grace_until_s
        if not due or self._planning or agent is None or not complete:
            return
        self._planning, self._urgent = True, False
        arguments = (agent.body.position, agent.body.path, robots, self._plan)
        self._effects.append(Compute(PLANNING, self._planner.plan, arguments))

    def _planned(self, done: JobDone, now_s: float) -> None:
        """Take a plan over: as a new decision, as an update of the spares' places, or not at all."""
        self._planning = False
        if done.failure:
            if done.failure != self._failure:
                self._log("error", f"planning failed, the last deployment stands: {done.failure}")
            self._failure = done.failure
            return
        self._effects.append(Record(Planned(planning_s=done.duration_s)))
        plan, before = done.result, self._plan
        self._plan = plan
        if plan.serves != (before is None or before.serves):
            self._log("info" if plan.serves else "warning", plan.reason)
        decides = before is None or _choice(plan) != _choice(before)
        if before is not None and not decides and plan.placements == before.placements:
            return
        self._decisions += decides
        deployment = Deployment(
            authority=self._next_authority(),
            valid_for_s=self._mission.valid_for_s,
            decision=self._decisions,
            placements=plan.placements,
            edges=plan.edges,
            cost=_finite(plan.cost) or 0.0,
            total_cost_m=_finite(plan.total_cost_m),
            lower_bound_m=_finite(plan.lower_bound_m),
            relays_needed=plan.relays_needed,
            reason=plan.reason[:500] if decides or self._said is None else self._said.reason,
        )
        if decides:
            changed = before is not None and set(map(frozenset, plan.edges)) != set(map(frozenset, before.edges))
            self._effects.append(
                Record(Decision(deployment=deployment, planning_s=done.duration_s, topology_changed=changed))
            )
        self._say(deployment, now_s)

    def _say(self, deployment: Deployment, now_s: float) -> None:
        self._said = deployment
        self._repeat_at_s = now_s + deployment.valid_for_s / REPETITIONS
        self._effects.append(Publish(deployment))

    def _next_authority(self) -> Authority:
        self._sequence += 1
        return Authority(epoch=self._epoch, leader=self._name, sequence=self._sequence)

    @property
    def _mode(self) -> Mode:
        return "waiting" if self._said is None else "arrived"

    def _report(self) -> None:
        """Say and record where it is, and who sees whom."""
        still = (0.0, 0.0)
        self._effects += (
            Publish(State(position=self._position, velocity=still, mode=self._mode)),
            Record(
                Track(
                    role="base_station",
                    position=self._position,
                    velocity=still,
                    radius_m=self._mission.robot_radius_m,
                    mode=self._mode,
                )
            ),
            Record(self._connectivity()),
        )

    def _connectivity(self) -> Connectivity:
        """True lines of sight between the places heard. Whoever is not heard is connected to nobody."""
        places = {self._name: self._position}
        for name in (self._agent, *self._robots):
            if name in self._known:
                places[name] = self._known[name].body.position
        points = list(places.values())
        visible = self._environment.visibility_matrix(points)
        rows = visible.tolist()
        component = component_labels(visible)
        agent_heard = self._agent in self._known
        everybody = len(places) == 2 + len(self._robots)
        return Connectivity(
            links=tuple((points[i], points[j]) for i, j in combinations(range(len(points)), 2) if rows[i][j]),
            agent_visible=agent_heard and sum(rows[1]) > 1,  # it is on the diagonal itself
            chain_connected=bool(agent_heard and component[0] == component[1]),
            team_connected=bool(everybody and component.max() == 0),
            lambda2=algebraic_connectivity(visible) if everybody else 0.0,
            tree_links=tuple(
                (places[a], places[b])
                for a, b in (self._said.edges if self._said is not None else ())
                if a in places and b in places
            ),
        )

    def _log(self, level: Literal["info", "warning", "error"], text: str) -> None:
        self._effects.append(Record(LogLine(level=level, text=text)))


def _finite(number: float | None) -> float | None:
    """The number, or None: JSON has no infinity."""
    return number if number is not None and math.isfinite(number) else None


def _choice(plan: Plan) -> tuple[object, ...]:
    """What makes a decision: links, and places of relays. Places of spares do not."""
    relays: tuple[Placement, ...] = tuple(placement for placement in plan.placements if not placement.spare)
    return plan.edges, relays
