"""The study of thesis §2.5: three experiments, a corrupt measurement, closed loop and straight line (figs. 10-18).

Runs are paired: every law meets the same starts and the same noise. What comes out is written down as it is, also
where the thesis says otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from launcher.studies import drawing
from launcher.studies.localization_figures import (
    draw_against_straight,
    draw_embedding,
    draw_fusion,
    draw_laws,
    draw_snapshots,
    snapshot_steps,
)
from launcher.studies.ranging_run import (
    BOUND_M,
    CORRUPT_STEP,
    EXPERIMENTS,
    FLAW_M,
    LAWS,
    RESOLVED_M2,
    STEP_M,
    STEPS,
    STRAIGHT,
    Run,
    run_experiment,
)

THESIS = "thesis' gradient"

Runs = Mapping[str, Mapping[str, Sequence[Run]]]
"""By experiment and law."""

KEEPERS = (
    ("inside", "our ellipsoid"),
    ("tight_inside", "tight set, rejecting"),
    ("relaxed_inside", "tight set, q-relaxed"),
    ("thesis_inside", "thesis' filter"),
    ("gaussian_inside", "Gaussian, 3σ"),
)
"""Whether each estimate holds the target: a series of a run, and what to call it."""


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
    tell(f"one robot with a corrupt measurement, {seeds} runs")
    corrupt = [run_experiment(EXPERIMENTS[0], THESIS, seed, corrupt=True) for seed in range(seeds)]
    tell("figures")
    _draw(folder, runs)
    _write_runs(folder / "runs.csv", runs, corrupt)
    text = _sum_up(runs, corrupt, seeds)
    (folder / "summary.md").write_text(text, encoding="utf-8")
    return text


def _draw(folder: Path, runs: Runs) -> None:
    draw_embedding(folder)
    one, standing, two = EXPERIMENTS
    seed = _typical(runs[one.name][THESIS])
    run = run_experiment(one, THESIS, seed, corrupt=True, keep_scenes=True)
    flaw = f", position {FLAW_M:g} m off (□)"
    draw_snapshots(
        run,
        snapshot_steps(run, corrupt=True),
        f"Fig. 12: one robot, thesis' law (corrected), a corrupt measurement in step {CORRUPT_STEP + 1}; "
        "area of the feasible and the tight set",
        folder / "fig12-one-robot.png",
        {CORRUPT_STEP: flaw},
    )
    draw_fusion(
        run,
        "Fig. 13: weight and determinant of that run, with a close-up of the corrupt measurement",
        folder / "fig13-one-robot-fusion.png",
        (CORRUPT_STEP - 3, CORRUPT_STEP + 16),
    )
    draw_against_straight(runs[one.name][THESIS], runs[one.name][STRAIGHT], folder / "fig14-closed-loop.png")
    for experiment, number in ((standing, 15), (two, 17)):
        seed = _typical(runs[experiment.name][THESIS])
        run = run_experiment(experiment, THESIS, seed, keep_scenes=True)
        draw_snapshots(
            run,
            snapshot_steps(run, corrupt=False),
            f"Fig. {number}: {experiment.title}",
            folder / f"fig{number}-{experiment.name}.png",
        )
        draw_fusion(
            run,
            f"Fig. {number + 1}: weight and determinant of that run",
            folder / f"fig{number + 1}-{experiment.name}-fusion.png",
        )
    draw_laws(runs, {experiment.name: experiment.title for experiment in EXPERIMENTS}, folder / "laws.png")


def _typical(runs: Sequence[Run]) -> int:
    """The seed whose run took the median number of steps, nearly."""
    steps = np.array([min(run.resolved_at, STEPS + 1) for run in runs])
    return int(np.argmin(np.abs(steps - np.median(steps))))


def _write_runs(file: Path, runs: Runs, corrupt: Sequence[Run]) -> None:
    """One row per run: what the medians are made of."""
    columns = ("experiment", "law", "seed", "resolved_at", "area_m2", "tight_m2", "error_m", "angle_deg", "thesis_det")
    rows: list[tuple[object, ...]] = []
    sets = [(name, law, some) for name, by_law in runs.items() for law, some in by_law.items()]
    for name, law, some in [*sets, ("one, corrupt", THESIS, corrupt)]:
        for seed, run in enumerate(some):
            ends = [float(run[column][-1]) for column in columns[4:]]
            kept = [int(run[column][-1]) for column, _ in KEEPERS]
            rows.append((name, law, seed, run.resolved_at, *ends, *kept))
    drawing.write_table(file, (*columns, *(column for column, _ in KEEPERS)), rows)


def _sum_up(runs: Runs, corrupt: Sequence[Run], seeds: int) -> str:
    parts = [
        "# Localisation study\n",
        f"{seeds} runs each, {STEPS} steps of {STEP_M} m, ranges off by up to ±{BOUND_M} m (even), target at rest. "
        "Thesis' law: eq. 17 with the corrected weight and predicted range, circling where nothing pulls aside.\n",
        f"## Steps until the tight set is below {RESOLVED_M2} m² and in one place\n",
        "Median (middle half).\n",
        _table(
            ("law", *(experiment.title for experiment in EXPERIMENTS)),
            [
                (law, *(_quartiles([run.resolved_at for run in runs[e.name][law]]) for e in EXPERIMENTS))
                for law in (STRAIGHT, *LAWS)
            ],
        ),
        "## Holding the target\n",
        "Share of runs whose estimate held it at every step, all laws and experiments; and at the end after a corrupt "
        f"measurement in step {CORRUPT_STEP + 1} (a position {FLAW_M:g} m off along the line of sight; one robot, "
        "thesis' law).\n",
        _table(
            ("estimate", "every step, no corrupt measurement", "at the end, after a corrupt one"),
            [
                (
                    title,
                    f"{np.mean([run[name].min() for by in runs.values() for some in by.values() for run in some]):.1%}",
                    f"{np.mean([run[name][-1] for run in corrupt]):.1%}",
                )
                for name, title in KEEPERS
            ],
        ),
        "## The thesis' claims\n",
        f"- {_recovery(corrupt)}\n- {_closed_loop(runs)}\n- {_right_angles(runs)}\n- {_more_robots(runs)}\n",
    ]
    return "\n".join(parts)


def _recovery(corrupt: Sequence[Run]) -> str:
    definite = np.array([run["thesis_definite"] for run in corrupt])
    broken = definite[:, CORRUPT_STEP] < 0.5
    back = broken & (definite[:, -1] > 0.5)
    negative = np.array([(run["thesis_det"][CORRUPT_STEP:] < 0).any() for run in corrupt])
    return (
        "**The filter recovers by itself (fig. 13).** The corrupt measurement left the thesis' E without a set in "
        f"{_share(broken)} of runs, and its determinant was negative at that step or later in {_share(negative)}. By "
        f"the last step E bounded a set again in {_share(back)} of all runs. k < 0 proves that nothing is left; ours "
        "rejects the measurement and goes on."
    )


def _closed_loop(runs: Runs) -> str:
    closed, straight = runs["one"][THESIS], runs["one"][STRAIGHT]
    ratios = {
        "det E": [10 ** (a["log10_det"][-1] - b["log10_det"][-1]) for a, b in zip(closed, straight, strict=True)],
        "area of the feasible set": [
            b["area_m2"][-1] / a["area_m2"][-1] for a, b in zip(closed, straight, strict=True)
        ],
    }
    told = " and ".join(
        f"{name} {np.median(ratio):.2g} times ({np.quantile(ratio, 0.25):.2g}–{np.quantile(ratio, 0.75):.2g})"
        for name, ratio in ratios.items()
    )
    better = "comes out in the median" if np.median(ratios["det E"]) > 100 else "does not come out"
    found = [_share(np.isfinite([run.resolved_at for run in some])) for some in (closed, straight)]
    return (
        f"**Closed loop has det E orders of magnitude above the straight line (fig. 14)**: {better}. At the end it is "
        f"better than the line by {told}. The determinant makes that look like more than it is: it is the square of a "
        "volume in three dimensions, and rewards being near. (In the thesis' own filter a line never gives three "
        "independent strips, and det E stays 0.) What counts is that the mirror image goes: the target was found in "
        f"{found[0]} of runs, and on the straight line, where the image stays, in {found[1]}."
    )


def _right_angles(runs: Runs) -> str:
    told, seen = [], []
    for name, title in (("one-and-standing", "one standing"), ("two", "two moving")):
        for law in (THESIS, "covariance", "5 steps ahead"):
            angles = [float(np.median(run["angle_deg"][STEPS // 2 :])) for run in runs[name][law]]
            told.append(f"{title}, {law} {_quartiles(angles)}°")
            if np.median(angles) >= 75:
                seen.append(f"{title}, {law}")
    return (
        "**About 90° between the robots emerges (figs. 15, 17)**: above 75° in the median with "
        f"{'; '.join(seen) or 'none'}. Over the second half of the runs, opposite counted as 0°: {'; '.join(told)}. It "
        "is no measure of quality: compare the steps above."
    )


def _more_robots(runs: Runs) -> str:
    ends = {name: [run["tight_m2"][19] for run in by_law[THESIS]] for name, by_law in runs.items()}
    told = ", ".join(f"{experiment.title} {np.median(ends[experiment.name]):.2g} m²" for experiment in EXPERIMENTS)
    return f"**More robots help, and more than their number (figs. 15–18)**: tight set after 20 steps, median: {told}."


def _quartiles(values: Sequence[float]) -> str:
    low, middle, high = (_number(float(np.quantile(values, q, method="higher"))) for q in (0.25, 0.5, 0.75))
    return middle if low == middle == high else f"{middle} ({low}–{high})"


def _number(value: float) -> str:
    return f"{value:.0f}" if math.isfinite(value) else "never"


def _share(flags: Sequence[bool] | np.ndarray) -> str:
    return f"{np.mean(flags):.0%}"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows)]
    return "\n".join(lines) + "\n"
