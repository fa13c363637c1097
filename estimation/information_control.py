"""Where a robot goes to learn more: directions from the shared set, its own position and its own limits (thesis §2.4).

Every law is a pure function

    law(shared, position, limits, …) → direction, a unit vector or zero, (2,) float.

Each robot decides alone. What the others have measured is already in the shared set, so robots that look at the same
set coordinate without a word (thesis §2.5). Two laws that need a gradient only stand here; the ones that predict the
set itself stand in :mod:`estimation.look_ahead`, and the one of a Gaussian in :mod:`estimation.information_filter`.
A direction is a wish: how to get there past walls and other robots is for whoever plans the robot's motion.

Symbols, as in the thesis: a the robot's position, u its next move, x̂ the estimate, b = a + u − x̂ the robot as seen
from the estimate, C the covariance of the set.

*Degenerate cases* are decided here once, for all laws, so that replays and peers agree:

===================================  ==================================================================================
no estimate yet, or a single point   zero: there is nothing to aim at, or nothing to gain
the robot cannot move                zero
robot at the estimate (b ≈ 0)        along the long axis of C, the half of it that points to +x (or +y): any step leads
                                     out of the place where the gradient has no value, and this one measures most
no pull (or almost) to either side   circle: at right angles to the line of sight, to the left as seen from the robot;
                                     so it is on the mirror line, by symmetry, where it must be left
===================================  ==================================================================================

Looking ahead needs none of the last two: it compares headings, and the first of equally good ones is taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from estimation.range_filter import FilterSnapshot

Floats = NDArray[np.float64]

EMPTY_GRADIENT = 1e-3
"""Share of what the gradient could be at most, below which its part across the line of sight counts as empty."""

AT_THE_ESTIMATE = 1e-3
"""Share of the set's size within which the robot counts as standing at the estimate."""


class NotAnEstimate(ValueError):
    """Numbers that are no set, position or limits; the text says which and what to do."""


@dataclass(frozen=True)
class Limits:
    """What the robot that decides can do.

    Attributes:
        step_m: how far it can drive from one range to the next, metres; 0 if it stands. A gradient only asks whether it
            can move at all.
        bound_m: ε, half-width of the interval that a range of it stands for, metres. It does not bear on a gradient's
            direction.
        headings: how many first headings are tried by looking ahead, evenly spread.

    Raises:
        NotAnEstimate: the step is negative, another number not positive, or one is not finite.
    """

    step_m: float
    bound_m: float
    headings: int = 24

    def __post_init__(self) -> None:
        if not (0 <= self.step_m < math.inf and 0 < self.bound_m < math.inf and self.headings > 0):
            raise NotAnEstimate(
                f"a step must be at least 0, the bound and the number of headings positive, all finite, not {self}"
            )


class EmbeddedSet(Protocol):
    """A set around the target in (x, y, s = x² + y²): a :class:`estimation.range_filter.RangeFilter`."""

    @property
    def started(self) -> bool:
        """Whether anything is known."""

    def snapshot(self) -> FilterSnapshot:
        """The set as numbers."""


class PlaneSet(Protocol):
    """A set in the plane: a :class:`estimation.tight_set.TightSet`, a :class:`estimation.feasible_set.FeasibleSet`."""

    @property
    def centroid(self) -> Floats:
        """(2,) float, metres, map frame."""

    @property
    def covariance(self) -> Floats:
        """(2, 2) float, m², of a point spread evenly over the set."""


