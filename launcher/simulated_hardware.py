"""What a peer in virtual time has of its own: a clock that runs as it likes, a disk that takes its time, and a body."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from random import Random
from typing import TYPE_CHECKING, Final

from agents.role import Persist, Written

if TYPE_CHECKING:
    from agents.driver import DiscDriver, Ranged
    from protocol.messages import Point
    from protocol.simulated_bus import VirtualTime

WRITING_S: Final = 0.003
"""How long a sound disk takes to keep a promise."""


class SimulatedClock:
    """What a peer reads for the time: another zero, another rate. Never steps back."""

    def __init__(self) -> None:
        self.rate = 1.0
        """Its seconds in a true one."""
        self._true_s = self._shown_s = 0.0

    def read(self, true_s: float) -> float:
        """What it shows."""
        return self._shown_s + self.rate * (true_s - self._true_s)

    def when(self, shown_s: float) -> float:
        """True time from which on it shows at least this; for now or later."""
        true_s = self._true_s + (shown_s - self._shown_s) / self.rate
        while self.read(true_s) < shown_s:  # it rounds
            true_s = math.nextafter(true_s, math.inf)
        return true_s

    def change(self, rate: float, true_s: float, ahead_s: float | None = None) -> None:
        """Run at another rate from now on; step ahead of true time by so much, if that is given."""
        self._shown_s = self.read(true_s) if ahead_s is None else true_s + ahead_s
        self._true_s, self.rate = true_s, rate


class SimulatedDisk:
    """Keeps the last content written, whole or not at all. What has been acknowledged stays when the power fails.

    Args:
        time: the clock that completions are put on.
        seed: of what becomes of a write that is under way when the power fails.
    """

    def __init__(self, time: VirtualTime, seed: str) -> None:
        self.content: bytes | None = None
        self.takes_s = WRITING_S
        self.full = False
        self._time = time
        self._chance = Random(seed)
        self._under_way: dict[int, bytes] = {}
        self._writes = 0

    def write(self, what: Persist, done: Callable[[Written], None]) -> None:
        """Put this in place of what is there, which takes a while; then say so."""
        self._writes += 1
        if not self.full:
            self._under_way[self._writes] = what.content
        self._time.call_at(self._time.now_s + self.takes_s, self._finish, self._writes, what.token, self.full, done)

    def fail(self) -> None:
        """The power is gone: what is under way may have been written, or not."""
        for content in self._under_way.values():
            if self._chance.random() < 0.5:
                self.content = content
        self._under_way.clear()

    def _finish(self, write: int, token: int, full: bool, done: Callable[[Written], None]) -> None:
        content = self._under_way.pop(write, None)
        if content is not None:
            self.content = content
            done(Written(token))
        elif full:
            done(Written(token, "no space left on device"))


class TrueBody:
    """A body as the mind has it: it moves by true time, and never for longer than it was told by either clock."""

    def __init__(self, body: DiscDriver, time: VirtualTime, clock: SimulatedClock) -> None:
        self.until_s = -math.inf
        """When it stands if it is told nothing more."""
        self._body, self._time, self._clock = body, time, clock

    def advance(self, _now_s: float) -> None:
        """Bring it up to date, whatever the mind's clock shows."""
        self._body.advance(self._time.now_s)

    def pose(self) -> Point:
        """Where it is."""
        return self._body.pose()

    def ranges(self) -> Sequence[Ranged]:
        """What its radio has measured."""
        return self._body.ranges()

    def drive(self, velocity: Point, for_s: float) -> None:
        """Set it in motion for so long by the mind's clock."""
        for_s = min(for_s, for_s / self._clock.rate)
        self.until_s = self._time.now_s + for_s if velocity != (0.0, 0.0) else -math.inf
        self._body.drive(velocity, for_s)
