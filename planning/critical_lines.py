"""Inflection rays and bitangents: the lines at which what can be seen changes.

Thesis §3.2.2, with *reflex* corrected to an interior angle above π (the text says below; its Table 1 does not).

Every ray starts at a reflex vertex and runs through free space to the first wall that stops it. A ray that only grazes
a vertex, its two walls strictly on one side, goes on: grazing is seeing. One that meets a wall end on, or runs along a
wall, stops at that wall's vertex. Whatever is nearer to a line than the tolerance lies on it, so that a ray that ends
at a vertex ends *in* it; the ray from there back is then the same segment and counts once.

Coordinates here are the environment's vertices in the arrangement's frame (about unit size); free space is on the left
of the wall from a vertex to its successor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NONE = -1
"""No vertex, no wall."""


@dataclass(frozen=True, slots=True)
class CriticalLines:
    """Segments that divide the free space, as pieces of straight lines through environment vertices.

    Attributes:
        base: (c,) int, the vertex that the line parameter is measured from.
        direction: (c, 2) float, unit vectors.
        reach: (c, 2) float, parameters of the two ends, first below second.
        end_vertex: (c, 2) int, the vertex at each end, or `NONE`.
        end_wall: (c, 2) int, the wall in whose interior each other end lies, named by its first vertex, or `NONE`.
        ray_count: Lr of Table 1, the distinct inflection rays; they come first.
        bitangent_count: number of true bitangents; La of Table 1 is three times this.
    """

    base: Ints
    direction: Floats
    reach: Floats
    end_vertex: Ints
    end_wall: Ints
    ray_count: int
    bitangent_count: int


def find_critical_lines(
    vertices: Floats,
    after: Ints,
    before: Ints,
    reflex: Ints,
    tolerance: float,
    longest_bitangent: float,
    resolution: float,
) -> CriticalLines:
    """Inflection rays and bitangents of an environment.

    Args:
        vertices: (V, 2) float, the environment's vertices.
        after: (V,) int, the next vertex on the same ring.
        before: (V,) int, the previous one.
        reflex: (r,) int, the reflex vertices.
        tolerance: length below which things touch.
        longest_bitangent: pairs farther apart have none: 0 for the inflection decomposition, infinity for the aspect
            decomposition, else the R of the R-aspect decomposition.
        resolution: by how much coordinates may be rounded. Where that turns a short wall so far that its ray passes a
            vertex in line with the wall by more than the tolerance, the ray still meets it.

    Complexity: O(r V) for the rays, O(r² V) at worst for the bitangents of r reflex vertices.
    """
    rays = _find_rays(vertices, after, before, reflex, tolerance, resolution)
    bitangents = _find_bitangents(vertices, after, before, reflex, longest_bitangent, tolerance)
    base, direction, reach, end_vertex, end_wall = (
        np.concatenate(columns) for columns in zip(rays, bitangents, strict=True)
    )
    return CriticalLines(base, direction, reach, end_vertex, end_wall, len(rays[0]), len(bitangents[0]))


Lines = tuple[Ints, Floats, Floats, Ints, Ints]
"""The arrays of `CriticalLines` in its order."""


def _distinct(end_vertex: Ints) -> Ints:
    """Rows of (c, 2) that do not repeat an earlier pair of end vertices, in either order; `NONE` repeats nothing."""
    low, high = end_vertex.min(axis=1), end_vertex.max(axis=1)
    key = np.where(low == NONE, -1 - np.arange(len(low)), low * (int(end_vertex.max(initial=0)) + 1) + high)
    return np.sort(np.unique(key, return_index=True)[1])


@kernel
def _shoot(
    vertices: Floats, after: Ints, before: Ints, start: int, ux: float, uy: float, tolerance: float, tilt: float
) -> tuple[float, int, int, bool]:
    """Where the ray from vertex ``start`` along the unit vector u, known but for a ``tilt``, stops.

    Returns:
        Distance, vertex or `NONE`, wall or `NONE`, and whether a wall at that vertex lies along the ray. O(V).
    """
    ox, oy = vertices[start, 0], vertices[start, 1]
    nearest, vertex, wall, along_wall = np.inf, NONE, NONE, False
    for a in range(len(vertices)):
        b = after[a]
        ax, ay = vertices[a, 0] - ox, vertices[a, 1] - oy
        bx, by = vertices[b, 0] - ox, vertices[b, 1] - oy
        side_a = ux * ay - uy * ax
        side_b = ux * by - uy * bx
        t_a, t_b = ux * ax + uy * ay, ux * bx + uy * by
        a_on, b_on = abs(side_a) <= max(tolerance, tilt * t_a), abs(side_b) <= max(tolerance, tilt * t_b)
        if a_on:
            t = t_a
            if t <= tolerance or t >= nearest:
                continue
            c = before[a]
            cx, cy = vertices[c, 0] - ox, vertices[c, 1] - oy
            side_c = ux * cy - uy * cx
            c_on = abs(side_c) <= max(tolerance, tilt * (ux * cx + uy * cy))
            if b_on or c_on or (side_b > 0.0) != (side_c > 0.0):
                nearest, vertex, wall, along_wall = t, a, NONE, b_on or c_on
        elif not b_on and (side_a > 0.0) != (side_b > 0.0):
            t = t_a + (t_b - t_a) * side_a / (side_a - side_b)
            if tolerance < t < nearest:
                nearest, vertex, wall, along_wall = t, NONE, a, False
    return nearest, vertex, wall, along_wall


def _find_rays(vertices: Floats, after: Ints, before: Ints, reflex: Ints, tolerance: float, resolution: float) -> Lines:
    """Both inflection rays of every reflex vertex, outward along its walls; coincident ones once. O(r V)."""
    base = np.repeat(reflex, 2)
    span = vertices[base] - vertices[np.stack([before[reflex], after[reflex]], axis=1).ravel()]
    length = np.hypot(span[:, 0], span[:, 1])
    direction = span / length[:, None]
    reach = np.zeros((len(base), 2))
    end_vertex, end_wall = np.stack([base, base], axis=1), np.full((len(base), 2), NONE)
    _shoot_rays(vertices, after, before, base, direction, tolerance, resolution / length, reach, end_vertex, end_wall)
    rows = _distinct(end_vertex)
    return base[rows], direction[rows], reach[rows], end_vertex[rows], end_wall[rows]


@kernel
def _shoot_rays(
    vertices: Floats,
    after: Ints,
    before: Ints,
    base: Ints,
    direction: Floats,
    tolerance: float,
    tilt: Floats,
    reach: Floats,
    end_vertex: Ints,
    end_wall: Ints,
) -> None:
    """Write the far end of each ray into the second columns of ``reach``, ``end_vertex`` and ``end_wall``."""
    for k in range(len(base)):
        reach[k, 1], end_vertex[k, 1], end_wall[k, 1], _ = _shoot(
            vertices, after, before, base[k], direction[k, 0], direction[k, 1], tolerance, tilt[k]
        )


def _find_bitangents(
    vertices: Floats, after: Ints, before: Ints, reflex: Ints, longest: float, tolerance: float
) -> Lines:
    """True bitangents, each as one line from wall to wall through its two reflex vertices. O(r² V) at worst.

    A pair is left out when a vertex lies on the open segment between them (its two pairs with that vertex draw the
    same line), and when the line runs into a wall lengthwise (an inflection ray draws it).
    """
    room = 8 * len(reflex)
    while True:
        pairs, reach = np.empty((room, 2), np.int64), np.empty((room, 2))
        end_vertex, end_wall = np.empty((room, 2), np.int64), np.empty((room, 2), np.int64)
        count = _draw_bitangents(
            vertices, after, before, reflex, longest, tolerance, pairs, reach, end_vertex, end_wall
        )
        if count <= room:
            break
        room = count
    base, other = pairs[:count].T
    span = vertices[other] - vertices[base]
    direction = span / np.hypot(span[:, 0], span[:, 1])[:, None]
    return base, direction, reach[:count], end_vertex[:count], end_wall[:count]


@kernel
def _is_tangent(vertices: Floats, after: Ints, before: Ints, v: int, ux: float, uy: float, tolerance: float) -> bool:
    """Whether both walls of vertex v lie strictly on one side of the line through it along the unit vector u."""
    x, y = vertices[v, 0], vertices[v, 1]
    side_b = ux * (vertices[after[v], 1] - y) - uy * (vertices[after[v], 0] - x)
    side_c = ux * (vertices[before[v], 1] - y) - uy * (vertices[before[v], 0] - x)
    return bool((side_b > tolerance and side_c > tolerance) or (side_b < -tolerance and side_c < -tolerance))


@kernel
def _blocks(
    vertices: Floats, after: Ints, a: int, v: int, ux: float, uy: float, length: float, tolerance: float
) -> bool:
    """Whether wall a meets the open segment of ``length`` from vertex v along the unit vector u."""
    b = after[a]
    ax, ay = vertices[a, 0] - vertices[v, 0], vertices[a, 1] - vertices[v, 1]
    bx, by = vertices[b, 0] - vertices[v, 0], vertices[b, 1] - vertices[v, 1]
    side_a, side_b = ux * ay - uy * ax, ux * by - uy * bx
    if abs(side_a) <= tolerance:
        return bool(tolerance < ux * ax + uy * ay < length - tolerance)
    if abs(side_b) <= tolerance or (side_a > 0.0) == (side_b > 0.0):
        return False
    t_a = ux * ax + uy * ay
    t = t_a + (ux * bx + uy * by - t_a) * side_a / (side_a - side_b)
    return bool(tolerance < t < length - tolerance)


@kernel
def _draw_bitangents(
    vertices: Floats,
    after: Ints,
    before: Ints,
    reflex: Ints,
    longest: float,
    tolerance: float,
    pairs: Ints,
    reach: Floats,
    end_vertex: Ints,
    end_wall: Ints,
) -> int:
    """Write down as many bitangents as the (m, 2) arrays have room for; how many there are."""
    count = 0
    last = 0  # the wall that blocked the pair before: it often blocks the next one too
    for i in range(len(reflex)):
        v = reflex[i]
        for j in range(i + 1, len(reflex)):
            w = reflex[j]
            dx, dy = vertices[w, 0] - vertices[v, 0], vertices[w, 1] - vertices[v, 1]
            length = np.hypot(dx, dy)
            if length > longest:
                continue
            ux, uy = dx / length, dy / length
            if not _is_tangent(vertices, after, before, v, ux, uy, tolerance):
                continue
            if not _is_tangent(vertices, after, before, w, ux, uy, tolerance):
                continue
            blocked = _blocks(vertices, after, last, v, ux, uy, length, tolerance)
            for a in range(len(vertices)):
                if blocked:
                    break
                blocked = _blocks(vertices, after, a, v, ux, uy, length, tolerance)
                last = a if blocked else last
            if blocked:
                continue
            back, back_vertex, back_wall, back_along = _shoot(vertices, after, before, v, -ux, -uy, tolerance, 0.0)
            ahead, ahead_vertex, ahead_wall, ahead_along = _shoot(vertices, after, before, w, ux, uy, tolerance, 0.0)
            if back_along or ahead_along:
                continue
            if count < len(pairs):
                pairs[count, 0], pairs[count, 1] = v, w
                reach[count, 0], reach[count, 1] = -back, length + ahead
                end_vertex[count, 0], end_vertex[count, 1] = back_vertex, ahead_vertex
                end_wall[count, 0], end_wall[count, 1] = back_wall, ahead_wall
            count += 1
    return count
