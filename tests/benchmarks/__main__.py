"""`make bench`: what the speed targets ask for, measured on this machine, as a table and as JSON.

Every case is called once to warm up and then repeatedly; minimum and median are shown, because machines are shared and
noisy. Targets are sizes to compare with, not tests: nothing fails here on a wall clock. Where there is something to
compare with, it is timed on the same input in the same run, and shown as a ratio of minima, ours to theirs.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.benchmarks.timing import Case, Work

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(name, "1")


def cases() -> Iterator[Case]:
    """All benchmark cases."""
    from tests.benchmarks import (
        chain_cases,
        estimation_benchmarks,
        motion_benchmarks,
        planning_benchmarks,
        process_benchmarks,
        redeployment_cases,
        steiner_cases,
    )

    yield from planning_benchmarks.cases()
    yield from steiner_cases.cases()
    yield from redeployment_cases.cases()
    yield from chain_cases.cases()
    yield from motion_benchmarks.cases()
    yield from estimation_benchmarks.cases()
    yield from process_benchmarks.cases()


def measure(case: Case) -> dict[str, Any]:
    """Time one case and its references."""
    name, target_s, work, *references = case
    work()
    runs = _time_runs(work, least=3)
    compared = {}
    for reference, theirs in zip(references[::2], references[1::2], strict=True):
        compared[reference] = theirs if isinstance(theirs, float) else min(_time_runs(theirs, least=1))
    return {
        "name": name,
        "target_s": target_s,
        "minimum_s": min(runs),
        "median_s": statistics.median(runs),
        "runs": len(runs),
        "references_s": compared,
    }


def _time_runs(work: Work, least: int, *, least_s: float = 1.0, most: int = 50) -> list[float]:
    """Times of at least so many runs, then until ``least_s`` is spent or ``most`` runs are done."""
    runs: list[float] = []
    start = time.perf_counter()
    while len(runs) < least or (time.perf_counter() - start < least_s and len(runs) < most):
        begin = time.perf_counter()
        result = work()
        spent = time.perf_counter() - begin
        runs.append(result if isinstance(result, float) else spent)
    return runs


def format_row(row: dict[str, Any]) -> str:
    """A line of the table."""
    times = "".join(format_time(row[key]) for key in ("minimum_s", "median_s", "target_s"))
    ratios = [f"1 : {theirs / row['minimum_s']:.3g} {name}" for name, theirs in row["references_s"].items()]
    return f"{row['name']:<58}{times}  {row['runs']:>4}  {'; '.join(ratios)}".rstrip()


def format_time(seconds: float) -> str:
    """Three digits and a unit, ten characters wide."""
    factor, unit = (1e6, "µs") if seconds < 1e-3 else (1e3, "ms") if seconds < 1.0 else (1.0, "s ")
    return f"{seconds * factor:>7.3g} {unit}"


def main() -> None:
    """Measure, print, and write JSON where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, help="write the figures to this file, too")
    parser.add_argument("--only", default="", help="only cases whose name contains this")
    arguments = parser.parse_args()
    print(f"{'case':<58}{'minimum':>10}{'median':>10}{'target':>10}  runs  ours : theirs")
    rows = []
    for case in cases():
        if arguments.only in case[0]:
            row = measure(case)
            rows.append(row)
            print(format_row(row), flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
