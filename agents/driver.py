"""The seam to a body: where it is, and how it shall move.

A real robot implements :class:`RobotDriver` over its own drive and radio; :class:`DiscDriver` is the body built in.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from planning.environment import Environment
from protocol.messages import Point


def patience_s(control_hz: float) -> float:
    """How long a body obeys a command that a mind at this rate does not renew."""
    return max(0.5, 3.0 / control_hz)


@dataclass(frozen=True, slots=True)
class Ranged:
    """A radio of this body has measured how far the tracked agent is from where the body was then."""

    anchor: Point
    range_m: float
    bound_m: float
    """The distance to where the agent is by now is within this of ``range_m``: what it can have walked since counts."""


class RobotDriver(Protocol):
    """A body in the plane."""

    def advance(self, now_s: float) -> None:
        """Let mission time pass until ``now_s``. Hardware moves by itself and does nothing here."""

    def pose(self) -> Point:
        """Where the body is: metres, map frame."""

    def ranges(self) -> Sequence[Ranged]:
        """What its radio has measured since this was asked last, in line of sight.

        No more often than the mission's ``ranging.rate_hz``, lest the others take it for made up.
        """

    def drive(self, velocity: Point, for_s: float) -> None:
        """Move at ``velocity`` (m/s, map frame) for at most ``for_s``, then stand: a mind that hangs drives no body."""


class DiscDriver:
    """A disc that turns on the spot and has no inertia, in an environment that it does not leave.

    Args:
        position: where it starts; metres, map frame.
        speed_limit_m_s: a faster command is scaled down to this speed.
        free: where the centre of the disc may be, which is the map inflated by its radius; None: anywhere.
    """

    def __init__(self, position: Point, speed_limit_m_s: float, free: Environment | None = None) -> None:
        self._position = position
        self._speed_limit_m_s = speed_limit_m_s
        self._free = free
        self._velocity: Point = (0.0, 0.0)
        self._drives_until_s = -math.inf
        self._now_s = -math.inf

    def advance(self, now_s: float) -> None:
        """Integrate the command until ``now_s``; what would leave the free space ends at its border. O(walls)."""
        self._position = self.place_at(now_s)
        self._now_s = max(now_s, self._now_s)

    def place_at(self, time_s: float) -> Point:
        """Where it is at a time, now or later, if it is told nothing more. Changes nothing."""
        moves_s = min(time_s, self._drives_until_s) - self._now_s
        if moves_s <= 0.0 or self._velocity == (0.0, 0.0):
            return self._position
        (x, y), (u, v) = self._position, self._velocity
        wanted = (x + u * moves_s, y + v * moves_s)
        if self._free is None or self._free.line_of_sight(self._position, wanted):
            return wanted
        return _last_visible(self._free, self._position, wanted)

    def pose(self) -> Point:
        """Where the centre of the disc is at the time it was last advanced to."""
        return self._position

    def ranges(self) -> Sequence[Ranged]:
        """Nothing: the radio built in is the agent's process, which is asked over the bus (:mod:`agents.ranging`)."""
        return ()

    def drive(self, velocity: Point, for_s: float) -> None:
        """Replace the command, from the time it was last advanced to."""
        speed = math.hypot(*velocity)
        scale = min(1.0, self._speed_limit_m_s / speed) if speed > 0.0 else 0.0
        self._velocity = (velocity[0] * scale, velocity[1] * scale)
        self._drives_until_s = self._now_s + for_s


def _last_visible(free: Environment, start: Point, end: Point) -> Point:
    """Farthest point that ``start`` sees on the way to an ``end`` that it does not see, to 2⁻³² of the way."""
    near, far = 0.0, 1.0
    for _ in range(32):
        middle = 0.5 * (near + far)
        if free.line_of_sight(start, _between(start, end, middle)):
            near = middle
        else:
            far = middle
    return _between(start, end, near)


def _between(start: Point, end: Point, share: float) -> Point:
    return start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])
