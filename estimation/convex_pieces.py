"""Kernels on a union of convex polygons: keep it near the annuli it stands for, with few pieces, and measure it.

A set is pieces (m, MOST_VERTICES, 2) float, the numbers of their vertices (m,) int (see `estimation.convex_polygon`)
and, of every piece, the width at which it was *checked* last (m,) float: all remembered annuli were cut out of it as
finely as that width asked for. The width of a piece is 2 · area / perimeter. A cut that stays t away from a circle
costs no more area than t times the perimeter, so tolerances in proportion to the width bound the share of area that is
too much, be a piece round or a sliver; and when a piece has become thinner, what was fine enough no longer is, and the
annuli are cut out of it again.

Pieces hardly overlap; `estimation.convex_growth`, which makes them overlap, also parts them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from estimation import convex_polygon
from estimation.convex_cut import MOST_VERTICES, SCRATCH, cut_piece
from estimation.convex_polygon import area, depth, distances, hull, simplify, width
from estimation.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_PIECES = 512
"""Of one set."""

FINENESS = 0.025
"""How far a cut may stay from its circle, as a share of the piece's width."""

RING_FINENESS = 0.04
"""The same for the ring of a first range, as a share of its width."""

SWEEPS = 8
"""Over all pieces, at most."""

THINNER = 0.7
"""A piece is checked again when its width has fallen to this share."""

COARSE = -1.0
"""In place of a width: places ran out, so the piece is to be checked again when there are more."""

FINEST_M = 1e-9
"""Tolerance below which rounding decides."""


