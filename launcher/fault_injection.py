"""Has a timetable of faults happen to a simulated team."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from itertools import permutations
from typing import Final, TypeVar

from msgspec import structs

from agents.records import Mishap
from launcher.fault_timetable import (
    LEADER,
    Clock,
    Corrupt,
    Cut,
    Delay,
    Disk,
    Duplicate,
    Fault,
    Kill,
    LinkFault,
    Loss,
    Partition,
    Pause,
    PeerFault,
    Timetable,
    describe,
)
from launcher.simulated_hardware import WRITING_S
from launcher.simulated_peer import SimulatedPeer
from protocol.simulated_bus import SimulatedNetwork, VirtualTime
from protocol.simulated_links import Delays, LinkFaults

OfPeer = TypeVar("OfPeer", bound=PeerFault)

LOOK_S: Final = 0.05
"""How often it looks who leads while nobody does."""


class FaultInjection:
    """Puts the faults of a timetable on the clock.

    What is wrong at any time follows from the faults that have begun and are not over: a peer is there if no kill of it
    is among them, it is paused if a pause is, and of the others that name it the one begun last holds.

    Args:
        time: true time, at which the mission has not begun.
        network: of the team.
        peers: by name.
        timetable: held against their names (:func:`launcher.fault_timetable.checked`).
        leader: name of who leads now; None: nobody does.
        note: is told what begins and what is over.
    """

    def __init__(
        self,
        time: VirtualTime,
        network: SimulatedNetwork,
        peers: Mapping[str, SimulatedPeer],
        timetable: Timetable,
        leader: Callable[[], str | None],
        note: Callable[[Mishap], None],
    ) -> None:
        self._time, self._network, self._peers = time, network, peers
        self._leader, self._note = leader, note
        self._active: list[Fault] = []
        self._to_come = len(timetable.faults)
        """Faults that are not over. Who is dead for good, or has another clock, is not waited for."""
        self._changed_s = 0.0
        for fault in sorted(timetable.faults, key=lambda fault: fault.at_s):
            time.call_at(fault.at_s, self._begin, fault)

    @property
    def quiet_since_s(self) -> float:
        """Since when nothing more goes wrong, but for who is dead and for clocks; infinite: something will, or does."""
        return math.inf if self._to_come else self._changed_s

    def keep_away(self, who: str) -> bool:
        """Whether a peer has been killed and is not to be back yet."""
        return bool(self._on(Kill, who))

    def _begin(self, fault: Fault) -> None:
        if isinstance(fault, PeerFault) and fault.who == LEADER:
            name = self._leader()
            if name is None:
                self._time.call_at(self._time.now_s + LOOK_S, self._begin, fault)
                return
            fault = structs.replace(fault, who=name)
        self._changed_s = self._time.now_s
        self._active.append(fault)
        self._tell(fault, over=False)
        match fault:
            case Kill(who=who, disk=disk, noticed_after_s=noticed_after_s):
                self._peers[who].kill(lose_disk=disk == "lost", noticed_after_s=noticed_after_s)
            case Pause(who=who, speaking=speaking):
                self._peers[who].pause(speaking=speaking)
            case Partition(noticed_after_s=noticed_after_s):
                self._set(fault)
                self._time.call_at(self._time.now_s + noticed_after_s, self._hide_tokens, fault)
            case Clock(who=who, rate=rate, offset_s=offset_s):
                self._peers[who].set_clock(rate, offset_s)
            case _:
                self._set(fault)
        if fault.for_s is not None:
            self._time.call_at(self._time.now_s + fault.for_s, self._end, fault)
        elif isinstance(fault, Kill | Clock):
            self._to_come -= 1

    def _end(self, fault: Fault) -> None:
        self._active = [other for other in self._active if other is not fault]
        self._to_come -= 1
        self._changed_s = self._time.now_s
        self._tell(fault, over=True)
        match fault:
            case Kill(who=who):
                if not self._on(Kill, who):
                    self._peers[who].start()
                    if self._on(Pause, who):
                        self._peers[who].pause()
            case Pause(who=who):
                if not self._on(Pause, who):
                    self._peers[who].resume()
            case Clock(who=who):
                clocks = self._on(Clock, who)
                self._peers[who].set_clock(clocks[-1].rate if clocks else 1.0)
            case _:
                self._set(fault)

    def _set(self, fault: Partition | LinkFault | Disk) -> None:
        """Bring up to date what a fault concerns that has begun or is over."""
        if isinstance(fault, Disk):
            disk, faults = self._peers[fault.who].disk, self._on(Disk, fault.who)
            disk.takes_s = faults[-1].takes_s if faults else WRITING_S
            disk.full = bool(faults) and faults[-1].full
            return
        for speaker, hearer in permutations(self._peers, 2):
            if _concerns(fault, speaker, hearer):
                self._network.set_faults(speaker, hearer, self._on_link(speaker, hearer))

    def _on(self, kind: type[OfPeer], who: str) -> list[OfPeer]:
        """The faults of a kind on a peer, that begun last at the end."""
        return [fault for fault in self._active if isinstance(fault, kind) and fault.who == who]

    def _on_link(self, speaker: str, hearer: str) -> LinkFaults | None:
        """All that is wrong with a link; None if nothing is."""
        usual = wrong = self._network.usual
        for fault in self._active:
            if _concerns(fault, speaker, hearer):
                wrong = _worsen(wrong, fault)
        return None if wrong is usual else wrong

    def _hide_tokens(self, fault: Partition) -> None:
        for speaker, hearer in permutations(self._peers, 2):
            if _concerns(fault, speaker, hearer):
                self._network.hide_token(speaker, hearer)

    def _tell(self, fault: Fault, *, over: bool) -> None:
        text = describe(fault)
        self._note(Mishap(kind=fault.kind, who=_whom(fault), text=f"over: {text}" if over else text, over=over))


def _concerns(fault: Fault, speaker: str, hearer: str) -> bool:
    """Whether a fault is one of a link."""
    match fault:
        case Partition(group=group):
            return (speaker in group) is not (hearer in group)
        case Cut() | Loss() | Delay() | Duplicate() | Corrupt():
            return (not fault.speakers or speaker in fault.speakers) and (not fault.hearers or hearer in fault.hearers)
    return False


def _worsen(wrong: LinkFaults, fault: Fault) -> LinkFaults:
    match fault:
        case Partition() | Cut():
            return replace(wrong, cut=True)
        case Loss(share=share, burst=burst):
            return replace(wrong, loss=share, burst=burst)
        case Duplicate(share=share):
            return replace(wrong, duplicates=share)
        case Corrupt(share=share):
            return replace(wrong, corrupted=share)
        case Delay():
            return replace(
                wrong,
                delays=Delays(fault.least_s, fault.mean_s, fault.tail, fault.spikes, fault.spike_s, fault.overtaking),
            )
    return wrong


def _whom(fault: Fault) -> tuple[str, ...]:
    names: Iterable[str] = ()
    match fault:
        case Partition(group=group):
            names = group
        case Cut() | Loss() | Delay() | Duplicate() | Corrupt():
            names = (*fault.speakers, *fault.hearers)
        case _:
            names = (fault.who,)
    return tuple(dict.fromkeys(names))
