"""How people let faults happen in a running team, and mend them: keys on its terminal, ``sightline fault`` elsewhere.

The launcher listens on a socket in the run's folder (:mod:`launcher.fault_order`) for as long as the team runs.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import sys
import termios
import tty
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from pathlib import Path
from typing import Final

import msgspec

from launcher.chaos import Chaos, LiveFault
from launcher.fault_order import ANSWER_WITHIN_S, CONTROL, MOST_BYTES, Answer, Order, check_order, shortened
from launcher.fault_timetable import LEADER, Cut, Kill, Partition, Pause
from launcher.replacement import Replacements
from launcher.scenario import ScenarioFault

PAUSE_S: Final = 3.0
"""How long a pause lasts if nobody says."""

KEYS_FOR_S: Final = 5.0
"""How long what a key brings about lasts; a pause less, see above."""


def obey(order: Order, chaos: Chaos, replacements: Replacements, names: Sequence[str]) -> Answer:
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
    if order.action == "start":
        obstacle = replacements.start(who[0], order.at)
        return Answer(done=not obstacle, text=obstacle or f"{who[0]} is started")
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
        # Whoever asked may be gone, or say too much; nobody is to be told then.
        with contextlib.closing(writer), contextlib.suppress(OSError, ValueError, TimeoutError):
            line = await asyncio.wait_for(reader.readline(), ANSWER_WITHIN_S)
            try:
                said = answer(msgspec.json.decode(line, type=Order))
            except msgspec.DecodeError as problem:
                said = Answer(done=False, text=f"not understood: {problem}")
            writer.write(msgspec.json.encode(said) + b"\n")
            await asyncio.wait_for(writer.drain(), ANSWER_WITHIN_S)

    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        with shortened(folder) as short:
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
