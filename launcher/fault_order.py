"""An order that something go wrong in a running team, and how it comes to the launcher: a socket in the run's folder.

There is one order to a connection, and one sentence in reply. Who may write in the folder may give orders.
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

Action: TypeAlias = Literal["kill", "pause", "cut", "heal"]

CONTROL: Final = "control"
"""Name of the socket in the folder of a run."""

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
