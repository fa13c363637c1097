"""``demo``, ``run`` and ``goal``: teams of real processes."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from launcher.console import LONGEST_S, busy, check_option, complain, out, plainly, read_point, tell
from launcher.scenario import ScenarioFault, find_scenario

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
    scenario: Annotated[str, typer.Argument(help="A TOML file, or the name of a scenario that comes with Sightline.")],
    name: Name = None,
    duration_s: Duration = None,
) -> None:
    """Run a scenario with a process for each peer, watch it live, and leave a recording in runs/."""
    with plainly():
        _run(find_scenario(scenario), name, duration_s)


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


def _run(file: Path, name: str | None, duration_s: float | None) -> None:
    """Run, then merge, measure and say where everything is."""
    check_option("--duration", duration_s, 1, LONGEST_S, "seconds")
    from launcher.run import run as run_team

    course = run_team(file, name, duration_s, out)
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
