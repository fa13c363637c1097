"""A peer in virtual time, and what can happen to one: it dies, hangs and comes back; its clock and disk are its own.

The role, its shell and its body are those of the live system. The process is not: it sleeps until it is due, computes
inline and lets the result wait for its delay.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Final, TypeVar

from agents.allegiance import Allegiance
from agents.records import AnyRecord
from agents.role import Compute, JobDone, Persist, Role, Written
from agents.shell import PeerShell, read
from launcher.simulated_hardware import SimulatedClock, SimulatedDisk, TrueBody
from protocol.bus import BusEvent
from protocol.inbox import Inbox
from protocol.promises import decode_promise

if TYPE_CHECKING:
    from agents.casting import Casting
    from agents.driver import DiscDriver
    from agents.mission import Mission
    from protocol.messages import Point
    from protocol.simulated_bus import SimulatedNetwork, VirtualTime

APart = TypeVar("APart")

read_shared: Final = lru_cache(maxsize=4096)(read)
"""Messages are values: what one hearer has read serves all others, and the rules."""


class SimulatedPeer:
    """One process after another under one name, with one body, one clock and one disk.

    Args:
        time: true time.
        network: of the team.
        casting: gives it a role, and a body.
        mission: its name is on the roster of it.
        name: of this peer.
        record: takes what it records: true time, name, record.
        watch: called after each event that it has handled.
    """

    def __init__(
        self,
        time: VirtualTime,
        network: SimulatedNetwork,
        casting: Casting,
        mission: Mission,
        name: str,
        record: Callable[[float, str, AnyRecord], None],
        watch: Callable[[SimulatedPeer], None] | None = None,
    ) -> None:
        self.name = name
        self.clock = SimulatedClock()
        self.disk = SimulatedDisk(time, f"{mission.seed}/{name}/disk")
        self.shell: PeerShell | None = None
        """Of the process that runs; None: there is none."""
        self.role: Role | None = None
        self.allegiance: Allegiance | None = None
        """Of its role, if that has one."""
        self.incarnation = -1
        """Of the latest process."""
        self.watch = watch
        """Called after each event that it has handled."""
        self.said: Callable[[SimulatedPeer, str, bytes], None] | None = None
        """Called with key and payload of everything that it says, before anybody hears it."""
        self._time, self._network = time, network
        self._casting, self._mission = casting, mission
        self._record = record
        self._body: DiscDriver | None = None
        self._mover: TrueBody | None = None
        self._parts: dict[type[object], object] = {}
        self._due_s = math.inf
        self.inbox: Inbox[JobDone | Written] | None = None
        """What arrives while it is paused; None while it is not."""
        self._held: list[tuple[str, bytes]] | None = None
        """What it is about to say; it has been paused in the middle of a sentence, or will be."""

    @property
    def runs(self) -> bool:
        """Whether there is a process, and it is not paused."""
        return self.shell is not None and self.inbox is None

    @property
    def now_s(self) -> float:
        """What its clock shows."""
        return self.clock.read(self._time.now_s)

    @property
    def true_s(self) -> float:
        """True time."""
        return self._time.now_s

    @property
    def drives_until_s(self) -> float:
        """True time at which its body stands if it is told nothing more; it may stand already."""
        return -math.inf if self._mover is None else self._mover.until_s

    def part(self, kind: type[APart]) -> APart | None:
        """The part of this kind of its present mind; None if it has none."""
        if kind not in self._parts:
            parts = getattr(self.role, "parts", ())
            self._parts[kind] = next((part for part in parts if isinstance(part, kind)), None)
        return self._parts[kind]  # type: ignore[return-value]

    @property
    def place(self) -> Point:
        """Where its body truly is now."""
        if self._body is None:
            return self._mission.entry(self.name).start
        return self._body.place_at(self._time.now_s)

    def start(self) -> None:
        """Begin a process where there is none: it joins the network, and its role begins."""
        if self.shell is not None:
            return
        self.incarnation += 1
        promise = decode_promise(
            self.disk.content,
            file=f"the simulated disk of {self.name}",
            team=self._mission.team,
            voter=self.name,
            incarnation=self.incarnation,
        )
        role, body = self._casting.cast(self.name, incarnation=self.incarnation, promise=promise, now_s=self.now_s)
        self._body = body = self._body or body
        self.role = role
        self._parts.clear()
        self.allegiance = self.part(Allegiance)
        self._mover = TrueBody(body, self._time, self.clock)
        self._bus = self._network.attach(self.name, self._take, kinds=role.hears)
        self.shell = shell = PeerShell(
            role,
            self._mover,
            self,
            name=self.name,
            team=self._mission.team,
            incarnation=self.incarnation,
            peers=[entry.name for entry in self._mission.roster],
            now=self._read_clock,
            wall_clock=lambda: self._mission.epoch_unix_s + self.now_s,
            record=lambda _, record: self._record(self._time.now_s, self.name, record),
            execute=self._execute,
            persist=self._persist,
            read=read_shared,
        )
        shell.start()
        self._sleep()

    def kill(self, *, lose_disk: bool = False, noticed_after_s: float = 0.0) -> None:
        """End the process at once; its body stands when its last command has run out.

        Args:
            lose_disk: what it has written is gone.
            noticed_after_s: the others see its token vanish so much later.
        """
        if self.shell is not None:
            self.disk.fail()
            self._bus.close(noticed_after_s)
            self.shell = self.role = self.allegiance = self.inbox = self._held = None
            self._parts.clear()
            self._due_s = math.inf
        if lose_disk:
            self.disk.content = None

    def pause(self, *, speaking: bool = False) -> None:
        """Stop the process as SIGSTOP does.

        Args:
            speaking: not now, but when it has dealt with its next event, before what it then says has gone out.
        """
        if self.shell is not None and self.inbox is None:
            if speaking:
                self._held = []
            else:
                self.inbox = Inbox()

    def resume(self) -> None:
        """Let the process go on as SIGCONT does: it ends its sentence, looks at what has arrived, then at the clock."""
        held, self._held = self._held, None
        waiting, self.inbox = self.inbox, None
        for key, payload in held or ():
            self._bus.publish(key, payload)
        for event in waiting.wait(0.0) if waiting is not None else ():
            self._pass_on(event)
        self._sleep()
        self._wake(self._due_s)

    def set_clock(self, rate: float, ahead_s: float | None = None) -> None:
        """Let the clock run at another rate; a clock in use does not jump."""
        self.clock.change(rate, self._time.now_s, ahead_s if self.shell is None else None)
        self._due_s = math.inf
        self._sleep()

    def publish(self, key: str, payload: bytes) -> None:
        """The bus of its shell."""
        if self.said is not None:
            self.said(self, key, payload)
        if self._held is None:
            self._bus.publish(key, payload)
        else:
            self._held.append((key, payload))

    def close(self) -> None:
        """The bus of its shell; it is closed by :meth:`kill`."""

    def _read_clock(self) -> float:
        return self.clock.read(self._time.now_s)

    def _take(self, event: BusEvent) -> None:
        if self.inbox is not None:
            self.inbox.put(event)
        elif self.shell is not None:
            self.shell.take(event)
            self._end_event()

    def _come_back(self, incarnation: int, event: JobDone | Written) -> None:
        """Pass on the end of what a process has begun, if that is the one that runs."""
        if self.shell is None or self.incarnation != incarnation:
            return
        if self.inbox is None:
            self._pass_on(event)
        else:
            self.inbox.put(event)

    def _pass_on(self, event: BusEvent | JobDone | Written) -> None:
        shell = self.shell
        assert shell is not None
        if isinstance(event, JobDone):
            shell.finish(event)
        elif isinstance(event, Written):
            shell.written(event)
        else:
            shell.take(event)
        self._end_event()

    def _end_event(self) -> None:
        if self._held is not None and self.inbox is None:
            self.inbox = Inbox()
        if self.watch is not None:
            self.watch(self)
        if self.shell is not None and self.shell.wake_at_s != self._due_s:
            self._sleep()

    def _execute(self, job: Compute) -> None:
        result, failure = None, ""
        try:
            result = job.function(*job.arguments)
        except Exception as problem:
            failure = f"{type(problem).__name__}: {problem}"
        delay_s = self._mission.planning_delay_s
        done = JobDone(job.job, result, delay_s, failure)
        self._time.call_at(self._time.now_s + delay_s, self._come_back, self.incarnation, done)

    def _persist(self, what: Persist) -> None:
        incarnation = self.incarnation
        self.disk.write(what, lambda written: self._come_back(incarnation, written))

    def _sleep(self) -> None:
        """Have :meth:`_wake` called when the shell is due; calls for times no longer wished for find that out."""
        if self.shell is not None and self.inbox is None and self.shell.wake_at_s != self._due_s:
            self._due_s = self.shell.wake_at_s
            self._time.call_at(self.clock.when(self._due_s), self._wake, self._due_s)

    def _wake(self, due_s: float) -> None:
        if self.runs and due_s == self._due_s and self.now_s >= due_s:
            assert self.shell is not None
            self._due_s = math.inf
            self.shell.wake()
            self._end_event()


def holds_lease(peer: SimulatedPeer) -> bool:
    """Whether a peer believes now that it holds an unexpired lease; also one that is paused."""
    if peer.allegiance is None:
        return False
    election = peer.allegiance.election
    return election.office is not None and peer.now_s < election.lease_until_s
