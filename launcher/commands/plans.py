"""``plan``: where robots are to stand, and who goes where, without a team."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from launcher.commands.plan_facts import answer_plan
from launcher.commands.plan_options import (
    LARGEST_M,
    AsJson,
    Decomposition,
    Diagram,
    MaxBitangent,
    Picture,
    Radius,
    Tolerance,
    check_picture,
)
from launcher.console import LONGEST_S, check_option, plainly, read_point
from launcher.placements import PlacementOptions, Weighting
from launcher.plan_request import Method, Movement, Moves, Request, Search
from launcher.present_tree import read_links, read_pair
from launcher.scenario import MOST_ROBOTS, ScenarioFault, find_map

if TYPE_CHECKING:
    from planning.edge_weights import RobotPenalty

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
    agent_from: Annotated[
        list[str] | None,
        typer.Option(
            metavar="X,Y",
            help="Where an agent comes from, by the schedule as robots do; once for each agent. It is there already if "
            "not given.",
            rich_help_panel=_MOVES,
        ),
    ] = None,
    search: Annotated[
        Search,
        typer.Option(
            help="Least cost over all trees, over those one edge away, over the present one, over chains; or the "
            "cheapest tree first and then who goes where in it.",
            rich_help_panel=_MOVES,
        ),
    ] = "exact",
    link: Annotated[
        list[str] | None,
        typer.Option(
            metavar="A-B",
            help="A link of the present tree, between base, agent (agent1, agent2 ...) and robots by number, such as "
            "base-1; may be repeated. If not given, fixed and one-edge take a line by all robots in their order.",
            rich_help_panel=_MOVES,
        ),
    ] = None,
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
    diagram: Diagram = None,
    as_json: AsJson = False,
) -> None:
    """Say where robots are to stand so that lines of sight join the base station to all agents, and who goes where.

    Of robots that are somewhere already it also says in which order they go there, so that nobody collides and the
    network holds on the way.
    """
    with plainly():
        check_option("--robots", robots, 0, MOST_ROBOTS)
        check_option("--vertices", vertices, 1, 2 * MOST_ROBOTS)
        check_option("--radius", radius_m, 0, LARGEST_M, "metres")
        check_option("--tolerance", tolerance_m, 0, LARGEST_M, "metres")
        check_option("--spacing", spacing_m, 1e-3, GREATEST, "metres")
        check_option("--max-bitangent", max_bitangent_m, 1e-6, GREATEST, "metres")
        check_option("--distance-weight", distance_weight, 0, GREATEST)
        check_option("--area-weight", area_weight, 0, GREATEST)
        check_option("--mu", mu, 0, GREATEST)
        check_option("--jump-penalty", jump_penalty_m, 0, GREATEST, "metres")
        check_option("--speed", speed_m_s, 1e-3, LARGEST_M, "m/s")
        check_option("--deadline", deadline_s, 0, LONGEST_S, "seconds")
        starts = tuple(read_point(text, "--robot") for text in robot or ())
        came = tuple(read_point(text, "--agent-from") for text in agent_from or ())
        check_option("the number of --robot", len(starts), 0, MOST_ROBOTS)
        weighting = Weighting(weights, distance_weight, area_weight, area_cost, _read_penalty(robot_penalty))
        present = read_links(link, len(agent), len(starts), idle) if link else ()
        request = Request(
            find_map(name, Path()),
            read_point(base, "--base"),
            tuple(read_point(text, "--agent") for text in agent),
            PlacementOptions(placements, radius_m, decomposition, max_bitangent_m, spacing_m, weighting),
            robots,
            method,
            vertices,
            Moves(starts, search, mu, movement, jump_penalty_m, speed_m_s, deadline_s, idle, present, came),
            tolerance_m,
            picture,
            None if diagram is None else (read_pair(diagram[0], len(agent), len(starts)), diagram[1]),
        )
        request.check()
        check_picture(picture)
        if diagram is not None:
            check_picture(diagram[1], "--diagram")
        answer_plan(request, as_json)


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
