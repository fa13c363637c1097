"""From when to when peers led, and whom they obeyed, by what they recorded.

Every voter records whom it obeys and whether it leads (:class:`agents.records.Office`). A process that was killed or
hung ends its spells with what it recorded last, or with the end of its lease that it found when it went on.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, Literal

import msgspec

from agents.records import AnyRecord, Office
from protocol.messages import Reign

SILENT_S: Final = 1.0
"""A process that recorded nothing for so long was gone, or stood still: tracks are recorded ten times as often."""


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


def find_spells(
    peer: str, entries: Sequence[tuple[float, AnyRecord]], what: Literal["leads", "obeys"]
) -> Iterator[Spell]:
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
