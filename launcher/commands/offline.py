"""``simulate`` and ``review``: missions in virtual time, and missions that are over."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from launcher.console import LONGEST_S, busy, check_option, complain, err, out, plainly, print_json, tell
from launcher.scenario import ScenarioFault, find_scenario, packaged

if TYPE_CHECKING:
    from agents.recorder import RerunRecorder
    from launcher.preparation import Preparation
    from launcher.report import Metrics

MOST_SEEDS = 10000
"""More missions than that nobody waits for."""

AsJson = Annotated[bool, typer.Option("--json", help="Write JSON for programs.")]


def simulate(
    scenario: Annotated[str, typer.Argument(help=f"A TOML file, or one of {', '.join(packaged())}.")],
    seeds: Annotated[int, typer.Option(help="Missions with this many seeds, 1 to 10000, from the scenario's on.")] = 1,
    duration_s: Annotated[
        float | None, typer.Option("--duration", help="Seconds, 1 to 86400, instead of the scenario's duration.")
    ] = None,
    record: Annotated[Path | None, typer.Option(help="Write the recording of the first mission (.rrd).")] = None,
    faults: Annotated[
        Path | None,
        typer.Option(help="TOML file of faults on a timetable, besides the scenario's own; see docs/faults.md."),
    ] = None,
    loss: Annotated[float | None, typer.Option(help="Share of messages that each peer misses, 0 to 1.")] = None,
    as_json: AsJson = False,
) -> None:
    """Run the very same roles in virtual time; print what it was worth."""
    with plainly():
        file = find_scenario(scenario)
        check_option("--seeds", seeds, 1, MOST_SEEDS)
        check_option("--duration", duration_s, 1, LONGEST_S, "seconds")
        check_option("--loss", loss, 0, 1)
        if record is not None:
            _check_recording(record)
        _simulate(file, seeds, duration_s, record, faults, loss or 0.0, as_json)


def review(
    run: Annotated[str | None, typer.Argument(help="Folder or name of a run; the latest if not given.")] = None,
    as_json: AsJson = False,
    show: Annotated[bool, typer.Option("--open/--no-open", help="Open the recording in the viewer.")] = True,
) -> None:
    """Print what a run was worth and why its chain changed; open its recording."""
    from msgspec import to_builtins

    from launcher.conclusion import conclude, measure_run
    from launcher.report_table import render
    from launcher.review import open_viewer
    from launcher.run_folder import RunFolder

    with plainly():
        folder = RunFolder.find(run)
        with busy("Measuring ..."):
            # A launcher that was killed has not merged its recordings.
            metrics = measure_run(folder) if folder.recording.is_file() else conclude(folder)
        if as_json:
            print_json({"run": str(folder.path), "recording": str(folder.recording), **to_builtins(metrics)})
            return
        tell(f"Run {folder.path}")
        out.print(render(metrics))
        for failure in metrics.failures:
            complain(f"failed: {failure}")
        if show:
            tell(open_viewer(folder.recording))


def _check_recording(record: Path) -> None:
    if record.suffix != ".rrd":
        raise ScenarioFault(f"--record {record}: a recording is a .rrd file; name it so")
    if not record.parent.is_dir():
        raise ScenarioFault(f"--record {record}: there is no folder {record.parent}; make it, or choose another")


def _simulate(
    file: Path,
    seeds: int,
    duration_s: float | None,
    record: Path | None,
    timetable: Path | None,
    loss: float,
    as_json: bool,
) -> None:
    from msgspec import to_builtins
    from rich.progress import Progress

    from launcher.fault_timetable import Timetable, read_timetable
    from launcher.preparation import prepare
    from launcher.referee import record_verdicts
    from launcher.report import measure
    from launcher.report_table import render
    from launcher.simulation import UNTIL_TOLD_S
    from launcher.simulation import simulate as simulate_mission

    with busy("Checking ..."):
        preparation = prepare(file, lambda text: tell(text, err))
    for warning in preparation.warnings:
        tell(f"Warning: {warning}", err, "yellow")
    mission, environment = preparation.mission, preparation.environment
    faults = preparation.scenario.faults
    if timetable is not None:
        faults += read_timetable(timetable, [entry.name for entry in mission.roster]).faults
    length_s = duration_s or mission.duration_s or UNTIL_TOLD_S
    results: list[tuple[int, Metrics]] = []
    begun_s = time.perf_counter()
    with Progress(console=err, transient=True) as progress:
        for seed in progress.track(range(mission.seed, mission.seed + seeds), description="Simulating ..."):
            recorder = _open_recorder(preparation, record) if record is not None and not results else None
            try:
                trace = simulate_mission(
                    mission, environment, recorder=recorder, duration_s=length_s, seed=seed,
                    planner=preparation.planner, faults=Timetable(faults=faults), loss=loss,
                )  # fmt: skip
                if recorder is not None and not mission.announces:
                    record_verdicts(trace, environment, recorder)
            finally:
                if recorder is not None:
                    recorder.close()
            results.append((seed, measure(trace, environment)))
    took_s = time.perf_counter() - begun_s
    if as_json:
        missions = [{"seed": seed, **to_builtins(metrics)} for seed, metrics in results]
        print_json({"scenario": str(file), "took_s": round(took_s, 3), "missions": missions})
        _judge(results)
        return
    if seeds == 1:
        out.print(render(results[0][1]))
    else:
        out.print(_compare(results))
    speed = seeds * length_s / took_s
    tell(f"{seeds * length_s:.0f} s of missions in {took_s:.1f} s: {speed:.0f} times faster than real time")
    if record is not None:
        tell(f"Recording  {record}")
    _judge(results)


def _judge(results: list[tuple[int, Metrics]]) -> None:
    """Say what must not happen and did, and end with a status that says so too."""
    failures = [f"failed with seed {seed}: {failure}" for seed, metrics in results for failure in metrics.failures]
    for failure in failures:
        complain(failure)
    if failures:
        raise typer.Exit(1)


def _open_recorder(preparation: Preparation, file: Path) -> RerunRecorder:
    """A recorder for a whole team, with the map drawn."""
    from agents.recorder import RerunRecorder

    mission, graph = preparation.mission, preparation.planner.graph
    recorder = RerunRecorder(file, team=mission.team, recording_id=f"{mission.team}-{mission.seed}", peer="simulation")
    recorder.log_map(preparation.environment, graph.outlines, graph.positions)
    recorder.log_blueprint(mission)
    return recorder


def _compare(results: list[tuple[int, Metrics]]) -> Any:
    """A row per seed, and their mean."""
    from rich.table import Table

    table = Table(
        "seed", "agent visible", "chain connected", "team connected", "relays", "driven", "overlaps", box=None
    )
    rows = []
    for seed, metrics in results:
        shares = metrics.since_first_deployment or metrics.whole_run
        row = (
            100 * shares.agent_visible,
            100 * shares.chain_connected,
            100 * shares.team_connected,
            metrics.relays_at_most,
            metrics.total_distance_m,
            sum(overlap.episodes for overlap in metrics.overlaps),
        )
        rows.append(row)
        table.add_row(str(seed), *_cells(row))
    mean = tuple(sum(column) / len(rows) for column in zip(*rows, strict=True))
    table.add_section()
    table.add_row("mean", *_cells(mean))
    table.caption = "shares of time since the first deployment"
    return table


def _cells(row: tuple[float, ...]) -> list[str]:
    visible, chain, team, relays, driven, overlaps = row
    return [
        f"{visible:.1f} %",
        f"{chain:.1f} %",
        f"{team:.1f} %",
        f"{relays:.3g}",
        f"{driven:.1f} m",
        f"{overlaps:.3g}",
    ]
