"""Shares of traces made by hand, whose values are known in closed form."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from io import StringIO

import msgspec
import numpy as np
import pytest
from rich.console import Console

from agents.mission import Mission
from agents.records import AnyRecord, Decision, LogLine, Ordered, Planned, Track
from launcher.mission_trace import MissionTrace
from launcher.report import CertifiedShares, Metrics, measure
from launcher.report_table import render
from planning.environment import Environment
from protocol.messages import Authority, Deployment, MemberWay, Motion, Placement, Point, Warrant
from tests.agents.conftest import make_mission

CORNER = Environment([(0, 0), (10, 0), (10, 5), (5, 5), (5, 10), (0, 10)])
"""An L; (2, 9) and (9, 2) do not see each other, and (1, 1) sees both."""

Records = list[tuple[float, str, AnyRecord]]


def tracks(
    peer: str, where: Callable[[float], Point] | Point, start_s: float = 0.0, end_s: float = 10.0, rate_hz: float = 10.0
) -> Iterator[tuple[float, str, AnyRecord]]:
    for time_s in np.arange(start_s, end_s + 1e-9, 1.0 / rate_hz):
        place = where(float(time_s)) if callable(where) else where
        yield float(time_s), peer, Track(role="robot", position=place, velocity=(0, 0), radius_m=0.2, mode="moving")


def decide(time_s: float, number: int, relays: tuple[str, ...], changed: bool = False) -> tuple[float, str, AnyRecord]:
    deployment = Deployment(
        authority=Authority(epoch=0, leader="base", sequence=number),
        warrant=Warrant(lease_s=0.8, marks=()),
        decision=number,
        placements=tuple(Placement(robot=robot, position=(1.0, 1.0), spare=robot not in relays)
                         for robot in ("robot1", "robot2")),
        edges=(),
        cost=0.0,
        relays_needed=len(relays),
        reason=f"reason {number}",
    )  # fmt: skip
    return time_s, "base", Decision(deployment=deployment, planning_s=0.1, topology_changed=changed)


def judge(records: Records, duration_s: float = 10.0) -> Metrics:
    mission: Mission = make_mission()
    return measure(MissionTrace.of(records, mission, duration_s), CORNER)


def shown(metrics: Metrics) -> str:
    paper = StringIO()
    Console(width=160, file=paper).print(render(metrics))
    return paper.getvalue()


def test_everybody_at_home_is_connected_all_the_time() -> None:
    records = [entry for peer in ("base", "agent", "robot1", "robot2") for entry in tracks(peer, (1.0, 1.0))]
    metrics = judge(records)
    assert msgspec.structs.astuple(metrics.whole_run) == (10.0, 1.0, 1.0, 1.0)
    assert metrics.since_first_deployment is None
    assert metrics.total_distance_m == 0.0


def test_shares_follow_from_when_the_agent_is_out_of_sight() -> None:
    # The agent walks along y = 1 from x = 1 to x = 9 in 8 s. The corner (5, 5) halves the way from (3, 9) to (7, 1), so
    # that base and robots, which stand there or see no farther, lose it after 6 s.
    def agent(time_s: float) -> Point:
        return (1.0 + min(time_s, 8.0), 1.0)

    records = [*tracks("base", (3.0, 9.0)), *tracks("agent", agent)]
    records += [*tracks("robot1", (3.0, 9.5)), *tracks("robot2", (3.0, 9.0))]
    metrics = judge(records)
    assert metrics.whole_run.agent_visible == pytest.approx(0.6, abs=0.01)
    assert metrics.whole_run.chain_connected == pytest.approx(0.6, abs=0.01)
    assert metrics.agent_distance_m == pytest.approx(8.0)


def test_visible_connected_and_complete_are_three_different_things() -> None:
    def relay(time_s: float) -> Point:
        return (1.0, 1.0) if 2.0 <= time_s <= 6.0 else (9.0, 3.0)

    records = [*tracks("base", (2.0, 9.0)), *tracks("agent", (9.0, 2.0))]
    records += [*tracks("robot1", relay), *tracks("robot2", (9.0, 3.0), 0.0, 4.0)]
    metrics = judge(records)
    # robot2 falls silent after 4 s: until then it sees the agent but not the base. The relay needs one control period
    # to jump, and joins the chain on the way.
    assert metrics.whole_run.agent_visible == pytest.approx(1.0, abs=0.011)
    assert metrics.whole_run.chain_connected == pytest.approx(0.4, abs=0.021)
    assert metrics.whole_run.team_connected == pytest.approx(0.2, abs=0.021)


def test_peers_that_are_not_there_link_nobody() -> None:
    # robot1 is the only relay: it starts at 1 s, is silent from 3 to 6 s, and dies at 8 s.
    alive = ((1.0, 3.0), (6.0, 8.0))
    records = [*tracks("base", (2.0, 9.0)), *tracks("agent", (9.0, 2.0)), *tracks("robot2", (1.0, 9.0))]
    for start_s, end_s in alive:
        records += tracks("robot1", (1.0, 1.0), start_s, end_s)
    metrics = judge(records)
    assert metrics.whole_run.chain_connected == pytest.approx(0.42, abs=0.001)  # one period after each last sample
    assert metrics.whole_run.team_connected == metrics.whole_run.chain_connected


def test_short_gaps_are_bridged_by_interpolation() -> None:
    records = [entry for peer in ("base", "agent", "robot1") for entry in tracks(peer, (1.0, 1.0))]
    records += tracks("robot2", lambda time_s: (1.0, 1.0 + time_s / 2), rate_hz=1.25)
    metrics = judge(records)
    assert metrics.whole_run.team_connected == pytest.approx(0.97, abs=0.011)  # its last sample is of 9.6 s
    assert metrics.distance_m["robot2"] == pytest.approx(4.8)


def test_time_before_the_first_deployment_counts_for_the_whole_run_only() -> None:
    records = [*tracks("base", (2.0, 9.0)), *tracks("agent", (9.0, 2.0)), *tracks("robot2", (1.0, 8.5))]
    records += tracks("robot1", (1.0, 1.0), start_s=4.0)
    records.append(decide(4.03, 1, ("robot1",)))
    metrics = judge(records)
    assert metrics.first_deployment_s == 4.03
    assert metrics.whole_run.chain_connected == pytest.approx(0.6)
    assert metrics.since_first_deployment is not None
    assert metrics.since_first_deployment.seconds == pytest.approx(5.97)
    assert metrics.since_first_deployment.chain_connected == pytest.approx(1.0)


def test_overlaps_are_counted_in_episodes_and_seconds() -> None:
    # Centres 0.4 m apart just touch. robot2 swings through robot1 twice; the agent keeps clear; the base counts not.
    def swing(time_s: float) -> Point:
        return (3.0 + 2.0 * np.cos(np.pi * time_s / 5.0), 1.0)

    records = [*tracks("base", (3.0, 1.0)), *tracks("agent", (9.0, 1.0))]
    records += [*tracks("robot1", (3.0, 1.0)), *tracks("robot2", swing)]
    (overlap,) = judge(records).overlaps
    inside_s = 2 * (10.0 / np.pi) * np.arcsin(0.4 / 2.0)
    assert overlap.peers == ("robot1", "robot2")
    assert overlap.episodes == 2
    assert overlap.seconds == pytest.approx(inside_s, abs=0.2)


def test_overlaps_of_robots_are_failures_and_those_with_the_agent_are_not() -> None:
    records = [*tracks("base", (1.0, 1.0)), *tracks("robot1", (3.0, 1.0)), *tracks("robot2", (3.0, 1.3))]
    metrics = judge([*records, *tracks("agent", (3.0, 1.0))])
    assert [contact.peers for contact in metrics.overlaps] == [("robot1", "robot2")]
    assert metrics.failures == ("robot1 and robot2 overlapped 1 time, 10.0 s in all",)
    assert {frozenset(contact.peers) for contact in metrics.agent_contacts} == {
        frozenset(("agent", "robot1")),
        frozenset(("agent", "robot2")),
    }
    assert "overlapping robots" in shown(metrics)


def test_who_may_have_gone_around_is_not_accused() -> None:
    # A robot that turns right between two records passes the other at 0.4 m, and the straight between them at 0.38 m:
    # at 1 m/s it may have been 0.045 m beside that straight. One that was on the straight all the time did overlap.
    for speed_share, expected in ((1.0, 1), (0.5, 0)):

        def drive(time_s: float, share: float = speed_share) -> Point:
            return (2.0 + share * time_s, 1.38)

        records = [*tracks("base", (1.0, 1.0)), *tracks("agent", (9.0, 1.0)), *tracks("robot1", (5.0, 1.0))]
        records += tracks("robot2", drive)
        assert len(judge(records).overlaps) == expected


def test_certificates_count_for_as_long_as_their_motions() -> None:
    def order(time_s: float, number: int, connection: str, *members: str) -> tuple[float, str, AnyRecord]:
        ways = tuple(
            MemberWay(member=name, radius_m=0.2, speed_m_s=1.0, waypoints=((1.0, 1.0),), stages=(0, 0))
            for name in ("base", "robot1", *members)
        )
        motion = Motion(
            plan=number // 2, revision=number % 2, first_stage=0, released=-1, ways=ways,
            connection=connection, joined=("base", "robot1"),  # type: ignore[arg-type]
        )  # fmt: skip
        return time_s, "base", Ordered(epoch=1, motion=motion)

    records = [entry for peer in ("base", "agent", "robot1", "robot2") for entry in tracks(peer, (1.0, 1.0))]
    records += [
        order(2.0, 0, "team", "agent"),
        order(4.0, 1, "team"),
        order(7.0, 2, "joined", "robot2"),
        order(9.0, 3, "none"),
    ]
    records += [(1.0 * n, "base", Planned(planning_s=0.1, in_sight_s=0.2 * n)) for n in range(4)]
    metrics = judge(records)
    assert (metrics.plans, metrics.motions) == (2, 4)
    assert metrics.certified == CertifiedShares(seconds=8.0, agent=0.25, team=0.625, chain=0.875)
    assert metrics.agent_certain == 0.25  # plans are due every half second
    assert "2 plans, 2 revisions; certified as one network 62.5 % of" in shown(metrics)


def test_distance_is_that_of_the_path_and_restarts_are_no_journeys() -> None:
    records = [*tracks("base", (1.0, 1.0)), *tracks("agent", (1.0, 1.0)), *tracks("robot2", (1.0, 1.0))]
    records += tracks("robot1", lambda time_s: (1.0 + abs(time_s - 2.0), 1.0), 0.0, 4.0)
    records += tracks("robot1", (9.0, 1.0), 6.0, 10.0)
    metrics = judge(records)
    assert metrics.distance_m == {"robot1": pytest.approx(4.0), "robot2": 0.0}
    assert metrics.total_distance_m == pytest.approx(4.0)


def test_decisions_planning_and_logs_are_counted() -> None:
    records = [entry for peer in ("base", "agent", "robot1", "robot2") for entry in tracks(peer, (1.0, 1.0))]
    records += [
        decide(1.0, 1, ()),
        decide(2.0, 2, ("robot1",), changed=True),
        decide(3.0, 3, ("robot1", "robot2"), True),
    ]
    records += [(0.1 * n, "base", Planned(planning_s=0.01 * n)) for n in range(1, 101)]
    records += [(5.0, "base", LogLine(level=level, text="text")) for level in ("info", "warning", "warning", "error")]  # type: ignore[arg-type]
    metrics = judge(list(reversed(records)))
    assert (metrics.decisions, metrics.robots, metrics.robots_used, metrics.relays_at_most) == (3, 2, 2, 2)
    assert [(change.time_s, change.reason) for change in metrics.topology_changes] == [
        (2.0, "reason 2"),
        (3.0, "reason 3"),
    ]
    planning = metrics.planning
    assert planning is not None
    assert (planning.count, planning.max_s) == (100, pytest.approx(1.0))
    assert planning.median_s == pytest.approx(0.505)
    assert planning.p95_s == pytest.approx(np.percentile(np.arange(0.01, 1.005, 0.01), 95))
    assert (metrics.warnings, metrics.errors) == (2, 1)


def test_a_run_that_never_began_has_no_shares_and_no_faults() -> None:
    metrics = judge([], 0.0)
    assert metrics.whole_run.seconds == 0.0
    assert metrics.planning is None
    assert judge([], 5.0).whole_run.agent_visible == 0.0


def test_figures_survive_json_and_can_be_shown() -> None:
    records = [entry for peer in ("base", "agent", "robot1", "robot2") for entry in tracks(peer, (1.0, 1.0))]
    records += [decide(1.0, 1, ()), decide(2.0, 2, ("robot1",), changed=True)]
    for metrics in (judge(records), judge([])):
        assert msgspec.json.decode(msgspec.json.encode(metrics), type=Metrics) == metrics
        assert "agent-base chain connected" in shown(metrics)
        assert f"{100 * metrics.whole_run.chain_connected:.1f} %" in shown(metrics)
