"""From a scenario to a mission: the scenario held against its map, completely, before anything starts.

What is wrong raises one sentence; what is only risky (too few robots for some far place) becomes a warning.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from agents.leader import DeploymentPlanner
from agents.mission import Behaviour, Mission, OnDemand, RosterEntry, Scripted, Wandering
from launcher.scenario import Scenario, ScenarioFault, find_map, read_scenario
from planning.environment import Environment
from planning.inflation import NothingLeft
from planning.warm_up import warm_up
from protocol.messages import Point

BASE = "base"
AGENT = "agent"
GAP = 0.25
"""Automatic starts leave this share of a radius between two discs."""


@dataclass(frozen=True)
class Preparation:
    """A scenario that can be run."""

    scenario: Scenario
    environment: Environment
    mission: Mission
    """Without endpoints, and with mission time zero at the epoch of Unix: the launcher fills these in."""
    warnings: tuple[str, ...]


def prepare(file: Path, announce: Callable[[str], None]) -> Preparation:
    """Read a scenario file and hold it against its map.

    Args:
        file: the scenario.
        announce: is told beforehand if the numerical kernels have to be compiled, which takes a while.

    Raises:
        ScenarioFault: the scenario, or a place in it, does not fit.
        ValueError: the map cannot be read (a sentence too).
    """
    scenario = read_scenario(file)
    map_file = find_map(scenario.map, file.parent, f"{file}: map: ")
    warm_up(announce)
    environment = Environment.load(map_file, containing=scenario.base.position)
    ground = _Ground(file, environment)
    ground.check_inside("base.position", scenario.base.position)
    agent, robots = scenario.agent, scenario.robots
    walk = {"agent.start": agent.start} | _named("agent.goals", agent.goals)
    ground.check_walk("agent", walk, agent.radius_m, agent.start, "agent.start")
    if robots.starts:
        places = _named("robots.starts", robots.starts)
        ground.check_walk("robots", places, robots.radius_m, scenario.base.position, "base.position")
    starts = robots.starts or _automatic_starts(ground, scenario)
    ground.check_apart(scenario, starts)
    mission = _mission(scenario, starts)
    warnings = _check_robots_suffice(file, scenario, mission, environment)
    return Preparation(scenario, environment, mission, warnings)


class _Ground:
    """Places of a scenario on its map."""

    def __init__(self, file: Path, environment: Environment) -> None:
        self.file = file
        self.environment = environment

    def check_inside(self, place: str, point: Point, radius_m: float = 0.0) -> None:
        """Raise unless a disc at this place is inside the free space."""
        inside = bool(self.environment.contains([point])[0])
        clearance = shapely.distance(self.environment.polygon.boundary, shapely.Point(point))
        if inside and clearance >= radius_m:
            return
        what = f"{clearance:.2f} m from a wall, nearer than its radius of {radius_m:g} m"
        if not inside:
            x0, y0, x1, y1 = self.environment.bounds
            what = f"inside a wall or off the map (x {x0:g} to {x1:g}, y {y0:g} to {y1:g})"
        raise ScenarioFault(f"{self.file}: {place} {_text(point)} is {what}; {self._remedy(point, radius_m)}")

    def _remedy(self, point: Point, radius_m: float) -> str:
        """Name a place near by that would do."""
        roomy = self.environment.polygon.buffer(-radius_m - 0.05)
        if roomy.is_empty:
            return "no place on this map is wide enough: make the radius smaller"
        near = shapely.get_coordinates(shapely.shortest_line(roomy, shapely.Point(point)))[0]
        return f"move it, for example to [{near[0]:.2f}, {near[1]:.2f}]"

    def check_walk(self, who: str, places: dict[str, Point], radius_m: float, origin: Point, origin_place: str) -> None:
        """Raise unless a disc fits at every place and can get there from ``origin``, or from what that sees."""
        for place, point in places.items():
            self.check_inside(place, point, radius_m)
        free = self.room(who, radius_m, origin, origin_place)
        for place, point in places.items():
            if not free.contains([point])[0]:
                raise ScenarioFault(
                    f"{self.file}: {place} {_text(point)} cannot be reached from {origin_place} {_text(origin)} with a "
                    f"radius of {radius_m:g} m; move it, or make {who}.radius_m smaller"
                )

    def room(self, who: str, radius_m: float, origin: Point, origin_place: str) -> Environment:
        """Where the centre of a disc can be: the part of the free space at ``origin``, or that it sees."""
        try:
            return self.environment.inflated(radius_m, containing=origin)
        except NothingLeft as problem:
            raise ScenarioFault(
                f"{self.file}: {who}.radius_m = {radius_m:g} leaves no room at {origin_place} {_text(origin)}; "
                "make it smaller, or move to where there is more room"
            ) from problem

    def check_apart(self, scenario: Scenario, starts: tuple[Point, ...]) -> None:
        """Raise where two discs overlap at the start."""
        agent, radius = scenario.agent, scenario.robots.radius_m
        discs = [("agent.start", agent.start, agent.radius_m)]
        for place, point in _named("robots.starts", starts).items():
            for other, taken, other_radius in discs:
                if float(np.hypot(point[0] - taken[0], point[1] - taken[1])) < radius + other_radius:
                    raise ScenarioFault(
                        f"{self.file}: {place} {_text(point)} overlaps {other} {_text(taken)}; "
                        f"keep them {radius + other_radius:g} m apart"
                    )
            discs.append((place, point, radius))


def _automatic_starts(ground: _Ground, scenario: Scenario) -> tuple[Point, ...]:
    """Places around the base station, in its sight, nearest first, discs apart from each other and from the agent.

    O(g) for a grid of g candidates.
    """
    environment, file = ground.environment, ground.file
    count, radius = scenario.robots.count or 0, scenario.robots.radius_m
    base, agent = np.array(scenario.base.position), np.array(scenario.agent.start)
    free = ground.room("robots", radius, scenario.base.position, "base.position")
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
            f"{file}: only {len(candidates)} robots of radius {radius:g} m have room near base.position and in its "
            f"sight, and robots.count is {count}; give their places as robots.starts"
        )
    return tuple((round(float(x), 6), round(float(y), 6)) for x, y in candidates[:count])


def _mission(scenario: Scenario, starts: tuple[Point, ...]) -> Mission:
    """The mission of a checked scenario."""
    agent = scenario.agent
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
        valid_for_s=scenario.planning.valid_for_s,
        decomposition=scenario.planning.decomposition,
        duration_s=scenario.duration_s,
        seed=scenario.seed,
        epoch_unix_s=0.0,
    )


def _named(place: str, points: tuple[Point, ...]) -> dict[str, Point]:
    return {f"{place}[{index}]": point for index, point in enumerate(points)}


def _text(point: Point) -> str:
    return f"[{point[0]:g}, {point[1]:g}]"
