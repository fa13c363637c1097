"""The recording: one rerun file per process and incarnation, merged by ``launcher.review`` when the run is over.

Every record goes into the file twice. Its JSON stands on ``journal/<peer>``, exactly, for the review and for other
programs. And it is drawn, for the eye:

======================  ==============================================================================
entity                  what is there
======================  ==============================================================================
``world``               mirrors the map frame (y up) into the viewer's (y down); holds all that follows
``world/map/...``       ``free`` (picture), ``cells``, ``walls``; static
``world/sight``         all lines of sight between peers
``world/chain``         links of the current deployment tree, green in sight and red out of it
``world/peers/...``     ``<peer>/body`` (true disc and velocity), ``/trail``, ``/path``, ``/target``
``tree``                the deployment tree as a graph, in columns by hops from the base station
``connected/...``       ``agent_visible``, ``chain``, ``team``: 0 or 1
``lambda2``             algebraic connectivity of the team's visibility graph
``planning_ms``         how long each decision took
``mode/<peer>``         what the peer's body does
``log/<peer>``          log lines, and the leader's decisions with their reasons
======================  ==============================================================================

Times are on the timeline ``run_time``: seconds of mission time. Nothing here waits for a network or a viewer: the
only sink is a file, written by a thread of rerun's own every half second.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import msgspec
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from agents.map_picture import draw_map
from agents.mission import Mission
from agents.records import AnyRecord, Connectivity, Decision, LogLine, Track
from agents.tree_layout import lay_out

if TYPE_CHECKING:
    from planning.environment import Environment

APPLICATION = "sightline"
TIMELINE = "run_time"
JOURNAL = "journal"

FLUSH_PERIOD_S = 0.5
"""What a process that is killed may lose."""

TRAIL_S = 20.0
"""Length of the trails that the layout shows."""

_BASE_STATION, _ROBOT, _AGENT, _UNKNOWN = 0xF5B83DFF, 0x4DB8FFFF, 0xFF5D7EFF, 0xC0C4CCFF
_ROLE_COLOURS = {"base_station": _BASE_STATION, "robot": _ROBOT, "tracked_agent": _AGENT}
_WALL, _CELL, _SIGHT = 0xB9C2D0FF, 0x8A94A638, 0xC8D2E040
_IN_SIGHT, _OUT_OF_SIGHT = 0x5BE08AFF, 0xFF4D4DFF
_MODES = {"waiting": 0x7A8290FF, "moving": 0x4DB8FFFF, "arrived": 0x5BE08AFF, "holding": 0xF5B83DFF}
_LEVELS = {
    "debug": rr.TextLogLevel.DEBUG,
    "info": rr.TextLogLevel.INFO,
    "warning": rr.TextLogLevel.WARN,
    "error": rr.TextLogLevel.ERROR,
}
_BACKGROUND = (17, 19, 23)


class Recorder(Protocol):
    """Where a shell puts its role's records."""

    def record(self, time_s: float, peer: str, record: AnyRecord) -> None:
        """Keep a record of a peer at a mission time. Never raises, never blocks for long."""

    def close(self) -> None:
        """Write what is not yet written. Later records are dropped. May be called twice."""


class NullRecorder:
    """Keeps nothing."""

    def record(self, time_s: float, peer: str, record: AnyRecord) -> None:
        """Drop the record."""

    def close(self) -> None:
        """Do nothing."""


