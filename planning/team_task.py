"""What a team is asked to do, read and checked: who goes from where to where, who stands, and who has to be joined."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.carving import carve
from planning.connectivity import component_labels
from planning.environment import Environment
from planning.geodesic import GeodesicMap, NotInFreeSpace
from planning.motion_plan import InvalidSchedule, Schedule, read_points
from planning.schedule import schedule
from planning.team_roadmap import see_throughout

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Level:
    """Which members have to be in one network of sight; fewer than two: none.

    Attributes:
        rows: of the members, those that go as they please last.
    """

    rows: tuple[int, ...]

    @property
    def asks(self) -> bool:
        """Whether it asks for anything."""
        return len(self.rows) > 1


NOTHING = Level(())


@dataclass(frozen=True, eq=False)
class TeamTask:
    """One redeployment of k members, and of others that go as they please.

    Attributes:
        environment: the map as drawn.
        geodesics: of the space where the movers' centres can be, obstacles left out.
        members: k names.
        starts: (k, 2) float, metres, map frame.
        goals: (k, 2) float, metres: where they can get to; where they start, if they cannot get where they should.
        radii_m: (k,) float, metres.
        speeds_m_s: (k,) float, metres a second.
        unscheduled: paths (m, 2), metres, of members without a body that may be anywhere on them at any time.
        level: who has to be joined.
        unreachable: members that cannot get to their goals, whoever else is there.
    """

    environment: Environment
    geodesics: GeodesicMap
    members: tuple[str, ...]
    starts: Floats
    goals: Floats
    radii_m: Floats
    speeds_m_s: Floats
    unscheduled: Mapping[str, Floats]
    level: Level
    unreachable: tuple[str, ...] = ()
    geodesic_lengths_m: Floats = field(default_factory=lambda: np.zeros(0))

    @property
    def free(self) -> Environment:
        """Where the movers' centres can be."""
        return self.geodesics.environment

    @cached_property
    def movers(self) -> list[int]:
        """Rows of those that do not start at their goals."""
        return [int(i) for i in np.flatnonzero(np.any(self.starts != self.goals, axis=1))]

    @property
    def alike(self) -> bool:
        """Whether all discs have one radius, so that what the widest cannot reach is out of reach for each."""
        return len(set(self.radii_m[self.radii_m > 0.0])) <= 1

    @cached_property
    def standing(self) -> list[int]:
        """Rows of the others."""
        return [i for i in range(len(self.members)) if i not in self.movers]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of all, those that go as they please last."""
        return (*self.members, *self.unscheduled)

    def starting_at(self, places: Floats) -> TeamTask:
        """The same from other starts (k, 2), metres."""
        return replace(self, starts=places)

    def separations(self) -> Floats:
        """How far apart two members have to be: (k, k) float, metres, 0 for one without a body."""
        apart: Floats = self.radii_m[:, None] + self.radii_m
        apart[np.minimum(self.radii_m[:, None], self.radii_m) == 0.0] = 0.0
        return apart

    def schedule(self, paths: Sequence[Floats], level: Level) -> Schedule:
        """A schedule of the members' paths, and of those that go as they please.

        Raises:
            NoSchedule: none was found.
        """
        return schedule(
            [*paths, *self.unscheduled.values()],
            np.append(self.radii_m, np.zeros(len(self.unscheduled))),
            self.environment if level.asks else None,
            joined=level.rows if level.asks else None,
            members=self.names,
            speed_m_s=self.all_speeds,
            unscheduled=list(self.unscheduled),
        )

    @cached_property
    def all_speeds(self) -> Floats:
        """Of all, metres a second; those that go as they please at 1 m/s, for they wait for nobody."""
        return np.append(self.speeds_m_s, np.ones(len(self.unscheduled)))

    def keeps(self, places: Floats, level: Level) -> bool:
        """Whether a level holds with the members at these places (k, 2), wherever the others are on their paths."""
        labels = component_labels(self.network(places))
        return len({int(labels[row]) for row in level.rows}) <= 1

    def network(self, places: Floats) -> Bools:
        """Who sees whom with the members at these places (k, 2): (n, n) bool, n with those that go as they please."""
        k, n = len(places), len(self.names)
        links = np.zeros((n, n), dtype=np.bool_)
        links[:k, :k] = self.environment.visibility_matrix(places)
        ways = [*(place[None] for place in places), *self.unscheduled.values()]
        for i in range(k, n):
            for j in range(i):
                links[i, j] = links[j, i] = see_throughout(self.environment, ways[i], ways[j])
        return links


def read_task(
    environment: Environment,
    starts: ArrayLike,
    goals: ArrayLike,
    radius_m: ArrayLike,
    members: Sequence[str],
    speed_m_s: ArrayLike,
    joined: Collection[str] | None,
    unscheduled: Mapping[str, ArrayLike],
    obstacles: Sequence[tuple[ArrayLike, float]],
    geodesics: GeodesicMap | None,
) -> TeamTask:
    """The task of these arguments of `planning.motion.plan_motion`.

    Raises:
        InvalidSchedule: they do not fit together.
        NotInFreeSpace: somebody is to set out from where it cannot be.
    """
    names, k = tuple(members), len(members)
    others = {name: read_points(path) for name, path in unscheduled.items()}
    begin, end = read_points(starts), read_points(goals)
    if not (len(begin) == len(end) == k > 0) or not (np.isfinite(begin).all() and np.isfinite(end).all()):
        raise InvalidSchedule(
            f"{k} members have {len(begin)} starts and {len(end)} goals: give each one of both, finite, in metres"
        )
    for name, path in others.items():
        if len(path) == 0 or not np.isfinite(path).all():
            raise InvalidSchedule(f"the way of {name} has no points, or one that is not finite: give metres")
    if len({*names, *others}) < k + len(others):
        raise InvalidSchedule("two members have one name: give each its own")
    for name in joined or ():
        if name not in names and name not in others:
            raise InvalidSchedule(f"'{name}' is to be joined, but no member: there are {', '.join((*names, *others))}")
    everybody = [*names, *others]
    level = Level(tuple(i for i, name in enumerate(everybody) if joined is None or name in joined))
    radii, speeds = _spread(radius_m, k, "radius"), _spread(speed_m_s, k, "speed")
    movers = np.flatnonzero(np.any(begin != end, axis=1))
    if geodesics is None:
        widest = float(radii[movers].max(initial=0.0))
        geodesics = GeodesicMap(environment.inflated(widest, begin[movers[0]]) if len(movers) else environment)
    if obstacles and len(movers):
        geodesics = carve(geodesics, obstacles, float(radii[movers].max()), begin[movers])
    for i in movers:
        try:
            geodesics.check_free(begin[i : i + 1])
        except NotInFreeSpace as problem:
            raise NotInFreeSpace(f"{names[i]} cannot set out: {problem}") from None
    lost = [int(i) for i in movers if not geodesics.environment.contains(end[i : i + 1])[0]]
    end[lost] = begin[lost]
    lengths = np.array([geodesics.length(p, q) if np.any(p != q) else 0.0 for p, q in zip(begin, end, strict=True)])
    return TeamTask(
        environment, geodesics, names, begin, end, radii, speeds, others, level, tuple(names[i] for i in lost), lengths
    )


def _spread(given: ArrayLike, members: int, name: str) -> Floats:
    values = np.array(given, dtype=np.float64)
    if values.shape not in {(), (members,)} or not (np.isfinite(values) & (values >= 0.0)).all():
        raise InvalidSchedule(
            f"the {name} of {members} members is given as {values.tolist()}: give one finite number that is not "
            "negative, or one for each member"
        )
    return np.array(np.broadcast_to(values, members))
