"""Whether places are where somebody can stand, and get to; every fault is one sentence with a remedy."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import shapely

from launcher.scenario import ScenarioFault
from launcher.wording import text_of
from planning.environment import Environment
from planning.inflation import NothingLeft
from planning.occupancy_grid import load_occupancy_grid
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

    @classmethod
    def around(cls, file: Path, map_file: Path, place: str, point: Point, tolerance_m: float | None = None) -> Ground:
        """The map, or of several parts of it that which holds a point of the file; raise unless the point is inside.

        ``tolerance_m`` as in :func:`load_map`.

        Raises:
            ScenarioFault: the point is in a wall or off the map.
            ValueError: the map cannot be read, one sentence.
        """
        try:
            ground = cls(file, load_map(file, map_file, point, tolerance_m))
        except ValueError:
            # An occupancy grid is a map only around free floor. Whatever else is wrong with the map is said here again.
            ground = cls(file, load_map(file, map_file, None, tolerance_m))
        ground.check_inside(place, point)
        return ground

    def _remedy(self, point: Point, radius_m: float) -> str:
        """Name a place near by that would do."""
        roomy = self.environment.polygon.buffer(-radius_m - 0.05)
        if roomy.is_empty:
            return self._too_small(radius_m) or "no place on this map is wide enough: make the radius smaller"
        near = shapely.get_coordinates(shapely.shortest_line(roomy, shapely.Point(point)))[0]
        return f"move it, for example to [{near[0]:.2f}, {near[1]:.2f}]"

    def _too_small(self, radius_m: float) -> str:
        """A hint if the whole map is smaller than a disc, as it is when its coordinates are no metres."""
        x0, y0, x1, y1 = self.environment.bounds
        if max(x1 - x0, y1 - y0) > 2 * radius_m:
            return ""
        size = f"the whole map is {x1 - x0:.2g} m by {y1 - y0:.2g} m"
        return f"{size}: make the radius smaller or, if the coordinates of the map are degrees, convert them to metres"

    def check_walk(self, key: str, places: dict[str, Point], radius_m: float, origin: Point, origin_place: str) -> None:
        """Raise unless a disc fits at every place and can get there from ``origin``, or from what that sees.

        ``key`` is that of the radius in the file.
        """
        for place, point in places.items():
            self.check_inside(place, point, radius_m)
        free = self.room(key, radius_m, origin, origin_place)
        for place, point in places.items():
            if not free.contains([point])[0]:
                raise ScenarioFault(
                    f"{self.file}: {place} {text_of(point)} cannot be reached from {origin_place} {text_of(origin)} "
                    f"with a radius of {radius_m:g} m; move it, or make {key} smaller"
                )

    def room(self, key: str, radius_m: float, origin: Point, origin_place: str) -> Environment:
        """Where the centre of a disc can be: the part of the free space at ``origin``, or that it sees.

        ``key`` is that of the radius in the file.
        """
        try:
            return self.environment.inflated(radius_m, containing=origin)
        except NothingLeft as problem:
            raise ScenarioFault(
                f"{self.file}: {key} = {radius_m:g} leaves no room at {origin_place} {text_of(origin)}; "
                + (self._too_small(radius_m) or "make it smaller, or move to where there is more room")
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


def load_map(file: Path, map_file: Path, containing: Point | None, tolerance_m: float | None) -> Environment:
    """The map, or the part of it that holds a point.

    Args:
        file: says so: the scenario, or the map itself.
        map_file: polygons or an occupancy grid.
        containing: see :meth:`~planning.environment.Environment.load`.
        tolerance_m: of the outline of an occupancy grid; None: what the grid's reader takes for good.

    Raises:
        ScenarioFault: there is a tolerance, and the map is no grid.
        ValueError: the map cannot be read, one sentence.
    """
    if tolerance_m is None:
        return Environment.load(map_file, containing)
    if map_file.suffix.lower() not in {".yaml", ".yml"}:
        raise ScenarioFault(
            f"{file}: a tolerance of {tolerance_m:g} m is given, and {map_file.name} is no occupancy grid (.yaml); "
            "leave it out"
        )
    return load_occupancy_grid(map_file, containing, tolerance_m)


def named(place: str, points: tuple[Point, ...]) -> dict[str, Point]:
    """Points of a list by their places in the file, e.g. ``agent.goals[2]``."""
    return {f"{place}[{index}]": point for index, point in enumerate(points)}
