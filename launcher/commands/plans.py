"""``plan``: where robots are to stand, and who goes where, without a team."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from launcher.commands.plan_options import (
    LARGEST_M,
    AsJson,
    Decomposition,
    MaxBitangent,
    Picture,
    Radius,
    Tolerance,
    check_picture,
    sayer,
)
from launcher.console import LONGEST_S, busy, check_option, plainly, print_json, read_point, tell
from launcher.placements import PlacementOptions, Weighting, place
from launcher.plan_request import Method, Movement, Moves, Request, Search, check_robots, send_robots
from launcher.scenario import MOST_ROBOTS, ScenarioFault, find_map
from launcher.wording import counted

if TYPE_CHECKING:
    from launcher.offline_plan import MovePlan, TreePlan
    from planning.decomposition import Cells
    from planning.edge_weights import RobotPenalty
    from planning.environment import Environment
    from protocol.messages import Point

GREATEST = 1e9
"""Of any coefficient."""

_PLACES = "Where robots may stand"
_WEIGHTS = "What links between cells weigh"
_MOVES = "Robots that are somewhere already"


def plan(
    name: Annotated[str, typer.Argument(metavar="MAP", help="A map that comes with Sightline, or a map file.")],
    base: Annotated[str, typer.Option(metavar="X,Y", help="Where the base station stands, in metres.")],
    agent: Annotated[list[str], typer.Option(metavar="X,Y", help="Where an agent is, in metres; may be repeated.")],
    robots: Annotated[int | None, typer.Option(help="Robots there are; as many as needed if not given.")] = None,
    radius_m: Radius = 0.2,
    method: Annotated[Method, typer.Option(help="How the tree to base station and agents is found.")] = "exact",
    vertices: Annotated[
        int | None, typer.Option(help="A tree of exactly so many nodes: base station, agents, robots.")
    ] = None,
    placements: Annotated[
        Literal["cells", "points"],
        typer.Option(help="Cells that wholly see each other, or points with exact sight.", rich_help_panel=_PLACES),
    ] = "points",
    spacing_m: Annotated[
        float | None, typer.Option("--spacing", help="Of the grid of points, in metres.", rich_help_panel=_PLACES)
    ] = None,
    decomposition: Decomposition = "inflection",
    max_bitangent_m: MaxBitangent = None,
    weights: Annotated[
        Literal["normalised", "combined"],
        typer.Option(help="Distance and area as shares of the greatest, or by weight.", rich_help_panel=_WEIGHTS),
    ] = "normalised",
    distance_weight: Annotated[float, typer.Option(help="k_a, if combined.", rich_help_panel=_WEIGHTS)] = 1.0,
    area_weight: Annotated[float, typer.Option(help="k_b, if combined.", rich_help_panel=_WEIGHTS)] = 1.0,
    area_cost: Annotated[
        Literal["negative-exponential", "inverse"], typer.Option(help="Of small cells.", rich_help_panel=_WEIGHTS)
    ] = "negative-exponential",
    robot_penalty: Annotated[
        str | None,
        typer.Option(
            metavar="Z", help="Of each link: a number, 'pairwise', or 'fewest' robots first.", rich_help_panel=_WEIGHTS
        ),
    ] = None,
    robot: Annotated[
        list[str] | None,
        typer.Option(metavar="X,Y", help="Where a robot is; may be repeated.", rich_help_panel=_MOVES),
    ] = None,
    search: Annotated[
        Search,
        typer.Option(
            help="Least cost over all trees, over those one edge away, over the present one, over chains; or the "
            "cheapest tree first and then who goes where in it.",
            rich_help_panel=_MOVES,
        ),
    ] = "exact",
    mu: Annotated[float, typer.Option(help="What links count beside movement.", rich_help_panel=_MOVES)] = 1.0,
    movement: Annotated[
        Movement, typer.Option(help="Round walls, straight, or by adjacent cells.", rich_help_panel=_MOVES)
    ] = "geodesic",
    jump_penalty_m: Annotated[
        float,
        typer.Option("--jump-penalty", help="Metres that one jump less may cost (adjacency).", rich_help_panel=_MOVES),
    ] = 0.0,
    speed_m_s: Annotated[
        float | None, typer.Option("--speed", help="Of robots, m/s: movement costs seconds.", rich_help_panel=_MOVES)
    ] = None,
    deadline_s: Annotated[
        float | None, typer.Option("--deadline", help="Seconds that robots have.", rich_help_panel=_MOVES)
    ] = None,
    idle: Annotated[bool, typer.Option("--idle", help="Robots may be left out.", rich_help_panel=_MOVES)] = False,
    tolerance_m: Tolerance = None,
    picture: Picture = None,
    as_json: AsJson = False,
) -> None:
    """Say where robots are to stand so that lines of sight join the base station to all agents, and who goes where."""
    with plainly():
        check_option("--robots", robots, 0, MOST_ROBOTS)
        check_option("--vertices", vertices, 1, 2 * MOST_ROBOTS)
        check_option("--radius", radius_m, 0, LARGEST_M, "metres")
        check_option("--tolerance", tolerance_m, 0, LARGEST_M, "metres")
        check_option("--max-bitangent", max_bitangent_m, 1e-6, GREATEST, "metres")
        check_option("--distance-weight", distance_weight, 0, GREATEST)
        check_option("--area-weight", area_weight, 0, GREATEST)
        check_option("--mu", mu, 0, GREATEST)
        check_option("--jump-penalty", jump_penalty_m, 0, GREATEST, "metres")
        check_option("--speed", speed_m_s, 1e-3, LARGEST_M, "m/s")
        check_option("--deadline", deadline_s, 0, LONGEST_S, "seconds")
        starts = tuple(read_point(text, "--robot") for text in robot or ())
        check_option("the number of --robot", len(starts), 0, MOST_ROBOTS)
        weighting = Weighting(weights, distance_weight, area_weight, area_cost, _read_penalty(robot_penalty))
        request = Request(
            find_map(name, Path()),
            read_point(base, "--base"),
            tuple(read_point(text, "--agent") for text in agent),
            PlacementOptions(placements, radius_m, decomposition, max_bitangent_m, spacing_m, weighting),
            robots,
            method,
            vertices,
            Moves(starts, search, mu, movement, jump_penalty_m, speed_m_s, deadline_s, idle),
            tolerance_m,
        )
        request.check()
        check_picture(picture)
        _answer(request, picture, as_json)


def _read_penalty(text: str | None) -> RobotPenalty | None:
    """Z as it is written on the command line.

    Raises:
        ScenarioFault: it is neither of the words nor a number.
    """
    if text is None:
        return None
    if text == "pairwise":
        return "pairwise"
    if text == "fewest":
        return "fewest"
    try:
        value = float(text)
    except ValueError:
        raise ScenarioFault(f"--robot-penalty '{text}' is no penalty; give a number, 'pairwise' or 'fewest'") from None
    check_option("--robot-penalty", value, 0, GREATEST)
    return value


def _answer(request: Request, picture: Path | None, as_json: bool) -> None:
    from launcher.ground import Ground
    from launcher.kernels import warm_up

    say = sayer(as_json)
    warm_up(say, ["planning"])
    file, options = request.file, request.placements
    ground = Ground.around(file, file, "--base", request.base, request.tolerance_m)
    for agent in request.agents:
        ground.check_inside("--agent", agent)
    for robot in request.moves.robots:
        ground.check_walk("--radius", {"--robot": robot}, options.radius_m, request.base, "--base")
    ground.room("--radius", options.radius_m, request.base, "--base")
    from launcher.offline_plan import Terminals

    with busy("Planning ..."):
        graph, cells = place(file, ground.environment, options, request.base, say)
        terminals = Terminals(graph, [request.base, *request.agents])
        if lost := terminals.unreachable():
            x, y = request.agents[lost[0]]
            raise ScenarioFault(
                f"{file}: no chain of robots joins --agent {x:g},{y:g} to --base; move it, make --radius smaller, or "
                "choose other placements"
            )
        needed = terminals.fewest_relays()
        check_robots(request, needed)
        facts = {
            "map": str(file),
            "base": request.base,
            "agents": list(request.agents),
            "placements": options.kind,
            "decomposition": options.decomposition if options.kind == "cells" else None,
            "robot_radius_m": options.radius_m,
            "relays_needed": needed,
            "most_relays_needed": max(0, int(graph.relays_from(request.base).max()) - 1),
        }
        if request.moves.robots:
            moved = send_robots(request.moves, terminals, graph, cells, request.method)
        else:
            tree = terminals.tree(request.method, request.vertices, request.robots)
    if request.moves.robots:
        _tell_moves(request, facts, moved, ground.environment, cells, picture, as_json)
    else:
        _tell_tree(request, facts, tree, ground.environment, cells, picture, as_json)


def _tell_tree(
    request: Request,
    facts: dict[str, Any],
    tree: TreePlan,
    environment: Environment,
    cells: Cells | None,
    picture: Path | None,
    as_json: bool,
) -> None:
    count = len(tree.relays)
    spares = None if request.robots is None else request.robots - count
    _draw(request, environment, cells, picture, f"{counted(count, 'relay')}", tree.relays, tree.links)
    if as_json:
        print_json({**facts, "relays": tree.relays, "links": tree.links, "cost": tree.cost, "spares": spares})
        return
    spare = "" if spares is None else f", {spares} to spare"
    tell(f"{_count(count, facts)}{spare}; virtual cost {tree.cost:.3f}")
    relays = [(f"relay {number}", place) for number, place in enumerate(tree.relays, 1)]
    _tell_places([("base", request.base), *relays, *_named_agents(request)])
    _tell_most(facts, picture)


def _tell_moves(
    request: Request,
    facts: dict[str, Any],
    moved: MovePlan,
    environment: Environment,
    cells: Cells | None,
    picture: Path | None,
    as_json: bool,
) -> None:
    moves = request.moves
    unit = "m" if moves.speed_m_s is None else "s"
    targets = [target for target in moved.targets if target is not None]
    ways = list(zip(moves.robots, moved.targets, strict=True))
    idle = len(ways) - len(targets)
    title = f"{moves.search}: {counted(len(targets), 'relay')}, {idle} idle, cost {moved.cost:.2f}"
    _draw(request, environment, cells, picture, title, targets, moved.links, ways)
    if as_json:
        robots = [{"from": start, "to": end} for start, end in ways]
        costs = {"movement": moved.movement, "virtual": moved.virtual, "cost": moved.cost}
        bound = {"mu": moves.mu, "unit": unit, "lower_bound": moved.lower_bound, "search": moves.search}
        print_json({**facts, "robots": robots, "relays": targets, "links": moved.links, **costs, **bound})
        return
    tell(
        f"{_count(len(targets), facts)}, {idle} idle; cost "
        f"{moved.cost:.3f} = movement {moved.movement:.3f} {unit} + {moves.mu:g} × virtual cost {moved.virtual:.3f}"
    )
    if moved.lower_bound is not None:
        gap = moved.cost - moved.lower_bound
        proof = "which is the least there can be" if gap <= 1e-9 * moved.cost else "which no plan goes below"
        tell(f"  bound     {moved.lower_bound:.3f}, {proof}")
    _tell_places([("base", request.base), *_named_agents(request)])
    for number, (start, end) in enumerate(ways, 1):
        where = "idles" if end is None else f"to {end[0]:8.3f}, {end[1]:8.3f}"
        tell(f"  robot {number:<3} {start[0]:8.3f}, {start[1]:8.3f}  {where}")
    _tell_most(facts, picture)


def _count(relays: int, facts: dict[str, Any]) -> str:
    """How many relays, and how many would do."""
    needed = facts["relays_needed"]
    return counted(relays, "relay") + ("" if relays == needed else f" ({needed} would do)")


def _named_agents(request: Request) -> list[tuple[str, Point]]:
    if len(request.agents) == 1:
        return [("agent", request.agents[0])]
    return [(f"agent {number}", place) for number, place in enumerate(request.agents, 1)]


def _tell_places(places: Sequence[tuple[str, Point]]) -> None:
    for title, (x, y) in places:
        tell(f"  {title:9} {x:8.3f}, {y:8.3f}")


def _tell_most(facts: dict[str, Any], picture: Path | None) -> None:
    most = counted(facts["most_relays_needed"], "relay")
    tell(f"An agent at any of the {facts['placements']} needs at most {most} from this base station.")
    if picture is not None:
        tell(f"Picture: {picture}")


def _draw(
    request: Request,
    environment: Environment,
    cells: Cells | None,
    picture: Path | None,
    title: str,
    relays: Sequence[Point],
    links: Sequence[tuple[Point, Point]],
    robots: Sequence[tuple[Point, Point | None]] = (),
) -> None:
    if picture is None:
        return
    from launcher.picture import draw_plan

    draw_plan(
        environment, None if cells is None else cells.polygons, request.base, request.agents, relays, links, picture,
        f"{environment.name or request.file.stem}: {title}", robots=robots,
    )  # fmt: skip
