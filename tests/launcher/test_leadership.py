"""The leader dies, hangs, is cut off and comes back, in virtual time, with complete minds and a quick planner."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, pairwise
from typing import TypeVar

import pytest
from msgspec import structs

from agents.mission import Mission, RosterEntry, Scripted
from agents.records import AnyRecord, Decision, LogLine, Office, Ordered, Track
from launcher.fault_timetable import Cut, Disk, Fault, Kill, Partition, Pause, Timetable
from launcher.simulation import SimulatedTeam
from protocol.election import LEASE_S
from protocol.messages import Reign
from tests.faults.light_team import DEPTH_M, RADIUS_M, LightCasting, lane

ROBOTS = tuple(f"robot{number}" for number in range(1, 5))
TEAM = ("base", *ROBOTS)

Kind = TypeVar("Kind", bound=AnyRecord)


def mission() -> Mission:
    """The agent walks along the room for as long as anybody looks."""
    robots = (RosterEntry(name=name, role="robot", start=lane(number)) for number, name in enumerate(ROBOTS))
    return Mission(
        team="team",
        map_path="",
        roster=(
            RosterEntry(name="base", role="base_station", start=(1.0, DEPTH_M / 2 + 4.5)),
            RosterEntry(name="agent", role="tracked_agent", start=(3.0, DEPTH_M - 1.0)),
            *robots,
        ),
        behaviour=Scripted(goals=((22.0, DEPTH_M - 1.0),), start_after_s=1.0),
        robot_radius_m=RADIUS_M,
        agent_radius_m=RADIUS_M,
        robot_speed_m_s=1.2,
        agent_speed_m_s=0.8,
        control_hz=5.0,
        heartbeat_hz=2.0,
        planning_period_s=0.5,
        decomposition="inflection",
        duration_s=20.0,
        seed=1,
        epoch_unix_s=0.0,
        planning_delay_s=0.05,
    )


class Play:
    """A mission with faults, and what its peers recorded."""

    def __init__(self, *faults: Fault, until_s: float, without: str = "", period_s: float = 0.5) -> None:
        self.records: list[tuple[float, str, AnyRecord]] = []
        what = structs.replace(mission(), planning_period_s=period_s)
        what = structs.replace(what, roster=tuple(entry for entry in what.roster if entry.name != without))
        self.team = SimulatedTeam(
            what,
            LightCasting(what),
            lambda time_s, peer, record: self.records.append((time_s, peer, record)),
            faults=Timetable(faults=faults),
        )
        self.until_s = until_s
        self.team.time.run_until(until_s)
        self.check()

    def check(self) -> None:
        """No two led, and no two were obeyed, at the same time; nobody obeyed a leader that did not lead."""
        led, obeyed = list(self.spans("leads")), list(self.spans("obeys"))
        for (_, reign, begin_s, end_s), (_, other, from_s, to_s) in combinations(led, 2):
            assert reign == other or min(end_s, to_s) <= max(begin_s, from_s), f"{reign} and {other} led"
        for (_, reign, begin_s, end_s), (_, other, from_s, to_s) in combinations(obeyed, 2):
            same = (reign.leader, reign.incarnation) == (other.leader, other.incarnation)
            assert same or min(end_s, to_s) <= max(begin_s, from_s), f"{reign} and {other} were obeyed"

    def spans(self, what: str) -> Iterator[tuple[str, Reign, float, float]]:
        """Who led or obeyed in which reign, from when to when."""
        for name in dict.fromkeys(peer for _, peer, _ in self.of(Office)):
            offices = [(time_s, record) for time_s, peer, record in self.of(Office) if peer == name]
            ends = [time_s for time_s, peer, record in self.of(Track) if peer == name]
            for (begin_s, office), following in zip(offices, [*offices[1:], None], strict=True):
                if (reign := getattr(office, what)) is None:
                    continue
                if following is None:
                    end_s = self.until_s if max(ends) > self.until_s - 1.0 else max(ends)
                elif following[1].incarnation != office.incarnation:
                    end_s = max(time_s for time_s in ends if time_s < following[0])
                else:
                    ended_s = following[1].led_until_s if what == "leads" else following[1].obeyed_until_s
                    end_s = following[0] if ended_s is None else ended_s
                yield name, reign, begin_s, end_s

    def of(self, kind: type[Kind]) -> list[tuple[float, str, Kind]]:
        """Records of one kind."""
        return [(time_s, peer, record) for time_s, peer, record in self.records if isinstance(record, kind)]

    def leaders(self) -> list[tuple[float, str]]:
        """Who took office when."""
        return [(time_s, peer) for time_s, peer, record in self.of(LogLine) if record.text.startswith("leads in epoch")]

    def plans(self) -> list[tuple[float, str, int, int]]:
        """When a plan was ordered first, by whom, in which epoch, and its number."""
        seen: dict[tuple[str, int, int], float] = {}
        for time_s, peer, ordered in self.of(Ordered):
            seen.setdefault((peer, ordered.epoch, ordered.motion.plan), time_s)
        return [(time_s, *what) for what, time_s in seen.items()]

    def decisions(self) -> list[int]:
        return [record.deployment.decision for _, _, record in self.of(Decision)]

    def travelled_m(self, robot: str, begin_s: float, end_s: float) -> float:
        """Along its lane."""
        places = [r.position[0] for t, peer, r in self.of(Track) if peer == robot and begin_s <= t <= end_s]
        return sum(abs(b - a) for a, b in pairwise(places))

    def logs(self, peer: str, word: str) -> list[float]:
        """When a peer has logged a line with this in it."""
        return [time_s for time_s, who, line in self.of(LogLine) if who == peer and word in line.text]


def test_a_team_that_starts_is_led_by_its_base_station_at_once() -> None:
    play = Play(until_s=3.0)
    ((time_s, leader),) = play.leaders()
    assert (leader, time_s < 0.3) == ("base", True)
    assert {peer for peer, reign, *_ in play.spans("obeys") if reign.leader == "base"} == set(TEAM)
    assert play.plans()[0][0] < 0.5


def test_when_the_leader_dies_another_goes_on_and_the_base_station_comes_back_as_one_of_many() -> None:
    play = Play(Kill(at_s=6.0, who="base", for_s=3.0), until_s=16.0)
    (_, first), (taken_s, second) = play.leaders()
    assert (first, second in ROBOTS) == ("base", True)
    assert 6.0 < taken_s < 6.0 + 2 * LEASE_S
    fresh = [(time_s, plan) for time_s, peer, _, plan in play.plans() if peer == second]
    assert fresh[0][1] == 0
    assert fresh[0][0] < taken_s + 1.0
    # The team stood in between, and drives again under the new leader.
    assert play.travelled_m("robot4", taken_s - 0.1, taken_s) == 0.0
    assert sum(play.travelled_m(robot, 9.0, 16.0) for robot in ROBOTS) > 3.0
    numbers = play.decisions()
    assert numbers == list(range(1, len(numbers) + 1)), "each leader goes on with the numbers of the one before"
    obeying = {peer: reign for peer, reign, _, end_s in play.spans("obeys") if end_s == play.until_s}
    assert {reign.leader for reign in obeying.values()} == {second}
    assert len(play.logs("robot4", "obeys nobody")) == 1


def test_a_leader_that_hangs_is_replaced_and_what_it_says_late_is_refused() -> None:
    play = Play(Pause(at_s=5.0, for_s=3.0, who="base", speaking=True), until_s=12.0)
    (_, first), (taken_s, second) = play.leaders()
    assert first == "base"
    assert taken_s < 5.0 + 2 * LEASE_S
    assert play.logs("base", "leads no more")
    assert all(reign.leader == second for _, reign, begin_s, _ in play.spans("obeys") if begin_s > 5.5)
    assert play.plans()[-1][1] == second


def test_the_next_leader_plans_as_soon_as_it_can_however_long_its_planning_period_is() -> None:
    play = Play(Pause(at_s=5.0, for_s=9.0, who="base"), until_s=10.0, period_s=30.0)
    taken_s, second = play.leaders()[-1]
    assert second != "base"
    first_s = min(time_s for time_s, peer, *_ in play.plans() if peer == second)
    assert first_s < taken_s + 1.0


def test_who_is_cut_off_with_less_than_half_holds_and_says_so_once() -> None:
    play = Play(Partition(at_s=5.0, for_s=5.0, group=("base", "robot1")), until_s=14.0)
    for name in ("base", "robot1"):
        (lost_s,) = play.logs(name, "obeys nobody")
        assert 5.0 < lost_s < 5.0 + LEASE_S
    assert play.travelled_m("robot1", 5.0 + LEASE_S, 10.0) == 0.0
    (_, first), (_, second) = play.leaders()
    assert (first, second in ("robot2", "robot3", "robot4")) == ("base", True)
    healed = [begin_s for peer, reign, begin_s, _ in play.spans("obeys") if peer == "base" and reign.leader == second]
    assert min(healed) < 10.0 + 1.5 * LEASE_S


def test_an_even_split_holds_and_nobody_leads() -> None:
    play = Play(Partition(at_s=4.0, group=("base", "robot1")), until_s=9.0, without="robot4")
    assert len(play.leaders()) == 1
    assert all(end_s < 4.0 + LEASE_S for _, _, _, end_s in play.spans("obeys"))


def test_a_robot_that_starts_late_knows_all_within_seconds_and_takes_part() -> None:
    play = Play(Kill(at_s=0.15, who="robot4", for_s=6.0), until_s=12.0)
    joined_s = min(begin_s for peer, _, begin_s, _ in play.spans("obeys") if peer == "robot4")
    assert joined_s < 6.15 + 2 * LEASE_S
    with_it = [
        time_s
        for time_s, _, ordered in play.of(Ordered)
        if any(way.member == "robot4" and way.scheduled for way in ordered.motion.ways)
    ]
    assert 6.15 < with_it[0] < 6.15 + 2.5


def test_two_leaders_die_one_after_the_other_and_a_third_goes_on() -> None:
    play = Play(Kill(at_s=4.0, who="leader"), Kill(at_s=8.0, who="leader"), until_s=14.0)
    leaders = [leader for _, leader in play.leaders()]
    assert len(set(leaders)) == 3
    assert play.plans()[-1][1] == leaders[-1]
    assert sum(play.travelled_m(robot, 10.0, 14.0) for robot in ROBOTS) > 1.0


def test_a_robot_that_does_not_hear_the_leader_does_not_keep_the_team_waiting() -> None:
    play = Play(Cut(at_s=3.0, for_s=9.0, speakers=("base",), hearers=("robot2",)), until_s=10.0)
    assert play.logs("base", "robot2 does not answer")
    time_s, leader, _, _ = play.plans()[-1]
    assert (leader, 3.0 < time_s < 10.0) == ("base", True)
    last = play.of(Ordered)[-1][2]
    assert [way.scheduled for way in last.motion.ways if way.member == "robot2"] == [False]


@pytest.mark.parametrize("takes_s", [0.05, 0.2])
def test_slow_disks_cost_time_and_nothing_else(takes_s: float) -> None:
    slow = [Disk(at_s=0.0, who=name, takes_s=takes_s) for name in TEAM]
    play = Play(*slow, Kill(at_s=4.0, who="leader"), until_s=9.0)
    assert len(play.leaders()) >= 2
