"""Clocks, disks and processes of simulated peers do what theirs would."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.mission import Mission
from launcher.fault_timetable import Clock, Disk, Fault, Kill, Pause, Timetable
from launcher.simulated_hardware import SimulatedClock, SimulatedDisk
from launcher.simulation import SimulatedTeam
from protocol.core import Persist, Written
from protocol.simulated_bus import VirtualTime
from tests.faults.chaos_mission import ChaosCase
from tests.faults.light_team import LightCasting

times = st.floats(0.0, 1e5)


@given(st.lists(st.tuples(times, st.floats(0.9, 1.1)), max_size=5), times)
def test_a_clock_is_read_back_exactly_and_never_steps_back(changes: list[tuple[float, float]], later_s: float) -> None:
    clock, true_s, shown_s = SimulatedClock(), 0.0, 0.0
    for wait_s, rate in changes:
        true_s += wait_s
        assert clock.read(true_s) >= shown_s
        shown_s = clock.read(true_s)
        clock.change(rate, true_s)
        assert clock.read(true_s) == shown_s
    wished_s = shown_s + later_s
    due_s = clock.when(wished_s)
    assert clock.read(due_s) >= wished_s
    assert clock.read(due_s) == pytest.approx(wished_s, abs=1e-6)


def test_a_disk_keeps_what_it_has_acknowledged_and_perhaps_what_was_under_way() -> None:
    kept = set()
    for seed in range(20):
        time, done = VirtualTime(), list[Written]()
        disk = SimulatedDisk(time, str(seed))
        disk.write(Persist(b"first", 1), done.append)
        time.run_until(1.0)
        assert (disk.content, done) == (b"first", [Written(1)])
        disk.write(Persist(b"second", 2), done.append)
        disk.fail()
        time.run_until(2.0)
        assert done == [Written(1)], "nothing is acknowledged after the power has failed"
        kept.add(disk.content)
    assert kept == {b"first", b"second"}


def test_a_full_disk_says_so_and_keeps_what_it_has() -> None:
    time, done = VirtualTime(), list[Written]()
    disk = SimulatedDisk(time, "")
    disk.write(Persist(b"first", 1), done.append)
    time.run_until(1.0)
    disk.full, disk.takes_s = True, 0.5
    disk.write(Persist(b"second", 2), done.append)
    time.run_until(1.4)
    assert len(done) == 1
    time.run_until(2.0)
    assert done[1].failure
    assert disk.content == b"first"


def team_with(*faults: Fault) -> tuple[Mission, SimulatedTeam]:
    mission = ChaosCase(seed=1, robots=2, duration_s=30.0).mission()
    casting = LightCasting(mission)
    return mission, SimulatedTeam(mission, casting, lambda *_: None, faults=Timetable(faults=faults))


def test_overlapping_kills_and_pauses_end_with_the_last_of_them() -> None:
    _, team = team_with(
        Kill(at_s=2.0, for_s=2.0, who="robot1"), Kill(at_s=3.0, for_s=3.0, who="robot1"),
        Pause(at_s=2.0, for_s=3.0, who="robot2"), Pause(at_s=3.0, for_s=1.0, who="robot2"),
    )  # fmt: skip
    one, two = team.peers["robot1"], team.peers["robot2"]
    seen = []
    for time_s in (1.9, 2.5, 4.5, 5.5, 6.5):
        team.time.run_until(time_s)
        seen.append((one.runs, two.runs))
    assert seen == [(True, True), (False, False), (False, False), (False, True), (True, True)]
    assert one.incarnation == 1
    assert team.faults.quiet_since_s == 6.0


def test_a_process_that_begins_within_a_pause_is_paused() -> None:
    _, team = team_with(
        Pause(at_s=2.0, for_s=4.0, who="robot1"), Kill(at_s=3.0, for_s=1.0, who="robot1"),
        Kill(at_s=2.0, for_s=2.0, who="robot2"), Pause(at_s=3.0, for_s=2.0, who="robot2"),
    )  # fmt: skip
    one, two = team.peers["robot1"], team.peers["robot2"]
    seen = []
    for time_s in (4.5, 5.5, 6.5):
        team.time.run_until(time_s)
        seen.append((one.runs, two.runs))
        assert (one.incarnation, two.incarnation) == (1, 1)
    assert seen == [(False, False), (False, True), (True, True)]


def test_a_process_that_begins_again_remembers_its_promise_and_its_body_stands() -> None:
    _, team = team_with(Kill(at_s=6.9, for_s=2.0, who="robot1"))
    robot = team.peers["robot1"]
    team.time.run_until(7.9)
    place, promise = robot.place, robot.disk.content
    assert promise is not None
    team.time.run_until(8.89)
    assert robot.place == place
    team.time.run_until(8.91)
    assert robot.place == place
    assert robot.runs
    assert robot.disk.content == promise


def test_a_lost_disk_and_a_full_one_and_a_fast_clock() -> None:
    _, team = team_with(
        Clock(at_s=0.0, who="base", rate=1.05, offset_s=10.0),
        Kill(at_s=3.0, for_s=0.5, who="robot1", disk="lost"),
        Disk(at_s=3.0, for_s=1.0, who="robot2", full=True, takes_s=0.2),
    )
    team.time.run_until(3.2)
    assert team.peers["robot1"].disk.content is None
    assert team.peers["robot2"].disk.full
    assert team.peers["base"].now_s == pytest.approx(10.0 + 1.05 * 3.2)
    team.time.run_until(4.5)
    assert not team.peers["robot2"].disk.full


def test_a_paused_leader_that_goes_on_is_obeyed_by_nobody() -> None:
    _, team = team_with(Pause(at_s=3.0, for_s=3.0, who="leader", speaking=True))
    team.time.run_until(2.9)
    first = team.leader()
    assert first is not None
    team.time.run_until(6.5)
    assert team.leader() not in (None, first)
    for peer in team.peers.values():
        if peer.allegiance is not None:
            obeyed = peer.allegiance.obeyed(peer.now_s)
            assert obeyed is None or obeyed.leader == team.leader()
