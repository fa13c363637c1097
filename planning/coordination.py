"""The coordination diagram of two robots: where on their paths they would collide, and boxes around that.

Symbols: robot i is at p_i + κ_i v_i on a segment of its path, κ_i in [0, 1], robot j likewise; S is the sum of their
radii. They collide at the points (κ_i, κ_j) of the unit square with |p_i + κ_i v_i − p_j − κ_j v_j| < S (eq. 50), part
of an ellipse, or of a strip where the segments are parallel: a convex region in any case.

The box around that region needs no conic. Some κ_j collides with a given κ_i exactly if the point p_i + κ_i v_i is
nearer than S to the segment of j; so the box spans, in κ_i, what segment i has inside the *stadium* around segment j:
two discs of radius S at its ends and a rectangle between them. The discs are the roots on the edges κ_j = 0 and 1 of
the square, the long sides of the rectangle are the ellipse's own extrema, and the edges κ_i = 0 and 1 are the ends of
segment i. Each is clipped by itself, well conditioned for parallel segments and those of no length too.

Boxes are never too small: S is enlarged by 1e-12 of the figure's size, which is far more than all rounding.

Thesis §4.3.1, algorithm 9, corrected: as printed it forgets corners of the square that lie inside the region, and
misses collisions.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_MARGIN: Final = 1e-12
"""What the separation is enlarged by, relative to the lengths that it is compared with."""


def bound_collisions(segments_i: ArrayLike, segments_j: ArrayLike, separation_m: float) -> Floats:
    """Tight boxes around the collision regions of n pairs of segments.

    Args:
        segments_i: (n, 2, 2) float, metres, map frame: from where to where robot i moves.
        segments_j: the same of robot j; row by row they are the pairs.
        separation_m: S, the sum of the two radii, metres, not negative.

    Returns:
        (n, 4) float: least κ_i, greatest κ_i, least κ_j, greatest κ_j, all in [0, 1]; NaN where nothing collides.

    Complexity: O(n). Thesis algorithm 9 (COLLISIONBOUND), corrected.
    """
    i, j = (_read_points(segments).reshape(-1, 2, 2) for segments in (segments_i, segments_j))
    _check_separation(separation_m)
    if len(i) != len(j):
        raise ValueError(f"collisions of {len(i)} segments with {len(j)}: give as many, row by row they are pairs")
    found: Floats = _bound_pairs(i, j, separation_m)
    return found


def collision_sections(segment_i: ArrayLike, segment_j: ArrayLike, separation_m: float, shares_j: ArrayLike) -> Floats:
    """The collision region itself, row by row: which κ_i collide with each κ_j.

    Args:
        segment_i: (2, 2) float, metres, map frame.
        segment_j: the same.
        separation_m: S, metres, not negative.
        shares_j: (n,) float: values of κ_j in [0, 1].

    Returns:
        (n, 2) float: least and greatest κ_i, NaN where nothing collides. O(n).
    """
    i, j = _read_points(segment_i), _read_points(segment_j)
    places = j[0] + np.asarray(shares_j, dtype=np.float64)[:, None] * (j[1] - j[0])
    still = np.repeat(places[:, None], 2, axis=1)
    return bound_collisions(np.broadcast_to(i, still.shape), still, separation_m)[:, :2]


def collision_boxes(path_i: ArrayLike, path_j: ArrayLike, separation_m: float) -> tuple[Floats, Ints]:
    """All boxes of the coordination diagram of two paths.

    Args:
        path_i: (m, 2) float, metres, map frame, m ≥ 1: robot i goes straight from point to point; a single point is a
            robot that stands.
        path_j: (n, 2), the same.
        separation_m: S, metres, not negative.

    Returns:
        boxes: (b, 4) float, metres of path covered: least and greatest of robot i, then of robot j. Robots that keep
            out of all boxes do not collide. A box of a segment of no length has no width there.
        segments: (b, 2) int: the segments of i and j that each box belongs to, in this order.

    Complexity: O(m n); only pairs of segments that come near each other cost more than a comparison.
    """
    _check_separation(separation_m)
    boxes, segments = _bound_paths(_read_path(path_i), _read_path(path_j), separation_m)
    return boxes, segments


def _check_separation(separation_m: float) -> None:
    if not separation_m >= 0.0:
        raise ValueError(f"the separation of two robots is {separation_m} m: give the sum of their radii")


def _read_points(points: ArrayLike) -> Floats:
    read = np.array(points, dtype=np.float64, order="C").reshape(-1, 2)
    # A box that is missing would be a collision, so nothing may be lost in comparisons with what is no number.
    if not np.isfinite(read).all():
        raise ValueError("a path has a point that is not finite: give metres")
    return read


def _read_path(path: ArrayLike) -> Floats:
    """A single point as a segment of no length, so that every path has segments."""
    points = _read_points(path)
    if len(points) == 0:
        raise ValueError("a path has no points: give at least the place where the robot stands")
    return np.repeat(points, 2, axis=0) if len(points) == 1 else points


@kernel
def _clip_to_disc(dx: float, dy: float, vx: float, vy: float, reach: float) -> tuple[float, float]:
    """The κ at which d + κ v is within ``reach`` of the origin: first and last; none where first > last."""
    length = math.hypot(vx, vy)
    if length == 0.0:
        return (0.0, 1.0) if math.hypot(dx, dy) <= reach else (1.0, 0.0)
    ux, uy = vx / length, vy / length
    aside = dx * uy - dy * ux
    if abs(aside) > reach:
        return 1.0, 0.0
    half = math.sqrt((reach - aside) * (reach + aside))
    before = -(dx * ux + dy * uy)
    return (before - half) / length, (before + half) / length


@kernel
def _clip_to_strip(c: float, s: float, least: float, greatest: float) -> tuple[float, float]:
    """The κ at which c + κ s is from ``least`` to ``greatest``: first and last; none where first > last."""
    if s == 0.0:
        return (0.0, 1.0) if least <= c <= greatest else (1.0, 0.0)
    first, last = (least - c) / s, (greatest - c) / s
    return (first, last) if s > 0.0 else (last, first)


@kernel
def _clip_to_stadium(
    dx: float, dy: float, vx: float, vy: float, wx: float, wy: float, reach: float, margin: float
) -> tuple[float, float]:
    """The κ in [0, 1] at which d + κ v is within ``reach`` of the segment from the origin to w; none: first > last."""
    first, last = _clip_to_disc(dx, dy, vx, vy, reach)
    first, last = max(0.0, first), min(1.0, last)
    start, end = _clip_to_disc(dx - wx, dy - wy, vx, vy, reach)
    start, end = max(0.0, start), min(1.0, end)
    if start <= end:
        first, last = (min(first, start), max(last, end)) if first <= last else (start, end)
    length = math.hypot(wx, wy)
    if length > 0.0:
        ux, uy = wx / length, wy / length
        start, end = _clip_to_strip(dx * uy - dy * ux, vx * uy - vy * ux, -reach, reach)
        from_, to = _clip_to_strip(dx * ux + dy * uy, vx * ux + vy * uy, -margin, length + margin)
        start, end = max(0.0, start, from_), min(1.0, end, to)
        if start <= end:
            first, last = (min(first, start), max(last, end)) if first <= last else (start, end)
    return first, last


@kernel
def _bound(
    pix: float, piy: float, vix: float, viy: float, pjx: float, pjy: float, vjx: float, vjy: float, separation: float
) -> tuple[float, float, float, float]:
    """The box of two segments; its first two numbers are in the wrong order where nothing collides."""
    dx, dy = pix - pjx, piy - pjy
    margin = _MARGIN * (abs(dx) + abs(dy) + abs(vix) + abs(viy) + abs(vjx) + abs(vjy) + separation)
    reach = separation + margin
    first_i, last_i = _clip_to_stadium(dx, dy, vix, viy, vjx, vjy, reach, margin)
    if first_i > last_i:
        return 1.0, 0.0, 1.0, 0.0
    first_j, last_j = _clip_to_stadium(-dx, -dy, vjx, vjy, vix, viy, reach, margin)
    if first_j > last_j:
        return 1.0, 0.0, 1.0, 0.0
    return first_i, last_i, first_j, last_j


@kernel
def _bound_pairs(segments_i: Floats, segments_j: Floats, separation: float) -> Floats:
    boxes = np.full((segments_i.shape[0], 4), np.nan)
    for k in range(boxes.shape[0]):
        px, py, qx, qy = segments_i[k, 0, 0], segments_i[k, 0, 1], segments_j[k, 0, 0], segments_j[k, 0, 1]
        box = _bound(
            px, py, segments_i[k, 1, 0] - px, segments_i[k, 1, 1] - py,
            qx, qy, segments_j[k, 1, 0] - qx, segments_j[k, 1, 1] - qy, separation,
        )  # fmt: skip
        if box[0] <= box[1]:
            boxes[k, 0], boxes[k, 1], boxes[k, 2], boxes[k, 3] = box
    return boxes


@kernel
def _measure(path: Floats) -> Floats:
    """Metres of path up to each of its points: (m,)."""
    covered = np.zeros(path.shape[0])
    for a in range(path.shape[0] - 1):
        covered[a + 1] = covered[a] + math.hypot(path[a + 1, 0] - path[a, 0], path[a + 1, 1] - path[a, 1])
    return covered


@kernel
def _bound_paths(path_i: Floats, path_j: Floats, separation: float) -> tuple[Floats, Ints]:
    m, n = path_i.shape[0] - 1, path_j.shape[0] - 1
    covered_i, covered_j = _measure(path_i), _measure(path_j)
    boxes = np.empty((m * n, 4))
    segments = np.empty((m * n, 2), np.int64)
    found = 0
    # Rounding is left to the exact part: what is passed over here is farther away than that.
    near = separation * (1.0 + 1e-9) + 1e-9
    for a in range(m):
        px, py = path_i[a, 0], path_i[a, 1]
        vx, vy = path_i[a + 1, 0] - px, path_i[a + 1, 1] - py
        left, right = min(px, px + vx) - near, max(px, px + vx) + near
        low, high = min(py, py + vy) - near, max(py, py + vy) + near
        for b in range(n):
            qx, qy, rx, ry = path_j[b, 0], path_j[b, 1], path_j[b + 1, 0], path_j[b + 1, 1]
            if max(qx, rx) < left or min(qx, rx) > right or max(qy, ry) < low or min(qy, ry) > high:
                continue
            box = _bound(px, py, vx, vy, qx, qy, rx - qx, ry - qy, separation)
            if box[0] > box[1]:
                continue
            length_i, length_j = covered_i[a + 1] - covered_i[a], covered_j[b + 1] - covered_j[b]
            boxes[found, 0] = covered_i[a] + box[0] * length_i
            boxes[found, 1] = covered_i[a] + box[1] * length_i
            boxes[found, 2] = covered_j[b] + box[2] * length_j
            boxes[found, 3] = covered_j[b] + box[3] * length_j
            segments[found, 0], segments[found, 1] = a, b
            found += 1
    return boxes[:found].copy(), segments[:found].copy()
