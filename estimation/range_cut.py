"""Kernels of the range filter: an ellipsoid in (x, y, s = x² + y²), kept as a factor in a frame that follows it.

A state is one array of 14 numbers: the origin o (2) of its frame on the map, the centre c (3) and the rows of the
factor L (3 × 3) of {c + L v : |v| ≤ 1}, all in metres and square metres relative to o. As a matrix E in a fixed frame
the same filter loses a target 5 km away to rounding; as a factor in a frame that is moved along it does not.

A range between r₀ and r₁ from a is the strip r₀² ≤ s − 2a·x + |a|² ≤ r₁² (Thesis §2.3). The strip only ever cuts the
ellipsoid; that the target lies on the paraboloid s = |x|² is used by the *manifold multiplier*: adding μ(|x|² − s) to
the inequality of the ellipsoid changes nothing on the paraboloid, so take the μ whose ellipsoid is smallest.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from estimation.fusion import PADDING
from estimation.kernel import kernel
from estimation.minkowski_sum import enlarge
from estimation.strip_cut import EMPTY, REDUNDANT, THINNEST, cut_factor

Floats = NDArray[np.float64]

STATE = 14
"""Numbers in a state."""

GRID_M = 2.0**-10
"""Origins lie on this grid, so that differences of origins are exact."""


@kernel
def volume(state: Floats) -> float:
    """Volume in (x, y, s), m⁴: 4/3 π |det L|."""
    L = state[5:].reshape(3, 3)
    determinant: float = (
        L[0, 0] * (L[1, 1] * L[2, 2] - L[1, 2] * L[2, 1])
        - L[0, 1] * (L[1, 0] * L[2, 2] - L[1, 2] * L[2, 0])
        + L[0, 2] * (L[1, 0] * L[2, 1] - L[1, 1] * L[2, 0])
    )
    return 4.0 / 3.0 * math.pi * abs(determinant)


@kernel
def begin(ax: float, ay: float, r0: float, r1: float, state: Floats) -> None:
    """Fill the state with the smallest ellipsoid around the part of the paraboloid that a first range leaves.

    With τ = r², m̄ and w̄ the middle and half-width of [τ₀, τ₁] and e = 2w̄² / (m̄ + √(m̄² + 8w̄²)) it has the semi-axes
    t/√(2e) twice and t, t² = w̄² + e² + 2em̄, and its centre m̄ + e above the anchor. Nothing of it is degenerate.
    """
    ox, oy = math.floor(ax / GRID_M + 0.5) * GRID_M, math.floor(ay / GRID_M + 0.5) * GRID_M
    m = 0.5 * (r0 * r0 + r1 * r1)
    w = 0.5 * (r1 - r0) * (r1 + r0)
    e = 2.0 * w * w / (m + math.sqrt(m * m + 8.0 * w * w))
    t = math.sqrt(w * w + e * e + 2.0 * e * m) * (1.0 + PADDING)
    state[:] = 0.0
    # In the frame of the anchor; then moved to the grid.
    state[0], state[1], state[4] = ax, ay, m + e
    state[5] = state[9] = t / math.sqrt(2.0 * e)
    state[13] = t
    move_origin(state, ox - ax, oy - ay)
    state[0], state[1] = ox, oy


@kernel
def move_origin(state: Floats, dx: float, dy: float) -> None:
    """Move the frame's origin by Δ = (dx, dy); the set stays where it is on the map. Δ enters s = |x|² twice."""
    for j in range(3):
        state[11 + j] -= 2.0 * (dx * state[5 + j] + dy * state[8 + j])
    state[4] += dx * (dx - 2.0 * state[2]) + dy * (dy - 2.0 * state[3])
    state[2] -= dx
    state[3] -= dy
    state[0] += dx
    state[1] += dy


@kernel
def recentre(state: Floats) -> None:
    """Move the frame's origin to the grid point nearest to the centre."""
    dx, dy = math.floor(state[2] / GRID_M + 0.5) * GRID_M, math.floor(state[3] / GRID_M + 0.5) * GRID_M
    if dx != 0.0 or dy != 0.0:
        move_origin(state, dx, dy)


@kernel
def squared_distances(state: Floats, ax: float, ay: float) -> tuple[float, float]:
    """Least and greatest s − 2a·x + |a|² on the ellipsoid: on the paraboloid, the squared distance from a, m²."""
    px, py = ax - state[0], ay - state[1]
    middle = state[4] - 2.0 * (px * state[2] + py * state[3]) + px * px + py * py
    reach = 0.0
    for j in range(3):
        reach += (state[11 + j] - 2.0 * (px * state[5 + j] + py * state[8 + j])) ** 2
    reach = math.sqrt(reach)
    return middle - reach, middle + reach


