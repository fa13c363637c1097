"""Whole missions in which the tree changes by agreement, by both ways to the next one, also when the leader is lost."""

from __future__ import annotations

import pytest
from msgspec import structs

from agents.mission import Scripted
from agents.records import TopologyChange
from launcher.fault_timetable import LEADER, Kill, Timetable
from launcher.mission_trace import MissionTrace
from launcher.report import measure
from launcher.report_trees import describe_trees, settled_proposals
from launcher.simulation import simulate
from protocol.messages import Method
from tests.launcher.test_simulation import CORNER, around_the_corner, team

KILLED_S = 7.0


@pytest.fixture(scope="module", params=["optimum", "auction"])
def method(request: pytest.FixtureRequest) -> Method:
    way: Method = request.param
    return way


@pytest.fixture(scope="module")
def trace(method: Method) -> MissionTrace:
    mission = structs.replace(around_the_corner(), topology=method)
    faults = Timetable(faults=(Kill(at_s=KILLED_S, who=LEADER, for_s=30.0),))
    return simulate(mission, CORNER, duration_s=13.0, faults=faults)


def test_changes_follow_on_each_other(trace: MissionTrace, method: Method) -> None:
    before: TopologyChange | None = None
    made = [change for _, _, change in trace.trees if change.committed]
    assert len(made) >= 3
    for change in made:
        assert change.method == method and change.reason and change.rounds <= 8 and change.duration_s <= 2.0
        edges, old = set(map(frozenset, change.edges)), set(map(frozenset, change.before))
        assert set(map(frozenset, change.released)) == old - edges
        if before is not None:
            assert change.number > before.number
            assert old == set(map(frozenset, before.edges)), "a new leader takes over the tree of the one before"
        same_reign = before is not None and before.number[0] == change.number[0]
        assert set(map(frozenset, change.new)) == (edges - old if same_reign else edges)
        before = change


def test_the_chain_grows_by_a_relay_and_another_leader_goes_on_with_it(trace: MissionTrace) -> None:
    made = [(at_s, leader, change) for at_s, leader, change in trace.trees if change.committed]
    assert made[0][2].edges == (("base", "agent"),)
    assert len({change.number[0] for _, _, change in made}) == 2
    earlier = [leader for at_s, leader, _ in made if at_s < KILLED_S]
    later = [(at_s, leader, change) for at_s, leader, change in made if at_s > KILLED_S]
    assert later and later[0][1] not in earlier
    assert later[0][0] < KILLED_S + 4.0
    assert any(len(change.edges) > 1 for _, _, change in made)


def test_decisions_are_taken_when_their_tree_is_in_force(trace: MissionTrace) -> None:
    for at_s, decision in trace.decisions:
        in_force = [change for when_s, _, change in trace.trees if change.committed and when_s <= at_s]
        assert in_force and set(map(frozenset, in_force[-1].edges)) == set(map(frozenset, decision.deployment.edges))


def test_an_agent_that_nobody_sees_or_hears_is_found_and_linked() -> None:
    hidden = team(Scripted(goals=()), (1.5, 11.0), (11.0, 1.5), [(0.7, 11.0), (2.3, 11.0)])
    trace = simulate(structs.replace(hidden, announces=False), CORNER, duration_s=14.0)
    metrics = measure(trace, CORNER)
    assert min(at_s for at_s, _, change in trace.trees if change.committed) < 1.5
    assert metrics.first_deployment_s is not None and metrics.first_deployment_s < 1.5
    assert metrics.relays_at_most >= 1 and metrics.total_distance_m > 5.0
    # From the one corridor into the other it is some metres; then base, relay and agent are one chain to the end.
    assert metrics.whole_run.chain_connected > 0.3
    assert not [line for _, _, line in trace.logs if "does not propose" in line.text]


def test_the_report_lists_them(trace: MissionTrace, method: Method) -> None:
    metrics = measure(trace, CORNER)
    assert len(metrics.trees) == len(trace.trees) == len(settled_proposals(trace))
    assert {proposal.method for proposal in metrics.trees} == {method}
    assert "came into force" in describe_trees(metrics.trees) and describe_trees(()) == "none negotiated"
    if method == "auction":
        assert any("bid by" in proposal.reason or "the tree as it is" in proposal.reason for proposal in metrics.trees)
