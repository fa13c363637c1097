"""From a scenario to a mission: the scenario held against its map, completely, before anything starts.

What is wrong raises one sentence; what is only risky (too few robots for some far place) becomes a warning.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from agents.casting import Casting
from agents.leader import MOST_TO_PLAN_ON, DeploymentPlanner, remedy_for
from agents.mission import Behaviour, Mission, OnDemand, Ranging, RosterEntry, Scripted, Wandering
from agents.movement_authority import Onset
from agents.planning_job import Question
from agents.sighted_set import rehearse
from launcher.fault_timetable import FaultyTimetable, Timetable, checked
from launcher.ground import Ground, named
from launcher.kernels import warm_up
from launcher.scenario import Scenario, ScenarioFault, find_map, read_scenario
from launcher.wording import counted, text_of
from planning.deployment import NoChain
from planning.environment import Environment
from planning.forecast import forecast_cells
from planning.mutual_visibility import TooManyCells
from planning.placement_points import UnfitSpacing
from protocol.messages import Point

BASE = "base"
AGENT = "agent"
GAP = 0.25
"""Automatic starts leave this share of a radius between two discs."""

MOST_FOR_EXACT = 10
"""More robots take the exact search half a second and more, see docs/scenario.md."""

LARGE = 250
"""Vertices from which on a map takes more than a second to prepare for planning."""


@dataclass(frozen=True)
class Preparation:
    """A scenario that can be run."""

    scenario: Scenario
    environment: Environment
    mission: Mission
    """Without endpoints, and with mission time zero at the epoch of Unix: the launcher fills these in."""
    planner: DeploymentPlanner
    """The leader's, since the check needed one and large maps take long to prepare."""
    warnings: tuple[str, ...]


def prepare(file: Path, announce: Callable[[str], None]) -> Preparation:
    """Read a scenario file and hold it against its map.

    Args:
        file: the scenario.
        announce: is told beforehand what takes a while, and what a majority is if the team can part into halves.

    Raises:
        ScenarioFault: the scenario, or a place in it, does not fit.
        ValueError: the map cannot be read (a sentence too).
    """
    scenario = read_scenario(file)
    map_file = find_map(scenario.map, file.parent, f"{file}: map: ")
    warm_up(announce, ["planning"] if scenario.agent.announces else ["planning", "estimation"])
    ground = Ground.around(file, map_file, "base.position", scenario.base.position, scenario.map_tolerance_m)
    environment = ground.environment
    agent, robots = scenario.agent, scenario.robots
    walk = {"agent.start": agent.start} | named("agent.goals", agent.goals)
    ground.check_walk("agent.radius_m", walk, agent.radius_m, agent.start, "agent.start")
    if robots.starts:
        places = named("robots.starts", robots.starts)
        ground.check_walk("robots.radius_m", places, robots.radius_m, scenario.base.position, "base.position")
    starts = robots.starts or _automatic_starts(ground, scenario)
    robot_discs = [(place, start, robots.radius_m) for place, start in named("robots.starts", starts).items()]
    ground.check_apart([("agent.start", agent.start, agent.radius_m), *robot_discs])
    mission = _mission(scenario, starts)
    _check_faults(file, scenario, mission)
    if len(environment.vertices) > LARGE:
        announce(f"Preparing the planner for a map of {len(environment.vertices)} vertices ...")
    if mission.placements == "cells":
        _check_cells(file, mission, environment)
    casting = Casting(mission, environment)
    try:
        planner = casting.planner()
    except TooManyCells as problem:
        raise ScenarioFault(f"{file}: map: {problem}") from problem
    except UnfitSpacing as problem:
        raise ScenarioFault(f"{file}: planning.spacing_m: {problem}") from problem
    _rehearse(file, mission, casting)
    if len(mission.voters.voters) % 2 == 0:
        announce(f"{mission.voters.describe_majority()}.")
    warnings = (*_check_robots_suffice(file, scenario, planner), *_check_pace(scenario))
    return Preparation(scenario, environment, mission, planner, warnings)


def _check_faults(file: Path, scenario: Scenario, mission: Mission) -> None:
    """Raise where a fault names somebody who is not there, or pauses a peer for ever."""
    try:
        checked(Timetable(faults=scenario.faults), [entry.name for entry in mission.roster])
    except FaultyTimetable as problem:
        raise ScenarioFault(f"{file}: {problem}") from problem


def _rehearse(file: Path, mission: Mission, casting: Casting) -> None:
    """Plan the first motion: what cannot be begun is found now, and what planning loads is there when the team begins.

    Raises:
        ScenarioFault: the robots cannot set out from their places.
    """
    places = {entry.name: entry.start for entry in (mission.base_station, *mission.robots)}
    if not mission.announces:
        rehearse(casting.sight, list(places.values()), mission.tracked_agent.start)
    question = Question(
        way=(mission.tracked_agent.start,), onset=Onset(0, 0, 0, places), lead_s=0.0, previous=None, heading={}
    )
    answer = casting.team_planner().plan(question)
    if answer.failure:
        raise ScenarioFault(f"{file}: robots.starts: the robots cannot set out from there: {answer.failure}")


def _check_cells(file: Path, mission: Mission, environment: Environment) -> None:
    """Raise where cells will be too many, before minutes are spent on them."""
    cells = forecast_cells(environment, mission.decomposition).cells
    if cells > MOST_TO_PLAN_ON:
        raise ScenarioFault(
            f"{file}: map: {environment.name!r} has about {cells:,} {mission.decomposition} cells, and at most "
            f"{MOST_TO_PLAN_ON:,} can be planned on: {remedy_for(mission.decomposition)}, or use placements on points"
        )


