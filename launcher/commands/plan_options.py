"""Options that ``map`` and ``plan`` share, and what both do with them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import typer

from launcher.console import err, tell
from launcher.scenario import ScenarioFault

Decomposition = Annotated[
    Literal["inflection", "aspect"], typer.Option(help="Cells by inflection lines, or also by bitangents.")
]
MaxBitangent = Annotated[
    float | None, typer.Option("--max-bitangent", help="Aspect cells: leave out longer bitangents, in metres.")
]
Radius = Annotated[float, typer.Option("--radius", help="Radius of a robot, in metres, 0 to 100.")]
Tolerance = Annotated[
    float | None,
    typer.Option("--tolerance", help="Of an occupancy grid's outline, in metres, up to 100; two cells if not given."),
]
Picture = Annotated[Path | None, typer.Option(help="Write a picture (.png, .svg or .pdf).")]
Diagram = Annotated[
    tuple[str, Path] | None,
    typer.Option(
        metavar="A-B FILE",
        help="Write the coordination diagram of two members as a picture, such as 1-3 of robots 1 and 3.",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Write JSON for programs.")]

LARGEST_M = 100.0
"""Radius of a robot at most, as in scenario files."""


def check_picture(picture: Path | None, option: str = "--picture") -> None:
    """Raise where a picture cannot be written, before anything is computed for it.

    Raises:
        ScenarioFault: one sentence.
    """
    if picture is None:
        return
    if picture.suffix.lower() not in {".png", ".svg", ".pdf"}:
        raise ScenarioFault(f"{option} {picture}: cannot draw '{picture.suffix}'; use .png, .svg or .pdf")
    if not picture.parent.is_dir():
        raise ScenarioFault(f"{option} {picture}: there is no folder {picture.parent}; make it, or choose another")


def sayer(as_json: bool) -> Callable[[str], None]:
    """Where to say what is being done: not into JSON."""
    return (lambda text: tell(text, err)) if as_json else tell
