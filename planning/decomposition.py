"""Visibility cells: the inflection, aspect and R-aspect decompositions of free space into convex polygons."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from planning.arrangement import Arrangement, arrange
from planning.cell_location import CellIndex
from planning.critical_lines import CriticalLines, find_critical_lines
from planning.environment import Environment
from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Kind: TypeAlias = Literal["inflection", "aspect"]


class DecompositionFailed(ValueError):
    """The cells do not tile the free space; the text is one sentence with map, place and remedy."""


@dataclass(frozen=True, eq=False, repr=False)
class Cells:
    """Visibility cells: convex, disjoint but for their edges, together all of free space (thesis §3.2).

    The cells, their order and their counts do not change when the map is moved or scaled. Made by `decompose`.

    Attributes:
        environment: what was decomposed.
        kind: ``"inflection"`` or ``"aspect"``.
        counts: V, r, Lb, Lr, La, I, N as in the thesis' Table 1: vertices and reflex vertices of the environment;
            segments of walls, inflection rays and bitangents (three each); vertices and cells of the decomposition.
        areas: (N,) float, square metres.
        centroids: (N, 2) float, metres, map frame, each inside its cell.
        adjacency: (N, N) bool, symmetric, False on the diagonal: cells that share an edge or a piece of one.
        starts: (N + 1,) int: cell k has the corners ``starts[k]`` to ``starts[k + 1]``, counter-clockwise.
        corners: (C, 2) float, metres, map frame: the corners of all cells, one cell after the other.
        frame: the unit frame that the geometry was computed in.
        unit_corners: (C, 2) float: ``corners`` in that frame, where slivers are not rounded away far from the origin.
    """

    environment: Environment
    kind: Kind
    counts: dict[str, int]
    areas: Floats
    centroids: Floats
    adjacency: csr_array
    starts: Ints
    corners: Floats
    frame: Frame
    unit_corners: Floats

    def __len__(self) -> int:
        return len(self.areas)

    def __repr__(self) -> str:
        return f"Cells({self.environment.name!r}, {self.kind!r}, {len(self)} cells)"

    @cached_property
    def polygons(self) -> tuple[Floats, ...]:
        """Each cell as (m, 2) float, metres, map frame, counter-clockwise."""
        return tuple(np.split(self.corners, self.starts[1:-1]))

    def locate(self, points: ArrayLike) -> Ints:
        """The cell that holds each of ``points`` (n, 2), metres, map frame: (n,) int, -1 outside free space.

        Cells are closed. A point within the environment's tolerance of several cells belongs to the one it lies
        deepest in, the first of equals; a point on a wall is inside. Expected O(1) a point.
        """
        local = self.frame.enter(np.asarray(points, dtype=np.float64).reshape(-1, 2))
        return self._index.locate(local)

    @cached_property
    def _index(self) -> CellIndex:
        return CellIndex.build(self.unit_corners, self.starts, self.frame.tolerance)


@dataclass(frozen=True, slots=True)
class Frame:
    """The frame of the geometry: the map moved to the origin and scaled to unit size, so that rounding is relative.

    Attributes:
        origin: (2,) float, metres, map frame: the middle of the map's bounding box.
        size_m: the longer side of that box.
        tolerance: the environment's tolerance in units of ``size_m``.
        resolution: how far apart coordinates of the map frame are that can be told apart, in the same unit.
    """

    origin: Floats
    size_m: float
    tolerance: float
    resolution: float

    @classmethod
    def of(cls, environment: Environment) -> Frame:
        """The frame of this environment."""
        x_min, y_min, x_max, y_max = environment.bounds
        size = max(x_max - x_min, y_max - y_min)
        origin = np.array([x_min + 0.5 * (x_max - x_min), y_min + 0.5 * (y_max - y_min)])
        resolution = float(np.spacing(np.abs(environment.bounds).max()))
        return cls(origin, size, environment.tolerance_m / size, resolution / size)

    def enter(self, points: Floats) -> Floats:
        """Points (n, 2) of the map frame, metres, in this frame."""
        return np.ascontiguousarray((points - self.origin) / self.size_m)

    def leave(self, points: Floats) -> Floats:
        """Points (n, 2) of this frame in the map frame, metres."""
        return points * self.size_m + self.origin


def decompose(environment: Environment, kind: Kind = "inflection", max_bitangent_m: float | None = None) -> Cells:
    """Cut free space into visibility cells.

    ``"inflection"``: every reflex vertex sends a ray along each of its two walls, outward, to the first wall hit.
    ``"aspect"``: in addition every bitangent of two reflex vertices that see each other, extended both ways to the
    walls. Adjacent cells are mutually visible (theorem 3.2.1).

    Args:
        environment: the map.
        kind: see above.
        max_bitangent_m: aspect only: leave out bitangents of vertices farther apart, in metres (R-aspect).

    Raises:
        ValueError: an unknown kind, or a ``max_bitangent_m`` that is not positive or comes with ``"inflection"``.
        DecompositionFailed: the cells do not tile the free space, which takes walls that cross (an environment that was
            not validated) or come nearer to each other than its tolerance.

    Complexity: O(r² V + c² + I log I), c the number of rays and bitangents; thesis §3.2.2, §4.1.1 and Table 1.
    """
    if kind not in ("inflection", "aspect"):
        raise ValueError(f'there is no decomposition "{kind}": say "inflection" or "aspect"')
    if max_bitangent_m is not None and not (kind == "aspect" and max_bitangent_m > 0.0):
        raise ValueError(f'max_bitangent_m = {max_bitangent_m} needs the kind "aspect" and a length above 0 m')
    frame = Frame.of(environment)
    vertices = frame.enter(environment.vertices)
    ring_starts = environment.ring_starts
    after = np.arange(1, len(vertices) + 1)
    after[ring_starts[1:] - 1] = ring_starts[:-1]
    before = np.argsort(after)
    reflex = np.flatnonzero(environment.is_reflex)
    longest = 0.0 if kind == "inflection" else math.inf if max_bitangent_m is None else max_bitangent_m / frame.size_m

    lines = find_critical_lines(vertices, after, before, reflex, frame.tolerance, longest, frame.resolution)
    arrangement = arrange(vertices, after, lines, frame.tolerance)
    unit_corners = arrangement.points[arrangement.corners]
    areas, centroids = measure_cells(unit_corners, arrangement.starts)
    areas *= frame.size_m**2
    _check_tiling(environment, frame, unit_corners, arrangement.starts, areas)
    points = frame.leave(arrangement.points)
    points[: len(vertices)] = environment.vertices
    return Cells(
        environment,
        kind,
        _count(environment, lines, arrangement),
        areas,
        frame.leave(centroids),
        _find_adjacency(arrangement),
        arrangement.starts,
        points[arrangement.corners],
        frame,
        unit_corners,
    )


def _count(environment: Environment, lines: CriticalLines, arrangement: Arrangement) -> dict[str, int]:
    v = len(environment.vertices)
    return {
        "V": v,
        "r": len(environment.reflex_vertices),
        "Lb": v,
        "Lr": lines.ray_count,
        "La": 3 * lines.bitangent_count,
        "I": len(arrangement.points),
        "N": len(arrangement.starts) - 1,
    }


def _find_adjacency(arrangement: Arrangement) -> csr_array:
    n = len(arrangement.starts) - 1
    i, j = np.concatenate([arrangement.neighbours, arrangement.neighbours[:, ::-1]]).T
    adjacency = csr_array((np.ones(len(i), np.bool_), (i, j)), shape=(n, n))
    adjacency.sum_duplicates()
    return adjacency


def _check_tiling(environment: Environment, frame: Frame, unit_corners: Floats, starts: Ints, areas: Floats) -> None:
    """Refuse cells that are not a tiling by convex cells: folded or bent ones, gaps, overlaps (another total area)."""
    after = np.arange(1, len(unit_corners) + 1)
    after[starts[1:] - 1] = starts[:-1]
    edge = unit_corners[after] - unit_corners
    following = edge[after]
    length = np.hypot(edge[:, 0], edge[:, 1])
    bend = (edge[:, 0] * following[:, 1] - edge[:, 1] * following[:, 0]) / length
    tiles = (areas > 0.0).all() and abs(areas.sum() - environment.area) <= 1e-9 * environment.area
    if tiles and bend.min() >= -4.0 * frame.tolerance:
        return
    x, y = frame.leave(unit_corners[after[bend.argmin()]])
    raise DecompositionFailed(
        f"{environment.name or 'the map'}: its cells do not tile its free space, probably near ({x:.3f}, {y:.3f}) m: "
        f"where walls cross or come closer than {environment.tolerance_m:.1e} m, move them apart or simplify the map"
    )


@kernel
def measure_cells(corners: Floats, starts: Ints) -> tuple[Floats, Floats]:
    """Areas (N,) and centroids (N, 2) of convex polygons given one after the other. O(C).

    The centroid is the mean of a fan of triangles weighted by areas that are never negative, so it does not leave a
    sliver, whatever the rounding.
    """
    n = len(starts) - 1
    areas, centroids = np.zeros(n), np.zeros((n, 2))
    for k in range(n):
        first, end = starts[k], starts[k + 1]
        x, y = corners[first, 0], corners[first, 1]
        weight, mx, my = 0.0, 0.0, 0.0
        for c in range(first + 1, end - 1):
            ax, ay = corners[c, 0] - x, corners[c, 1] - y
            bx, by = corners[c + 1, 0] - x, corners[c + 1, 1] - y
            area = 0.5 * (ax * by - ay * bx)
            areas[k] += area
            weight += max(area, 0.0)
            mx += max(area, 0.0) * (ax + bx) / 3.0
            my += max(area, 0.0) * (ay + by) / 3.0
        if weight > 0.0:
            centroids[k, 0], centroids[k, 1] = x + mx / weight, y + my / weight
        else:
            centroids[k, 0], centroids[k, 1] = x, y
    return areas, centroids