def _automatic_starts(ground: Ground, scenario: Scenario) -> tuple[Point, ...]:
    """Places around the base station, in its sight, nearest first, discs apart from each other and from the agent.

    O(g) for a grid of g candidates.
    """
    environment, file = ground.environment, ground.file
    count, radius = scenario.robots.count or 0, scenario.robots.radius_m
    base, agent = np.array(scenario.base.position), np.array(scenario.agent.start)
    free = ground.room("robots.radius_m", radius, scenario.base.position, "base.position")
    pitch = (2 + GAP) * radius
    x0, y0, x1, y1 = environment.bounds
    reach = min(float(np.hypot(x1 - x0, y1 - y0)), pitch * (6 + 2 * count**0.5))
    steps = np.arange(-np.floor(reach / pitch), np.floor(reach / pitch) + 1) * pitch
    offsets = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
    distances = np.hypot(offsets[:, 0], offsets[:, 1])
    order = np.lexsort((offsets[:, 1], offsets[:, 0], distances.round(6)))
    candidates = base + offsets[order][distances[order] > pitch / 2]
    candidates = candidates[
        np.linalg.norm(candidates - agent, axis=1) > radius + scenario.agent.radius_m + GAP * radius
    ]
    candidates = candidates[free.contains(candidates)]
    candidates = candidates[environment.line_of_sight(base, candidates)]
    if len(candidates) < count:
        raise ScenarioFault(
            f"{file}: near base.position and in its sight there is room for {counted(len(candidates), 'robot')} of "
            f"radius {radius:g} m, and robots.count is {count}; give their places as robots.starts"
        )
    return tuple((round(float(x), 6), round(float(y), 6)) for x, y in candidates[:count])


def _mission(scenario: Scenario, starts: tuple[Point, ...]) -> Mission:
    """The mission of a checked scenario."""
    agent, ranging = scenario.agent, scenario.ranging
    roster = [
        RosterEntry(name=BASE, role="base_station", start=scenario.base.position),
        RosterEntry(name=AGENT, role="tracked_agent", start=agent.start),
        *(RosterEntry(name=f"robot{i}", role="robot", start=start) for i, start in enumerate(starts, 1)),
    ]
    behaviour: Behaviour = OnDemand()
    if agent.behaviour == "script":
        behaviour = Scripted(goals=agent.goals, pause_s=agent.pause_s, start_after_s=agent.start_after_s)
    elif agent.behaviour == "wander":
        behaviour = Wandering(
            around_corner_share=agent.around_corner_share, pause_s=agent.pause_s, start_after_s=agent.start_after_s
        )
    return Mission(
        team=scenario.name,
        map_path="map.json",
        roster=tuple(roster),
        behaviour=behaviour,
        robot_radius_m=scenario.robots.radius_m,
        agent_radius_m=agent.radius_m,
        robot_speed_m_s=scenario.robots.speed_m_s,
        agent_speed_m_s=agent.speed_m_s,
        control_hz=scenario.rates.control_hz,
        heartbeat_hz=scenario.rates.heartbeat_hz,
        planning_period_s=scenario.planning.period_s,
        decomposition=scenario.planning.decomposition,
        placements=scenario.planning.placements,
        spacing_m=scenario.planning.spacing_m,
        search=scenario.planning.search,
        topology=scenario.planning.topology,
        retreat_after_s=scenario.planning.retreat_after_s,
        duration_s=scenario.duration_s,
        seed=scenario.seed,
        announces=agent.announces,
        ranging=Ranging(
            rate_hz=ranging.rate_hz,
            bound_m=ranging.bound_m,
            noise_m=ranging.bound_m / 2 if ranging.noise_m is None else ranging.noise_m,
            clock_bound_s=ranging.clock_bound_s,
        ),
        epoch_unix_s=0.0,
    )


def _check_robots_suffice(file: Path, scenario: Scenario, planner: DeploymentPlanner) -> tuple[str, ...]:
    """Warnings about far places; raises where the first deployment or a goal needs more robots than there are."""
    count = scenario.robot_count
    for place, point in ({"agent.start": scenario.agent.start} | named("agent.goals", scenario.agent.goals)).items():
        try:
            needed = planner.relays_needed(point)
        except NoChain as problem:
            raise ScenarioFault(
                f"{file}: {place} {text_of(point)} cannot be joined to base.position by any chain of robots; "
                "move it, or make robots.radius_m smaller"
            ) from problem
        if needed > count:
            raise ScenarioFault(
                f"{file}: {place} {text_of(point)} needs {counted(needed, 'robot')} between base and agent, and "
                f"there {'is' if count == 1 else 'are'} {count}; make robots.count at least {needed}, or move it"
            )
    most = planner.most_relays_needed()
    if most <= count:
        return ()
    return (
        f"some places of this map need {counted(most, 'robot')}, and there {'is' if count == 1 else 'are'} {count}: "
        "in those the chain will be broken",
    )


def _check_pace(scenario: Scenario) -> tuple[str, ...]:
    """A warning where plans are slower than they are asked for."""
    count, planning = scenario.robot_count, scenario.planning
    if planning.search != "exact" or count <= MOST_FOR_EXACT or planning.period_s >= 1.0:
        return ()
    return (
        f'planning.search = "exact" can take longer with {count} robots than planning.period_s = '
        f'{planning.period_s:g} s, and the leader then plans less often; "chain" is quicker',
    )
