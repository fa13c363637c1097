"""Placements for the commands that plan without a team: made as the options ask, their cost said beforehand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from launcher.scenario import ScenarioFault
from planning.edge_weights import AreaCost, Form, RobotPenalty, virtual_weights

if TYPE_CHECKING:
    from planning.decomposition import Cells
    from planning.environment import Environment
    from planning.forecast import Forecast
    from planning.placement_graph import PlacementGraph
    from protocol.messages import Point

LONG_S = 5.0
"""What takes longer is said before it begins."""


@dataclass(frozen=True)
class Weighting:
    """The virtual weights of cells (thesis §3.3.1); points have their own."""

    form: Form = "normalised"
    distance_weight: float = 1.0
    area_weight: float = 1.0
    area_cost: AreaCost = "negative-exponential"
    robot_penalty: RobotPenalty | None = None


@dataclass(frozen=True)
class PlacementOptions:
    """Where robots may be sent."""

    kind: Literal["cells", "points"]
    radius_m: float
    decomposition: Literal["inflection", "aspect"] = "inflection"
    max_bitangent_m: float | None = None
    spacing_m: float | None = None
    weighting: Weighting = Weighting()

    def check(self) -> None:
        """Raise where an option belongs to the other kind of placements.

        Raises:
            ScenarioFault: one sentence.
        """
        if self.kind == "cells" and self.spacing_m is not None:
            raise ScenarioFault("--spacing is of points: say --placements points, or leave it out")
        if self.kind == "points" and self.weighting != Weighting():
            raise ScenarioFault("the weights of links between points are fixed: say --placements cells to choose them")
        coefficients = (self.weighting.distance_weight, self.weighting.area_weight)
        if self.weighting.form == "normalised" and coefficients != (1.0, 1.0):
            raise ScenarioFault("normalised weights have no coefficients: say --weights combined to choose them")
        if self.max_bitangent_m is not None and self.decomposition != "aspect":
            raise ScenarioFault("--max-bitangent is of aspect cells: say --decomposition aspect, or leave it out")


def place(
    file: Path,
    environment: Environment,
    options: PlacementOptions,
    containing: Point | None,
    announce: Callable[[str], None],
) -> tuple[PlacementGraph, Cells | None]:
    """The placements, and the cells that they stand for; None for points. Compiled before or now (`CompiledMap`).

    Args:
        file: of the map, for faults.
        environment: the map.
        options: checked.
        containing: robots are in the part of the map at this point; None: in the largest.
        announce: is told beforehand of what takes long, and of what cannot be kept for the next time.

    Raises:
        ScenarioFault: more cells than a mutual visibility graph is made for.
        ValueError: another sentence, where robots of this radius have no room.
    """
    from planning.compiled_map import CompiledMap

    compiled = CompiledMap(
        environment, options.decomposition, options.radius_m, options.max_bitangent_m,
        containing=containing, announce=announce,
    )  # fmt: skip
    if options.kind == "points":
        return compiled.point_placements(options.spacing_m), None
    from planning.forecast import forecast_cells
    from planning.mutual_visibility import MOST_CELLS
    from planning.placement_graph import PlacementGraph

    forecast = forecast_cells(environment, options.decomposition, options.max_bitangent_m)
    if forecast.cells > MOST_CELLS:
        raise ScenarioFault(
            f"{file}: about {forecast.cells:,} {options.decomposition} cells would be more than the {MOST_CELLS:,} "
            "that a mutual visibility graph is made for; use --placements points, inflection cells or --max-bitangent"
        )
    if forecast.seconds > LONG_S:
        announce(f"{price(forecast)} ...")
    weighting = options.weighting
    if weighting == Weighting():
        return compiled.cell_placements, compiled.cells
    weights = virtual_weights(
        compiled.cells, compiled.seen, form=weighting.form, distance_weight=weighting.distance_weight,
        area_weight=weighting.area_weight, area_cost=weighting.area_cost, robot_penalty=weighting.robot_penalty,
    )  # fmt: skip
    graph = PlacementGraph.from_cells(
        compiled.cells, compiled.seen, environment, options.radius_m, weights=weights, containing=containing
    )
    return graph, compiled.cells


def price(forecast: Forecast) -> str:
    """What cells will cost, in words."""
    seconds, gibibytes = forecast.seconds, forecast.memory_bytes / 2**30
    time = "less than 1 s"
    if seconds >= 1:
        time = f"about {seconds:.0f} s" if seconds < 120 else f"about {seconds / 60:,.0f} minutes"
    memory = f"{gibibytes:,.1f} GiB" if gibibytes >= 0.1 else "less than 0.1 GiB"
    return f"About {forecast.cells:,} cells; to find which see each other takes {time} and {memory}"