@kernel
def cut(state: Floats, ax: float, ay: float, low: float, high: float) -> tuple[int, float, float]:
    """Cut the ellipsoid with low ≤ s − 2a·x + |a|² ≤ high (m²), and use the paraboloid.

    Returns:
        outcome (CUT, REDUNDANT or EMPTY of `estimation.strip_cut`); λ of the thesis' family (1: the range changed
        nothing, near 0: the old set hardly matters across it); μ in 1/m². A state that comes out empty is as it was.
    """
    px, py = ax - state[0], ay - state[1]
    direction = np.array([-2.0 * px, -2.0 * py, 1.0])
    offset = px * px + py * py
    outcome, ratio, first, last, center, factor = cut_factor(
        state[2:5], state[5:].reshape(3, 3), direction, low - offset, high - offset
    )
    if outcome == EMPTY:
        return EMPTY, 0.0, 0.0
    if outcome == REDUNDANT:
        return REDUNDANT, 1.0, 0.0
    # λ from the cut's semi-axes: with E₂ = d⁻² u uᵀ for the strip, 1/q = 1 + d⁻² (1 − λ)/λ.
    d = max(0.5 * (min(last, 1.0) - max(first, -1.0)), THINNEST)
    reach, before = 0.0, 0.0
    for j in range(3):
        reach += (direction[0] * factor[0, j] + direction[1] * factor[1, j] + factor[2, j]) ** 2
        before += (direction[0] * state[5 + j] + direction[1] * state[8 + j] + state[11 + j]) ** 2
    along = math.sqrt(reach / before)
    across = math.sqrt(ratio / along)
    q = min(1.0, (along / across) ** 2)
    weight = q / (q + d * d * (1.0 - q))
    trial = state.copy()
    trial[2:5] = center
    trial[5:] = factor.copy().reshape(9)
    empty, multiplier = tighten(trial)
    if empty:
        return EMPTY, weight, multiplier
    state[:] = trial
    return outcome, weight, multiplier


@kernel
def _slope(t: float, e_max: float, e1: float, e2: float, g: Floats, gamma: float) -> tuple[float, float, float, float]:
    """At log(1 + μ e_max) = t: μ, k, the size of the terms of k, and k times dF/dμ for F = 3/2 log k − ½ Σ log(…)."""
    mu = math.expm1(t) / e_max
    s1, s2 = 1.0 + mu * e1, 1.0 + mu * e2
    pull = g[0] * g[0] / s1 + g[1] * g[1] / s2 + g[2] * g[2]
    k = 1.0 - mu * gamma + mu * mu * pull
    terms = 1.0 + abs(mu * gamma) + mu * mu * pull
    rate = (
        -gamma
        + g[0] * g[0] * mu * (1.0 + s1) / (s1 * s1)
        + g[1] * g[1] * mu * (1.0 + s2) / (s2 * s2)
        + 2.0 * g[2] * g[2] * mu
    )
    return mu, k, terms, 1.5 * rate - 0.5 * k * (e1 / s1 + e2 / s2)


@kernel
def tighten(state: Floats) -> tuple[bool, float]:
    """Re-centre, and replace the ellipsoid by the smallest one with the same points of the paraboloid, over all μ.

    With e, V from L_xyᵀ L_xy, g = Vᵀ(L_xyᵀ c_xy − ½ L_sᵀ), γ = |c_xy|² − c_s: k(μ) = 1 − μγ + μ² Σ gᵢ²/(1 + μeᵢ), and
    3/2 log k − ½ Σ log(1 + μeᵢ) has one minimum over μ > −1/e_max.

    Returns:
        Whether some k < 0 proves that no point of the paraboloid is left (beyond what rounding could do to k), and μ.
    """
    recentre(state)
    L = state[5:].reshape(3, 3)
    gamma = state[2] ** 2 + state[3] ** 2 - state[4]
    e, V = spectrum(L)
    raw = np.empty(3)
    for j in range(3):
        raw[j] = L[0, j] * state[2] + L[1, j] * state[3] - 0.5 * L[2, j]
    g = np.empty(3)
    for j in range(3):
        g[j] = V[0, j] * raw[0] + V[1, j] * raw[1] + V[2, j] * raw[2]
    e1, e2 = e[0], e[1]
    low, high = -12.0, 30.0
    for _ in range(48):
        t = 0.5 * (low + high)
        mu, k, terms, slope = _slope(t, e1, e1, e2, g, gamma)
        if k < -1e-9 * terms:
            return True, mu
        if slope > 0.0:
            high = t
        else:
            low = t
    mu, k, _, _ = _slope(0.5 * (low + high), e1, e1, e2, g, gamma)
    if k <= 0.0:
        return False, 0.0
    s = np.array([1.0 + mu * e1, 1.0 + mu * e2, 1.0])
    if 1.5 * math.log(k) - 0.5 * (math.log(s[0]) + math.log(s[1])) > -1e-9:
        return False, 0.0
    grown = math.sqrt(k) * (1.0 + PADDING)
    for i in range(3):
        x, y, z = L[i, 0], L[i, 1], L[i, 2]
        for j in range(3):
            turned = x * V[0, j] + y * V[1, j] + z * V[2, j]
            state[2 + i] -= mu * turned * g[j] / s[j]
            L[i, j] = grown * turned / math.sqrt(s[j])
    recentre(state)
    return False, mu


