"""No history of a small election breaks a rule, and every election that lacks a rule is found out."""

from __future__ import annotations

from dataclasses import replace

import pytest

from protocol import ballot
from tests.protocol.election_exploration import Bounds, Exploration
from tests.protocol.election_mutants import (
    FAST,
    LEASE_JUST_OVER,
    MUTANTS,
    ONE_DIES,
    ONE_OBEYS,
    RIGHT,
    SLOW,
    TWO_STAND,
    Mutant,
)

EXPLORED = {
    "two stand": TWO_STAND,
    "any two of three stand, a slow leader": Bounds(steps=2, candidacies=2, rates=(SLOW, FAST, FAST)),
    "a candidate hears of other epochs": replace(TWO_STAND, steps=3, refusals=True),
    "two die": replace(ONE_DIES, crashes=2),
    "two die within half a lease, with disk or without": replace(ONE_DIES, crashes=2, lose_disks=True, steps=1),
    "one obeys": ONE_OBEYS,
    "one obeys when the lease is just over": replace(LEASE_JUST_OVER, candidacies=3, rounds=(2, 2, 0)),
}


@pytest.mark.parametrize("name", EXPLORED)
def test_no_history_breaks_a_rule(name: str) -> None:
    bounds = EXPLORED[name]
    explored = Exploration(bounds).run(300_000)
    assert explored.found is None, "\n".join((explored.found.rule, *explored.found.history))
    assert explored.led > 100, "somebody is elected in many ways"
    assert explored.obeyed > 100 or not bounds.heeding


@pytest.mark.parametrize("kind", MUTANTS, ids=lambda kind: kind.__name__)
def test_an_election_that_lacks_a_rule_is_found_out(kind: type[Mutant]) -> None:
    explored = Exploration(replace(kind.bounds, kind=kind)).run(60_000)
    assert explored.found is not None
    assert explored.found.history[-1].startswith("step")


def test_an_election_without_caution_is_found_out_where_clocks_drift(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ballot, "CAUTION", 1.0)
    assert Exploration(replace(TWO_STAND, rates=(RIGHT, RIGHT, RIGHT))).run(60_000).found is None
    found = Exploration(TWO_STAND).run(60_000).found
    assert found is not None
    assert found.rule.startswith("two hold a lease")


def test_the_drift_allowed_is_the_drift_that_the_caution_covers() -> None:
    drift = ballot.CLOCK_DRIFT
    assert ballot.CAUTION / (1.0 - drift) <= 1.0 / (1.0 + drift)
    assert (1.0 - drift, 1.0 + drift) == (SLOW, FAST)
