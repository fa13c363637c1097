"""How a recording opens: which views there are, and what each shows."""

from __future__ import annotations

from typing import Final

import rerun.blueprint as rrb

from agents.map_picture import OBSTACLE
from agents.mission import Mission

TIMELINE: Final = "run_time"

TRAIL_S: Final = 15.0
"""Length of the trails that the layout shows."""

CURVES: Final = (
    ("lambda2", "λ2"),
    ("planning_ms", "Planning [ms]"),
    ("cost", "Cost, bound [m]"),
    ("certified", "Certified: chain 1, team 2, agent 3"),
    ("in_hand", "Stages released and not finished"),
    ("in_sight_s", "Agent surely in sight for [s]"),
)
"""Entity and title."""

AREA: Final = "estimate_area"
AGE: Final = "estimate_age"

ESTIMATE_CURVES: Final = (
    (AREA, "Estimate of the agent [m²]"),
    (AGE, "Its newest range [s]"),
)
"""Of an agent that does not announce."""


def lay_out_views(mission: Mission, bounds: tuple[float, float, float, float] | None) -> rrb.Blueprint:
    """Map and log on the left; tree, modes and curves on the right."""
    recent = rrb.VisibleTimeRange(
        TIMELINE,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-TRAIL_S),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    plan = rrb.Spatial2DView(
        origin="/",
        contents="/world/**",
        name="Map",
        background=OBSTACLE,
        visual_bounds=None if bounds is None else _seen_from_above(bounds),
        overrides={f"world/peers/{entry.name}/trail": rrb.VisibleTimeRanges(recent) for entry in mission.roster},
    )
    log = rrb.TextLogView(origin="/log", name="Log", columns=rrb.TextLogColumns(text_log_columns=["loglevel", "body"]))
    connected = rrb.TimeSeriesView(
        origin="/connected",
        name="Agent visible (red), chain connected (green), team connected (blue): 1 or 0",
        axis_y=rrb.ScalarAxis(range=(-0.1, 1.1), zoom_lock=True),
        plot_legend=rrb.PlotLegend(visible=False),
    )
    curves = [
        rrb.TimeSeriesView(origin=f"/{entity}", name=name, plot_legend=rrb.PlotLegend(visible=False))
        for entity, name in (CURVES if mission.announces else (*CURVES, *ESTIMATE_CURVES))
    ]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(plan, log, row_shares=[7, 2]),
            rrb.Vertical(
                rrb.GraphView(origin="/tree", name="Deployment tree"),
                rrb.StateTimelineView(origin="/mode", name="Modes"),
                connected,
                rrb.Grid(*curves, grid_columns=3),
                row_shares=[3, 4, 1.5, 4],
            ),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
    )


def _seen_from_above(bounds: tuple[float, float, float, float]) -> rrb.VisualBounds2D:
    """What the view shows at first: the bounds with a margin, y negated since the view points y down."""
    x_min, y_min, x_max, y_max = bounds
    margin = 0.03 * max(x_max - x_min, y_max - y_min)
    return rrb.VisualBounds2D(x_range=(x_min - margin, x_max + margin), y_range=(-y_max - margin, -y_min + margin))
