"""Shortest paths among walls, exact, by a visibility graph that is computed once (thesis §4.2.1, algorithm 8).

A shortest path bends only at reflex vertices, and only so that it is *tangent* there: it could go straight on without
entering the walls at once. So the graph joins reflex vertices that see each other by segments tangent at both ends,
which leaves a few per cent of algorithm 8's edges, and Dijkstra's algorithm gives the shortest paths between all of
them. A query joins its ends to the vertices that they see by a tangent segment, and takes the best pair.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from planning.environment import Environment
from planning.kernel import kernel
from planning.line_of_sight import free_points_see, point_is_free
from planning.polygon_validation import name_place

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class NotInFreeSpace(ValueError):
    """A point that no path can start or end at; the text is one sentence that names it."""


class GeodesicMap:
    """Shortest paths in an environment, which the caller has inflated by the robot's radius.

    The graph of the r reflex vertices is built at the first query that needs it, in O(r² w + r e log r) for w walls and
    e tangent edges, and takes O(r²) memory. Lengths are exact up to rounding and the environment's tolerance.

    Args:
        environment: the space where the robot's centre may be, walls included.
        corner_paths: :attr:`corner_paths` of another such map of this environment, if they are known.
    """

    def __init__(self, environment: Environment, corner_paths: tuple[Floats, Ints] | None = None) -> None:
        self.environment = environment
        self._corner_paths = corner_paths
        vertices, reflex = environment.vertices, environment.is_reflex
        after = environment.walls[:, 1]
        before = np.empty_like(vertices)
        before[environment.successors] = vertices
        corners = np.stack([before, vertices, after], axis=1)[reflex]
        corners.flags.writeable = False
        self.corners: Floats = corners
        """(r, 3, 2) float, metres: each reflex vertex between its neighbours."""

    def path(self, p: ArrayLike, q: ArrayLike) -> Floats:
        """The shortest path from p to q, each (2,), metres: (m, 2), m ≥ 2, from p over the bends to q.

        Raises:
            NotInFreeSpace: p or q is no point of the environment.

        Complexity: O(t w + r) for t tangent segments at p and q; O(w) where p sees q.
        """
        start, end = self._read_point(p), self._read_point(q)
        _, first, last = self._search(start, end)
        bends = []
        while last >= 0:
            bends.append(self.corners[last, 1])
            last = self._predecessors[first, last] if last != first else -1
        path = [start]
        for point in [*reversed(bends), end]:
            if math.dist(point, path[-1]) > self.environment.tolerance_m:
                path.append(point)
        if len(path) == 1 or math.dist(path[-1], end) > 0.0:
            path[max(1, len(path) - 1) :] = [end]
        return np.array(path)

    def length(self, p: ArrayLike, q: ArrayLike) -> float:
        """Length of the shortest path from p to q, each (2,), metres. Raises and costs as `path`."""
        return self._search(self._read_point(p), self._read_point(q))[0]

    def lengths(self, p: ArrayLike, points: ArrayLike) -> Floats:
        """Lengths of the shortest paths from p (2,) to each of ``points`` (n, 2), metres: (n,) float.

        Raises:
            NotInFreeSpace: p or one of the points is no point of the environment.

        Complexity: O(t r + n (t w + r)); the search from p is shared.
        """
        start = self._read_point(p)
        ends = np.array(points, dtype=np.float64, order="C").reshape(-1, 2)
        self.check_free(ends)
        found: Floats = _find_lengths(start, ends, self.corners, self.corner_lengths, *self._space)
        return found

    def check_free(self, points: Floats) -> None:
        """Raise NotInFreeSpace, naming the first, if any of ``points`` (n, 2), metres, is no point of the environment.

        O(n w).
        """
        free = self.environment.contains(points)
        if not free.all():
            raise self._refuse(points[np.argmin(free)])

    def nearest(self, p: ArrayLike) -> Floats:
        """The point of the environment nearest to p (2,), metres: p itself where it is inside. (2,) float. O(w)."""
        point = np.array(p, dtype=np.float64).reshape(2)
        found: Floats = _find_nearest(point, *self._space)
        return found

    @property
    def _space(self) -> tuple[Floats, float]:
        return self.environment.walls, self.environment.tolerance_m

    @property
    def corner_paths(self) -> tuple[Floats, Ints]:
        """Lengths (metres) and predecessors of the shortest paths between reflex vertices, both (r, r).

        Computed when they are first asked for.
        """
        if self._corner_paths is None:
            edges = _join_corners(self.corners, *self._space)
            distances, predecessors = dijkstra(csr_array(edges), directed=False, return_predecessors=True)
            self._corner_paths = np.ascontiguousarray(distances), np.ascontiguousarray(predecessors)
        return self._corner_paths

    @property
    def corner_lengths(self) -> Floats:
        """(r, r) float, metres: the lengths of :attr:`corner_paths`."""
        return self.corner_paths[0]

    @property
    def _predecessors(self) -> Ints:
        return self.corner_paths[1]

    def _read_point(self, p: ArrayLike) -> Floats:
        point = np.array(p, dtype=np.float64).reshape(2)
        if not point_is_free(point[0], point[1], *self._space):
            raise self._refuse(point)
        return point

    def _refuse(self, point: Floats) -> NotInFreeSpace:
        name = f" of the map {self.environment.name!r}" if self.environment.name else ""
        return NotInFreeSpace(
            f"{name_place(point[0], point[1])} is not in the free space{name}: move it away from the walls"
        )

    def _search(self, start: Floats, end: Floats) -> tuple[float, int, int]:
        """Length of the shortest path, and its first and last bend, −1 for none."""
        if free_points_see(start[0], start[1], end[0], end[1], *self._space):
            return math.dist(start, end), -1, -1
        length, first, last = _find_bends(start, end, self.corners, self.corner_lengths, *self._space)
        if last < 0:
            raise ValueError("the free space of this environment is in several parts: build it with validate=True")
        return float(length), int(first), int(last)


@kernel
def is_tangent(px: float, py: float, corners: Floats, i: int, tolerance: float) -> bool:
    """Whether the segment from p to reflex vertex i could go straight on: its neighbours lie on one side of the line.

    p is known to ± tolerance, so the line beyond the vertex is known the worse the nearer p is; in doubt the answer is
    yes, which costs time and never a path.
    """
    vx, vy = corners[i, 1, 0], corners[i, 1, 1]
    ux, uy = vx - px, vy - py
    left = right = True
    for k in range(0, 3, 2):
        wx, wy = corners[i, k, 0] - vx, corners[i, k, 1] - vy
        side = ux * wy - uy * wx
        doubt = tolerance * (abs(ux) + abs(uy) + abs(wx) + abs(wy))
        left = left and side >= -doubt
        right = right and side <= doubt
    return left or right


@kernel
def _join_corners(corners: Floats, walls: Floats, tolerance: float) -> Floats:
    """Lengths (r, r) of the segments between reflex vertices that are visible and tangent at both ends, else 0."""
    r = corners.shape[0]
    edges = np.zeros((r, r))
    for i in range(r):
        px, py = corners[i, 1, 0], corners[i, 1, 1]
        for j in range(i + 1, r):
            qx, qy = corners[j, 1, 0], corners[j, 1, 1]
            if (
                is_tangent(px, py, corners, j, tolerance)
                and is_tangent(qx, qy, corners, i, tolerance)
                and free_points_see(px, py, qx, qy, walls, tolerance)
            ):
                edges[i, j] = edges[j, i] = math.hypot(qx - px, qy - py)
    return edges


@kernel
def reach_corners(
    start: Floats, corners: Floats, distances: Floats, walls: Floats, tolerance: float
) -> tuple[Floats, NDArray[np.int64]]:
    """Lengths (r,) of the shortest bent paths from a point to all reflex vertices, and the first bend of each."""
    r = corners.shape[0]
    reached = np.full(r, np.inf)
    first = np.full(r, -1, np.int64)
    for i in range(r):
        vx, vy = corners[i, 1, 0], corners[i, 1, 1]
        leg = math.hypot(vx - start[0], vy - start[1])
        # A vertex that is reached no later over another one adds nothing.
        if (
            leg < reached[i]
            and is_tangent(start[0], start[1], corners, i, tolerance)
            and free_points_see(start[0], start[1], vx, vy, walls, tolerance)
        ):
            for j in range(r):
                if leg + distances[i, j] < reached[j]:
                    reached[j] = leg + distances[i, j]
                    first[j] = i
    return reached, first


@kernel
def _finish(end: Floats, reached: Floats, corners: Floats, walls: Floats, tolerance: float) -> tuple[float, int]:
    """Length of the shortest path over reached reflex vertices to a point, and its last bend.

    Vertices are tried in the order of the lengths that they promise: the first that the point sees is the answer.
    """
    promised = np.empty(corners.shape[0])
    for j in range(corners.shape[0]):
        if is_tangent(end[0], end[1], corners, j, tolerance):
            promised[j] = reached[j] + math.hypot(end[0] - corners[j, 1, 0], end[1] - corners[j, 1, 1])
        else:
            promised[j] = np.inf
    while True:
        j = int(np.argmin(promised))
        length = promised[j]
        if length == np.inf:
            return length, -1
        if free_points_see(corners[j, 1, 0], corners[j, 1, 1], end[0], end[1], walls, tolerance):
            return length, j
        promised[j] = np.inf


@kernel
def _find_bends(
    start: Floats, end: Floats, corners: Floats, distances: Floats, walls: Floats, tolerance: float
) -> tuple[float, int, int]:
    reached, first = reach_corners(start, corners, distances, walls, tolerance)
    length, last = _finish(end, reached, corners, walls, tolerance)
    return length, first[last] if last >= 0 else -1, last


@kernel
def _find_lengths(
    start: Floats, ends: Floats, corners: Floats, distances: Floats, walls: Floats, tolerance: float
) -> Floats:
    reached, _ = reach_corners(start, corners, distances, walls, tolerance)
    lengths = np.empty(ends.shape[0])
    for k in range(ends.shape[0]):
        if free_points_see(start[0], start[1], ends[k, 0], ends[k, 1], walls, tolerance):
            lengths[k] = math.hypot(ends[k, 0] - start[0], ends[k, 1] - start[1])
        else:
            lengths[k] = _finish(ends[k], reached, corners, walls, tolerance)[0]
    return lengths


@kernel
def _find_nearest(point: Floats, walls: Floats, tolerance: float) -> Floats:
    nearest = point.copy()
    if point_is_free(point[0], point[1], walls, tolerance):
        return nearest
    best = np.inf
    for i in range(walls.shape[0]):
        wx, wy = walls[i, 1, 0] - walls[i, 0, 0], walls[i, 1, 1] - walls[i, 0, 1]
        t = ((point[0] - walls[i, 0, 0]) * wx + (point[1] - walls[i, 0, 1]) * wy) / (wx * wx + wy * wy)
        t = min(1.0, max(0.0, t))
        x, y = walls[i, 0, 0] + t * wx, walls[i, 0, 1] + t * wy
        distance = math.hypot(x - point[0], y - point[1])
        if distance < best:
            best = distance
            nearest[0], nearest[1] = x, y
    return nearest
