"""Campaign: the motion certificate against sampling at every millisecond, over many mutants of random schedules.

    python -m tests.campaigns.certificate --mutants 10000

A mutant is *missed* if the certificate accepts it and sampling refutes it. It is a *false alarm* if the certificate
refuses it, and sampling finds nothing, neither throughout nor in the time that the certificate names. It ends with
status 1 if any was missed, or more than 1 % are false alarms, and names them.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter

import numpy as np

import maps
from planning.certificate import certify
from planning.environment import Environment
from tests.planning.polygons import environment_of
from tests.planning.schedule_mutants import (
    Ground,
    broken_rules,
    mutants,
    random_schedule,
    sample_times,
    truly_broken,
)

MUTANTS_EACH = 8
"""Of every schedule."""


def grounds() -> list[Ground]:
    """The maps of the thesis and an office for robots of 0.2 m, and random ones for smaller robots."""
    named = [Ground(Environment.load(maps.path(name)), 0.2) for name in ("cityblocks", "room3", "office", "maze")]
    return named + [Ground(environment_of(seed), 0.12) for seed in range(20)]


def main() -> int:
    """Print what became of the mutants of each kind; 1 if one was missed or too many were refused without cause."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutants", type=int, default=10_000)
    parser.add_argument("--robots", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    places = grounds()
    outcomes: Counter[tuple[str, str]] = Counter()
    rules: Counter[str] = Counter()
    spent = []
    shown = time.monotonic()
    judged = number = 0
    while judged < options.mutants:
        rng = np.random.default_rng([options.seed, number])
        ground = places[number % len(places)]
        schedule = random_schedule(ground, options.robots, rng)
        number += 1
        if schedule is None:
            continue
        for kind, mutant in [("unchanged", schedule), *mutants(schedule, rng, MUTANTS_EACH)]:
            judged += kind != "unchanged"
            began = time.perf_counter()
            certificate = certify(mutant, ground.environment)
            spent.append(time.perf_counter() - began)
            rules.update({violation.kind for violation in certificate.violations})
            if certificate.valid:
                broken = broken_rules(ground, mutant, sample_times(mutant, 1e-3))
                outcome = "missed" if broken else "accepted"
            else:
                sampled = truly_broken(ground, mutant, certificate)
                sampled = sampled or bool(broken_rules(ground, mutant, sample_times(mutant, 1e-3)))
                outcome = "refused" if sampled else "false alarm"
            outcomes[kind, outcome] += 1
            if outcome in {"missed", "false alarm"}:
                print(f"{outcome}: {kind}, schedule {number - 1} of seed {options.seed}: {certificate.violations[:1]}")
        if time.monotonic() - shown > 5.0:
            shown = time.monotonic()
            print(f"{judged} of {options.mutants} mutants", file=sys.stderr)
    names = ("accepted", "refused", "false alarm", "missed")
    print(f"{'mutant':<12}" + "".join(f"{name:>13}" for name in names))
    for kind in sorted({kind for kind, _ in outcomes}):
        print(f"{kind:<12}" + "".join(f"{outcomes[kind, name]:>13}" for name in names))
    totals = {name: sum(count for (_, outcome), count in outcomes.items() if outcome == name) for name in names}
    print(f"{'all':<12}" + "".join(f"{totals[name]:>13}" for name in names))
    alarms = totals["false alarm"] / sum(totals.values())
    print(f"false alarms {100.0 * alarms:.2f} %; broken rules: {dict(sorted(rules.items()))}")
    print(f"a certificate takes {1e3 * float(np.median(spent)):.2f} ms (median), {1e3 * max(spent[9:]):.1f} ms at most")
    return 1 if totals["missed"] or alarms > 0.01 else 0


if __name__ == "__main__":
    sys.exit(main())
