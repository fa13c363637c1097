"""Figure 10 of the thesis: what an ellipsoid in (x, y, x² + y²) means on the map, beside the CSV it is drawn from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from estimation.feasible_set import FeasibleSet
from estimation.range_filter import RangeFilter
from launcher.studies import drawing


def draw_embedding(folder: Path) -> Path:
    """Figure 10: what an ellipsoid in (x, y, x² + y²) means on the map: an annulus, two regions, or one."""
    target = np.array([1.6, 2.0])
    anchors = [(-1.5, 0.0), (1.0, 0.0), (0.0, -1.0), (3.0, -0.5), (3.2, 1.5), (0.2, 3.0)]
    stages = ((1, "one range: an annulus"), (2, "two places: two regions"), (6, "six places: one region"))
    figure = drawing.new_figure(11, 7.4)
    figure.suptitle(
        "Fig. 10: the ellipsoid in (x, y, x² + y²), and what it means on the map, after ranges from 1, 2 and 6 places",
        fontsize=11, x=0.01, ha="left",
    )  # fmt: skip
    rows: list[tuple[int, int, int, float, float]] = []
    filter_, told = RangeFilter(), 0
    for column, (count, title) in enumerate(stages):
        for anchor in anchors[told:count]:
            filter_.measure(anchor, float(np.hypot(*(target - anchor))), 0.2)
        told = count
        feasible = filter_.feasible_set()
        axes: Any = figure.add_subplot(2, 3, column + 1, projection="3d")
        _draw_paraboloid(axes, filter_, feasible)
        plane = figure.add_subplot(2, 3, column + 4)
        for anchor in anchors[:count]:
            r = float(np.hypot(*(target - anchor)))
            drawing.draw_annulus(plane, anchor, r - 0.2, r + 0.2, drawing.ANNULI[0])
            plane.plot(*anchor, "o", color=drawing.ROBOTS[0], markersize=5, zorder=7)
        drawing.draw_sets(plane, feasible, ())
        drawing.draw_target(plane, target)
        drawing.dress_plane(plane, f"{title}, {feasible.area_m2:.2f} m²", (-6.2, -5), (4.6, 5.2))
        for number, region in enumerate(feasible.regions):
            for ring_number, ring in enumerate((region.outer, *region.holes)):
                rows.extend((count, number, ring_number, float(x), float(y)) for x, y in ring)
    drawing.legend_below(figure, 4)
    drawing.write_table(folder / "fig10-embedding.csv", ("ranges", "region", "ring", "x_m", "y_m"), rows)
    return drawing.write_figure(figure, folder / "fig10-embedding.png")


def _draw_paraboloid(axes: Any, filter_: RangeFilter, feasible: FeasibleSet) -> None:
    """The paraboloid, the ellipsoid, and where they meet, in a window that holds the feasible set."""
    radius, angle = np.meshgrid(np.linspace(0, 5, 26), np.linspace(0, 2 * np.pi, 61))
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    axes.plot_surface(x, y, x**2 + y**2, color="#c9d1da", alpha=0.35, linewidth=0, antialiased=True)
    axes.plot_wireframe(x, y, x**2 + y**2, color="#9aa5b1", linewidth=0.25, rstride=6, cstride=5)
    ellipsoid = filter_.ellipsoid()
    around, up = np.meshgrid(np.linspace(0, 2 * np.pi, 49), np.linspace(0, np.pi, 25))
    ball = np.stack([np.cos(around) * np.sin(up), np.sin(around) * np.sin(up), np.cos(up)])
    surface = ellipsoid.center[:, None, None] + np.tensordot(ellipsoid.factor, ball, 1)
    axes.plot_wireframe(*surface, color=drawing.PROJECTION, linewidth=0.35, alpha=0.75, rstride=2, cstride=3)
    for region in feasible.regions:
        for ring in (region.outer, *region.holes):
            closed = np.vstack([ring, ring[:1]])
            axes.plot(*closed.T, (closed**2).sum(axis=1), color=drawing.FEASIBLE, linewidth=1.8)
    axes.set(xlim=(-6, 5), ylim=(-5, 5), zlim=(0, 28))
    axes.set_box_aspect((1.1, 1, 0.85))
    axes.view_init(24, -62)
    axes.tick_params(labelsize=6, pad=-3)
    axes.set_xlabel("x [m]", fontsize=7, labelpad=-7)
    axes.set_ylabel("y [m]", fontsize=7, labelpad=-7)
    axes.set_zlabel("x² + y² [m²]", fontsize=7, labelpad=-6)
