"""Who led when, and how long the team was without a leader: read from a recording, and held against the rules.

Every voter records whom it obeys and whether it leads (:class:`agents.records.Office`). A process that was killed or
hung ends its spells with what it recorded last, or with the end of its lease that it found when it went on. All of that
is by the clocks of one machine, or of one simulation, so that moments can be compared to a few milliseconds.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import msgspec

from agents.records import AnyRecord, Decision, Mishap, Office, Ordered, TopologyChange
from protocol.messages import Reign

SLACK_S: Final = 0.005
"""Records of different processes are taken for simultaneous within this time."""

SILENT_S: Final = 1.0
"""A process that recorded nothing for so long was gone, or stood still: tracks are recorded ten times as often."""

_FELLED: Final = frozenset({"kill", "pause", "crash", "partition"})
"""Mishaps that can take the leader from the team."""


class Spell(msgspec.Struct, frozen=True, kw_only=True):
    """A peer led, or obeyed, for a time."""

    peer: str
    leader: str
    incarnation: int
    epoch: int
    from_s: float
    until_s: float

    @property
    def reign(self) -> Reign:
        """Which reign that was."""
        return Reign(epoch=self.epoch, leader=self.leader, incarnation=self.incarnation)


class Takeover(msgspec.Struct, frozen=True, kw_only=True):
    """The leader was taken from the team."""

    at_s: float
    """When, in mission time."""
    what: str
    """What befell it."""
    before: str
    """Who led."""
    after: str | None
    """Who was obeyed then by all others that were there; None: nobody until the end of the recording."""
    took_s: float | None
    """Until then."""
    back_after_s: float | None = None
    """Until who had led recorded again; None: never, or it was only cut off."""


@dataclass(frozen=True)
class Reigns:
    """What a recording says about leading."""

    led: tuple[Spell, ...] = ()
    """By time."""
    obeyed: tuple[Spell, ...] = ()
    """By time."""
    takeovers: tuple[Takeover, ...] = ()
    mishaps: tuple[tuple[float, Mishap], ...] = ()
    """What befell processes and links, by time."""
    broken: tuple[str, ...] = field(default=())
    """Rules that did not hold, as sentences; none, if all is well."""


def find_reigns(records: Sequence[tuple[float, str, AnyRecord]]) -> Reigns:
    """Who led and who was obeyed when, by (mission time, peer, record) in any order."""
    by_peer: dict[str, list[tuple[float, AnyRecord]]] = defaultdict(list)
    for time_s, peer, record in sorted(records, key=lambda entry: entry[0]):
        by_peer[peer].append((time_s, record))
    led: list[Spell] = []
    obeyed: list[Spell] = []
    for peer, entries in by_peer.items():
        led += _spells(peer, entries, "leads")
        obeyed += _spells(peer, entries, "obeys")
    led.sort(key=lambda spell: spell.from_s)
    obeyed.sort(key=lambda spell: spell.from_s)
    mishaps = tuple(
        (time_s, record) for time_s, _, record in sorted(records, key=lambda entry: entry[0])
        if isinstance(record, Mishap)
    )  # fmt: skip
    voters = {peer for peer, entries in by_peer.items() if any(isinstance(record, Office) for _, record in entries)}
    times_s = {peer: [time_s for time_s, _ in by_peer[peer]] for peer in voters}
    return Reigns(
        led=tuple(led),
        obeyed=tuple(obeyed),
        takeovers=tuple(_takeovers(led, obeyed, mishaps, times_s)),
        mishaps=mishaps,
        broken=tuple(_broken(led, obeyed, records)) if voters else (),
    )


def _spells(peer: str, entries: Sequence[tuple[float, AnyRecord]], what: str) -> Iterator[Spell]:
    """For how long a peer led (``what`` is ``leads``), or whom it obeyed (``obeys``)."""
    present: Reign | None = None
    since_s = last_s = 0.0
    silent_from_s: float | None = None
    incarnation = -1
    for time_s, record in entries:
        if silent_from_s is None and time_s - last_s > SILENT_S:
            silent_from_s = last_s  # what comes after may be another process, which has not said so yet
        if isinstance(record, Office):
            reign = record.leads if what == "leads" else record.obeys
            restarted = record.incarnation != incarnation
            if present is not None and (restarted or reign != present):
                ended_s = record.led_until_s if what == "leads" else record.obeyed_until_s
                if restarted:
                    ended_s = last_s if silent_from_s is None else silent_from_s
                until_s = time_s if ended_s is None else ended_s
                yield _spell(peer, present, since_s, max(since_s, until_s))
                present = None
            if present is None and reign is not None:
                present, since_s = reign, time_s
            incarnation, silent_from_s = record.incarnation, None
        last_s = time_s
    if present is not None:
        yield _spell(peer, present, since_s, last_s)


def _spell(peer: str, reign: Reign, from_s: float, until_s: float) -> Spell:
    return Spell(
        peer=peer,
        leader=reign.leader,
        incarnation=reign.incarnation,
        epoch=reign.epoch,
        from_s=from_s,
        until_s=until_s,
    )


def _lives(times_s: Sequence[float]) -> list[tuple[float, float]]:
    """From when to when somebody recorded without a long silence."""
    lives = [(times_s[0], times_s[0])]
    for before_s, time_s in pairwise(times_s):
        if time_s - before_s > SILENT_S:
            lives.append((time_s, time_s))
        lives[-1] = (lives[-1][0], time_s)
    return lives


def _takeovers(
    led: Sequence[Spell],
    obeyed: Sequence[Spell],
    mishaps: Sequence[tuple[float, Mishap]],
    times_s: dict[str, list[float]],
) -> Iterator[Takeover]:
    """What came of the mishaps of leaders; ``times_s`` of the records of each voter, ascending."""
    lives = {peer: _lives(recorded_s) for peer, recorded_s in times_s.items()}
    for at_s, mishap in mishaps:
        before = next((spell for spell in reversed(led) if spell.from_s <= at_s), None)
        if mishap.over or mishap.kind not in _FELLED or before is None or before.peer not in mishap.who:
            continue
        if before.until_s < at_s - SILENT_S:
            continue  # it had ceased to lead before
        moments_s = sorted(spell.from_s for spell in obeyed if spell.from_s >= at_s and spell.epoch > before.epoch)
        again_s = next((time_s for time_s in times_s[before.peer] if time_s > at_s + SLACK_S), None)
        back_after_s = None if again_s is None or mishap.kind == "partition" else again_s - at_s
        after = None
        for moment_s in moments_s:
            there = {
                peer
                for peer, spans in lives.items()
                if peer not in mishap.who and any(begin_s <= moment_s <= end_s for begin_s, end_s in spans)
            }
            obeying = {spell.peer: spell for spell in obeyed if spell.from_s <= moment_s < spell.until_s}
            reigns = {obeying[peer].reign if peer in obeying else None for peer in there}
            if len(reigns) == 1 and (only := reigns.pop()) is not None and only.epoch > before.epoch:
                after = Takeover(
                    at_s=at_s,
                    what=mishap.text,
                    before=before.peer,
                    after=only.leader,
                    took_s=moment_s - at_s,
                    back_after_s=back_after_s,
                )
                break
        yield after or Takeover(
            at_s=at_s, what=mishap.text, before=before.peer, after=None, took_s=None, back_after_s=back_after_s
        )


def _broken(
    led: Sequence[Spell], obeyed: Sequence[Spell], records: Iterable[tuple[float, str, AnyRecord]]
) -> Iterator[str]:
    """Rules that did not hold."""
    for one, other in _overlaps(led):
        yield f"{one.peer} and {other.peer} both led at {other.from_s:.2f} s, in epochs {one.epoch} and {other.epoch}"
    for one, other in _overlaps(obeyed):
        yield (
            f"{one.peer} obeyed {one.leader} in epoch {one.epoch} while {other.peer} obeyed {other.leader} in epoch "
            f"{other.epoch}, at {other.from_s:.2f} s"
        )
    for before, after in pairwise(led):
        if after.reign != before.reign and after.epoch <= before.epoch:
            yield f"{after.peer} led in epoch {after.epoch} at {after.from_s:.2f} s, after epoch {before.epoch}"
    latest: dict[str, Spell] = {}
    for spell in obeyed:
        if spell.peer in latest and spell.epoch < latest[spell.peer].epoch:
            yield f"{spell.peer} obeyed epoch {spell.epoch} at {spell.from_s:.2f} s, after {latest[spell.peer].epoch}"
        latest[spell.peer] = spell
    for time_s, peer, record in records:
        epoch = _epoch_of(record)
        if epoch is not None and not any(
            spell.peer == peer and spell.epoch == epoch and spell.from_s - SLACK_S <= time_s <= spell.until_s + SLACK_S
            for spell in led
        ):
            yield f"{peer} gave orders in epoch {epoch} at {time_s:.2f} s, when it did not lead"
        if isinstance(record, TopologyChange) and record.committed and not _is_tree(record.edges):
            yield f"the tree {record.number[0]}.{record.number[1]} of {time_s:.2f} s is none: {record.edges}"


def _overlaps(spells: Sequence[Spell]) -> Iterator[tuple[Spell, Spell]]:
    """Pairs of spells of different reigns at one time. O(n²) in the worst case."""
    for place, spell in enumerate(spells):
        for other in spells[place + 1 :]:
            if other.from_s >= spell.until_s - SLACK_S:
                break
            if other.reign != spell.reign and other.until_s - other.from_s > SLACK_S:
                yield spell, other


def _epoch_of(record: AnyRecord) -> int | None:
    """Epoch of an order; None if it is none."""
    if isinstance(record, Decision):
        return record.deployment.authority.epoch
    return record.epoch if isinstance(record, Ordered) else None


def _is_tree(edges: Sequence[tuple[str, str]]) -> bool:
    """Whether links join all that they name, without a circle."""
    joined: dict[str, set[str]] = {}
    for one, other in edges:
        group, second = joined.get(one, {one}), joined.get(other, {other})
        if group is second or one == other:
            return False
        group |= second
        joined |= dict.fromkeys(group, group)
    return len({id(group) for group in joined.values()}) <= 1