@kernel
def cut(
    pieces: Floats, counts: Ints, checked: Floats, annuli: Floats, out: Floats, kept: Ints, passed: Floats
) -> tuple[int, bool, bool]:
    """Write an outer bound of what the last of some annuli leaves of a set into out, kept and passed.

    All pieces are cut by the last annulus first; then those that came out thin by all annuli, until none is thin.

    Args:
        pieces: the set.
        counts: see the module.
        checked: see the module; inf where not at all, 0 where that is not asked for.
        annuli: (k, 4) float: x, y, inner and outer radius, metres, frame of the set. The set lies in all but the last,
            up to tolerances.
        out: (MOST_PIECES, MOST_VERTICES, 2), receives the pieces.
        kept: receives their numbers of vertices.
        passed: receives the widths at which they were checked.

    Returns:
        The number of pieces, whether anything was cut, and whether the last annulus says anything about the set.
    """
    scratch, P = np.empty((2, SCRATCH, 2)), np.empty((SCRATCH, 2))
    last = len(annuli) - 1
    # Pieces still to be cut wait at the end of out: at the annulus `stage`, with tolerances for the width `basis`.
    stage, basis = np.empty(MOST_PIECES, dtype=np.int64), np.empty(MOST_PIECES)
    m, top, changed, tells = 0, MOST_PIECES - len(counts), False, False
    coarse, before = False, np.inf
    for i in range(len(counts)):
        out[top + i, : counts[i]] = pieces[i, : counts[i]]
        kept[top + i], passed[top + i] = counts[i], checked[i]
        stage[top + i], basis[top + i] = last, width(pieces[i], counts[i])
    for sweep in range(SWEEPS):
        if sweep:
            # Once; and again while places ran out, but may not run out any more because so much is gone.
            size = total_area(out, kept[:m])
            if m == 0 or not (changed if sweep == 1 else coarse and size < 0.5 * before):
                break
            before = size
            for i in range(m - 1, -1, -1):
                top -= 1
                _move(out, kept, i, top)
                passed[top], stage[top] = passed[i], last + 1
            m, coarse = 0, False
        while top < MOST_PIECES:
            n, at, wide, after = kept[top], stage[top], basis[top], passed[top]
            P[:n] = out[top, :n]
            top += 1
            while n > 0:
                if at > last:
                    now = width(P, n) if sweep else np.inf
                    if now <= FINEST_M or now >= THINNER * after:
                        break
                    at, wide, after = 0, now, now
                ax, ay, r0, r1 = annuli[at]
                nearest, farthest, inside = distances(P, n, ax, ay)
                tells = tells or (at == last and (nearest < r0 or farthest > r1))
                if nearest > r1 or farthest < r0:
                    n, changed = 0, True
                    break
                tolerance = max(FINENESS * min(wide, r1 - r0), FINEST_M)
                inner, outer = r0 - nearest > tolerance, farthest - r1 > 2.0 * tolerance
                at += 1
                if not (inner or outer):
                    continue
                changed = True
                # Places are shared with the pieces that wait.
                most = max(1, (top - m) // (1 + MOST_PIECES - top))
                first = top - most
                k, enough = cut_piece(
                    P, n, ax, ay, r0, r1, tolerance, inner, inside, most, out[first:top], kept[first:top], scratch
                )
                n = kept[first] if k else 0
                P[:n] = out[first, :n]
                after = after if enough else COARSE
                for i in range(first + k - 1, first, -1):
                    top -= 1
                    _move(out, kept, i, top)
                    stage[top], basis[top], passed[top] = at, wide, after
            if n:
                out[m, :n] = P[:n]
                coarse = coarse or after == COARSE
                kept[m], passed[m] = n, np.inf if after == COARSE else after
                m += 1
    return m, changed, tells


@kernel
def _move(out: Floats, kept: Ints, source: int, target: int) -> None:
    """Copy a piece from one place to another."""
    n = kept[source]
    out[target, :n] = out[source, :n]
    kept[target] = n


@kernel
def telling(pieces: Floats, counts: Ints, annuli: Floats) -> NDArray[np.bool_]:
    """Which annuli (k,) do not contain the whole set."""
    tells = np.zeros(len(annuli), dtype=np.bool_)
    for j in range(len(annuli)):
        for i in range(len(counts)):
            nearest, farthest, _ = distances(pieces[i], counts[i], annuli[j, 0], annuli[j, 1])
            if nearest < annuli[j, 2] or farthest > annuli[j, 3]:
                tells[j] = True
                break
    return tells


@kernel
def ring(ax: float, ay: float, r0: float, r1: float, out: Floats, kept: Ints, passed: Floats) -> int:
    """Write a ring of pieces around an annulus into out, kept and passed; their number."""
    if r0 <= 0.0:
        count, step = 1, 2.0 * math.pi / MOST_VERTICES
        kept[0] = MOST_VERTICES
        for i in range(MOST_VERTICES):
            _polar(out[0, i], ax, ay, r1 / math.cos(0.5 * step), i * step)
    else:
        tolerance = RING_FINENESS * (r1 - r0)
        widest = 2.0 * math.acos(max(0.5, 1.0 - tolerance / r0, 1.0 / (1.0 + tolerance / r1)))
        count = min(MOST_PIECES // 4, math.ceil(2.0 * math.pi / widest))
        step = 2.0 * math.pi / count
        reach = r1 / math.cos(0.5 * step)
        for i in range(count):
            _polar(out[i, 0], ax, ay, r0, (i + 1) * step)
            _polar(out[i, 1], ax, ay, r0, i * step)
            _polar(out[i, 2], ax, ay, reach, i * step)
            _polar(out[i, 3], ax, ay, reach, (i + 1) * step)
            kept[i] = 4
    passed[:count] = np.inf
    return count


@kernel
def _polar(point: Floats, ax: float, ay: float, r: float, angle: float) -> None:
    """Fill a point (2,): at a distance and angle from an anchor."""
    point[0], point[1] = ax + r * math.cos(angle), ay + r * math.sin(angle)


@kernel
def merge(pieces: Floats, counts: Ints, checked: Floats, m: int, share: float, most: int) -> int:
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
                counts[i], checked[i] = n, max(checked[i], checked[j])
                continue
            i += 1
            if i != j:
                pieces[i, : counts[j]] = pieces[j, : counts[j]]
                counts[i], checked[i] = counts[j], checked[j]
        m = min(m, i + 1)
        if m <= most:
            return m
        share *= 2.0


@kernel
def moments(pieces: Floats, counts: Ints) -> Floats:
    """Sums over the pieces of ∫ of 1, x, y, x², xy, y² (6,), about the first vertex of the first piece.

    Not about the frame's origin: a target may have walked far from it, and second moments about a far point lose the
    digits that a small set needs.
    """
    total = np.zeros(6)
    x0, y0 = pieces[0, 0]
    for piece in range(len(counts)):
        for i in range(2, counts[piece]):
            ax, ay = pieces[piece, 0, 0] - x0, pieces[piece, 0, 1] - y0
            bx, by = pieces[piece, i - 1, 0] - x0, pieces[piece, i - 1, 1] - y0
            cx, cy = pieces[piece, i, 0] - x0, pieces[piece, i, 1] - y0
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
