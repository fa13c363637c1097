"""Figures 10 and 12 to 18 of the thesis, redrawn from our own runs, each beside the CSV it is drawn from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from estimation.ellipsoid import EmptyIntersection
from estimation.feasible_set import FeasibleSet, Region
from estimation.range_filter import RangeFilter
from launcher.studies import drawing
from launcher.studies.ranging_run import BOUND_M, CORRUPT_STEP, SERIES, STRAIGHT, Run, Scene

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


def draw_embedding(folder: Path) -> Path:
    """Figure 10: what an ellipsoid in (x, y, x² + y²) means on the map: an annulus, two regions, or one."""
    target = np.array([1.6, 2.0])
    anchors = [(-1.5, 0.0), (1.0, 0.0), (0.0, -1.0), (3.0, -0.5), (3.2, 1.5), (0.2, 3.0)]
    stages = ((1, "one range: an annulus"), (2, "two places: two regions"), (6, "six places: one region"))
    figure = drawing.new_figure(11, 7)
    rows: list[tuple[int, int, int, float, float]] = []
    filter_, told = RangeFilter(), 0
    for column, (count, title) in enumerate(stages):
        for anchor in anchors[told:count]:
            filter_.measure(anchor, float(np.hypot(*(target - anchor))), 0.2)
        told = count
        feasible = filter_.feasible_set()
        axes: Any = figure.add_subplot(2, 3, column + 1, projection="3d")
        _draw_paraboloid(axes, filter_, feasible)
        plane = figure.add_subplot(2, 3, column + 4)
        for anchor in anchors[:count]:
            r = float(np.hypot(*(target - anchor)))
            drawing.draw_annulus(plane, anchor, r - 0.2, r + 0.2, drawing.ANNULI[0])
            plane.plot(*anchor, "o", color=drawing.ROBOTS[0], markersize=5, zorder=7)
        _draw_sets(plane, feasible, ())
        drawing.draw_target(plane, target)
        drawing.dress_plane(plane, f"{title}, {feasible.area_m2:.2f} m²", (-6.2, -5), (4.6, 5.2))
        for number, region in enumerate(feasible.regions):
            for ring_number, ring in enumerate((region.outer, *region.holes)):
                rows.extend((count, number, ring_number, float(x), float(y)) for x, y in ring)
    drawing.legend_below(figure, plane, 4)
    drawing.write_table(folder / "fig10-embedding.csv", ("ranges", "region", "ring", "x_m", "y_m"), rows)
    return drawing.write_figure(figure, folder / "fig10-embedding.png")


def _draw_paraboloid(axes: Any, filter_: RangeFilter, feasible: FeasibleSet) -> None:
    """The paraboloid, the ellipsoid, and where they meet, in a window that holds the feasible set."""
    radius, angle = np.meshgrid(np.linspace(0, 5, 26), np.linspace(0, 2 * np.pi, 61))
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    axes.plot_surface(x, y, x**2 + y**2, color="#c9d1da", alpha=0.35, linewidth=0, antialiased=True)
    axes.plot_wireframe(x, y, x**2 + y**2, color="#9aa5b1", linewidth=0.25, rstride=6, cstride=5)
    ellipsoid = filter_.ellipsoid()
    around, up = np.meshgrid(np.linspace(0, 2 * np.pi, 49), np.linspace(0, np.pi, 25))
    ball = np.stack([np.cos(around) * np.sin(up), np.sin(around) * np.sin(up), np.cos(up)])
    surface = ellipsoid.center[:, None, None] + np.tensordot(ellipsoid.factor, ball, 1)
    axes.plot_wireframe(*surface, color=drawing.PROJECTION, linewidth=0.35, alpha=0.75, rstride=2, cstride=3)
    for region in feasible.regions:
        for ring in (region.outer, *region.holes):
            closed = np.vstack([ring, ring[:1]])
            axes.plot(*closed.T, (closed**2).sum(axis=1), color=drawing.FEASIBLE, linewidth=1.8)
    axes.set(xlim=(-6, 5), ylim=(-5, 5), zlim=(0, 28))
    axes.set_box_aspect((1.1, 1, 0.85))
    axes.view_init(24, -62)
    axes.tick_params(labelsize=6, pad=-3)
    axes.set_xlabel("x [m]", fontsize=7, labelpad=-7)
    axes.set_ylabel("y [m]", fontsize=7, labelpad=-7)
    axes.set_zlabel("x² + y² [m²]", fontsize=7, labelpad=-6)


def _draw_sets(axes: Axes, feasible: FeasibleSet, tight: Sequence[Floats]) -> None:
    """Feasible set, base projection, tangent slice, and the tight set beside them."""
    drawing.draw_ellipse(axes, feasible.base_projection(), drawing.PROJECTION, "base projection")
    flat = feasible.tangent_slice()
    if not isinstance(flat, EmptyIntersection):
        drawing.draw_ellipse(axes, flat, drawing.SLICE, "tangent slice", ":")
    drawing.draw_regions(axes, feasible.regions, drawing.FEASIBLE, "feasible set", alpha=0.3)
    drawing.draw_regions(axes, [Region(piece) for piece in tight], drawing.TIGHT, "tight set", alpha=0.95, width=0.6)


def draw_snapshots(run: Run, steps: Sequence[int], title: str, file: Path, notes: Mapping[int, str] = {}) -> Path:
    """Figures 12, 15 and 17: what a run looks like after some of its steps.

    Args:
        run: with its scenes.
        steps: which of them, an even number.
        title: over all.
        file: a .png; the CSV beside it holds the numbers of all steps.
        notes: added to the titles of some steps.
    """
    columns = 3 if len(steps) % 3 == 0 else 2
    lines = len(steps) // columns
    figure = drawing.new_figure(3.7 * columns, 3.75 * lines + 0.6)
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
        _draw_sets(axes, scene.feasible, scene.tight)
        drawing.draw_target(axes, run.target)
        sizes = f"{run['area_m2'][step]:.2g} and {run['tight_m2'][step]:.2g} m²"
        drawing.dress_plane(axes, f"step {step + 1}: {sizes}{notes.get(step, '')}", middle - half, middle + half)
        if not np.allclose(scene.claimed, scene.places):
            axes.plot(*scene.claimed[0], "s", markerfacecolor="none", color=drawing.FEASIBLE, markersize=8, zorder=7)
        _draw_close_up(axes, scene, np.vstack([trail[: step + 1].reshape(-1, 2), scene.claimed, run.target]), half)
    drawing.legend_below(figure, axes, 6)
    places = [f"robot{robot + 1}_{axis}_m" for robot in range(trail.shape[1]) for axis in "xy"]
    rows = [(step + 1, *map(float, trail[step].ravel()), *map(float, values)) for step, values in enumerate(run.series)]
    drawing.write_table(file.with_suffix(".csv"), ("step", *places, *SERIES), rows)
    return drawing.write_figure(figure, file)


def _draw_close_up(axes: Axes, scene: Scene, avoid: Floats, half: float) -> None:
    """The sets again, larger, when they have become small: in the corner that hides fewest of the points to avoid.

    The last of those points is the target.
    """
    low, high = scene.feasible.base_projection().bounding_box()
    reach = 0.6 * float((high - low).max())
    if reach > 0.25 * half:
        return
    box = np.array([(x, y) for x in (low[0], high[0]) for y in (low[1], high[1])])
    points = np.vstack([avoid, np.repeat(box, len(avoid), axis=0)])
    inside = (points - [axes.get_xlim()[0], axes.get_ylim()[0]]) / (2 * half)
    corners = [(x, y) for x in (0.02, 0.6) for y in (0.02, 0.58)]
    hidden = [int(((inside >= place) & (inside <= np.add(place, 0.42))).all(axis=1).sum()) for place in corners]
    corner = axes.inset_axes((*corners[int(np.argmin(hidden))], 0.38, 0.38), zorder=9)
    _draw_sets(corner, scene.feasible, scene.tight)
    corner.plot(*avoid[-1], "+", color=drawing.INK, markersize=7, zorder=8)
    middle = 0.5 * (low + high)
    corner.set(xlim=(middle[0] - reach, middle[0] + reach), ylim=(middle[1] - reach, middle[1] + reach), aspect="equal")
    corner.set(xticks=(), yticks=())
    corner.set_title(f"{2 * reach:.1f} m wide", fontsize=6.5, pad=2)
    axes.indicate_inset_zoom(corner, edgecolor=drawing.INK, linewidth=0.6)


def draw_fusion(run: Run, title: str, file: Path, close_up: tuple[int, int] | None = None) -> Path:
    """Figures 13, 16 and 18: λ and det E over a run, the thesis' filter and ours; with a close-up of some steps.

    The numbers are in the CSV beside the snapshots of the same run.
    """
    steps = np.arange(1, len(run.series) + 1)
    windows = [(1, len(steps))] + ([close_up] if close_up else [])
    figure = drawing.new_figure(5.6 * len(windows), 5.4)
    figure.suptitle(title, fontsize=11, x=0.01, ha="left")
    broken = run["thesis_definite"] < 0.5
    for column, (low, high) in enumerate(windows):
        upper = figure.add_subplot(2, len(windows), column + 1)
        lower = figure.add_subplot(2, len(windows), len(windows) + column + 1)
        inside = (steps >= low) & (steps <= high)
        upper.plot(steps[inside], run["thesis_weight"][inside], "o-", color=drawing.PROJECTION, markersize=3, lw=1)
        upper.plot(steps[inside], run["weight"][inside], "s-", color=drawing.ROBOTS[0], markersize=3, lw=1)
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
        drawing.dress_series(upper, "weight λ: 1 keeps the estimate, 0 throws it away", "step", "λ")
        drawing.dress_series(
            lower, "determinant of E (at the set for ours: it does not depend on the frame)", "step", "det E [m⁻⁸]"
        )
        upper.set_ylim(-0.05, 1.05)
    drawing.legend_below(figure, lower, 4)
    return drawing.write_figure(figure, file)


def draw_against_straight(closed: Sequence[Run], straight: Sequence[Run], file: Path) -> Path:
    """Figure 14: closed loop against a straight line past the target, by the thesis' measure and by area."""
    figure = drawing.new_figure(13, 4.4)
    figure.suptitle(
        f"Fig. 14: closed loop (thesis' law) against a straight line; median and middle half of {len(closed)} runs",
        fontsize=11, x=0.01, ha="left",
    )  # fmt: skip
    steps = np.arange(1, len(closed[0].series) + 1)
    panels = (
        ("thesis_det", "det E, the thesis' filter (0 on a line)", "det E [m⁻⁸]"),
        ("log10_det", "det E, our filter", "det E [m⁻⁸]"),
        ("area_m2", "area of the feasible set", "area [m²]"),
        ("spread_m", "spread of the tight set", "√ tr C [m]"),
    )
    table: list[Floats] = []
    for number, (name, title, up) in enumerate(panels):
        axes = figure.add_subplot(1, len(panels), number + 1)
        axes.set_yscale("log")
        for runs, colour, label in (
            (closed, drawing.PROJECTION, "closed loop"),
            (straight, LAW_COLOURS[STRAIGHT], STRAIGHT),
        ):
            rows = np.array([run[name] for run in runs])
            rows = np.where(rows > 0, rows, np.nan) if name == "thesis_det" else rows
            rows = 10**rows if name == "log10_det" else rows
            table.extend(drawing.draw_spread(axes, steps, rows, colour, label))
        drawing.dress_series(axes, title, "step", up)
    drawing.legend_below(figure, axes, 2)
    columns = [
        f"{name}_{who}_{q}" for name, _, _ in panels for who in ("closed", "straight") for q in ("q1", "median", "q3")
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
    drawing.legend_below(figure, upper, 6)
    drawing.write_table(file.with_suffix(".csv"), ("step", *columns), _rows(steps, table))
    return drawing.write_figure(figure, file)


def snapshot_steps(run: Run, corrupt: bool) -> tuple[int, ...]:
    """Steps worth a snapshot: the first, the last with two regions, found, and around the flaw."""
    regions = [len(scene.feasible.regions) for scene in run.scenes]
    two = [step for step, count in enumerate(regions[:CORRUPT_STEP]) if count == 2]
    split = max(2, two[len(two) // 2]) if two else 2
    if not corrupt:
        return 0, min(split, 11), 12, 30
    return 0, min(split, CORRUPT_STEP - 2), CORRUPT_STEP - 1, CORRUPT_STEP, CORRUPT_STEP + 4, len(regions) - 1


def _rows(steps: NDArray[np.int_], table: Sequence[Floats]) -> list[tuple[float, ...]]:
    return [(int(step), *map(float, values)) for step, values in zip(steps, np.array(table).T, strict=True)]
