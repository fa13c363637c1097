"""Figures of the redeployment study: how much dearer other searches are, how long they take, and one of the cases."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from launcher.studies import drawing
from launcher.studies.map_drawing import draw_walls
from launcher.studies.redeployment_runs import SEARCHES, Answer, Question, Task
from planning import PlacementGraph, Redeployment, redeploy

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

COLOURS = dict(zip(SEARCHES, ("#d1261f", "#0b6b74", "#f0a11c", "#7b8794"), strict=True))
AGENT, BASE = "#c227b9", drawing.INK


def dearer(answers: Sequence[Answer], search: str) -> Floats:
    """By what share of the optimum each answer of a search costs more: (n,) float, inf where it found none."""
    return np.array([max(one.costs[search] / one.costs["exact"] - 1.0, 0.0) for one in answers])


def draw_costs(found: Mapping[str, Mapping[int, Sequence[Answer]]], file: Path) -> None:
    """How many redeployments cost how much more than the optimum; found by map and k."""
    figure, panels = drawing.new_panels(
        len(found), f"What {' and '.join(SEARCHES[1::2])} search cost beside the optimum"
    )
    for axes, (name, by_nodes) in zip(panels, found.items(), strict=True):
        for nodes, answers in by_nodes.items():
            shade = drawing.shade_of(nodes, list(by_nodes))
            for search, style in (("one-edge", "-"), ("fixed", ":")):
                more = 100.0 * np.sort(dearer(answers, search))
                shares = 100.0 * (1.0 - np.arange(len(more)) / len(more))
                label = f"k = {nodes}, {search}"
                axes.step(np.minimum(more, 1e4), shares, style, where="pre", color=shade, linewidth=1.3, label=label)
        axes.set(xscale="log", yscale="log", xlim=(0.1, 1e3), ylim=(0.4, 115))
        axes.set_yticks([1, 10, 100], ["1 %", "10 %", "100 %"])
        axes.set_xticks([0.1, 1, 10, 100, 1000], ["0.1", "1", "10", "100", "none"])
        drawing.dress_series(axes, name, "dearer by at least [%]", "share of redeployments")
    drawing.legend_below(figure, len(next(iter(found.values()))))
    drawing.write_figure(figure, file)


def draw_times(found: Mapping[str, Mapping[int, Sequence[Answer]]], file: Path) -> None:
    """Median processor times; found by map and k."""
    figure, panels = drawing.new_panels(len(found), "Processor time of a redeployment, median")
    for axes, (name, by_nodes) in zip(panels, found.items(), strict=True):
        for search in SEARCHES:
            times = [1e3 * np.median([one.seconds[search] for one in answers]) for answers in by_nodes.values()]
            axes.semilogy(list(by_nodes), times, "o-", color=COLOURS[search], markersize=4, label=search)
        axes.set_xticks(list(by_nodes))
        axes.set_ylim(0.04, 60)
        drawing.dress_series(axes, name, "nodes k", "milliseconds")
    drawing.legend_below(figure, len(SEARCHES))
    drawing.write_figure(figure, file)


def draw_example(ground: PlacementGraph, task: Task, question: Question, file: Path) -> None:
    """A redeployment by one-edge search beside the optimum: the deployment before, the ways, the deployment after."""
    figure = drawing.new_figure(12.5, 5.6)
    title = f"{ground.environment.name}: one redeployment of base B, agent A and {question.nodes - 2} robots"
    figure.suptitle(f"{title}, μ = {question.mu_m:g} m", fontsize=11, x=0.01, ha="left")
    for number, (name, found) in enumerate(
        (
            (
                "one edge away from the tree before",
                redeploy(task.move, ground.weights, question.mu_m, "one-edge", task.tree),
            ),
            ("exact: over all trees", redeploy(task.move, ground.weights, question.mu_m)),
        )
    ):
        axes = figure.add_subplot(1, 2, number + 1)
        draw_walls(axes, ground.environment)
        driven = _draw_redeployment(axes, ground, task, found)
        low, high = ground.environment.outer.min(axis=0), ground.environment.outer.max(axis=0)
        drawing.dress_plane(
            axes, f"{name}: cost {found.cost:.1f} m, of which the robots drive {driven:.1f} m", low - 1.0, high + 1.0
        )
    drawing.legend_below(figure, 5)
    drawing.write_figure(figure, file)


def _draw_redeployment(axes: Axes, ground: PlacementGraph, task: Task, found: Redeployment) -> float:
    """Returns the metres that the robots drive."""
    before, after = ground.positions[task.before], ground.positions[found.cells]
    for number, (i, j) in enumerate(task.tree):
        axes.plot(*before[[i, j]].T, color="#b3bcc4", linewidth=3.5, label="_" if number else "links before", zorder=2)
    for number, (i, j) in enumerate(found.tree if found.tree is not None else ()):
        axes.plot(
            *after[[i, j]].T, color=COLOURS["exact"], linewidth=1.3, label="_" if number else "links after", zorder=4
        )
    driven = 0.0
    for i in range(len(before)):
        way = ground.geodesics.path(before[i], after[i])
        driven += float(np.hypot(*np.diff(way, axis=0).T).sum()) if i > 1 else 0.0
        colour = AGENT if i == 1 else COLOURS["one-edge"]
        axes.plot(
            *way.T,
            "--",
            color=colour,
            linewidth=1.1,
            zorder=5,
            label=("_", "the agent's way", "robots' ways")[min(i, 2)] if i < 3 else "_",
        )
        if i:
            axes.plot(*before[i], "o", markerfacecolor="white", markeredgecolor=colour, markersize=6, zorder=6)
            axes.plot(*after[i], "o", color=colour, markersize=7, markeredgecolor="white", zorder=7)
    for name, place, colour in (("B", after[0], BASE), ("A", after[1], AGENT)):
        axes.plot(*place, "s" if name == "B" else "o", color=colour, markersize=9, zorder=8)
        axes.annotate(name, place, ha="center", va="center", color="white", fontsize=7, fontweight="bold", zorder=9)
    return driven
