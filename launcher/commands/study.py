"""``study``: experiments that are run, drawn and summed up."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Literal

import typer

from launcher.console import plainly, tell
from launcher.scenario import ScenarioFault

app = typer.Typer(no_args_is_help=True, help="Run an experiment; leave figures, and the CSV files they are drawn from.")

Output = Annotated[Path | None, typer.Option(help="Folder to write to; runs/studies/NAME if not given.")]


@app.command()
def localization(
    seeds: Annotated[int, typer.Option(min=2, max=1000, help="Runs of each experiment and control law.")] = 20,
    output: Output = None,
) -> None:
    """Robots find a target by ranges and choose where to go: thesis chapter 2, figures 10 and 12 to 18."""
    with plainly():
        folder = _made(output, "localization", "estimation")
        from launcher.studies.localization import study_localization

        _conclude(study_localization(folder, seeds, tell), folder)


@app.command()
def ranges(
    data: Annotated[Path, typer.Option(help="Folder with path.csv, beacons.csv and ranges.csv.")],
    find: Annotated[
        Literal["beacons", "target"], typer.Option(help="What to localise: the beacons, or the node that moves.")
    ] = "beacons",
    bound_m: Annotated[
        float | None, typer.Option("--bound", min=1e-3, max=1e3, help="Largest error of a range, metres; else learned.")
    ] = None,
    speed_m_s: Annotated[
        float, typer.Option("--speed", min=0.0, max=1e3, help="Most that the moving node does, metres a second.")
    ] = 1.0,
    output: Output = None,
) -> None:
    """Localise the beacons, or the moving node, of a data set from its ranges alone."""
    with plainly():
        from launcher.studies.range_data import read_range_data

        known = read_range_data(data)
        folder = _made(output, f"ranges-{data.resolve().name}-{find}", "estimation")
        from launcher.studies.ranges import study_beacons, study_target

        if find == "beacons":
            text = study_beacons(folder, known, bound_m, tell)
        else:
            text = study_target(folder, known, speed_m_s, bound_m, tell)
        _conclude(text, folder)


@app.command()
def complexity(
    quick: Annotated[bool, typer.Option("--quick", help="Only maps of at most 200 cells; some seconds.")] = False,
    output: Output = None,
) -> None:
    """Count cells and time every planning algorithm: thesis §4.1, Tables 1 to 3 and figures 41 to 50."""
    with plainly():
        folder = _made(output, "complexity", "planning")
        from launcher.studies.complexity import study_complexity

        _conclude(study_complexity(folder, quick, tell), folder)


@app.command()
def weights(
    shown: Annotated[
        Literal["room1", "room2", "room3", "l457mod"], typer.Option("--map", help="Whose aspect cells are drawn.")
    ] = "room3",
    output: Output = None,
) -> None:
    """Weigh the edges of the mutual visibility graphs: thesis §3.3.1, figures 25 to 30."""
    with plainly():
        folder = _made(output, "weights", "planning")
        from launcher.studies.weights import study_weights

        _conclude(study_weights(folder, shown, tell), folder)


@app.command()
def redeployment(
    number: Annotated[int, typer.Option(min=2, max=10_000, help="Redeployments of each map and team size.")] = 200,
    seed: Annotated[int, typer.Option(min=0, help="Of the random places.")] = 0,
    output: Output = None,
) -> None:
    """How much the optimum over all trees saves beside searches near the present tree, on the thesis' maps."""
    with plainly():
        folder = _made(output, "redeployment", "planning")
        from launcher.studies.redeployment import study_redeployment

        _conclude(study_redeployment(folder, number, seed, tell=tell), folder)


@app.command()
def motion(
    number: Annotated[int, typer.Option(min=2, max=10_000, help="Redeployments of each map and team size.")] = 300,
    seed: Annotated[int, typer.Option(min=0, help="Of the random places.")] = 0,
    output: Output = None,
) -> None:
    """How often a team keeps its network on the way to the next deployment: at once, by the thesis' hybrid, by ours."""
    with plainly():
        folder = _made(output, "motion", "planning")
        from launcher.studies.motion import study_motion

        _conclude(study_motion(folder, number, seed, tell=tell), folder)


@app.command()
def topology(
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="Missions of each scenario and loss.")] = 2,
    duration_s: Annotated[float, typer.Option("--duration", min=10.0, max=3600.0, help="Of each, seconds.")] = 60.0,
    output: Output = None,
) -> None:
    """Trees by the leader's optimum and by the auction of all, over the same simulated missions."""
    with plainly():
        folder = _made(output, "topology", "planning")
        from launcher.studies.topology import study_topology

        _conclude(study_topology(folder, seeds, duration_s, tell=tell), folder)


def _made(output: Path | None, name: str, package: Literal["planning", "estimation"]) -> Path:
    """The folder to write to, made before any work is done for it; then the package's kernels.

    Raises:
        ScenarioFault: one sentence, where nothing can be written there.
    """
    folder = output or Path("runs") / "studies" / name
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise ScenarioFault(
            f"--output {folder}: cannot be made a folder ({problem.strerror}); name one that you may write to"
        ) from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise ScenarioFault(f"--output {folder}: you may not write to that folder; name another")
    from launcher.kernels import warm_up

    warm_up(tell, [package])
    return folder


def _conclude(text: str, folder: Path) -> None:
    tell(text.rstrip())
    tell(f"Figures and tables: {folder}")
