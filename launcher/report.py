"""What a mission was worth: shares of time, counts and distances, measured on the true tracks of all peers.

Simulation and review measure alike: both bring the records of a mission into a :class:`MissionTrace`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import msgspec
import numpy as np
from numpy.typing import NDArray
from rich.console import Group
from rich.table import Table

from agents.base_station import silence_s
from agents.mission import Mission
from agents.records import AnyRecord, Decision, LogLine, Planned, Track
from planning.environment import Environment
from protocol.messages import RoleName

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Trail:
    """Where a peer truly was; empty for one that never recorded."""

    peer: str
    role: RoleName
    radius_m: float
    times_s: Floats
    """(n,) float, mission time, rising."""
    positions: Floats
    """(n, 2) float, metres, map frame."""


@dataclass(frozen=True, eq=False)
class MissionTrace:
    """What the peers of a mission recorded, in order of time."""

    trails: tuple[Trail, ...]
    """One for each peer on the roster, in roster order."""
    decisions: tuple[tuple[float, Decision], ...]
    planning_s: tuple[float, ...]
    """Durations of all planning jobs."""
    logs: tuple[tuple[float, str, LogLine], ...]
    control_hz: float
    duration_s: float

    @classmethod
    def of(
        cls, records: Iterable[tuple[float, str, AnyRecord]], mission: Mission, duration_s: float | None = None
    ) -> MissionTrace:
        """Trace of (mission time, peer, record) in any order; it ends with the last of them if no duration is given."""
        ordered = sorted(records, key=lambda entry: entry[0])
        tracks: dict[str, list[tuple[float, Track]]] = {entry.name: [] for entry in mission.roster}
        for time_s, peer, record in ordered:
            if isinstance(record, Track) and peer in tracks:
                tracks[peer].append((time_s, record))
        trails = tuple(
            Trail(
                entry.name,
                entry.role,
                mission.agent_radius_m if entry.role == "tracked_agent" else mission.robot_radius_m,
                np.array([time_s for time_s, _ in tracks[entry.name]], dtype=np.float64),
                np.array([track.position for _, track in tracks[entry.name]], dtype=np.float64).reshape(-1, 2),
            )
            for entry in mission.roster
        )
        if duration_s is None:
            duration_s = ordered[-1][0] if ordered else 0.0
        return cls(
            trails=trails,
            decisions=tuple((time_s, record) for time_s, _, record in ordered if isinstance(record, Decision)),
            planning_s=tuple(record.planning_s for _, _, record in ordered if isinstance(record, Planned)),
            logs=tuple((time_s, peer, record) for time_s, peer, record in ordered if isinstance(record, LogLine)),
            control_hz=mission.control_hz,
            duration_s=duration_s,
        )


class Shares(msgspec.Struct, frozen=True, kw_only=True):
    """Shares of ``seconds``, between 0 and 1, by true line of sight between true positions."""

    seconds: float
    agent_visible: float
    """Some robot or the base station sees the agent."""
    chain_connected: float
    """The agent is joined to the base station by peers that see each other."""
    team_connected: float
    """Base station, agent and every robot are joined so."""


class PlanningTimes(msgspec.Struct, frozen=True, kw_only=True):
    """Of all planning jobs of the leader."""

    count: int
    median_s: float
    p95_s: float
    max_s: float


class TopologyChange(msgspec.Struct, frozen=True, kw_only=True):
    """A decision whose links differ from those before it."""

    time_s: float
    decision: int
    reason: str
    total_cost_m: float | None = None
    """Of the chain, in metres, as the leader counted it."""
    lower_bound_m: float | None = None
    """No chain would have cost less that sees as much of the agent's way as the reason says."""


class Overlap(msgspec.Struct, frozen=True, kw_only=True):
    """Two discs, of robots or the agent, that lay over each other."""

    peers: tuple[str, str]
    episodes: int
    seconds: float


class Metrics(msgspec.Struct, frozen=True, kw_only=True):
    """The figures of a mission."""

    duration_s: float
    first_deployment_s: float | None
    whole_run: Shares
    since_first_deployment: Shares | None
    robots: int
    robots_used: int
    """Robots that were relays at some time."""
    relays_at_most: int
    """Most relays in one deployment."""
    distance_m: dict[str, float]
    """Driven by each robot."""
    total_distance_m: float
    agent_distance_m: float
    planning: PlanningTimes | None
    decisions: int
    topology_changes: tuple[TopologyChange, ...]
    overlaps: tuple[Overlap, ...]
    warnings: int
    errors: int


