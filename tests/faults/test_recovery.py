"""How soon a team is led and has a plan again, when what went wrong is over."""

from __future__ import annotations

import pytest

from launcher.fault_timetable import Kill
from tests.faults.chaos import run_chaos
from tests.faults.chaos_mission import ChaosCase


@pytest.mark.parametrize("at_s", [5.0, 5.5, 6.0, 6.5, 7.0])
def test_a_plan_that_ends_is_followed_by_another_whenever_the_next_was_due(at_s: float) -> None:
    """Plans are made every 2 s; a robot comes back, and knows nothing of the present one."""
    faults = (Kill(at_s=at_s, for_s=0.3, who="robot1"),)
    verdict = run_chaos(ChaosCase(seed=1, robots=2, duration_s=12.0, planning_period_s=2.0, faults=faults), keep=False)
    assert verdict.broken is None
    assert verdict.planned_after_s < 0.5


def test_who_obeys_a_dead_leader_is_not_led() -> None:
    """Its last lease runs on for a while, and others have to be asked for theirs before there is another leader."""
    faults = (Kill(at_s=5.0, who="base"),)
    verdict = run_chaos(ChaosCase(seed=1, robots=2, duration_s=12.0, faults=faults), keep=False)
    assert verdict.broken is None
    assert 0.5 < verdict.led_after_s < verdict.planned_after_s < 4.0


def test_without_a_majority_nobody_is_waited_for() -> None:
    faults = tuple(Kill(at_s=5.0, who=name) for name in ("base", "robot1"))
    verdict = run_chaos(ChaosCase(seed=1, robots=2, duration_s=10.0, faults=faults), keep=False)
    assert verdict.broken is None
    assert verdict.led_after_s == verdict.planned_after_s == float("inf")


def test_a_new_leader_may_wait_for_whom_it_cannot_know_to_be_dead() -> None:
    """Its token is seen to be gone 1.5 s after its death, and it counts as gone 1.5 s after that."""
    faults = (Kill(at_s=5.0, who="robot1", noticed_after_s=1.5), Kill(at_s=5.02, who="base"))
    verdict = run_chaos(ChaosCase(seed=1, robots=4, duration_s=13.0, faults=faults), keep=False)
    assert verdict.broken is None
    assert verdict.led_after_s + 1.5 < verdict.planned_after_s < 4.0
