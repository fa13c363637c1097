"""A tight set as numbers: all that another peer needs to go on with it, exactly as it is here."""

from __future__ import annotations

from dataclasses import dataclass

Point = tuple[float, float]

UNCHECKED_M = 1e7
"""Wider than any piece: in place of the infinite width of pieces that have not been checked, which JSON cannot say."""


@dataclass(frozen=True, slots=True)
class TightPiece:
    """A convex polygon of the set.

    Attributes:
        corners: counter-clockwise, metres, from the origin of the set.
        checked_m: how wide it was when all remembered annuli were cut out of it.
    """

    corners: tuple[Point, ...]
    checked_m: float


@dataclass(frozen=True, slots=True)
class TightSnapshot:
    """See `estimation.tight_set.TightSet.snapshot`.

    Attributes:
        origin: of the frame, metres, map frame.
        pieces: of the set.
        annuli: those remembered, the oldest first: x, y, inner and outer radius, metres, from the origin.
        rejections: ranges in a row that contradicted the set.
    """

    origin: Point
    pieces: tuple[TightPiece, ...]
    annuli: tuple[tuple[float, float, float, float], ...]
    rejections: int
