"""Random schedules, mutants of them, and a judge that samples: what the certificate is held against.

The judge asks the environment and shapely at instants, so it misses what is shorter than its step; and it forgives what
is within a few tolerances of the limit, as the certificate does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from planning import line_of_sight
from planning.certificate import Certificate
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from planning.motion_plan import Schedule, TimedPath
from planning.visible_interval import visible_times
from tests.planning.polygons import free_points

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SPEED = 1.0
FORGIVEN = 8.0
"""Tolerances of the map."""


@dataclass(frozen=True)
class Ground:
    """A map and the robots that drive on it."""

    environment: Environment
    radius_m: float

    @cached_property
    def free(self) -> Environment:
        return self.environment.inflated(self.radius_m)

    @cached_property
    def geodesics(self) -> GeodesicMap:
        return GeodesicMap(self.free)


def broken_rules(ground: Ground, schedule: Schedule, times: Floats) -> set[str]:
    """Which kinds of violation are seen at any of ``times``; of speeds, whether any piece is too fast.

    Walls are asked of the line through all places of a member, bodies of members that move only.
    """
    places = schedule.positions(times)
    broken = broken_between(ground, schedule.radii_m, places)
    if too_fast(ground, schedule):
        broken.add("speed")
    if any(hits_wall(ground, places[:, i], float(radius)) for i, radius in enumerate(schedule.radii_m)):
        broken.add("wall")
    return broken


def too_fast(ground: Ground, schedule: Schedule) -> bool:
    """Whether any piece of path asks for more than its member's speed."""
    return any(
        np.any(
            np.hypot(*np.diff(path.waypoints, axis=0).T)
            > limit * np.diff(path.times_s) * (1 + 1e-6) + FORGIVEN * ground.environment.tolerance_m
        )
        for path, limit in zip(schedule.paths, schedule.speeds_m_s, strict=True)
    )


def hits_wall(ground: Ground, places: Floats, radius: float) -> bool:
    """Whether the line through places (n, 2) starts outside, or comes nearer to walls than the radius, if not 0."""
    slack = FORGIVEN * ground.environment.tolerance_m
    polygon = ground.environment.polygon
    if shapely.distance(polygon, shapely.Point(places[0])) > slack:
        return True
    there = shapely.LineString(places[[0, *range(len(places))]])
    return bool(radius > 0.0 and shapely.distance(polygon.boundary, there) < radius - slack)


def broken_between(ground: Ground, radii: Floats, places: Floats, dip: float = 0.5 * FORGIVEN) -> set[str]:
    """Whether members at any of their places (n, k, 2) overlap, or are no network.

    ``dip``: how far lines of sight may be in walls, in tolerances.
    """
    slack = FORGIVEN * ground.environment.tolerance_m
    broken = set()
    part = np.tile(np.arange(len(radii)), (len(places), 1))
    for i in range(len(radii)):
        for j in range(i):
            if min(radii[[i, j]]) > 0.0:
                near = radii[i] + radii[j] - slack
                if np.any(np.hypot(*(places[:, i] - places[:, j]).T) < near):
                    broken.add("collision")
            asked = np.flatnonzero(part[:, i] != part[:, j])
            sees = line_of_sight.segments_are_visible(
                places[asked, i], places[asked, j], ground.environment.walls, dip * ground.environment.tolerance_m
            )
            one, other = part[asked[sees], i, None], part[asked[sees], j, None]
            part[asked[sees]] = np.where(part[asked[sees]] == one, other, part[asked[sees]])
    if np.any(part != part[:, :1]):
        broken.add("connection")
    return broken


def sample_times(schedule: Schedule, step_s: float) -> Floats:
    return np.arange(schedule.start_s, schedule.end_s + step_s, step_s)


def random_team(ground: Ground, robots: int, rng: np.random.Generator) -> tuple[list[str], list[Floats]] | None:
    """A base station and robots in one network, names and places; None where none was found."""
    members = ["base", *(f"robot_{i}" for i in range(robots))]
    places = [free_points(ground.free, 1, rng)[0]]
    while len(places) < len(members):
        near = places[rng.integers(len(places))] + rng.normal(0.0, 2.5, (40, 2))
        near = near[ground.free.contains(near)]
        near = near[ground.environment.line_of_sight(near, places[rng.integers(len(places))])] if len(near) else near
        near = near[np.all(np.linalg.norm(near[:, None] - places, axis=-1) > 2.0 * ground.radius_m, axis=1)]
        if len(near) == 0:
            return None
        # Behind corners rather than in the open, so that the team is a chain more often than a crowd.
        seen = [np.sum(ground.environment.line_of_sight(point, np.array(places))) for point in near]
        places.append(near[int(np.argmin(seen))])
    return members, places


