"""The study of thesis §3.3.1: histograms of virtual edge weights, figures 25 to 30.

exp(−area) has a unit of length in it, and the thesis does not name the one of its maps. So each map is measured twice:
in metres as packaged, and at the scale at which the mean of exp(−area) + exp(−area) over its pairs is what fig. 26
says. What else figures 25 and 26 say can then be compared.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import kurtosis, skew

import maps
from launcher.studies import drawing
from launcher.studies.thesis_tables import AREA_WEIGHTS, EXPONENTIAL_AREA, INVERSE_AREA, ROWS, Kind
from planning import Cells, Environment, decompose, mutual_visibility, virtual_weights
from planning.shortest_paths import from_source, path

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MEASURES = {
    "distance": "centroid distance, eq. 20",
    "inverse area": "1 / area + 1 / area, eq. 21",
    "exponential area": "exp(−area) + exp(−area), eq. 22",
    "normalised": "mean of both costs, each divided by its greatest, eq. 25 without 1.01",
}
BARS = 60
OURS, THESIS = "#0b6b74", "#c227b9"


@dataclass(frozen=True, slots=True, eq=False)
class Weighed:
    """The pairs of cells of one map that see each other, and what their edges cost by each measure."""

    map: str
    kind: Kind
    unit: str
    """``metres``, or ``thesis`` for the scale of fig. 26."""
    scale: float
    """Length of the map here per length as packaged."""
    cells: Cells
    pairs: tuple[Ints, Ints]
    """The different cells that see each other, each pair once."""
    costs: Mapping[str, Floats]
    """(pairs,) float by measure."""
    distance: Floats
    """(N, N) float: the first measure as weights; inf where two cells do not see each other, 0 on the diagonal."""

    @property
    def name(self) -> str:
        """For titles."""
        return f"{self.map}, {self.kind} cells"


def study_weights(folder: Path, shown: str = "room3", tell: Callable[[str], None] = print) -> str:
    """Weigh all edges of the thesis' maps, draw the histograms, and say what came out.

    Args:
        folder: is made; files in it of the same names are replaced.
        shown: the map whose aspect cells figures 25 to 30 are drawn of; figure ``maps`` shows all.
        tell: is told what is being done.

    Returns:
        The text of ``summary.md``.
    """
    folder.mkdir(parents=True, exist_ok=True)
    weighed: list[Weighed] = []
    for row in ROWS:
        tell(f"{row.map}, {row.kind}")
        weighed += weigh(row.map, row.kind)
    example = next((one for one in weighed if (one.map, one.kind, one.unit) == (shown, "aspect", "thesis")), None)
    if example is None:
        example = weigh(shown, "aspect")[1]
    tell("figures")
    bars: list[tuple[str, str, float, float, int]] = []
    _draw_areas(example, folder, bars)
    _draw_hops(example, folder)
    _draw_mixtures(example, folder, bars)
    _draw_maps([one for one in weighed if one.unit == "metres"], folder, bars)
    drawing.write_table(folder / "histograms.csv", ("figure", "panel", "from", "to", "pairs"), bars)
    statistics = [
        (one.map, one.kind, one.unit, one.scale, len(one.pairs[0]), measure, *describe(one.costs[measure]))
        for one in weighed
        for measure in MEASURES
    ]
    drawing.write_table(
        folder / "statistics.csv",
        ("map", "kind", "unit", "scale", "pairs", "measure", "mean", "deviation", "skewness", "kurtosis", "greatest"),
        statistics,
    )
    text = _sum_up(weighed, example)
    (folder / "summary.md").write_text(text, encoding="utf-8")
    return text


def weigh(name: str, kind: Kind) -> tuple[Weighed, Weighed]:
    """The edges of a map in metres, and at the scale of fig. 26."""
    environment = Environment.load(maps.path(name))
    cells = decompose(environment, kind)
    metres = _weigh_cells(name, kind, "metres", 1.0, cells)
    scale = find_scale(cells.areas, metres.pairs)
    holes = [hole * scale for hole in environment.holes]
    scaled = decompose(Environment(environment.outer * scale, holes, environment.name), kind)
    return metres, _weigh_cells(name, kind, "thesis", scale, scaled)


def find_scale(areas: Floats, pairs: tuple[Ints, Ints]) -> float:
    """The factor of lengths at which exp(−area) + exp(−area) has the mean of fig. 26."""

    def excess(logarithm: float) -> float:
        costs = np.exp(-areas * np.exp(2.0 * logarithm))
        return float((costs[pairs[0]] + costs[pairs[1]]).mean()) - EXPONENTIAL_AREA[0]

    return float(np.exp(brentq(excess, -20.0, 20.0, xtol=1e-12)))


def describe(costs: Floats) -> tuple[float, float, float, float, float]:
    """Mean, standard deviation, skewness, excess kurtosis, greatest."""
    return float(costs.mean()), float(costs.std()), float(skew(costs)), float(kurtosis(costs)), float(costs.max())


def _weigh_cells(name: str, kind: Kind, unit: str, scale: float, cells: Cells) -> Weighed:
    seen = mutual_visibility(cells)
    first, second = seen.nonzero()
    once = first < second
    pairs = first[once].astype(np.int64), second[once].astype(np.int64)
    distance = virtual_weights(cells, seen, form="combined", area_weight=0.0)
    costs = {
        "distance": distance[pairs],
        # As printed; `virtual_weights` would count the smallest slivers larger than they are.
        "inverse area": 1.0 / cells.areas[pairs[0]] + 1.0 / cells.areas[pairs[1]],
        "exponential area": virtual_weights(cells, seen, form="combined", distance_weight=0.0)[pairs],
        "normalised": virtual_weights(cells, seen, robot_penalty=0.0)[pairs],
    }
    return Weighed(name, kind, unit, scale, cells, pairs, costs, distance)


def _draw_areas(one: Weighed, folder: Path, bars: list[tuple[str, str, float, float, int]]) -> None:
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


def _draw_hops(one: Weighed, folder: Path) -> None:
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


def _draw_mixtures(one: Weighed, folder: Path, bars: list[tuple[str, str, float, float, int]]) -> None:
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


def _draw_maps(weighed: Sequence[Weighed], folder: Path, bars: list[tuple[str, str, float, float, int]]) -> None:
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


def draw_walls(axes: Axes, environment: Environment) -> None:
    """The walls of a map, free space white."""
    axes.set_facecolor("#eceff1")
    axes.fill(*environment.outer.T, facecolor="white", edgecolor=drawing.INK, linewidth=0.8, zorder=0)
    for hole in environment.holes:
        axes.fill(*hole.T, facecolor="#eceff1", edgecolor=drawing.INK, linewidth=0.8, zorder=1)


def _draw_bars(
    axes: Axes, costs: Floats, bars: list[tuple[str, str, float, float, int]], figure: str, panel: str
) -> tuple[float, float]:
    """A histogram, which is also added to the table; returns where it begins and how wide a bar is."""
    counts, edges = np.histogram(costs, BARS)
    axes.stairs(counts, edges, fill=True, color=OURS, alpha=0.75)
    bars += [
        (figure, panel, float(low), float(high), int(count))
        for low, high, count in zip(edges[:-1], edges[1:], counts, strict=True)
    ]
    return float(edges[0]), float(edges[1] - edges[0])


def _sum_up(weighed: Sequence[Weighed], example: Weighed) -> str:
    """The text of ``summary.md``."""
    scaled = [one for one in weighed if one.unit == "thesis"]
    metres = [one for one in weighed if one.unit == "metres"]
    rows = []
    for one, real in zip(scaled, metres, strict=True):
        inverse, exponential = one.costs["inverse area"], one.costs["exponential area"]
        lopsided, in_metres = (describe(some.costs["normalised"])[2] for some in (one, real))
        rows.append(
            f"| {one.name} | {len(one.pairs[0])} | {1 / one.scale:.2f} m | {exponential.std():.2f} | "
            f"{inverse.mean():.4g} | {inverse.std():.4g} | {lopsided:+.2f} | "
            f"{real.costs['exponential area'].mean():.3g} | {in_metres:+.2f} |"
        )
    aspect = [one for one in scaled if one.kind == "aspect"]
    nearest = min(aspect, key=lambda one: abs(one.costs["exponential area"].std() - EXPONENTIAL_AREA[1]))
    mixed = {
        weight: [
            float(np.corrcoef(example.costs["distance"] + weight * example.costs["exponential area"], cost)[0, 1])
            for cost in (example.costs["distance"], example.costs["exponential area"])
        ]
        for weight in AREA_WEIGHTS
    }
    balanced = min(AREA_WEIGHTS, key=lambda weight: abs(mixed[weight][0] - mixed[weight][1]))
    balance = describe(example.costs["normalised"])
    both = [
        float(np.corrcoef(example.costs["normalised"], example.costs[measure])[0, 1])
        for measure in ("distance", "exponential area")
    ]
    return "\n".join(
        [
            "# Study of virtual edge weights\n",
            "All pairs of different cells that see each other, on the thesis' maps. exp(−area) depends on the unit of "
            "length, and the thesis does not say its own; at the *unit* below, exp(−area) + exp(−area) has the mean of "
            f"fig. 26, {EXPONENTIAL_AREA[0]:g}. The other columns up to the first skewness are at that unit, the last "
            "two in metres as packaged.\n",
            "| map | pairs | unit | exp: deviation | inverse: mean | inverse: deviation | normalised: skewness | exp "
            "in metres: mean | normalised in metres: skewness |",
            "|---|---|---|---|---|---|---|---|---|",
            f"| **thesis, Fig. 21** | ? | ? | {EXPONENTIAL_AREA[1]:g} | {INVERSE_AREA[0]:g} | {INVERSE_AREA[1]:g} | "
            '"almost Gaussian" | – | – |',
            *rows,
            "",
            "Which aspect decomposition Fig. 21 shows is not known, as the figure is lost in the text we have. By the "
            f"deviation of exp the nearest is {nearest.name}; the inverse is decided by the smallest slivers, which "
            "rebuilt maps do not share.\n",
            f"Figures 25 to 30 are drawn of {example.name}, at that unit; `maps.png` of all maps, in metres.\n",
            "- **Fig. 25: the inverse area has a heavy tail.** It has: with aspect cells the deviation is "
            f"{min(_tail(one) for one in aspect):.1f} to {max(_tail(one) for one in aspect):.1f} times the mean "
            f"(thesis {INVERSE_AREA[1] / INVERSE_AREA[0]:.1f}).",
            "- **Fig. 26: the exponential is smooth and at most 2.** It is at most 2, and smooth at the right "
            "unit. It says little where all areas are far above 1, or far below: see its mean in metres.",
            "- **Fig. 27: distance alone takes many small hops.** So it does; the figure counts them.",
            "- **Fig. 29: as k_b grows, the mixture goes over from distance to area.** Correlations with both: "
            + ", ".join(f"k_b = {weight:g} {a:.2f} and {b:.2f}" for weight, (a, b) in mixed.items())
            + f". They are nearest at k_b = {balanced:g}; that number depends on the map and its unit.",
            f"- **Fig. 30: normalised, the result is almost Gaussian.** Skewness {balance[2]:.2f}, excess "
            f"kurtosis {balance[3]:.2f} (both 0 for a Gaussian), correlation with distance {both[0]:.2f} and with area "
            f"{both[1]:.2f}. On other maps it has another shape: see `maps.png`.",
            "",
        ]
    )


def _tail(one: Weighed) -> float:
    """Deviation over mean of the inverse area."""
    inverse = one.costs["inverse area"]
    return float(inverse.std() / inverse.mean())
