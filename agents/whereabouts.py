"""Where the agent may be, now and some metres on: what deployments and motions are planned for.

One concept for both kinds of agents. One that announces is at one place, and goes one way. An independent one may be at
any place of a set, and may go anywhere from there (:mod:`agents.roaming`): so it has many ways, some likelier than
others. How long a chain holds is asked for each way, and counts by its chance; what the last relay is to see is said by
*aims*, each a number of places.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.foresight import length, walk
from protocol.messages import Point

Floats = NDArray[np.float64]

PREVIEWS_M: Final = (0.0, 1.5, 4.0, 8.0, 16.0)
"""How far ahead on the agent's path the proposed chains reach."""

PIECE_M: Final = 0.5
"""Whether a relay sees the agent's way is asked so often."""


@dataclass(frozen=True, eq=False)
class Aim:
    """What a chain is for: places to see."""

    places: Floats
    """(m, 2) float, metres: the last relay is to see them all."""
    shares: Floats
    """(m,) float, of sum 1: what each counts for where no last relay sees all; the link is measured to those that count
    for something."""
    ahead_m: float
    """So far the agent has to go until it is at the farthest of them."""
    whole: str
    """What is seen by who sees all of them, in words."""
    part: str
    """What by who sees some that count for something."""


@dataclass(frozen=True, eq=False)
class Whereabouts:
    """Where the agent may be."""

    center: Point
    """In the middle of where it is."""
    ways: tuple[Floats, ...]
    """(m, 2) float each, metres: the ways that it may take, from where it may be to where it would stop."""
    chances: Floats
    """(number of ways,) float: how likely each is taken; of sum 1."""
    aims: tuple[Aim, ...]
    """What chains are considered for; the first for where it is now, all others for later."""
    announced: bool
    """Whether it takes that way for certain."""


def announce(way: Sequence[Point] | Floats) -> Whereabouts:
    """Of an agent that is on a way (m, 2), metres, m ≥ 1, at its beginning."""
    points = np.asarray(way, dtype=np.float64).reshape(-1, 2)
    here = name_place(points[0])
    aims = []
    for ahead_m in sorted({min(preview, length(points)) for preview in PREVIEWS_M}):
        pieces = walk(points, np.linspace(0.0, ahead_m, 1 + math.ceil(ahead_m / PIECE_M)))
        shares = np.zeros(len(pieces))
        shares[-1] = 1.0
        part = f"for the agent {ahead_m:.1f} m on from {here}" if ahead_m > 0.0 else f"for the agent at {here}"
        whole = f"for the agent at {here} and all its way {ahead_m:.1f} m on" if ahead_m > 0.0 else part
        aims.append(Aim(pieces, shares, ahead_m, whole, part))
    center = (float(points[0, 0]), float(points[0, 1]))
    return Whereabouts(center, (points,), np.ones(1), tuple(aims), announced=True)


def name_place(point: Point | Floats) -> str:
    """A place in words, to the centimetre."""
    x, y = (round(float(value), 2) for value in point)
    return f"({x:.12g}, {y:.12g}) m"
