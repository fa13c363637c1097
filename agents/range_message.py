"""Ranges, digests and bases between the wire and the shared log; what no honest peer can have said is left out.

What a peer says may be wrong in any way. A message that does not fit costs itself: a name that has no vote, a place
outside the map, a time that no clock shows yet, a number higher than can have been counted since the mission began.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from agents.mission import Mission
from agents.sighted_set import Sight, SightedSet, Sighting
from estimation.range_log import Heard, Key, TimedRange
from estimation.shared_ranges import Base, Digest
from estimation.tight_set import TightSet
from estimation.tight_snapshot import TightPiece, TightSnapshot
from protocol.messages import ConvexPiece, HeardRanges, Point, RangeBase, RangeDigest, Ring, SharedRange

MOST_RANGES: Final = 32
"""In one message."""

MOST_SOURCES: Final = 128
"""Processes whose ranges are kept apart: peers, and each of their starts."""

MOST_BEYOND: Final = 256
"""Numbers that a digest lists for a source beyond those without a gap; of further ones it says nothing."""

UNCOUNTED: Final = 16
"""By so many a source's numbers may be higher than its clock and rate say."""


BEFORE_S: Final = 10.0
"""Processes begin a little before mission time zero, but no more than this."""


def source_of(owner: str, start: int) -> str:
    """Name of a process' ranges: another one after every start, as each counts from 0."""
    return f"{owner}.{start}"


def range_to_wire(record: TimedRange) -> SharedRange:
    """A range as it is said."""
    owner, start = _parts(record.peer)
    bound_m = max(record.bound_m) if isinstance(record.bound_m, tuple) else record.bound_m
    return SharedRange(
        owner=owner, start=start, number=record.number, time_s=record.time_s, anchor=record.anchor,
        range_m=record.range_m, bound_m=bound_m,
    )  # fmt: skip


def digest_to_wire(digest: Digest) -> RangeDigest:
    """A digest as it is said."""
    return RangeDigest(clock_s=digest.clock_s, heard=_heard_to_wire(digest.heard))


def base_to_wire(base: Base[SightedSet]) -> RangeBase:
    """A base as it is said, exactly."""
    time_s, source, number = base.key
    owner, start = _parts(source)
    held, seen = base.state.tight.snapshot(), base.state.seen
    return RangeBase(
        time_s=time_s,
        owner=owner,
        start=start,
        number=number,
        heard=_heard_to_wire(base.heard),
        fingerprint=base.fingerprint,
        origin=held.origin,
        pieces=tuple(ConvexPiece(corners=piece.corners, checked_m=piece.checked_m) for piece in held.pieces),
        rings=tuple(Ring(center=(x, y), inner_m=inner, outer_m=outer) for x, y, inner, outer in held.annuli),
        rejections=held.rejections,
        anchor=None if seen is None else seen.anchor,
        slack_m=0.0 if seen is None else seen.slack_m,
    )


class Vetting:
    """Takes what others say off the wire, if it can be true.

    Args:
        mission: roster, rates, and how far clocks can be apart.
        sight: of the map.
    """

    def __init__(self, mission: Mission, sight: Sight) -> None:
        self._sight = sight
        self._voters = frozenset(entry.name for entry in mission.roster if entry.role != "tracked_agent")
        self._rate_hz = mission.ranging.rate_hz
        self._clock_bound_s = mission.ranging.clock_bound_s
        self._box = sight.environment.bounds
        x0, y0, x1, y1 = self._box
        self._across_m = math.hypot(x1 - x0, y1 - y0)

    def range(self, said: SharedRange, now_s: float) -> TimedRange | None:
        """The range of a message; None if there can be no such range."""
        fits = (
            said.owner in self._voters
            and self._has_come(said.time_s, now_s)
            and self._counted(said.number, said.time_s)
            and self._is_near(said.anchor, 0.0)
            and self.is_measure(said.range_m, said.bound_m)
        )
        if not fits:
            return None
        source = source_of(said.owner, said.start)
        return TimedRange(source, said.number, said.time_s, said.anchor, said.range_m, said.bound_m)

    def is_measure(self, range_m: float, bound_m: float) -> bool:
        """Whether there can be such a distance on the map, and whether the bound says anything."""
        return bound_m <= self._across_m and range_m <= self._across_m + bound_m

    def digest(self, said: RangeDigest, peer: str, start: int, now_s: float) -> Digest | None:
        """The digest of a message of a peer's process; None if its clock is wrong."""
        if peer not in self._voters or not self._has_come(said.clock_s, now_s):
            return None
        return Digest(peer, said.clock_s, self._heard(said.heard, now_s), source_of(peer, start))

    def base(self, said: RangeBase, now_s: float) -> Base[SightedSet] | None:
        """The base of a message; None if it is none."""
        reach_m = 2.0 * self._across_m
        corners = [(x + said.origin[0], y + said.origin[1]) for piece in said.pieces for x, y in piece.corners]
        fits = (
            said.owner in self._voters
            and self._has_come(said.time_s, now_s)
            and self._counted(said.number, said.time_s)
            and self._is_near(said.origin, reach_m)
            and (said.anchor is None or self._is_near(said.anchor, 0.0))
            and all(self._is_near(corner, reach_m) for corner in corners)
            and len(self._heard(said.heard, said.time_s)) == len(said.heard)
        )
        if not fits:
            return None
        held = TightSnapshot(
            said.origin,
            tuple(TightPiece(piece.corners, piece.checked_m) for piece in said.pieces),
            tuple((*ring.center, ring.inner_m, ring.outer_m) for ring in said.rings),
            said.rejections,
        )
        tight = TightSet()
        try:
            tight.restore(held)
        except ValueError:
            return None
        key: Key = (said.time_s, source_of(said.owner, said.start), said.number)
        seen = None if said.anchor is None else Sighting(tight, said.anchor, said.slack_m)
        return Base(key, SightedSet(self._sight, tight, seen), self._heard(said.heard, said.time_s), said.fingerprint)

    def _heard(self, said: tuple[HeardRanges, ...], now_s: float) -> dict[str, Heard]:
        return {
            source_of(heard.owner, heard.start): Heard(heard.below, frozenset(heard.beyond))
            for heard in said
            if heard.owner in self._voters and self._counted(max(heard.below, *heard.beyond, 0), now_s)
        }

    def _has_come(self, time_s: float, now_s: float) -> bool:
        """Whether some clock of the mission can have shown this time by now."""
        return -BEFORE_S <= time_s <= now_s + self._clock_bound_s

    def _counted(self, number: int, time_s: float) -> bool:
        """Whether a process can have measured so many ranges by then."""
        return number <= self._rate_hz * max(time_s + self._clock_bound_s, 0.0) + UNCOUNTED

    def _is_near(self, place: Point, margin_m: float) -> bool:
        x0, y0, x1, y1 = self._box
        x, y = place
        return x0 - margin_m <= x <= x1 + margin_m and y0 - margin_m <= y <= y1 + margin_m


def _parts(source: str) -> tuple[str, int]:
    owner, _, start = source.rpartition(".")
    return owner, int(start)


def _heard_to_wire(heard: Mapping[str, Heard]) -> tuple[HeardRanges, ...]:
    return tuple(
        HeardRanges(owner=owner, start=start, below=have.below, beyond=tuple(sorted(have.beyond)[:MOST_BEYOND]))
        for (owner, start), have in sorted((_parts(source), have) for source, have in heard.items())
    )
