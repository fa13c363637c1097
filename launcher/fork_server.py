"""A process that forks peers when the launcher cannot any more, with everything imported and the planner at hand.

A launcher whose team runs has threads, a bus and an event loop, and must not fork. So it forks one process before that
does nothing but fork peers when it is asked to. A peer that is started again is there as soon as one of the first, and
need not spend two seconds of a processor on imports while its team is short of it. Linux.

A peer is forked by a process that ends at once, and is so adopted by the launcher, which has the kernel pass it orphans
among its descendants (``PR_SET_CHILD_SUBREAPER``). The launcher therefore waits for every peer in the same way, and its
death ends them all. A peer is asked for in one packet, and sends its process id in another one itself, once it is tied
to the launcher.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import signal
import socket
import time
from pathlib import Path
from typing import Final

from agents.leader import DeploymentPlanner
from agents.runtime import call_oneself, tie_to
from launcher.processes import be_peer, leave_launcher

NAME: Final = "sightline-forks"
"""What the process is called by ``ps``; the kernel keeps 15 characters."""

ANSWER_WITHIN_S: Final = 3.0
"""Who asks waits so long, though a fork takes milliseconds: on a machine with much else to do it takes its turn."""

_PR_SET_CHILD_SUBREAPER = 36
_MOST_BYTES = 65536
_ADOPTION_POLL_S = 5e-4


class ServerGone(Exception):
    """The process that forks has ended or does not answer, and has forked nobody."""


class ForkServer:
    """The launcher's end. Make it when all first peers have been forked, so that none of them holds it open.

    Args:
        planner: the team's, for all peers.

    Raises:
        OSError: the launcher cannot adopt peers, or there is no process to be had.
    """

    def __init__(self, planner: DeploymentPlanner) -> None:
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0) != 0:
            raise OSError(ctypes.get_errno(), "the launcher cannot adopt processes")
        launcher = os.getpid()
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.pid = os.fork()
        if self.pid == 0:
            try:
                tie_to(launcher)
                self._socket.close()
                leave_launcher(Path(os.devnull))
                call_oneself(NAME)
                _serve(theirs, launcher, planner)
            finally:
                os._exit(1)  # whatever happens, this is not the launcher any more
        theirs.close()
        self._socket.settimeout(ANSWER_WITHIN_S)

    def fork_peer(self, arguments: list[str], log: Path) -> int:
        """Process id of a peer, a child of this process; as :func:`launcher.processes.fork_peer`.

        Raises:
            ServerGone: use another way from now on. The server is closed.
        """
        answer = b""
        with contextlib.suppress(OSError):  # a timeout is one
            self._socket.send(json.dumps([str(log), *arguments]).encode())
            answer = self._socket.recv(_MOST_BYTES)
        if not answer:
            with contextlib.suppress(OSError):
                self._socket.shutdown(socket.SHUT_RDWR)  # a peer that is late cannot answer any more, and ends
                answer = self._socket.recv(_MOST_BYTES)
        if not answer:
            self.close()
            raise ServerGone
        return int(answer)

    def close(self) -> None:
        """End the process, which has nothing to lose. Peers live on."""
        if self._socket.fileno() < 0:
            return
        self._socket.close()
        os.kill(self.pid, signal.SIGKILL)  # not waited for yet, so that the id is its own
        os.waitpid(self.pid, 0)


def _serve(asked: socket.socket, launcher: int, planner: DeploymentPlanner) -> None:
    """Fork until nobody can ask any more, or a fork fails: the end of this process says so."""
    while packet := asked.recv(_MOST_BYTES):
        log, *arguments = json.loads(packet)
        between = os.fork()
        if between == 0:
            parent = os.getpid()
            if os.fork() == 0:
                while os.getppid() == parent:
                    time.sleep(_ADOPTION_POLL_S)
                # Not before: the kernel takes the end of that process for the one that we are to die of.
                tie_to(launcher)
                asked.send(str(os.getpid()).encode())
                asked.close()
                be_peer(arguments, Path(log), planner)
            os._exit(0)
        if os.waitstatus_to_exitcode(os.waitpid(between, 0)[1]) != 0:
            return
