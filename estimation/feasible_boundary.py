"""The boundary of ellipsoid ∩ paraboloid in the plane, as loops of points with the right topology.

In coordinates w of the ellipsoid, x = c + L V w with |w| ≤ 1 and V the eigenvectors of L_xyᵀ L_xy (`estimation.
range_cut`), the paraboloid is a graph w₃ = H(w₁, w₂), H of second degree without a mixed term. So the feasible set is

    F(w₁, w₂) = H² + w₁² + w₂² − 1 ≤ 0,

an affine picture of the set on the map that always fits the unit disc, be the set a kilometre wide or a micrometre.

It is swept by lines w₂ = y. On each, F is a quartic and the set at most two intervals. The roots are continuous in y
and are born and die in neighbouring pairs; these *events* are found by bisection, and between two of them the number of
roots is constant: a *panel*, with nodes that crowd towards its ends like the zeros of a cosine, where roots come and go
like square roots. The critical points of F, roots of one polynomial of degree five, are among the first lines, since
every region holds a minimum of F and every hole a maximum: none is too small to be seen.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.kernel import kernel
from estimation.quartic import negative_intervals

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LINES = 65
"""First lines of the sweep, evenly spaced."""

RESOLUTION = 1e-11
"""How close lines are looked at, in units of the ellipsoid: finer, rounding lets roots come and go at random."""

NARROWEST = 1e-9
"""Events nearer to each other than this count as one."""

Panel = tuple[Floats, Floats]
"""Lines (m,) and the roots on them (m, 0, 2 or 4), constant in number."""


class NormalForm(NamedTuple):
    """H = constant + linear · w + square · w² (each (2,), by component) and where F may be critical."""

    constant: float
    linear: Floats
    square: Floats

    @property
    def coefficients(self) -> Floats:
        """(5,) float: h₀, h₁, h₂, a₁, a₂."""
        return np.array([self.constant, *self.linear, *self.square])


@kernel
def roots_on_line(h: Floats, y: float, ends: Floats) -> int:
    """Where the line w₂ = y meets the set: ends (4,) of at most two intervals of w₁; their number, 0, 2 or 4."""
    room = (1.0 - y) * (1.0 + y)
    if room <= 0.0:
        return 0
    K = h[0] + y * (h[2] + y * h[4])
    c = np.array([K * K - room, 2.0 * h[1] * K, h[1] * h[1] + 2.0 * h[3] * K + 1.0, 2.0 * h[3] * h[1], h[3] * h[3]])
    half = math.sqrt(room)
    return negative_intervals(c, -half, half, ends)


@kernel
def roots_on_lines(h: Floats, lines: Floats) -> tuple[Ints, Floats]:
    """Numbers (m,) and roots (m, 4) on every line of (m,)."""
    counts = np.empty(len(lines), dtype=np.int64)
    roots = np.zeros((len(lines), 4))
    for i in range(len(lines)):
        counts[i] = roots_on_line(h, lines[i], roots[i])
    return counts, roots


@kernel
def find_events(h: Floats, lines: Floats) -> Floats:
    """Events (k, 2) between lines (m,), ascending: the last line before each and the first after it, nearly equal.

    Also where the number of intervals stays the same but they do not overlap: one ends before the other begins.
    """
    most = 64
    events = np.empty((most, 2))
    k = 0
    # A stack of lines still to be compared with `left`, the nearest on top.
    at, count, roots = np.empty(most), np.empty(most, dtype=np.int64), np.zeros((most, 4))
    left, n, p = lines[0], 0, np.zeros(4)
    n = roots_on_line(h, left, p)
    for i in range(1, len(lines)):
        at[0] = lines[i]
        count[0] = roots_on_line(h, lines[i], roots[0])
        pending = 1
        while pending > 0:
            top = pending - 1
            alike = n == count[top]
            for j in range(0, n if alike else 0, 2):
                alike = alike and max(p[j], roots[top, j]) <= min(p[j + 1], roots[top, j + 1])
            middle = 0.5 * (left + at[top])
            close = at[top] - left < RESOLUTION
            if alike or close:
                if not alike and k < most:
                    events[k] = left, at[top]
                    k += 1
                left, n = at[top], count[top]
                p[:] = roots[top]
                pending = top
                continue
            at[pending] = middle
            count[pending] = roots_on_line(h, middle, roots[pending])
            pending += 1
    return events[:k].copy()


@kernel
def _times(p: Floats, q: Floats) -> Floats:
    """Product of two polynomials, ascending coefficients."""
    product = np.zeros(len(p) + len(q) - 1)
    for i in range(len(p)):
        for j in range(len(q)):
            product[i + j] += p[i] * q[j]
    return product


@kernel
def _critical_polynomial(h: Floats, scale: float) -> Floats:
    """The quintic H(w(ν)) − ν = 0 times s₁²s₂², s_i = 1 + 2νa_i, in units of 1/scale for ν; ascending (6,)."""
    nu = np.array([0.0, 1.0 / scale])
    total = np.zeros(6)
    s1, s2 = np.array([1.0, 2.0 * h[3] / scale]), np.array([1.0, 2.0 * h[4] / scale])
    s11, s22 = _times(s1, s1), _times(s2, s2)
    total += _times(np.array([h[0], -1.0 / scale]), _times(s11, s22))
    for i in range(2):
        pull, a = h[1 + i] * h[1 + i], h[3 + i]
        term = _times(nu, s1 if i == 0 else s2) * -pull + _times(nu, nu) * (a * pull)
        total[:5] += _times(term, s22 if i == 0 else s11)
    return total


def critical_lines(form: NormalForm) -> Floats:
    """w₂ of the critical points of F (k,), those in the unit disc.

    They are the critical points of |w|² on the graph: w_i = −ν h_i / (1 + 2ν a_i) and w₃ = ν for a multiplier ν, where
    H(w₁, w₂) = ν: the roots of a quintic. Where an h_i is zero, ν = −1 / (2 a_i) is another case; they are listed too.
    """
    (h1, h2), (a1, a2), h0 = form.linear.tolist(), form.square.tolist(), form.constant
    scale = max(abs(a1), abs(a2), 1e-300)
    quintic = _critical_polynomial(form.coefficients, scale)
    roots = np.roots(quintic[::-1]) if np.isfinite(quintic).all() else np.empty(0)
    found: list[float] = []
    for root in roots[np.abs(roots.imag) <= 1e-6 * (1.0 + np.abs(roots.real))].real.tolist():
        below = 1.0 + 2.0 * a2 * root / scale
        if below != 0.0:
            found.append(-root / scale * h2 / below)
    if a1 != 0.0 and a1 != a2:
        found.append(h2 / (2.0 * a1 * (1.0 - a2 / a1)))
    if a2 != 0.0 and a1 != a2:
        nu = -0.5 / a2
        w1 = -nu * h1 / (1.0 + 2.0 * nu * a1)
        rest = h0 + h1 * w1 + a1 * w1 * w1 - nu
        inside = h2 * h2 - 4.0 * a2 * rest
        if inside >= 0.0:
            found += [(-h2 + sign * math.sqrt(inside)) / (2.0 * a2) for sign in (-1.0, 1.0)]
    return np.array([line for line in found if abs(line) < 1.0], dtype=np.float64)


def first_lines(form: NormalForm) -> Floats:
    """Lines (m,) that meet every region and every hole, in no order."""
    return np.concatenate([np.linspace(-1.0, 1.0, LINES), critical_lines(form)])


def sweep(form: NormalForm, nodes: int, lines: Floats) -> tuple[list[Panel], Floats]:
    """Panels with nodes + 1 lines each, ascending in w₂ from one end of the set to the other; none if it is empty.

    Returns also lines (m,) that find them at once the next time.

    Args:
        form: the set.
        nodes: even.
        lines: from −1 to 1, in any order.
    """
    h = form.coefficients
    spread = 0.5 * (1.0 - np.cos(np.linspace(0.0, math.pi, nodes + 1)))
    panels: list[Panel] = []
    for _ in range(6):
        events: list[list[float]] = []
        for first, last in find_events(h, np.unique(lines)).tolist():
            if events and first - events[-1][1] < NARROWEST:
                events[-1][1] = last
            else:
                events.append([first, last])
        panels, surprises = [], []
        for (_, first), (last, _) in pairwise(events):
            on = first + (last - first) * spread
            on[-1] = last
            counts, roots = roots_on_lines(h, on)
            if (counts != counts[0]).any():
                surprises.append(on)
            panels.append((on, roots[:, : counts[0]]))
        # The ends of events need no bisection again.
        lines = np.concatenate([[-1.0, 1.0], np.ravel(events), *(on for on, _ in panels), *surprises])
        if not surprises:
            break
        # Something came and went between two first lines: look again with the lines that saw it.
    return panels, lines


@kernel
def extents(lines: Floats, roots: Floats, M: Floats) -> tuple[float, float]:
    """Of a panel on the map, metres: the length of its boundary, and how far nodes lie from chords that skip them."""
    length, gap = 0.0, 0.0
    for i in range(roots.shape[1]):
        for k in range(2, len(lines), 2):
            x, y = roots[k, i] - roots[k - 2, i], lines[k] - lines[k - 2]
            u, v = roots[k - 1, i] - roots[k - 2, i], lines[k - 1] - lines[k - 2]
            x, y = M[0, 0] * x + M[0, 1] * y, M[1, 0] * x + M[1, 1] * y
            u, v = M[0, 0] * u + M[0, 1] * v, M[1, 0] * u + M[1, 1] * v
            chord = math.sqrt(x * x + y * y)
            length += chord
            if chord > 0.0:
                gap = max(gap, abs(x * v - y * u) / chord)
    return length, gap


def _join(
    before: list[float], after: list[float]
) -> tuple[list[tuple[int, int]], list[tuple[int, int]], list[tuple[int, int]]]:
    """Which roots go on over an event (old, new), which die in pairs (old, old) and which are born (new, new)."""
    n, m = len(before), len(after)
    if n == m and all(max(before[i], after[i]) <= min(before[i + 1], after[i + 1]) for i in range(0, n, 2)):
        return [(i, i) for i in range(n)], [], []
    if abs(n - m) != 2:
        return [], [(i, i + 1) for i in range(0, n, 2)], [(i, i + 1) for i in range(0, m, 2)]
    small, large = (before, after) if n < m else (after, before)

    def shift(at: int) -> float:
        rest = large[:at] + large[at + 2 :]
        return sum(abs(one - other) for one, other in zip(rest, small, strict=True))

    at = min(range(len(small) + 1), key=shift)
    kept = [i for i in range(len(large)) if i not in (at, at + 1)]
    through = list(enumerate(kept)) if n < m else [(old, new) for new, old in enumerate(kept)]
    return through, ([] if n < m else [(at, at + 1)]), ([(at, at + 1)] if n < m else [])


def trace(panels: list[Panel]) -> list[Floats]:
    """Closed loops (m, 2) of points w on the boundary, without the first one repeated; the set lies to their left."""
    links: dict[tuple[int, int, bool], tuple[int, int, bool]] = {}

    def link(one: tuple[int, int, bool], other: tuple[int, int, bool]) -> None:
        links[one], links[other] = other, one

    # An end of a piece of boundary: (panel, root, whether it is the upper end).
    for p in range(len(panels) + 1):
        before = panels[p - 1][1][-1].tolist() if p else []
        after = panels[p][1][0].tolist() if p < len(panels) else []
        through, dying, born = _join(before, after)
        for old, new in through:
            link((p - 1, old, True), (p, new, False))
        for i, j in dying:
            link((p - 1, i, True), (p - 1, j, True))
        for i, j in born:
            link((p, i, False), (p, j, False))
    loops: list[Floats] = []
    left = {(p, i) for p, (_, roots) in enumerate(panels) for i in range(roots.shape[1])}
    while left:
        start = min(left)
        # Left ends of intervals are walked down, right ends up.
        here = (*start, start[1] % 2 == 0)
        pieces: list[Floats] = []
        while here[:2] in left:
            p, i, downwards = here
            left.remove((p, i))
            lines, roots = panels[p]
            piece = np.column_stack([roots[:, i], lines])
            pieces.append(piece[::-1] if downwards else piece)
            here = links[(p, i, not downwards)]
        loops.append(np.concatenate(pieces))
    return loops


@kernel
def moments(lines: Floats, roots: Floats) -> Floats:
    """∫ of 1, w₁, w₂, w₁², w₁w₂, w₂² over a panel (6,), by Simpson's rule in the cosine's angle.

    The error falls with the fourth power of the number of nodes.
    """
    n = len(lines) - 1
    half = 0.5 * (lines[n] - lines[0])
    total = np.zeros(6)
    for k in range(1, n):
        y = lines[k]
        weight = (4.0 if k % 2 else 2.0) * math.pi / (3.0 * n) * half * math.sin(math.pi * k / n)
        for i in range(0, roots.shape[1], 2):
            low, high = roots[k, i], roots[k, i + 1]
            length = weight * (high - low)
            total[0] += length
            total[1] += length * 0.5 * (high + low)
            total[2] += length * y
            total[3] += length * (high * high + high * low + low * low) / 3.0
            total[4] += length * 0.5 * (high + low) * y
            total[5] += length * y * y
    return total
