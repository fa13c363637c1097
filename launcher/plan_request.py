"""What ``plan`` is asked, held against itself and against the map."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias

from launcher.placements import PlacementOptions
from launcher.present_tree import Links, line_up
from launcher.scenario import ScenarioFault
from launcher.wording import counted

if TYPE_CHECKING:
    from launcher.offline_plan import MovePlan, Need, Terminals
    from launcher.planned_motion import PlannedMotion
    from launcher.ways import Line
    from planning.decomposition import Cells
    from planning.placement_graph import PlacementGraph
    from protocol.messages import Point

# As planning has them; importing them from there takes a second, before a word is said.
Method: TypeAlias = Literal["exact", "mst", "takahashi-matsuyama"]
Search: TypeAlias = Literal["tree", "exact", "one-edge", "fixed", "chain"]
"""``tree``: the cheapest tree first, and then which robot goes to which of its places (thesis §3.4)."""
Movement: TypeAlias = Literal["geodesic", "euclidean", "adjacency"]


SPEED_M_S = 1.0
"""Of robots that move, where nobody says."""


@dataclass(frozen=True)
class Moves:
    """How robots that are somewhere already are sent."""

    robots: tuple[Point, ...] = ()
    search: Search = "exact"
    mu: float = 1.0
    movement: Movement = "geodesic"
    jump_penalty_m: float = 0.0
    speed_m_s: float | None = None
    deadline_s: float | None = None
    idle: bool = False
    links: Links = ()
    """The present tree, of nodes as in :mod:`launcher.present_tree`; none: not known."""
    agents: tuple[Point, ...] = ()
    """Where agents come from; none: they are where they are to be joined."""

    def check(self, agents: int) -> None:
        """Raise where options contradict each other.

        Raises:
            ScenarioFault: one sentence.
        """
        if not self.robots and self != Moves():
            raise ScenarioFault("how robots move is asked, and not where they are: give --robot X,Y for each of them")
        if self.agents and len(self.agents) != agents:
            raise ScenarioFault(
                f"--agent-from is given {counted(len(self.agents), 'time')} for {counted(agents, 'agent')}: give it "
                "once for each, in their order, or not at all"
            )
        if self.deadline_s is not None and self.speed_m_s is None:
            raise ScenarioFault("--deadline needs to know how fast robots are: give --speed, too")
        if self.jump_penalty_m and self.movement != "adjacency":
            raise ScenarioFault("--jump-penalty is of paths through adjacent cells: say --movement adjacency")
        if self.links and self.search in ("tree", "chain"):
            raise ScenarioFault(
                f"--search {self.search} looks at no present tree: leave out --link, or say --search one-edge"
            )
        if self.search == "chain" and agents > 1:
            raise ScenarioFault(
                f"--search chain joins one agent, and there are {agents}: say --search exact, with --idle if "
                "robots may be left out"
            )


@dataclass(frozen=True)
class Request:
    """What is asked for."""

    file: Path
    base: Point
    agents: tuple[Point, ...]
    placements: PlacementOptions
    robots: int | None = None
    method: Method = "exact"
    vertices: int | None = None
    moves: Moves = field(default_factory=Moves)
    tolerance_m: float | None = None
    picture: Path | None = None
    diagram: tuple[tuple[int, int], Path] | None = None
    """Of which two, of nodes as in :mod:`launcher.present_tree`, and where it is written."""

    def check(self) -> None:
        """Raise where options contradict each other.

        Raises:
            ScenarioFault: one sentence.
        """
        self.placements.check()
        self.moves.check(len(self.agents))
        if self.vertices is not None and (self.moves.robots or self.robots is not None):
            raise ScenarioFault("--vertices fixes the number of robots: leave out --robots and --robot")
        if self.vertices is not None and self.method != "exact":
            raise ScenarioFault("a tree of so many --vertices is always exact: leave out --method")
        if self.diagram is not None and not self.moves.robots:
            raise ScenarioFault("--diagram is of two that move: give --robot X,Y for each of them")
        if self.moves.robots and self.robots is not None:
            raise ScenarioFault("each --robot is one of the robots there are: leave out --robots")
        if self.moves.movement == "adjacency" and self.placements.kind == "points":
            raise ScenarioFault("--movement adjacency leads through cells: say --placements cells, too")


def check_robots(request: Request, need: Need) -> None:
    """Raise where there are certainly too few robots.

    Args:
        request: what is asked.
        need: how many robots the terminals need.

    Raises:
        ScenarioFault: one sentence.
    """
    if not need.least:
        return
    needed, agents = need.relays, len(request.agents)
    who = f"the agent at {request.agents[0][0]:g},{request.agents[0][1]:g} needs"
    if agents > 1:
        who = f"the {agents} agents need"
    lack = f"{request.file}: {who} {counted(needed, 'robot')}, and"
    if request.robots is not None and request.robots < needed:
        raise ScenarioFault(f"{lack} --robots says {request.robots}; give at least {needed}, or move the agents")
    if request.vertices is not None and request.vertices < 1 + agents + needed:
        raise ScenarioFault(
            f"{lack} of --vertices {request.vertices} only {max(0, request.vertices - 1 - agents)} can be robots; give "
            f"at least {1 + agents + needed}, or move the agents"
        )
    if 0 < len(request.moves.robots) < needed:
        raise ScenarioFault(
            f"{lack} --robot was given {counted(len(request.moves.robots), 'time')}; give at least {needed}, or move "
            "the agents"
        )


def present_tree(request: Request) -> Links | None:
    """The tree that the search starts from; None where it needs none, and none is given."""
    if request.moves.links or request.moves.search not in ("fixed", "one-edge"):
        return request.moves.links or None
    return line_up(len(request.agents), len(request.moves.robots))


def send_robots(
    request: Request, terminals: Terminals, graph: PlacementGraph, cells: Cells | None
) -> tuple[MovePlan, tuple[Line, ...]]:
    """Who goes where, and along which way; of a robot that idles the way is the place where it is.

    Args:
        request: with robots.
        terminals: base station and agents on the placements.
        graph: the placements.
        cells: which they stand for, if they do.

    Raises:
        ValueError: one sentence, where these robots cannot do it.
    """
    from launcher.ways import Ways
    from planning.physical_weights import arrival_times

    moves = request.moves
    ways = Ways(moves.robots, graph, moves.movement, cells, moves.jump_penalty_m)
    costs = ways.lengths()
    if moves.speed_m_s is not None:
        costs = arrival_times(costs, moves.speed_m_s, float("inf") if moves.deadline_s is None else moves.deadline_s)
    if moves.search == "tree":
        plan = terminals.assign(costs, moves.mu, request.method)
    else:
        plan = terminals.redeploy(costs, moves.mu, moves.search, present_tree(request), moves.idle)
    lines = [
        (start,) if placement is None else ways.line(robot, placement)
        for robot, (start, placement) in enumerate(zip(moves.robots, plan.placements, strict=True))
    ]
    return plan, tuple(lines)


def move_team(request: Request, plan: MovePlan, graph: PlacementGraph) -> PlannedMotion:
    """How the team gets there, by the ways round walls whatever movement costs were counted by.

    Raises:
        ScenarioFault: a diagram is asked for of somebody who stays.
    """
    from launcher.planned_motion import PlannedMotion, Team

    moves = request.moves
    team = Team.sent(
        request.base,
        list(zip(moves.agents or request.agents, request.agents, strict=True)),
        list(zip(moves.robots, plan.targets, strict=True)),
        plan.tree, graph.radius_m, graph.environment, graph.free,
    )  # fmt: skip
    planned = PlannedMotion.of(team, graph.environment, graph.geodesics, moves.speed_m_s or SPEED_M_S)
    still = [] if request.diagram is None else [team.names[row] for row in request.diagram[0] if planned.stays(row)]
    if still:
        movers = [name for row, name in enumerate(team.names) if not planned.stays(row)]
        raise ScenarioFault(
            f"{request.file}: a --diagram is of two that move, and {still[0]} stays where it is; choose two of "
            f"{', '.join(movers) or 'other places'}"
        )
    return planned
