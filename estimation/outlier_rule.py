"""What a set of possible positions does about ranges that contradict it; the same for ellipsoids and for polygons.

*Reject*: a range is corrupt if no point of the set is at such a distance. It is left out; after three in a row the set
itself must be wrong, through a corrupt range that went unnoticed, and begins again from the last one. (Thesis §2.5 goes
on fusing through k < 0, which leaves no set at all: corrected.)

*Relaxed*: in every block of so many ranges at most q are taken to be corrupt, and the points that violate at most q of
them are kept. With S₀ ⊆ S₁ ⊆ … ⊆ S_q, S_k the points that violate at most k so far, and A what the next range leaves,

    S_k ← (S_k ∩ A) ∪ (S_{k−1} ∖ A),

which needs no list of past ranges and no choice of subsets. S_q is the answer; at the end of a block it is where all
levels begin again. Until more than q ranges have come it is the whole plane, so there is no answer yet.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, Literal, Protocol, TypeVar

from estimation.range_measurement import Annulus, MeasurementReport

REJECTIONS_BEFORE_RESTART = 3
"""After so many ranges in a row that contradict the set, it is the set that is wrong."""

SetT = TypeVar("SetT")


class Operations(Protocol[SetT]):
    """What a rule asks of a kind of set. None stands for the empty set; no set is changed in place."""

    def begin(self, annulus: Annulus) -> SetT:
        """The set of a first range; the annulus is not empty."""

    def cut(self, held: SetT, annulus: Annulus) -> SetT | None:
        """What the annulus leaves of a set; the very same object if nothing changes."""

    def cut_or(self, held: SetT | None, fallback: SetT, annulus: Annulus) -> SetT:
        """An outer bound of (held ∩ A) ∪ (fallback ∖ A), fallback ⊆ held; held = None is the whole plane here."""

    def grow(self, held: SetT, distance_m: float) -> SetT:
        """The set after the target has moved at most so far."""


@dataclass(frozen=True, slots=True)
class Relaxation:
    """q-relaxed intersection: in every block of so many ranges, at most so many are corrupt.

    Unlike with rejection, the target stays inside even if a corrupt range leaves the set nonempty, for as long as the
    promise is kept. A set that comes out empty begins again: the promise was broken.

    Source: L. Jaulin, "Robust set-membership state estimation", doi:10.1016/j.automatica.2008.06.013.

    Raises:
        ValueError: q is not at least 1 and less than the block.
    """

    tolerated: int = 2
    """q."""
    block: int = 12
    """Ranges in a block."""

    def __post_init__(self) -> None:
        if not 1 <= self.tolerated < self.block:
            raise ValueError(
                f"{self.tolerated} corrupt ranges in a block of {self.block} cannot be told from right ones: "
                "tolerate at least 1 and less than the block holds"
            )


class RejectingRule(Generic[SetT]):
    """Leave out what contradicts the set; begin again after three in a row."""

    def __init__(self, operations: Operations[SetT]) -> None:
        self._operations = operations
        self.rejections = 0
        """Ranges left out in a row."""
        self.held: SetT | None = None

    def reset(self, held: SetT | None = None, rejections: int = 0) -> None:
        """Go on from a set, or from nothing."""
        self.held, self.rejections = held, rejections

    def measure(self, annulus: Annulus) -> MeasurementReport:
        """Take a range into account, or leave it out."""
        possible = annulus.outer >= 0.0
        if self.held is None:
            if possible:
                self.reset(self._operations.begin(annulus))
            return MeasurementReport(accepted=possible, redundant=False, empty=not possible, restarted=False)
        rest = self._operations.cut(self.held, annulus) if possible else None
        if rest is not None:
            redundant = rest is self.held
            self.reset(rest)
            return MeasurementReport(accepted=True, redundant=redundant, empty=False, restarted=False)
        self.rejections += 1
        restarted = possible and self.rejections >= REJECTIONS_BEFORE_RESTART
        if restarted:
            self.reset(self._operations.begin(annulus))
        return MeasurementReport(accepted=restarted, redundant=False, empty=True, restarted=restarted)

    def predict(self, distance_m: float) -> None:
        """The target has moved at most so far."""
        if self.held is not None and distance_m > 0.0:
            self.held = self._operations.grow(self.held, distance_m)


class RelaxedRule(Generic[SetT]):
    """Keep the points that violate at most q ranges of a block."""

    def __init__(self, operations: Operations[SetT], relaxation: Relaxation) -> None:
        self._operations = operations
        self._relaxation = relaxation
        self.reset()

    def reset(self, held: SetT | None = None) -> None:
        """Go on from a set, or from nothing."""
        # Levels beyond the number of ranges since the beginning are the whole plane and are not in the list.
        self._levels: list[SetT | None] = [] if held is None else [held] * (self._relaxation.tolerated + 1)
        self._in_block = 0

    @property
    def held(self) -> SetT | None:
        """S_q, None while it is the whole plane."""
        return self._levels[-1] if len(self._levels) > self._relaxation.tolerated else None

    def measure(self, annulus: Annulus) -> MeasurementReport:
        """Take a range into account as far as it can be trusted."""
        before = self.held
        possible = annulus.outer >= 0.0
        old = self._levels
        levels: list[SetT | None] = []
        for k in range(min(len(old) + 1, self._relaxation.tolerated + 1)):
            below = old[k - 1] if k else None
            beyond = k == len(old)
            levels.append(self._beyond(below, annulus) if beyond else self._next(old[k], below, annulus))
        self._levels = levels
        self._in_block += 1
        if len(levels) > self._relaxation.tolerated and levels[-1] is None:
            # An empty S_q: more were corrupt than promised.
            self.reset()
            restarted = before is not None and possible
            if restarted:
                self.reset(self._operations.begin(annulus))
            return MeasurementReport(accepted=restarted, redundant=False, empty=True, restarted=restarted)
        if self._in_block >= self._relaxation.block:
            self.reset(self.held)
        return MeasurementReport(accepted=True, redundant=self.held is before, empty=False, restarted=False)

    def _beyond(self, below: SetT | None, annulus: Annulus) -> SetT | None:
        """The next value of a level that was the whole plane."""
        if annulus.outer < 0.0:
            return below
        if below is None:
            return self._operations.begin(annulus)
        return self._operations.cut_or(None, below, annulus)

    def _next(self, held: SetT | None, below: SetT | None, annulus: Annulus) -> SetT | None:
        """The next value of a level that is bounded, or empty."""
        if held is None:
            return None
        if annulus.outer < 0.0:
            return below
        if below is None:
            return self._operations.cut(held, annulus)
        return self._operations.cut_or(held, below, annulus)

    def predict(self, distance_m: float) -> None:
        """The target has moved at most so far."""
        if distance_m > 0.0:
            grown: dict[int, SetT] = {}
            for level in self._levels:
                if level is not None and id(level) not in grown:
                    grown[id(level)] = self._operations.grow(level, distance_m)
            self._levels = [None if level is None else grown[id(level)] for level in self._levels]


Outliers = Literal["reject", "relaxed"] | Relaxation
"""How to choose a rule; "relaxed" is Relaxation() as it comes."""


def make_rule(operations: Operations[SetT], outliers: Outliers) -> RejectingRule[SetT] | RelaxedRule[SetT]:
    """The rule of that name, holding nothing yet.

    Raises:
        ValueError: no such rule.
    """
    if outliers == "reject":
        return RejectingRule(operations)
    if outliers == "relaxed":
        return RelaxedRule(operations, Relaxation())
    if isinstance(outliers, Relaxation):
        return RelaxedRule(operations, outliers)
    raise ValueError(f'outliers are handled by "reject", "relaxed" or a Relaxation(…), not by {outliers!r}')
