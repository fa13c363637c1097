"""Kernels that cut one convex piece by an annulus, outwards, into as few convex pieces as come near enough.

An annulus is not convex. Its outer disc is left by tangents. For the inner one the piece is split by rays from the
anchor into wedges, and each wedge loses what lies before the chord between its rays: that much is inside the disc for
sure, and what is left of the disc is thinner than the tolerance.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from estimation.convex_polygon import clip, simplify
from estimation.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_VERTICES = 16
"""Of one piece."""

SCRATCH = 4 * MOST_VERTICES
"""Rows enough for a piece while it is worked on."""

MOST_TANGENTS = 12
"""On one piece."""

ON_CIRCLE = 1e-9
"""How far beyond an edge's ends, as a share of its length, a circle counts as meeting it."""


@kernel
def cut_piece(
    P: Floats,
    n: int,
    ax: float,
    ay: float,
    r0: float,
    r1: float,
    tolerance: float,
    inner: bool,
    inside: bool,
    most: int,
    out: Floats,
    counts: Ints,
    scratch: Floats,
) -> tuple[int, bool]:
    """Write an outer bound of the part of a piece in an annulus into out[:k] and counts[:k].

    Args:
        P: the piece, n of its rows; overwritten.
        n: see there.
        ax: anchor, metres, frame of the set.
        ay: the same.
        r0: inner radius, metres.
        r1: outer radius, metres; may be inf.
        tolerance: how far chords may stay from the inner circle, metres; tangents may stay twice as far from the outer.
        inner: whether to cut by the inner circle at all.
        inside: whether the anchor is in the piece.
        most: pieces to write at most.
        out: receives (k, MOST_VERTICES, 2).
        counts: receives their numbers of vertices.
        scratch: (2, SCRATCH, 2), anything.

    Returns:
        k, and whether all came as near as they should: else there were too few places.
    """
    Q, other = scratch[0], scratch[1]
    wedges, first, step = 1, 0.0, 0.0
    enough = True
    if inner:
        widest = 2.0 * math.acos(max(0.0, 1.0 - tolerance / r0))
        if inside:
            wanted = max(3, math.ceil(2.0 * math.pi / widest))
            wedges = min(wanted, most) if most >= 3 else 0
            step = 2.0 * math.pi / max(wedges, 1)
            enough = wedges == wanted
        else:
            span = np.array([np.inf, -np.inf])
            facing = _facing(P, n, ax, ay)
            # All of the boundary in the disc, and vertices that are on the circle but for rounding.
            for i in range(n):
                enter, leave = _chord(P, n, i, ax, ay, r0)
                if enter <= 1.0 + ON_CIRCLE and leave >= -ON_CIRCLE:
                    _widen(span, P, n, i, max(enter, 0.0), ax, ay, facing)
                    _widen(span, P, n, i, min(leave, 1.0), ax, ay, facing)
            # A disc that just touches may come out with no chord: then it cuts nothing off.
            wanted = max(1, math.ceil((span[1] - span[0]) / widest)) if span[1] > span[0] else 0
            wedges = min(wanted, most)
            enough = wedges == wanted
            first = facing + span[0]
            step = (span[1] - span[0]) / max(wedges, 1)
    written = 0
    for wedge in range(max(wedges, 1)):
        k = n
        Q[:k] = P[:k]
        if inner and wedges > 0:
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
            k = _leave_disc(Q, k, ax, ay, r1, 2.0 * tolerance, other)
        if k:
            k = simplify(Q, k, MOST_VERTICES)
        if k:
            out[written, :k] = Q[:k]
            counts[written] = k
            written += 1
    return written, enough


@kernel
def _facing(P: Floats, n: int, ax: float, ay: float) -> float:
    """Direction of the middle of a piece, seen from an anchor."""
    mx, my = 0.0, 0.0
    for i in range(n):
        mx += P[i, 0] - ax
        my += P[i, 1] - ay
    return math.atan2(my, mx)


@kernel
def _chord(P: Floats, n: int, i: int, ax: float, ay: float, r: float) -> tuple[float, float]:
    """Where the line of the edge that begins at vertex i enters and leaves a circle, from 0 to 1 along the edge."""
    j = i + 1 if i + 1 < n else 0
    px, py = P[i, 0] - ax, P[i, 1] - ay
    ex, ey = P[j, 0] - P[i, 0], P[j, 1] - P[i, 1]
    a = ex * ex + ey * ey
    half = px * ex + py * ey
    c = px * px + py * py - r * r
    square = half * half - a * c
    if a == 0.0 or square <= 0.0:
        return np.inf, -np.inf
    # Roots of at² + 2·half·t + c in the form that does not cancel.
    q = -(half + math.copysign(math.sqrt(square), half))
    one, two = q / a, c / q
    return min(one, two), max(one, two)


@kernel
def _widen(span: Floats, P: Floats, n: int, i: int, t: float, ax: float, ay: float, facing: float) -> None:
    """Make a span of angles (2,) hold the direction of a point on an edge, relative to another direction."""
    j = i + 1 if i + 1 < n else 0
    x, y = P[i, 0] + t * (P[j, 0] - P[i, 0]) - ax, P[i, 1] + t * (P[j, 1] - P[i, 1]) - ay
    angle = (math.atan2(y, x) - facing + math.pi) % (2.0 * math.pi) - math.pi
    span[0], span[1] = min(span[0], angle), max(span[1], angle)


@kernel
def _leave_disc(P: Floats, n: int, ax: float, ay: float, r: float, tolerance: float, other: Floats) -> int:
    """Cut a piece by tangents of the disc that it leaves by more than a tolerance, in place; other is scratch."""
    farthest = 0.0
    for i in range(n):
        farthest = max(farthest, (P[i, 0] - ax) ** 2 + (P[i, 1] - ay) ** 2)
    if farthest <= (r + tolerance) ** 2:
        return n
    span = np.array([np.inf, -np.inf])
    facing = _facing(P, n, ax, ay)
    for i in range(n):
        for t in _chord(P, n, i, ax, ay, r):
            if 0.0 <= t <= 1.0:
                _widen(span, P, n, i, t, ax, ay, facing)
    around = span[1] < span[0] or _holds(P, n, ax, ay)
    if around:
        span[0], span[1] = -math.pi, math.pi
    step = 2.0 * math.acos(1.0 / (1.0 + tolerance / r)) if r > 0.0 else math.pi
    tangents = min(MOST_TANGENTS, max(1, math.ceil((span[1] - span[0]) / step)))
    if around:
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
def _holds(P: Floats, n: int, x: float, y: float) -> bool:
    """Whether a point is in a piece."""
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        if (P[j, 0] - P[i, 0]) * (y - P[i, 1]) - (P[j, 1] - P[i, 1]) * (x - P[i, 0]) < 0.0:
            return False
    return True
