"""`make bench`: what the issue's speed targets ask for, measured on this machine, as a table and as JSON.

Every case is called once to warm up and then repeatedly; minimum and median are shown, because machines are shared
and noisy. Targets are sizes to compare with, not tests: nothing fails here on a wall clock.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(name, "1")

Case = tuple[str, float, Callable[[], object]]


def cases() -> Iterator[Case]:
    """All benchmark cases: name, target in seconds, what to time."""
    from tests.benchmarks import estimation_benchmarks, planning_benchmarks, process_benchmarks

    yield from planning_benchmarks.cases()
    yield from estimation_benchmarks.cases()
    yield from process_benchmarks.cases()


def measure(case: Case, *, least_s: float = 1.0, most_runs: int = 50) -> dict[str, Any]:
    """Time one case: at least three runs, then until ``least_s`` is spent or ``most_runs`` are done."""
    name, target_s, function = case
    function()
    runs: list[float] = []
    while len(runs) < 3 or (sum(runs) < least_s and len(runs) < most_runs):
        begin = time.perf_counter()
        result = function()
        spent = time.perf_counter() - begin
        runs.append(result if isinstance(result, float) else spent)  # a case may time a part of itself
    return {
        "name": name,
        "target_s": target_s,
        "minimum_s": min(runs),
        "median_s": statistics.median(runs),
        "runs": len(runs),
    }


def _time(seconds: float) -> str:
    """Three digits and a unit, ten characters wide."""
    factor, unit = (1e6, "µs") if seconds < 1e-3 else (1e3, "ms") if seconds < 1.0 else (1.0, "s ")
    return f"{seconds * factor:>7.3g} {unit}"


def main() -> None:
    """Measure, print, and write JSON where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, help="write the figures to this file, too")
    parser.add_argument("--only", default="", help="only cases whose name contains this")
    arguments = parser.parse_args()
    print(f"{'case':<58}{'minimum':>10}{'median':>10}{'target':>10}  runs")
    rows = []
    for case in cases():
        if arguments.only in case[0]:
            row = measure(case)
            rows.append(row)
            print(
                f"{row['name']:<58}{_time(row['minimum_s'])}{_time(row['median_s'])}{_time(row['target_s'])}"
                f"  {row['runs']:>4}"
            )
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
