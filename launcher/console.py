"""What the commands share: where they write, how a fault ends them, how places are written."""

from __future__ import annotations

import contextlib
import math
import reprlib
from collections.abc import Iterator
from typing import Any

import typer
from rich.console import Console

from launcher.scenario import ScenarioFault
from protocol.messages import Point

out = Console()
err = Console(stderr=True)

FARTHEST_M = 1e7
"""The bound of :data:`protocol.messages.Coordinate`."""

LONGEST_S = 86400.0
"""Missions last a day at most, as in scenario files."""

BAD_INPUT = 2
"""Exit status when what was asked for cannot be done as asked."""

_OURS = {"agents", "estimation", "launcher", "maps", "planning", "protocol"}


@contextlib.contextmanager
def plainly() -> Iterator[None]:
    """Turn a fault of the user's input, or of the machine's files, into one sentence and an exit status.

    Our own ``ValueError`` subclasses are such faults by convention; any other exception is a defect and shows itself.
    """
    try:
        yield
    except ValueError as problem:
        if type(problem).__module__.partition(".")[0] not in _OURS:
            raise
        complain(str(problem))
        raise typer.Exit(BAD_INPUT) from problem
    except BrokenPipeError as problem:
        raise typer.Exit(1) from problem
    except OSError as problem:
        complain(f"{problem.filename or 'the machine'}: {problem.strerror or problem}; see to that and try again")
        raise typer.Exit(1) from problem
    except KeyboardInterrupt as problem:
        complain("interrupted")
        raise typer.Exit(130) from problem


def tell(text: str, console: Console = out, style: str = "") -> None:
    """Say a sentence as it is: no markup in it, and no line breaks that a log or a pipe did not ask for."""
    console.print(text, style=style, markup=False, highlight=False, soft_wrap=True)


@contextlib.contextmanager
def busy(text: str) -> Iterator[None]:
    """Show on a terminal that something is going on, from a thread that ends with it; say nothing elsewhere."""
    if not err.is_terminal:
        yield
        return
    with err.status(text):
        yield


def complain(text: str) -> None:
    """Say what is wrong, on stderr, in one line, whatever characters the user's names and files hold."""
    line = "".join(sign if sign.isprintable() else ascii(sign)[1:-1] for sign in text)
    tell(f"sightline: {line}", err, "red")


def print_json(value: Any) -> None:
    """Write a value for programs, in the order of its keys."""
    import json

    typer.echo(json.dumps(value, indent=1, allow_nan=False))


def read_point(text: str, place: str) -> Point:
    """The place in ``X,Y``.

    Raises:
        ScenarioFault: it is no two numbers of metres, or far off.
    """
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        x = y = math.nan
    if not (math.isfinite(x) and math.isfinite(y)):
        raise ScenarioFault(f"{place}: '{text}' is no place; write it in metres as X,Y, for example 3.5,-2")
    if max(abs(x), abs(y)) > FARTHEST_M:
        raise ScenarioFault(f"{place}: '{text}' is farther off than any map; write it in metres as X,Y")
    return x, y


def check_option(option: str, value: float | None, least: float, most: float, unit: str = "") -> None:
    """Hold a number against its bounds. Not left to typer, which answers with a box of several lines.

    Raises:
        ScenarioFault: the number is given, and less than ``least``, more than ``most``, or none (NaN).
    """
    if value is not None and not least <= value <= most:
        bounds = f"from {least:g} to {most:g}{unit and ' ' + unit}"
        raise ScenarioFault(f"{option} {reprlib.repr(value)} is out of range; give a number {bounds}")
