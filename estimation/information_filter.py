"""The Gaussian baseline: an information filter of ranges, and the control law that goes with it (thesis §2.4.1).

The information filter keeps Y = P⁻¹ and y = P⁻¹ x̂ instead of a mean and covariance (eq. 11, 12), so that ranges add.
As printed it needs three corrections. The information vector is i = Hᵀ R⁻¹ [(z − h(x̂)) + H x̂] (the parenthesis is
misplaced). P stands for the covariance only and Q for the covariance of the process noise (the thesis uses P for both
and leaves Q undefined). And H, not Hᵀ, is the Jacobian of h.

It is what the set filter is compared with, and shows why there is one: it is linearised at its own estimate, so it
needs a first guess, cannot say "either here or there", and its covariance is no promise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.information_control import Limits, check_position, turn_about

Floats = NDArray[np.float64]


class NotInformative(ValueError):
    """Numbers with which a Gaussian cannot be made or updated; the text says which and what to do."""


@dataclass(frozen=True, eq=False)
class InformationFilter:
    """A Gaussian over the target's position, in information form; each operation returns a new one.

    Attributes:
        vector: (2,) float, y = Y x̂, 1/m.
        matrix: (2, 2) float, Y, 1/m²; zero when nothing is known, as the thesis starts.
    """

    vector: Floats
    matrix: Floats

    @classmethod
    def uninformed(cls) -> InformationFilter:
        """Y = 0: nothing is known. Ranges cannot be added to it, since there is no place to linearise at."""
        return cls(np.zeros(2), np.zeros((2, 2)))

    @classmethod
    def from_guess(cls, mean: ArrayLike, covariance: ArrayLike) -> InformationFilter:
        """Start at a guess: mean (2,) float, metres, and covariance (2, 2) float, m², positive definite."""
        x, P = np.asarray(mean, dtype=np.float64), np.asarray(covariance, dtype=np.float64)
        if x.shape != (2,) or not np.isfinite(x).all() or not _is_covariance(P) or np.linalg.eigvalsh(P)[0] <= 0:
            raise NotInformative(
                f"a guess is a finite position (2,) and a positive definite covariance (2, 2), not {x} and {P}"
            )
        Y = np.asarray(np.linalg.inv(P), dtype=np.float64)
        return cls(Y @ x, Y)

    @property
    def known(self) -> bool:
        """Whether there is an estimate: Y can be inverted."""
        return bool(np.linalg.eigvalsh(self.matrix)[0] > 0)

    @property
    def covariance(self) -> Floats:
        """(2, 2) float, m²: P = Y⁻¹. Raises NotInformative while nothing is known."""
        if not self.known:
            raise NotInformative("nothing is known yet, so there is no covariance: start from a guess")
        return np.asarray(np.linalg.inv(self.matrix))

    @property
    def mean(self) -> Floats:
        """(2,) float, metres: x̂ = Y⁻¹ y. Raises NotInformative while nothing is known."""
        return np.asarray(self.covariance @ self.vector)

    def predict(self, process_covariance: ArrayLike, transition: ArrayLike | None = None) -> InformationFilter:
        """Eq. 13 and 14: Y ← (F Y⁻¹ Fᵀ + Q)⁻¹, y ← Y F Y⁻¹ y.

        Args:
            process_covariance: (2, 2) float, m²: Q.
            transition: (2, 2) float: F; the target stands if not given.

        Raises:
            NotInformative: Q is no covariance, or F is not (2, 2) and finite.
        """
        F = np.eye(2) if transition is None else np.asarray(transition, dtype=np.float64)
        Q = np.asarray(process_covariance, dtype=np.float64)
        if F.shape != (2, 2) or not np.isfinite(F).all() or not _is_covariance(Q) or np.linalg.eigvalsh(Q)[0] < 0:
            raise NotInformative(
                f"a prediction takes a covariance and a finite transition, both (2, 2), not {Q} and {F}"
            )
        if not self.known:
            return self
        mean = F @ self.mean
        P = F @ self.covariance @ F.T + Q
        Y = np.asarray(np.linalg.inv(P), dtype=np.float64)
        return InformationFilter(Y @ mean, Y)

    def measure(self, anchors: ArrayLike, ranges: ArrayLike, deviation_m: float) -> InformationFilter:
        """Eq. 15 and 16: add what several ranges at one time say, all linearised at the mean before them.

        Args:
            anchors: (n, 2) float, metres: where the robots were.
            ranges: (n,) float, metres.
            deviation_m: standard deviation of a range; R = deviation². For errors even in ±ε it is ε / √3.

        Raises:
            NotInformative: nothing is known yet, the deviation is not positive, or a number is not finite.
        """
        if not 0 < deviation_m < math.inf:
            raise NotInformative(f"the deviation of a range must be positive and finite, not {deviation_m}")
        places = np.atleast_2d(np.asarray(anchors, dtype=np.float64))
        measured = np.atleast_1d(np.asarray(ranges, dtype=np.float64))
        if places.shape != (len(measured), 2) or not (np.isfinite(places).all() and np.isfinite(measured).all()):
            raise NotInformative(f"ranges (n,) come from places (n, 2), all finite, not {measured} from {places}")
        x = self.mean
        y, Y = self.vector, self.matrix
        for a, z in zip(places, measured, strict=True):
            H, r = _sight(x, a)
            i = H / deviation_m**2 * ((z - r) + H @ x)
            y, Y = y + i, Y + np.outer(H, H) / deviation_m**2
        return InformationFilter(y, Y)

    def direction(self, position: ArrayLike, limits: Limits) -> Floats:
        """The control law of §2.4.1: the gradient of ½ tr(Y⁻¹ I), I = HᵀR⁻¹H, by the robot's position.

        With H = uᵀ, the line of sight, ½ tr(P uuᵀ)/R has the gradient −(I − uuᵀ) P u / (R r): the covariance law, with
        P in the place of the set's covariance, and the same degenerate cases (:mod:`estimation.information_control`).

        Args:
            position: (2,) float, metres, map frame: the robot.
            limits: of the robot.

        Returns:
            (2,) float: a unit vector, or zero.

        Raises:
            NotAnEstimate: the position is not two finite numbers.
        """
        a = check_position(position)
        if not self.known or limits.step_m == 0:
            return np.zeros(2)
        return turn_about(self.mean, self.covariance, a)


def _is_covariance(P: Floats) -> bool:
    """Whether it can be one: (2, 2), finite, symmetric but for rounding."""
    return P.shape == (2, 2) and bool(np.isfinite(P).all()) and bool(np.abs(P - P.T).max() <= 1e-9 * np.abs(P).max())


def _sight(x: Floats, a: Floats) -> tuple[Floats, float]:
    """H = ∂|x − a|/∂x and |x − a|; at the anchor itself H is zero: such a range tells no direction."""
    away = x - a
    r = math.hypot(away[0], away[1])
    return (away / r if r > 1e-9 else np.zeros(2)), r
