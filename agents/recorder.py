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
``world/motion/...``    the team's motion: ``ways`` with the ends of their ``stages``, ``released`` ones again
``world/estimate/...``  ``<peer>/outline`` of where the agent may be; the base station's ``area`` and ``center``
``world/peers/...``     ``<peer>/body`` (dot, true disc, velocity), ``/trail``, ``/path``, ``/target``
``tree``                the deployment tree as a graph, in columns by hops from the base station
``connected``           agent visible, chain connected, team connected: 0 or 1 each
``lambda2``             algebraic connectivity of the team's visibility graph
``planning_ms``         how long each planning job took
``cost``                of each decision, metres, and the least of chains such as its reason names
``certified``           what the motion keeps joined: nothing, the chain, the team, the team and the agent (0 to 3)
``in_hand``             of each robot, how many stages are released and not finished
``in_sight_s``          how long the last relay will see the agent wherever it goes
``estimate_area/...``   of each peer's estimate, square metres
``estimate_age/...``    of the newest range in it, seconds
``mode/<peer>``         what the peer's body does
``log/<peer>``          log lines, and the leader's decisions with their reasons
======================  ==============================================================================

Times are on the timeline ``run_time``: seconds of mission time, rounded to nanoseconds. Nothing here waits for a
network or a viewer: the only sink is a file, written by a thread of rerun's own. What comes with every control period
is gathered for half a second of wall time and sent as columns, which in virtual time makes it five times cheaper.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import msgspec
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from agents.map_picture import draw_map
from agents.mission import Mission
from agents.motion_level import certified_level
from agents.recorder_columns import (
    Columns,
    body_columns,
    journal_columns,
    line_columns,
    links_columns,
    places_columns,
    scalar_columns,
)
from agents.recorder_estimate import draw_estimate, style_estimates
from agents.recorder_file import RecordingFile
from agents.recorder_layout import lay_out_views
from agents.recorder_style import CELL, ROLE_COLOURS, UNKNOWN, WALL, faded, style
from agents.records import (
    Advance,
    AnyRecord,
    Connectivity,
    Decision,
    Estimate,
    LogLine,
    Mishap,
    Ordered,
    Planned,
    TopologyChange,
    Track,
    TreeAnswer,
    in_words,
)
from agents.tree_layout import lay_out
from protocol.messages import Motion

if TYPE_CHECKING:
    from planning.environment import Environment

JOURNAL = "journal"

REFEREE = "referee"
"""Who judges afterwards what no peer can know; not a peer."""

