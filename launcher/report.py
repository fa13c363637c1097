"""What a mission was worth: shares of time, counts and distances, measured on the true tracks of all peers.

Simulation and review measure alike: both bring the records of a mission into a
:class:`~launcher.mission_trace.MissionTrace`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import msgspec
import numpy as np
from numpy.typing import NDArray

from agents.motion_level import AGENT, CHAIN, TEAM, certified_level
from agents.self_report import silence_s
from launcher.contacts import Overlap, find_overlaps
from launcher.mission_trace import MissionTrace, Trail
from launcher.reigns import Takeover
from launcher.report_estimate import EstimateFigures, failures_of, measure_estimates
from launcher.report_trees import SettledProposal, settled_proposals
from launcher.spells import Spell
from launcher.wording import counted
from planning.environment import Environment

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


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


class CertifiedShares(msgspec.Struct, frozen=True, kw_only=True):
    """Shares of ``seconds``, between 0 and 1, in which the motion ordered was certified to keep lines of sight."""

    seconds: float
    """From the first motion on."""
    agent: float
    """The whole team and the agent's next moments are one network, whoever is late."""
    team: float
    """Base station and robots are."""
    chain: float
    """Base station and last relays are joined at least."""


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
    trees: tuple[SettledProposal, ...]
    """What was negotiated, as the leaders recorded it."""
    plans: int
    """Of motion: each but the first began because a robot was lost or heard anew, or did not follow the one before."""
    motions: int
    """Plans and their revisions."""
    certified: CertifiedShares | None
    agent_certain: float | None
    """Share of the plans at which, wherever the agent went, the last relay would see it until the next plan is due."""
    overlaps: tuple[Overlap, ...]
    """Of robots: none, if all is well."""
    agent_contacts: tuple[Overlap, ...]
    """Of robots and the agent, which goes where it likes."""
    estimate: EstimateFigures | None
    """Of an agent that does not announce."""
    reigns: tuple[Spell, ...]
    """Who led, by time."""
    takeovers: tuple[Takeover, ...]
    """How long the team was without a leader when one was killed, paused or cut off."""
    leading_faults: tuple[str, ...] | None
    """Rules of leading that a recording breaks; none of a simulation, which is judged while it runs."""
    failures: tuple[str, ...]
    """What must not happen, and did; sentences."""
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
    there, places = sample(trace, middles_s)
    judged = _judge(trace, _sights(places, there, environment))
    first_s = trace.decisions[0][0] if trace.decisions else None
    deployments = [decision.deployment for _, decision in trace.decisions]
    relays = [[place.robot for place in deployment.placements if not place.spare] for deployment in deployments]
    distance_m = {trail.peer: _distance_m(trail, trace.control_hz) for trail in trace.trails}
    robots = [trail.peer for trail in trace.trails if trail.role == "robot"]
    contacts = tuple(find_overlaps(trace.trails, places, there, middles_s, lengths_s))
    overlaps = tuple(contact for contact in contacts if set(contact.peers) <= set(robots))
    estimate = measure_estimates(trace)
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
        planning=_planning_times([planned.planning_s for planned in trace.planned]),
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
        trees=settled_proposals(trace),
        plans=len({(ordered.epoch, ordered.motion.plan) for _, ordered in trace.motions}),
        motions=len(trace.motions),
        certified=_certified(trace),
        agent_certain=_agent_certain(trace),
        overlaps=overlaps,
        agent_contacts=tuple(contact for contact in contacts if contact not in overlaps),
        estimate=estimate,
        reigns=trace.reigns.led,
        takeovers=trace.reigns.takeovers,
        leading_faults=None,
        failures=(
            *(
                f"{' and '.join(overlap.peers)} overlapped {counted(overlap.episodes, 'time')}, "
                f"{overlap.seconds:.1f} s in all"
                for overlap in overlaps
            ),
            *failures_of(estimate),
        ),
        warnings=sum(line.level == "warning" for _, _, line in trace.logs),
        errors=sum(line.level == "error" for _, _, line in trace.logs),
    )


def sample(trace: MissionTrace, times_s: Floats) -> tuple[Bools, Floats]:
    """Who was there, and where: (t, n) bool, and (t, n, 2) in metres, meaningless for who was not; trails in order."""
    there = np.column_stack([_presence(trail, times_s, trace.control_hz) for trail in trace.trails])
    return there, np.stack([_places(trail, times_s) for trail in trace.trails], axis=1)


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
    # Rounding of the sums must not make a share of more than all.
    shares = np.minimum(judged.T @ lengths_s / seconds, 1.0) if seconds > 0.0 else np.zeros(3)
    visible, chain, team = shares.tolist()
    return Shares(seconds=seconds, agent_visible=visible, chain_connected=chain, team_connected=team)


def _distance_m(trail: Trail, control_hz: float) -> float:
    steps_m = np.hypot(*np.diff(trail.positions, axis=0).T)
    return float(steps_m[np.diff(trail.times_s) <= silence_s(control_hz)].sum())


def _certified(trace: MissionTrace) -> CertifiedShares | None:
    """Each motion counts until the next one."""
    if not trace.motions:
        return None
    begins_s = np.array([time_s for time_s, _ in trace.motions] + [trace.duration_s])
    lengths_s = np.diff(begins_s)
    levels = np.array([certified_level(ordered.motion, trace.agent) for _, ordered in trace.motions])
    judged = np.column_stack([levels >= level for level in (AGENT, TEAM, CHAIN)])
    seconds = float(lengths_s.sum())
    agent, whole, chain = (judged.T @ lengths_s / seconds).tolist() if seconds > 0.0 else (0.0, 0.0, 0.0)
    return CertifiedShares(seconds=seconds, agent=agent, team=whole, chain=chain)


def _agent_certain(trace: MissionTrace) -> float | None:
    if not trace.planned:
        return None
    return float(np.mean([planned.in_sight_s >= trace.planning_period_s for planned in trace.planned]))


def _planning_times(planning_s: Sequence[float]) -> PlanningTimes | None:
    if not planning_s:
        return None
    median_s, p95_s, max_s = np.percentile(planning_s, (50, 95, 100)).tolist()
    return PlanningTimes(count=len(planning_s), median_s=median_s, p95_s=p95_s, max_s=max_s)
