"""Figures 12 to 18 of the thesis, redrawn from our own runs, each beside the CSV it is drawn from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from launcher.studies import drawing
from launcher.studies.ranging_run import BOUND_M, CORRUPT_STEP, SERIES, STRAIGHT, THROUGH, Run, Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

LAW_COLOURS = {
    STRAIGHT: "#7b8794",
    "thesis' gradient": "#c227b9",
    "covariance": "#0b6b74",
    "1 step ahead": "#f0a11c",
    "5 steps ahead": "#d1261f",
    "Gaussian": "#2f4bd6",
}


def draw_snapshots(
    run: Run, steps: Sequence[int], title: str, file: Path, notes: Mapping[int, str] = {}, beside_thesis: bool = False
) -> Path:
    """Figures 12, 15 and 17: what a run looks like after some of its steps.

    Args:
        run: with its scenes.
        steps: which of them, an even number.
        title: over all.
        file: a .png; the CSV beside it holds the numbers of all steps.
        notes: added to the titles of some steps.
        beside_thesis: draw the base projection of the thesis' own filter too, and say where it holds no set.
    """
    columns = 3 if len(steps) % 3 == 0 else 2
    lines = len(steps) // columns
    figure = drawing.new_figure(3.7 * columns, 4.0 * lines + 0.6)
    figure.suptitle(title, fontsize=11, x=0.01, ha="left")
    trail = np.array([scene.places for scene in run.scenes])
    seen = np.concatenate([trail[: max(steps) + 1].reshape(-1, 2), run.target[None]])
    middle, half = 0.5 * (seen.min(axis=0) + seen.max(axis=0)), 0.5 * float(np.ptp(seen, axis=0).max()) + 2.0
    for number, step in enumerate(steps):
        axes = figure.add_subplot(lines, columns, number + 1)
        scene = run.scenes[step]
        for robot, (place, measured) in enumerate(zip(scene.claimed, scene.ranges, strict=True)):
            drawing.draw_annulus(axes, place, measured - BOUND_M, measured + BOUND_M, drawing.ANNULI[robot])
            drawing.draw_trail(axes, trail[: step + 1, robot], drawing.ROBOTS[robot], f"robot {robot + 1}")
        drawing.draw_sets(axes, scene.feasible, scene.tight)
        if beside_thesis and scene.thesis is not None:
            drawing.draw_ellipse(axes, scene.thesis, drawing.BASELINE, "thesis' filter, base projection", "--")
        drawing.draw_target(axes, run.target)
        said = f"step {step + 1}: feasible {run['area_m2'][step]:.2g}, tight {run['tight_m2'][step]:.2g} m²"
        if len(scene.places) == 2:
            said += f", {run['angle_deg'][step]:.0f}°"
        remarks = [notes[step]] if step in notes else []
        if beside_thesis and run["thesis_definite"][step] < 0.5:
            remarks.append("no set in the thesis' filter")
        drawing.dress_plane(axes, "\n".join([said, "; ".join(remarks)]).strip(), middle - half, middle + half)
        if not np.allclose(scene.claimed, scene.places):
            axes.plot(*scene.claimed[0], "s", markerfacecolor="none", color=drawing.FEASIBLE, markersize=8, zorder=7)
        _draw_close_up(axes, scene, np.vstack([trail[: step + 1].reshape(-1, 2), scene.claimed, run.target]), half)
    drawing.legend_below(figure, 4)
    weights = [f"{whose}weight_robot{robot + 1}" for whose in ("", "thesis_") for robot in range(trail.shape[1])]
    places = [f"robot{robot + 1}_{axis}_m" for robot in range(trail.shape[1]) for axis in "xy"]
    numbers = np.hstack([trail.reshape(len(trail), -1), run.weights, run.thesis_weights, run.series])
    rows = [(step + 1, *map(float, values)) for step, values in enumerate(numbers)]
    drawing.write_table(file.with_suffix(".csv"), ("step", *places, *weights, *SERIES), rows)
    return drawing.write_figure(figure, file)


def _draw_close_up(axes: Axes, scene: Scene, avoid: Floats, half: float) -> None:
    """The sets again, larger, when they have become small: in the corner that hides fewest of the points to avoid.

    The last of those points is the target.
    """
    rings = np.concatenate([region.outer for region in scene.feasible.regions])
    low, high = rings.min(axis=0), rings.max(axis=0)
    reach = 0.65 * float((high - low).max())
    if reach > 0.25 * half:
        return
    box = np.array([(x, y) for x in (low[0], high[0]) for y in (low[1], high[1])])
    points = np.vstack([avoid, np.repeat(box, len(avoid), axis=0)])
    inside = (points - [axes.get_xlim()[0], axes.get_ylim()[0]]) / (2 * half)
    corners = [(x, y) for x in (0.02, 0.6) for y in (0.02, 0.58)]
    hidden = [int(((inside >= place) & (inside <= np.add(place, 0.42))).all(axis=1).sum()) for place in corners]
    corner = axes.inset_axes((*corners[int(np.argmin(hidden))], 0.38, 0.38), zorder=9)
    drawing.draw_sets(corner, scene.feasible, scene.tight)
    corner.plot(*avoid[-1], "+", color=drawing.INK, markersize=6, markeredgewidth=0.6, zorder=8)
    middle = 0.5 * (low + high)
    corner.set(xlim=(middle[0] - reach, middle[0] + reach), ylim=(middle[1] - reach, middle[1] + reach), aspect="equal")
    corner.set(xticks=(), yticks=())
    corner.set_title(f"{2 * reach:.1f} m wide", fontsize=6.5, pad=2)
    axes.indicate_inset_zoom(corner, edgecolor=drawing.INK, linewidth=0.6)


def draw_fusion(run: Run, title: str, file: Path, close_up: tuple[int, int] | None = None) -> Path:
    """Figures 13, 16 and 18: λ of every range and det E, the thesis' filter and ours; with a close-up of some steps.

    The numbers are in the CSV beside the snapshots of the same run.
    """
    from matplotlib.ticker import MaxNLocator

    steps = np.arange(1, len(run.series) + 1)
    robots = run.weights.shape[1]
    # The robots measure in turn: the last range of a step is drawn at the step, the others before it.
    turns = (steps[:, None] - 1 + np.arange(1, robots + 1) / robots).ravel()
    windows = [(1, len(steps))] + ([close_up] if close_up else [])
    figure = drawing.new_figure(5.6 * len(windows), 5.4)
    figure.suptitle(title, fontsize=11, x=0.01, ha="left")
    broken = run["thesis_definite"] < 0.5
    for column, (low, high) in enumerate(windows):
        upper = figure.add_subplot(2, len(windows), column + 1)
        lower = figure.add_subplot(2, len(windows), len(windows) + column + 1)
        inside, told = (steps >= low) & (steps <= high), (turns > low - 1) & (turns <= high)
        size = 3 if robots == 1 else 2
        for weights, marker, colour in (
            (run.thesis_weights, "o-", drawing.PROJECTION),
            (run.weights, "s-", drawing.ROBOTS[0]),
        ):
            upper.plot(turns[told], weights.ravel()[told], marker, color=colour, markersize=size, lw=1)
        det = run["thesis_det"][inside]
        signed = np.where(det > 0, det, np.nan)
        flipped = np.where(det < 0, -det, np.nan)
        lower.semilogy(
            steps[inside], signed, "o-", color=drawing.PROJECTION, markersize=3, lw=1, label="thesis' filter, det E > 0"
        )
        if np.isfinite(flipped).any():
            lower.semilogy(
                steps[inside], flipped, "x", color=drawing.FEASIBLE, markersize=6, label="its |det E| where det E < 0"
            )
        lower.semilogy(
            steps[inside], 10 ** run["log10_det"][inside], "s-", color=drawing.ROBOTS[0], markersize=3, lw=1,
            label="ours",
        )  # fmt: skip
        for axes in (upper, lower):
            for number, step in enumerate(steps[inside & broken]):
                axes.axvspan(
                    step - 0.5, step + 0.5, color=drawing.FEASIBLE, alpha=0.1, linewidth=0,
                    label="thesis' E bounds no set" if number == 0 else "_",
                )  # fmt: skip
        drawing.dress_series(upper, "weight λ of every range: 1 keeps the estimate, 0 throws it away", "step", "λ")
        drawing.dress_series(
            lower, "determinant of E (at the set for ours: it does not depend on the frame)", "step", "det E [m⁻⁸]"
        )
        upper.set_ylim(-0.05, 1.05)
        for axes in (upper, lower):
            axes.xaxis.set_major_locator(MaxNLocator(integer=True, steps=[1, 2, 5, 10]))
    drawing.legend_below(figure, 4)
    return drawing.write_figure(figure, file)


def draw_against_straight(closed: Sequence[Run], past: Sequence[Run], through: Sequence[Run], file: Path) -> Path:
    """Figure 14: closed loop against straight lines past and through the target, by the thesis' measure and by area."""
    figure = drawing.new_figure(13, 4.4)
    figure.suptitle(
        f"Fig. 14: closed loop (thesis' law) against straight lines; median and middle half of {len(closed)} runs",
        fontsize=11, x=0.01, ha="left",
    )  # fmt: skip
    steps = np.arange(1, len(closed[0].series) + 1)
    panels = (
        ("thesis_det", "det E, the thesis' filter (0 on a line)", "det E [m⁻⁸]"),
        ("log10_det", "det E, our filter", "det E [m⁻⁸]"),
        ("area_m2", "area of the feasible set", "area [m²]"),
        ("spread_m", "spread of the tight set", "√ tr C [m]"),
    )
    lines = (
        (closed, drawing.PROJECTION, "closed loop", "-"),
        (past, LAW_COLOURS[STRAIGHT], "straight line, past the target at 1 to 3 m", "-"),
        (through, drawing.INK, f"straight {THROUGH}", "--"),
    )
    table: list[Floats] = []
    for number, (name, title, up) in enumerate(panels):
        axes = figure.add_subplot(1, len(panels), number + 1)
        axes.set_yscale("log")
        for runs, colour, label, style in lines:
            rows = np.array([run[name] for run in runs])
            rows = np.where(rows > 0, rows, np.nan) if name == "thesis_det" else rows
            rows = 10**rows if name == "log10_det" else rows
            table.extend(drawing.draw_spread(axes, steps, rows, colour, label, style))
        drawing.dress_series(axes, title, "step", up)
    drawing.legend_below(figure, 3)
    columns = [
        f"{name}_{who}_{q}"
        for name, _, _ in panels
        for who in ("closed", "past", "through")
        for q in ("q1", "median", "q3")
    ]
    drawing.write_table(file.with_suffix(".csv"), ("step", *columns), _rows(steps, table))
    return drawing.write_figure(figure, file)


