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

Key = Callable[[MapRun], float]


def draw_once(runs: Sequence[MapRun], folder: Path) -> dict[str, tuple[Fit, Fit]]:
    """Figures 41 to 43: what is computed once for a map. Returns our fit and the thesis', by what was computed."""
    cells: Key = lambda run: run.counts["N"]  # noqa: E731
    panels: tuple[tuple[str, str, str, str, Key, Key, str, float], ...] = (
        ("decomposition", "Fig. 41: decomposition", "fig41-decomposition", "line segments L",
         lambda run: run.segments, lambda run: run.decomposition_s, "Td", 2),
        ("mutual visibility", "Fig. 42: mutual visibility graph", "fig42-visibility", "cells N",
         cells, lambda run: run.visibility_s, "Tmv", 2),
        ("all pairs", "Fig. 43: all shortest paths, mutual visibility graph", "fig43-all-pairs", "cells N",
         cells, lambda run: run.all_pairs_s, "Tpv", 3),
        ("all adjacency paths", "Fig. 43: all shortest paths, adjacency graph", "fig43-adjacency-paths", "cells N",
         cells, lambda run: run.adjacency_paths_s, "Tpp", 3),
    )  # fmt: skip
    fits = {}
    for name, title, file, across, key, ours, theirs, slope in panels:
        figure = drawing.new_figure(6.4, 5.2)
        axes = figure.add_subplot()
        done = [run for run in runs if np.isfinite(ours(run))]
        known = [run for run in done if run.thesis is not None]
        beyond = [run for run in done if run.thesis is None]
        large = [run for run in done if run.counts["N"] >= LARGE] if len(done) > 4 else done
        tables = [(key(run), float(getattr(run.thesis, theirs))) for run in known]
        fit = fit_power([key(run) for run in large], [ours(run) for run in large])
        printed = fit_power(*zip(*tables, strict=True))
        fits[name] = fit, printed
        axes.loglog(*zip(*tables, strict=True), "s", color=THESIS, markersize=5, label="thesis, Tables 1 and 2")
        axes.loglog([key(r) for r in known], [ours(r) for r in known], "o", color=OURS, label="ours, the thesis' maps")
        if beyond:
            xs, ys = [key(run) for run in beyond], [ours(run) for run in beyond]
            axes.loglog(xs, ys, "o", color=BEYOND, label="ours, bitangents the thesis left out")
        _draw_law(axes, [key(run) for run in large], fit, OURS, f"ours from {LARGE} cells on: slope {fit.slope:.2f}")
        _draw_law(axes, [x for x, _ in tables], printed, THESIS, f"thesis' times: slope {printed.slope:.2f}")
        _draw_slope(axes, tables, slope)
        if name == "mutual visibility":
            adjacency = [(key(run), run.thesis.Tad) for run in known if run.thesis]
            axes.loglog(*zip(*adjacency, strict=True), "x", color=THESIS, label="thesis, adjacency graph")
        drawing.dress_series(axes, title, across, "seconds")
        drawing.legend_below(figure, 2)
        drawing.write_figure(figure, folder / f"{file}.png")
    return fits


def draw_steiner(timings: Sequence[Timing], folder: Path) -> dict[str, list[tuple[int, Fit]]]:
    """Figures 44 and 45. Returns fits over the cells for each number of terminals, and over those for each map."""
    sizes, numbers = _sizes(timings), _cells(timings)
    shades = _shades(max(len(sizes), len(numbers)))
    figure = drawing.new_figure(11.5, 5.4)
    figure.suptitle(
        "Fig. 44: exact Steiner trees by cells; mean, least and most of the trials", fontsize=11, x=0.01, ha="left"
    )
    over_cells, over_terminals = [], []
    for number, logarithmic in enumerate((False, True)):
        axes = figure.add_subplot(1, 2, number + 1)
        for shade, size in zip(shades, sizes, strict=False):
            some = [t for t in timings if t.size == size]
            label = f"{size} terminals"
            if logarithmic:
                over_cells.append((size, fit := _fit_large(some)))
                _draw_law(axes, [t.cells for t in _large(some)], fit, shade, "_")
                label += f": slope {fit.slope:.1f}"
            _draw_bars(axes, some, [t.cells for t in some], shade, label)
        if logarithmic:
            axes.set(xscale="log", yscale="log")
            _draw_slope(axes, [(t.cells, t.mean_s) for t in timings if t.size == sizes[-1]], 2)
        drawing.dress_series(axes, "logarithmic" if logarithmic else "as they are", "cells N", "seconds")
        axes.legend(fontsize=7, frameon=False)
    drawing.write_figure(figure, folder / "fig44-steiner-by-cells.png")

    figure = drawing.new_figure(11.5, 5.4)
    figure.suptitle(
        "Fig. 45: exact Steiner trees by terminals; mean, least and most of the trials", fontsize=11, x=0.01, ha="left"
    )
    for number, logarithmic in enumerate((False, True)):
        axes = figure.add_subplot(1, 2, number + 1)
        for shade, cells in zip(shades, numbers, strict=False):
            some = [t for t in timings if t.cells == cells]
            label = f"{cells} cells"
            if logarithmic:
                over_terminals.append((cells, fit := fit_exponential([t.size for t in some], [t.mean_s for t in some])))
                label += f": base {fit.slope:.2f}"
            _draw_bars(axes, some, [t.size for t in some], shade, label, line=True)
        if logarithmic:
            axes.set_yscale("log")
            start = max(t.mean_s for t in timings if t.size == sizes[0])
            axes.plot(
                sizes, start * 3.0 ** (np.array(sizes) - sizes[0]), "--", color=drawing.INK, label="base 3 (thesis)"
            )
        drawing.dress_series(axes, "logarithmic" if logarithmic else "as they are", "terminals", "seconds")
        axes.legend(fontsize=7, frameon=False)
    drawing.write_figure(figure, folder / "fig45-steiner-by-terminals.png")
    return {"cells": over_cells, "terminals": over_terminals}


