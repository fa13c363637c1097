"""Teams with the full planner and estimate on the packaged maps, where lines of sight end and ways are narrow."""

from __future__ import annotations

from functools import cache
from random import Random
from typing import Final

from msgspec import structs

import maps
from agents.casting import Casting
from agents.leader import DeploymentPlanner
from agents.mission import Mission, RosterEntry, Wandering
from planning.environment import Environment
from protocol.messages import Point
from tests.faults.chaos_mission import RANGING, ChaosCase, draw_case, robot_names
from tests.faults.light_team import RADIUS_M

MAPS: Final = ("office", "room3", "maze")
MOST_ROBOTS: Final = 5


def draw_real_case(seed: int) -> ChaosCase:
    """Three to five robots on one of the maps; the agent announces its way in every other mission."""
    chance = Random(f"{seed}/real")
    case = draw_case(seed, (3, MOST_ROBOTS), (25, 35), clocks=False)
    return structs.replace(case, map=chance.choice(MAPS), announces=seed % 2 == 0)


def real_mission(case: ChaosCase) -> Mission:
    """What all peers of a team on a map know."""
    base, agent, *starts = _places(case.map)
    return Mission(
        team="team",
        map_path=case.map,
        roster=(
            RosterEntry(name="base", role="base_station", start=base),
            RosterEntry(name="agent", role="tracked_agent", start=agent),
            *(
                RosterEntry(name=name, role="robot", start=start)
                for name, start in zip(robot_names(case.robots), starts, strict=False)
            ),
        ),
        behaviour=Wandering(start_after_s=2.0),
        robot_radius_m=RADIUS_M,
        agent_radius_m=RADIUS_M,
        robot_speed_m_s=1.2,
        agent_speed_m_s=0.5,
        control_hz=5.0,
        heartbeat_hz=2.0,
        planning_period_s=case.planning_period_s,
        decomposition="inflection",
        duration_s=case.duration_s,
        seed=case.seed,
        announces=case.announces,
        retreat_after_s=case.retreat_after_s,
        ranging=RANGING,
        epoch_unix_s=0.0,
        planning_delay_s=0.2,
    )


def real_casting(mission: Mission) -> Casting:
    """Casts them; the planner of a map is built once."""
    return Casting(mission, _environment(mission.map_path), _planner(mission.map_path))


@cache
def _environment(name: str) -> Environment:
    return Environment.load(maps.path(name))


@cache
def _planner(name: str) -> DeploymentPlanner:
    case = ChaosCase(seed=0, robots=MOST_ROBOTS, duration_s=1.0, map=name)
    return Casting(real_mission(case), _environment(name)).planner()


@cache
def _places(name: str) -> tuple[Point, ...]:
    """Of base station, agent and robots: in sight of the first, and none in another's way."""
    environment, chance = _environment(name), Random(name)
    free = environment.inflated(RADIUS_M)
    west, south, east, north = free.bounds
    places: list[Point] = []
    while len(places) < 2 + MOST_ROBOTS:
        place = (round(chance.uniform(west, east), 2), round(chance.uniform(south, north), 2))
        apart = all(abs(place[0] - x) + abs(place[1] - y) > 4 * RADIUS_M for x, y in places)
        if free.contains([place])[0] and apart and (not places or environment.line_of_sight(places[0], place)):
            places.append(place)
    return tuple(places)
