"""The recording: one rerun file per process and incarnation, merged by ``launcher.review`` when the run is over.

Every record goes into the file twice. Its JSON stands on ``journal/<peer>``, exactly, for the review and for other
programs. And it is drawn, for the eye:

======================  ==============================================================================
entity                  what is there
======================  ==============================================================================
``world``               mirrors the map frame (y up) into the viewer's (y down); holds all that follows
``world/map/...``       ``free`` (picture), ``cells``, ``placements``, ``walls``; static
``world/sight``         all lines of sight between peers
``world/chain/...``     links of the current deployment tree: ``in_sight``, ``broken``
``world/peers/...``     ``<peer>/body`` (dot, true disc, velocity), ``/trail``, ``/path``, ``/target``
``tree``                the deployment tree as a graph, in columns by hops from the base station
``connected``           agent visible, chain connected, team connected: 0 or 1 each
``lambda2``             algebraic connectivity of the team's visibility graph
``planning_ms``         how long each planning job took
``cost``                of each decision, metres, and the least of chains such as its reason names
``mode/<peer>``         what the peer's body does
``log/<peer>``          log lines, and the leader's decisions with their reasons
======================  ==============================================================================

Times are on the timeline ``run_time``: seconds of mission time, rounded to nanoseconds. Nothing here waits for a
network or a viewer: the only sink is a file, written by a thread of rerun's own. What comes with every control period
is gathered for half a second of wall time and sent as columns, which in virtual time makes it five times cheaper.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import msgspec
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from agents.map_picture import OBSTACLE, draw_map
from agents.mission import Mission
from agents.records import AnyRecord, Connectivity, Decision, LogLine, Planned, Track, in_words
from agents.tree_layout import lay_out
from protocol.messages import Point

if TYPE_CHECKING:
    from planning.environment import Environment

APPLICATION = "sightline"
TIMELINE = "run_time"
JOURNAL = "journal"

FLUSH_PERIOD_S = 0.5
"""Wall time. A killed process loses the tracks of about this long; decisions and log lines are not held back."""

TRAIL_S = 15.0
"""Length of the trails that the layout shows."""

_BASE_STATION, _ROBOT, _AGENT, _UNKNOWN = 0xF5B83DFF, 0x4DB8FFFF, 0xFF5D7EFF, 0xC0C4CCFF
_ROLE_COLOURS = {"base_station": _BASE_STATION, "robot": _ROBOT, "tracked_agent": _AGENT}
_WALL, _CELL, _SIGHT = 0xB9C2D0FF, 0x8A94A638, 0xC8D2E070
_IN_SIGHT, _OUT_OF_SIGHT = 0x5BE08AFF, 0xFF4D4DFF
_MODES = {
    "waiting": 0x7A8290FF,
    "moving": 0x4DB8FFFF,
    "yielding": 0xB48CFFFF,
    "arrived": 0x5BE08AFF,
    "holding": 0xF5B83DFF,
}
_SERIES = {"connected": ["agent visible", "chain", "team"], "cost": ["cost", "lower bound"]}
_LEVELS = {
    "debug": rr.TextLogLevel.DEBUG,
    "info": rr.TextLogLevel.INFO,
    "warning": rr.TextLogLevel.WARN,
    "error": rr.TextLogLevel.ERROR,
}

_Columns: TypeAlias = Callable[[list[Any]], Iterable[Any]]
"""Turns the values of several rows into rerun's columns."""


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
        peer: whose process this is; the recording's properties name it with its file.

    Raises:
        OSError: the file cannot be created.
    """

    def __init__(self, file: Path, *, team: str, recording_id: str, peer: str) -> None:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(b"")  # says plainly what is wrong with the place, which rerun does not
        self._stream = rr.RecordingStream(
            APPLICATION,
            recording_id=recording_id,
            batcher_config=rr.ChunkBatcherConfig(flush_tick=FLUSH_PERIOD_S),
        )
        rr.set_log_time_enabled(False, recording=self._stream)
        self._stream.set_sinks(rr.FileSink(str(file)))
        self._stream.send_recording_name(team)
        self._stream.send_property("recorded_by", rr.AnyValues(**{peer: file.name}))
        self._open = True
        self._bounds: tuple[float, float, float, float] | None = None
        self._roles: dict[str, str] = {}
        self._last: dict[str, Track] = {}
        self._rows: dict[tuple[str, _Columns], list[tuple[int, Any]]] = {}
        self._flushed_at = time.monotonic()

    def log_map(
        self,
        environment: Environment,
        cell_polygons: Sequence[NDArray[np.float64]] = (),
        placements: NDArray[np.float64] | None = None,
    ) -> None:
        """Draw the map, once; called by one process of the team.

        Args:
            environment: the map.
            cell_polygons: (m, 2) float rings, metres, map frame.
            placements: (n, 2) float, metres, map frame: where relays can be sent.
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
        if placements is not None:
            self._static("world/map/placements", rr.Points2D(placements, colors=_CELL, radii=-1.5, draw_order=-8.0))
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
        for entity, colours, widths in (
            ("connected", [_AGENT, _IN_SIGHT, _ROBOT], [6.0, 3.5, 1.5]),  # later ones are drawn over earlier ones
            ("lambda2", [_ROBOT], [1.5]),
            ("planning_ms", [_BASE_STATION], [1.5]),
            ("cost", [_BASE_STATION, _IN_SIGHT], [3.0, 1.5]),
        ):
            self._static(
                entity,
                rr.SeriesLines(
                    colors=np.array(colours, dtype=np.uint32),
                    widths=widths,
                    names=_SERIES.get(entity, entity),
                    interpolation_mode=rr.components.InterpolationMode.StepAfter,
                ),
            )
        for entity, colour, width, order in (
            ("world/sight", _SIGHT, 0.5, 5.0),
            ("world/chain/in_sight", _IN_SIGHT, 2.0, 10.0),
            ("world/chain/broken", _OUT_OF_SIGHT, 2.0, 10.0),
        ):
            self._static(entity, rr.LineStrips2D.from_fields(colors=colour, radii=-width, draw_order=order))
        self._stream.send_blueprint(_layout(mission, self._bounds), make_active=True, make_default=True)

    def record(self, time_s: float, peer: str, record: AnyRecord) -> None:
        """Write a record and draw it."""
        if not self._open:
            return
        now_ns = round(time_s * 1e9)
        self._stream.set_time(TIMELINE, duration=np.timedelta64(now_ns, "ns"))
        self._gather(now_ns, f"{JOURNAL}/{peer}", _journal_columns, msgspec.json.encode(record).decode())
        match record:
            case Track():
                self._draw_track(now_ns, peer, record)
            case Decision():
                self._draw_decision(now_ns, peer, record)
            case Connectivity():
                self._draw_connectivity(now_ns, record)
            case Planned():
                self._gather(now_ns, "planning_ms", _scalar_columns, [1e3 * record.planning_s])
            case LogLine():
                self._log(f"log/{peer}", rr.TextLog(f"{peer}: {record.text}", level=_LEVELS[record.level]))
        if isinstance(record, Decision | LogLine) or time.monotonic() - self._flushed_at >= FLUSH_PERIOD_S:
            self._flush()

    def close(self) -> None:
        """Finish the file. Safe to call twice, at exit and from a signal's handler on the main thread."""
        if self._open:
            self._open = False
            self._flush()
            self._stream.disconnect()

    def _log(self, entity: str, *values: Any) -> None:
        self._stream.log(entity, *values)

    def _static(self, entity: str, *values: Any) -> None:
        self._stream.log(entity, *values, static=True)

    def _gather(self, now_ns: int, entity: str, columns: _Columns, value: Any) -> None:
        self._rows.setdefault((entity, columns), []).append((now_ns, value))

    def _flush(self) -> None:
        for (entity, columns), rows in self._rows.items():
            times = np.array([now_ns for now_ns, _ in rows], dtype="timedelta64[ns]")
            values = [value for _, value in rows]
            self._stream.send_columns(entity, [rr.TimeColumn(TIMELINE, duration=times)], columns(values))
        self._rows.clear()
        self._flushed_at = time.monotonic()

    def _draw_track(self, now_ns: int, peer: str, track: Track) -> None:
        before = self._last.get(peer)
        self._last[peer] = track
        home = f"world/peers/{peer}"
        colour = _ROLE_COLOURS[track.role]
        if before is None:
            self._static(f"{home}/trail", rr.LineStrips2D.from_fields(colors=_faded(colour, 0x70), radii=-1.0))
            self._static(f"{home}/path", rr.LineStrips2D.from_fields(colors=colour, radii=-0.5))
            self._static(f"{home}/target", rr.Ellipses2D.from_fields(colors=_faded(colour, 0xA0), line_radii=-0.5))
            self._static(
                f"{home}/body",
                rr.Points2D.from_fields(colors=colour, radii=-4.0, labels=peer, show_labels=True, draw_order=30.0),
                rr.Ellipses2D.from_fields(colors=colour, half_sizes=[(track.radius_m,) * 2], line_radii=-0.75),
                rr.Arrows2D.from_fields(colors=colour, radii=-1.0),
            )
        self._gather(now_ns, f"{home}/body", _body_columns, track)
        if before is None or before.mode != track.mode:
            self._log(f"mode/{peer}", rr.StateChange(state=track.mode))
        if before is not None and before.position != track.position:
            self._gather(now_ns, f"{home}/trail", _line_columns, (before.position, track.position))
        if before is None or before.path != track.path:
            self._gather(now_ns, f"{home}/path", _line_columns, track.path)
        if before is None or before.target != track.target:
            centres = [] if track.target is None else [track.target]
            sizes = [(track.radius_m, track.radius_m)] * len(centres)
            self._log(f"{home}/target", rr.Ellipses2D.from_fields(centers=centres, half_sizes=sizes))

    def _draw_decision(self, now_ns: int, peer: str, decision: Decision) -> None:
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
        change = "new tree" if decision.topology_changed else "same tree"
        what = f"decision {deployment.decision} ({change}, {1e3 * decision.planning_s:.0f} ms)"
        worth = in_words(deployment)
        said = f"{peer}: {what}: {deployment.reason}" + (f"; {worth}" if worth else "")
        self._log(f"log/{peer}", rr.TextLog(said, level=rr.TextLogLevel.INFO))
        if deployment.total_cost_m is not None and deployment.lower_bound_m is not None:
            self._gather(now_ns, "cost", _scalar_columns, [deployment.total_cost_m, deployment.lower_bound_m])

    def _draw_connectivity(self, now_ns: int, connectivity: Connectivity) -> None:
        in_sight = {frozenset(link) for link in connectivity.links}
        in_tree = {link: frozenset(link) in in_sight for link in connectivity.tree_links}
        self._gather(now_ns, "world/sight", _links_columns, connectivity.links)
        self._gather(now_ns, "world/chain/in_sight", _links_columns, [link for link, seen in in_tree.items() if seen])
        self._gather(now_ns, "world/chain/broken", _links_columns, [link for link, seen in in_tree.items() if not seen])
        shown = (connectivity.agent_visible, connectivity.chain_connected, connectivity.team_connected)
        self._gather(now_ns, "connected", _scalar_columns, [float(value) for value in shown])
        self._gather(now_ns, "lambda2", _scalar_columns, [connectivity.lambda2])


