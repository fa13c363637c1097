"""Figures 41 to 50 of the thesis, drawn from our own times, with its Tables 1 and 2 or its slopes beside them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from launcher.studies import drawing
from launcher.studies.complexity_runs import MapRun, Timing
from launcher.studies.scaling import Fit, fit_exponential, fit_power

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OURS, BEYOND, THESIS = "#0b6b74", "#f0a11c", "#c227b9"
SECOND = "#2f4bd6"

LARGE = 190
"""Cells from which on the calls themselves no longer count beside the work: fits are over these maps."""

TITLES = {
    "one tree": "one tree: algorithms 4 to 6",
    "tree by tree": "all modifications: algorithm 7, tree by tree",
    "by messages": "all modifications: by messages",
    "exact": "all trees: exact",
}
"""Of what is timed by `complexity_runs.time_redeployment`."""

CLAIMS = {"one tree": (1,), "tree by tree": (4, 5), "by messages": (4,)}
"""Slopes over k that the thesis names."""

Key = Callable[[MapRun], float]


def draw_once(runs: Sequence[MapRun], folder: Path) -> dict[str, tuple[Fit, Fit]]:
    """Figures 41 to 43: what is computed once for a map. Returns our fit and the thesis', by what was computed."""
    panels: tuple[tuple[str, str, str, Key, str, float], ...] = (
        ("decomposition", "Fig. 41: decomposition", "fig41-decomposition",
         lambda run: run.decomposition_s, "Td", 2),
        ("mutual visibility", "Fig. 42: mutual visibility graph", "fig42-visibility",
         lambda run: run.visibility_s, "Tmv", 2),
        ("all pairs", "Fig. 43: all shortest paths, mutual visibility graph", "fig43-all-pairs",
         lambda run: run.all_pairs_s, "Tpv", 3),
        ("all adjacency paths", "Fig. 43: all shortest paths, adjacency graph", "fig43-adjacency-paths",
         lambda run: run.adjacency_paths_s, "Tpp", 3),
    )  # fmt: skip
    fits = {}
    for name, title, file, ours, theirs, slope in panels:
        by_segments = name == "decomposition"
        key: Key = (lambda run: run.segments) if by_segments else (lambda run: run.counts["N"])
        figure = drawing.new_figure(6.4, 5.2)
        axes = figure.add_subplot()
        done = [run for run in runs if np.isfinite(ours(run))]
        known = [run for run in done if run.thesis is not None]
        beyond = [run for run in done if run.thesis is None]
        large = [run for run in done if run.counts["N"] >= LARGE]
        large = large if len(large) > 2 else done
        # At the thesis' own counts, which are not always those of the rebuilt maps.
        rows = [run.thesis for run in known if run.thesis is not None]
        sizes = [row.segments if by_segments else row.N for row in rows]
        tables = [(size, float(getattr(row, theirs))) for size, row in zip(sizes, rows, strict=True)]
        fit = fit_power([key(run) for run in large], [ours(run) for run in large])
        printed = fit_power(*zip(*tables, strict=True))
        fits[name] = fit, printed
        axes.loglog(*zip(*tables, strict=True), "s", color=THESIS, markersize=5, label="thesis, Tables 1 and 2")
        axes.loglog([key(r) for r in known], [ours(r) for r in known], "o", color=OURS, label="ours, the thesis' maps")
        if beyond:
            xs, ys = [key(run) for run in beyond], [ours(run) for run in beyond]
            axes.loglog(xs, ys, "o", color=BEYOND, label="ours, bitangents the thesis left out")
        least = min(run.counts["N"] for run in large)
        label = f"ours from {least} cells on: slope {fit.slope:.2f}"
        _draw_law(axes, [key(run) for run in large], fit, OURS, label)
        _draw_law(axes, [x for x, _ in tables], printed, THESIS, f"thesis' times: slope {printed.slope:.2f}")
        _draw_slope(axes, tables, slope)
        if name == "mutual visibility":
            adjacency = [(row.N, row.Tad) for row in rows]
            axes.loglog(*zip(*adjacency, strict=True), "x", color=THESIS, label="thesis, adjacency graph")
        drawing.dress_series(axes, title, "line segments L" if by_segments else "cells N", "seconds")
        drawing.legend_below(figure, 2)
        drawing.write_figure(figure, folder / f"{file}.png")
    return fits


