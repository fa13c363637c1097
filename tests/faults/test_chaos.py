"""Missions in which much goes wrong break no rule; a rule left out on purpose is found out; failures are made small.

The campaign (``make chaos``) runs ten thousand of them.
"""

from __future__ import annotations

import pytest

from agents.records import Office
from launcher.fault_timetable import Clock, Kill, Loss, Partition
from launcher.reigns import find_reigns
from tests.faults.chaos import run_chaos
from tests.faults.chaos_mission import LONGEST_FAULT_S, ChaosCase, draw_case, draw_ranged_case, read_case, write_case
from tests.faults.chaos_mutants import MUTANTS
from tests.faults.mutant_cases import CASES, FURTHER
from tests.faults.shrinking import shrink

MISSIONS = 10
"""Of each test of them, so that several processes can share these."""

RETREATING = 33


def is_told_by_records(seed: int) -> bool:
    """Whether a recording can be judged: clocks are alike, and no epoch begins again."""
    faults = draw_case(seed, (2, 3), (12, 16)).faults
    return not any(isinstance(fault, Clock) or (isinstance(fault, Kill) and fault.disk == "lost") for fault in faults)


RECORDED = [seed for seed in range(1000, 1022) if is_told_by_records(seed)]


@pytest.mark.parametrize("first", range(1000, 1200, MISSIONS))
def test_no_rule_is_broken(first: int) -> None:
    """Small teams, whose missions cost little."""
    for seed in range(first, first + MISSIONS):
        case = draw_case(seed, (2, 4), (12, 16))
        broken = run_chaos(case, keep=False).broken
        assert broken is None, f"mission {seed}: {broken}\n{write_case(case)}\n{run_chaos(case).trace()}"


@pytest.mark.parametrize("seed", range(6))
def test_no_rule_is_broken_where_ranges_alone_tell_where_the_agent_is(seed: int) -> None:
    case = draw_ranged_case(seed, (2, 3), (12, 14))
    broken = run_chaos(case, keep=False).broken
    assert broken is None, f"mission {seed}: {broken}\n{write_case(case)}\n{run_chaos(case).trace()}"


@pytest.mark.parametrize("seed", RECORDED)
def test_what_is_recorded_breaks_no_rule(seed: int) -> None:
    """By recordings, of which less is known, the missions are judged as in the simulation."""
    verdict = run_chaos(draw_case(seed, (2, 3), (12, 16)))
    assert verdict.broken is None, f"mission {seed}: {verdict.broken}"
    assert find_reigns(verdict.history, 0.0).broken == (), "what was recorded breaks no rule, either"


def test_the_missions_are_hard() -> None:
    """Several things go wrong in each; leaders are replaced, and the last one is obeyed after the last fault."""
    faults = sorted(len(draw_case(seed).faults) for seed in range(100))
    assert faults[0] >= 5
    assert faults[50] >= 20
    verdict = run_chaos(draw_case(1001, (2, 3), (14, 20)))
    reigns = {record.leads for _, _, record in verdict.history if isinstance(record, Office)} - {None}
    assert len(reigns) > 1
    assert verdict.planned_after_s < 10.0


def test_in_some_missions_robots_go_back() -> None:
    """Where so many voters are dead that there is no majority; none of the rules is broken by that."""
    case = draw_case(RETREATING)
    assert case.retreat_after_s < LONGEST_FAULT_S
    verdict = run_chaos(case, keep=False)
    assert verdict.broken is None, write_case(case)
    assert verdict.went_back > 0


@pytest.mark.parametrize(
    ("name", "rule", "case"),
    [pytest.param(name, *found, id=name) for name, found in (*CASES.items(), *FURTHER.items())],
)
def test_a_rule_left_out_is_found_out(name: str, rule: str, case: ChaosCase, monkeypatch: pytest.MonkeyPatch) -> None:
    healthy = run_chaos(case)
    assert healthy.broken is None, healthy.trace()
    MUTANTS[name](monkeypatch)
    broken = run_chaos(case).broken
    assert broken is not None, f"{name} is not found out"
    assert broken.rule == rule


def test_there_is_a_mission_for_each_rule_left_out() -> None:
    assert CASES.keys() == MUTANTS.keys() >= FURTHER.keys()


def test_the_same_case_has_the_same_history_to_the_last_bit() -> None:
    case = draw_case(7, (2, 2), (10, 12))
    assert run_chaos(case).digest() == run_chaos(case).digest()
    other = ChaosCase(seed=8, robots=case.robots, duration_s=case.duration_s, faults=case.faults)
    assert run_chaos(case).digest() != run_chaos(other).digest()


def test_cases_read_back_as_they_were_written() -> None:
    for seed in range(50):
        case = draw_case(seed)
        assert read_case(write_case(case)) == case


def test_a_failing_case_is_made_small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of many faults only the one is left that leads to harm, and only the robots that it takes."""
    MUTANTS["is_elected_by_a_minority"](monkeypatch)
    case = ChaosCase(
        seed=1,
        robots=4,
        duration_s=30.0,
        faults=(
            Loss(at_s=1.0, for_s=2.0, share=0.2),
            Kill(at_s=1.5, for_s=1.0, who="robot4"),
            Partition(at_s=4.0, for_s=5.0, group=("base", "robot1")),
            Kill(at_s=9.5, for_s=1.0, who="agent"),
        ),
    )
    before = run_chaos(case).broken
    assert before is not None
    small = shrink(case, lambda smaller: run_chaos(smaller, keep=False), most_runs=40)
    verdict = run_chaos(small)
    assert verdict.broken is not None
    assert verdict.broken.rule == before.rule
    assert len(small.faults) <= 1
    assert small.robots < case.robots
    assert "BROKEN" in verdict.trace(last=5)


def test_what_breaks_no_rule_cannot_be_made_small() -> None:
    with pytest.raises(ValueError, match="breaks no rule"):
        shrink(ChaosCase(seed=1, robots=1, duration_s=2.0), run_chaos)
