"""Who truly saw whom, against shares measured in another way on the same tracks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from agents.recorder import REFEREE, NullRecorder
from agents.records import AnyRecord, Connectivity
from launcher.preparation import prepare
from launcher.referee import judge, record_verdicts
from launcher.report import measure
from launcher.scenario import find_scenario
from launcher.simulation import simulate


class Kept(NullRecorder):
    """Keeps what it is given."""

    def __init__(self) -> None:
        self.records: list[tuple[float, str, AnyRecord]] = []

    def record(self, time_s: float, peer: str, record: AnyRecord) -> None:
        self.records.append((time_s, peer, record))


def test_verdicts_have_the_shares_that_the_report_has() -> None:
    preparation = prepare(find_scenario("office"), lambda _: None)
    mission = preparation.mission
    assert not mission.announces
    trace = simulate(mission, preparation.environment, duration_s=5.0, planner=preparation.planner)
    kept = Kept()
    record_verdicts(trace, preparation.environment, kept)
    verdicts = [record for _, peer, record in kept.records if peer == REFEREE and isinstance(record, Connectivity)]
    assert verdicts == [verdict for _, verdict in judge(trace, preparation.environment)]
    shares = measure(trace, preparation.environment).whole_run
    shown = np.array([(seen.agent_visible, seen.chain_connected, seen.team_connected) for seen in verdicts])
    assert len(shown) == pytest.approx(5.0 * mission.control_hz, abs=1)
    for share, measured in zip(
        shown.mean(axis=0), (shares.agent_visible, shares.chain_connected, shares.team_connected), strict=True
    ):
        assert share == pytest.approx(measured, abs=0.05)  # one is judged at the middles of the control periods
    assert any(verdict.tree_links for verdict in verdicts)


def test_without_the_base_station_nobody_is_connected_to_it() -> None:
    preparation = prepare(find_scenario("office"), lambda _: None)
    trace = simulate(preparation.mission, preparation.environment, duration_s=2.0, planner=preparation.planner)
    gone = replace(
        trace,
        trails=tuple(
            replace(trail, times_s=np.zeros(0), positions=np.zeros((0, 2))) if trail.role == "base_station" else trail
            for trail in trace.trails
        ),
    )
    for _, verdict in judge(gone, preparation.environment):
        assert not (verdict.agent_visible or verdict.chain_connected or verdict.team_connected or verdict.links)