def measure(trace: MissionTrace, environment: Environment) -> Metrics:
    """Figures of a mission, weighted with time.

    Time is cut into control periods and each is judged at its middle, where positions are interpolated between samples.
    A peer is there from a sample to the next, unless that takes longer than the silence after which the leader gives a
    peer up, and for one control period after the last; a peer that is not there sees nobody and is seen by nobody.

    Args:
        trace: with one base station and one tracked agent.
        environment: the map as drawn.

    Complexity: O(periods · peers² · (walls + peers)).
    """
    edges_s = np.append(np.arange(0.0, trace.duration_s, 1.0 / trace.control_hz), trace.duration_s)
    middles_s, lengths_s = 0.5 * (edges_s[1:] + edges_s[:-1]), np.diff(edges_s)
    there = np.column_stack([_presence(trail, middles_s, trace.control_hz) for trail in trace.trails])
    places = np.stack([_places(trail, middles_s) for trail in trace.trails], axis=1)
    judged = _judge(trace, _sights(places, there, environment))
    first_s = trace.decisions[0][0] if trace.decisions else None
    deployments = [decision.deployment for _, decision in trace.decisions]
    relays = [[place.robot for place in deployment.placements if not place.spare] for deployment in deployments]
    distance_m = {trail.peer: _distance_m(trail, trace.control_hz) for trail in trace.trails}
    robots = [trail.peer for trail in trace.trails if trail.role == "robot"]
    return Metrics(
        duration_s=trace.duration_s,
        first_deployment_s=first_s,
        whole_run=_shares(judged, lengths_s),
        since_first_deployment=None if first_s is None else _shares(judged, _after(first_s, edges_s)),
        robots=len(robots),
        robots_used=len(set().union(*relays)),
        relays_at_most=max(map(len, relays), default=0),
        distance_m={peer: distance_m[peer] for peer in robots},
        total_distance_m=sum(distance_m[peer] for peer in robots),
        agent_distance_m=sum(distance_m[trail.peer] for trail in trace.trails if trail.role == "tracked_agent"),
        planning=_planning_times(trace.planning_s),
        decisions=len(deployments),
        topology_changes=tuple(
            TopologyChange(
                time_s=time_s,
                decision=decision.deployment.decision,
                reason=decision.deployment.reason,
                total_cost_m=decision.deployment.total_cost_m,
                lower_bound_m=decision.deployment.lower_bound_m,
            )
            for time_s, decision in trace.decisions
            if decision.topology_changed
        ),
        overlaps=_overlaps(trace, places, there, lengths_s),
        warnings=sum(line.level == "warning" for _, _, line in trace.logs),
        errors=sum(line.level == "error" for _, _, line in trace.logs),
    )


def _presence(trail: Trail, times_s: Floats, control_hz: float) -> Bools:
    """At which times the peer was there: (t,) bool."""
    if len(trail.times_s) == 0:
        return np.zeros(len(times_s), dtype=np.bool_)
    before = np.searchsorted(trail.times_s, times_s, side="right") - 1
    following = np.minimum(before + 1, len(trail.times_s) - 1)
    since_s = times_s - trail.times_s[before]
    gap_s = trail.times_s[following] - trail.times_s[before]
    continues = (following > before) & (gap_s <= silence_s(control_hz))
    return np.asarray((before >= 0) & (continues | (since_s <= 1.0 / control_hz)))


def _places(trail: Trail, times_s: Floats) -> Floats:
    """Where the peer was: (t, 2), metres; meaningless where it was not there."""
    if len(trail.times_s) == 0:
        return np.zeros((len(times_s), 2))
    return np.column_stack([np.interp(times_s, trail.times_s, trail.positions[:, axis]) for axis in (0, 1)])


def _sights(places: Floats, there: Bools, environment: Environment) -> Bools:
    """Who saw whom: (t, n, n) bool, True on the diagonal."""
    t, n = there.shape
    sights = np.zeros((t, n, n), dtype=np.bool_)
    sights[:, range(n), range(n)] = True
    for i, j in combinations(range(n), 2):
        both = there[:, i] & there[:, j]
        seen = np.asarray(environment.line_of_sight(places[both, i], places[both, j]))
        sights[both, i, j] = seen
        sights[both, j, i] = seen
    return sights


def _judge(trace: MissionTrace, sights: Bools) -> Bools:
    """Agent visible, chain connected, team connected: (t, 3) bool."""
    roles = [trail.role for trail in trace.trails]
    base, agent = roles.index("base_station"), roles.index("tracked_agent")
    reached = sights[:, base]
    for _ in roles[2:]:
        reached = np.any(sights & reached[:, :, None], axis=1)
    visible = np.delete(sights[:, agent], agent, axis=1).any(axis=1)
    return np.column_stack((visible, reached[:, agent], reached.all(axis=1)))


def _after(start_s: float, edges_s: Floats) -> Floats:
    """How much of each interval lies after a time."""
    return np.diff(np.maximum(edges_s, start_s))