class RerunRecorder:
    """Writes an ``.rrd`` file.

    Args:
        file: written anew, so each incarnation of a process needs a name of its own. Its folder is created.
        team: shown as the recording's name.
        recording_id: the run's; files of the same id merge into one recording.
        peer: whose process this is; it appears in the file's log lines only.

    Raises:
        OSError: the file cannot be created.
    """

    def __init__(self, file: Path, *, team: str, recording_id: str, peer: str) -> None:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
        self._peer = peer
        self._stream = rr.RecordingStream(
            APPLICATION,
            recording_id=recording_id,
            batcher_config=rr.ChunkBatcherConfig(flush_tick=FLUSH_PERIOD_S),
        )
        self._stream.set_sinks(rr.FileSink(str(file)))
        self._stream.send_recording_name(team)
        self._open = True
        self._bounds: tuple[float, float, float, float] | None = None
        self._roles: dict[str, str] = {}
        self._last: dict[str, Track] = {}

    def log_map(self, environment: Environment, cell_polygons: Sequence[NDArray[np.float64]] = ()) -> None:
        """Draw the map, once; called by one process of the team.

        Args:
            environment: the map.
            cell_polygons: (m, 2) float rings, metres, map frame.
        """
        self._bounds = environment.bounds
        picture = draw_map(environment, cell_polygons)
        self._static("world", rr.Transform3D(scale=(1.0, -1.0, 1.0)))
        self._static(
            "world/map/free",
            rr.Transform3D(
                translation=(*picture.origin, 0.0), scale=(picture.metres_per_pixel, picture.metres_per_pixel, 1.0)
            ),
            rr.EncodedImage(contents=picture.png, media_type="image/png", draw_order=-20.0),
        )
        if len(cell_polygons):
            outlines = [np.vstack([ring, ring[:1]]) for ring in cell_polygons]
            self._static("world/map/cells", rr.LineStrips2D(outlines, colors=_CELL, radii=-0.5, draw_order=-10.0))
        rings = [np.vstack([ring, ring[:1]]) for ring in (environment.outer, *environment.holes)]
        self._static("world/map/walls", rr.LineStrips2D(rings, colors=_WALL, radii=-1.0, draw_order=-5.0))

    def log_blueprint(self, mission: Mission) -> None:
        """Say how the recording opens, once; called by one process of the team, after :meth:`log_map`."""
        self._roles = {entry.name: entry.role for entry in mission.roster}
        for entry in mission.roster:
            self._static(
                f"mode/{entry.name}",
                rr.StateConfiguration(values=list(_MODES), colors=np.array(list(_MODES.values()), dtype=np.uint32)),
            )
        for name, colour, width in (
            ("connected/chain", _IN_SIGHT, 5.0),
            ("connected/agent_visible", _AGENT, 2.0),
            ("connected/team", _ROBOT, 1.0),
            ("lambda2", _ROBOT, 1.5),
            ("planning_ms", _BASE_STATION, 1.5),
        ):
            self._static(
                name,
                rr.SeriesLines(
                    colors=colour,
                    widths=width,
                    names=name.rpartition("/")[2].replace("_", " "),
                    interpolation_mode=rr.components.InterpolationMode.StepAfter,
                ),
            )
        self._stream.send_blueprint(_layout(mission, self._bounds), make_active=True, make_default=True)

    def record(self, time_s: float, peer: str, record: AnyRecord) -> None:
        """Write a record and draw it."""
        if not self._open:
            return
        self._stream.set_time(TIMELINE, duration=time_s)
        self._log(f"{JOURNAL}/{peer}", rr.TextDocument(msgspec.json.encode(record).decode()))
        match record:
            case Track():
                self._draw_track(peer, record)
            case Decision():
                self._draw_decision(peer, record)
            case Connectivity():
                self._draw_connectivity(record)
            case LogLine():
                self._log(f"log/{peer}", rr.TextLog(record.text, level=_LEVELS[record.level]))

    def close(self) -> None:
        """Finish the file. Safe to call twice, at exit and from a signal's handler on the main thread."""
        if self._open:
            self._open = False
            self._stream.disconnect()

    def _log(self, entity: str, *values: Any) -> None:
        self._stream.log(entity, *values)

    def _static(self, entity: str, *values: Any) -> None:
        self._stream.log(entity, *values, static=True)

    def _draw_track(self, peer: str, track: Track) -> None:
        before = self._last.get(peer)
        self._last[peer] = track
        home = f"world/peers/{peer}"
        colour = _ROLE_COLOURS[track.role]
        if before is None:
            self._static(f"{home}/trail", rr.LineStrips2D.from_fields(colors=_faded(colour, 0x90), radii=-1.0))
            self._static(f"{home}/path", rr.LineStrips2D.from_fields(colors=_faded(colour, 0xB0), radii=-0.75))
            self._static(f"{home}/target", rr.Ellipses2D.from_fields(colors=colour, line_radii=-0.75))
            self._static(
                f"{home}/body",
                rr.Points2D.from_fields(
                    colors=colour, radii=track.radius_m, labels=peer, show_labels=True, draw_order=30.0
                ),
                rr.Arrows2D.from_fields(colors=colour, radii=-1.0),
            )
        self._log(
            f"{home}/body",
            rr.Points2D.from_fields(positions=[track.position]),
            rr.Arrows2D.from_fields(origins=[track.position], vectors=[track.velocity]),
        )
        if before is None or before.mode != track.mode:
            self._log(f"mode/{peer}", rr.StateChange(state=track.mode))
        if before is not None and before.position != track.position:
            self._log(f"{home}/trail", rr.LineStrips2D.from_fields(strips=[[before.position, track.position]]))
        if before is None or before.path != track.path:
            self._log(f"{home}/path", rr.LineStrips2D.from_fields(strips=[track.path] if len(track.path) > 1 else []))
        if before is None or before.target != track.target:
            centres = [] if track.target is None else [track.target]
            sizes = [(track.radius_m, track.radius_m)] * len(centres)
            self._log(f"{home}/target", rr.Ellipses2D.from_fields(centers=centres, half_sizes=sizes))

    def _draw_decision(self, peer: str, decision: Decision) -> None:
        deployment = decision.deployment
        robots = [placement.robot for placement in deployment.placements]
        root = next((name for name, role in self._roles.items() if role == "base_station"), peer)
        places = lay_out(deployment.edges, root, robots)
        colours = [_ROLE_COLOURS.get(self._roles.get(name, ""), _UNKNOWN) for name in places]
        self._log(
            "tree",
            rr.GraphNodes(
                node_ids=list(places),
                positions=list(places.values()),
                labels=list(places),
                colors=np.array(colours, dtype=np.uint32),
                show_labels=True,
            ),
            rr.GraphEdges(edges=list(deployment.edges), graph_type="undirected"),
        )
        self._log("planning_ms", rr.Scalars(1e3 * decision.planning_s))
        change = "new tree" if decision.topology_changed else "same tree"
        text = f"decision {deployment.decision} ({change}, {1e3 * decision.planning_s:.0f} ms): {deployment.reason}"
        self._log(f"log/{peer}", rr.TextLog(text, level=rr.TextLogLevel.INFO))

    def _draw_connectivity(self, connectivity: Connectivity) -> None:
        in_sight = {frozenset(link) for link in connectivity.links}
        tree = connectivity.tree_links
        colours = [_IN_SIGHT if frozenset(link) in in_sight else _OUT_OF_SIGHT for link in tree]
        self._log("world/sight", rr.LineStrips2D(list(connectivity.links), colors=_SIGHT, radii=-0.5, draw_order=5.0))
        self._log(
            "world/chain",
            rr.LineStrips2D(
                list(tree),
                colors=np.array(colours, dtype=np.uint32),
                radii=-2.0,
                draw_order=10.0,
            ),
        )
        self._log("connected/agent_visible", rr.Scalars(float(connectivity.agent_visible)))
        self._log("connected/chain", rr.Scalars(float(connectivity.chain_connected)))
        self._log("connected/team", rr.Scalars(float(connectivity.team_connected)))
        self._log("lambda2", rr.Scalars(connectivity.lambda2))


