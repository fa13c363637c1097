"""Who led when, and how long the team was without a leader: read from a recording, and held against the rules.

All of that is by the clocks of one machine, or of one simulation, so that moments can be compared to a few
milliseconds.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import msgspec

from agents.records import AnyRecord, Mishap, Office
from launcher.recorded_rules import SLACK_S, RecordedRules
from launcher.spells import SILENT_S, Spell, find_spells

_FELLED: Final = frozenset({"kill", "pause", "crash", "partition"})
"""Mishaps that can take the leader from the team."""


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


def find_reigns(records: Sequence[tuple[float, str, AnyRecord]], epoch_unix_s: float | None = None) -> Reigns:
    """Who led and who was obeyed when.

    Args:
        records: mission time, peer, record; in any order.
        epoch_unix_s: when mission time began, in seconds since 1970; if not given, it is not judged how old orders were
            that peers took.
    """
    records = sorted(records, key=lambda entry: entry[0])
    by_peer: dict[str, list[tuple[float, AnyRecord]]] = defaultdict(list)
    for time_s, peer, record in records:
        by_peer[peer].append((time_s, record))
    led: list[Spell] = []
    obeyed: list[Spell] = []
    for peer, entries in by_peer.items():
        led += find_spells(peer, entries, "leads")
        obeyed += find_spells(peer, entries, "obeys")
    led.sort(key=lambda spell: spell.from_s)
    obeyed.sort(key=lambda spell: spell.from_s)
    mishaps = tuple((time_s, record) for time_s, _, record in records if isinstance(record, Mishap))
    voters = {peer for peer, entries in by_peer.items() if any(isinstance(record, Office) for _, record in entries)}
    times_s = {peer: [time_s for time_s, _ in by_peer[peer]] for peer in voters}
    return Reigns(
        led=tuple(led),
        obeyed=tuple(obeyed),
        takeovers=tuple(_takeovers(led, obeyed, mishaps, times_s)),
        mishaps=mishaps,
        broken=tuple(RecordedRules(led, obeyed, records).broken(epoch_unix_s)) if voters else (),
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
