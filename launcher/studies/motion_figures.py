"""Figures of the motion study: how often the chain is kept, how long that takes, and one of the motions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from launcher.motion_picture import draw_motion
from launcher.studies import drawing
from launcher.studies.motion_runs import AT_ONCE, HYBRID, METHODS, OURS, Ground, Journey, MotionAnswer
from planning.motion_plan import Schedule

COLOURS = {AT_ONCE: "#7b8794", HYBRID: "#f0a11c", OURS: "#0b6b74"}
LABELS = {AT_ONCE: "geodesics at once", HYBRID: "the thesis' hybrid, fixed links", OURS: "ours"}

Found = Mapping[str, Mapping[int, Sequence[MotionAnswer]]]
"""By map and k."""


def share_kept(answers: Sequence[MotionAnswer], method: str) -> float:
    """Of the redeployments: with discs apart and the network whole throughout."""
    return float(np.mean([one.outcomes[method].kept for one in answers]))


def draw_kept(found: Found, file: Path) -> None:
    """The share of redeployments that keep the chain throughout."""
    figure, panels = drawing.new_panels(
        len(found), "Redeployments that keep the whole network and all discs apart, throughout"
    )
    for axes, (name, by_nodes) in zip(panels, found.items(), strict=True):
        for method in METHODS:
            shares = [100.0 * share_kept(answers, method) for answers in by_nodes.values()]
            axes.plot(list(by_nodes), shares, "o-", color=COLOURS[method], markersize=4, label=LABELS[method])
        axes.set_xticks(list(by_nodes))
        axes.set_ylim(-3, 103)
        drawing.dress_series(axes, name, "nodes k", "%")
    drawing.legend_below(figure, len(METHODS))
    drawing.write_figure(figure, file)


def draw_times(found: Found, file: Path) -> None:
    """What planning takes by k, and how much longer than their geodesics the motions are; of ours."""
    everything: dict[int, list[MotionAnswer]] = {}
    for by_nodes in found.values():
        for nodes, answers in by_nodes.items():
            everything.setdefault(nodes, []).extend(answers)
    figure = drawing.new_figure(12.0, 3.8)
    times, longer, slower = (figure.add_subplot(1, 3, number) for number in (1, 2, 3))
    for nodes, answers in everything.items():
        shade = drawing.shade_of(nodes, list(everything))
        kept = [one for one in answers if one.outcomes[OURS].kept]
        for axes, values in (
            (times, [1e3 * one.outcomes[OURS].planning_s for one in answers]),
            (longer, [100.0 * (one.outcomes[OURS].length_m / one.geodesic_m - 1.0) for one in kept]),
            (slower, [100.0 * (one.outcomes[OURS].duration_s / one.fastest_s - 1.0) for one in kept]),
        ):
            shares = 100.0 * (1.0 - np.arange(len(values)) / max(len(values), 1))
            axes.step(np.sort(np.maximum(values, 0.0)), shares, where="pre", color=shade, label=f"k = {nodes}")
    times.set_xscale("log")
    for axes in (longer, slower):
        axes.set_xscale("symlog", linthresh=1.0)
    drawing.dress_series(times, "planning takes at least", "milliseconds", "share of redeployments [%]")
    drawing.dress_series(longer, "ways longer than geodesics by at least", "%", "share of those that are kept [%]")
    drawing.dress_series(slower, "slower than all at once by at least", "%", "share of those that are kept [%]")
    drawing.legend_below(figure, len(everything))
    drawing.write_figure(figure, file)


def draw_example(ground: Ground, journey: Journey, schedule: Schedule, file: Path, title: str) -> None:
    """One motion: paths, stages and their order."""
    before, after = (
        [(_place(ends[u]), _place(ends[v])) for u, v in links]
        for ends, links in zip((journey.starts, journey.goals), journey.trees, strict=True)
    )
    markers = {"base": "B", "agent": "A"}
    markers |= {name: name.removeprefix("robot ") for name in journey.members if name not in markers}
    draw_motion(ground.graph.environment, None, schedule, markers, after, file, title, links_before=before)


def _place(point: Sequence[float]) -> tuple[float, float]:
    return float(point[0]), float(point[1])
