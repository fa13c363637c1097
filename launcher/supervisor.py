"""One process per peer: started, restarted when it crashes, stopped in time, and never left behind.

Each peer is in a session of its own, so that Ctrl-C reaches only the launcher, which then stops the team in order. A
peer asks the kernel to be killed when its launcher dies (``PR_SET_PDEATHSIG``), so that a killed launcher leaves nobody
behind, not even a peer that is paused.

Peers can also be killed and paused on purpose (:mod:`launcher.chaos`). That is no crash, and nobody is given up for it.
Whoever is gone, for whatever reason, can be started again (:mod:`launcher.replacement`).
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import random
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic

from agents.leader import DeploymentPlanner
from agents.mission import Mission
from agents.runtime import WOULD_JOIN_WRONGLY
from agents.voter_file import VoterFile
from launcher.fork_server import ForkServer, ServerGone
from launcher.processes import fork_peer, spawn, wait_for_end
from launcher.run_folder import RECORDINGS
from protocol.messages import Point

RESTARTS = 3
"""A peer that crashes more often than this within :data:`STEADY_S` seconds is given up."""
STEADY_S = 60.0
BACKOFF_S = 0.2
"""Pause before the first restart; it doubles with each crash, and a random share of up to as much is added."""
TERMINATE_S = 2.0
"""From the request to stop until the processes that still run are killed."""


@dataclass
class Peer:
    """A peer's process as the supervisor knows it."""

    name: str
    incarnation: int = 0
    pid: int | None = None
    """Of its process; None while there is none."""
    crashes: list[float] = field(default_factory=list)
    """When it crashed, monotonic seconds."""
    given_up: bool = False
    killed: Killed | None = None
    """What its process was killed for, until it is back."""
    place: Point | None = None
    """Where the body of its next process is, if that is another one than the last had."""
    due: asyncio.Event = field(default_factory=asyncio.Event)
    """Set when nothing is to be waited for any more before its next process, or the end."""

    @property
    def gone(self) -> bool:
        """Whether it will not come back."""
        return self.given_up or (self.killed is not None and self.killed.back_after_s is None)


@dataclass(frozen=True)
class Killed:
    """On purpose."""

    back_after_s: float | None
    """Until another process is started under the name; None: never."""
    lose_disk: bool
    """Whether its voter's file goes with it."""


