"""A team that does nothing but range a walking agent and share what it measures, on a network with all its faults."""

from __future__ import annotations

import math
from collections.abc import Iterator
from random import Random

from msgspec import structs

from agents.driver import DiscDriver
from agents.mind import Mind
from agents.mission import Mission, OnDemand, Ranging, RosterEntry
from agents.ranging import Ranging as RangingPart
from agents.ranging import Transponder
from agents.records import AnyRecord, Estimate
from agents.rhythm import Rhythm
from agents.role import Drive, Effect, Event, Role, Woken
from agents.shared_estimate import HORIZON_S, SharedEstimate
from agents.sighted_set import Sight
from launcher.fault_timetable import Fault, Timetable
from launcher.simulated_peer import SimulatedPeer
from launcher.simulation import SimulatedTeam
from planning.environment import Environment
from protocol.messages import Point, Reign

CORNER = Environment([(0, 0), (10, 0), (10, 5), (5, 5), (5, 10), (0, 10)], name="corner")
AGENT_RADIUS_M = 0.2
VOTERS = ("base", "robot1", "robot2", "robot3")


class Stroll:
    """A part that walks about, the same way for the same seed."""

    hears = frozenset[str]()

    def __init__(self, seed: str, speed_m_s: float, now_s: float) -> None:
        self._chance, self._speed_m_s = Random(seed), speed_m_s
        self._turns = Rhythm(0.5, now_s)

    @property
    def next_s(self) -> float:
        return self._turns.next_s

    def handle(self, event: Event, now_s: float) -> Iterator[Effect]:
        if isinstance(event, Woken) and self._turns.due(now_s):
            angle = self._chance.uniform(0.0, 2.0 * math.pi)
            yield Drive((self._speed_m_s * math.cos(angle), self._speed_m_s * math.sin(angle)), 0.6)


class LightCasting:
    """Casts peers that only range and stroll."""

    def __init__(self, mission: Mission, horizon_s: float = HORIZON_S) -> None:
        self._mission, self._horizon_s = mission, horizon_s
        self.sight = Sight(CORNER, CORNER.inflated(AGENT_RADIUS_M))

    def cast(
        self,
        name: str,
        *,
        incarnation: int = 0,
        promise: Reign | None = None,  # noqa: ARG002 - these have no vote
        now_s: float = 0.0,
    ) -> tuple[Role, DiscDriver]:
        mission, entry = self._mission, self._mission.entry(name)
        seed = f"{mission.seed}/{name}/{incarnation}"
        if name == "agent":
            body = DiscDriver(entry.start, mission.agent_speed_m_s, self.sight.room)
            return Mind([Stroll(seed, mission.agent_speed_m_s, now_s), Transponder(mission, CORNER)]), body
        estimate = SharedEstimate(mission, name, incarnation, self.sight, horizon_s=self._horizon_s)
        body = DiscDriver(entry.start, mission.robot_speed_m_s, self.sight.room)
        stroll = Stroll(seed, mission.robot_speed_m_s * (name != "base"), now_s)
        return Mind([stroll, estimate, RangingPart(mission, name, estimate)]), body


def make_mission(seed: int, **ranging: float) -> Mission:
    """Base station, three robots and an agent that tells nothing, in a room round a corner."""
    starts: dict[str, Point] = {
        "base": (1.0, 1.0), "robot1": (2.0, 4.0), "robot2": (4.0, 8.0), "robot3": (4.5, 4.5), "agent": (4.0, 6.0),
    }  # fmt: skip
    roles = {"base": "base_station", "agent": "tracked_agent"}
    return Mission(
        team="team",
        map_path="corner.json",
        roster=tuple(
            RosterEntry(name=name, role=roles.get(name, "robot"), start=start)  # type: ignore[arg-type]
            for name, start in starts.items()
        ),
        behaviour=OnDemand(),
        robot_radius_m=0.2,
        agent_radius_m=AGENT_RADIUS_M,
        robot_speed_m_s=0.8,
        agent_speed_m_s=0.8,
        control_hz=10.0,
        heartbeat_hz=2.0,
        planning_period_s=0.5,
        decomposition="inflection",
        duration_s=30.0,
        seed=seed,
        announces=False,
        ranging=structs.replace(Ranging(), **ranging),
        epoch_unix_s=0.0,
    )


class EstimateTeam:
    """The team in virtual time; its invariant is checked as it runs."""

    def __init__(
        self, seed: int, *faults: Fault, check_s: float = 0.4, horizon_s: float = HORIZON_S, **ranging: float
    ) -> None:
        self.mission = make_mission(seed, **ranging)
        self.casting = LightCasting(self.mission, horizon_s)
        self.estimates: list[tuple[float, str, Estimate]] = []
        self.escapes: list[str] = []
        self.checks = 0
        self._check_s, self._checked = check_s, dict.fromkeys(VOTERS, 0.0)
        self.team = SimulatedTeam(
            self.mission,
            self.casting,  # type: ignore[arg-type]
            self._record,
            faults=Timetable(faults=faults),
            watch=self._check,
        )
        self.peers = self.team.peers

    def run_until(self, time_s: float) -> None:
        self.team.time.run_until(time_s)

    @property
    def now_s(self) -> float:
        return self.team.time.now_s

    def estimate(self, name: str) -> SharedEstimate:
        found = self.peers[name].part(SharedEstimate)
        assert found is not None, f"{name} does not run"
        return found

    def silence_the_agent(self) -> None:
        """No ranges from now on: what there are can come to everybody."""
        self.peers["agent"].kill()

    def _record(self, time_s: float, peer: str, record: AnyRecord) -> None:
        if isinstance(record, Estimate):
            self.estimates.append((time_s, peer, record))

    def _check(self, peer: SimulatedPeer) -> None:
        """The target is inside every peer's set."""
        if peer.name == "agent" or self.now_s - self._checked[peer.name] < self._check_s:
            return
        self._checked[peer.name] = self.now_s
        self.checks += 1
        place = self.peers["agent"].place
        if not self.estimate(peer.name).contains(place, peer.now_s):
            self.escapes.append(f"at {self.now_s:.3f} s the agent at {place} is outside the set of {peer.name}")