def draw_laws(runs: Mapping[str, Mapping[str, Sequence[Run]]], titles: Mapping[str, str], file: Path) -> Path:
    """Beyond the thesis: how far each law gets, and the angle between two robots' lines of sight.

    Args:
        runs: by experiment and law.
        titles: by experiment.
        file: a .png; the CSV is beside it.
    """
    figure = drawing.new_figure(4.3 * len(runs), 7.2)
    figure.suptitle("What each law is worth: median and middle half", fontsize=11, x=0.01, ha="left")
    columns: list[str] = []
    table: list[Floats] = []
    for column, (experiment, by_law) in enumerate(runs.items()):
        upper = figure.add_subplot(2, len(runs), column + 1)
        lower = figure.add_subplot(2, len(runs), len(runs) + column + 1)
        upper.set_yscale("log")
        for law, some in by_law.items():
            steps = np.arange(1, len(some[0].series) + 1)
            for axes, name in ((upper, "spread_m"), (lower, "angle_deg" if experiment != "one" else "distance_m")):
                rows = np.array([run[name] for run in some])
                table.extend(drawing.draw_spread(axes, steps, rows, LAW_COLOURS[law], law))
                columns += [f"{experiment}_{law}_{name}_{quartile}" for quartile in ("q1", "median", "q3")]
        drawing.dress_series(upper, f"{titles[experiment]}: spread of the tight set", "step", "√ tr C [m]")
        if experiment == "one":
            drawing.dress_series(lower, "distance of the robot from the target", "step", "metres")
        else:
            drawing.dress_series(lower, "angle between the lines of sight (opposite counts as 0°)", "step", "degrees")
            lower.set_ylim(0, 90)
    drawing.legend_below(figure, 6)
    drawing.write_table(file.with_suffix(".csv"), ("step", *columns), _rows(steps, table))
    return drawing.write_figure(figure, file)


def snapshot_steps(run: Run, corrupt: bool) -> tuple[int, ...]:
    """Steps worth a snapshot: the first, one with two regions, later ones, and around the flaw."""
    two = split_steps(run)
    split = max(2, two[len(two) // 2]) if two else 2
    if not corrupt:
        return 0, min(split, 11), 12, 30
    return 0, min(split, CORRUPT_STEP - 2), CORRUPT_STEP - 1, CORRUPT_STEP, CORRUPT_STEP + 4, len(run.scenes) - 1


def split_steps(run: Run) -> list[int]:
    """Steps before the flaw after which the feasible set had two regions: the target and its mirror image."""
    return [step for step, scene in enumerate(run.scenes[:CORRUPT_STEP]) if len(scene.feasible.regions) == 2]


def is_like_the_thesis(run: Run) -> bool:
    """Whether two regions came on the way, and the thesis' filter held a set again at the end, as in its fig. 12."""
    return bool(split_steps(run)) and bool(run["thesis_definite"][-1] > 0.5)


def _rows(steps: NDArray[np.int_], table: Sequence[Floats]) -> list[tuple[float, ...]]:
    return [(int(step), *map(float, values)) for step, values in zip(steps, np.array(table).T, strict=True)]