def _faded(colour: int, alpha: int) -> int:
    """The colour 0xRRGGBBAA with another alpha."""
    return (colour & ~0xFF) | alpha


def _layout(mission: Mission, bounds: tuple[float, float, float, float] | None) -> rrb.Blueprint:
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
        background=_BACKGROUND,
        visual_bounds=None if bounds is None else _seen_from_above(bounds),
        overrides={f"world/peers/{entry.name}/trail": rrb.VisibleTimeRanges(recent) for entry in mission.roster},
    )
    curves = [
        rrb.TimeSeriesView(
            origin="/connected",
            name="Connected (1) or not (0)",
            axis_y=rrb.ScalarAxis(range=(-0.1, 1.1), zoom_lock=True),
            plot_legend=rrb.Corner2D.RightBottom,
        ),
        rrb.TimeSeriesView(origin="/lambda2", name="Algebraic connectivity λ2 of the team"),
        rrb.TimeSeriesView(origin="/planning_ms", name="Planning time [ms]"),
    ]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(plan, rrb.TextLogView(origin="/log", name="Log"), row_shares=[4, 1]),
            rrb.Vertical(
                rrb.GraphView(origin="/tree", name="Deployment tree"),
                rrb.StateTimelineView(origin="/mode", name="Modes"),
                *curves,
                row_shares=[3, 3, 2, 2, 2],
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
