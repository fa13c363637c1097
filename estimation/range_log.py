"""A grow-only set of time-stamped ranges, and what is needed to bring two of them together with few bytes (spec E9).

Every range is named by its peer and a number; a peer numbers its ranges 0, 1, 2, … and its times never fall. Two logs
are merged by union, so merging is commutative, associative and idempotent: loss, duplicates, delays and any order do no
harm as long as something gets through in the end. What a log has is summed up per peer as "all below n, and these", so
that a peer that reads the other's summary sends exactly what it lacks, about 40 bytes a range.

The *canonical order* is by (time, peer, number). Whoever replays equal logs in it gets equal sets.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right, insort
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from hashlib import blake2b
from operator import attrgetter
from struct import pack

Key = tuple[float, str, int]
"""Place of a range in the canonical order: time, peer, number."""


class BadRecord(ValueError):
    """A record that no peer can have made; the text says what is wrong with it and what to do."""


@dataclass(frozen=True, slots=True)
class TimedRange:
    """One range, as it is shared.

    Attributes:
        peer: who measured it; another name after every start, since a peer that starts again counts from 0.
        number: the peer's own count of its ranges, from 0.
        time_s: when, by the peer's clock, seconds of mission time.
        anchor: where the peer was, metres, map frame.
        range_m: what it measured, metres.
        bound_m: ε, or (below, above), metres.

    Raises:
        BadRecord: a number is negative or not finite.
    """

    peer: str
    number: int
    time_s: float
    anchor: tuple[float, float]
    range_m: float
    bound_m: float | tuple[float, float]

    def __post_init__(self) -> None:
        bounds = self.bound_m if isinstance(self.bound_m, tuple) else (self.bound_m,)
        numbers = (self.time_s, *self.anchor, self.range_m, *bounds)
        if self.number < 0 or min(bounds) < 0 or not all(math.isfinite(number) for number in numbers):
            raise BadRecord(f"{self} is no range: its numbers must be finite, and number and bound at least 0")

    @property
    def key(self) -> Key:
        """Place in the canonical order."""
        return self.time_s, self.peer, self.number

    @property
    def fingerprint(self) -> int:
        """Of all of it, less than 2⁴⁸; the same everywhere."""
        below, above = self.bound_m if isinstance(self.bound_m, tuple) else (self.bound_m, self.bound_m)
        numbers = pack("<Q6d", self.number, self.time_s, *self.anchor, self.range_m, below, above)
        return int.from_bytes(blake2b(self.peer.encode() + numbers, digest_size=6).digest(), "little")


@dataclass(frozen=True)
class Heard:
    """Which ranges of one peer somebody has: all numbers below ``below``, and those in ``beyond``."""

    below: int = 0
    beyond: frozenset[int] = frozenset()

    def __contains__(self, number: int) -> bool:
        return number < self.below or number in self.beyond

    def and_number(self, number: int) -> Heard:
        """With one more; the same object when there is nothing to add."""
        return self if number in self else _compact(self.below, self.beyond | {number})

    def merged(self, other: Heard) -> Heard:
        """With all that either has."""
        return _compact(max(self.below, other.below), self.beyond | other.beyond)


def _compact(below: int, beyond: Iterable[int]) -> Heard:
    rest = {number for number in beyond if number >= below}
    while below in rest:
        rest.remove(below)
        below += 1
    return Heard(below, frozenset(rest))


class RangeLog:
    """The ranges that a peer holds, in canonical order, and all that it has ever heard of."""

    def __init__(self, ranges: Iterable[TimedRange] = ()) -> None:
        self._ranges: list[TimedRange] = []
        self._heard: dict[str, Heard] = {}
        for record in ranges:
            self.add(record)

    def __len__(self) -> int:
        return len(self._ranges)

    def __iter__(self) -> Iterator[TimedRange]:
        return iter(self._ranges)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, RangeLog) and self._ranges == other._ranges and self._heard == other._heard

    __hash__ = None  # type: ignore[assignment]

    @property
    def heard(self) -> Mapping[str, Heard]:
        """What it has, per peer, ranges given up or folded included."""
        return dict(self._heard)

    def has(self, record: TimedRange) -> bool:
        """Whether it has heard this range."""
        return record.number in self._heard.get(record.peer, _NOTHING)

    def add(self, record: TimedRange) -> bool:
        """Add one range; False when it was there. O(log n) and a shift."""
        if self.has(record):
            return False
        insort(self._ranges, record, key=attrgetter("key"))
        self.skip(record)
        return True

    def skip(self, record: TimedRange) -> None:
        """Count a range as heard without holding it: nobody is to send it again."""
        self._heard[record.peer] = self._heard.get(record.peer, _NOTHING).and_number(record.number)

    def skip_below(self, peer: str, number: int) -> None:
        """Count a peer's ranges below a number as heard: those that are missing would come too late."""
        self._heard[peer] = self._heard.get(peer, _NOTHING).merged(Heard(number))

    def merge(self, other: RangeLog) -> None:
        """Take in all that another log has: union. Commutative, associative, idempotent."""
        for record in other:
            self.add(record)
        for peer, heard in other._heard.items():
            self._heard[peer] = self._heard.get(peer, _NOTHING).merged(heard)

    def missing_in(self, heard: Mapping[str, Heard]) -> list[TimedRange]:
        """The ranges held here that somebody who has heard those lacks, in canonical order: a delta."""
        return [record for record in self._ranges if record.number not in heard.get(record.peer, _NOTHING)]

    def after(self, key: Key | None) -> list[TimedRange]:
        """Ranges after a place in the canonical order, in that order."""
        return self._ranges[0 if key is None else bisect_right(self._ranges, key, key=attrgetter("key")) :]

    def before_time(self, time_s: float) -> list[TimedRange]:
        """Ranges stamped before a time, in canonical order."""
        return self._ranges[: bisect_left(self._ranges, time_s, key=attrgetter("time_s"))]

    def release(self, count: int) -> None:
        """Hold the first so many no longer; they stay heard."""
        del self._ranges[:count]


_NOTHING = Heard()
