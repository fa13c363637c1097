"""A map as the ground of a figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from launcher.studies import drawing
from planning import Environment

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_walls(axes: Axes, environment: Environment) -> None:
    """The walls of a map, free space white."""
    axes.set_facecolor("#eceff1")
    axes.fill(*environment.outer.T, facecolor="white", edgecolor=drawing.INK, linewidth=0.8, zorder=0)
    for hole in environment.holes:
        axes.fill(*hole.T, facecolor="#eceff1", edgecolor=drawing.INK, linewidth=0.8, zorder=1)
