"""``map`` and ``plan``: what can be known without a team."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from launcher.console import busy, check_option, err, out, plainly, print_json, read_point, tell
from launcher.scenario import MOST_ROBOTS, ScenarioFault, find_map
from launcher.wording import counted

if TYPE_CHECKING:
    from planning.environment import Environment
    from protocol.messages import Point

Decomposition = Annotated[
    Literal["inflection", "aspect"], typer.Option(help="Cells by inflection lines, or also by bitangents.")
]
Tolerance = Annotated[
    float | None,
    typer.Option("--tolerance", help="Of an occupancy grid's outline, in metres, up to 100; two cells if not given."),
]
MapName = Annotated[str, typer.Argument(metavar="MAP", help="A map that comes with Sightline, or a map file.")]
Picture = Annotated[Path | None, typer.Option(help="Write a picture (.png, .svg or .pdf).")]
AsJson = Annotated[bool, typer.Option("--json", help="Write JSON for programs.")]

LARGEST_M = 100.0
"""Radius of a robot at most, as in scenario files."""


def show(
    name: Annotated[
        str | None, typer.Argument(metavar="MAP", help="A map that comes with Sightline, or a map file; none: a list.")
    ] = None,
    decomposition: Decomposition = "inflection",
    tolerance_m: Tolerance = None,
    picture: Picture = None,
    as_json: AsJson = False,
) -> None:
    """Say what a map is like: size, cells and their counts; draw it. Without MAP: list the maps there are."""
    with plainly():
        if name is None:
            _list_maps(as_json)
        else:
            check_option("--tolerance", tolerance_m, 0, LARGEST_M, "metres")
            _describe_map(name, decomposition, tolerance_m, picture, as_json)


def _list_maps(as_json: bool) -> None:
    from rich.table import Table

    import maps
    from planning.environment import Environment

    environments = {name: Environment.load(maps.path(name)) for name in maps.names()}
    facts = [_facts(name, environment) for name, environment in environments.items()]
    if as_json:
        print_json(facts)
        return
    table = Table("map", "size", "free area", "vertices", "holes", box=None)
    for fact in facts:
        x0, y0, x1, y1 = fact["bounds"]
        size = f"{x1 - x0:.1f} × {y1 - y0:.1f} m"
        table.add_row(fact["name"], size, f"{fact['area_m2']:.0f} m²", str(fact["vertices"]), str(fact["holes"]))
    out.print(table)


def _facts(name: str, environment: Environment) -> dict[str, Any]:
    return {
        "name": name,
        "bounds": [round(value, 6) for value in environment.bounds],
        "area_m2": round(environment.area, 6),
        "vertices": len(environment.vertices),
        "reflex_vertices": len(environment.reflex_vertices),
        "holes": len(environment.holes),
    }


def _describe_map(
    name: str,
    kind: Literal["inflection", "aspect"],
    tolerance_m: float | None,
    picture: Path | None,
    as_json: bool,
) -> None:
    from launcher.kernels import warm_up

    file = find_map(name, Path())
    _check_picture(picture)
    from launcher.ground import load_map

    environment = load_map(file, file, None, tolerance_m)
    warm_up(_say(as_json), ["planning"])
    from planning.decomposition import decompose

    with busy("Decomposing ..."):
        cells = decompose(environment, kind)
    facts = {
        **_facts(environment.name or file.stem, environment),
        "file": str(file),
        "source": environment.source,
        "decomposition": kind,
        "cells": len(cells.areas),
        "counts": {key: int(value) for key, value in cells.counts.items()},
    }
    if picture is not None:
        from launcher.picture import draw_map

        title = f"{facts['name']}: {facts['cells']} cells ({kind})"
        draw_map(environment, cells.polygons, picture, title)
    if as_json:
        print_json(facts)
        return
    x0, y0, x1, y1 = environment.bounds
    tell(f"{facts['name']}  ({file})")
    tell(f"  size       {x1 - x0:.1f} × {y1 - y0:.1f} m, x {x0:g} to {x1:g}, y {y0:g} to {y1:g}")
    tell(f"  free       {environment.area:.1f} m²")
    walls = (
        f"{facts['vertices']} vertices, {facts['reflex_vertices']} of them reflex, {counted(facts['holes'], 'hole')}"
    )
    tell(f"  walls      {walls}")
    tell(f"  cells      {facts['cells']} ({kind})")
    tell("  counts     " + ", ".join(f"{key} {value}" for key, value in facts["counts"].items()))
    if environment.source:
        tell(f"  source     {environment.source}")
    if picture is not None:
        tell(f"  picture    {picture}")


def plan(
    name: MapName,
    base: Annotated[str, typer.Option(metavar="X,Y", help="Where the base station stands, in metres.")],
    agent: Annotated[list[str], typer.Option(metavar="X,Y", help="Where the agent is, in metres.")],
    robots: Annotated[int | None, typer.Option(help="Robots there are; as many as needed if not given.")] = None,
    radius_m: Annotated[float, typer.Option("--radius", help="Radius of a robot, in metres, 0 to 100.")] = 0.2,
    decomposition: Decomposition = "inflection",
    tolerance_m: Tolerance = None,
    picture: Picture = None,
    as_json: AsJson = False,
) -> None:
    """Say where robots are to stand so that lines of sight join the base station to the agent."""
    with plainly():
        if len(agent) > 1:
            raise ScenarioFault(
                f"--agent was given {len(agent)} times: this version plans chains to one agent, not trees to several; "
                "give it once"
            )
        check_option("--robots", robots, 0, MOST_ROBOTS)
        check_option("--radius", radius_m, 0, LARGEST_M, "metres")
        check_option("--tolerance", tolerance_m, 0, LARGEST_M, "metres")
        places = read_point(base, "--base"), read_point(agent[0], "--agent")
        _plan(name, *places, robots, radius_m, decomposition, tolerance_m, picture, as_json)


def _plan(
    name: str,
    base: Point,
    agent: Point,
    robots: int | None,
    radius_m: float,
    kind: Literal["inflection", "aspect"],
    tolerance_m: float | None,
    picture: Path | None,
    as_json: bool,
) -> None:
    file = find_map(name, Path())
    _check_picture(picture)
    from launcher.ground import Ground
    from launcher.kernels import warm_up

    warm_up(_say(as_json), ["planning"])
    ground = Ground.around(file, file, "--base", base, tolerance_m)
    environment = ground.environment
    ground.check_inside("--agent", agent)
    ground.room("--radius", radius_m, base, "--base")
    from agents.leader import DeploymentPlanner, TooManyCells

    try:
        with busy("Planning ..."):
            planner = DeploymentPlanner(environment, base, radius_m, kind)
    except TooManyCells as problem:
        raise ScenarioFault(f"{file}: {problem}") from problem
    needed = planner.relays_needed(agent)
    if robots is not None and robots < needed:
        raise ScenarioFault(
            f"{file}: the agent at {agent[0]:g},{agent[1]:g} needs {counted(needed, 'robot')}, and --robots says "
            f"{robots}; give at least {needed}, or move the agent"
        )
    chain = planner.plan(agent, (), {f"relay{i + 1}": base for i in range(needed)}, None)
    relays = [placement.position for placement in chain.placements if not placement.spare]
    stations = [base, *relays, agent]
    links = list(pairwise(stations))
    if picture is not None:
        from launcher.picture import draw_plan
        from planning.decomposition import decompose

        title = f"{environment.name or file.stem}: {counted(needed, 'relay')}"
        draw_plan(environment, decompose(environment, kind).polygons, base, [agent], relays, links, picture, title)
    if as_json:
        print_json(
            {
                "map": str(file),
                "base": base,
                "agents": [agent],
                "decomposition": kind,
                "robot_radius_m": radius_m,
                "relays_needed": needed,
                "relays": relays,
                "links": links,
                "cost": chain.cost,
                "spares": None if robots is None else robots - needed,
                "most_relays_needed": planner.most_relays_needed(),
            }
        )
        return
    spares = "" if robots is None else f", {robots - needed} to spare"
    tell(f"{counted(needed, 'relay')}{spares}; virtual cost {chain.cost:.3f}")
    for title, (x, y) in zip(["base", *(f"relay {i + 1}" for i in range(needed)), "agent"], stations, strict=True):
        tell(f"  {title:8}  {x:8.3f}, {y:8.3f}")
    if picture is not None:
        tell(f"Picture: {picture}")


def _check_picture(picture: Path | None) -> None:
    if picture is None:
        return
    if picture.suffix.lower() not in {".png", ".svg", ".pdf"}:
        raise ScenarioFault(f"--picture {picture}: cannot draw '{picture.suffix}'; use .png, .svg or .pdf")
    if not picture.parent.is_dir():
        raise ScenarioFault(f"--picture {picture}: there is no folder {picture.parent}; make it, or choose another")


def _say(as_json: bool) -> Callable[[str], None]:
    """Where to say what is being done: not into JSON."""
    return (lambda text: tell(text, err)) if as_json else tell