def draw_steiner(timings: Sequence[Timing], folder: Path) -> dict[str, list[tuple[int, Fit]]]:
    """Figures 44 and 45. Returns fits over the cells for each number of terminals, and over those for each map."""
    by_size = {size: _fit_large([t for t in timings if t.size == size]) for size in _sizes(timings)}
    by_cells = {}
    for cells in _cells(timings):
        some = [t for t in timings if t.cells == cells]
        by_cells[cells] = fit_exponential([t.size for t in some], [t.mean_s for t in some])
    spread = "mean, least and most of the trials"

    figure = drawing.new_figure(11.5, 5.4)
    figure.suptitle(f"Fig. 44: exact Steiner trees by cells; {spread}", fontsize=11, x=0.01, ha="left")
    for number, logarithmic in enumerate((False, True)):
        axes = figure.add_subplot(1, 2, number + 1)
        for shade, (size, fit) in zip(_shades(len(by_size)), by_size.items(), strict=True):
            some = [t for t in timings if t.size == size]
            label = f"{size} terminals" + (f": slope {fit.slope:.1f}" if logarithmic else "")
            _draw_bars(axes, some, [t.cells for t in some], shade, label, "o")
            if logarithmic:
                _draw_law(axes, [t.cells for t in _large(some)], fit, shade, "_")
        if logarithmic:
            _count_cells(axes)
            _draw_slope(axes, [(t.cells, t.mean_s) for t in _large(some)], 2)
        drawing.dress_series(axes, "logarithmic" if logarithmic else "as they are", "cells N", "seconds")
        axes.legend(fontsize=7, frameon=False)
    drawing.write_figure(figure, folder / "fig44-steiner-by-cells.png")

    figure = drawing.new_figure(11.5, 5.4)
    figure.suptitle(f"Fig. 45: exact Steiner trees by terminals; {spread}", fontsize=11, x=0.01, ha="left")
    for number, logarithmic in enumerate((False, True)):
        axes = figure.add_subplot(1, 2, number + 1)
        for shade, (cells, fit) in zip(_shades(len(by_cells)), by_cells.items(), strict=True):
            some = [t for t in timings if t.cells == cells]
            label = f"{cells} cells" + (f": base {fit.slope:.2f}" if logarithmic else "")
            _draw_bars(axes, some, [t.size for t in some], shade, label, "o-")
        if logarithmic:
            axes.set_yscale("log")
            sizes = np.array(list(by_size))
            start = max(t.mean_s for t in timings if t.size == sizes[0])
            axes.plot(sizes, start * 3.0 ** (sizes - sizes[0]), "--", color=drawing.INK, label="base 3 (thesis)")
        drawing.dress_series(axes, "logarithmic" if logarithmic else "as they are", "terminals", "seconds")
        axes.legend(fontsize=7, frameon=False)
    drawing.write_figure(figure, folder / "fig45-steiner-by-terminals.png")
    return {"cells": list(by_size.items()), "terminals": list(by_cells.items())}


def draw_redeployment(timings: Sequence[Timing], folder: Path) -> dict[str, dict[str, list[tuple[int, Fit]]]]:
    """Figures 46 to 50. Returns for each algorithm the fits over the cells for each k, and over k for each map."""
    fits: dict[str, dict[str, list[tuple[int, Fit]]]] = {}
    for algorithm in TITLES:
        some = [t for t in timings if t.algorithm == algorithm]
        over_nodes = fit_exponential if algorithm == "exact" else fit_power
        fits[algorithm] = {
            "cells": [(size, _fit_large([t for t in some if t.size == size])) for size in _sizes(some)],
            "nodes": [
                (cells, over_nodes(*zip(*((t.size, t.mean_s) for t in some if t.cells == cells), strict=True)))
                for cells in _cells(some)
            ],
        }
    one, all_of_them = list(TITLES)[:1], list(TITLES)[1:]
    figures = (
        (46, one, "by cells", "fig46-one-tree-by-cells"),
        (47, one, "by nodes", "fig47-one-tree-by-nodes"),
        (48, all_of_them, "by cells", "fig48-redeployment-by-cells"),
        (49, all_of_them, "by nodes, as they are", "fig49-redeployment-by-nodes"),
        (50, all_of_them, "by nodes", "fig50-redeployment-by-nodes"),
    )
    for number, algorithms, how, file in figures:
        figure = drawing.new_figure(1.6 + 4.6 * len(algorithms), 5.4)
        figure.suptitle(f"Fig. {number}: redeployment {how}", fontsize=11, x=0.01, ha="left")
        axes = None
        for place, algorithm in enumerate(algorithms):
            axes = figure.add_subplot(1, len(algorithms), place + 1, sharey=None if number == 49 else axes)
            some = [t for t in timings if t.algorithm == algorithm]
            if how == "by cells":
                _draw_by_cells(axes, some, dict(fits[algorithm]["cells"]))
            else:
                _draw_by_nodes(axes, some, None if number == 49 else dict(fits[algorithm]["nodes"]))
            drawing.dress_series(axes, TITLES[algorithm], "cells N" if how == "by cells" else "nodes k", "seconds")
            axes.legend(fontsize=6.5, frameon=False, loc="upper left")
        drawing.write_figure(figure, folder / f"{file}.png")
    return fits