_LEVELS = {
    "debug": rr.TextLogLevel.DEBUG,
    "info": rr.TextLogLevel.INFO,
    "warning": rr.TextLogLevel.WARN,
    "error": rr.TextLogLevel.ERROR,
}


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
        self._file = RecordingFile(file, team=team, recording_id=recording_id, peer=peer)
        self._bounds: tuple[float, float, float, float] | None = None
        self._roles: dict[str, str] = {}
        self._robots: list[str] = []
        self._announces = True
        self._motion: Motion | None = None
        self._last: dict[str, Track] = {}

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
            self._static("world/map/cells", rr.LineStrips2D(outlines, colors=CELL, radii=-0.5, draw_order=-10.0))
        if placements is not None:
            self._static("world/map/placements", rr.Points2D(placements, colors=CELL, radii=-1.5, draw_order=-8.0))
        rings = [np.vstack([ring, ring[:1]]) for ring in (environment.outer, *environment.holes)]
        self._static("world/map/walls", rr.LineStrips2D(rings, colors=WALL, radii=-1.0, draw_order=-5.0))

    def log_blueprint(self, mission: Mission) -> None:
        """Say how the recording opens, once; called by one process of the team, after :meth:`log_map`."""
        self.know(mission)
        style(self._file, mission)
        if not mission.announces:
            style_estimates(self._file, mission)
        self._file.open_with(lay_out_views(mission, self._bounds))

    def know(self, mission: Mission) -> None:
        """Learn who is who: any peer may come to lead, and then draws the tree of all."""
        self._roles = {entry.name: entry.role for entry in mission.roster}
        self._robots = [entry.name for entry in mission.robots]
        self._announces = mission.announces

    def record(self, time_s: float, peer: str, record: AnyRecord) -> None:
        """Write a record and draw it."""
        if not self._file.open:
            return
        now_ns = round(time_s * 1e9)
        self._file.set_time(now_ns)
        self._gather(now_ns, f"{JOURNAL}/{peer}", journal_columns, msgspec.json.encode(record).decode())
        match record:
            case Track():
                self._draw_track(now_ns, peer, record)
            case Decision():
                self._draw_decision(now_ns, peer, record)
            case Connectivity() if self._announces or peer == REFEREE:
                self._draw_connectivity(now_ns, record)
            case Ordered():
                self._draw_motion(now_ns, record.motion)
            case Advance():
                self._draw_advance(now_ns, record)
            case Planned():
                self._gather(now_ns, "planning_ms", scalar_columns, [1e3 * record.planning_s])
                self._gather(now_ns, "in_sight_s", scalar_columns, [record.in_sight_s])
            case Mishap():
                self._log(f"log/{peer}", rr.TextLog(record.text, level=rr.TextLogLevel.WARN))
            case Estimate():
                first = self._roles.get(peer) == "base_station"
                draw_estimate(self._file, now_ns, peer, record, base_station=first)
            case TopologyChange():
                what = "is in force" if record.committed else "is given up"
                said = f"{peer}: tree {record.number[0]}.{record.number[1]} {what}: {record.reason}"
                level = rr.TextLogLevel.INFO if record.committed else rr.TextLogLevel.WARN
                self._log(f"log/{peer}", rr.TextLog(said, level=level))
            case LogLine():
                self._log(f"log/{peer}", rr.TextLog(f"{peer}: {record.text}", level=_LEVELS[record.level]))
        self._file.flush(now=isinstance(record, Decision | LogLine | Mishap | TopologyChange | TreeAnswer))

    def close(self) -> None:
        """Finish the file. Safe to call twice, at exit and from a signal's handler on the main thread."""
        self._file.close()

    def _log(self, entity: str, *values: Any) -> None:
        self._file.log(entity, *values)

    def _static(self, entity: str, *values: Any) -> None:
        self._file.log(entity, *values, static=True)

    def _gather(self, now_ns: int, entity: str, columns: Columns, value: Any) -> None:
        self._file.gather(now_ns, entity, columns, value)

    def _draw_track(self, now_ns: int, peer: str, track: Track) -> None:
        before = self._last.get(peer)
        self._last[peer] = track
        home = f"world/peers/{peer}"
        colour = ROLE_COLOURS[track.role]
        if before is None:
            self._static(f"{home}/trail", rr.LineStrips2D.from_fields(colors=faded(colour, 0x70), radii=-1.0))
            self._static(f"{home}/path", rr.LineStrips2D.from_fields(colors=colour, radii=-0.5))
            self._static(f"{home}/target", rr.Ellipses2D.from_fields(colors=faded(colour, 0xA0), line_radii=-0.5))
            self._static(
                f"{home}/body",
                rr.Points2D.from_fields(colors=colour, radii=-4.0, labels=peer, show_labels=True, draw_order=30.0),
                rr.Ellipses2D.from_fields(colors=colour, half_sizes=[(track.radius_m,) * 2], line_radii=-0.75),
                rr.Arrows2D.from_fields(colors=colour, radii=-1.0),
            )
        self._gather(now_ns, f"{home}/body", body_columns, track)
        if before is None or before.mode != track.mode:
            self._log(f"mode/{peer}", rr.StateChange(state=track.mode))
        if before is not None and before.position != track.position:
            self._gather(now_ns, f"{home}/trail", line_columns, (before.position, track.position))
        if before is None or before.path != track.path:
            self._gather(now_ns, f"{home}/path", line_columns, track.path)
        if before is None or before.target != track.target:
            centres = [] if track.target is None else [track.target]
            sizes = [(track.radius_m, track.radius_m)] * len(centres)
            self._log(f"{home}/target", rr.Ellipses2D.from_fields(centers=centres, half_sizes=sizes))

    def _draw_decision(self, now_ns: int, peer: str, decision: Decision) -> None:
        deployment = decision.deployment
        robots = [placement.robot for placement in deployment.placements]
        root = next((name for name, role in self._roles.items() if role == "base_station"), peer)
        places = lay_out(deployment.edges, root, robots)
        colours = [ROLE_COLOURS.get(self._roles.get(name, ""), UNKNOWN) for name in places]
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
            self._gather(now_ns, "cost", scalar_columns, [deployment.total_cost_m, deployment.lower_bound_m])

    def _draw_motion(self, now_ns: int, motion: Motion) -> None:
        self._motion = motion
        ways = [way.waypoints for way in motion.ways if way.scheduled and len(way.waypoints) > 1]
        ends = [way.waypoints[mark] for way in motion.ways if way.scheduled for mark in sorted({*way.stages[1:]})]
        self._gather(now_ns, "world/motion/ways", links_columns, ways)
        self._gather(now_ns, "world/motion/stages", places_columns, ends if ways else [])
        agent = next((name for name, role in self._roles.items() if role == "tracked_agent"), "")
        self._gather(now_ns, "certified", scalar_columns, [float(certified_level(motion, agent))])

    def _draw_advance(self, now_ns: int, advance: Advance) -> None:
        in_hand = [
            float(advance.released + 1 - advance.finished.get(name, advance.released + 1)) for name in self._robots
        ]
        if in_hand:
            self._gather(now_ns, "in_hand", scalar_columns, in_hand)
        if self._motion is not None:
            end = min(max(advance.released + 1 - self._motion.first_stage, 0), len(self._motion.ways[0].stages) - 1)
            ways = [
                way.waypoints[way.stages[begin] : way.stages[end] + 1]
                for way in self._motion.ways
                if way.scheduled
                for begin in [min(max(advance.finished.get(way.member, 0) - self._motion.first_stage, 0), end)]
            ]
            self._gather(now_ns, "world/motion/released", links_columns, [way for way in ways if len(way) > 1])

    def _draw_connectivity(self, now_ns: int, connectivity: Connectivity) -> None:
        in_sight = {frozenset(link) for link in connectivity.links}
        in_tree = {link: frozenset(link) in in_sight for link in connectivity.tree_links}
        self._gather(now_ns, "world/sight", links_columns, connectivity.links)
        self._gather(now_ns, "world/chain/in_sight", links_columns, [link for link, seen in in_tree.items() if seen])
        self._gather(now_ns, "world/chain/broken", links_columns, [link for link, seen in in_tree.items() if not seen])
        shown = (connectivity.agent_visible, connectivity.chain_connected, connectivity.team_connected)
        self._gather(now_ns, "connected", scalar_columns, [float(value) for value in shown])
        self._gather(now_ns, "lambda2", scalar_columns, [connectivity.lambda2])
