"""Pictures of maps, their cells, and deployments on them, drawn to scale.

matplotlib is imported when a picture is drawn, not before, and draws without a display.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from planning.environment import Environment
from protocol.messages import Point

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]

_FORMATS = (".pdf", ".png", ".svg")
_LONG_SIDE_IN = 9.0
_SHORT_SIDE_IN = 3.0
_LONGEST_SIDE_IN = 18.0
_DOTS_PER_IN = 160

_SOLID = "#b9c0c9"
WALL = "#1d2329"
_FLOOR = "#ffffff"
_CELL = "#8fa9c4"
SIGHT = "#e07b00"
BASE = "#1f4e8c"
RELAY = "#16856b"
AGENT = "#b3262e"
IDLE = "#7a828c"


_APART_PT = 11.0
"""Between the centres of two markers."""
_PUSHES = 100


class BadPicture(ValueError):
    """A picture that cannot be written; the text says file, reason and remedy in one sentence."""


def draw_map(environment: Environment, polygons: Sequence[Floats] | None, file: Path, title: str) -> None:
    """Draw an environment and, faintly, its cells.

    Args:
        environment: metres.
        polygons: cells, each (m, 2) float, metres; None draws none.
        file: written as PNG, PDF or SVG, by its suffix.
        title: one line above the picture.

    Raises:
        BadPicture: the file has another suffix or cannot be written.
    """
    figure, _ = draw_floor(environment, polygons, file, title)
    write_picture(figure, file)


def draw_plan(
    environment: Environment,
    polygons: Sequence[Floats] | None,
    base: Point,
    agents: Sequence[Point],
    relays: Sequence[Point],
    links: Sequence[tuple[Point, Point]],
    file: Path,
    title: str,
) -> None:
    """Draw a deployment: who stands where, and the lines of sight that join them.

    Args:
        environment: metres.
        polygons: cells, each (m, 2) float, metres; None draws none.
        base: where the base station stands.
        agents: where each tracked agent is.
        relays: where each relay is to stand, numbered from 1 in this order.
        links: the two ends of each line of sight of the chain or tree.
        file: written as PNG, PDF or SVG, by its suffix.
        title: one line above the picture.

    Peers in one place are drawn beside each other, each joined to its place by a thin line.

    Raises:
        BadPicture: the file has another suffix or cannot be written.
    """
    from matplotlib.collections import LineCollection

    figure, axes = draw_floor(environment, polygons, file, title)
    axes.add_collection(LineCollection(list(links), colors=SIGHT, linewidths=2, zorder=4))
    axes.plot([], [], color=SIGHT, linewidth=2, label="line of sight")
    kinds = [
        ("s", BASE, "base", [base], ["B"]),
        ("o", RELAY, "relay", relays, [str(number) for number in range(1, len(relays) + 1)]),
        ("D", AGENT, "agent", agents, ["A"] if len(agents) == 1 else [f"A{i}" for i in range(1, len(agents) + 1)]),
    ]
    places = np.array([place for *_, these, _ in kinds for place in these], dtype=float)
    shown = spread_markers(axes, places)
    axes.add_collection(
        LineCollection(list(np.stack([places, shown], axis=1)), colors=WALL, linewidths=0.6, zorder=4.8)
    )
    begin = 0
    for marker, colour, kind, these, labels in kinds:
        draw_markers(axes, shown[begin : begin + len(these)], marker, colour, kind, labels)
        begin += len(these)
    axes.legend(
        loc="upper center", bbox_to_anchor=(0.5, -0.5 / figure.get_figheight()), ncols=6, frameon=False, fontsize=8
    )
    write_picture(figure, file)


def check_format(file: Path) -> None:
    """Raise where a file's suffix is none of those that pictures are written as.

    Raises:
        BadPicture: one sentence.
    """
    if file.suffix.lower() not in _FORMATS:
        raise BadPicture(f"{file}: pictures are written as {', '.join(_FORMATS)}: give a name that ends so")


def draw_floor(
    environment: Environment, polygons: Sequence[Floats] | None, file: Path, title: str
) -> tuple[Figure, Axes]:
    """A new figure with the map to scale; whatever is not free is solid."""
    check_format(file)
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import PathPatch, Rectangle
    from matplotlib.path import Path as Outline
    from matplotlib.ticker import MaxNLocator, MultipleLocator

    left, low, right, high = environment.bounds
    margin = 0.02 * max(right - left, high - low)
    width, height = right - left + 2 * margin, high - low + 2 * margin
    wanted = max(_LONG_SIDE_IN / max(width, height), _SHORT_SIDE_IN / min(width, height))
    scale = min(wanted, _LONGEST_SIDE_IN / max(width, height))
    figure = Figure(figsize=(width * scale, height * scale))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(left - margin, right + margin), ylim=(low - margin, high + margin), aspect="equal")
    axes.add_patch(Rectangle((left - margin, low - margin), width, height, facecolor=_SOLID, zorder=0))
    rings = [np.vstack([ring, ring[:1]]) for ring in (environment.outer, *environment.holes)]
    walls = Outline.make_compound_path(*(Outline(ring, closed=True) for ring in rings))
    axes.add_patch(PathPatch(walls, facecolor=_FLOOR, edgecolor="none", zorder=1))
    if polygons is not None:
        axes.add_collection(
            PolyCollection(list(polygons), facecolors="none", edgecolors=_CELL, linewidths=0.35, zorder=2)
        )
    axes.add_patch(PathPatch(walls, facecolor="none", edgecolor=WALL, linewidth=1.2, joinstyle="miter", zorder=3))
    axes.set_title(title, fontsize=11, loc="left", pad=8, parse_math=False)
    axes.set_xlabel("x [m]", fontsize=8)
    axes.set_ylabel("y [m]", fontsize=8)
    axes.tick_params(labelsize=8, length=3)
    first, second, *_ = MaxNLocator(9, steps=[1, 2, 5, 10]).tick_values(0, max(width, height))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(float(second - first)))
    for spine in axes.spines.values():
        spine.set_visible(False)
    return figure, axes


def spread_markers(axes: Axes, places: Floats) -> Floats:
    """Where to draw markers (n, 2) so that none covers another: those too near push each other apart."""
    scale = 72 / (_APART_PT * axes.figure.dpi)  # the unit is what two markers need
    turns = 2.4 * np.arange(len(places))
    # Markers in one place leave it in directions of their own.
    shown = scale * axes.transData.transform(places) + 1e-3 * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    pushed = np.zeros(len(places), dtype=np.bool_)
    for _ in range(_PUSHES):
        apart = shown[:, None] - shown
        distances = np.linalg.norm(apart, axis=2)
        np.fill_diagonal(distances, np.inf)
        lacks = np.maximum(1.0 - distances, 0.0)
        if lacks.max() < 1e-2:
            break
        near = np.maximum(np.count_nonzero(lacks, axis=1), 1)
        shown += ((lacks / distances)[:, :, None] * apart).sum(axis=1) / (2 * near[:, None])
        pushed |= lacks.any(axis=1)
    return np.where(pushed[:, None], axes.transData.inverted().transform(shown / scale), places)


def draw_markers(axes: Axes, places: Floats, marker: str, colour: str, kind: str, labels: Sequence[str]) -> None:
    """Markers (n, 2) of one kind of peer, with a label each, and their entry in the legend."""
    if not len(places):
        return
    axes.plot(
        *places.T,
        marker,
        color=colour,
        markersize=10,
        markeredgecolor="white",
        markeredgewidth=1.2,
        label=kind,
        zorder=5,
    )
    for (x, y), label in zip(places, labels, strict=True):
        axes.annotate(
            label, (x, y), color="white", fontsize=7, weight="bold", ha="center", va="center_baseline", zorder=6
        )


def write_picture(figure: Figure, file: Path) -> None:
    """Write a figure with all that is drawn around its axes.

    Raises:
        BadPicture: the file cannot be written.
    """
    try:
        figure.savefig(file, dpi=_DOTS_PER_IN, bbox_inches="tight", facecolor="white")
    except OSError as fault:
        raise BadPicture(
            f"{file}: cannot be written ({fault.strerror}): name a file in a folder you may write to"
        ) from None
