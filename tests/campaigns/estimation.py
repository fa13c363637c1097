"""Campaign: the range filter and the tight set over many seeded runs with truly bounded noise.

    python -m tests.campaigns.estimation --runs 10000

Robots (1–4), noise (uniform, bang-bang), target (static, moving), place (here, 500 km away) and bound (0.5, 0.05 m)
take turns. It ends with status 1 if a target was outside of a set even once, and names the runs.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict

import numpy as np

from estimation.range_filter import RangeFilter
from estimation.tight_set import TightSet
from tests.estimation.range_runs import Run, varied_runs


def follow(run: Run) -> dict[str, tuple[list[int], float, float]]:
    """For each kind of set: the steps at which the target was outside or a range refused, last area, µs per range."""
    results = {}
    for name, kind in (("ellipsoid", RangeFilter), ("tight set", TightSet)):
        held = kind()
        lost, spent = [], 0.0
        for k, step in enumerate(run.steps()):
            began = time.perf_counter()
            held.predict(step.moved_m)
            report = held.measure(step.anchor, step.range_m, run.epsilon_m)
            spent += time.perf_counter() - began
            inside = held.feasible_set() if isinstance(held, RangeFilter) else held
            if not report.accepted or not inside.contains(step.target):
                lost.append(k)
        area = held.feasible_set().area_m2 if isinstance(held, RangeFilter) else held.area_m2
        results[name] = (lost, area, 1e6 * spent / run.ranges)
    return results


def main() -> int:
    """Print containment, medians of area and time; 1 if a target was lost."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--ranges", type=int, default=40, help="per run; every 100th run has 500")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    groups: dict[tuple[str, str, float], list[tuple[float, float]]] = defaultdict(list)
    lost = []
    shown = time.monotonic()
    for i, run in enumerate(varied_runs(options.seed, options.runs, options.ranges)):
        if i % 100 == 99:
            run = Run(**{**run.__dict__, "ranges": 500})
        for name, (steps, area, spent) in follow(run).items():
            groups[name, "moving" if run.target_step_m else "static", run.epsilon_m].append((area, spent))
            if steps:
                lost.append((name, run, steps))
        if time.monotonic() - shown > 5.0:
            shown = time.monotonic()
            print(f"{i + 1} of {options.runs} runs, {len(lost)} lost", file=sys.stderr)
    print(f"{options.runs} runs; targets outside: {len(lost)}")
    print(f"{'set':<10} {'target':<7} {'bound m':>7} {'runs':>6} {'median area m²':>15} {'median µs a range':>18}")
    for (name, target, epsilon), rows in sorted(groups.items()):
        area, spent = np.median(np.array(rows), axis=0)
        print(f"{name:<10} {target:<7} {epsilon:>7} {len(rows):>6} {area:>15.4g} {spent:>18.1f}")
    for name, run, steps in lost:
        print(f"lost by the {name}: {run} at {steps[:5]}")
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