def _shares(judged: Bools, lengths_s: Floats) -> Shares:
    seconds = float(lengths_s.sum())
    visible, chain, team = (judged.T @ lengths_s / seconds).tolist() if seconds > 0.0 else (0.0, 0.0, 0.0)
    return Shares(seconds=seconds, agent_visible=visible, chain_connected=chain, team_connected=team)


def _distance_m(trail: Trail, control_hz: float) -> float:
    steps_m = np.hypot(*np.diff(trail.positions, axis=0).T)
    return float(steps_m[np.diff(trail.times_s) <= silence_s(control_hz)].sum())


def _planning_times(planning_s: Sequence[float]) -> PlanningTimes | None:
    if not planning_s:
        return None
    median_s, p95_s, max_s = np.percentile(planning_s, (50, 95, 100)).tolist()
    return PlanningTimes(count=len(planning_s), median_s=median_s, p95_s=p95_s, max_s=max_s)


def _overlaps(trace: MissionTrace, places: Floats, there: Bools, lengths_s: Floats) -> tuple[Overlap, ...]:
    """Pairs of robots and agent that lay over each other; the base station is taken to be no obstacle."""
    overlaps = []
    bodies = [index for index, trail in enumerate(trace.trails) if trail.role != "base_station"]
    for i, j in combinations(bodies, 2):
        touching_m = trace.trails[i].radius_m + trace.trails[j].radius_m
        over = (np.hypot(*(places[:, i] - places[:, j]).T) < touching_m - 1e-6) & there[:, i] & there[:, j]
        if over.any():
            episodes = int(over[0]) + int(np.count_nonzero(over[1:] & ~over[:-1]))
            peers = (trace.trails[i].peer, trace.trails[j].peer)
            overlaps.append(Overlap(peers=peers, episodes=episodes, seconds=float(lengths_s[over].sum())))
    return tuple(overlaps)


def render(metrics: Metrics) -> Group:
    """The figures as tables for a terminal."""
    shares = Table("share of time", "whole run", "since first deployment", title="Connected by true line of sight")
    since = metrics.since_first_deployment
    for title, key in (
        ("agent visible to some robot or the base", "agent_visible"),
        ("agent-base chain connected", "chain_connected"),
        ("whole team connected", "team_connected"),
    ):
        shares.add_row(title, _percent(metrics.whole_run, key), "-" if since is None else _percent(since, key))
    figures = Table.grid(padding=(0, 2))
    planning = metrics.planning
    overlapping_s = sum(overlap.seconds for overlap in metrics.overlaps)
    for title, value in (
        ("duration", f"{metrics.duration_s:.1f} s"),
        (
            "first deployment",
            "none" if metrics.first_deployment_s is None else f"at {metrics.first_deployment_s:.2f} s of mission time",
        ),
        (
            "robots used as relays",
            f"{metrics.robots_used} of {metrics.robots}, {metrics.relays_at_most} at most at a time",
        ),
        (
            "distance driven",
            f"{metrics.total_distance_m:.1f} m: "
            + ", ".join(f"{peer} {metres:.1f} m" for peer, metres in metrics.distance_m.items()),
        ),
        ("distance of the agent", f"{metrics.agent_distance_m:.1f} m"),
        (
            "planning",
            "none"
            if planning is None
            else f"{planning.count} jobs, median {1e3 * planning.median_s:.1f} ms, "
            f"95 % within {1e3 * planning.p95_s:.1f} ms, longest {1e3 * planning.max_s:.1f} ms",
        ),
        ("decisions", f"{metrics.decisions}, {len(metrics.topology_changes)} of them changed the topology"),
        (
            "overlapping discs",
            f"{sum(overlap.episodes for overlap in metrics.overlaps)} times, {overlapping_s:.1f} s in all, "
            f"{len(metrics.overlaps)} pairs (not avoided yet)",
        ),
        ("log", f"{metrics.warnings} warnings, {metrics.errors} errors, in the recording and in logs/"),
    ):
        figures.add_row(title, value)
    parts: list[Table] = [shares, figures]
    if metrics.topology_changes:
        changes = Table("time", "decision", "reason", "cost", "at least", title="Topology changes")
        for change in metrics.topology_changes:
            costs = (_metres(change.total_cost_m), _metres(change.lower_bound_m))
            changes.add_row(f"{change.time_s:.2f} s", str(change.decision), change.reason, *costs)
        parts.append(changes)
    return Group(*parts)


def _metres(length_m: float | None) -> str:
    return "-" if length_m is None else f"{length_m:.1f} m"


def _percent(shares: Shares, key: str) -> str:
    return f"{100.0 * float(getattr(shares, key)):.1f} %"
