"""What the peers of a mission recorded, brought into order: the same of a simulation and of a run that is over."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agents.mission import Mission
from agents.records import AnyRecord, Decision, Estimate, LogLine, Ordered, Planned, TopologyChange, Track
from launcher.reigns import Reigns, find_reigns
from protocol.messages import RoleName

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Trail:
    """Where a peer truly was; empty for one that never recorded."""

    peer: str
    role: RoleName
    radius_m: float
    speed_m_s: float
    """The most that it can go."""
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
    planned: tuple[Planned, ...]
    """All planning jobs."""
    motions: tuple[tuple[float, Ordered], ...]
    trees: tuple[tuple[float, str, TopologyChange], ...]
    """Proposals for another tree when they were settled, with their leaders."""
    estimates: tuple[tuple[float, str, Estimate], ...]
    """Where which peer took an independent agent to be."""
    logs: tuple[tuple[float, str, LogLine], ...]
    agent: str
    """Name of the tracked agent."""
    control_hz: float
    planning_period_s: float
    duration_s: float
    reigns: Reigns
    """Who led, and who took over from whom."""

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
                mission.agent_speed_m_s if entry.role == "tracked_agent" else mission.robot_speed_m_s,
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
            planned=tuple(record for _, _, record in ordered if isinstance(record, Planned)),
            motions=tuple((time_s, record) for time_s, _, record in ordered if isinstance(record, Ordered)),
            trees=tuple((at_s, peer, change) for at_s, peer, change in ordered if isinstance(change, TopologyChange)),
            estimates=tuple((time_s, peer, record) for time_s, peer, record in ordered if isinstance(record, Estimate)),
            logs=tuple((time_s, peer, record) for time_s, peer, record in ordered if isinstance(record, LogLine)),
            agent=mission.tracked_agent.name,
            control_hz=mission.control_hz,
            planning_period_s=mission.planning_period_s,
            duration_s=duration_s,
            reigns=find_reigns(ordered, mission.epoch_unix_s),
        )
