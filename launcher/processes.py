"""Starting a peer's process, by fork or from scratch, and noticing its end. Linux.

A launcher that has checked a scenario has imported nearly everything that a peer needs and has loaded the compiled
kernels. Its forks have all that at once and share the memory, where processes from scratch would spend two seconds of a
processor each. A fork is sound only before the launcher runs an event loop, a bus, a recording or a thread of its own;
the idle threads that rerun and pyarrow start on import provide for forks themselves. Later ones are taken of a process
that has stayed so (:mod:`launcher.fork_server`), and from scratch only if that one is lost.
"""

from __future__ import annotations

import asyncio
import os
import sys
import time
from pathlib import Path
from typing import NoReturn

from agents import runtime
from agents.leader import DeploymentPlanner

_ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
"""A team has a process per peer already: no thread per core and process on top."""


def age_s() -> float:
    """How long ago this process was started, seconds."""
    started = int(Path("/proc/self/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()[19])
    return time.clock_gettime(time.CLOCK_BOOTTIME) - started / os.sysconf("SC_CLK_TCK")


def fork_peer(arguments: list[str], log: Path, planner: DeploymentPlanner) -> int:
    """Process id of a fork of this process that is a peer, in a session of its own; it writes to the log only.

    Args:
        arguments: those of :func:`agents.runtime.main`.
        log: appended to.
        planner: the team's; the base station's process uses it.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    pid = os.fork()
    if pid == 0:
        be_peer(arguments, log, planner)
    return pid


def be_peer(arguments: list[str], log: Path, planner: DeploymentPlanner) -> NoReturn:
    """Be a peer in this process, which is a fork; it ends in here. Arguments as of :func:`fork_peer`."""
    try:
        leave_launcher(log)
        runtime.main(arguments, planner)
    finally:
        os._exit(1)  # whatever happens, this is not the launcher any more


def leave_launcher(log: Path) -> None:
    """Have a session of one's own and write to the log only, instead of where the launcher does."""
    os.setsid()
    for path, flags, descriptors in (
        (os.devnull, os.O_RDONLY, (0,)),
        (str(log), os.O_WRONLY | os.O_APPEND | os.O_CREAT, (1, 2)),
    ):
        opened = os.open(path, flags, 0o644)
        for descriptor in descriptors:
            os.dup2(opened, descriptor)
        os.close(opened)


def spawn(command: list[str], log: Path) -> int:
    """Process id of a program in a session of its own; it writes to the log only."""
    return os.posix_spawn(
        command[0],
        command,
        {**os.environ, **_ENVIRONMENT},
        file_actions=[
            (os.POSIX_SPAWN_OPEN, 0, os.devnull, os.O_RDONLY, 0),
            (os.POSIX_SPAWN_OPEN, 1, str(log), os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644),
            (os.POSIX_SPAWN_DUP2, 1, 2),
        ],
        setsid=True,
    )


async def wait_for_end(pid: int) -> int:
    """Exit status of a child process once it has ended; that of a signal is negative."""
    loop = asyncio.get_running_loop()
    ended = asyncio.Event()
    descriptor = os.pidfd_open(pid)
    loop.add_reader(descriptor, ended.set)
    try:
        await ended.wait()
    finally:
        loop.remove_reader(descriptor)
        os.close(descriptor)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