def information_gradient(shared: EmbeddedSet, position: ArrayLike, limits: Limits) -> Floats:
    """Direction that makes the next range most informative: the thesis' law, eq. 17, corrected.

    Ĩ(u) = ½ tr(E⁻¹ HᵀRH) with H = [−2(a + u)ᵀ, 1]. Two corrections. The weight of a strip is the inverse *square* of
    its half-width, R = (2rε)⁻². And the predicted range is r = |a + u − x̂|, not the last measured one: with r constant,
    Ĩ is a convex quadratic with no gradient at all after the first range, and the robot sticks to the mirror line and
    then runs away. H E⁻¹ Hᵀ is the variance of |x − a − u|², so only differences count: with P = E⁻¹ in the frame whose
    origin is x̂, Ĩ = (4 bᵀP_xx b − 4 bᵀP_xs + P_ss) / (8 ε²|b|²), and ε does not bear on the direction.

    Args:
        shared: the set that the team shares.
        position: (2,) float, metres, map frame: the robot.
        limits: of the robot.

    Returns:
        (2,) float: a unit vector, or zero; see the table above.

    Raises:
        NotAnEstimate: the position is not two finite numbers.
    """
    a = check_position(position)
    if not shared.started or limits.step_m == 0:
        return np.zeros(2)
    held = shared.snapshot()
    c = np.array(held.center[:2])
    # In the frame whose origin is x̂. The factor is moved and not E⁻¹, which is its square and would lose the digits.
    L = np.array(held.factor).reshape(3, 3)
    L[2] -= 2 * c @ L[:2]
    P = L @ L.T
    Pxx, Pxs, Pss = P[:2, :2], P[:2, 2], P[2, 2]
    b = (a - held.origin) - c
    if _is_at_estimate(b, Pxx):
        return _leave(Pxx)
    across = float(b @ b)
    variance = float(4 * b @ Pxx @ b - 4 * b @ Pxs + Pss)
    gradient = (4 * Pxx @ b - 2 * Pxs) * across - variance * b
    most = 4 * float(np.trace(Pxx)) * across**1.5 + variance * across**0.5
    # The pull along the line of sight is never empty, and keeps the robot on a mirror line: look across.
    aside = gradient - b * float(gradient @ b) / across
    if float(np.linalg.norm(aside)) < EMPTY_GRADIENT * most:
        return _circle(b)
    return _unit(gradient)


def covariance_direction(shared: PlaneSet | None, position: ArrayLike, limits: Limits) -> Floats:
    """Direction −(I − uuᵀ) C u, u the line of sight to the estimate: the robot turns about it towards its long axis.

    It is the gradient of the predicted range's variance uᵀCu, and the thesis' law without its pull towards the target.
    A range tells about the direction of sight only, so the robot looks along the axis that is known least.

    Args:
        shared: the set that the team shares; None while nothing is known.
        position: (2,) float, metres, map frame: the robot.
        limits: of the robot.

    Returns:
        (2,) float: a unit vector, or zero; see the table above. It circles when the norm is below 1e-3 tr C.

    Raises:
        NotAnEstimate: the position is not two finite numbers.
    """
    a = check_position(position)
    if shared is None or limits.step_m == 0:
        return np.zeros(2)
    return turn_about(shared.centroid, shared.covariance, a)


def turn_about(estimate: Floats, C: Floats, position: Floats) -> Floats:
    """The covariance law for an estimate (2,), metres, its covariance (2, 2), m², and a robot (2,), metres."""
    b = position - estimate
    if _is_at_estimate(b, C):
        return _leave(C)
    u = -_unit(b)
    Cu = C @ u
    direction = -(Cu - u * float(u @ Cu))
    if float(np.linalg.norm(direction)) < EMPTY_GRADIENT * float(np.trace(C)):
        return _circle(b)
    return _unit(direction)


def check_position(position: ArrayLike) -> Floats:
    """A robot's position as (2,) float.

    Raises:
        NotAnEstimate: not two finite numbers.
    """
    a = np.asarray(position, dtype=np.float64)
    if a.shape != (2,) or not np.isfinite(a).all():
        raise NotAnEstimate(f"the robot's position must be two finite numbers in metres, not {position!r}")
    return a


def _is_at_estimate(b: Floats, C: Floats) -> bool:
    """Also true where the set is a point: then :func:`_leave` says zero."""
    size = float(np.trace(C))
    return size <= 0 or float(b @ b) <= AT_THE_ESTIMATE**2 * size


def _leave(C: Floats) -> Floats:
    """Along the long axis of C, towards +x, or +y when it is upright; zero when C is."""
    values, axes = np.linalg.eigh(C)
    if values[1] <= 0:
        return np.zeros(2)
    axis = axes[:, 1]
    first = axis[0] if abs(axis[0]) > 1e-9 else axis[1]
    return np.asarray(axis * np.sign(first))


def _circle(b: Floats) -> Floats:
    """At right angles to the line of sight −b, to the robot's left."""
    return _unit(np.array([b[1], -b[0]]))


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))
