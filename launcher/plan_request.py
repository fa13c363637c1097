"""What ``plan`` is asked, held against itself and against the map."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias

from launcher.placements import PlacementOptions
from launcher.scenario import ScenarioFault
from launcher.wording import counted

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from launcher.offline_plan import MovePlan, Terminals
    from planning.decomposition import Cells
    from planning.placement_graph import PlacementGraph
    from protocol.messages import Point

# As planning has them; importing them from there takes a second, before a word is said.
Method: TypeAlias = Literal["exact", "mst", "takahashi-matsuyama"]
Search: TypeAlias = Literal["tree", "exact", "one-edge", "fixed", "chain"]
"""``tree``: the cheapest tree first, and then which robot goes to which of its places (thesis §3.4)."""
Movement: TypeAlias = Literal["geodesic", "euclidean", "adjacency"]


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

    def check(self, agents: int) -> None:
        """Raise where options contradict each other.

        Raises:
            ScenarioFault: one sentence.
        """
        if not self.robots and self != Moves():
            raise ScenarioFault("how robots move is asked, and not where they are: give --robot X,Y for each of them")
        if self.deadline_s is not None and self.speed_m_s is None:
            raise ScenarioFault("--deadline needs to know how fast robots are: give --speed, too")
        if self.jump_penalty_m and self.movement != "adjacency":
            raise ScenarioFault("--jump-penalty is of paths through adjacent cells: say --movement adjacency")
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
        if self.moves.robots and self.robots is not None:
            raise ScenarioFault("each --robot is one of the robots there are: leave out --robots")
        if self.moves.movement == "adjacency" and self.placements.kind == "points":
            raise ScenarioFault("--movement adjacency leads through cells: say --placements cells, too")


def check_robots(request: Request, needed: int) -> None:
    """Raise where there are too few robots.

    Args:
        request: what is asked.
        needed: how many robots the terminals need at least.

    Raises:
        ScenarioFault: one sentence.
    """
    agents = len(request.agents)
    who = f"the agent at {request.agents[0][0]:g},{request.agents[0][1]:g} needs"
    if agents > 1:
        who = f"the {agents} agents need"
    need = f"{request.file}: {who} {counted(needed, 'robot')}, and"
    if request.robots is not None and request.robots < needed:
        raise ScenarioFault(f"{need} --robots says {request.robots}; give at least {needed}, or move the agents")
    if request.vertices is not None and request.vertices < 1 + agents + needed:
        raise ScenarioFault(
            f"{need} of --vertices {request.vertices} only {max(0, request.vertices - 1 - agents)} can be robots; give "
            f"at least {1 + agents + needed}, or move the agents"
        )
    if 0 < len(request.moves.robots) < needed:
        raise ScenarioFault(
            f"{need} --robot was given {counted(len(request.moves.robots), 'time')}; give at least {needed}, or move "
            "the agents"
        )


def send_robots(
    moves: Moves, terminals: Terminals, graph: PlacementGraph, cells: Cells | None, method: Method
) -> MovePlan:
    """Who goes where.

    Args:
        moves: how; with robots.
        terminals: base station and agents on the placements.
        graph: the placements.
        cells: which they stand for, if they do.
        method: of the tree, where that is made first.

    Raises:
        ValueError: one sentence, where these robots cannot do it.
    """
    from planning.physical_weights import arrival_times

    costs = _lengths(moves, graph, cells)
    if moves.speed_m_s is not None:
        costs = arrival_times(costs, moves.speed_m_s, float("inf") if moves.deadline_s is None else moves.deadline_s)
    if moves.search == "tree":
        return terminals.assign(costs, moves.mu, method)
    return terminals.redeploy(costs, moves.mu, moves.search, moves.idle)


def _lengths(moves: Moves, graph: PlacementGraph, cells: Cells | None) -> NDArray[np.float64]:
    """How far robots have to go to each placement: (k, N) float, metres."""
    from planning.adjacency_path import AdjacencyPaths
    from planning.physical_weights import adjacency_path_weights, euclidean_weights, geodesic_weights

    if moves.movement == "adjacency" and cells is not None:
        paths = AdjacencyPaths(cells, graph.free, moves.jump_penalty_m)
        return adjacency_path_weights(paths, moves.robots)[:, graph.cells]
    if moves.movement == "euclidean":
        return euclidean_weights(moves.robots, graph.positions)
    return geodesic_weights(graph.geodesics, moves.robots, graph.positions)
