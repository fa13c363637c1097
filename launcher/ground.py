"""Whether places are where somebody can stand, and get to; every fault is one sentence with a remedy."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import shapely

from launcher.scenario import ScenarioFault
from planning.environment import Environment
from planning.inflation import NothingLeft
from protocol.messages import Point


class Ground:
    """The map on which the places of ``file`` are."""

    def __init__(self, file: Path, environment: Environment) -> None:
        self.file = file
        self.environment = environment

    def check_inside(self, place: str, point: Point, radius_m: float = 0.0) -> None:
        """Raise unless a disc at this place is inside the free space."""
        inside = bool(self.environment.contains([point])[0])
        clearance = shapely.distance(self.environment.polygon.boundary, shapely.Point(point))
        if inside and clearance >= radius_m:
            return
        what = f"{clearance:.2f} m from a wall, nearer than its radius of {radius_m:g} m"
        if not inside:
            x0, y0, x1, y1 = self.environment.bounds
            what = f"inside a wall or off the map (x {x0:g} to {x1:g}, y {y0:g} to {y1:g})"
        raise ScenarioFault(f"{self.file}: {place} {text_of(point)} is {what}; {self._remedy(point, radius_m)}")

    def _remedy(self, point: Point, radius_m: float) -> str:
        """Name a place near by that would do."""
        roomy = self.environment.polygon.buffer(-radius_m - 0.05)
        if roomy.is_empty:
            return "no place on this map is wide enough: make the radius smaller"
        near = shapely.get_coordinates(shapely.shortest_line(roomy, shapely.Point(point)))[0]
        return f"move it, for example to [{near[0]:.2f}, {near[1]:.2f}]"

    def check_walk(self, who: str, places: dict[str, Point], radius_m: float, origin: Point, origin_place: str) -> None:
        """Raise unless a disc fits at every place and can get there from ``origin``, or from what that sees."""
        for place, point in places.items():
            self.check_inside(place, point, radius_m)
        free = self.room(who, radius_m, origin, origin_place)
        for place, point in places.items():
            if not free.contains([point])[0]:
                raise ScenarioFault(
                    f"{self.file}: {place} {text_of(point)} cannot be reached from {origin_place} {text_of(origin)} "
                    f"with a radius of {radius_m:g} m; move it, or make {who}.radius_m smaller"
                )

    def room(self, who: str, radius_m: float, origin: Point, origin_place: str) -> Environment:
        """Where the centre of a disc can be: the part of the free space at ``origin``, or that it sees."""
        try:
            return self.environment.inflated(radius_m, containing=origin)
        except NothingLeft as problem:
            raise ScenarioFault(
                f"{self.file}: {who}.radius_m = {radius_m:g} leaves no room at {origin_place} {text_of(origin)}; "
                "make it smaller, or move to where there is more room"
            ) from problem

    def check_apart(self, discs: Sequence[tuple[str, Point, float]]) -> None:
        """Raise where two discs (place, centre, radius in metres) overlap. O(n²)."""
        for index, (place, point, radius_m) in enumerate(discs):
            for other, taken, other_radius_m in discs[:index]:
                if math.dist(point, taken) < radius_m + other_radius_m:
                    raise ScenarioFault(
                        f"{self.file}: {place} {text_of(point)} overlaps {other} {text_of(taken)}; "
                        f"keep them {radius_m + other_radius_m:g} m apart"
                    )


def named(place: str, points: tuple[Point, ...]) -> dict[str, Point]:
    """Points of a list by their places in the file, e.g. ``agent.goals[2]``."""
    return {f"{place}[{index}]": point for index, point in enumerate(points)}


def text_of(point: Point) -> str:
    """A point as the file has it."""
    return f"[{point[0]:g}, {point[1]:g}]"
