"""One process per peer: started, logged, restarted when it crashes, stopped in time, and never left behind.

Each peer is ``python -m agents.runtime`` in a session of its own, so that Ctrl-C reaches only the launcher, which then
stops the team in order. A peer asks the kernel to be told when its launcher dies (``PR_SET_PDEATHSIG``), so that a
killed launcher leaves nobody behind.
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

from agents.mission import Mission
from protocol.messages import Point

RESTARTS = 3
"""A peer that crashes more often than this within :data:`STEADY_S` seconds is given up."""
STEADY_S = 60.0
BACKOFF_S = 0.2
"""Pause before the first restart; it doubles with each crash, and a random share of up to as much is added."""
TERMINATE_S = 2.0
"""From the request to stop until the processes that still run are killed."""
_LINE_LIMIT = 1 << 20
_ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
"""A team has a process per peer already: no thread per core and process on top."""


@dataclass
class Peer:
    """A peer's process as the supervisor knows it."""

    name: str
    incarnation: int = 0
    process: asyncio.subprocess.Process | None = None
    crashes: list[float] = field(default_factory=list)
    """When it crashed, monotonic seconds."""
    given_up: bool = False

    @property
    def running(self) -> bool:
        """Whether the process exists."""
        return self.process is not None and self.process.returncode is None


class Supervisor:
    """The processes of a mission. Use it from one asyncio loop, in the main thread (the kernel ties peers to it).

    Args:
        mission: with endpoints.
        folder: of the run; holds ``mission.json``.
        announce: is told in a sentence what becomes of peers.
        find: where the body of a peer was last heard of; a mind that is restarted finds its body there.
    """

    def __init__(
        self, mission: Mission, folder: Path, announce: Callable[[str], None], find: Callable[[str], Point | None]
    ) -> None:
        self.peers = {entry.name: Peer(entry.name) for entry in mission.roster}
        self._folder = folder
        self._announce = announce
        self._find = find
        self._stopping = asyncio.Event()
        self._watchers: list[asyncio.Task[None]] = []

    async def start(self) -> None:
        """Start every peer; returns once all processes exist."""
        (self._folder / "logs").mkdir(exist_ok=True)
        (self._folder / "recordings").mkdir(exist_ok=True)
        for peer in self.peers.values():
            await self._spawn(peer)
            self._watchers.append(asyncio.create_task(self._watch(peer)))

    async def stop(self) -> None:
        """Ask every process to end, kill what still runs after :data:`TERMINATE_S`, wait until all are gone."""
        self._stopping.set()
        self._signal(signal.SIGTERM)
        _, late = await asyncio.wait(self._watchers, timeout=TERMINATE_S) if self._watchers else ((), ())
        if late:
            names = ", ".join(peer.name for peer in self.peers.values() if peer.running)
            if names:
                self._announce(f"killed, because they did not end within {TERMINATE_S:g} s: {names}")
            self._signal(signal.SIGKILL)
            await asyncio.wait(late)

    def _signal(self, number: signal.Signals) -> None:
        for peer in self.peers.values():
            if peer.process is not None and peer.process.returncode is None:
                with contextlib.suppress(ProcessLookupError):
                    peer.process.send_signal(number)

    def command(self, peer: Peer) -> list[str]:
        """What to execute for a peer's present incarnation."""
        position = self._find(peer.name) if peer.incarnation else None
        return [
            sys.executable,
            "-P",  # whatever the user's own folder holds, `agents` means ours
            *("-m", "agents.runtime", str(self._folder / "mission.json"), peer.name),
            *("--incarnation", str(peer.incarnation), "--launcher", str(os.getpid())),
            *([] if position is None else [f"--position={position[0]},{position[1]}"]),
        ]

    async def _spawn(self, peer: Peer) -> None:
        """Start a process for a peer's present incarnation."""
        peer.process = await asyncio.create_subprocess_exec(
            *self.command(peer),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.STDOUT,
            start_new_session=True,
            limit=_LINE_LIMIT,
            env={**os.environ, **_ENVIRONMENT},
        )
        if self._stopping.is_set():  # the stop came while the process was being made
            self._signal(signal.SIGTERM)

    async def _watch(self, peer: Peer) -> None:
        """Log what a peer says and restart it when it crashes, until the team stops or the peer is given up."""
        while True:
            assert peer.process is not None
            await self._log(peer)
            status = await peer.process.wait()
            if self._stopping.is_set():
                return
            peer.crashes = [when for when in peer.crashes if monotonic() - when < STEADY_S] + [monotonic()]
            how = f"was killed by {signal.Signals(-status).name}" if status < 0 else f"ended with status {status}"
            if len(peer.crashes) > RESTARTS:
                peer.given_up = True
                self._announce(
                    f"{peer.name} {how}, the {len(peer.crashes)}th time within {STEADY_S:g} s: given up; "
                    f"see {self._folder / 'logs' / peer.name}.log"
                )
                return
            self._announce(f"{peer.name} {how}; restarting it ({len(peer.crashes)} of {RESTARTS})")
            pause_s = BACKOFF_S * 2 ** (len(peer.crashes) - 1)
            # The jitter keeps peers that crashed together from coming back together; nothing is reproducible here.
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._stopping.wait(), pause_s * (1 + random.random()))
            if self._stopping.is_set():
                return
            peer.incarnation += 1
            await self._spawn(peer)

    async def _log(self, peer: Peer) -> None:
        """Append what the process says to its log, each line with name and incarnation, until it closes its output."""
        assert peer.process is not None
        assert peer.process.stdout is not None
        prefix = f"{peer.name}.{peer.incarnation} | "
        with (self._folder / "logs" / f"{peer.name}.log").open("a", encoding="utf-8") as log:
            while True:
                try:
                    line = await peer.process.stdout.readline()
                except ValueError:  # a line beyond the limit: asyncio has thrown away what it held of it
                    line = b"(a line that was too long)\n"
                if not line:
                    return
                log.write(prefix + line.decode(errors="replace").rstrip("\n") + "\n")
                log.flush()
