"""Pictures of coordination diagrams: how far two members of a schedule are on their paths, and where they must not be.

Each axis is metres of one path. Drawn are the pairs of places at which the two discs overlap (thesis §4.3.1), the boxes
around those that planners keep out of, the pairs of places that do not see each other, and the schedule: its nominal
course, and the boxes of two stages that follow each other, in which the two are whoever is late.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from launcher.move_order import cover_path, leave_out_stops
from launcher.picture import WALL, check_format, write_picture
from planning.coordination import collision_boxes, collision_sections
from planning.environment import Environment
from planning.motion_plan import Schedule
from planning.visible_interval import visible_intervals

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

_COLLISION = "#b3262e"
_HIDDEN = "#d5dae0"
_PROGRESS = "#16856b"
_ROWS = 240
"""Values of the second path at which sight is found along the first."""
_SECTIONS = 65
"""Of each collision region."""
_LONG_SIDE_IN = 6.0
_SHORT_SIDE_IN = 2.6


def draw_coordination(
    environment: Environment, schedule: Schedule, pair: tuple[int, int], labels: tuple[str, str], file: Path, title: str
) -> None:
    """Draw the coordination diagram of two members that both move.

    Args:
        environment: the map as drawn, metres.
        schedule: of the whole team.
        pair: rows of the two members; the first one goes across, the second up.
        labels: what the two are called.
        file: written as PNG, PDF or SVG, by its suffix.
        title: one line above the picture.

    Raises:
        BadPicture: the file has another suffix or cannot be written.

    Complexity: sight is found exactly along 240 lines of the first path's length; the rest is O(m n + stages) for paths
    of m and n waypoints.
    """
    check_format(file)
    from matplotlib.collections import PatchCollection, PolyCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    i, j = pair
    path_i, path_j = (leave_out_stops(schedule.paths[member].waypoints) for member in pair)
    across, up = (schedule.paths[member].length_m for member in pair)
    scale = _LONG_SIDE_IN / max(across, up)
    size = np.maximum([across * scale, up * scale], _SHORT_SIDE_IN)
    figure = Figure(figsize=(float(size[0]), float(size[1])))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, across), ylim=(0, up))

    hidden = list(hidden_strips(environment, path_i, path_j))
    axes.add_collection(PolyCollection(hidden, facecolors=_HIDDEN, edgecolors="none", antialiaseds=False, zorder=1))
    if schedule.stages is not None:
        region = progress_region(schedule, pair)
        axes.fill(*region.T, facecolor=_PROGRESS, alpha=0.25, zorder=2)
        axes.plot(*region.T, color=_PROGRESS, linewidth=1.0, zorder=2.2)
    separation = float(schedule.radii_m[i] + schedule.radii_m[j])
    near = False
    if min(schedule.radii_m[i], schedule.radii_m[j]) > 0.0:
        outlines = list(collision_outlines(path_i, path_j, separation))
        axes.add_collection(PolyCollection(outlines, facecolors=_COLLISION, alpha=0.75, edgecolors="none", zorder=3))
        bounds, _ = collision_boxes(path_i, path_j, separation)
        near = len(bounds) > 0
        axes.add_collection(
            PatchCollection(
                [Rectangle((x0, y0), x1 - x0, y1 - y0) for x0, x1, y0, y1 in bounds], facecolor="none",
                edgecolor=_COLLISION, linewidth=0.9, linestyle="--", zorder=4,
            )
        )  # fmt: skip
    _draw_course(axes, schedule, pair)

    axes.set_title(title, fontsize=10, loc="left", pad=8, parse_math=False)
    for label, who, length in ((axes.set_xlabel, labels[0], across), (axes.set_ylabel, labels[1], up)):
        label(f"{who}: metres of its {length:.1f} m", fontsize=8)
    axes.tick_params(labelsize=8, length=3)
    _explain(axes, float(size[1]), hidden=bool(hidden), stages=schedule.stages is not None, near=near)
    write_picture(figure, file)


def hidden_strips(environment: Environment, path_i: Floats, path_j: Floats) -> Iterator[Floats]:
    """Where the two do not see each other: rectangles (4, 2) of metres of path, each as high as one of the rows."""
    covered_i, covered_j = cover_path(path_i), cover_path(path_j)
    borders = np.linspace(0.0, covered_j[-1], _ROWS + 1)
    for low, high in pairwise(borders):
        place = [np.interp(0.5 * (low + high), covered_j, path_j[:, axis]) for axis in (0, 1)]
        for a in range(len(path_i) - 1):
            seen = visible_intervals(environment, path_i[a : a + 2], [place, place])
            ends = np.concatenate([[0.0], seen.ravel(), [1.0]]).reshape(-1, 2)
            for first, last in covered_i[a] + ends[ends[:, 1] > ends[:, 0]] * (covered_i[a + 1] - covered_i[a]):
                yield np.array([(first, low), (last, low), (last, high), (first, high)])


def collision_outlines(path_i: Floats, path_j: Floats, separation_m: float) -> Iterator[Floats]:
    """The regions in which the two discs overlap: polygons (n, 2) of metres of path, one for each pair of segments."""
    covered_i, covered_j = cover_path(path_i), cover_path(path_j)
    boxes, segments = collision_boxes(path_i, path_j, separation_m)
    for box, (a, b) in zip(boxes, segments, strict=True):
        length_i, length_j = covered_i[a + 1] - covered_i[a], covered_j[b + 1] - covered_j[b]
        least, greatest = np.clip((box[2:] - covered_j[b]) / length_j, 0.0, 1.0)
        shares = np.linspace(least, greatest, _SECTIONS)
        found = collision_sections(path_i[a : a + 2], path_j[b : b + 2], separation_m, shares)
        known = np.isfinite(found[:, 0])
        rows, ends = covered_j[b] + shares[known] * length_j, covered_i[a] + found[known] * length_i
        left, right = (np.column_stack([ends[:, side], rows]) for side in (0, 1))
        yield np.concatenate([left, right[::-1]])


def progress_region(schedule: Schedule, pair: tuple[int, int]) -> Floats:
    """Where the two may be under the rule of progress: a closed ring (n, 2) of metres of path.

    It holds a box for each two stages that follow each other. Neither member goes back, so these boxes lie between two
    flights of steps: while the one is in stage n the other is not beyond stage n + 1, nor short of stage n − 1. Of a
    member that is not scheduled nothing is known.
    """
    ahead, behind = (_borders(schedule, member) for member in pair)
    if {schedule.members[member] for member in pair} & schedule.unscheduled:
        return np.array([(0, 0), (0, 1), (1, 1), (1, 0), (0, 0)]) * [ahead[-1], behind[-1]]
    stages = len(ahead) - 1
    flights = []
    for first, second in ((ahead, behind), (behind, ahead)):
        # Of the first member as slow, and the second as fast, as can be.
        steps = [(first[0], second[0])]
        for stage in range(stages):
            limit = second[min(stage + 2, stages)]
            steps += [(first[stage], limit), (first[stage + 1], limit)]
        flights.append(steps)
    upper, lower = flights
    return np.array([*upper, *((x, y) for y, x in reversed(lower))])


def _borders(schedule: Schedule, member: int) -> list[float]:
    """Metres of path of a member at which each stage begins, and the last one ends."""
    assert schedule.stages is not None
    covered = cover_path(schedule.paths[member].waypoints)
    return [float(metres) for metres in covered[schedule.stages[member]]]


def _draw_course(axes: Axes, schedule: Schedule, pair: tuple[int, int]) -> None:
    """The nominal course, and lines where a stage of either ends."""
    paths = [schedule.paths[member] for member in pair]
    times = np.unique(np.concatenate([path.times_s for path in paths]))
    course = np.stack([np.interp(times, path.times_s, cover_path(path.waypoints)) for path in paths], axis=1)
    axes.plot(*course.T, color=WALL, linewidth=1.8, zorder=5, clip_on=False)
    for place, fill in ((course[0], "white"), (course[-1], WALL)):
        axes.plot(*place, "o", color=WALL, markerfacecolor=fill, markersize=7, zorder=6, clip_on=False)
    if schedule.stages is not None:
        for member, draw in zip(pair, (axes.axvline, axes.axhline), strict=True):
            for metres in {*_borders(schedule, member)[1:-1]}:
                draw(metres, color=_PROGRESS, linewidth=0.4, linestyle=(0, (2, 4)), zorder=2.5)


def _explain(axes: Axes, height_in: float, *, hidden: bool, stages: bool, near: bool) -> None:
    """The legend."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries: list[Artist] = [Line2D([], [], color=WALL, linewidth=1.8, label="schedule, if nobody is late")]
    if stages:
        entries.append(Patch(facecolor=_PROGRESS, alpha=0.25, label="where the two may be, whoever is late"))
    if near:
        entries.append(Patch(facecolor=_COLLISION, alpha=0.75, label="discs overlap"))
        entries.append(Patch(facecolor="none", edgecolor=_COLLISION, linestyle="--", label="boxes around that"))
    if hidden:
        entries.append(Patch(facecolor=_HIDDEN, label="no line of sight between the two"))
    axes.legend(
        handles=entries, loc="upper center", bbox_to_anchor=(0.5, -0.55 / height_in), ncols=2,
        frameon=False, fontsize=8,
    )  # fmt: skip
