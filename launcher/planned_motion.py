"""The motion of a plan: how robots get from where they are to where they are sent, and what is certified of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import networkx as nx
import numpy as np
import shapely
from numpy.typing import NDArray

from launcher.move_order import Move, order_moves
from launcher.standing_room import stand_apart
from planning.certificate import Certificate, certify
from planning.environment import Environment
from planning.motion import Motion, plan_motion

if TYPE_CHECKING:
    from planning.geodesic import GeodesicMap
    from protocol.messages import Point

Floats = NDArray[np.float64]
Links = tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True, eq=False)
class Team:
    """Who is where, and who is sent where: the base station, agents and robots, in this order.

    Attributes:
        names: of all k.
        starts: (k, 2) float, metres, map frame.
        goals: (k, 2) float, metres; those who are not sent anywhere stay.
        radii_m: (k,) float, metres.
        tree: pairs of rows that are to see each other in the end.
    """

    names: tuple[str, ...]
    starts: Floats
    goals: Floats
    radii_m: Floats
    tree: Links

    @classmethod
    def sent(
        cls,
        base: Point,
        agents: Sequence[tuple[Point, Point]],
        robots: Sequence[tuple[Point, Point | None]],
        tree: Links,
        radius_m: float,
        environment: Environment,
        free: Environment,
    ) -> Team:
        """The team of a plan.

        The base station has no body. How large agents are a plan is not told: they are taken as large as robots; where
        they stand between walls and others, as large as there is room for. Robots that are sent to one place stand
        beside each other.

        Args:
            base: where the base station stands, metres.
            agents: where each agent comes from and goes.
            robots: the same of robots; None for one that idles.
            tree: as in :class:`Team`.
            radius_m: of robots.
            environment: the map as drawn.
            free: where their centres can be.
        """
        fixed = 1 + len(agents)
        starts = np.array([base, *(start for start, _ in (*agents, *robots))], dtype=np.float64)
        sent = [goal for _, goal in agents] + [start if goal is None else goal for start, goal in robots]
        radii = np.full(len(starts), radius_m)
        radii[0] = 0.0
        for row, (start, goal) in enumerate(agents, 1):
            if start == goal:
                wall = float(shapely.distance(environment.polygon.boundary, shapely.Point(start)))
                room = [math.dist(start, place) - radius_m for place in starts[fixed:]]
                room += [0.5 * math.dist(start, starts[other]) for other in range(1, fixed) if other != row]
                radii[row] = max(0.0, min([radius_m, wall, *room]))

        def fits(row: int, place: Floats, chosen: Floats) -> bool:
            seen = chosen[[v if u == row else u for u, v in tree if row in (u, v)]]
            return bool(free.contains(place[None])[0] and np.all(environment.line_of_sight(place[None], seen)))

        idle = [fixed + number for number, (_, goal) in enumerate(robots) if goal is None]
        goals = stand_apart([base, *sent], [*range(fixed), *idle], radii, fits)
        named = ["agent"] if len(agents) == 1 else [f"agent {number}" for number in range(1, fixed)]
        names = ("base", *named, *(f"robot {number}" for number in range(1, len(robots) + 1)))
        return cls(names, starts, goals, radii, tree)

    def links_at_start(self, environment: Environment) -> Links:
        """Short lines of sight that join as many as can be to the base station, before anybody moves: a tree."""
        seen = environment.visibility_matrix(self.starts)
        graph: nx.Graph[int] = nx.Graph()
        graph.add_node(0)
        graph.add_weighted_edges_from(
            (int(u), int(v), math.dist(self.starts[u], self.starts[v])) for u, v in np.argwhere(np.triu(seen, 1))
        )
        component = graph.subgraph(nx.node_connected_component(graph, 0))
        return tuple((min(link), max(link)) for link in nx.minimum_spanning_tree(component).edges)


@dataclass(frozen=True, slots=True, eq=False)
class PlannedMotion:
    """How a team gets to its deployment.

    Attributes:
        team: who.
        motion: the schedule, and how it was found.
        certificate: what is true of the schedule.
        joined: names of those that one network holds throughout, over any others: all of the tree that are joined to
            the base station before anybody moves. Fewer than two: nobody has to see anybody on the way.
        links_before: lines of sight that join them then.
        speed_m_s: of robots.
    """

    team: Team
    motion: Motion
    certificate: Certificate
    joined: tuple[str, ...]
    links_before: Links
    speed_m_s: float

    @classmethod
    def of(cls, team: Team, environment: Environment, geodesics: GeodesicMap, speed_m_s: float) -> PlannedMotion:
        """Plan the motion of a team, and judge it.

        Args:
            team: who goes where.
            environment: the map as drawn.
            geodesics: of robots' centres.
            speed_m_s: of robots.
        """
        links = team.links_at_start(environment)
        wanted = {0, *(row for link in team.tree for row in link)} & {0, *(row for link in links for row in link)}
        joined = tuple(team.names[row] for row in sorted(wanted))
        motion = plan_motion(
            environment, team.starts, team.goals, team.radii_m, members=team.names, speed_m_s=speed_m_s,
            joined=joined, geodesics=geodesics, yielding=[name for name in team.names if name.startswith("robot")],
        )  # fmt: skip
        asked: dict[str, Any] = {"ends": joined} if len(joined) > 1 else {"links": ()}
        return cls(team, motion, certify(motion.schedule, environment, **asked), joined, links, speed_m_s)

    @property
    def succeeds(self) -> bool:
        """Whether all get there, and the certificate finds nothing wrong on the way."""
        return self.motion.arrives and self.certificate.valid

    @property
    def fault(self) -> str:
        """One sentence on a motion that does not succeed."""
        planned_so = self.motion.way == "parted" or not self.motion.arrives
        return self.motion.reason if planned_so else self.certificate.violations[0].text

    @property
    def moves(self) -> list[Move]:
        """Who goes how far, when."""
        return order_moves(self.motion.schedule)

    def stays(self, row: int) -> bool:
        """Whether a member goes nowhere."""
        return self.motion.schedule.paths[row].length_m <= 0.0

    def facts(self) -> dict[str, Any]:
        """As it is written for programs."""
        motion, schedule, names = self.motion, self.motion.schedule, self.team.names
        assert schedule.stages is not None
        return {
            "way": motion.way,
            "arrives": motion.arrives,
            "reason": motion.reason,
            "proven": motion.proven,
            "between": motion.between,
            "break_s": motion.break_s,
            "certified": self.certificate.valid,
            "violations": [violation.text for violation in self.certificate.violations],
            "joined": list(self.joined),
            "speed_m_s": self.speed_m_s,
            "duration_s": schedule.end_s - schedule.start_s,
            "length_m": motion.length_m,
            "geodesic_m": motion.geodesic_m,
            "moves": [
                {
                    "member": names[move.member],
                    "stages": move.stages,
                    "length_m": move.length_m,
                    "begin_s": move.begin_s,
                    "end_s": move.end_s,
                    "waits_s": move.waits_s,
                    "waits_for": [names[member] for member in move.waits_for],
                }
                for move in self.moves
            ],
            "schedule": [
                {
                    "member": name,
                    "radius_m": float(radius),
                    "waypoints": path.waypoints.tolist(),
                    "times_s": path.times_s.tolist(),
                    "stages": stages.tolist(),
                }
                for name, path, radius, stages in zip(
                    schedule.members, schedule.paths, schedule.radii_m, schedule.stages, strict=True
                )
            ],
        }