def _journal_columns(texts: list[str]) -> Iterable[Any]:
    return rr.TextDocument.columns(text=texts)  # type: ignore[no-any-return]


def _body_columns(tracks: list[Track]) -> Iterable[Any]:
    positions = [track.position for track in tracks]
    velocities = [track.velocity for track in tracks]
    return [
        *rr.Points2D.columns(positions=positions),
        *rr.Ellipses2D.columns(centers=positions),
        *rr.Arrows2D.columns(origins=positions, vectors=velocities),
    ]


def _line_columns(lines: list[tuple[Point, ...]]) -> Iterable[Any]:
    """One line per row; a line without points takes the last one away."""
    return _links_columns([[line] if len(line) > 1 else [] for line in lines])


def _links_columns(rows: list[Sequence[tuple[Point, ...]]]) -> Iterable[Any]:
    """Any number of lines per row."""
    strips = [line for row in rows for line in row]
    return rr.LineStrips2D.columns(strips=strips).partition([len(row) for row in rows])  # type: ignore[no-any-return]


def _scalar_columns(rows: list[list[float]]) -> Iterable[Any]:
    """As many values in each row."""
    values = np.array(rows)
    return rr.Scalars.columns(scalars=values.ravel()).partition([values.shape[1]] * len(rows))  # type: ignore[no-any-return]


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
        for entity, name in (
            ("lambda2", "λ2"),
            ("planning_ms", "Planning [ms]"),
            ("cost", "Cost, bound [m]"),
        )
    ]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(plan, log, row_shares=[7, 2]),
            rrb.Vertical(
                rrb.GraphView(origin="/tree", name="Deployment tree"),
                rrb.StateTimelineView(origin="/mode", name="Modes"),
                connected,
                rrb.Horizontal(*curves),
                row_shares=[3, 5, 2, 2.5],
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
