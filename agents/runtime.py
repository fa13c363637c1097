"""One peer as a process: ``python -m agents.runtime MISSION.json NAME``. Started by the launcher's supervisor.

One thread runs the role: it sleeps until the next message or wake-up, whichever comes first. Computations run in a
second thread and come back as events. A third waits for the signal to end: it arms a watchdog that needs no Python
lock, so that even a process whose main thread hangs is gone two seconds later. Should the launcher die, the kernel
kills this process at once.

Little is imported before the peer is tied to its launcher; the rest follows in :func:`live`, or has been imported by
the launcher of which this process is a fork.
"""

from __future__ import annotations

import argparse
import ctypes
import faulthandler
import gc
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from agents.casting import Casting
    from agents.leader import DeploymentPlanner
    from agents.mission import Mission
    from agents.recorder import Recorder
    from agents.records import AnyRecord
    from agents.role import Compute, JobDone, Written
    from planning.environment import Environment
    from protocol.bus import Deliver
    from protocol.inbox import Inbox

CLOSE_WITHIN_S: Final = 2.0
"""From the signal to end until the process is gone, whatever hangs."""

LINGER_S: Final = 0.15
"""From when a peer listens no more until it leaves: those that end with it shall not take it for lost."""

_PR_SET_PDEATHSIG = 1
_PR_SET_NAME = 15


WOULD_JOIN_WRONGLY: Final = 2
"""Exit status of a peer that must not take part as things are; its log says why. Starting it again changes nothing."""


class AlreadyRun(Exception):
    """A process has been this incarnation before; the text says what to do."""


class Ending:
    """The wish that this process end: SIGTERM or SIGINT."""

    def __init__(self) -> None:
        self.wished = threading.Event()
        self._inbox: Inbox[JobDone | Written] | None = None
        signals = {signal.SIGTERM, signal.SIGINT}
        signal.pthread_sigmask(signal.SIG_BLOCK, signals)  # inherited by every later thread: only sigwait takes them
        threading.Thread(target=self._wait, args=(signals,), name="signals", daemon=True).start()

    def wakes(self, inbox: Inbox[JobDone | Written]) -> None:
        """Have the reader of this inbox woken when the wish comes."""
        self._inbox = inbox
        if self.wished.is_set():
            inbox.wake()

    def _wait(self, signals: set[signal.Signals]) -> None:
        signal.sigwait(signals)
        faulthandler.dump_traceback_later(CLOSE_WITHIN_S, exit=True)
        self.wished.set()
        if self._inbox is not None:
            self._inbox.wake()


class Worker:
    """A thread beside the control loop that runs computations one after the other."""

    def __init__(self, inbox: Inbox[JobDone | Written]) -> None:
        self._inbox = inbox
        self._jobs: SimpleQueue[Compute] = SimpleQueue()
        threading.Thread(target=self._run, name="worker", daemon=True).start()

    def execute(self, compute: Compute) -> None:
        """Queue a computation; its :class:`~agents.role.JobDone` goes to the inbox."""
        self._jobs.put(compute)

    def _run(self) -> None:
        from agents.role import JobDone

        while True:
            compute = self._jobs.get()
            begun_s = time.perf_counter()
            result, failure = None, ""
            try:
                result = compute.function(*compute.arguments)
            except Exception as problem:
                traceback.print_exc()
                failure = f"{type(problem).__name__}: {problem}"
            self._inbox.put(JobDone(compute.job, result, time.perf_counter() - begun_s, failure))


def tie_to(launcher: int) -> None:
    """Have the kernel kill this process when its launcher dies, or end now if that has happened.

    No signal that can wait: to a process that is paused it would never be delivered.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "cannot tie this process to its launcher")
    if os.getppid() != launcher:
        os._exit(1)


def call_oneself(name: str) -> None:
    """Be called so by ``ps``, ``top`` and ``pgrep``: a fork has its launcher's command line."""
    ctypes.CDLL(None).prctl(_PR_SET_NAME, name.encode(), 0, 0, 0)


