"""What the studies' figures are made of: annuli, regions, ellipses, trails; and the files beside them."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.ellipsoid import Ellipsoid, EmptyIntersection
from estimation.feasible_set import FeasibleSet, Region

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

# The colours of the thesis' figures 12, 15 and 17; the tight set is ours.
ANNULI = ("#00a8b5", "#4f9d2f")
PROJECTION = "#c227b9"
SLICE = "#2f4bd6"
FEASIBLE = "#d1261f"
TIGHT = "#f0a11c"
BASELINE = "#7b8794"
ROBOTS = ("#0b6b74", "#2f6b18")
INK = "#22272e"

DOTS_PER_IN = 110


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure that needs no display and arranges its parts itself."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), dpi=DOTS_PER_IN, layout="constrained")


def new_panels(number: int, title: str) -> tuple[Figure, list[Axes]]:
    """A figure with so many axes, four in a row."""
    columns = min(number, 4)
    rows = -(-number // columns)
    figure = new_figure(3.7 * columns, 3.2 * rows + 0.8)
    figure.suptitle(title, fontsize=11, x=0.01, ha="left")
    return figure, [figure.add_subplot(rows, columns, place + 1) for place in range(number)]


def shade_of(value: int, series: Sequence[int]) -> str:
    """A colour for one of several values in order."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return to_hex(colormaps["viridis"](0.88 * series.index(value) / max(len(series) - 1, 1)))


def write_figure(figure: Figure, file: Path) -> Path:
    """Write a figure as PNG of 256 colours, with less than half the bytes of one of all; the folder must exist."""
    from PIL import Image

    full = io.BytesIO()
    figure.savefig(full, format="png", dpi=DOTS_PER_IN)
    with Image.open(full) as image:
        # Thin curves have few pixels: cells of the octree keep their colours, the median cut would merge them.
        few = image.convert("RGB").quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
        few.save(file, optimize=True)
    return file


def write_table(file: Path, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> Path:
    """Write a CSV file; floats with 7 digits."""
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows([f"{value:.7g}" if isinstance(value, float) else value for value in row] for row in rows)
    return file


def draw_annulus(axes: Axes, anchor: ArrayLike, inner: float, outer: float, colour: str) -> None:
    """The places that one range leaves."""
    from matplotlib.patches import Annulus, Circle

    x, y = np.asarray(anchor, dtype=float)
    inner, outer = max(inner, 0.0), max(outer, 1e-9)
    if inner > 0:
        axes.add_patch(Annulus((x, y), outer, outer - inner, facecolor=colour, alpha=0.16, linewidth=0))
    else:
        axes.add_patch(Circle((x, y), outer, facecolor=colour, alpha=0.16, linewidth=0))
    for radius in (inner, outer):
        axes.add_patch(Circle((x, y), radius, fill=False, edgecolor=colour, linewidth=0.7, alpha=0.8))


def draw_regions(
    axes: Axes, regions: Iterable[Region], colour: str, label: str, alpha: float = 0.55, width: float = 1.1
) -> None:
    """Pieces of the plane, with their holes."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    for number, region in enumerate(regions):
        rings = [np.vstack([ring, ring[:1]]) for ring in (region.outer, *region.holes)]
        outline = Outline.make_compound_path(*(Outline(ring, closed=True) for ring in rings))
        axes.add_patch(PathPatch(outline, facecolor=colour, alpha=alpha, linewidth=0, zorder=3))
        axes.add_patch(
            PathPatch(
                outline,
                facecolor="none",
                edgecolor=colour,
                linewidth=width,
                zorder=4,
                label=label if number == 0 else "_",
            )
        )


def draw_ellipse(axes: Axes, ellipse: Ellipsoid, colour: str, label: str, style: str = "-") -> None:
    """A bounded ellipse in the plane."""
    around = np.linspace(0, 2 * np.pi, 241)
    ring = ellipse.center[:, None] + ellipse.factor @ np.array([np.cos(around), np.sin(around)])
    axes.plot(ring[0], ring[1], style, color=colour, linewidth=1.2, label=label, zorder=5)


def draw_sets(axes: Axes, feasible: FeasibleSet, tight: Sequence[Floats]) -> None:
    """Feasible set, base projection, tangent slice, and the tight set beside them."""
    draw_ellipse(axes, feasible.base_projection(), PROJECTION, "base projection")
    flat = feasible.tangent_slice()
    if not isinstance(flat, EmptyIntersection):
        draw_ellipse(axes, flat, SLICE, "tangent slice", ":")
    draw_regions(axes, feasible.regions, FEASIBLE, "feasible set", alpha=0.3)
    draw_regions(axes, [Region(piece) for piece in tight], TIGHT, "tight set", alpha=0.95, width=0.6)


def draw_target(axes: Axes, place: ArrayLike) -> None:
    """A bold T, as in the thesis, beside a cross, so that small sets are not hidden."""
    x, y = np.asarray(place, dtype=float)
    axes.plot(x, y, "+", color=INK, markersize=6, zorder=8)
    axes.annotate(
        "T",
        (x, y),
        (4, 3),
        textcoords="offset points",
        color=INK,
        fontsize=11,
        fontweight="bold",
        zorder=8,
        clip_on=True,
    )


def draw_trail(axes: Axes, places: Floats, colour: str, label: str) -> None:
    """Where a robot has been, and where it is; places (n, 2) float, metres."""
    axes.plot(places[:, 0], places[:, 1], "-", color=colour, linewidth=1.4, zorder=6)
    axes.plot(*places[0], "o", color="white", markeredgecolor=colour, markersize=4, zorder=6)
    axes.plot(*places[-1], "o", color=colour, markersize=6.5, markeredgecolor="white", label=label, zorder=7)


def dress_plane(axes: Axes, title: str, low: ArrayLike, high: ArrayLike) -> None:
    """Same scale on both axes, and a title; corners (2,) float, metres."""
    (x0, y0), (x1, y1) = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    axes.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal")
    axes.set_title(title, fontsize=9, loc="left", parse_math=False)
    axes.set_xlabel("x [m]", fontsize=7, labelpad=1)
    axes.set_ylabel("y [m]", fontsize=7, labelpad=0)
    axes.tick_params(labelsize=7, length=2)


def dress_series(axes: Axes, title: str, across: str, up: str) -> None:
    """Labels and a faint grid for a curve."""
    axes.set_title(title, fontsize=9, loc="left", parse_math=False)
    axes.set_xlabel(across, fontsize=8)
    axes.set_ylabel(up, fontsize=8)
    axes.tick_params(labelsize=7, length=2)
    axes.grid(alpha=0.25, linewidth=0.6)


def draw_spread(axes: Axes, across: ArrayLike, rows: Floats, colour: str, label: str, style: str = "-") -> Floats:
    """Median over runs, and the middle half as a band; rows (runs, n) float, nan left out. Returns (3, n) quartiles."""
    quartiles = np.full((3, rows.shape[1]), np.nan)
    known = ~np.isnan(rows).all(axis=0)
    quartiles[:, known] = np.nanquantile(rows[:, known], [0.25, 0.5, 0.75], axis=0)
    axes.fill_between(across, quartiles[0], quartiles[2], color=colour, alpha=0.11, linewidth=0)
    axes.plot(across, quartiles[1], style, color=colour, linewidth=1.6, label=label)
    return quartiles


def legend_below(figure: Figure, columns: int) -> None:
    """One legend for the whole figure: every label of any of its axes, once."""
    entries: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    handles, labels = list(entries.values()), list(entries)
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False, fontsize=8)
