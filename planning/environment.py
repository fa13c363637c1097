"""A polygonal environment with holes: the free space that robots move in and see through."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import overload

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from planning import line_of_sight
from planning.polygon_file import read_polygon_file, write_polygon_file
from planning.polygon_validation import (
    InvalidEnvironment,
    check_rings,
    clean_ring,
    find_tolerance,
    name_ring,
    orient,
    read_ring,
    signed_area,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Environment:
    """Free space bounded by one outer ring and the rings of its holes (thesis §3.1 and §4.2.1).

    All arrays are in metres in the map frame and cannot be written to. Rings are open (the first point is not repeated)
    and directed so that free space lies to the **left** of every wall: the outer ring counter-clockwise, holes
    clockwise. Points that repeat their predecessor, or lie on the straight line between their neighbours, are removed,
    within `tolerance_m`.

    Free space is the closed set: walls belong to it. Whatever is nearer than `tolerance_m` counts as touching.

    Args:
        outer: (n, 2) points of the outer ring, metres, in either direction, open or closed.
        holes: rings of the same form.
        name: what people call the map.
        source: where it comes from and its licence, kept in saved files.
        validate: False only for rings known to be simple and disjoint; cleaning and orientation are done all the same.

    Raises:
        InvalidEnvironment: a ring is no ring, touches or crosses itself or another, or a hole lies outside the outer
            ring or in another hole; one sentence with ring (holes count from 1), place and remedy.
    """

    outer: Floats
    """(n, 2) float, metres: the outer ring, counter-clockwise."""
    holes: tuple[Floats, ...]
    """Each (m, 2) float, metres: a hole's ring, clockwise."""
    name: str
    source: str
    tolerance_m: float
    """1e-9 of the map's diagonal; more only where coordinates far from the origin are coarser than that."""

    def __init__(
        self,
        outer: ArrayLike,
        holes: Sequence[ArrayLike] = (),
        name: str = "",
        *,
        source: str = "",
        validate: bool = True,
    ) -> None:
        given = [read_ring(points, index) for index, points in enumerate([outer, *holes])]
        tolerance = find_tolerance(given[0])
        rings = []
        for index, points in enumerate(given):
            ring = clean_ring(points, tolerance)
            if len(ring) < 3:
                raise InvalidEnvironment(f"{name_ring(index)} encloses no area: its points lie on one line, delete it")
            rings.append(_freeze(orient(ring, clockwise=index > 0)))
        object.__setattr__(self, "outer", rings[0])
        object.__setattr__(self, "holes", tuple(rings[1:]))
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "source", source)
        object.__setattr__(self, "tolerance_m", tolerance)
        if validate:
            check_rings(self.walls, self.ring_starts, tolerance)

    def __repr__(self) -> str:
        return f"Environment({self.name!r}, {len(self.vertices)} vertices, {len(self.holes)} holes, {self.area:.6g} m²)"

    @property
    def rings(self) -> tuple[Floats, ...]:
        """All rings, the outer one first."""
        return (self.outer, *self.holes)

    @cached_property
    def vertices(self) -> Floats:
        """(V, 2) float: the vertices of all rings, the outer one's first."""
        return _freeze(np.concatenate(self.rings))

    @cached_property
    def ring_starts(self) -> Ints:
        """(R + 1,) int: ring k is ``vertices[ring_starts[k]:ring_starts[k + 1]]``, and its walls likewise."""
        starts = np.cumsum([0, *map(len, self.rings)], dtype=np.int64)
        starts.flags.writeable = False
        return starts

    @cached_property
    def walls(self) -> Floats:
        """(V, 2, 2) float: wall i runs from vertex i to the next of its ring, free space on its left."""
        return _freeze(np.stack([self.vertices, self.vertices[self.successors]], axis=1))

    @cached_property
    def successors(self) -> Ints:
        """(V,) int: the vertex after each vertex in its ring."""
        successors = np.arange(1, len(self.vertices) + 1, dtype=np.int64)
        successors[self.ring_starts[1:] - 1] = self.ring_starts[:-1]
        successors.flags.writeable = False
        return successors

    @cached_property
    def is_reflex(self) -> Bools:
        """(V,) bool: where the interior angle of free space is strictly greater than π (thesis eq. 48)."""
        along = self.walls[:, 1] - self.walls[:, 0]
        onward = along[self.successors]
        reflex = np.empty(len(along), dtype=np.bool_)
        reflex[self.successors] = along[:, 0] * onward[:, 1] - along[:, 1] * onward[:, 0] < 0.0
        reflex.flags.writeable = False
        return reflex

    @cached_property
    def is_convex(self) -> bool:
        """Whether everywhere is in sight of everywhere."""
        return not self.holes and not self.is_reflex.any()

    @cached_property
    def reflex_vertices(self) -> Floats:
        """(r, 2) float: the vertices around which shortest paths bend and behind which robots hide."""
        return _freeze(self.vertices[self.is_reflex])

    @cached_property
    def area(self) -> float:
        """Area of free space in m²."""
        return sum(signed_area(ring) for ring in self.rings)

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """(x_min, y_min, x_max, y_max), metres."""
        (x_min, y_min), (x_max, y_max) = self.outer.min(axis=0), self.outer.max(axis=0)
        return float(x_min), float(y_min), float(x_max), float(y_max)

    @cached_property
    def polygon(self) -> shapely.Polygon:
        """The same as a shapely polygon."""
        return shapely.Polygon(self.outer, self.holes)

    def contains(self, points: ArrayLike) -> Bools:
        """Which of ``points`` (n, 2), metres, lie in free space or on a wall: (n,) bool. O(n w)."""
        free: Bools = line_of_sight.points_are_free(_read_points(points), self.walls, self.tolerance_m)
        return free

    @overload
    def line_of_sight(self, p: tuple[float, float], q: tuple[float, float]) -> bool: ...
    @overload
    def line_of_sight(self, p: ArrayLike, q: ArrayLike) -> bool | Bools: ...
    def line_of_sight(self, p: ArrayLike, q: ArrayLike) -> bool | Bools:
        """Whether the segment from p to q stays in free space: L(x, y) of thesis §3.1.

        Grazing a wall or a vertex is visible, crossing is not; a point outside free space sees nothing.

        Args:
            p: (2,) or (n, 2), metres.
            q: the same; a single point is paired with every point of the other side.

        Returns:
            bool for two single points, else (n,) bool.

        Complexity: O(n w).
        """
        starts, ends = _read_points(p), _read_points(q)
        if len(starts) != len(ends) and 1 not in (len(starts), len(ends)):
            raise ValueError(
                f"line of sight between {len(starts)} points and {len(ends)}: give as many, or a single one"
            )
        n = len(ends) if len(starts) == 1 else len(starts)
        visible: Bools = line_of_sight.segments_are_visible(
            _repeat(starts, n), _repeat(ends, n), self.walls, self.tolerance_m
        )
        return bool(visible[0]) if np.ndim(p) == np.ndim(q) == 1 else visible

    def visibility_matrix(self, points: ArrayLike) -> Bools:
        """Which of ``points`` (n, 2), metres, see each other: (n, n) bool, symmetric, True on the diagonal.

        The matrix A of thesis §3.1. O(n² w).
        """
        seen: Bools = line_of_sight.visible_pairs(_read_points(points), self.walls, self.tolerance_m)
        return seen

    def inflated(self, radius_m: float, containing: ArrayLike | None = None) -> Environment:
        """The environment with its walls grown by ``radius_m``: where the centre of such a disc can be.

        See `planning.inflation` for how corners are rounded.

        Args:
            radius_m: metres, at least 0.
            containing: (2,) metres: of several components of what is left take the one that holds this point, else the
                nearest one that the point sees. None: the largest.

        Raises:
            NothingLeft: the disc fits nowhere, or nowhere in sight of the point.
            ValueError: the radius is negative or not finite.
        """
        from planning.inflation import inflate

        return inflate(self, radius_m, None if containing is None else _read_points(containing)[0])

    @classmethod
    def load(cls, path: str | Path, containing: ArrayLike | None = None) -> Environment:
        """Read a map: polygons in ``.json``, ``.geojson`` or ``.wkt``, or a ROS occupancy grid by its ``.yaml``.

        Coordinates are metres in a local frame, in GeoJSON and WKT too.

        Args:
            path: the file.
            containing: (2,) metres: of several components of free space take the one that holds this point; the largest
                if none does or no point is given.

        Raises:
            UnreadableMap: the file is absent, no map, or not in metres.
            InvalidEnvironment: its rings bound no free space.
            Both are ValueErrors of one sentence with file, place and remedy.
        """
        path = Path(path)
        if path.suffix.lower() in {".yaml", ".yml"}:
            from planning.occupancy_grid import load_occupancy_grid

            return load_occupancy_grid(path, containing)
        found = read_polygon_file(path, None if containing is None else _read_points(containing)[0])
        try:
            return cls(found.outer, found.holes, found.name, source=found.source)
        except InvalidEnvironment as error:
            raise InvalidEnvironment(f"{path}: {error}") from None

    def save(self, path: str | Path) -> None:
        """Write the map as the project's JSON; a reader sees the old file or the new one, never a part.

        Raises:
            OSError: the folder is absent or cannot be written to.
        """
        write_polygon_file(Path(path), self.name, self.outer, self.holes, self.source)


def _freeze(array: Floats) -> Floats:
    array = np.ascontiguousarray(array, dtype=np.float64)
    array.flags.writeable = False
    return array


def _read_points(points: ArrayLike) -> Floats:
    """Points as a fresh (n, 2) array: kernels are compiled for arrays that can be written to only."""
    return np.array(points, dtype=np.float64, order="C").reshape(-1, 2)


def _repeat(points: Floats, n: int) -> Floats:
    return points if len(points) == n else np.ascontiguousarray(np.broadcast_to(points, (n, 2)))
