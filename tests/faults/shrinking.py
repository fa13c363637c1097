"""Makes a mission that breaks a rule as small as it can be and still break the same rule."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

from msgspec import structs

from launcher.fault_timetable import Fault
from tests.faults.chaos import Verdict
from tests.faults.chaos_mission import ChaosCase, robot_names

MOST_RUNS: Final = 400

LATER_S: Final = 1.0
"""In a smaller case the rule may be broken so much later."""


def shrink(case: ChaosCase, run: Callable[[ChaosCase], Verdict], most_runs: int = MOST_RUNS) -> ChaosCase:
    """The smallest case found that breaks the rule that ``case`` breaks.

    First it does without as many faults as possible (A. Zeller and R. Hildebrandt, "Simplifying and isolating
    failure-inducing input", 2002, doi:10.1109/32.988498), then without robots, then with shorter faults; each time the
    mission ends where the rule was broken.

    Args:
        case: breaks a rule.
        run: says what comes of a case; the same each time.
        most_runs: when to be content.
    """
    verdict = run(case)
    if verdict.broken is None:
        raise ValueError("the case breaks no rule: there is nothing to shrink")
    rule, runs = verdict.broken.rule, 0
    case = _ending(case, verdict)

    def breaks(smaller: ChaosCase) -> ChaosCase | None:
        nonlocal runs
        runs += 1
        ends_s = smaller.duration_s if smaller.ends_s is None else min(smaller.ends_s + LATER_S, smaller.duration_s)
        smaller = structs.replace(smaller, ends_s=ends_s)
        verdict = run(smaller)
        return _ending(smaller, verdict) if verdict.broken is not None and verdict.broken.rule == rule else None

    parts = 2
    progress = True
    while progress and runs < most_runs:
        progress = False
        for smaller in (*_without_faults(case, parts), *_without_robots(case), *_with_shorter_faults(case)):
            if runs >= most_runs:
                break
            if (found := breaks(smaller)) is not None:
                case, progress = found, True
                break
        if not progress and parts < len(case.faults):
            parts, progress = min(2 * parts, len(case.faults)), True
    return case


def _ending(case: ChaosCase, verdict: Verdict) -> ChaosCase:
    """The case, over soon after the rule was broken; faults that come later are none."""
    ends_s = round(verdict.ended_s + 0.05, 3)
    faults = tuple(fault for fault in case.faults if fault.at_s <= ends_s)
    return structs.replace(case, faults=faults, ends_s=min(case.ends_s or ends_s, ends_s))


def _without_faults(case: ChaosCase, parts: int) -> Iterator[ChaosCase]:
    """Without each of so many parts of the timetable."""
    faults = case.faults
    size = max(1, -(-len(faults) // parts))
    for begin in range(0, len(faults), size):
        yield structs.replace(case, faults=faults[:begin] + faults[begin + size :])


def _without_robots(case: ChaosCase) -> Iterator[ChaosCase]:
    """Without the last robot, and what would have happened to it."""
    if case.robots > 1:
        name = robot_names(case.robots)[-1]
        faults = (_without(fault, name) for fault in case.faults)
        left = tuple(fault for fault in faults if fault is not None)
        yield structs.replace(case, robots=case.robots - 1, faults=left)


def _without(fault: Fault, name: str) -> Fault | None:
    """A fault of a team that lacks a peer; None if it was that peer's only."""
    if getattr(fault, "who", "") == name:
        return None
    changes: dict[str, tuple[str, ...]] = {}
    for key in ("group", "speakers", "hearers"):
        names = getattr(fault, key, ())
        if name in names:
            if names == (name,):
                return None
            changes[key] = tuple(other for other in names if other != name)
    return structs.replace(fault, **changes)


def _with_shorter_faults(case: ChaosCase) -> Iterator[ChaosCase]:
    """With one fault of half the length."""
    for place, fault in enumerate(case.faults):
        if fault.for_s is not None and fault.for_s > 0.2:
            shorter = structs.replace(fault, for_s=round(fault.for_s / 2, 3))
            yield structs.replace(case, faults=(*case.faults[:place], shorter, *case.faults[place + 1 :]))
