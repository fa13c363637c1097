"""The study of topology: one short mission, and its table."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from msgspec import structs

from agents.casting import Casting
from launcher.studies.topology import METHODS, Outcome, live_through, sum_up
from tests.launcher.test_simulation import CORNER, around_the_corner

PAGE = Path(__file__).resolve().parents[2] / "docs" / "topology.md"


def test_a_mission_is_lived_through_and_counted() -> None:
    mission = structs.replace(around_the_corner(), topology="auction")
    planner = Casting(mission, CORNER).planner()
    outcome = live_through("corner", mission, CORNER, planner, 0.0, 5.0)
    assert (outcome.method, outcome.seed, outcome.given_up) == ("auction", mission.seed, 0)
    assert outcome.changes >= 1 and outcome.rounds == 1 and 0.0 < outcome.commit_ms <= outcome.slowest_ms < 250.0
    assert outcome.chain_share > 0.9 and outcome.messages_per_s > 5.0
    assert outcome.bytes_per_s > 50.0 * outcome.messages_per_s


def test_the_table_has_means_and_the_worst() -> None:
    one = Outcome("maze", "optimum", 0, 0.0, 1.0, 4, 0, 2.0, 10.0, 1, 30.0, 40.0, 100.0, 20.0, 5000.0)
    others = [replace(one, seed=1, chain_share=0.5, cost_m=0.0, slowest_ms=90.0), replace(one, method="auction")]
    lines = sum_up([one, *others], 2, 60.0).splitlines()
    rows = [line for line in lines if line.startswith(("| maze", "| all"))]
    assert len(rows) == 2 * len(METHODS)
    assert "| maze | 0 % | optimum | 75.0 (50.0) | 4.0 | 0.0 | 2.0 | 10.0 | 100 | 30 (90) | 1 | 20.0 | 5.0 |" in rows
    assert rows[0].replace("maze", "all") == rows[2]


@pytest.mark.parametrize("method", METHODS)
def test_the_page_quotes_both_ways(method: str) -> None:
    assert f"| {method} |" in PAGE.read_text(encoding="utf-8")
