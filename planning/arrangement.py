"""The planar subdivision of free space by walls and critical lines: its vertices, edges and bounded free faces.

Thesis §3.2.3 finds the faces by a sweep; here every point is found once, named, and the faces are walked.

1. *Incidence before intersection.* Which environment vertices lie on which line, and on which wall each line ends, is
   decided first, within the tolerance. Two lines that share an environment vertex meet there and nowhere else, so
   the many lines through one reflex vertex meet in that vertex and not in a cloud of rounded points.
2. All other crossings are computed, and points nearer than the tolerance become one: three lines through a point.
3. The points on a line, in order, cut it into edges; an edge that lies on two lines is one edge.
4. Every edge has two directed sides. With the sides sorted by angle around each vertex, the successor of a side in
   the face on its left is the one clockwise of its opposite.
5. The right side of a wall is an obstacle. A face with no such side is free. There is no other test, so a face is
   never classified by a point that rounding has put outside it.

The graph is connected (the extreme vertex of any group of holes sends a ray out of their hull), so every free face is
bounded by one cycle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.critical_lines import NONE, CriticalLines
from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_SWEEP = np.array([0.8090173, 0.5877849])
"""Direction in which points are sorted to find near ones: oblique, so that maps drawn on a grid have no ties."""


@dataclass(frozen=True, slots=True)
class Arrangement:
    """Vertices and free faces.

    Attributes:
        points: (I, 2) float, all distinct vertices; those of the environment come first, in its order.
        corners: (C,) int, vertices of the free faces, each counter-clockwise, one face after the other.
        starts: (N + 1,) int, where each face starts in ``corners``.
        neighbours: (M, 2) int, pairs of free faces that share an edge, once for each edge.
    """

    points: Floats
    corners: Ints
    starts: Ints
    neighbours: Ints


def arrange(vertices: Floats, after: Ints, lines: CriticalLines, tolerance: float) -> Arrangement:
    """Subdivide the free space.

    Args:
        vertices: (V, 2) float, the environment's vertices; each starts a wall with free space on its left.
        after: (V,) int, the next vertex on the same ring.
        lines: what divides the free space.
        tolerance: length below which two points are one.

    Complexity: O(c² + c V + I log I) for c lines and I vertices.
    """
    points, on_segment = _place_points(vertices, after, lines, tolerance)
    merged = _merge(points, np.argsort(points @ _SWEEP, kind="stable"), tolerance)
    kept = np.flatnonzero(merged == np.arange(len(points)))
    name = np.empty(len(points), np.int64)
    name[kept] = np.arange(len(kept))
    points = points[kept]
    segment, parameter, point = on_segment
    point = name[merged[point]]

    order = np.lexsort((parameter, segment))
    segment, point = segment[order], point[order]
    joined = (segment[1:] == segment[:-1]) & (point[1:] != point[:-1])
    tail, head, segment = point[:-1][joined], point[1:][joined], segment[1:][joined]
    # The walls come first, so of equal edges the one kept is a wall's, and its direction tells where it is free.
    key = np.minimum(tail, head) * len(points) + np.maximum(tail, head)
    first = np.unique(key, return_index=True)[1]
    tail, head, segment = tail[first], head[first], segment[first]

    side_tail = np.stack([tail, head], axis=1).ravel()
    side_head = np.stack([head, tail], axis=1).ravel()
    obstacle = np.zeros(len(side_tail), np.bool_)
    obstacle[1::2] = segment < len(vertices)
    span = points[side_head] - points[side_tail]
    around = np.lexsort((np.arctan2(span[:, 1], span[:, 0]), side_tail))
    block = np.searchsorted(side_tail[around], np.arange(len(points) + 1))
    face, corners, starts = _walk_faces(side_tail, obstacle, around, block)
    pairs = face.reshape(-1, 2)
    return Arrangement(points, corners, starts, pairs[(pairs >= 0).all(axis=1)])


def _place_points(
    vertices: Floats, after: Ints, lines: CriticalLines, tolerance: float
) -> tuple[Floats, tuple[Ints, Floats, Ints]]:
    """All points, not yet merged, and which lies where on which segment.

    Returns:
        points (n, 2): vertices, line ends in walls, crossings; and three (m,) arrays: segment (walls first, then
        lines), parameter along it, and point.
    """
    walls = np.arange(len(vertices))
    span = vertices[after] - vertices
    length = np.hypot(span[:, 0], span[:, 1])
    wall_direction = span / length[:, None]

    origin = vertices[lines.base]
    line, end = np.nonzero(lines.end_wall != NONE)
    host = lines.end_wall[line, end]
    t = lines.reach[line, end]
    ends = origin[line] + t[:, None] * lines.direction[line]
    end_name = len(vertices) + np.arange(len(ends))
    t_host = ((ends - vertices[host]) * wall_direction[host]).sum(axis=1)

    touching = _find_incidences(vertices, origin, lines.direction, lines.reach, tolerance)
    ended, side = np.nonzero(lines.end_vertex != NONE)
    touching[ended, lines.end_vertex[ended, side]] = True  # a short wall's ray may miss it by more than the tolerance
    on_line, vertex = np.nonzero(touching)
    t_vertex = ((vertices[vertex] - origin[on_line]) * lines.direction[on_line]).sum(axis=1)

    first, second, t_first, t_second = _find_crossings(origin, lines.direction, lines.reach, touching, tolerance)
    crossings = origin[first] + t_first[:, None] * lines.direction[first]
    cross_name = len(vertices) + len(ends) + np.arange(len(crossings))

    w = len(vertices)
    segment = np.concatenate([walls, walls, host, line + w, on_line + w, first + w, second + w])
    parameter = np.concatenate([np.zeros(w), length, t_host, t, t_vertex, t_first, t_second])
    point = np.concatenate([walls, after, end_name, end_name, vertex, cross_name, cross_name])
    return np.concatenate([vertices, ends, crossings]), (segment, parameter, point)


@kernel
def _find_incidences(
    vertices: Floats, origin: Floats, direction: Floats, reach: Floats, tolerance: float
) -> NDArray[np.bool_]:
    """Which vertices lie on which lines, both ends included: (c, V) bool. O(c V)."""
    touching = np.zeros((len(origin), len(vertices)), np.bool_)
    for k in range(len(origin)):
        ux, uy = direction[k, 0], direction[k, 1]
        for v in range(len(vertices)):
            dx, dy = vertices[v, 0] - origin[k, 0], vertices[v, 1] - origin[k, 1]
            if abs(ux * dy - uy * dx) <= tolerance:
                t = ux * dx + uy * dy
                touching[k, v] = reach[k, 0] - tolerance <= t <= reach[k, 1] + tolerance
    return touching


def _find_crossings(
    origin: Floats, direction: Floats, reach: Floats, touching: NDArray[np.bool_], tolerance: float
) -> tuple[Ints, Ints, Floats, Floats]:
    """Where lines meet that share no environment vertex: both lines, both parameters, each (x,). O(c²)."""
    room = 32 * len(origin)
    while True:
        lines, parameters = np.empty((room, 2), np.int64), np.empty((room, 2))
        count = _cross_lines(origin, direction, reach, touching, tolerance, lines, parameters)
        if count <= room:
            return lines[:count, 0], lines[:count, 1], parameters[:count, 0], parameters[:count, 1]
        room = count


@kernel
def _cross_lines(
    origin: Floats,
    direction: Floats,
    reach: Floats,
    touching: NDArray[np.bool_],
    tolerance: float,
    lines: Ints,
    parameters: Floats,
) -> int:
    """Write down as many crossings as ``lines`` and ``parameters`` (m, 2) have room for; how many there are."""
    shared = np.empty(touching.shape[1], np.int64)
    count = 0
    for i in range(len(origin)):
        on_line = 0
        for v in range(touching.shape[1]):
            if touching[i, v]:
                shared[on_line] = v
                on_line += 1
        ux, uy = direction[i, 0], direction[i, 1]
        for j in range(i + 1, len(origin)):
            vx, vy = direction[j, 0], direction[j, 1]
            sine = ux * vy - uy * vx
            if abs(sine) < 1e-14:
                continue
            dx, dy = origin[j, 0] - origin[i, 0], origin[j, 1] - origin[i, 1]
            s = (dx * vy - dy * vx) / sine
            if s < reach[i, 0] - tolerance or s > reach[i, 1] + tolerance:
                continue
            t = (dx * uy - dy * ux) / sine
            if t < reach[j, 0] - tolerance or t > reach[j, 1] + tolerance:
                continue
            meet = False
            for k in range(on_line):
                meet = meet or touching[j, shared[k]]
            if meet:
                continue
            if count < len(lines):
                lines[count, 0], lines[count, 1] = i, j
                parameters[count, 0], parameters[count, 1] = s, t
            count += 1
    return count


@kernel
def _merge(points: Floats, order: Ints, tolerance: float) -> Ints:
    """For each point the first of those within ``tolerance`` of it, directly or through others: (n,) int.

    ``order`` sorts the points along `_SWEEP`. O(n) when few points are equally far along it.
    """
    parent = np.arange(len(points))
    for k in range(len(order)):
        a = order[k]
        along = points[a, 0] * _SWEEP[0] + points[a, 1] * _SWEEP[1]
        for m in range(k + 1, len(order)):
            b = order[m]
            if points[b, 0] * _SWEEP[0] + points[b, 1] * _SWEEP[1] - along > tolerance:
                break
            if np.hypot(points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]) <= tolerance:
                root_a, root_b = a, b
                while parent[root_a] != root_a:
                    root_a = parent[root_a]
                while parent[root_b] != root_b:
                    root_b = parent[root_b]
                parent[max(root_a, root_b)] = min(root_a, root_b)
    for a in range(len(points)):
        parent[a] = parent[parent[a]]  # the parent comes before its child, so it has its root already
    return parent


@kernel
def _walk_faces(tail: Ints, obstacle: NDArray[np.bool_], around: Ints, block: Ints) -> tuple[Ints, Ints, Ints]:
    """Walk round every face.

    Args:
        tail: (2 E,) int, vertex at which each directed side starts; sides 2 e and 2 e + 1 are opposite.
        obstacle: (2 E,) bool, sides with an obstacle on their left.
        around: (2 E,) int, sides sorted by vertex, counter-clockwise round each.
        block: (I + 1,) int, where each vertex starts in ``around``.

    Returns:
        The free face on the left of each side, or `NONE`; vertices of all free faces; where each face starts.
    """
    follower = np.empty(len(around), np.int64)
    for p in range(len(around)):
        at = tail[around[p]]
        follower[around[p] ^ 1] = around[p - 1] if p > block[at] else around[block[at + 1] - 1]
    walked = np.zeros(len(tail), np.bool_)
    face = np.full(len(tail), NONE)
    corners = np.empty(len(tail), np.int64)
    starts = np.zeros(len(tail) + 1, np.int64)
    faces = 0
    for first in range(len(tail)):
        if walked[first]:
            continue
        n = starts[faces]
        free = True
        side = first
        while not walked[side]:
            walked[side] = True
            free = free and not obstacle[side]
            corners[n] = tail[side]
            n += 1
            side = follower[side]
        if not free:
            continue
        while face[side] == NONE:
            face[side] = faces
            side = follower[side]
        faces += 1
        starts[faces] = n
    return face, corners[: starts[faces]].copy(), starts[: faces + 1].copy()
