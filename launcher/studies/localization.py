"""The study of thesis §2.5: three experiments, a corrupt measurement, closed loop and straight line (figs. 10-18).

Runs are paired: every law meets the same starts and the same noise. What comes out is written down as it is, also
where the thesis says otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from launcher.studies import drawing
from launcher.studies.embedding_figure import draw_embedding
from launcher.studies.localization_figures import (
    draw_against_straight,
    draw_fusion,
    draw_laws,
    draw_snapshots,
    is_like_the_thesis,
    snapshot_steps,
)
from launcher.studies.localization_summary import KEEPERS, THESIS, Runs, sum_up
from launcher.studies.ranging_run import (
    CORRUPT_STEP,
    EXPERIMENTS,
    FLAW_M,
    LAWS,
    STEPS,
    STRAIGHT,
    THROUGH,
    Run,
    run_experiment,
)


class BadStudy(ValueError):
    """A study that cannot be run as asked; the text says why and what to do."""


def study_localization(folder: Path, seeds: int = 20, tell: Callable[[str], None] = print) -> str:
    """Run everything, draw it, and say what came out.

    Args:
        folder: is made; files in it of the same names are replaced.
        seeds: runs of each experiment and law.
        tell: is told what is being done.

    Returns:
        The text of ``summary.md``.

    Raises:
        BadStudy: fewer than 2 seeds.
    """
    if seeds < 2:
        raise BadStudy(f"--seeds {seeds}: medians and spread need at least 2 runs; 20 take about two minutes")
    folder.mkdir(parents=True, exist_ok=True)
    laws = (STRAIGHT, *LAWS)
    runs: dict[str, dict[str, list[Run]]] = {}
    for experiment in EXPERIMENTS:
        runs[experiment.name] = {}
        for law in laws:
            tell(f"{experiment.title}: {law}, {seeds} runs")
            runs[experiment.name][law] = [run_experiment(experiment, law, seed) for seed in range(seeds)]
    one = EXPERIMENTS[0]
    tell(f"{one.title}: {THROUGH}, {seeds} runs")
    through = [run_experiment(one, THROUGH, seed) for seed in range(seeds)]
    tell(f"{one.title}, with a corrupt measurement, {seeds} runs")
    corrupt = [run_experiment(one, THESIS, seed, corrupt=True, keep_scenes=True) for seed in range(seeds)]
    tell("figures")
    _draw(folder, runs, through, corrupt)
    _write_runs(folder / "runs.csv", runs, through, corrupt)
    text = sum_up(runs, through, corrupt)
    (folder / "summary.md").write_text(text, encoding="utf-8")
    return text


def _draw(folder: Path, runs: Runs, through: Sequence[Run], corrupt: Sequence[Run]) -> None:
    draw_embedding(folder)
    one, standing, two = EXPERIMENTS
    alike = [run for run in corrupt if is_like_the_thesis(run)] or corrupt
    run = alike[_typical(alike)]
    draw_snapshots(
        run,
        snapshot_steps(run, corrupt=True),
        f"Fig. 12: one robot, thesis' law (corrected), a corrupt measurement in step {CORRUPT_STEP + 1}",
        folder / "fig12-one-robot.png",
        {CORRUPT_STEP: f"position {FLAW_M:g} m off (□)"},
        beside_thesis=True,
    )
    draw_fusion(
        run,
        "Fig. 13: weight and determinant of that run, with a close-up of the corrupt measurement",
        folder / "fig13-one-robot-fusion.png",
        (CORRUPT_STEP - 3, CORRUPT_STEP + 16),
    )
    closed, past = runs[one.name][THESIS], runs[one.name][STRAIGHT]
    draw_against_straight(closed, past, through, folder / "fig14-closed-loop.png")
    for experiment, number in ((standing, 15), (two, 17)):
        seed = _typical(runs[experiment.name][THESIS])
        run = run_experiment(experiment, THESIS, seed, keep_scenes=True)
        draw_snapshots(
            run,
            snapshot_steps(run, corrupt=False),
            f"Fig. {number}: {experiment.title}, thesis' law (corrected); angle: between the lines of sight",
            folder / f"fig{number}-{experiment.name}.png",
        )
        draw_fusion(
            run,
            f"Fig. {number + 1}: weight and determinant of that run",
            folder / f"fig{number + 1}-{experiment.name}-fusion.png",
        )
    draw_laws(runs, {experiment.name: experiment.title for experiment in EXPERIMENTS}, folder / "laws.png")


def _typical(runs: Sequence[Run]) -> int:
    """Which run took the median number of steps, nearly."""
    steps = np.array([min(run.resolved_at, STEPS + 1) for run in runs])
    return int(np.argmin(np.abs(steps - np.median(steps))))


def _write_runs(file: Path, runs: Runs, through: Sequence[Run], corrupt: Sequence[Run]) -> None:
    """One row per run: what the medians are made of."""
    columns = ("experiment", "law", "seed", "resolved_at", "area_m2", "tight_m2", "error_m", "angle_deg", "thesis_det")
    rows: list[tuple[object, ...]] = []
    sets = [(name, law, some) for name, by_law in runs.items() for law, some in by_law.items()]
    for name, law, some in [*sets, ("one", THROUGH, through), ("one, corrupt", THESIS, corrupt)]:
        for seed, run in enumerate(some):
            ends = [float(run[column][-1]) for column in columns[4:]]
            kept = [int(run[column][-1]) for column, _ in KEEPERS]
            rows.append((name, law, seed, run.resolved_at, *ends, *kept))
    drawing.write_table(file, (*columns, *(column for column, _ in KEEPERS)), rows)
