"""What a certificate finds: one rule broken for one stretch of time, and how it says so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

Kind = Literal["wall", "collision", "speed", "connection", "progress"]


@dataclass(frozen=True, slots=True)
class Violation:
    """One rule broken for one stretch of time."""

    time_s: float
    """When it begins, on the nominal clock."""
    until_s: float
    """When it ends; inf if it lasts."""
    kind: Kind
    members: tuple[str, ...]
    """Whom it concerns: one at walls and for speed, else two; of a parted team two on either side of the break."""
    text: str
    """One sentence."""
    stage: int | None = None
    """The first of the two stages in which it can happen, counted from 0; None for what does not depend on stages."""


def name_parts(members: Sequence[str], parts: Sequence[int], lost: Sequence[tuple[int, int]]) -> tuple[str, str]:
    """Of a network in parts: the clause about the links that were lost, empty without any, and the list of parts.

    Args:
        members: all names.
        parts: of each member, numbered from 0.
        lost: rows of members whose link it was.
    """
    joined = [
        " + ".join(name for name, label in zip(members, parts, strict=True) if label == part)
        for part in range(max(parts) + 1)
    ]
    return ", ".join(f"{members[i]} and {members[j]}" for i, j in lost), " | ".join(joined)
