"""A live run, from a scenario file to a folder with a recording: check, start, watch, stop, merge, measure.

While it runs, peers are killed and paused and links are cut on the scenario's timetable of faults, by keys on the
terminal, and by ``sightline fault``.
"""

from __future__ import annotations

import asyncio
import contextlib
import signal
import socket
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from msgspec import structs
from rich.console import Console

from agents.body_places import BODIES, BodyPlaces
from agents.casting import Casting
from agents.mission import Mission
from agents.runtime import import_all
from agents.shared_estimate import SharedEstimate
from launcher.chaos import Chaos, LiveFault, check_live
from launcher.chaos_control import KEYS, hearing_keys, listening, obey, order_of_key
from launcher.console import busy, tell
from launcher.disk_room import RoomWatch, check_room
from launcher.fault_order import Answer, Order
from launcher.fault_timetable import FaultyTimetable, Timetable, describe, read_timetable
from launcher.ground import Ground
from launcher.journal import OBSERVER, Journal
from launcher.observer import Status, TeamView
from launcher.preparation import Preparation, prepare
from launcher.processes import age_s
from launcher.replacement import Replacements
from launcher.run_folder import RUNS, RunFolder
from launcher.scenario import ScenarioFault
from launcher.status import shown
from launcher.supervisor import Supervisor
from protocol.inbox import Inbox
from protocol.link_faults import LINKS, LinkTable
from protocol.zenoh_bus import ZenohBus, free_endpoints

STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Any of these ends the run in order."""

LOOK_S = 0.2
"""How often the launcher looks at what it has heard."""
LISTENER = 1 << 40
"""Incarnation of an estimate that has no ranges of its own: no process has such a one."""


@dataclass
class Course:
    """What a run has come to."""

    folder: RunFolder
    obeyed_after_s: float | None = None
    """From the command to the first moment at which all robots followed a deployment."""
    interrupted: bool = False
    failure: str = ""
    """Why the run had to end, if it had to."""


def run(
    file: Path, name: str | None, duration_s: float | None, console: Console, timetable: Path | None = None
) -> Course:
    """Run a scenario with real processes until its time is over, or Ctrl-C, or the agent is lost, whom nobody replaces.

    Args:
        file: the scenario.
        name: of the run, or None.
        duration_s: replaces the scenario's, unless None.
        console: where to say what happens.
        timetable: file of faults that happen besides those of the scenario, or None.

    Raises:
        ScenarioFault: the scenario, or the timetable, cannot be run; nothing has been started then.
        FaultyTimetable: the timetable does not fit.
    """
    tell(f"Checking {file} ...", console)
    with busy("Checking ..."):
        preparation = prepare(file, lambda text: tell(text, console))
        import_all()  # before mission time begins
    for warning in preparation.warnings:
        tell(f"Warning: {warning}", console, "yellow")
    mission = preparation.mission
    endpoints = reserve_endpoints(file, preparation)
    roster = tuple(structs.replace(entry, endpoint=to) for entry, to in zip(mission.roster, endpoints, strict=True))
    mission = structs.replace(
        mission, roster=roster, duration_s=duration_s or mission.duration_s, epoch_unix_s=time.time()
    )
    faults = _faults(file, preparation, mission, timetable)
    for fault in faults:
        if mission.duration_s is not None and fault.at_s >= mission.duration_s:
            text = f"the run is over at {mission.duration_s:g} s, before {describe(fault)} at {fault.at_s:g} s"
            tell(f"Warning: {text}", console, "yellow")
    if scarce := check_room(RUNS if RUNS.is_dir() else Path(), len(roster), mission.duration_s):
        tell(f"Warning: {scarce}", console, "yellow")
    folder = RunFolder.create(name, mission.team)
    folder.write(file, mission, preparation.environment)
    robots = f"{len(mission.robots)} robot" + "s" * (len(mission.robots) != 1)
    tell(
        f"Starting {len(roster)} processes (base station, agent, {robots}) for {folder.path}; Ctrl-C stops them.",
        console,
    )
    course = Course(folder)
    names = [entry.name for entry in roster]
    bodies = BodyPlaces(folder.path / BODIES, names, create=True)
    links = LinkTable(folder.path / LINKS, names, create=True)
    view = TeamView(mission, preparation.environment, _listener(preparation, mission))
    journal = Journal(mission, folder.path, console)
    supervisor = Supervisor(
        mission, folder.path, preparation.planner, journal.tell, journal.crashed, bodies.get, journal.revived
    )
    stop = asyncio.Event()
    _launch(supervisor, stop)
    tell("Processes: " + ", ".join(f"{peer.name} {peer.pid}" for peer in supervisor.peers.values()), console)
    ground = Ground(folder.path / mission.map_path, preparation.environment)
    team = Team(mission, view, supervisor, links, journal, Replacements(mission, ground, supervisor, bodies.get))
    try:
        asyncio.run(_accompany(team, faults, course, stop, console))
    finally:
        journal.close()
    return course


@dataclass(frozen=True)
class Team:
    """A running team, and what the launcher has of it."""

    mission: Mission
    view: TeamView
    supervisor: Supervisor
    links: LinkTable
    journal: Journal
    replacements: Replacements


def _listener(preparation: Preparation, mission: Mission) -> SharedEstimate | None:
    """What the team knows of an independent agent, for the status; None of one that announces."""
    if mission.announces:
        return None
    sight = Casting(mission, preparation.environment, preparation.planner).sight
    return SharedEstimate(mission, mission.base_station.name, LISTENER, sight)


def _faults(file: Path, preparation: Preparation, mission: Mission, timetable: Path | None) -> tuple[LiveFault, ...]:
    """The faults of the scenario and of a file, held against the mission."""
    names = [entry.name for entry in mission.roster]
    faults: tuple[LiveFault, ...] = ()
    place = file
    try:
        faults = check_live(Timetable(faults=preparation.scenario.faults), mission)
        if timetable is not None:
            place = timetable
            faults += check_live(read_timetable(timetable, names), mission)
    except FaultyTimetable as problem:  # says its file
        raise ScenarioFault(str(problem)) from problem
    except ScenarioFault as problem:
        raise ScenarioFault(f"{place}: {problem}") from problem
    return faults


def _launch(supervisor: Supervisor, stop: asyncio.Event) -> None:
    """Start the processes. A signal to stop is noted from now on: what has been started is to be stopped in order.

    Forks would inherit our handlers and lose a signal that comes before they listen; it waits for them instead.
    """
    for number in STOPPING:
        signal.signal(number, lambda *_: stop.set())
    signal.pthread_sigmask(signal.SIG_BLOCK, STOPPING)
    try:
        supervisor.launch()
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPPING)


def reserve_endpoints(file: Path, preparation: Preparation) -> list[str]:
    """An endpoint for each peer. Raises ScenarioFault where a port is taken."""
    count, base_port = len(preparation.mission.roster), preparation.scenario.network.base_port
    if base_port is None:
        return free_endpoints(count)
    for port in range(base_port, base_port + count):
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # closed connections do not count
            try:
                probe.bind(("127.0.0.1", port))
                probe.listen()
            except OSError as problem:
                raise ScenarioFault(
                    f"{file}: network.base_port: port {port} on 127.0.0.1 is taken; choose another base_port "
                    f"({count} ports from it on are used), or leave it out and free ones are found"
                ) from problem
    return [f"tcp/127.0.0.1:{port}" for port in range(base_port, base_port + count)]


async def _accompany(
    team: Team, faults: Sequence[LiveFault], course: Course, stop: asyncio.Event, console: Console
) -> None:
    """Watch the team until the end, or until it is to stop, then stop it."""
    loop = asyncio.get_running_loop()
    for number in STOPPING:
        loop.add_signal_handler(number, stop.set)
    mission, view, supervisor = team.mission, team.view, team.supervisor
    inbox: Inbox[None] = Inbox()
    bus: ZenohBus | None = None

    def mission_time() -> float:
        return time.time() - mission.epoch_unix_s

    def leader() -> str | None:
        return view.leader(mission_time())

    chaos = Chaos(mission, supervisor, team.links, leader, mission_time, team.journal.note)
    room = RoomWatch(course.folder.path, lambda text: tell(f"Warning: {text}", console, "yellow"))
    try:
        supervisor.watch()
        bus = ZenohBus.open(
            mission.team, OBSERVER, None, [entry.endpoint for entry in mission.roster], inbox.put, operator=True
        )
        chaos.play(faults)
        async with contextlib.AsyncExitStack() as stack:
            await _take_orders(stack, chaos, team, course.folder.path, console)
            show = stack.enter_context(shown(mission, console))
            while not stop.is_set():
                now_s = mission_time()
                for event in inbox.wait(0.0):
                    if event is not None:
                        view.handle(event, now_s)
                status = view.status(now_s)
                show(status, now_s)
                _note_obedience(status, mission, course, console)
                room.look()
                course.failure = _irreplaceable_loss(supervisor, mission)
                if course.failure or (mission.duration_s is not None and now_s >= mission.duration_s):
                    break
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(stop.wait(), LOOK_S)
    finally:
        course.interrupted = stop.is_set()
        chaos.close()
        try:
            tell("Stopping ...", console)
        finally:  # also when nobody reads what we print any more
            # The bus of the launcher closes beside the stopping, which must not wait for it.
            closing = loop.run_in_executor(None, bus.close) if bus is not None else None
            await supervisor.stop()
            if closing is not None:
                await closing


async def _take_orders(
    stack: contextlib.AsyncExitStack, chaos: Chaos, team: Team, folder: Path, console: Console
) -> None:
    """Let people have faults happen, with ``sightline fault`` and with keys, until the stack is closed."""
    names, robots = [entry.name for entry in team.mission.roster], [entry.name for entry in team.mission.robots]

    def carry_out(order: Order) -> Answer:
        return obey(order, chaos, team.replacements, names)

    def press(key: str) -> None:
        order = order_of_key(key, robots)
        if order is not None and not (answer := carry_out(order)).done:
            tell(answer.text[:1].upper() + answer.text[1:], console)

    try:
        await stack.enter_async_context(listening(folder, carry_out))
    except OSError as problem:
        tell(f"Warning: `sightline fault` will not reach this run: {problem.strerror}", console, "yellow")
    if console.is_terminal and stack.enter_context(hearing_keys(press)):
        tell(KEYS, console)


def _note_obedience(status: Status, mission: Mission, course: Course, console: Console) -> None:
    """Say once how long it took until every robot followed a deployment."""
    robots = {entry.name for entry in mission.robots}
    if course.obeyed_after_s is None and all(peer.obeying for peer in status.peers if peer.name in robots):
        course.obeyed_after_s = age_s()
        tell(f"First deployment obeyed {course.obeyed_after_s:.1f} s after the command.", console)


def _irreplaceable_loss(supervisor: Supervisor, mission: Mission) -> str:
    """A sentence if the agent will not come back. Whoever else is lost, the others go on."""
    agent = supervisor.peers[mission.tracked_agent.name]
    if not agent.gone:
        return ""
    why = "could not be kept alive" if agent.given_up else "was killed for good"
    return f"the run ended because {agent.name} {why}, and without it nothing is left to do"
