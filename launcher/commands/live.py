"""``demo``, ``run``, ``goal`` and ``fault``: teams of real processes."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from launcher.console import LONGEST_S, busy, check_option, complain, out, plainly, read_point, tell
from launcher.scenario import ScenarioFault, find_scenario, packaged

if TYPE_CHECKING:
    from launcher.report import Metrics
    from launcher.run import Course

DEMO = "office"

Name = Annotated[str | None, typer.Option(help="Name of the run's folder in runs/; scenario and time if not given.")]
Duration = Annotated[
    float | None, typer.Option("--duration", help="Seconds to run, 1 to 86400, instead of the scenario's duration.")
]


def demo(name: Name = None, duration_s: Duration = None) -> None:
    """Run the embedded scenario: an agent walks through an office, and robots keep it linked to the base station."""
    with plainly():
        _run(find_scenario(DEMO), name, duration_s)


def run(
    scenario: Annotated[str, typer.Argument(help=f"A TOML file, or one of {', '.join(packaged())}.")],
    name: Name = None,
    duration_s: Duration = None,
    chaos: Annotated[
        Path | None,
        typer.Option(help="TOML file of faults on a timetable, besides the scenario's own; see docs/faults.md."),
    ] = None,
) -> None:
    """Run a scenario with a process for each peer, watch it live, and leave a recording in runs/."""
    with plainly():
        _run(find_scenario(scenario), name, duration_s, chaos)


def goal(
    place: Annotated[str, typer.Argument(metavar="X,Y", help="Where to go, in metres.")],
    run: Annotated[str | None, typer.Option(help="Folder or name of the run; the latest if not given.")] = None,
) -> None:
    """Send the tracked agent of a running team somewhere."""
    from launcher.operator import send_goal
    from launcher.run_folder import RunFolder

    with plainly():
        x, y = read_point(place, "X,Y")
        reply = send_goal(RunFolder.find(run).read_mission(), (x, y))
        if not reply.accepted:
            raise ScenarioFault(f"the agent refuses {x:g},{y:g}: {reply.reason}")
        tell(f"The agent goes to {x:g}, {y:g}.")


def fault(
    run: Annotated[str, typer.Argument(metavar="RUN", help="Folder or name of a run, or latest.")],
    action: Annotated[
        Literal["kill", "pause", "cut", "heal", "start"],
        typer.Argument(metavar="ACTION", help="kill, pause, cut, heal or start."),
    ],
    who: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[PEER]...",
            help="A name on the roster, or leader; cut: one to cut off, or two; heal: all if none is named; "
            "start: one that has been killed for good, or given up.",
        ),
    ] = None,
    for_s: Annotated[
        float | None, typer.Option("--for", help="Seconds; else killed and cut for good, paused for 3 s.")
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(metavar="X,Y", help="start: another robot of that name begins here; else where the last ended."),
    ] = None,
) -> None:
    """Have something go wrong in a running team: kill or pause a peer, cut links; or heal them, start a peer again."""
    from launcher.fault_order import Order, give_order
    from launcher.run_folder import RunFolder

    with plainly():
        check_option("--for", for_s, 0.05, LONGEST_S, "seconds")
        folder = RunFolder.find(run)
        place = None if at is None else read_point(at, "--at")
        order = Order(action=action, who=tuple(who or ()), for_s=for_s, at=place)
        tell(give_order(folder, folder.read_mission(), order) + ".")


def _run(file: Path, name: str | None, duration_s: float | None, chaos: Path | None = None) -> None:
    """Run, then merge, measure and say where everything is."""
    check_option("--duration", duration_s, 1, LONGEST_S, "seconds")
    from launcher.run import run as run_team

    course = run_team(file, name, duration_s, out, chaos)
    failures = [*_conclude(course).failures, *([course.failure] if course.failure else [])]
    for failure in failures:
        complain(failure)
    if failures:
        raise typer.Exit(1)
    if course.interrupted:
        raise typer.Exit(130)


def _conclude(course: Course) -> Metrics:
    """Merge and measure; say what came of it and where it is."""
    from launcher.conclusion import conclude
    from launcher.report_table import render

    folder = course.folder
    with busy("Merging the recordings ..."):
        metrics = conclude(folder)
    out.print(render(metrics))
    tell(f"Recording  {folder.recording}")
    tell(f"Metrics    {folder.metrics_file}")
    tell(f"Open it    {_command()} review {folder.path}")
    return metrics


def _command() -> str:
    """How this program is called from here: its name where the environment is active, else the way that was taken."""
    return "sightline" if shutil.which("sightline") else sys.argv[0]