@kernel
def spectrum(L: Floats) -> tuple[Floats, Floats]:
    """Eigenvalues (descending; the third is 0) and orthonormal eigenvectors of L_xyᵀ L_xy, from the rows x and y of L.

    By one Jacobi rotation of the two rows: it makes them orthogonal without squaring a small one away.
    """
    xx = L[0, 0] ** 2 + L[0, 1] ** 2 + L[0, 2] ** 2
    yy = L[1, 0] ** 2 + L[1, 1] ** 2 + L[1, 2] ** 2
    xy = L[0, 0] * L[1, 0] + L[0, 1] * L[1, 1] + L[0, 2] * L[1, 2]
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
    c, s = math.cos(angle), math.sin(angle)
    V = np.empty((3, 3))
    e = np.zeros(3)
    for j in range(3):
        V[j, 0] = c * L[0, j] + s * L[1, j]
        V[j, 1] = c * L[1, j] - s * L[0, j]
    e[0] = V[0, 0] ** 2 + V[1, 0] ** 2 + V[2, 0] ** 2
    length = math.sqrt(e[0])
    overlap = 0.0
    for j in range(3):
        V[j, 0] /= length
    for j in range(3):
        overlap += V[j, 0] * V[j, 1]
    for j in range(3):
        V[j, 1] -= overlap * V[j, 0]
    e[1] = V[0, 1] ** 2 + V[1, 1] ** 2 + V[2, 1] ** 2
    length = math.sqrt(e[1])
    for j in range(3):
        V[j, 1] /= length
    V[0, 2] = V[1, 0] * V[2, 1] - V[2, 0] * V[1, 1]
    V[1, 2] = V[2, 0] * V[0, 1] - V[0, 0] * V[2, 1]
    V[2, 2] = V[0, 0] * V[1, 1] - V[1, 0] * V[0, 1]
    return e, V


@kernel
def grow(state: Floats, distance: float) -> None:
    """Outer bound of the set after the target has moved at most δ = distance > 0.

    On the set |x| ≤ ρ = min(|c_xy| + σ_max(L_xy), √(c_s + |L_s|)), so s changes by e ∈ [−(2ρ − t)t, (2ρ + δ)δ] with
    t = min(δ, ρ), and (x, y) by at most δ: a cylinder, which the ellipsoid D = diag(√1.5 δ, √1.5 δ, √3 η) bounds. The
    Minkowski sum is bounded by (1 + 1/p) L Lᵀ + (1 + p) D Dᵀ, of least volume where 3/(p(p + 1)) = Σ λᵢ/(1 + pλᵢ).
    """
    recentre(state)
    L = state[5:].reshape(3, 3)
    e, _ = spectrum(L)
    rho = math.hypot(state[2], state[3]) + math.sqrt(e[0])
    top = state[4] + math.sqrt(L[2, 0] ** 2 + L[2, 1] ** 2 + L[2, 2] ** 2)
    rho = min(rho, math.sqrt(max(top, 0.0)))
    t = min(distance, rho)
    down, up = -(2.0 * rho - t) * t, (2.0 * rho + distance) * distance
    state[4] += 0.5 * (down + up)
    D = np.array([math.sqrt(1.5) * distance, math.sqrt(1.5) * distance, math.sqrt(3.0) * 0.5 * (up - down)])
    enlarge(L, D)
    tighten(state)
