"""Faults of real processes: kills, pauses and cut links, on a timetable or when somebody asks for them.

The faults are those of :mod:`launcher.fault_timetable`; the rest of them needs virtual time. A process is killed with
SIGKILL and paused with SIGSTOP, a link is cut in the processes that listen (:mod:`protocol.link_faults`). Everything
that is done is noted for the recording, so that a review can say what it led to.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from typing import Final, TypeAlias

from msgspec import structs

from agents.mission import Mission
from agents.records import Mishap
from launcher.fault_timetable import LEADER, Cut, Fault, Kill, Loss, Partition, Pause, Timetable, checked, describe
from launcher.scenario import ScenarioFault
from launcher.supervisor import Supervisor
from protocol.link_faults import CUT, LinkTable

LiveFault: TypeAlias = Kill | Pause | Partition | Cut | Loss

LOOK_S: Final = 0.05
"""How often it looks who leads while nobody does."""


def check_live(timetable: Timetable, mission: Mission) -> tuple[LiveFault, ...]:
    """The faults of a timetable, if live teams know them all.

    Raises:
        ScenarioFault: there is one that only virtual time knows.
        FaultyTimetable: somebody is named who is not on the roster.
    """
    checked(timetable, [entry.name for entry in mission.roster])
    faults: list[LiveFault] = []
    for place, fault in enumerate(timetable.faults):
        kind = str(fault.__struct_config__.tag)
        if not isinstance(fault, LiveFault):
            raise ScenarioFault(
                f"faults[{place}].kind is '{kind}', which only `sightline simulate` knows; "
                "of a live team use kill, pause, partition, cut and loss"
            )
        if isinstance(fault, Loss) and fault.burst > 1.0:
            raise ScenarioFault(
                f"faults[{place}].burst is {fault.burst:g}, and live teams lose one publication at a time; leave it out"
            )
        if isinstance(fault, Kill) and fault.disk == "lost" and fault.for_s is None:
            raise ScenarioFault(f"faults[{place}] loses the disk of a peer that does not come back; add for_s = 5.0")
        faults.append(fault)
    return tuple(faults)


class Chaos:
    """What goes wrong in a running team. Lives in the event loop of its supervisor.

    Args:
        mission: the team's.
        supervisor: of its processes.
        links: the table that its processes read.
        leader: name of who leads now, None while nobody is known to.
        now: mission time, seconds.
        note: is told what has been done, and keeps it.
    """

    def __init__(
        self,
        mission: Mission,
        supervisor: Supervisor,
        links: LinkTable,
        leader: Callable[[], str | None],
        now: Callable[[], float],
        note: Callable[[Mishap], None],
    ) -> None:
        self._names = [entry.name for entry in mission.roster]
        self._supervisor = supervisor
        self._links = links
        self._leader = leader
        self._now = now
        self._note = note
        self._broken: list[Partition | Cut | Loss] = []
        """Faults of links that last, in the order in which they began."""
        self._tasks: set[asyncio.Task[None]] = set()

    def play(self, faults: Sequence[LiveFault]) -> None:
        """Let faults happen when they are due; those whose time is over at once."""
        for fault in faults:
            task = asyncio.create_task(self._play(fault))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    def close(self) -> None:
        """Let nothing more happen."""
        for task in self._tasks:
            task.cancel()

    def begin(self, fault: LiveFault) -> str:
        """Let a fault happen now; a sentence if it cannot, empty if it does. Its ``at_s`` does not matter.

        A peer has to be named: ``leader`` is for :meth:`play` to find out.
        """
        match fault:
            case Kill(who=who, for_s=for_s):
                if not self._supervisor.kill(who, for_s, lose_disk=fault.disk == "lost"):
                    return f"{who} has no process to kill at the moment"
            case Pause(who=who, for_s=for_s):
                if for_s is None or not self._supervisor.pause(who, for_s):
                    return f"{who} has no process that could be paused, or is paused already"
            case Partition() | Cut() | Loss():
                self._broken.append(fault)
                self._write_links()
        self._tell(fault, describe(fault))
        if not isinstance(fault, Kill) and fault.for_s is not None:
            asyncio.get_running_loop().call_later(fault.for_s, self._end, fault)
        return ""

    def heal(self, name: str | None = None) -> int:
        """End all faults of links that touch a peer, or all there are; how many that were."""
        ended = [fault for fault in self._broken if name is None or name in _touched(fault, self._names)]
        for fault in ended:
            self._end(fault)
        return len(ended)

    def leader(self) -> str | None:
        """Who leads now, as far as is known."""
        return self._leader()

    async def _play(self, fault: LiveFault) -> None:
        await asyncio.sleep(max(fault.at_s - self._now(), 0.0))
        if isinstance(fault, Kill | Pause) and fault.who == LEADER:
            while (leader := self._leader()) is None:
                await asyncio.sleep(LOOK_S)
            fault = structs.replace(fault, who=leader)
        if problem := self.begin(fault):
            self._tell(fault, f"nothing done: {problem}")

    def _end(self, fault: LiveFault) -> None:
        """A fault is over; nothing if it has been ended before."""
        if isinstance(fault, Pause):
            self._tell(fault, f"{fault.who} goes on", over=True)
        elif isinstance(fault, Partition | Cut | Loss) and any(fault is broken for broken in self._broken):
            self._broken = [broken for broken in self._broken if broken is not fault]
            self._write_links()
            self._tell(fault, f"over: {describe(fault)}", over=True)

    def _tell(self, fault: Fault, text: str, *, over: bool = False) -> None:
        who = (fault.who,) if isinstance(fault, Kill | Pause) else tuple(_touched(fault, self._names))
        self._note(Mishap(kind=str(fault.__struct_config__.tag), who=who, over=over, text=text))

    def _write_links(self) -> None:
        names = self._names
        percent = [[0] * len(names) for _ in names]
        for fault in sorted(self._broken, key=lambda fault: not isinstance(fault, Loss)):  # a cut cuts, whatever else
            lost = round(CUT * fault.share) if isinstance(fault, Loss) else CUT
            for i, speaker in enumerate(names):
                for j, hearer in enumerate(names):
                    if i != j and _concerns(fault, speaker, hearer):
                        percent[i][j] = lost
        self._links.lose(percent)


def _concerns(fault: Partition | Cut | Loss, speaker: str, hearer: str) -> bool:
    """Whether a fault is one of the link from a speaker to a hearer."""
    if isinstance(fault, Partition):
        return (speaker in fault.group) != (hearer in fault.group)
    return speaker in (fault.speakers or (speaker,)) and hearer in (fault.hearers or (hearer,))


def _touched(fault: Fault, names: Sequence[str]) -> Sequence[str]:
    """Whose links are meant by name; everybody where none are."""
    if isinstance(fault, Partition):
        return fault.group
    meant = {*getattr(fault, "speakers", ()), *getattr(fault, "hearers", ())}
    return [name for name in names if name in meant] or names