def import_all() -> None:
    """Import what a peer needs, so that forks find it there. The recorder alone takes half a second."""
    for module in ("agents.casting", "agents.recorder", "agents.shell", "protocol.inbox", "protocol.zenoh_bus"):
        import_module(module)


def live(
    mission: Mission, folder: Path, name: str, incarnation: int, ending: Ending, planner: DeploymentPlanner | None
) -> None:
    """Be the peer until the end is wished for.

    Args:
        mission: whose roster holds ``name``.
        folder: of the run; the map lies there, and the recording goes to ``recordings/`` in it.
        name: of the peer.
        incarnation: how many processes bore the name before.
        ending: says when it is time.
        planner: of the team, if there is one already.
    """
    from agents.body_places import BODIES, BodyPlaces
    from agents.casting import Casting
    from agents.records import LogLine
    from agents.role import JobDone, Written
    from agents.shell import PeerShell
    from agents.voter_file import VoterFile
    from planning.environment import Environment
    from protocol.inbox import Inbox
    from protocol.link_faults import LINKS, LinkFilter, LinkTable
    from protocol.zenoh_bus import ZenohBus

    # What has been imported stays. To look through it for garbage would stop everything for a fifth of a second, and
    # copy the memory that forks share.
    gc.freeze()
    epoch_s = time.clock_gettime(time.CLOCK_BOOTTIME) - (time.time() - mission.epoch_unix_s)

    def now() -> float:
        # Mission time follows this clock from here on: a wall clock may be set while we drive. It goes on while the
        # machine is suspended, which leases count on (docs/election.md).
        return time.clock_gettime(time.CLOCK_BOOTTIME) - epoch_s

    environment = Environment.load(folder / mission.map_path)
    casting = Casting(mission, environment, planner)
    voter_file = VoterFile(folder, name)
    promise = voter_file.read(team=mission.team, incarnation=incarnation) if name in mission.voters.voters else None
    role, driver = casting.cast(name, incarnation=incarnation, promise=promise, now_s=now())
    file = folder / "recordings" / f"{name}.{incarnation}.rrd"
    recorder = open_recorder(file, mission, name, incarnation, environment, casting)

    def record(time_s: float, what: AnyRecord) -> None:
        recorder.record(time_s, name, what)
        if isinstance(what, LogLine):
            print(f"{time_s:8.3f} {what.level}: {what.text}", file=sys.stderr, flush=True)

    inbox: Inbox[JobDone | Written] = Inbox()
    worker = Worker(inbox)
    voter_file.serve(inbox.put)
    ending.wakes(inbox)
    endpoints = [entry.endpoint for entry in mission.roster]
    peers = [entry.name for entry in mission.roster]
    bodies = BodyPlaces(folder / BODIES, peers) if (folder / BODIES).exists() else None
    deliver: Deliver = inbox.put
    if (folder / LINKS).exists():
        links = LinkFilter(LinkTable(folder / LINKS, peers), name, inbox.put, mission.seed)
        links.watch()
        deliver = links.deliver
    bus = ZenohBus.open(mission.team, name, mission.entry(name).endpoint, endpoints, deliver, kinds=role.hears)
    try:
        shell = PeerShell(
            role,
            driver,
            bus,
            name=name,
            team=mission.team,
            incarnation=incarnation,
            peers=peers,
            now=now,
            wall_clock=time.time,
            record=record,
            execute=worker.execute,
            persist=voter_file.write,
        )
        shell.start()
        while not ending.wished.is_set():
            for event in inbox.wait(shell.wake_at_s - now()):
                if ending.wished.is_set():
                    break
                if isinstance(event, JobDone):
                    shell.finish(event)
                elif isinstance(event, Written):
                    shell.written(event)
                else:
                    shell.take(event)
            if now() >= shell.wake_at_s:
                shell.wake()
                if bodies is not None:
                    bodies.put(name, driver.pose())
        time.sleep(LINGER_S)
    finally:
        bus.close()
        recorder.close()
        if inbox.dropped:
            print(f"{now():8.3f} {inbox.dropped} messages were dropped unread", file=sys.stderr)