def draw_redeployment(timings: Sequence[Timing], folder: Path) -> dict[str, dict[str, list[tuple[int, Fit]]]]:
    """Figures 46 to 50. Returns for each algorithm the fits over the cells for each k, and over k for each map."""
    fits: dict[str, dict[str, list[tuple[int, Fit]]]] = {}
    for algorithm in dict.fromkeys(t.algorithm for t in timings):
        some = [t for t in timings if t.algorithm == algorithm]
        over_nodes = fit_exponential if algorithm == "exact" else fit_power
        fits[algorithm] = {
            "cells": [(size, _fit_large([t for t in some if t.size == size])) for size in _sizes(some)],
            "nodes": [
                (cells, over_nodes(*zip(*((t.size, t.mean_s) for t in some if t.cells == cells), strict=True)))
                for cells in _cells(some)
            ],
        }
    one = ("one tree",)
    _draw_searches(
        timings,
        one,
        fits,
        "cells",
        2,
        "Fig. 46: one tree (algorithms 4 to 6) by cells",
        folder / "fig46-one-tree-by-cells.png",
    )
    _draw_searches(
        timings, one, fits, "nodes", 1, "Fig. 47: one tree by nodes k", folder / "fig47-one-tree-by-nodes.png"
    )
    rest = ("tree by tree", "by messages", "exact")
    _draw_searches(
        timings,
        rest,
        fits,
        "cells",
        2,
        "Fig. 48: all modifications, tree by tree and by messages, and the exact search, by cells",
        folder / "fig48-redeployment-by-cells.png",
    )
    _draw_searches(
        timings,
        rest,
        fits,
        "plain nodes",
        0,
        "Fig. 49: the same by nodes k",
        folder / "fig49-redeployment-by-nodes.png",
    )
    _draw_searches(
        timings,
        rest,
        fits,
        "nodes",
        4,
        "Fig. 50: the same by nodes k, logarithmic",
        folder / "fig50-redeployment-by-nodes.png",
    )
    return fits


def _draw_searches(
    timings: Sequence[Timing],
    algorithms: Sequence[str],
    fits: dict[str, dict[str, list[tuple[int, Fit]]]],
    over: str,
    slope: float,
    title: str,
    file: Path,
) -> None:
    """A panel for each algorithm, one above it all logarithmic unless ``over`` is plain."""
    figure = drawing.new_figure(6.4 if len(algorithms) == 1 else 14.5, 5.4)
    figure.suptitle(title, fontsize=11, x=0.01, ha="left")
    axes = None
    for number, algorithm in enumerate(algorithms):
        axes = figure.add_subplot(1, len(algorithms), number + 1, sharey=axes if "plain" not in over else None)
        some = [t for t in timings if t.algorithm == algorithm]
        by_cells = over == "cells"
        groups = _sizes(some) if by_cells else _cells(some)
        for shade, group in zip(_shades(len(groups)), groups, strict=True):
            members = [t for t in some if (t.size if by_cells else t.cells) == group]
            xs, ys = [t.cells if by_cells else t.size for t in members], [t.mean_s for t in members]
            label = f"k = {group}" if by_cells else f"{group} cells"
            if "plain" not in over:
                fit = dict(fits[algorithm][over])[group]
                label += f": {'base' if algorithm == 'exact' and not by_cells else 'slope'} {fit.slope:.2f}"
            order = np.argsort(xs, kind="stable")
            axes.plot(
                np.array(xs)[order], np.array(ys)[order], "o-", color=shade, markersize=3.5, linewidth=0.9, label=label
            )
        if "plain" not in over:
            axes.set(xscale="log", yscale="log")
            last = [
                (t.cells if by_cells else t.size, t.mean_s)
                for t in some
                if (t.size if by_cells else t.cells) == groups[-1]
            ]
            if not (algorithm == "exact" and not by_cells):
                _draw_slope(axes, last, slope)
            if algorithm == "tree by tree" and not by_cells:
                _draw_slope(axes, last, 5)
            if not by_cells:
                axes.set_xticks(_sizes(some), [str(size) for size in _sizes(some)])
                axes.minorticks_off()
        what = {
            "one tree": "one tree",
            "tree by tree": "algorithm 7, tree by tree",
            "by messages": "algorithm 7, by messages",
        }
        drawing.dress_series(
            axes, what.get(algorithm, "exact, all trees"), "cells N" if by_cells else "nodes k", "seconds"
        )
        axes.legend(fontsize=6.5, frameon=False, loc="upper left")
    drawing.write_figure(figure, file)


def _draw_bars(
    axes: Axes, some: Sequence[Timing], xs: Sequence[int], shade: str, label: str, line: bool = False
) -> None:
    order = np.argsort(xs, kind="stable")
    low, mean, high = np.array([(t.least_s, t.mean_s, t.most_s) for t in some])[order].T
    axes.errorbar(
        np.array(xs)[order], mean, [mean - low, high - mean], fmt="o-" if line else "o", color=shade, markersize=3.5,
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
