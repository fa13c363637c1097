"""Kernels on a union of convex polygons: cut by an annulus, keep the number of pieces bounded, and measure.

Pieces are (m, MOST_VERTICES, 2) float with the numbers of their vertices (m,) int; see `estimation.convex_polygon`.
They hardly overlap; `estimation.convex_growth`, which makes them overlap, also parts them.

An annulus is not convex. Its outer disc is left by tangents. For the inner one the piece is split by rays from the
anchor into wedges, and each wedge loses what lies before the chord between its rays: that much is inside the disc for
sure, and what is left of the disc is thinner than the tolerance.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from estimation import convex_polygon
from estimation.convex_polygon import area, clip, depth, distances, hull, simplify
from estimation.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_VERTICES = 16
"""Of one piece."""

MOST_PIECES = 128
"""Of one set."""

SCRATCH = 4 * MOST_VERTICES
"""Rows enough for a piece while it is worked on."""

MOST_TANGENTS = 12
"""On one piece."""


@kernel
def _crossings(P: Floats, n: int, ax: float, ay: float, r: float, facing: float, span: Floats) -> bool:
    """Widen span (2,) by the angles, from a direction, at which the boundary crosses a circle; whether it does."""
    found = False
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        px, py = P[i, 0] - ax, P[i, 1] - ay
        ex, ey = P[j, 0] - P[i, 0], P[j, 1] - P[i, 1]
        a = ex * ex + ey * ey
        half = px * ex + py * ey
        c = px * px + py * py - r * r
        square = half * half - a * c
        if a == 0.0 or square <= 0.0:
            continue
        # Roots of at² + 2·half·t + c in the form that does not cancel.
        q = -(half + math.copysign(math.sqrt(square), half))
        for t in (q / a, c / q if q != 0.0 else -1.0):
            if 0.0 <= t <= 1.0:
                found = True
                _widen(span, px + t * ex, py + t * ey, facing)
    return found


@kernel
def _widen(span: Floats, x: float, y: float, facing: float) -> None:
    """Make a span of angles relative to a direction hold that of (x, y)."""
    angle = (math.atan2(y, x) - facing + math.pi) % (2.0 * math.pi) - math.pi
    span[0], span[1] = min(span[0], angle), max(span[1], angle)


@kernel
def _leave_disc(P: Floats, n: int, ax: float, ay: float, r: float, tolerance: float, other: Floats) -> int:
    """Cut a piece by tangents of the disc that it partly leaves, in place; other is scratch."""
    _, farthest, inside = distances(P, n, ax, ay)
    if farthest <= r:
        return n
    span = np.array([np.inf, -np.inf])
    mx, my = 0.0, 0.0
    for i in range(n):
        mx += (P[i, 0] - ax) / n
        my += (P[i, 1] - ay) / n
    facing = math.atan2(my, mx)
    crosses = _crossings(P, n, ax, ay, r, facing, span)
    if inside or not crosses:
        span[0], span[1] = -math.pi, math.pi
    step = 2.0 * math.acos(1.0 / (1.0 + tolerance / r)) if r > 0.0 else math.pi
    tangents = min(MOST_TANGENTS, max(1, math.ceil((span[1] - span[0]) / step)))
    if inside or not crosses:
        tangents = MOST_TANGENTS
    for i in range(tangents):
        angle = facing + span[0] + (i + 0.5) * (span[1] - span[0]) / tangents
        nx, ny = math.cos(angle), math.sin(angle)
        n = clip(P, n, nx, ny, nx * ax + ny * ay + r, other)
        P[:n] = other[:n]
        if n == 0:
            break
    return n


@kernel
def cut(
    pieces: Floats, counts: Ints, ax: float, ay: float, r0: float, r1: float, tolerance: float, out: Floats, kept: Ints
) -> tuple[int, bool]:
    """Write an outer bound of what an annulus leaves of a set into out (MOST_PIECES, …) and kept (MOST_PIECES,).

    Args:
        pieces: the set.
        counts: its vertices.
        ax: anchor, metres, frame of the set.
        ay: the same.
        r0: inner radius, metres.
        r1: outer radius, metres; may be inf.
        tolerance: how far the straight cuts may stay from the circles, metres; more where pieces run out.
        out: receives the pieces.
        kept: receives their numbers of vertices.

    Returns:
        The number of pieces, and whether anything was cut.
    """
    m, changed = 0, False
    P, Q, other = np.empty((SCRATCH, 2)), np.empty((SCRATCH, 2)), np.empty((SCRATCH, 2))
    for piece in range(len(counts)):
        n = counts[piece]
        nearest, farthest, inside = distances(pieces[piece], n, ax, ay)
        if nearest > r1 or farthest < r0:
            changed = True
            continue
        if nearest >= r0 and farthest <= r1:
            out[m, :n] = pieces[piece, :n]
            kept[m] = n
            m += 1
            continue
        changed = True
        P[:n] = pieces[piece, :n]
        # Every piece that follows must have a place.
        room = MOST_PIECES - m - (len(counts) - piece - 1)
        wedges, first, step, facing = 1, 0.0, 0.0, 0.0
        if nearest < r0:
            widest = 2.0 * math.acos(max(0.0, 1.0 - tolerance / r0))
            if inside:
                wedges = max(3, math.ceil(2.0 * math.pi / widest))
                wedges = min(wedges, room) if room >= 3 else 0
                step = 2.0 * math.pi / max(wedges, 1)
            else:
                span = np.array([np.inf, -np.inf])
                mx, my = 0.0, 0.0
                for i in range(n):
                    mx += (P[i, 0] - ax) / n
                    my += (P[i, 1] - ay) / n
                facing = math.atan2(my, mx)
                _crossings(P, n, ax, ay, r0, facing, span)
                for i in range(n):
                    if (P[i, 0] - ax) ** 2 + (P[i, 1] - ay) ** 2 < r0 * r0:
                        _widen(span, P[i, 0] - ax, P[i, 1] - ay, facing)
                # A disc that just touches may come out with no crossing: then it cuts nothing off.
                wedges = min(max(1, math.ceil((span[1] - span[0]) / widest)), room) if span[1] > span[0] else 0
                first = facing + span[0]
                step = (span[1] - span[0]) / max(wedges, 1)
        for wedge in range(max(wedges, 1)):
            k = n
            Q[:k] = P[:k]
            if nearest < r0 and wedges > 0:
                low, high = first + wedge * step, first + (wedge + 1) * step
                if inside or wedge > 0:
                    nx, ny = math.sin(low), -math.cos(low)
                    k = clip(Q, k, nx, ny, nx * ax + ny * ay, other)
                    Q[:k] = other[:k]
                if k and (inside or wedge < wedges - 1):
                    nx, ny = -math.sin(high), math.cos(high)
                    k = clip(Q, k, nx, ny, nx * ax + ny * ay, other)
                    Q[:k] = other[:k]
                if k:
                    nx, ny = -math.cos(0.5 * (low + high)), -math.sin(0.5 * (low + high))
                    k = clip(Q, k, nx, ny, nx * ax + ny * ay - r0 * math.cos(0.5 * step), other)
                    Q[:k] = other[:k]
            if k:
                k = _leave_disc(Q, k, ax, ay, r1, tolerance, other)
            if k:
                k = simplify(Q, k, MOST_VERTICES)
            if k:
                out[m, :k] = Q[:k]
                kept[m] = k
                m += 1
    return m, changed


@kernel
def ring(ax: float, ay: float, r0: float, r1: float, tolerance: float, out: Floats, kept: Ints) -> int:
    """Write a ring of pieces around an annulus into out and kept; their number."""
    square = np.empty((1, MOST_VERTICES, 2))
    for i in range(4):
        square[0, i, 0] = ax + (2.0 * r1 if i in (0, 3) else -2.0 * r1)
        square[0, i, 1] = ay + (2.0 * r1 if i < 2 else -2.0 * r1)
    m, _ = cut(square, np.array([4]), ax, ay, r0, r1, tolerance, out, kept)
    return m


@kernel
def merge(pieces: Floats, counts: Ints, m: int, share: float, most: int) -> int:
    """Merge neighbours in the list whose hull adds less than a share of their area, in place; the number of pieces.

    While there are more than most, the share is doubled. Pieces of one annulus are listed around it, so neighbours in
    the list are neighbours in the plane wherever it matters.
    """
    joint = np.empty((2 * SCRATCH, 2))
    while True:
        i = 0
        for j in range(1, m):
            n = hull(pieces[i], counts[i], pieces[j], counts[j], joint)
            limit = (1.0 + share) * (area(pieces[i], counts[i]) + area(pieces[j], counts[j]))
            fits = area(joint, n) <= limit
            if fits:
                n = simplify(joint, n, MOST_VERTICES)
            if fits and area(joint, n) <= limit:
                pieces[i, :n] = joint[:n]
                counts[i] = n
                continue
            i += 1
            if i != j:
                pieces[i, : counts[j]] = pieces[j, : counts[j]]
                counts[i] = counts[j]
        m = min(m, i + 1)
        if m <= most:
            return m
        share *= 2.0


@kernel
def moments(pieces: Floats, counts: Ints) -> Floats:
    """Sums over the pieces of ∫ of 1, x, y, x², xy, y² (6,), about the frame's origin."""
    total = np.zeros(6)
    for piece in range(len(counts)):
        for i in range(2, counts[piece]):
            ax, ay = pieces[piece, 0]
            bx, by = pieces[piece, i - 1]
            cx, cy = pieces[piece, i]
            own = 0.5 * ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))
            sx, sy = ax + bx + cx, ay + by + cy
            total[0] += own
            total[1] += own * sx / 3.0
            total[2] += own * sy / 3.0
            total[3] += own * (sx * sx + ax * ax + bx * bx + cx * cx) / 12.0
            total[4] += own * (sx * sy + ax * ay + bx * by + cx * cy) / 12.0
            total[5] += own * (sy * sy + ay * ay + by * by + cy * cy) / 12.0
    return total


@kernel
def total_area(pieces: Floats, counts: Ints) -> float:
    """Sum of the areas, m²."""
    total = 0.0
    for i in range(len(counts)):
        total += area(pieces[i], counts[i])
    return total


@kernel
def contains(pieces: Floats, counts: Ints, points: Floats) -> NDArray[np.bool_]:
    """Which points (k, 2) are in a piece."""
    inside = np.zeros(len(points), dtype=np.bool_)
    for k in range(len(points)):
        for i in range(len(counts)):
            if depth(pieces[i], counts[i], points[k, 0], points[k, 1]) >= -convex_polygon.ROUNDING_M:
                inside[k] = True
                break
    return inside
