"""An order that something go wrong in a running team, or right again: how it comes to the launcher.

By a socket in the run's folder, one order to a connection, and one sentence in reply. Who may write in the folder may
give orders.
"""

from __future__ import annotations

import contextlib
import difflib
import os
import socket
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, Literal, TypeAlias

import msgspec

from agents.mission import Mission
from launcher.fault_timetable import LEADER
from launcher.run_folder import RunFolder
from launcher.scenario import ScenarioFault
from protocol.messages import Point

Action: TypeAlias = Literal["kill", "pause", "cut", "heal", "start"]

CONTROL: Final = "control"
"""Name of the socket in the folder of a run."""

MOST_BYTES: Final = 4096
ANSWER_WITHIN_S: Final = 5.0


class Order(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What somebody wants to go wrong, or right again."""

    action: Action
    who: tuple[str, ...] = ()
    """Names on the roster, or ``leader``."""
    for_s: float | None = None
    at: Point | None = None
    """Of a robot that is started: where its body is, if that is another one than before; metres."""


class Answer(msgspec.Struct, frozen=True, kw_only=True):
    """What came of it."""

    done: bool
    text: str


def check_order(order: Order, names: Sequence[str]) -> None:
    """Hold an order against the roster.

    Raises:
        ScenarioFault: it names somebody who is not there, not as many peers as it must, or what it does not know.
    """
    known = [*names] if order.action == "start" else [*names, LEADER]
    for name in order.who:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
            hint = f"did you mean {near[0]}" if near else f"choose one of {', '.join(known)}"
            raise ScenarioFault(f"no peer is called {name}: {hint}")
    most = 2 if order.action == "cut" else 1
    if len(order.who) > most or (not order.who and order.action != "heal"):
        wanted = {
            "cut": "one peer to cut off, or two that are to be cut off from each other",
            "heal": "one peer at most",
            "start": "one peer",
        }
        raise ScenarioFault(f"{order.action}: name {wanted.get(order.action, 'one peer, or leader')}")
    if len({*order.who}) < len(order.who):
        raise ScenarioFault(f"cut: {order.who[0]} cannot be cut off from itself; name two peers")
    if order.for_s is not None and order.action in ("heal", "start"):
        raise ScenarioFault(f"--for does not go with {order.action}; leave it out")
    if order.at is not None and order.action != "start":
        raise ScenarioFault(f"--at does not go with {order.action}; leave it out")


def give_order(run: RunFolder, mission: Mission, order: Order) -> str:
    """Have an order carried out in a running team; a sentence about what has been done.

    Raises:
        ScenarioFault: the run is over, the order does not fit the team, or it could not be carried out.
    """
    check_order(order, [entry.name for entry in mission.roster])
    with shortened(run.path) as short, socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
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


@contextlib.contextmanager
def shortened(folder: Path) -> Iterator[Path]:
    """Another name for a folder, short enough for the name of a socket in it, which may have a hundred characters."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield Path(f"/proc/self/fd/{descriptor}")
    finally:
        os.close(descriptor)