def _draw_by_cells(axes: Axes, some: Sequence[Timing], fits: dict[int, Fit]) -> None:
    """A curve for each number of nodes."""
    for shade, (size, fit) in zip(_shades(len(fits)), fits.items(), strict=True):
        members = sorted((t.cells, t.mean_s) for t in some if t.size == size)
        label = f"k = {size}: slope {fit.slope:.2f}"
        axes.plot(*zip(*members, strict=True), "o-", color=shade, markersize=3.5, linewidth=0.9, label=label)
    _count_cells(axes)
    _draw_slope(axes, [(t.cells, t.mean_s) for t in _large([t for t in some if t.size == max(fits)])], 2)


def _draw_by_nodes(axes: Axes, some: Sequence[Timing], fits: dict[int, Fit] | None) -> None:
    """A curve for each map; without fits, no logarithms."""
    maps = _cells(some)
    exact = some[0].algorithm == "exact"
    for shade, cells in zip(_shades(len(maps)), maps, strict=True):
        members = sorted((t.size, t.mean_s) for t in some if t.cells == cells)
        label = f"{cells} cells"
        if fits is not None:
            label += f": {'base' if exact else 'slope'} {fits[cells].slope:.2f}"
        axes.plot(*zip(*members, strict=True), "o-", color=shade, markersize=3.5, linewidth=0.9, label=label)
    if fits is not None:
        axes.set(xscale="linear" if exact else "log", yscale="log")
        for slope in CLAIMS.get(some[0].algorithm, ()):
            _draw_slope(axes, members, slope)
    axes.set_xticks(_sizes(some), [str(size) for size in _sizes(some)])
    axes.set_xticks([], minor=True)


def _draw_bars(axes: Axes, some: Sequence[Timing], xs: Sequence[int], shade: str, label: str, style: str) -> None:
    order = np.argsort(xs, kind="stable")
    low, mean, high = np.array([(t.least_s, t.mean_s, t.most_s) for t in some])[order].T
    axes.errorbar(
        np.array(xs)[order], mean, [mean - low, high - mean], fmt=style, color=shade, markersize=3.5,
        linewidth=0.9, capsize=2, elinewidth=0.7, label=label,
    )  # fmt: skip


def _draw_law(axes: Axes, xs: Sequence[float], fit: Fit, colour: str, label: str) -> None:
    ends = np.array([min(xs), max(xs)], dtype=float)
    axes.plot(ends, fit.factor * ends**fit.slope, "-", color=colour, linewidth=1.0, alpha=0.8, label=label)


def _draw_slope(axes: Axes, points: Sequence[tuple[float, float]], slope: float) -> None:
    """A line of the thesis' slope through the middle of some points."""
    x, y = np.log(np.array(points)).T
    ends = np.array([x.min(), x.max()])
    style = ":" if slope == 5 else "--"
    axes.plot(
        np.exp(ends),
        np.exp(y.mean() + slope * (ends - x.mean())),
        style,
        color=drawing.INK,
        linewidth=1.1,
        label=f"slope {slope:g} (thesis)",
    )


def _count_cells(axes: Axes) -> None:
    """Logarithmic axes, with numbers of cells on the one."""
    ticks = (25, 50, 100, 200, 400, 800)
    axes.set(xscale="log", yscale="log")
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.set_xticks([], minor=True)


def _fit_large(some: Sequence[Timing]) -> Fit:
    large = _large(some)
    return fit_power([t.cells for t in large], [t.mean_s for t in large])


def _large(some: Sequence[Timing]) -> Sequence[Timing]:
    """Those on maps of enough cells; all of them if these are too few for a line."""
    large = [t for t in some if t.cells >= LARGE]
    return large if len({t.cells for t in large}) > 2 else some


def _sizes(some: Sequence[Timing]) -> list[int]:
    return sorted({t.size for t in some})


def _cells(some: Sequence[Timing]) -> list[int]:
    return sorted({t.cells for t in some})


def _shades(number: int) -> list[str]:
    """Colours from dark to light, in order."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return [to_hex(colormaps["viridis"](place)) for place in np.linspace(0.0, 0.88, number)]
