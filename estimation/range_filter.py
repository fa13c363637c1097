"""The range filter: an ellipsoid around the target that never lets go of it, from ranges alone.

Thesis §2.2–2.3 with the filter's promise kept: the strip of a range cuts the ellipsoid in closed form instead of by a
search over λ, the paraboloid s = x² + y² is used by a multiplier, and the state is a factor in a frame that follows it
(`estimation.range_cut` holds the formulas). The first range begins it; no guess is asked for.

    f = RangeFilter()
    f.measure((0.0, 0.0), 20.3, 0.5)     # anchor, range, bound: metres
    f.predict(0.1)                       # the target may have moved so far
    f.feasible_set().area_m2
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation import range_cut
from estimation.ellipsoid import Ellipsoid
from estimation.feasible_set import FeasibleSet
from estimation.outlier_rule import Outliers, make_rule
from estimation.range_measurement import Annulus, Bound, MeasurementReport, NothingMeasured, annulus, moved_distance
from estimation.strip_cut import EMPTY, REDUNDANT

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FilterReport(MeasurementReport):
    """What a range did to the ellipsoid.

    Attributes:
        volume_before: volume in (x, y, s = x² + y²), m⁴, inf before the first range.
        volume_after: the same after it.
        weight: the λ of the thesis' fusion (eq. 5) that the cut comes to: 1 if the range changed nothing, 0 if it is
            all there is.
        multiplier: μ of the paraboloid, 1/m²; 0 where none was of use.
    """

    volume_before: float
    volume_after: float
    weight: float
    multiplier: float

    @property
    def volume(self) -> float:
        """Volume after the range, m⁴."""
        return self.volume_after


@dataclass(frozen=True, slots=True)
class FilterSnapshot:
    """All that another peer needs to go on with the set: 14 numbers, exactly as they are here.

    Attributes:
        origin: of the frame, metres, map frame, on a grid of 2⁻¹⁰ m.
        center: (x, y, s), metres and square metres in that frame.
        factor: rows of L, 9 numbers, of {center + L v : |v| ≤ 1}.
    """

    origin: tuple[float, float]
    center: tuple[float, float, float]
    factor: tuple[float, ...]


class _Ellipsoids:
    """Operations of the outlier rules on states of `estimation.range_cut`."""

    def __init__(self) -> None:
        self.weight = self.multiplier = 0.0

    def begin(self, annulus: Annulus) -> Floats:
        state = np.empty(range_cut.STATE)
        range_cut.begin(*annulus, state)
        self.weight = self.multiplier = 0.0
        return state

    def cut(self, held: Floats, annulus: Annulus) -> Floats | None:
        return self._cut(held, annulus.x, annulus.y, annulus.inner**2, annulus.outer**2)

    def cut_or(self, held: Floats | None, fallback: Floats, annulus: Annulus) -> Floats:
        # The fallback lies in the held set, so a strip wide enough for it too is all that the union asks for.
        low, high = range_cut.squared_distances(fallback, annulus.x, annulus.y)
        inner, outer = max(0.0, min(annulus.inner**2, low)), max(annulus.outer**2, high)
        if held is None:
            return self.begin(Annulus(annulus.x, annulus.y, math.sqrt(inner), math.sqrt(outer)))
        rest = self._cut(held, annulus.x, annulus.y, inner, outer)
        return fallback if rest is None else rest

    def _cut(self, held: Floats, x: float, y: float, low: float, high: float) -> Floats | None:
        state = held.copy()
        outcome, self.weight, self.multiplier = range_cut.cut(state, x, y, low, high)
        if outcome == EMPTY:
            return None
        return held if outcome == REDUNDANT else state

    def grow(self, held: Floats, distance_m: float) -> Floats:
        state = held.copy()
        range_cut.grow(state, distance_m)
        return state


class RangeFilter:
    """Set-membership filter on ranges with bounded error (Thesis chapter 2): the target is inside, always.

    Args:
        outliers: "reject": a range that contradicts the set is left out, and after three in a row the set begins again;
            "relaxed" or a `Relaxation`: so many of a block may be corrupt, whether they show or not.

    Raises:
        ValueError: no such way to handle outliers.
    """

    def __init__(self, outliers: Outliers = "reject") -> None:
        self._operations = _Ellipsoids()
        self._rule = make_rule(self._operations, outliers)

    @property
    def started(self) -> bool:
        """Whether anything is known."""
        return self._rule.held is not None

    @property
    def _state(self) -> Floats:
        if self._rule.held is None:
            raise NothingMeasured("no range has bounded the set yet: call measure() first, or ask `started`")
        return self._rule.held

    def measure(self, anchor_xy: ArrayLike, range_m: float, bound_m: Bound) -> FilterReport:
        """Take a range into account.

        Args:
            anchor_xy: (2,) float, where the range was measured from, metres, map frame.
            range_m: z, metres.
            bound_m: ε, or (below, above): the true distance lies in [z − below, z + above].

        Raises:
            BadRange: a number is not finite, or a bound is negative. The set is as it was.
        """
        possible = annulus(anchor_xy, range_m, bound_m)
        before = math.inf if self._rule.held is None else range_cut.volume(self._rule.held)
        report = self._rule.measure(possible)
        after = math.inf if self._rule.held is None else range_cut.volume(self._rule.held)
        used = report.accepted and not report.redundant
        return FilterReport(
            report.accepted,
            report.redundant,
            report.empty,
            report.restarted,
            before,
            after,
            self._operations.weight if used else 1.0,
            self._operations.multiplier if used else 0.0,
        )

    def predict(self, distance_m: float) -> None:
        """The target may have moved by so many metres since; nothing happens before the first range.

        Raises:
            BadRange: the distance is negative or not finite.
        """
        self._rule.predict(moved_distance(distance_m))

    def reset(self) -> None:
        """Forget everything."""
        self._rule.reset()

    @property
    def center(self) -> Floats:
        """(2,) float, the ellipsoid's centre, metres, map frame. Raises NothingMeasured before the first range."""
        return self._state[:2] + self._state[2:4]

    @property
    def volume(self) -> float:
        """Volume in (x, y, s), m⁴. Raises NothingMeasured before the first range."""
        return range_cut.volume(self._state)

    def feasible_set(self) -> FeasibleSet:
        """The points (x, y) with (x, y, x² + y²) in the ellipsoid. Raises NothingMeasured before the first range."""
        state = self._state
        return FeasibleSet(state[:2], state[2:5], state[5:].reshape(3, 3))

    def ellipsoid(self) -> Ellipsoid:
        """The ellipsoid in (x, y, s = x² + y²), metres, map frame. Raises NothingMeasured before the first range.

        Far from the map's origin s is large and the ellipsoid thin, and double precision does not hold both: for
        pictures and for the thesis' metrics, not to go on computing with.
        """
        state = self._state.copy()
        range_cut.move_origin(state, -state[0], -state[1])
        return Ellipsoid.from_factor(state[2:5], state[5:].reshape(3, 3))

    def snapshot(self) -> FilterSnapshot:
        """The set as a value for a message. Raises NothingMeasured before the first range."""
        numbers = self._state.tolist()
        return FilterSnapshot(tuple(numbers[:2]), tuple(numbers[2:5]), tuple(numbers[5:]))

    def restore(self, snapshot: FilterSnapshot) -> None:
        """Go on from a snapshot, with no memory of rejections."""
        self._rule.reset(np.array([*snapshot.origin, *snapshot.center, *snapshot.factor], dtype=np.float64))