def _read_mission(file: Path, name: str, position: str | None) -> Mission:
    """The mission of a file; the peer starts at ``position`` if that is given."""
    from msgspec import json, structs

    from agents.mission import Mission

    mission = json.decode(file.read_bytes(), type=Mission)
    if position is None:
        return mission
    x, y = map(float, position.split(","))
    moved = structs.replace(mission.entry(name), start=(x, y))
    return structs.replace(mission, roster=tuple(moved if entry.name == name else entry for entry in mission.roster))


def open_recorder(
    file: Path, mission: Mission, name: str, incarnation: int, environment: Environment, casting: Casting
) -> Recorder:
    """The recorder of a peer; that of the base station draws the map and says how the recording opens.

    It does so beside the control loop, which takes a third of a second, and not again when it is started again. Where
    nothing can be written the peer does its work unrecorded: the team needs it.

    Raises:
        AlreadyRun: a process of this incarnation has recorded.
    """
    from agents.recorder import NullRecorder, RerunRecorder

    if file.exists():
        raise AlreadyRun(
            f"{file} exists, so that an earlier process was this incarnation of {name}, and what it promised and said "
            f"would be mistaken for this one's; start {name} with an --incarnation of its own, greater than all before"
        )
    try:
        recorder = RerunRecorder(file, team=mission.team, recording_id=file.parent.parent.name, peer=name)
        recorder.know(mission)
    except (OSError, RuntimeError) as problem:  # rerun raises the latter when the disk is full
        print(f"{name} goes on without a recording, {file} cannot be written: {problem}", file=sys.stderr, flush=True)
        return NullRecorder()

    def draw() -> None:
        graph = casting.planner().graph
        recorder.log_map(environment, graph.outlines, graph.positions)
        recorder.log_blueprint(mission)

    if mission.entry(name).role == "base_station" and incarnation == 0:
        threading.Thread(target=draw, name="drawing", daemon=True).start()
    return recorder


def main(arguments: Sequence[str] | None = None, planner: DeploymentPlanner | None = None) -> None:
    """Entry of the process, which ends in here.

    Args:
        arguments: of the command line.
        planner: of the team, which a fork has from its launcher.
    """
    parser = argparse.ArgumentParser(prog="python -m agents.runtime", description="One peer of a mission.")
    parser.add_argument("mission", type=Path, help="mission.json in the folder of a run")
    parser.add_argument("name", help="of the peer, as on the roster")
    parser.add_argument("--incarnation", type=int, default=0, help="how many processes bore the name before")
    parser.add_argument("--launcher", type=int, help="process whose death ends this one")
    parser.add_argument("--position", metavar="X,Y", help="where its body is by now; at its start if not given")
    options = parser.parse_args(arguments)
    ending = Ending()
    if options.launcher is not None:
        tie_to(options.launcher)
    from protocol.promises import VoterFileFault
    from protocol.roster import RosterFault

    call_oneself(options.name)
    print(f"--- {options.name}, incarnation {options.incarnation}, process {os.getpid()}", flush=True)
    status = 0
    try:
        mission = _read_mission(options.mission, options.name, options.position)
        live(mission, options.mission.parent, options.name, options.incarnation, ending, planner)
    except (AlreadyRun, RosterFault, VoterFileFault) as fault:
        print(f"{options.name} does not join: {fault}", file=sys.stderr)
        status = WOULD_JOIN_WRONGLY
    except Exception:
        traceback.print_exc()
        status = 1
    sys.stderr.flush()
    # All is closed; the threads of the worker and of zenoh need not be waited for, and could not be relied on to end.
    os._exit(status)


if __name__ == "__main__":
    main()
