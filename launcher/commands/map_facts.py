"""``map``: what a map is like, what it asks for, and what planning on it costs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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
from launcher.console import busy, check_option, out, plainly, print_json, tell
from launcher.placements import PlacementOptions, place, price
from launcher.scenario import find_map
from launcher.wording import counted

if TYPE_CHECKING:
    from planning.environment import Environment
    from planning.forecast import Forecast

LONGEST_S = 86400.0


def show(
    name: Annotated[
        str | None, typer.Argument(metavar="MAP", help="A map that comes with Sightline, or a map file; none: a list.")
    ] = None,
    decomposition: Decomposition = "inflection",
    max_bitangent_m: MaxBitangent = None,
    radius_m: Radius = 0.2,
    patience_s: Annotated[
        float, typer.Option("--patience", help="Seconds: what would take longer is said, not done.")
    ] = 60.0,
    tolerance_m: Tolerance = None,
    picture: Picture = None,
    as_json: AsJson = False,
) -> None:
    """Say what a map is like, how many robots it asks for, and what that costs; draw it. Without MAP: list the maps."""
    with plainly():
        if name is None:
            _list_maps(as_json)
            return
        check_option("--tolerance", tolerance_m, 0, LARGEST_M, "metres")
        check_option("--radius", radius_m, 0, LARGEST_M, "metres")
        check_option("--patience", patience_s, 0, LONGEST_S, "seconds")
        options = PlacementOptions("cells", radius_m, decomposition, max_bitangent_m)
        options.check()
        _describe(find_map(name, Path()), options, patience_s, tolerance_m, picture, as_json)


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


def _describe(
    file: Path,
    options: PlacementOptions,
    patience_s: float,
    tolerance_m: float | None,
    picture: Path | None,
    as_json: bool,
) -> None:
    from launcher.ground import load_map
    from launcher.kernels import warm_up

    check_picture(picture)
    environment = load_map(file, file, None, tolerance_m)
    say = sayer(as_json)
    warm_up(say, ["planning"])
    from planning.compiled_map import CompiledMap
    from planning.forecast import forecast_cells

    kind = options.decomposition
    forecast = forecast_cells(environment, kind, options.max_bitangent_m)
    facts: dict[str, Any] = {
        **_facts(environment.name or file.stem, environment),
        "file": str(file),
        "source": environment.source,
        "decomposition": kind,
        "forecast": {
            "cells": forecast.cells,
            "decomposition_s": round(forecast.decomposition_s, 3),
            "visibility_s": round(forecast.visibility_s, 3),
            "memory_bytes": round(forecast.memory_bytes),
        },
        "cells": None,
        "counts": None,
    }
    cells = None
    if forecast.decomposition_s <= patience_s:
        with busy("Decomposing ..."):
            cells = CompiledMap(environment, kind, max_bitangent_m=options.max_bitangent_m, announce=say).cells
        facts["cells"] = len(cells)
        facts["counts"] = {key: int(value) for key, value in cells.counts.items()}
    facts["robots"] = {
        "radius_m": options.radius_m,
        "cells": _left_out(forecast, patience_s) or _robots(file, environment, options, say),
        "points": _robots(file, environment, replace(options, kind="points"), say),
    }
    if picture is not None:
        from launcher.picture import draw_map

        number = f"about {forecast.cells}" if cells is None else f"{len(cells)}"
        polygons = None if cells is None else cells.polygons
        draw_map(environment, polygons, picture, f"{facts['name']}: {number} cells ({kind})")
    if as_json:
        print_json(facts)
    else:
        _tell(facts, forecast, picture)


def _left_out(forecast: Forecast, patience_s: float) -> dict[str, Any] | None:
    """Why it is not said what cells ask for; None if it is."""
    from planning.mutual_visibility import MOST_CELLS

    if forecast.cells > MOST_CELLS:
        return {"left_out": f"more than {MOST_CELLS:,} cells"}
    if forecast.seconds > patience_s:
        return {"left_out": f"it would take longer than --patience {patience_s:g}"}
    return None


def _robots(
    file: Path, environment: Environment, options: PlacementOptions, say: Callable[[str], None]
) -> dict[str, Any]:
    """What two placements ask for at most, or why that is not said."""
    from planning.inflation import NothingLeft
    from planning.placement_graph import NoPlacement
    from planning.relays import most_relays

    try:
        with busy("Looking who sees whom ..."):
            graph, _ = place(file, environment, options, None, say)
            most = most_relays(graph.visible)
    except (NothingLeft, NoPlacement) as problem:
        return {"left_out": str(problem)}
    return {"placements": len(graph), "most_relays": most.relays, "parts": most.parts}


def _tell(facts: dict[str, Any], forecast: Forecast, picture: Path | None) -> None:
    x0, y0, x1, y1 = facts["bounds"]
    tell(f"{facts['name']}  ({facts['file']})")
    tell(f"  size       {x1 - x0:.1f} × {y1 - y0:.1f} m, x {x0:g} to {x1:g}, y {y0:g} to {y1:g}")
    tell(f"  free       {facts['area_m2']:.1f} m²")
    tell(
        f"  walls      {facts['vertices']} vertices, {facts['reflex_vertices']} of them reflex, "
        f"{counted(facts['holes'], 'hole')}"
    )
    tell(f"  forecast   {price(forecast)}")
    if facts["counts"] is not None:
        tell(f"  cells      {facts['cells']} ({facts['decomposition']})")
        tell("  counts     " + ", ".join(f"{key} {value}" for key, value in facts["counts"].items()))
    for placements, note in (("cells", ""), ("points", "; other places at most 2 more")):
        robots = facts["robots"][placements]
        text = f"not looked at: {robots.get('left_out')}"
        if "left_out" not in robots:
            text = (
                f"any two of {robots['placements']} {placements} need at most "
                f"{counted(robots['most_relays'], 'relay')}{note}"
            )
            if robots["parts"] > 1:
                text += f"; they fall into {robots['parts']} parts that no chain joins"
        tell(f"  robots     {text}")
    if facts["source"]:
        tell(f"  source     {facts['source']}")
    if picture is not None:
        tell(f"  picture    {picture}")
