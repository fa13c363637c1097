"""The study of a data set: localise its beacons or its moving node, draw them, write the numbers, say what came out."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation.containment_monitor import Verdict
from estimation.feasible_set import Region
from launcher.studies import drawing
from launcher.studies.range_data import RangeData
from launcher.studies.range_findings import MARGIN, PASSES, BeaconFinding, TargetFinding, find_beacons, find_target

Floats = NDArray[np.float64]

PAUSE = 20
"""So many times the usual time between ranges is a pause."""


def study_beacons(folder: Path, data: RangeData, bound_m: float | None, tell: Callable[[str], None] = print) -> str:
    """Localise the beacons, draw them, and write the numbers; returns the summary."""
    folder.mkdir(parents=True, exist_ok=True)
    tell(f"{data.name}: {len(data.beacons)} beacons from {len(data.ranges)} ranges")
    found = find_beacons(data, bound_m)
    reading = ("beacon", "ranges", "scale", "offset_m", "bound_m")
    result = ("center_error_m", "solved_error_m", "tight_m2", "inside", "tight_inside")
    rows = [
        (*(getattr(one, name) for name in reading), one.feasible.area_m2, *(getattr(one, name) for name in result))
        for one in found
    ]
    drawing.write_table(folder / "beacons.csv", (*reading, "area_m2", *result), rows)
    _draw_beacons(data, found, folder / "beacons.png")
    errors = {
        f"error of the ellipsoid's centre after {PASSES} passes": [one.center_error_m for one in found],
        "error of least squares from the tight set": [one.solved_error_m for one in found],
    }
    lines = [
        f"{data.name}: {sum(one.inside for one in found)} of {len(found)} beacons inside the ellipsoid's set, "
        f"{sum(one.tight_inside for one in found)} inside the tight set",
        *(f"  {name:47} mean {np.mean(some):.3f} m, largest {max(some):.3f} m" for name, some in errors.items()),
        f"  {'area of the tight set':47} {min(one.tight_m2 for one in found):.2f} to "
        f"{max(one.tight_m2 for one in found):.2f} m², of the ellipsoid's mean "
        f"{np.mean([one.feasible.area_m2 for one in found]):.1f} m²",
    ]
    lines += [
        f"  beacon {one.beacon}: r = {one.scale:.4f} z {one.offset_m:+.3f} m, ε = {one.bound_m:.2f} m"
        + _worry(one.verdict)
        for one in found
    ]
    if bound_m is None and (wide := [one for one in found if one.bound_m > 2 * MARGIN * one.usual_m]):
        names, usual = ", ".join(one.beacon for one in wide), max(one.usual_m for one in wide)
        lines.append(
            f"  ε for {names} is decided by less than 1 % of the ranges, the others keep {usual:.2f} m: with "
            f"--bound {1.5 * usual:.2g} or so the sets are smaller, and those few count as corrupt"
        )
    return _finish(folder, lines)


def study_target(
    folder: Path, data: RangeData, speed_m_s: float, bound_m: float | None, tell: Callable[[str], None] = print
) -> str:
    """Follow the moving node, draw it, and write the numbers; returns the summary."""
    folder.mkdir(parents=True, exist_ok=True)
    tell(f"{data.name}: a moving node from {len(data.ranges)} ranges to {len(data.beacons)} beacons")
    found = find_target(data, speed_m_s, bound_m)
    columns = ("t_s", "x_m", "y_m", "center_x_m", "center_y_m", "error_m", "area_m2", "tight_m2")
    series = (found.truth, found.centers, found.errors_m[:, None], found.areas[:, None], found.tight_areas[:, None])
    numbers = np.hstack([found.times[:, None], *series])
    drawing.write_table(
        folder / "target.csv",
        (*columns, "inside", "tight_inside"),
        [
            (*map(float, line), int(inside), int(tight))
            for line, inside, tight in zip(numbers, found.inside, found.tight_inside, strict=True)
        ],
    )
    _draw_target(data, found, folder / "target.png")
    lines = [
        f"{data.name}: ε = {found.bound_m:.2f} m, v = {found.speed_m_s:g} m/s, {found.ranges} ranges at "
        f"{len(found.times)} times, {found.rejected} rejected",
        f"  ellipsoid  RMSE {found.rmse_m:.3f} m, median error {np.median(found.errors_m):.3f} m, largest "
        f"{found.errors_m.max():.3f} m; outside {1 - found.inside.mean():.2%} of the times, median area "
        f"{np.median(found.areas):.2f} m²",
        f"  tight set  outside {1 - found.tight_inside.mean():.2%} of the times, median area "
        f"{np.median(found.tight_areas):.2f} m²" + _worry(found.verdict),
    ]
    if not found.tight_inside.all() and not found.verdict.too_small:
        lines.append(
            "  The tight set lost the node, so some ranges were further off than ε or the node was faster than v; "
            "the ranges alone did not show it. Try a larger --bound or --speed"
        )
    return _finish(folder, lines)


def _worry(verdict: Verdict) -> str:
    if not verdict.too_small:
        return ""
    return (
        f" – the monitor says that ε is too small: {verdict.contradictions} of {verdict.ranges} ranges in a row "
        f"contradicted the set; try {verdict.suggested_bound_m:.2f} m or more"
    )


def _finish(folder: Path, lines: list[str]) -> str:
    text = "\n".join(lines) + "\n"
    (folder / "summary.txt").write_text(text, encoding="utf-8")
    return text


def _draw_beacons(data: RangeData, found: list[BeaconFinding], file: Path) -> None:
    columns = math.ceil(len(found) / 2)
    figure = drawing.new_figure(5.5 + 3.2 * columns, 6.4)
    figure.suptitle(f"{data.name}: beacons from ranges alone", fontsize=11, x=0.01, ha="left")
    grid = figure.add_gridspec(2, columns + 2)
    whole = figure.add_subplot(grid[:, :2])
    whole.plot(*data.path[:, 1:].T, color=drawing.ROBOTS[0], linewidth=0.5, alpha=0.7, label="path")
    places = np.array([one.place for one in found])
    whole.plot(*places.T, "D", color=drawing.INK, markersize=5, linestyle="none")
    for one, (x, y) in zip(found, places, strict=True):
        whole.annotate(one.beacon, (float(x), float(y)), (5, 4), textcoords="offset points", fontsize=9)
    drawing.dress_plane(whole, "path and beacons", *_window(np.vstack([data.path[:, 1:], places])))
    for number, one in enumerate(found):
        axes = figure.add_subplot(grid[number // columns, 2 + number % columns])
        drawing.draw_ellipse(axes, one.feasible.base_projection(), drawing.PROJECTION, "base projection")
        drawing.draw_regions(axes, one.feasible.regions, drawing.FEASIBLE, "feasible set", alpha=0.25)
        drawing.draw_regions(axes, [Region(piece) for piece in one.tight], drawing.TIGHT, "tight set", 0.9, 0.5)
        axes.plot(*one.center, "x", color=drawing.FEASIBLE, markersize=6, label="centre", zorder=8)
        axes.plot(*one.solved, "o", color=drawing.SLICE, markersize=4, label="least squares", zorder=8)
        axes.plot(*one.place, "+", color=drawing.INK, markersize=10, label="truth", zorder=8)
        low, high = one.feasible.base_projection().bounding_box()
        middle, half = 0.5 * (low + high), 0.55 * float((high - low).max())
        title = f"beacon {one.beacon}: feasible {one.feasible.area_m2:.1f}, tight {one.tight_m2:.2f} m²"
        drawing.dress_plane(axes, title, middle - half, middle + half)
    drawing.legend_below(figure, 7)
    drawing.write_figure(figure, file)


def _draw_target(data: RangeData, found: TargetFinding, file: Path) -> None:
    figure = drawing.new_figure(12, 6.3)
    figure.suptitle(
        f"{data.name}: a moving node from ranges alone, ε = {found.bound_m:.2f} m, v = {found.speed_m_s:g} m/s",
        fontsize=11, x=0.01, ha="left",
    )  # fmt: skip
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.25))
    plane = figure.add_subplot(grid[:, 0])
    columns = (found.truth, found.centers, found.errors_m[:, None], found.areas[:, None], found.tight_areas[:, None])
    times, x, y, center_x, center_y, error, area, tight_area = _with_pauses(found.times, np.hstack(columns)).T
    plane.plot(x, y, color=drawing.INK, linewidth=1.2, label="truth")
    plane.plot(center_x, center_y, color=drawing.FEASIBLE, linewidth=0.7, alpha=0.8, label="ellipsoid's centre")
    places = np.array(list(data.beacons.values()))
    plane.plot(*places.T, "D", color=drawing.ROBOTS[0], markersize=5, linestyle="none", label="beacons")
    drawing.dress_plane(plane, "path", *_window(np.vstack([places, found.truth])))
    errors, areas = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
    errors.semilogy(times, error, color=drawing.FEASIBLE, linewidth=0.8)
    drawing.dress_series(errors, f"error of the ellipsoid's centre, RMSE {found.rmse_m:.3f} m", "time [s]", "metres")
    areas.semilogy(times, area, color=drawing.FEASIBLE, linewidth=0.8, label="feasible set")
    areas.semilogy(times, tight_area, color=drawing.TIGHT, linewidth=0.8, label="tight set")
    for inside, where, colour, whose in (
        (found.inside, found.areas, drawing.FEASIBLE, "feasible"),
        (found.tight_inside, found.tight_areas, drawing.INK, "tight"),
    ):
        if not inside.all():
            label = f"outside of the {whose} set"
            areas.plot(found.times[~inside], where[~inside], "x", color=colour, markersize=4, label=label)
    drawing.dress_series(areas, "area", "time [s]", "m²")
    drawing.legend_below(figure, 7)
    drawing.write_figure(figure, file)


def _with_pauses(times: Floats, columns: Floats) -> Floats:
    """(k,) and (k, m) as (k', 1 + m), with a row of nan where ranges paused, so that no line is drawn across."""
    steps = np.diff(times)
    pauses = np.flatnonzero(steps > PAUSE * np.median(steps)) + 1
    return np.insert(np.column_stack([times, columns]), pauses, np.nan, axis=0)


def _window(points: Floats) -> tuple[Floats, Floats]:
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.06 * float((high - low).max())
    return low - margin, high + margin
