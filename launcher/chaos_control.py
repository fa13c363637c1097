"""How people let faults happen in a running team: keys on its terminal, and ``sightline fault`` from another one.

The launcher listens on a socket in the run's folder for as long as the team runs. Who may write there may give orders;
there is one order to a connection, and one sentence in reply.
"""

from __future__ import annotations

import asyncio
import contextlib
import difflib
import os
import socket
import sys
import termios
import tty
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from pathlib import Path
from typing import Final, Literal, TypeAlias

import msgspec

from agents.mission import Mission
from launcher.chaos import Chaos, LiveFault
from launcher.fault_timetable import LEADER, Cut, Kill, Partition, Pause
from launcher.run_folder import RunFolder
from launcher.scenario import ScenarioFault

Action: TypeAlias = Literal["kill", "pause", "cut", "heal"]

CONTROL: Final = "control"
"""Name of the socket in the folder of a run."""

PAUSE_S: Final = 3.0
"""How long a pause lasts if nobody says."""

KEYS_FOR_S: Final = 5.0
"""How long what a key brings about lasts; a pause less, see above."""

MOST_BYTES: Final = 4096
ANSWER_WITHIN_S: Final = 5.0


class Order(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What somebody wants to go wrong."""

    action: Action
    who: tuple[str, ...] = ()
    """Names on the roster, or ``leader``."""
    for_s: float | None = None


class Answer(msgspec.Struct, frozen=True, kw_only=True):
    """What came of it."""

    done: bool
    text: str


def check_order(order: Order, names: Sequence[str]) -> None:
    """Hold an order against the roster.

    Raises:
        ScenarioFault: it names somebody who is not there, or not as many peers as it must.
    """
    for name in order.who:
        if name not in names and name != LEADER:
            near = difflib.get_close_matches(name, [*names, LEADER], n=1, cutoff=0.5)
            hint = f"did you mean {near[0]}" if near else f"choose one of {', '.join([*names, LEADER])}"
            raise ScenarioFault(f"no peer is called {name}: {hint}")
    most = {"kill": 1, "pause": 1, "cut": 2, "heal": 1}[order.action]
    if len(order.who) > most or (not order.who and order.action != "heal"):
        wanted = {
            "cut": "one peer to cut off, or two that are to be cut off from each other",
            "heal": "one peer at most",
        }
        raise ScenarioFault(f"{order.action}: name {wanted.get(order.action, 'one peer, or leader')}")
    if len({*order.who}) < len(order.who):
        raise ScenarioFault(f"cut: {order.who[0]} cannot be cut off from itself; name two peers")


def obey(order: Order, chaos: Chaos, names: Sequence[str]) -> Answer:
    """Do what somebody wants."""
    try:
        check_order(order, names)
    except ScenarioFault as problem:
        return Answer(done=False, text=str(problem))
    leader = chaos.leader()
    if LEADER in order.who and leader is None:
        return Answer(done=False, text="nobody is known to lead at the moment; try again in a second")
    who = tuple(leader if name == LEADER and leader else name for name in order.who)
    if order.action == "heal":
        healed = chaos.heal(who[0] if who else None)
        return Answer(done=True, text=f"{healed} faults of links ended" if healed != 1 else "1 fault of links ended")
    faults: dict[str, Callable[[], tuple[LiveFault, ...]]] = {
        "kill": lambda: (Kill(at_s=0.0, for_s=order.for_s, who=who[0]),),
        "pause": lambda: (Pause(at_s=0.0, for_s=order.for_s or PAUSE_S, who=who[0]),),
        "cut": lambda: (
            (Partition(at_s=0.0, for_s=order.for_s, group=who),)
            if len(who) == 1
            else tuple(
                Cut(at_s=0.0, for_s=order.for_s, speakers=(one,), hearers=(other,)) for one, other in (who, who[::-1])
            )
        ),
    }
    for fault in faults[order.action]():
        if obstacle := chaos.begin(fault):
            return Answer(done=False, text=obstacle)
    done = {"kill": "is killed", "pause": "is paused", "cut": "is cut off"}[order.action]
    return Answer(done=True, text=f"{' and '.join(who)} {done if len(who) == 1 else 'are cut off from each other'}")


@contextlib.asynccontextmanager
async def listening(folder: Path, answer: Callable[[Order], Answer]) -> AsyncIterator[None]:
    """Take orders on the socket in a run's folder. Raises OSError where the file system has no sockets."""

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            line = await asyncio.wait_for(reader.readline(), ANSWER_WITHIN_S)
            try:
                said = answer(msgspec.json.decode(line, type=Order))
            except msgspec.DecodeError as problem:
                said = Answer(done=False, text=f"not understood: {problem}")
            writer.write(msgspec.json.encode(said) + b"\n")
            await asyncio.wait_for(writer.drain(), ANSWER_WITHIN_S)
        except (OSError, ValueError, TimeoutError):
            pass  # whoever asked is gone, or says too much
        finally:
            writer.close()

    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        with _short(folder) as short:
            listener.bind(str(short / CONTROL))
        server = await asyncio.start_unix_server(serve, sock=listener, limit=MOST_BYTES)
    except OSError:
        listener.close()
        raise
    try:
        yield
    finally:
        server.close()
        (folder / CONTROL).unlink(missing_ok=True)


def give_order(run: RunFolder, mission: Mission, order: Order) -> str:
    """Have an order carried out in a running team; a sentence about what has been done.

    Raises:
        ScenarioFault: the run is over, the order does not fit the team, or it could not be carried out.
    """
    check_order(order, [entry.name for entry in mission.roster])
    with _short(run.path) as short, socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        connection.settimeout(ANSWER_WITHIN_S)
        try:
            connection.connect(str(short / CONTROL))
            connection.sendall(msgspec.json.encode(order) + b"\n")
            with connection.makefile("rb") as stream:
                answer = msgspec.json.decode(stream.readline(MOST_BYTES), type=Answer)
        except TimeoutError as problem:
            raise ScenarioFault(f"the launcher of {run.path} does not answer; is it stopped? Try again") from problem
        except (OSError, msgspec.DecodeError) as problem:
            raise ScenarioFault(
                f"{run.path} is over, or was not started by `sightline run`: start a team with it, "
                "and name the folder of that run"
            ) from problem
    if not answer.done:
        raise ScenarioFault(answer.text)
    return answer.text


def order_of_key(key: str, robots: Sequence[str]) -> Order | None:
    """What a key on the terminal of a run means; None if nothing."""
    match key:
        case "k":
            return Order(action="kill", who=(LEADER,), for_s=KEYS_FOR_S)
        case "p":
            return Order(action="pause", who=(LEADER,), for_s=PAUSE_S)
        case "c":
            return Order(action="cut", who=(LEADER,), for_s=KEYS_FOR_S)
        case "h":
            return Order(action="heal")
        case "1" | "2" | "3" | "4" | "5" | "6" | "7" | "8" | "9" if int(key) <= len(robots):
            return Order(action="kill", who=(robots[int(key) - 1],), for_s=KEYS_FOR_S)
    return None


KEYS: Final = (
    f"Keys: k kills the leader and c cuts it off, for {KEYS_FOR_S:g} s each; p pauses it for {PAUSE_S:g} s; "
    f"h heals all links; 1 to 9 kills that robot for {KEYS_FOR_S:g} s."
)


@contextlib.contextmanager
def hearing_keys(pressed: Callable[[str], None]) -> Iterator[bool]:
    """Hear single keys on the terminal, if there is one and we are in its foreground; yields whether so.

    Needs a running event loop, which calls ``pressed``. Ctrl-C remains what it is.
    """
    descriptor = sys.stdin.fileno() if sys.stdin is not None and sys.stdin.isatty() else -1
    if descriptor < 0 or os.tcgetpgrp(descriptor) != os.getpgrp():
        yield False
        return
    loop = asyncio.get_running_loop()
    before = termios.tcgetattr(descriptor)

    def read() -> None:
        typed = os.read(descriptor, 64)
        if not typed:  # the terminal is gone
            loop.remove_reader(descriptor)
        for key in typed.decode("utf-8", "ignore"):
            pressed(key)

    tty.setcbreak(descriptor)
    loop.add_reader(descriptor, read)
    try:
        yield True
    finally:
        loop.remove_reader(descriptor)
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


@contextlib.contextmanager
def _short(folder: Path) -> Iterator[Path]:
    """Another name for a folder, short enough for the name of a socket in it, which may have a hundred characters."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield Path(f"/proc/self/fd/{descriptor}")
    finally:
        os.close(descriptor)
