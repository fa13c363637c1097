"""Runs a mission in which much goes wrong, and says which rule it broke, if it did."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from hashlib import sha256

import msgspec

from agents.records import AnyRecord, LogLine, Mishap, Track
from launcher.fault_timetable import Disk
from launcher.invariants import Invariants
from launcher.recovery_rules import RecoveryRules
from launcher.simulation import SimulatedTeam
from launcher.violation import Violation
from tests.faults.chaos_mission import ChaosCase
from tests.faults.light_team import LightCasting
from tests.faults.real_team import real_casting, real_mission

Record = tuple[float, str, AnyRecord]


@dataclass(frozen=True)
class Verdict:
    """What came of a mission."""

    broken: Violation | None
    """The rule that was broken; the mission ended there."""
    ended_s: float
    led_after_s: float = math.nan
    """From the last fault until all obeyed somebody."""
    planned_after_s: float = math.nan
    """From the last fault until all had a plan."""
    published: int = 0
    went_back: int = 0
    """How many robots that nobody led went back."""
    history: list[Record] = field(default_factory=list, repr=False)

    def digest(self) -> str:
        """Of the whole history."""
        return sha256(msgspec.json.encode(self.history)).hexdigest()

    def trace(self, last: int = 60) -> str:
        """The last lines of who said and did what, to be read."""
        lines = []
        for time_s, peer, record in self.history:
            if isinstance(record, Mishap):
                lines.append(f"{time_s:8.3f} --- {record.text}")
            elif isinstance(record, LogLine) and record.level != "debug":
                lines.append(f"{time_s:8.3f} {peer}: {record.text}")
        if self.broken is not None:
            lines.append(f"{self.ended_s:8.3f} BROKEN: {self.broken}")
        return "\n".join(lines[-last:])


def run_chaos(case: ChaosCase, *, keep: bool = True) -> Verdict:
    """Run a mission until it ends or breaks a rule.

    Args:
        case: which mission.
        keep: the history.
    """
    mission, timetable = real_mission(case) if case.map else case.mission(), case.timetable
    casting = real_casting(mission) if case.map else LightCasting(mission)
    history: list[Record] = []

    went_back: set[str] = set()

    def record(time_s: float, peer: str, what: AnyRecord) -> None:
        if isinstance(what, Track) and what.mode == "retreating":
            went_back.add(peer)
        if keep:
            history.append((time_s, peer, what))

    team = SimulatedTeam(mission, casting, record, faults=timetable)
    Invariants(mission, team, timetable)
    full_disks = any(isinstance(fault, Disk) and fault.full for fault in case.faults)
    recovery = RecoveryRules(mission, team, full_disks=full_disks)
    broken = None
    try:
        team.time.run_until(case.ends_s or case.duration_s)
    except Violation as violation:
        broken = violation
    return Verdict(
        broken,
        team.time.now_s,
        recovery.led_after_s,
        recovery.planned_after_s,
        team.network.published,
        len(went_back),
        history,
    )
