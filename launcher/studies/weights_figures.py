"""Figures 25 to 30 of the thesis: histograms of virtual edge weights, and paths that they make."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from launcher.studies import drawing
from launcher.studies.map_drawing import draw_walls
from launcher.studies.thesis_tables import AREA_WEIGHTS, EXPONENTIAL_AREA, INVERSE_AREA
from launcher.studies.weighed_edges import MEASURES, Weighed, describe
from planning.shortest_paths import from_source, path

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]
Bars: TypeAlias = list[tuple[str, str, float, float, int]]
"""Figure, panel, from, to, pairs: of all histograms drawn so far."""

BARS = 60
OURS, THESIS = "#0b6b74", "#c227b9"


def draw_areas(one: Weighed, folder: Path, bars: Bars) -> None:
    """Figures 25 and 26."""
    inverse, exponential = one.costs["inverse area"], one.costs["exponential area"]
    figure = drawing.new_figure(10.5, 4.0)
    figure.suptitle(f"Fig. 25: inverse area; {one.name}", fontsize=11, x=0.01, ha="left")
    cut = float(np.quantile(inverse, 0.9))
    for number, (panel, some) in enumerate((("all", inverse), ("the lower 90 %", inverse[inverse <= cut]))):
        axes = figure.add_subplot(1, 2, number + 1)
        _draw_bars(axes, some, bars, "25", panel)
        title = panel if number else f"all: mean {inverse.mean():.4g}, deviation {inverse.std():.4g}"
        drawing.dress_series(axes, title, "1 / area + 1 / area", "pairs")
        if number == 0:
            mean, deviation = INVERSE_AREA
            axes.axvline(mean, color=THESIS, linewidth=1, label=f"thesis: mean {mean:g}, deviation {deviation:g}")
            axes.legend(fontsize=8, frameon=False)
    drawing.write_figure(figure, folder / "fig25-inverse-area.png")

    figure = drawing.new_figure(6.4, 4.2)
    axes = figure.add_subplot()
    _draw_bars(axes, exponential, bars, "26", "all")
    mean, deviation = EXPONENTIAL_AREA
    axes.axvline(mean, color=THESIS, linewidth=1.2, label=f"thesis: mean {mean:g}, deviation {deviation:g}")
    axes.axvspan(mean - deviation, mean + deviation, color=THESIS, alpha=0.08, linewidth=0)
    for side in (-1, 1):
        axes.axvline(mean + side * exponential.std(), color=OURS, linestyle=":", linewidth=1.2)
    label = f"ours: mean {exponential.mean():.3g} by the choice of scale, deviation {exponential.std():.2f}"
    axes.plot([], [], ":", color=OURS, label=label)
    drawing.dress_series(axes, f"Fig. 26: negative exponential; {one.name}", "exp(−area) + exp(−area)", "pairs")
    drawing.legend_below(figure, 1)
    drawing.write_figure(figure, folder / "fig26-exponential-area.png")


def draw_hops(one: Weighed, folder: Path) -> None:
    """Figure 27: the shortest paths of a pair by distance alone, and with a penalty for each edge."""
    distance = one.distance
    greatest = distance[one.pairs].max()
    penalised = np.where(np.isfinite(distance), distance + 1.01 * greatest, np.inf)
    np.fill_diagonal(penalised, 0.0)
    lengths, _ = from_source(distance, 0)
    start = int(np.argmax(lengths))
    goal = int(np.argmax(from_source(distance, start)[0]))
    figure = drawing.new_figure(11.5, 4.4)
    figure.suptitle(f"Fig. 27: the shortest path between two cells; {one.name}", fontsize=11, x=0.01, ha="left")
    for number, (title, W) in enumerate((("distance alone", distance), ("a penalty for each edge", penalised))):
        axes = figure.add_subplot(1, 2, number + 1)
        cells = path(from_source(W, start)[1], start, goal)
        draw_walls(axes, one.cells.environment)
        axes.plot(*one.cells.centroids[cells].T, "o-", color=OURS, markersize=4, linewidth=1.4)
        low, high = one.cells.corners.min(axis=0), one.cells.corners.max(axis=0)
        margin = 0.02 * (high - low).max()
        drawing.dress_plane(axes, f"{title}: {len(cells) - 1} hops", low - margin, high + margin)
        axes.set(xlabel="x [thesis' unit]", ylabel="y [thesis' unit]")
    drawing.write_figure(figure, folder / "fig27-hops.png")


def draw_mixtures(one: Weighed, folder: Path, bars: Bars) -> None:
    """Figures 28 to 30."""
    distance, area = one.costs["distance"], one.costs["exponential area"]
    figure = drawing.new_figure(10.5, 4.0)
    figure.suptitle(f"Fig. 28: the two costs to be mixed; {one.name}", fontsize=11, x=0.01, ha="left")
    for number, measure in enumerate(("distance", "exponential area")):
        axes = figure.add_subplot(1, 2, number + 1)
        _draw_bars(axes, one.costs[measure], bars, "28", measure)
        drawing.dress_series(axes, MEASURES[measure], "thesis' unit of length" if number == 0 else "no unit", "pairs")
    drawing.write_figure(figure, folder / "fig28-costs.png")

    figure = drawing.new_figure(11.5, 6.2)
    figure.suptitle(
        f"Fig. 29: distance + k_b · area cost, and its correlations with distance and area; {one.name}",
        fontsize=11,
        x=0.01,
        ha="left",
    )
    for number, weight in enumerate(AREA_WEIGHTS):
        axes = figure.add_subplot(2, 3, number + 1)
        mixed = distance + weight * area
        _draw_bars(axes, mixed, bars, "29", f"{weight:g}")
        alike = [float(np.corrcoef(mixed, cost)[0, 1]) for cost in (distance, area)]
        title = f"k_b = {weight:g}; correlations {alike[0]:.2f}, {alike[1]:.2f}"
        drawing.dress_series(axes, title, "cost", "pairs")
        axes.title.set_fontsize(8)
    drawing.write_figure(figure, folder / "fig29-combined.png")

    figure = drawing.new_figure(6.4, 4.2)
    axes = figure.add_subplot()
    normalised = one.costs["normalised"]
    low, step = _draw_bars(axes, normalised, bars, "30", "all")
    mean, deviation, skewness, _, _ = describe(normalised)
    across = np.linspace(low, low + BARS * step, 200)
    bell = np.exp(-0.5 * ((across - mean) / deviation) ** 2) / (deviation * np.sqrt(2 * np.pi))
    axes.plot(across, bell * len(normalised) * step, color=THESIS, label='Gaussian ("almost", says the thesis)')
    label = f"mean {mean:.3f}, deviation {deviation:.3f}, skewness {skewness:.2f}"
    axes.plot([], [], " ", label=label)
    drawing.dress_series(axes, f"Fig. 30: both costs normalised; {one.name}", "½ (a / max a + b / max b)", "pairs")
    drawing.legend_below(figure, 1)
    drawing.write_figure(figure, folder / "fig30-normalised.png")


def draw_maps(weighed: Sequence[Weighed], folder: Path, bars: Bars) -> None:
    """The normalised costs of all maps in metres, as they are used."""
    figure = drawing.new_figure(14.5, 5.8)
    title = "The normalised costs of all maps, in metres as packaged: what deployments are planned with, less 1.01"
    figure.suptitle(title, fontsize=11, x=0.01, ha="left")
    for number, one in enumerate(weighed):
        axes = figure.add_subplot(2, 5, number + 1)
        _draw_bars(axes, one.costs["normalised"], bars, "maps", one.name)
        title = f"{one.map}, {one.kind}; skewness {describe(one.costs['normalised'])[2]:.2f}"
        drawing.dress_series(axes, title, "½ (a / max a + b / max b)", "pairs")
        axes.title.set_fontsize(8)
        axes.set_xlim(0, 1)
    drawing.write_figure(figure, folder / "maps.png")


def _draw_bars(axes: Axes, costs: Floats, bars: Bars, figure: str, panel: str) -> tuple[float, float]:
    """A histogram, which is also added to the table; returns where it begins and how wide a bar is."""
    counts, edges = np.histogram(costs, BARS)
    axes.stairs(counts, edges, fill=True, color=OURS, alpha=0.75)
    bars += [
        (figure, panel, float(low), float(high), int(count))
        for low, high, count in zip(edges[:-1], edges[1:], counts, strict=True)
    ]
    return float(edges[0]), float(edges[1] - edges[0])
