"""For how long one who walks independently certainly stays in sight of one who watches.

An independent target has no schedule that could be certified. But it cannot be farther than its speed allows. It leaves
the watcher's sight only through a *window*: a piece of the border of the region in sight that is no wall. Windows lie
on rays from the watcher past corners of walls, from the corner to the next wall. So the target stays in sight for as
long as the shortest way in free space from where it can be to the nearest window takes it.

A shortest way to a window from a set that segments bound is straight, or bends at reflex vertices; each end of it is an
end of a segment, or the foot of a perpendicular on one: elsewhere it could be shortened.

When the watcher moves, its windows sweep over sectors. Those are bounded by the windows that there are when it is at
an end of its way, or on a line through two vertices, where windows appear, vanish or jump; a target that comes into a
sector passes one of them first. So they are enough, and the answer is exact for a watcher that moves too.

Beyond the thesis, whose agent announces its path (§4.3.5 and chapter 5).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from planning.kernel import kernel
from planning.line_of_sight import free_points_see, point_is_free
from planning.motion_plan import read_points
from planning.visible_interval import sees_throughout

if TYPE_CHECKING:
    from planning.environment import Environment

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_SIDES: Final = 32
"""Of the polygon around a disc: it is 0.5 % wider."""


def time_in_sight(
    environment: Environment, watcher: ArrayLike, target: ArrayLike, speed_m_s: float, radius_m: float = 0.0
) -> float:
    """Until when all that an independent target can reach stays in a watcher's sight.

    Args:
        environment: the walls.
        watcher: (2,) or (m, 2) float, metres, map frame: its place, or a way, any place of which it may be at.
        target: (2,) or (n, 2) float, metres: its place, or places whose convex hull it is in. It is in free space: what
            of this lies in walls does not count.
        speed_m_s: the most that the target can go, more than 0.
        radius_m: by which the target may be away from that, metres.

    Returns:
        Seconds from now, inf if it cannot leave; 0 if there is a place where it may be now that is not in sight from
        all places of the watcher.

    Raises:
        ValueError: the speed or the radius is not a number in its range, or a place is missing or not finite.

    Complexity: O(r (m + c) w) for r reflex vertices, w walls and c lines through two vertices that cross the watcher's
        way; and for the way to the windows O(r² w) at worst, of what is nearer than the nearest window.
    """
    if not speed_m_s > 0.0:
        raise ValueError(f"a target's greatest speed is {speed_m_s} m/s: give a number above 0")
    if not 0.0 <= radius_m < np.inf:
        raise ValueError(f"a target is within {radius_m} m of its place: give a number of at least 0")
    way, places = (read_points(points) for points in (watcher, target))
    if min(len(way), len(places)) == 0 or not (np.isfinite(way).all() and np.isfinite(places).all()):
        raise ValueError("a watcher or a target is nowhere, or at a place that is not finite: give metres")
    pieces = np.stack([way[:-1], way[1:]], axis=1) if len(way) > 1 else np.stack([way, way], axis=1)
    borders, witnesses = _bound_target(environment, places, radius_m)
    if len(borders) == 0 or not all(
        sees_throughout(environment, piece, (place, place)) for piece in pieces for place in witnesses
    ):
        return 0.0
    after = environment.successors
    before = np.empty_like(after)
    before[after] = np.arange(len(after))
    reflex = np.flatnonzero(environment.is_reflex)
    walls, tolerance = environment.walls, environment.tolerance_m
    windows = [_find_windows(piece, environment.vertices, before, after, reflex, walls, tolerance) for piece in pieces]
    distance = _measure(borders, np.concatenate(windows), environment.reflex_vertices, walls, tolerance)
    return distance / speed_m_s


def _bound_target(environment: Environment, places: Floats, radius: float) -> tuple[Floats, Floats]:
    """The border of the set where a target can be now, (n, 2, 2), and a place in each of its parts, (p, 2)."""
    turns = (np.arange(_SIDES) + 0.5) * (2.0 * math.pi / _SIDES)
    around = radius / math.cos(math.pi / _SIDES) * np.column_stack([np.cos(turns), np.sin(turns)])
    hull = shapely.MultiPoint((places[:, None] + around).reshape(-1, 2)).convex_hull
    if hull.length == 0.0:
        return np.stack([places[:1], places[:1]], axis=1), places[:1]
    parts = [part for part in shapely.get_parts(hull.intersection(environment.polygon)) if part.length > 0.0]
    rings = [
        np.array(ring.coords)
        for part in parts
        for ring in ((part.exterior, *part.interiors) if isinstance(part, shapely.Polygon) else (part,))
    ]
    borders = [np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings]
    witnesses = [shapely.get_coordinates(part)[0] for part in parts]
    return np.concatenate([np.empty((0, 2, 2)), *borders]), np.array(witnesses).reshape(-1, 2)


@kernel
def _find_windows(
    piece: Floats, vertices: Floats, before: Ints, after: Ints, reflex: Ints, walls: Floats, tolerance: float
) -> Floats:
    """Windows (n, 2, 2) of a watcher at the ends of a straight way (2, 2) and where a line through vertices cuts it."""
    x, y = piece[0]
    ux, uy = piece[1, 0] - x, piece[1, 1] - y
    found = np.empty((64, 2, 2))
    n = 0
    shares = np.empty(vertices.shape[0] + 2)
    for i in reflex:
        ax, ay = vertices[i]
        count = 1 if ux == 0.0 and uy == 0.0 else 2
        shares[0], shares[1] = 0.0, 1.0
        for d in range(vertices.shape[0] if count == 2 else 0):
            dx, dy = vertices[d, 0] - ax, vertices[d, 1] - ay
            slope = dx * uy - dy * ux
            side = dx * (y - ay) - dy * (x - ax)
            if side * slope < 0.0 and abs(side) < abs(slope):
                shares[count] = -side / slope
                count += 1
        for share in shares[:count]:
            px, py = x + share * ux, y + share * uy
            length = math.hypot(ax - px, ay - py)
            if length <= tolerance:
                continue
            vx, vy = (ax - px) / length, (ay - py) / length
            side_before = vx * (vertices[before[i], 1] - ay) - vy * (vertices[before[i], 0] - ax)
            side_after = vx * (vertices[after[i], 1] - ay) - vy * (vertices[after[i], 0] - ax)
            # Between its walls the line would enter the corner, which hides nothing on either side.
            if min(side_before, side_after) < -tolerance and max(side_before, side_after) > tolerance:
                continue
            if not free_points_see(px, py, ax, ay, walls, tolerance):
                continue
            pieces = _follow_ray(ax, ay, vx, vy, walls, tolerance)
            if n + pieces.shape[0] > found.shape[0]:
                longer = np.empty((2 * (n + pieces.shape[0]), 2, 2))
                longer[:n] = found[:n]
                found = longer
            found[n : n + pieces.shape[0]] = pieces
            n += pieces.shape[0]
    return found[:n].copy()


@kernel
def _follow_ray(x: float, y: float, ux: float, uy: float, walls: Floats, tolerance: float) -> Floats:
    """The pieces (n, 2, 2) of a ray from a point in a unit direction, until it leaves free space, that are no walls."""
    end = np.inf
    cuts = np.empty(2 * walls.shape[0] + 2)
    cuts[0] = 0.0
    n = 1
    for k in range(walls.shape[0]):
        ax, ay, bx, by = walls[k, 0, 0] - x, walls[k, 0, 1] - y, walls[k, 1, 0] - x, walls[k, 1, 1] - y
        side_a, side_b = ux * ay - uy * ax, ux * by - uy * bx
        if min(side_a, side_b) < -tolerance and max(side_a, side_b) > tolerance:
            at_a, at_b = ux * ax + uy * ay, ux * bx + uy * by
            at = at_a + side_a / (side_a - side_b) * (at_b - at_a)
            if at > tolerance:
                end = min(end, at)
        for side, at in ((side_a, ux * ax + uy * ay), (side_b, ux * bx + uy * by)):
            if abs(side) <= tolerance and at > 0.0:
                cuts[n] = at
                n += 1
    cuts[n] = end
    ordered = np.sort(cuts[: n + 1])
    pieces = np.empty((n, 2, 2))
    count = 0
    for k in range(n):
        start, stop = ordered[k], min(end, ordered[k + 1])
        if stop - start <= tolerance:
            continue
        if stop == np.inf:
            break
        middle = 0.5 * (start + stop)
        px, py = x + middle * ux, y + middle * uy
        if not point_is_free(px, py, walls, tolerance):
            break
        if _lies_on_wall(px, py, walls, tolerance):
            continue
        pieces[count, 0, 0], pieces[count, 0, 1] = x + start * ux, y + start * uy
        pieces[count, 1, 0], pieces[count, 1, 1] = x + stop * ux, y + stop * uy
        count += 1
    return pieces[:count]


@kernel
def _find_foot(x: float, y: float, segment: Floats) -> tuple[float, float]:
    """The place on a segment (2, 2) that is nearest to a point."""
    ax, ay = segment[0]
    ux, uy = segment[1, 0] - ax, segment[1, 1] - ay
    squared = ux * ux + uy * uy
    share = 0.0 if squared == 0.0 else min(1.0, max(0.0, (ux * (x - ax) + uy * (y - ay)) / squared))
    return ax + share * ux, ay + share * uy


@kernel
def _lies_on_wall(x: float, y: float, walls: Floats, tolerance: float) -> bool:
    for k in range(walls.shape[0]):
        wx, wy = _find_foot(x, y, walls[k])
        if math.hypot(wx - x, wy - y) <= tolerance:
            return True
    return False


@kernel
def _cross(one: Floats, other: Floats) -> bool:
    """Whether two segments (2, 2) cross; what only touches has no distance anyway."""
    sides = np.empty(4)
    for k, (segment, line) in enumerate(((one, other), (other, one))):
        ux, uy = line[1, 0] - line[0, 0], line[1, 1] - line[0, 1]
        for end in range(2):
            sides[2 * k + end] = ux * (segment[end, 1] - line[0, 1]) - uy * (segment[end, 0] - line[0, 0])
    return bool(sides[0] * sides[1] < 0.0 and sides[2] * sides[3] < 0.0)


@kernel
def _measure_straight(borders: Floats, windows: Floats, walls: Floats, tolerance: float) -> float:
    """The shortest straight way, metres, from segments (b, 2, 2) to others (n, 2, 2); inf if walls are in every one."""
    best = np.inf
    for border in borders:
        for window in windows:
            if _cross(border, window):
                return 0.0
            for from_, to in ((border, window), (window, border)):
                for x, y in from_:
                    X, Y = _find_foot(x, y, to)
                    length = math.hypot(X - x, Y - y)
                    if length < best and free_points_see(x, y, X, Y, walls, tolerance):
                        best = length
    return best


@kernel
def _measure(borders: Floats, windows: Floats, bends: Floats, walls: Floats, tolerance: float) -> float:
    """The shortest way, metres, from any of the segments (b, 2, 2) to any window (n, 2, 2) around bends (r, 2)."""
    best = _measure_straight(borders, windows, walls, tolerance)
    # Metres from the borders, and as the crow flies to the windows: no way over a bend is shorter than both together.
    way, rest = np.full(bends.shape[0], np.inf), np.full(bends.shape[0], np.inf)
    for k, (x, y) in enumerate(bends):
        for window in windows:
            X, Y = _find_foot(x, y, window)
            rest[k] = min(rest[k], math.hypot(X - x, Y - y))
        for border in borders:
            X, Y = _find_foot(x, y, border)
            length = math.hypot(X - x, Y - y)
            if length < way[k] and length + rest[k] < best and free_points_see(x, y, X, Y, walls, tolerance):
                way[k] = length
    settled = np.zeros(bends.shape[0], np.bool_)
    while True:
        nearest = -1
        for k in range(bends.shape[0]):
            if not settled[k] and way[k] + rest[k] < best and (nearest < 0 or way[k] < way[nearest]):
                nearest = k
        if nearest < 0:
            return best
        settled[nearest] = True
        x, y = bends[nearest]
        for window in windows:
            X, Y = _find_foot(x, y, window)
            length = way[nearest] + math.hypot(X - x, Y - y)
            if length < best and free_points_see(x, y, X, Y, walls, tolerance):
                best = length
        for k, (X, Y) in enumerate(bends):
            length = way[nearest] + math.hypot(X - x, Y - y)
            if length < way[k] and length + rest[k] < best and free_points_see(x, y, X, Y, walls, tolerance):
                way[k] = length