def random_schedule(ground: Ground, robots: int, rng: np.random.Generator) -> Schedule | None:
    """A base station and robots, all in one network at the start, who go to places near by; None where it fails.

    Most keep the rules, by sampling coarsely. In some a robot stops at the very instant that it would lose sight.
    """
    team = random_team(ground, robots, rng)
    if team is None:
        return None
    members, places = team
    paths = [TimedPath.standing(place) for place in places]
    clock = 0.0
    for i in rng.permutation(np.arange(1, len(members))):
        goals = places[i] + rng.normal(0.0, 4.0, (12, 2))
        goals = goals[ground.free.contains(goals)]
        for goal in goals[np.argsort(-np.hypot(*(goals - places[i]).T))]:
            waypoints = ground.geodesics.path(places[i], goal)
            start = max(0.0, clock - rng.choice([0.0, rng.uniform(0.0, 3.0), clock]))
            path = drive(waypoints, start)
            if rng.uniform() < 0.3:
                path = _stop_at_the_last_instant(ground, path, paths, rng)
            tried = [*paths[:i], path, *paths[i + 1 :]]
            schedule = _team(ground, members, tried)
            if not broken_rules(ground, schedule, sample_times(schedule, 0.1)):
                paths, clock = tried, float(path.times_s[-1])
                break
    return _team(ground, members, paths) if clock > 0.0 else None


def drive(waypoints: Floats, start_s: float, speed: float = SPEED) -> TimedPath:
    """At constant speed from waypoint to waypoint."""
    steps = np.hypot(*np.diff(waypoints, axis=0).T)
    kept = np.append(True, steps > 1e-9)
    return TimedPath(waypoints[kept], start_s + np.append(0.0, np.cumsum(steps[kept[1:]])) / speed)


def _team(ground: Ground, members: list[str], paths: list[TimedPath]) -> Schedule:
    radii = [0.0] + [ground.radius_m] * (len(members) - 1)
    return Schedule(members, paths, radii, SPEED)


def _stop_at_the_last_instant(
    ground: Ground, path: TimedPath, others: list[TimedPath], rng: np.random.Generator
) -> TimedPath:
    """The path as far as it keeps the sight that it has of one of the others."""
    other = others[rng.integers(len(others))]
    seen = visible_times(ground.environment, path, TimedPath.standing(other.waypoints[-1], path.times_s[0]))
    if len(seen) == 0 or not path.times_s[0] < seen[0, 1] < path.times_s[-1] or seen[0, 0] > path.times_s[0]:
        return path
    kept = path.times_s < seen[0, 1]
    return TimedPath(
        np.concatenate([path.waypoints[kept], path.positions(seen[0, 1:])]), np.append(path.times_s[kept], seen[0, 1])
    )


def mutants(schedule: Schedule, rng: np.random.Generator, count: int) -> Iterator[tuple[str, Schedule]]:
    """Each with one thing changed: a start, an order, a waypoint (far, or by a hair), a pace, a stop left out."""
    moving = [i for i, path in enumerate(schedule.paths) if len(path.times_s) > 1]
    made = 0
    while made < count:
        i = int(rng.choice(moving))
        path = schedule.paths[i]
        times, points = path.times_s.copy(), path.waypoints.copy()
        changed = {}
        kind = str(rng.choice(["delay", "swap", "waypoint", "hair", "pace", "skip"]))
        if kind == "delay":
            changed[i] = TimedPath(points, times + rng.uniform(0.0, 6.0))
        elif kind == "swap":
            j = int(rng.choice(moving))
            other = schedule.paths[j]
            changed[i] = TimedPath(points, times - times[0] + other.times_s[0])
            changed[j] = TimedPath(other.waypoints, other.times_s - other.times_s[0] + times[0])
        elif kind in {"waypoint", "hair"}:
            w = int(rng.integers(1, len(points)))
            points[w] += (
                rng.normal(0.0, 1.5, 2) if kind == "waypoint" else rng.normal(size=2) * 10 ** rng.uniform(-6, -1)
            )
            changed[i] = drive(points, times[0])
        elif kind == "pace":
            changed[i] = TimedPath(points, times[0] + (times - times[0]) * rng.uniform(0.7, 1.5))
        elif len(points) > 2:
            w = int(rng.integers(1, len(points) - 1))
            changed[i] = drive(np.delete(points, w, axis=0), times[0])
        if changed:
            made += 1
            paths = [changed.get(k, kept) for k, kept in enumerate(schedule.paths)]
            yield kind, Schedule(schedule.members, paths, schedule.radii_m, schedule.speeds_m_s)


def truly_broken(ground: Ground, schedule: Schedule, certificate: Certificate) -> bool:
    """Whether sampling sees, in the time that the certificate names, what it refuses first."""
    first = certificate.violations[0]
    inner = np.linspace(first.time_s, min(first.until_s, schedule.end_s + 1.0), 203)[1:-1]
    return first.kind in broken_rules(ground, schedule, inner)
