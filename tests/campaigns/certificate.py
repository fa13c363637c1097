"""Campaign: the motion certificate against sampling at every millimetre, over many mutants of random schedules.

    python -m tests.campaigns.certificate --mutants 10000 --by progress

By the *clock* it judges schedules without stages, and sampling looks at every millisecond of them. By *progress* it
judges schedules in stages; shapely and networkx judge the rule as it stands (links hold wherever two members are in two
stages that follow each other), and sampling looks at every millimetre of executions in which members go by turns.

A mutant is *missed* if the certificate accepts it and any of them refutes it. It is a *false alarm* if the certificate
refuses it and it keeps the rule: nothing is found throughout, nor in the time that the certificate names. It ends with
status 1 if any was missed, or more than 1 % are false alarms, and names them. Of the mutants that break the rule by
progress it also counts those where no execution that was tried shows it: what the rule costs.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterator
from typing import Literal

import numpy as np

import maps
from planning.certificate import Certificate, certify
from planning.environment import Environment
from planning.motion_plan import Schedule
from tests.planning.polygons import environment_of
from tests.planning.schedule_mutants import (
    Ground,
    broken_rules,
    mutants,
    random_schedule,
    sample_times,
    truly_broken,
)
from tests.planning.stage_mutants import breaks_by_turns, breaks_the_rule, random_staged, staged_mutants

MUTANTS_EACH = 8
"""Of every schedule."""

EXECUTIONS = 4
"""By turns, of a mutant that breaks the rule."""

Outcome = Literal["accepted", "refused", "false alarm", "missed"]


def grounds() -> list[Ground]:
    """The maps of the thesis and an office for robots of 0.2 m, and random ones for smaller robots."""
    named = [Ground(Environment.load(maps.path(name)), 0.2) for name in ("cityblocks", "room3", "office", "maze")]
    return named + [Ground(environment_of(seed), 0.12) for seed in range(20)]


def judge_clock(ground: Ground, mutant: Schedule, certificate: Certificate) -> Outcome:
    """What sampling says about the certificate of a schedule without stages."""
    if certificate.valid:
        return "missed" if broken_rules(ground, mutant, sample_times(mutant, 1e-3)) else "accepted"
    if truly_broken(ground, mutant, certificate) or broken_rules(ground, mutant, sample_times(mutant, 1e-3)):
        return "refused"
    return "false alarm"


def judge_progress(
    ground: Ground, mutant: Schedule, certificate: Certificate, rng: np.random.Generator, seen: Counter[bool]
) -> Outcome:
    """What the rule and executions say about the certificate of one in stages; counts if these show what is broken."""
    broken = breaks_the_rule(ground, mutant)
    if certificate.valid:
        return "missed" if broken or breaks_by_turns(ground, mutant, rng) else "accepted"
    if broken and broken <= {"collision", "connection"}:
        seen[any(breaks_by_turns(ground, mutant, rng) for _ in range(EXECUTIONS))] += 1
    return "refused" if broken else "false alarm"


def draw(by: str, robots: int, seed: int) -> Iterator[tuple[int, Ground, Schedule, np.random.Generator]]:
    """Random schedules without end, numbered."""
    places = grounds()
    number = 0
    while True:
        rng = np.random.default_rng([seed, number])
        ground = places[number % len(places)]
        schedule = (random_schedule if by == "clock" else random_staged)(ground, robots, rng)
        if schedule is not None:
            yield number, ground, schedule, rng
        number += 1


def main() -> int:
    """Print what became of the mutants of each kind; 1 if one was missed or too many were refused without cause."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutants", type=int, default=10_000)
    parser.add_argument("--by", choices=("clock", "progress"), default="progress")
    parser.add_argument("--robots", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    outcomes: Counter[tuple[str, str]] = Counter()
    rules: Counter[str] = Counter()
    seen: Counter[bool] = Counter()
    spent = []
    shown = time.monotonic()
    judged = 0
    for number, ground, schedule, rng in draw(options.by, options.robots, options.seed):
        made = (mutants if options.by == "clock" else staged_mutants)(schedule, rng, MUTANTS_EACH)
        for kind, mutant in [("unchanged", schedule), *made]:
            judged += kind != "unchanged"
            began = time.perf_counter()
            certificate = certify(mutant, ground.environment)
            spent.append(time.perf_counter() - began)
            rules.update({violation.kind for violation in certificate.violations})
            if options.by == "clock":
                outcome = judge_clock(ground, mutant, certificate)
            else:
                outcome = judge_progress(ground, mutant, certificate, rng, seen)
            outcomes[kind, outcome] += 1
            if outcome in {"missed", "false alarm"}:
                print(f"{outcome}: {kind}, schedule {number} of seed {options.seed}: {certificate.violations[:1]}")
        if time.monotonic() - shown > 5.0:
            shown = time.monotonic()
            print(f"{judged} of {options.mutants} mutants", file=sys.stderr)
        if judged >= options.mutants:
            break
    names = ("accepted", "refused", "false alarm", "missed")
    print(f"{'mutant':<12}" + "".join(f"{name:>13}" for name in names))
    for kind in sorted({kind for kind, _ in outcomes}):
        print(f"{kind:<12}" + "".join(f"{outcomes[kind, name]:>13}" for name in names))
    totals = {name: sum(count for (_, outcome), count in outcomes.items() if outcome == name) for name in names}
    print(f"{'all':<12}" + "".join(f"{totals[name]:>13}" for name in names))
    alarms = totals["false alarm"] / sum(totals.values())
    print(f"false alarms {100.0 * alarms:.2f} %; broken rules: {dict(sorted(rules.items()))}")
    if seen:
        print(f"of {seen.total()} where members collide or part by the rule, executions show it of {seen[True]}")
    print(f"a certificate takes {1e3 * float(np.median(spent)):.2f} ms (median), {1e3 * max(spent[9:]):.1f} ms at most")
    return 1 if totals["missed"] or alarms > 0.01 else 0


if __name__ == "__main__":
    sys.exit(main())
