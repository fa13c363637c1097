"""The team in motion, in virtual time: discs stay apart and everybody is one network, whoever is lost or late.

Bodies are looked at fifty times a second, between what they record too.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations

import numpy as np
import pytest
from msgspec import structs

import maps
from agents.casting import Casting
from agents.mission import Mission, Wandering
from agents.records import AnyRecord, LogLine, Office, Ordered
from launcher.fault_timetable import Fault, Kill, Partition, Timetable
from launcher.mission_trace import MissionTrace
from launcher.report import Metrics, measure
from launcher.simulation import SimulatedTeam, simulate
from planning.environment import Environment
from tests.launcher.test_simulation import team

STARTS = [(1.0, 10.0), (1.5, 10.0), (2.0, 10.0), (2.5, 10.0)]


@cache
def office() -> Environment:
    return Environment.load(maps.path("office"))


def mission(seed: int) -> Mission:
    walk = Wandering(start_after_s=1.0, around_corner_share=1.0)
    wandering = team(walk, (1.5, 11.0), (4.5, 10.5), STARTS, seed)
    return structs.replace(wandering, robot_speed_m_s=1.4, agent_speed_m_s=0.9)


class Stage:
    """A simulation that is looked at in between."""

    def __init__(self, seed: int, *faults: Fault, loss: float = 0.0, announces: bool = True) -> None:
        self.mission = structs.replace(mission(seed), announces=announces)
        self.records: list[tuple[float, str, AnyRecord]] = []
        self.team = SimulatedTeam(
            self.mission,
            Casting(self.mission, office()),
            lambda time_s, peer, record: self.records.append((time_s, peer, record)),
            faults=Timetable(faults=faults),
            loss=loss,
        )
        self.nearest_m = np.inf

    def run(self, until_s: float) -> None:
        robots = [entry.name for entry in self.mission.robots]
        time = self.team.time
        while time.now_s < until_s:
            time.run_until(min(time.now_s + 0.02, until_s))
            places = [self.team.peers[name].place for name in robots]
            gaps = [np.hypot(*np.subtract(one, other)) for one, other in combinations(places, 2)]
            self.nearest_m = min(self.nearest_m, *gaps)

    def measure(self) -> Metrics:
        return measure(MissionTrace.of(self.records, self.mission, self.team.time.now_s), office())

    def warnings(self) -> list[str]:
        return [record.text for _, _, record in self.records if isinstance(record, LogLine) and record.level != "info"]


def test_nobody_touches_anybody_and_the_network_is_certified() -> None:
    stage = Stage(3)
    stage.run(15.0)
    assert stage.nearest_m > 0.4 - 1e-6
    metrics = stage.measure()
    assert not metrics.failures
    assert (metrics.plans, metrics.errors) == (1, 0)
    assert metrics.motions > 10
    assert metrics.total_distance_m > 10.0
    assert metrics.certified is not None
    assert metrics.certified.team > 0.95
    assert metrics.certified.agent <= metrics.certified.team <= metrics.certified.chain
    assert metrics.since_first_deployment is not None
    assert metrics.since_first_deployment.chain_connected > 0.97


CUT_OFF = Partition(at_s=6.0, for_s=7.0, group=("robot2",))
"""Nobody hears it any more, nor it anybody."""
CRASH = Kill(at_s=6.0, for_s=7.0, who="robot2")
"""The mind is gone, and the body stands when its last command has run out."""


@pytest.mark.parametrize("harm", [CUT_OFF, CRASH])
def test_a_robot_that_is_lost_is_in_nobodys_way_and_taken_in_again(harm: Fault) -> None:
    stage = Stage(4, harm)
    stage.run(17.0)
    assert stage.nearest_m > 0.4 - 1e-6
    orders = [(time_s, record.motion) for time_s, _, record in stage.records if isinstance(record, Ordered)]
    plans = {motion.plan: {way.member for way in motion.ways if way.scheduled} for _, motion in orders}
    assert [("robot2" in members) for members in plans.values()] == [True, False, True]
    assert any(way.member == "robot2" and not way.scheduled for _, motion in orders for way in motion.ways)
    metrics = stage.measure()
    assert metrics.errors == 0
    assert not metrics.failures


@pytest.mark.parametrize("deaths", [1, 2])
def test_a_leader_that_dies_in_motion_is_replaced_and_the_team_drives_on(deaths: int) -> None:
    """Nobody touches anybody, the chain holds all the same, and each epoch's plans begin from a standstill."""
    faults = [Kill(at_s=at_s, for_s=1.0, who="leader") for at_s in (5.0, 9.0)[:deaths]]
    stage = Stage(4, *faults)
    stage.run(16.0)
    assert stage.nearest_m > 0.4 - 1e-6
    reigns = {record.leads.epoch for _, _, record in stage.records if isinstance(record, Office) and record.leads}
    assert len(reigns) >= 1 + len(faults)
    metrics = stage.measure()
    assert metrics.errors == 0
    assert not metrics.failures
    assert metrics.plans >= len(reigns)
    assert metrics.since_first_deployment is not None
    assert metrics.since_first_deployment.chain_connected > 0.9
    driven = [time_s for time_s, _, record in stage.records if isinstance(record, Ordered) and record.motion.revision]
    assert max(driven) > faults[-1].at_s + 2.0


def test_the_chain_follows_an_agent_that_is_only_measured() -> None:
    stage = Stage(3, announces=False)
    stage.run(8.0)
    assert stage.nearest_m > 0.4 - 1e-6
    metrics = stage.measure()
    assert not metrics.failures
    assert metrics.agent_distance_m > 2.0
    assert metrics.since_first_deployment is not None
    assert metrics.since_first_deployment.chain_connected > 0.9
    assert metrics.estimate is not None
    assert metrics.estimate.contained == 1.0
    assert metrics.estimate.area_median_m2 is not None
    assert metrics.estimate.area_median_m2 < 5.0


@pytest.mark.parametrize("loss", [0.1, 0.3])
def test_messages_may_be_lost(loss: float) -> None:
    """Who has not heard of a release or of another's progress waits for the next time that it is said."""
    stage = Stage(5, loss=loss)
    stage.run(12.0)
    assert stage.nearest_m > 0.4 - 1e-6
    metrics = stage.measure()
    assert metrics.errors == 0
    assert metrics.total_distance_m > 4.0
    assert metrics.since_first_deployment is not None
    assert metrics.since_first_deployment.chain_connected > 0.9


def test_a_trace_knows_its_motions() -> None:
    trace = simulate(mission(6), office(), duration_s=4.0)
    assert trace.motions
    times_s = [time_s for time_s, _ in trace.motions]
    assert times_s == sorted(times_s)
