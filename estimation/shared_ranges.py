"""The shared estimate: every peer holds the ranges of all and replays them in one order (spec E9).

*Containment.* Whatever subset of the true ranges a peer has, and in whatever order they came, its set contains the
target: each range only ever takes away what the target cannot be. *Equality.* Peers with equal logs have equal sets,
rejected ranges and restarts included, since all replay in the canonical order and the filters are deterministic.

*Time.* Sets move in between ranges: a target that may walk v metres a second is predicted by v Δt. Clocks of any two
peers differ by at most ``clock_bound_s``. Take any one peer's clock as the reference: a range stamped t by another was
measured within that bound of the reference's t, when the target was at most v · clock_bound from where it was at t. So
every range's own bound is widened by v · clock_bound, once, and the set at time t contains the target at t *by any
peer's clock*. Growing each prediction by v (Δt + clock_bound) instead is right as well, but adds up over the ranges.

*Memory.* A range is folded into the base, the set in front of the log, once nothing can come before it and every
roster member has it, or a stated horizon has passed. A range that comes after its place was folded is dropped and
counted; that costs area, never containment, and the peers may then differ. Of every name that ever measured a count
stays for ever, some dozen bytes for each start of a peer.

*Away for long.* Who lacks ranges that others hold no longer goes on from their base. Two who each lack folded ranges of
the other's go on from the base that has more; what only the other had folded is lost, which costs area.

All of it is state: no clock, no messages. ``digest`` and ``delta`` are what the team protocol is to carry.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from copy import deepcopy
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from numpy.typing import ArrayLike

from estimation.range_log import BadRecord, Heard, Key, RangeLog, TimedRange

_FINGERPRINTS = 1 << 48
"""So many there are: numbers that every JSON reader holds exactly."""

_TAIL_S = 10.0
"""By so much the bases of peers can end at different times, seconds."""

_MARK_EVERY = 16
"""Ranges between two kept states: a late range costs a replay from the mark before it."""


class Replayed(Protocol):
    """What is replayed: a RangeFilter, a TightSet; anything with these two that depends on nothing else."""

    def measure(self, anchor_xy: ArrayLike, range_m: float, bound_m: float | tuple[float, float], /) -> object:
        """Take a range into account."""

    def predict(self, distance_m: float, /) -> None:
        """The target may have moved so far; nothing before the first range."""


StateT = TypeVar("StateT", bound=Replayed)


@dataclass(frozen=True)
class Digest:
    """What a peer says of itself now and then, so that others send what it lacks and fold what it has.

    Attributes:
        peer: who says it.
        clock_s: its time: no range that it makes from now on is stamped earlier.
        heard: which ranges it has, per peer.
    """

    peer: str
    clock_s: float
    heard: Mapping[str, Heard]
    source: str = ""
    """The name under which its ranges are kept; its own if empty."""


@dataclass(frozen=True)
class Base(Generic[StateT]):
    """The set in front of a log, for a peer that comes back after its horizon; to be copied, not changed.

    Attributes:
        key: the last folded place of the canonical order.
        state: the set at that range's time.
        heard: which ranges need not be sent any more: those folded, and those of their peers before them.
        fingerprint: of the ranges folded.
    """

    key: Key
    state: StateT
    heard: Mapping[str, Heard]
    fingerprint: int = 0


class SharedRanges(Generic[StateT]):
    """One peer's copy of the team's ranges, and the set that they leave.

    Args:
        peer: this peer's name.
        roster: names of all peers, this one included.
        begin: makes the state before any range, for example ``RangeFilter`` or ``TightSet``.
        speed_m_s: v, the most that the target can walk; 0 for one that stands.
        clock_bound_s: the most by which any two peers' clocks differ.
        horizon_s: how long ranges are waited for.
        source: the name under which this peer's ranges are kept: another one after every start, as each counts its
            ranges from 0. The peer's own if empty.

    Raises:
        BadRecord: the peer is not in the roster, or a number is negative.
    """

    def __init__(
        self,
        peer: str,
        roster: Iterable[str],
        begin: Callable[[], StateT],
        *,
        speed_m_s: float = 0.0,
        clock_bound_s: float = 0.0,
        horizon_s: float = 60.0,
        source: str = "",
    ) -> None:
        self._peer, self._roster, self._begin = peer, tuple(roster), begin
        self._speed, self._horizon = speed_m_s, horizon_s
        self._clock_bound, self._widening = clock_bound_s, speed_m_s * clock_bound_s
        if peer not in self._roster or min(speed_m_s, clock_bound_s, horizon_s) < 0:
            raise BadRecord(
                f"'{peer}' must be in the roster {self._roster}, and speed, clock bound and horizon at least 0"
            )
        self._source, self._made = source or peer, 0
        self._log = RangeLog()
        self._digests: dict[str, Digest] = {}
        self._base: tuple[Key | None, StateT] = (None, begin())
        self._marks: list[tuple[Key, StateT]] = []
        self._tail: list[TimedRange] = []
        """The last ones folded: a base that is adopted may end before them."""
        self._now: tuple[Key | None, StateT] = (None, begin())
        self._last_s = -math.inf
        self._late = self._folded = self._fingerprint = 0

    @property
    def made(self) -> int:
        """Ranges that this peer has measured under its present source."""
        return self._made

    @property
    def late(self) -> int:
        """Ranges dropped because their place had been folded."""
        return self._late

    @property
    def folded(self) -> int:
        """Ranges folded into the base so far."""
        return self._folded

    @property
    def log(self) -> RangeLog:
        """The ranges held; to be read."""
        return self._log

    def record(
        self, time_s: float, anchor: tuple[float, float], range_m: float, bound_m: float | tuple[float, float]
    ) -> TimedRange:
        """Add a range that this peer has measured, and return it as it is shared.

        Raises:
            BadRecord: a number is not finite, or the time is before that of the last digest or range.
        """
        if not time_s >= self._last_s:
            raise BadRecord(
                f"{self._peer}: a range at {time_s} s is earlier than what was said at {self._last_s} s: "
                "stamp ranges with a clock that never goes back"
            )
        record = TimedRange(self._source, self._made, time_s, anchor, range_m, bound_m)
        self._last_s, self._made = time_s, self._made + 1
        self.receive([record])
        return record

    def receive(self, records: Iterable[TimedRange], now_s: float = math.inf) -> int:
        """Take in ranges from anywhere, in any order, as often as they come; how many were new and in time.

        Args:
            records: the ranges.
            now_s: this peer's time, seconds. What is stamped later than any clock can show by now is left out, unheard:
                one such range, once folded, would make all that come after it late.
        """
        new = 0
        for record in records:
            if self._log.has(record) or record.time_s > now_s + self._clock_bound:
                continue
            folded_through, _ = self._base
            if folded_through is not None and record.key <= folded_through:
                self._late += 1
                self._log.skip(record)
            elif self._log.add(record):
                new += 1
                self._go_back_before(record.key)
        return new

    def digest(self, now_s: float) -> Digest:
        """What this peer says of itself; no range of it after this may be earlier than ``now_s``."""
        self._last_s = max(self._last_s, now_s)
        return Digest(self._peer, self._last_s, self._log.heard, self._source)

    def delta(self, digest: Digest) -> list[TimedRange]:
        """The ranges that the sender of a digest lacks, in canonical order."""
        return self._log.missing_in(digest.heard)

    def note(self, digest: Digest) -> None:
        """Remember what another peer has; older digests than the last one change nothing, nor do those of strangers."""
        if digest.peer not in self._roster:
            return
        known = self._digests.get(digest.peer)
        if known is None or digest.clock_s >= known.clock_s:
            self._digests[digest.peer] = digest

    def fold(self, now_s: float, keep_s: float = 0.0) -> int:
        """Fold what can be folded at a time of this peer's clock, but nothing younger than so long; how many ranges."""
        own = Digest(self._peer, self._last_s, self._log.heard, self._source)
        digests = [own, *(self._digests.get(peer) for peer in self._roster if peer != self._peer)]
        given_up = count = len(self._log.before_time(now_s - self._horizon))
        said = [digest for digest in digests if digest is not None]
        if len(said) == len(self._roster) and all(self._has_all_of(digest) for digest in said):
            complete = self._log.before_time(min(now_s - keep_s, *(digest.clock_s for digest in said)))
            shared = 0
            for record in complete:
                if not all(record.number in digest.heard.get(record.peer, Heard()) for digest in said):
                    break
                shared += 1
            count = max(count, shared)
        if count:
            self._fold(list(self._log)[:count], given_up)
        return count

    def state_at(self, time_s: float) -> StateT:
        """The set at a time of this peer's clock: a copy, predicted by v |Δt| from the last range."""
        last, state = self._replay()
        state = deepcopy(state)
        if last is not None:
            state.predict(self._speed * abs(time_s - last[0]))
        return state

    def base(self) -> Base[StateT] | None:
        """What a peer needs that has missed folded ranges, besides the log; None before anything was folded."""
        key, state = self._base
        if key is None:
            return None
        held = {(record.peer, record.number) for record in self._log}
        heard = {}
        for peer, have in self._log.heard.items():
            first_held = min((number for owner, number in held if owner == peer), default=have.below)
            heard[peer] = Heard(min(have.below, first_held))
        return Base(key, state, heard, self._fingerprint)

    def adopt(self, base: Base[StateT]) -> bool:
        """Go on from another peer's base, if there is a range in it that this peer lacks. The log after it stays.

        Not if this peer's own base has ranges that the other lacks, and more of them. Ranges before the end of the base
        that it does not include are dropped, and those of the log counted as late.
        """
        if not self._lacks(base.heard):
            return False
        own = self.base()
        if own is not None and _misses(base.heard, own.heard) and _rank(own) >= _rank(base):
            return False
        known = [*self._tail, *self._log]
        kept = [record for record in known if record.key > base.key]
        dropped = [record for record in self._log if record.key <= base.key]
        self._late += sum(record.number not in base.heard.get(record.peer, Heard()) for record in dropped)
        self._log = RangeLog(kept)
        for peer, heard in base.heard.items():
            self._log.skip_below(peer, heard.below)
        self._tail = []
        self._base = base.key, deepcopy(base.state)
        self._fingerprint = base.fingerprint
        self._marks = []
        self._now = base.key, deepcopy(base.state)
        return True

    def needs_base(self, digest: Digest) -> bool:
        """Whether the sender of a digest lacks ranges that have been folded here, so that no delta brings them."""
        base = self.base()
        return base is not None and _misses(digest.heard, base.heard)

    def fingerprint(self, before_s: float) -> int | None:
        """A number for all ranges stamped before a time: peers with equal ones have equal sets.

        None where ranges from then on have been folded already. O(ranges held).
        """
        key, _ = self._base
        if key is not None and key[0] >= before_s:
            return None
        return (
            sum((record.fingerprint for record in self._log.before_time(before_s)), self._fingerprint) % _FINGERPRINTS
        )

    def _lacks(self, heard: Mapping[str, Heard]) -> bool:
        return _misses(self._log.heard, heard)

    def _has_all_of(self, digest: Digest) -> bool:
        """Whether all ranges that a peer had made when it said so are here."""
        source = digest.source or digest.peer
        return self._log.heard.get(source, Heard()).below >= digest.heard.get(source, Heard()).below

    def _fold(self, records: list[TimedRange], given_up: int) -> None:
        key, state = self._base
        end = records[-1].key
        passed = [mark for mark in self._marks if mark[0] <= end]
        if passed:
            key, state = passed[-1][0], deepcopy(passed[-1][1])
        for record in records:
            if key is None or record.key > key:
                key = self._step(key, state, record)
        for record in records[:given_up]:
            # A peer's times rise with its numbers: what is missing before this one would be late as well.
            self._log.skip_below(record.peer, record.number)
        self._base = end, state
        self._marks = self._marks[len(passed) :]
        if self._now[0] is None or self._now[0] < end:
            self._now = end, deepcopy(state)
        self._log.release(len(records))
        self._tail = [record for record in (*self._tail, *records) if record.time_s > end[0] - _TAIL_S]
        self._folded += len(records)
        self._fingerprint = sum((record.fingerprint for record in records), self._fingerprint) % _FINGERPRINTS

    def _go_back_before(self, key: Key) -> None:
        """Forget the states that a range at this place changes."""
        if self._now[0] is not None and self._now[0] > key:
            self._marks = [mark for mark in self._marks if mark[0] < key]
            last, state = self._marks[-1] if self._marks else self._base
            self._now = last, deepcopy(state)

    def _replay(self) -> tuple[Key | None, StateT]:
        """Bring the current state up to the end of the log."""
        key, state = self._now
        pending = self._log.after(key)
        if not pending:
            return self._now
        last_mark = self._marks[-1][0] if self._marks else self._base[0]
        since = len(self._log.after(last_mark)) - len(pending)
        for record in pending:
            key = self._step(key, state, record)
            since += 1
            if since == _MARK_EVERY:
                self._marks.append((key, deepcopy(state)))
                since = 0
        self._now = key, state
        return self._now

    def _step(self, key: Key | None, state: StateT, record: TimedRange) -> Key:
        if key is not None:
            state.predict(self._speed * (record.time_s - key[0]))
        below, above = record.bound_m if isinstance(record.bound_m, tuple) else (record.bound_m, record.bound_m)
        if self._widening == 0.0:
            state.measure(record.anchor, record.range_m, record.bound_m)
        else:
            state.measure(record.anchor, record.range_m, (below + self._widening, above + self._widening))
        return record.key


def _misses(heard: Mapping[str, Heard], others: Mapping[str, Heard]) -> bool:
    """Whether who has heard the one lacks some of the other that is below."""
    return any(
        have.below > (mine := heard.get(peer, Heard())).below
        and any(number not in mine for number in range(mine.below, have.below))
        for peer, have in others.items()
    )


def _rank(base: Base[StateT]) -> tuple[int, Key]:
    """The base of two that is kept: that of more ranges, then the later one."""
    return sum(heard.below for heard in base.heard.values()), base.key