class Supervisor:
    """The processes of a mission. Use it from the main thread: the kernel ties peers to the thread that started them.

    Args:
        mission: with endpoints.
        folder: of the run; holds ``mission.json``.
        planner: the team's, for forks.
        announce: is told in a sentence what else becomes of peers.
        crashed: is told who crashed, and in a sentence what follows.
        find: where the body of a peer is; a mind that is restarted finds its body there.
        revived: is told who has a process again after it had been killed on purpose, or given up.
    """

    def __init__(
        self,
        mission: Mission,
        folder: Path,
        planner: DeploymentPlanner,
        announce: Callable[[str], None],
        crashed: Callable[[str, str], None],
        find: Callable[[str], Point | None],
        revived: Callable[[str], None],
    ) -> None:
        self.peers = {entry.name: Peer(entry.name) for entry in mission.roster}
        self._folder = folder
        self._planner = planner
        self._announce = announce
        self._crashed = crashed
        self._find = find
        self._revived = revived
        self._stopping = asyncio.Event()
        self._watchers: list[asyncio.Task[None]] = []
        self._paused: dict[str, asyncio.TimerHandle] = {}
        self._forks: ForkServer | None = None
        """Starts peers again, as long as there is one."""

    def launch(self) -> None:
        """Start a process for every peer. Call it before there is an event loop, a bus or a thread: it forks."""
        (self._folder / "logs").mkdir(exist_ok=True)
        (self._folder / RECORDINGS).mkdir(exist_ok=True)
        for peer in self.peers.values():
            peer.pid = self.start_process(peer)
        self._forks = ForkServer(self._planner)

    def watch(self) -> None:
        """Restart from now on what crashes. Needs the event loop that :meth:`stop` runs in."""
        self._watchers = [asyncio.create_task(self._watch(peer)) for peer in self.peers.values()]

    def kill(self, name: str, back_after_s: float | None, *, lose_disk: bool = False) -> bool:
        """Kill a peer's process, whatever it does; False if it has none at the moment.

        Args:
            name: of the peer.
            back_after_s: until another one is started under the name; None: never.
            lose_disk: whether what it has promised as a voter is lost with it.
        """
        peer = self.peers[name]
        if peer.pid is None:
            return False
        peer.killed = Killed(back_after_s, lose_disk)
        os.kill(peer.pid, signal.SIGKILL)
        return True

    def start(self, name: str, place: Point | None = None) -> bool:
        """Start another process for a peer that has none, whatever became of the last one; False if it has one.

        Args:
            name: of the peer.
            place: where the body of the new one is; where that of the last one was if None.
        """
        peer = self.peers[name]
        if peer.pid is not None:
            return False
        peer.place = place
        peer.crashes.clear()
        peer.due.set()
        return True

    def pause(self, name: str, for_s: float) -> bool:
        """Let a peer's process stand still; False if it has none, or stands still already. Needs the event loop."""
        pid = self.peers[name].pid
        if pid is None or name in self._paused:
            return False
        os.kill(pid, signal.SIGSTOP)
        self._paused[name] = asyncio.get_running_loop().call_later(for_s, self.resume, name)
        return True

    def resume(self, name: str) -> None:
        """Let a peer that stands still go on, if it does."""
        timer = self._paused.pop(name, None)
        pid = self.peers[name].pid
        if timer is not None and pid is not None:
            timer.cancel()
            os.kill(pid, signal.SIGCONT)

    async def stop(self) -> None:
        """Ask every process to end, kill what still runs after :data:`TERMINATE_S`, wait until all are gone."""
        self._stopping.set()
        for peer in self.peers.values():
            peer.due.set()
        for name in tuple(self._paused):
            self.resume(name)
        self._signal(signal.SIGTERM)
        _, late = await asyncio.wait(self._watchers, timeout=TERMINATE_S)
        if late:
            names = ", ".join(peer.name for peer in self.peers.values() if peer.pid is not None)
            self._announce(f"killed, because they did not end within {TERMINATE_S:g} s: {names}")
            self._signal(signal.SIGKILL)
            await asyncio.wait(late)
        if self._forks is not None:
            self._forks.close()

    def start_process(self, peer: Peer) -> int:
        """Start a process for a peer's present incarnation and return its id."""
        position = (peer.place or self._find(peer.name)) if peer.incarnation else None
        arguments = [
            *(str(self._folder / "mission.json"), peer.name),
            *("--incarnation", str(peer.incarnation), "--launcher", str(os.getpid())),
            *([] if position is None else [f"--position={position[0]},{position[1]}"]),
        ]
        if peer.incarnation == 0:
            return fork_peer(arguments, self.log(peer), self._planner)
        if self._forks is not None:
            try:
                return self._forks.fork_peer(arguments, self.log(peer))
            except ServerGone:
                self._forks = None
                self._announce("the process that forks peers is gone: those started from now on take seconds longer")
        # With -P, whatever the user's own folder holds, `agents` means ours.
        return spawn([sys.executable, "-P", "-m", "agents.runtime", *arguments], self.log(peer))

    def log(self, peer: Peer) -> Path:
        """What the processes of a peer have said."""
        return self._folder / "logs" / f"{peer.name}.log"

    def _remedy(self, peer: Peer) -> str:
        return f"`sightline fault {self._folder} start {peer.name}`"

    def _signal(self, number: signal.Signals) -> None:
        for peer in self.peers.values():
            if peer.pid is not None:  # not yet waited for, so that the id is still its own
                with contextlib.suppress(ProcessLookupError):
                    os.kill(peer.pid, number)

    async def _watch(self, peer: Peer) -> None:
        """Restart a peer whenever it has ended, at once or later, until the team stops."""
        while peer.pid is not None:
            status = await wait_for_end(peer.pid)
            peer.pid = None
            if self._stopping.is_set():
                return
            peer.due.clear()
            if (timer := self._paused.pop(peer.name, None)) is not None:
                timer.cancel()
            if peer.killed is not None and peer.killed.lose_disk:
                VoterFile(self._folder, peer.name).path.unlink(missing_ok=True)
            pause_s = self._judge_crash(peer, status) if peer.killed is None else peer.killed.back_after_s
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(peer.due.wait(), pause_s)
            if self._stopping.is_set():
                return
            revived = peer.killed is not None or peer.given_up
            peer.incarnation += 1
            peer.killed, peer.given_up = None, False
            peer.pid = self.start_process(peer)
            peer.place = None
            if revived:
                self._revived(peer.name)

    def _judge_crash(self, peer: Peer, status: int) -> float | None:
        """Note a crash and say so; how long to wait before a restart, None if nobody but :meth:`start` restarts it."""
        peer.crashes = [when for when in peer.crashes if monotonic() - when < STEADY_S] + [monotonic()]
        how = f"was killed by {signal.Signals(-status).name}" if status < 0 else f"ended with status {status}"
        if status == WOULD_JOIN_WRONGLY:
            peer.given_up = True
            said = self.log(peer).read_text(encoding="utf-8", errors="replace").rstrip().rpartition("\n")[2]
            self._crashed(peer.name, f"{said}; given up, until {self._remedy(peer)}")
            return None
        if len(peer.crashes) > RESTARTS:
            peer.given_up = True
            self._crashed(
                peer.name,
                f"{peer.name} {how}, the {len(peer.crashes)}th time within {STEADY_S:g} s: given up, until "
                f"{self._remedy(peer)}; see {self.log(peer)}",
            )
            return None
        self._crashed(peer.name, f"{peer.name} {how}; restarting it ({len(peer.crashes)} of {RESTARTS})")
        # The jitter keeps peers that crashed together from coming back together; nothing is reproducible here.
        return BACKOFF_S * 2.0 ** (len(peer.crashes) - 1) * (1.0 + random.random())
