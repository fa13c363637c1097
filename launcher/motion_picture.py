"""Pictures of schedules: who goes where along which path, and below the map, on a line of time, in which order.

matplotlib is imported when a picture is drawn, not before, and draws without a display.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from launcher.move_order import Move, cover_path, leave_out_stops, order_moves
from launcher.picture import (
    AGENT,
    BASE,
    IDLE,
    SIGHT,
    WALL,
    draw_floor,
    draw_markers,
    spread_markers,
    write_picture,
)
from planning.environment import Environment
from planning.motion_plan import Schedule
from protocol.messages import Point

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

PATHS = ("#16856b", "#7b3fa0", "#1478c8", "#a8541c", "#c2187f", "#5d7a12", "#0f8f9f", "#8a2c3d", "#55606e", "#3a3fb0")
"""Colours of the members that move, one after the other."""

_LINKS_BEFORE = "#c4a27a"
_LEAST_PT = 13.0
"""Length of a piece of path from which on its stages are written beside it."""
_HEAD_PT = 16.0
"""Of path that the head at its end points along."""
_ROW_IN = 0.24


def draw_motion(
    environment: Environment,
    polygons: Sequence[Floats] | None,
    schedule: Schedule,
    markers: Mapping[str, str],
    links: Sequence[tuple[Point, Point]],
    file: Path,
    title: str,
    *,
    links_before: Sequence[tuple[Point, Point]] = (),
) -> None:
    """Draw the paths of a schedule, its stages, and their order.

    Args:
        environment: metres.
        polygons: cells, each (m, 2) float, metres; None draws none.
        schedule: who goes where.
        markers: what is written on each member: "B" is the base station, "A" and "A1" are agents, numbers robots.
        links: the two ends of each line of sight when all have arrived.
        file: written as PNG, PDF or SVG, by its suffix.
        title: one line above the picture.
        links_before: lines of sight before anybody moves.

    A bar across a path is where its member stops and waits; numbers are those of the stages in which it moves.

    Raises:
        BadPicture: the file has another suffix or cannot be written.
    """
    from matplotlib.collections import LineCollection

    moves = order_moves(schedule)
    moving = list(dict.fromkeys(sorted(move.member for move in moves)))
    robots = [member for member in moving if not markers[schedule.members[member]].startswith("A")]
    colours = dict.fromkeys(moving, AGENT) | {member: PATHS[place % len(PATHS)] for place, member in enumerate(robots)}
    figure, axes = draw_floor(environment, polygons, file, title)
    for ends, colour, style, width, label in (
        (links_before, _LINKS_BEFORE, (0, (1.5, 1.5)), 1.4, "lines of sight before"),
        (links, SIGHT, "-", 2.0, "lines of sight after"),
    ):
        if ends:
            axes.add_collection(
                LineCollection(list(ends), colors=colour, linewidths=width, linestyles=[style], zorder=4)
            )
            axes.plot([], [], color=colour, linewidth=width, linestyle=style, label=label)
    for member in moving:
        _draw_path(axes, schedule, member, [move for move in moves if move.member == member], colours[member])
    _draw_members(axes, schedule, markers, colours)
    height_in = figure.get_figheight()
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.45 / height_in), ncols=6, frameon=False, fontsize=8)
    if moves:
        chart_in = _ROW_IN * len(moving)
        chart = figure.add_axes((0.06, -(chart_in + 1.05) / height_in, 0.92, chart_in / height_in))
        _draw_order(chart, schedule, moves, colours)
    write_picture(figure, file)


def _draw_path(axes: Axes, schedule: Schedule, member: int, moves: Sequence[Move], colour: str) -> None:
    """A line with a head at its end, bars where the member waits, and stages where there is room."""
    from matplotlib.patches import Circle

    path = leave_out_stops(schedule.paths[member].waypoints)
    covered = cover_path(path)

    def find_place(metres: float) -> tuple[float, float]:
        return float(np.interp(metres, covered, path[:, 0])), float(np.interp(metres, covered, path[:, 1]))

    axes.plot(*path.T, color=colour, linewidth=1.8, solid_joinstyle="round", zorder=4.4)
    for end, alpha in ((path[0], 0.12), (path[-1], 0.3)):
        radius = float(schedule.radii_m[member])
        axes.add_patch(Circle((end[0], end[1]), radius, facecolor=colour, alpha=alpha, linewidth=0, zorder=4.3))
    points_per_m = float(np.ptp(axes.transData.transform([(0, 0), (1, 0)])[:, 0])) * 72.0 / axes.figure.dpi
    if covered[-1] * points_per_m > _HEAD_PT:  # else markers hide it
        axes.annotate(
            "", find_place(covered[-1]), find_place(covered[-1] - _HEAD_PT / points_per_m), zorder=4.5,
            arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 1.8, "shrinkA": 0, "shrinkB": 6},
        )  # fmt: skip
    for move in moves:
        middle, end = move.from_m + 0.5 * move.length_m, move.from_m + move.length_m
        if move is not moves[-1]:
            before = max(int(np.searchsorted(covered, end)) - 1, 0)
            dx, dy = path[before + 1] - path[before]
            turn = math.degrees(math.atan2(dy, dx))
            axes.plot(
                *find_place(end), marker=(2, 2, turn), color=colour, markersize=9, markeredgewidth=1.4, zorder=4.5
            )
        if move.length_m * points_per_m >= _LEAST_PT:
            before = int(np.searchsorted(covered, middle)) - 1
            aside = 6.5 if member % 2 else -6.5  # so that those who go one way are told apart
            dx, dy = aside * (path[before + 1] - path[before]) / (covered[before + 1] - covered[before])
            axes.annotate(
                _name_stages(move), find_place(middle), (-dy, dx), textcoords="offset points", color=colour,
                fontsize=7.5, weight="bold", ha="center", va="center_baseline", zorder=4.9,
                bbox={"boxstyle": "round,pad=0.08", "facecolor": "white", "edgecolor": "none", "alpha": 0.75},
            )  # fmt: skip


def _name_stages(move: Move) -> str:
    first, last = move.stages
    return str(first) if first == last else f"{first}–{last}"


def _draw_members(axes: Axes, schedule: Schedule, markers: Mapping[str, str], colours: Mapping[int, str]) -> None:
    """Where each member ends, and small rings where those that move start."""
    from matplotlib.collections import LineCollection

    ends = np.array([path.waypoints[-1] for path in schedule.paths])
    shown = spread_markers(axes, ends)
    axes.add_collection(LineCollection(list(np.stack([ends, shown], axis=1)), colors=WALL, linewidths=0.6, zorder=4.8))
    named = set()
    for member, (name, place) in enumerate(zip(schedule.members, shown, strict=True)):
        text = markers[name]
        kind, marker, colour = "robot that stays", "o", IDLE
        if text == "B":
            kind, marker, colour = "base", "s", BASE
        elif text.startswith("A"):
            kind, marker, colour = "agent", "D", AGENT
        elif member in colours:
            kind, colour = "robot, where it is to go", colours[member]
        if member in colours:
            axes.plot(
                *schedule.paths[member].waypoints[0], "o", markerfacecolor="white", markeredgecolor=colours[member],
                markersize=6, markeredgewidth=1.6, zorder=4.7, label="_" if "start" in named else "start",
            )  # fmt: skip
            named.add("start")
        draw_markers(axes, place[None], marker, colour, "_" if kind in named else kind, [text])
        named.add(kind)


def _draw_order(axes: Axes, schedule: Schedule, moves: Sequence[Move], colours: Mapping[int, str]) -> None:
    """One row for each member that moves; bars from when it sets off to when it is there, each with its stages."""
    row = {member: place for place, member in enumerate(colours)}
    span = schedule.end_s - schedule.start_s
    for move in moves:
        axes.barh(
            row[move.member], move.end_s - move.begin_s, left=move.begin_s, height=0.72, color=colours[move.member],
            edgecolor="white", linewidth=0.8,
        )  # fmt: skip
        if move.end_s - move.begin_s > 0.009 * span * len(_name_stages(move)):
            axes.annotate(
                _name_stages(move), (0.5 * (move.begin_s + move.end_s), row[move.member]), color="white", fontsize=7,
                weight="bold", ha="center", va="center_baseline",
            )  # fmt: skip
    axes.set_xlim(schedule.start_s, schedule.end_s + 0.01 * span)
    axes.set_ylim(len(row) - 0.45, -0.55)
    axes.set_yticks(range(len(row)), [schedule.members[member] for member in row])
    axes.tick_params(labelsize=8, length=0)
    axes.tick_params(axis="x", length=3)
    axes.set_xlabel(
        "seconds, if nobody is late; numbers are stages: nobody begins one before all have ended the last but one",
        fontsize=8,
    )
    axes.grid(axis="x", alpha=0.3, linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("left", "right", "top"):
        axes.spines[side].set_visible(False)
