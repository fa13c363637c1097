"""The part of a mind that shares the estimate of an independent agent with all other voters.

Peers exchange ranges, not estimates (:mod:`estimation.shared_ranges`): each says what it has measured at once, and
which ranges it has once a second; who lacks some is sent them (:mod:`protocol.shared_estimate`), or, where nobody keeps
them any more, the set that they left. Whatever is lost, doubled or late, the agent is inside every peer's set; and
when all have the same ranges they have the same set, to the last bit.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Final

import shapely

from agents.mission import Mission
from agents.range_message import (
    MOST_RANGES,
    MOST_SOURCES,
    Vetting,
    base_to_wire,
    digest_to_wire,
    range_to_wire,
    source_of,
)
from agents.records import Estimate
from agents.rhythm import Rhythm
from agents.role import Effect, Event, Heard, Publish, Record, Woken
from agents.sighted_set import Sight, SightedSet
from agents.target_set import TargetSet
from estimation.range_log import TimedRange
from estimation.shared_ranges import SharedRanges
from protocol.messages import Point, RangeBase, RangeDigest, Ranges
from protocol.shared_estimate import BASE, Debts

DIGEST_S: Final = 1.0
"""Time between two digests."""

RECORD_S: Final = 0.5
"""Each peer records its set so often; all at the same moments, so that they can be compared."""

FLIGHT_S: Final = 0.3
"""Ranges younger than this when somebody said which it has may have been on their way to it."""

KEPT_S: Final = 3.0
"""Ranges stay in the log so long even if everybody has them: what is compared between peers is no older."""

SETTLED_S: Final = 2.0
"""Ranges this old should have come to everybody, so that the logs up to then can be compared."""

HORIZON_S: Final = 30.0
"""Ranges are waited for, and kept for who lacks them, for so long; who was away longer gets a base."""

REPEATED: Final = 3
"""Each message with a new range has the last ones again: loss costs area until the next digest."""

TOLERANCE_M: Final = 1e-6
"""Rounding in outlines."""


class SharedEstimate:
    """Keeps one peer's copy of the team's ranges, and says what others need of it.

    Args:
        mission: roster, rates, speed of the agent, how far clocks can be apart.
        name: of this peer.
        incarnation: of its process; its ranges count from 0 anew with each.
        sight: of the map.
        horizon_s: how long ranges are waited for.
    """

    hears = frozenset({"ranges", "range_digest", "range_base"})

    def __init__(
        self, mission: Mission, name: str, incarnation: int, sight: Sight, *, horizon_s: float = HORIZON_S
    ) -> None:
        self._vetting = Vetting(mission, sight)
        voters = [entry.name for entry in mission.roster if entry.role != "tracked_agent"]
        self._ranges: SharedRanges[SightedSet] = SharedRanges(
            name,
            voters,
            lambda: SightedSet(sight),
            speed_m_s=mission.agent_speed_m_s,
            clock_bound_s=mission.ranging.clock_bound_s,
            horizon_s=horizon_s,
            source=source_of(name, incarnation),
        )
        others = [voter for voter in voters if voter != name]
        self._debts = Debts(others, f"{mission.seed}/{name}/{incarnation}/turns")
        share = voters.index(name) / len(voters)
        self._digest = Rhythm(DIGEST_S, DIGEST_S * (share - 1.0))
        self._joining, self._asks_s = True, math.inf
        """Whether it has yet to hear what others have; from when on it says a digest out of turn."""
        self._recording = Rhythm(RECORD_S, 0.0)
        self._own: deque[TimedRange] = deque(maxlen=REPEATED)
        self.newest_s = -math.inf
        """When the newest range was measured that it knows of."""
        self._said_s = -math.inf
        self._refused = 0

    @property
    def next_s(self) -> float:
        """When a digest, an answer or a record is due."""
        return min(self._digest.next_s, self._asks_s, self._debts.next_s, self._recording.next_s)

    def handle(self, event: Event, now_s: float) -> Iterator[Effect]:
        """Take in what others say; answer and say what is due."""
        match event:
            case Woken():
                if self._digest.due(now_s) or now_s >= self._asks_s:
                    self._asks_s = math.inf
                    yield from self._sum_up(now_s)
                yield from self._answer(now_s)
                if self._recording.due(now_s) and (target := self.target(now_s)) is not None:
                    yield Record(self._describe(target, now_s))
            case Heard(address, envelope):
                match envelope.body:
                    case Ranges():
                        self._receive(envelope.body, now_s)
                    case RangeDigest():
                        self._compare(address.speaker, envelope.incarnation, envelope.body, now_s)
                    case RangeBase():
                        self._adopt(envelope.body, now_s)

    def measured(self, anchor: Point, range_m: float, bound_m: float, now_s: float) -> Iterable[Effect]:
        """Share a range of this peer's own, unless there can be none such on the map.

        Args:
            anchor: where from.
            range_m: to where the agent is now, metres.
            bound_m: by which that is wrong at most.
            now_s: this peer's mission time.
        """
        if not self._vetting.is_measure(range_m, bound_m):  # the answer came from somebody else, or was damaged
            self._refused += 1
            return ()
        self._said_s = max(now_s, self._said_s)
        self._own.append(self._ranges.record(self._said_s, anchor, range_m, bound_m))
        self.newest_s = max(self.newest_s, self._said_s)
        return (Publish(Ranges(ranges=tuple(map(range_to_wire, self._own)))),)

    def target(self, now_s: float) -> TargetSet | None:
        """Where the agent may be, as this peer knows; None before it has heard of any range."""
        sketch = self._ranges.state_at(now_s).sketch
        return None if sketch is None else replace(sketch, time_s=now_s, newest_s=self.newest_s)

    def contains(self, point: Point, now_s: float) -> bool:
        """Whether the agent may be at a point; anywhere before any range."""
        region = self._ranges.state_at(now_s).region
        return region is None or bool(shapely.dwithin(region, shapely.Point(point), TOLERANCE_M))

    @property
    def ranges(self) -> SharedRanges[SightedSet]:
        """The log behind it; to be read."""
        return self._ranges

    def _sum_up(self, now_s: float) -> Iterator[Effect]:
        """Fold, and say which ranges there are."""
        self._said_s = max(now_s, self._said_s)
        self._ranges.fold(now_s, KEPT_S)
        yield Publish(digest_to_wire(self._ranges.digest(self._said_s)))

    def _describe(self, target: TargetSet, now_s: float) -> Estimate:
        ranges = self._ranges
        compared_s = float(math.floor(now_s - SETTLED_S))
        return Estimate(
            center=target.center,
            area_m2=target.area_m2,
            age_s=now_s - target.newest_s,
            rings=target.rings,
            made=ranges.made,
            heard=sum(have.below + len(have.beyond) for have in ranges.log.heard.values()),
            held=len(ranges.log),
            folded=ranges.folded,
            late=ranges.late,
            refused=self._refused,
            compared_s=compared_s,
            fingerprint=ranges.fingerprint(compared_s),
        )

    def _receive(self, said: Ranges, now_s: float) -> None:
        known = set(self._ranges.log.heard)
        fit = []
        for said_one in said.ranges:
            record = self._vetting.range(said_one, now_s)
            if record is not None and (record.peer in known or len(known) < MOST_SOURCES):
                known.add(record.peer)
                fit.append(record)
        self._refused += len(said.ranges) - len(fit)
        self._debts.settle((record.peer, record.number) for record in fit)
        if self._ranges.receive(fit, now_s):
            self.newest_s = max(self.newest_s, *(record.time_s for record in fit))

    def _compare(self, peer: str, start: int, said: RangeDigest, now_s: float) -> None:
        """Owe a peer what it lacks by its digest."""
        digest = self._vetting.digest(said, peer, start, now_s)
        if digest is None:
            self._refused += 1
            return
        self._ranges.note(digest)
        if self._joining and digest.heard:
            # Its own first digest may have been said before it was linked with anybody who has what it lacks.
            self._joining, self._asks_s = False, now_s
        lacks: list[tuple[str, int]] = [BASE] if self._ranges.needs_base(digest) else []
        lacks += [
            (record.peer, record.number)
            for record in self._ranges.delta(digest)
            if record.time_s < digest.clock_s - FLIGHT_S
        ]
        self._debts.owe(peer, lacks, now_s)

    def _adopt(self, said: RangeBase, now_s: float) -> None:
        base = self._vetting.base(said, now_s)
        if base is None or len(self._ranges.log.heard.keys() | base.heard.keys()) > MOST_SOURCES:
            self._refused += 1
            return
        self._debts.settle([BASE])
        if self._ranges.adopt(base):
            self.newest_s = max(self.newest_s, base.key[0])

    def _answer(self, now_s: float) -> Iterator[Effect]:
        """Say what others lack, if it is this peer's turn."""
        owed = self._debts.pay(now_s, MOST_RANGES)
        if BASE in owed and (base := self._ranges.base()) is not None:
            yield Publish(base_to_wire(base))
        if owed:
            held = {(record.peer, record.number): record for record in self._ranges.log}
            said = [range_to_wire(held[record]) for record in owed if record in held]
            if said:
                yield Publish(Ranges(ranges=tuple(said)))
