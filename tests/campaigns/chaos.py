"""Campaign: missions in which much goes wrong, by the thousand, and some with the full planner on real maps.

    python -m tests.campaigns.chaos --missions 10000 --ranged 300 --real 200
    python -m tests.campaigns.chaos --case runs/chaos/light-17.toml

Every mission is judged after every event (:mod:`launcher.invariants`), and by how soon it recovers from its last fault.
It ends with status 1 if a rule was broken, and leaves for each such mission the smallest one found that breaks the same
rule, with the last lines of its history: ``--case`` runs that one again.
"""

from __future__ import annotations

import argparse
import gc
import math
import sys
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Final

from tests.faults.chaos import run_chaos
from tests.faults.chaos_mission import ChaosCase, draw_case, draw_ranged_case, read_case, write_case
from tests.faults.real_team import draw_real_case
from tests.faults.shrinking import shrink

FOLDER: Final = Path("runs/chaos")

COLLECTED_AFTER: Final = (50_000, 20, 100)
"""Thresholds of the garbage collector: a mission makes little garbage in cycles, and to look for it takes an eighth."""

DRAW: Final = {"light": draw_case, "ranged": draw_ranged_case, "real": draw_real_case}


@dataclass(frozen=True)
class Result:
    """What came of a mission, as far as it is added up."""

    kind: str
    seed: int
    broken: str
    peers: int
    virtual_s: float
    cpu_s: float
    published: int
    faults: tuple[str, ...]
    led_after_s: float
    planned_after_s: float
    went_back: int


def run_one(what: tuple[str, int]) -> Result:
    """Run the mission of a kind and a seed."""
    kind, seed = what
    case: ChaosCase = DRAW[kind](seed)
    begun_s = time.process_time()
    verdict = run_chaos(case, keep=False)
    return Result(
        kind, seed, "" if verdict.broken is None else str(verdict.broken), case.robots + 2, verdict.ended_s,
        time.process_time() - begun_s, verdict.published, tuple(fault.kind for fault in case.faults),
        verdict.led_after_s, verdict.planned_after_s, verdict.went_back,
    )  # fmt: skip


def run_all(work: Sequence[tuple[str, int]], processes: int) -> list[Result]:
    """Run missions in several processes; say now and then how far it is."""
    results: list[Result] = []
    shown_s = time.monotonic()
    context = get_context("spawn")
    with ProcessPoolExecutor(processes, context, initializer=gc.set_threshold, initargs=COLLECTED_AFTER) as pool:
        for result in pool.map(run_one, work, chunksize=4):
            results.append(result)
            if result.broken:
                print(f"{result.kind} mission {result.seed}: BROKEN: {result.broken}", flush=True)
            if time.monotonic() - shown_s > 10.0:
                shown_s = time.monotonic()
                print(f"{len(results)} of {len(work)} missions", file=sys.stderr, flush=True)
    return results


def explain(kind: str, seed: int) -> None:
    """Shrink a mission that breaks a rule; print it and its history, and keep it."""
    case = shrink(DRAW[kind](seed), lambda smaller: run_chaos(smaller, keep=False))
    FOLDER.mkdir(parents=True, exist_ok=True)
    file = FOLDER / f"{kind}-{seed}.toml"
    file.write_text(write_case(case), encoding="utf-8")
    print(f"\n{kind} mission {seed}, made small:\n\n{write_case(case)}\n{run_chaos(case).trace()}")
    print(f"again: python -m tests.campaigns.chaos --case {file}")


def report(results: Sequence[Result]) -> None:
    """Print the sums of one kind of missions."""
    kinds = Counter(kind for result in results for kind in result.faults)
    peers = Counter(result.peers for result in results)
    virtual_s, cpu_s = sum(result.virtual_s for result in results), sum(result.cpu_s for result in results)
    broken = sum(bool(result.broken) for result in results)
    print(
        f"{len(results)} {results[0].kind} missions of {min(peers)} to {max(peers)} peers, {virtual_s / 3600:.1f} h of "
        f"virtual time, {sum(kinds.values())} faults, {sum(result.published for result in results)} messages: "
        f"{broken} broken"
    )
    print("  faults: " + ", ".join(f"{count} {kind}" for kind, count in kinds.most_common()))
    print(f"  robots that nobody led went back in {sum(result.went_back > 0 for result in results)} missions")
    print(f"  CPU: {cpu_s / len(results):.2f} s a mission, {virtual_s / cpu_s:.0f} times faster than real time")
    for what, times in (
        ("led", [result.led_after_s for result in results]),
        ("planned", [result.planned_after_s for result in results]),
    ):
        known = sorted(time_s for time_s in times if math.isfinite(time_s))
        if known:
            print(
                f"  {what} after the last fault: median {known[len(known) // 2]:.2f} s, "
                f"99 % {known[int(0.99 * len(known))]:.2f} s, worst {known[-1]:.2f} s ({len(known)} missions)"
            )


def main() -> int:
    """Run the missions, or one case; 1 if a rule was broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--missions", type=int, default=1000, help="with the light planner")
    parser.add_argument("--ranged", type=int, default=0, help="the same where ranges alone tell where the agent is")
    parser.add_argument("--real", type=int, default=0, help="missions with the full planner on packaged maps")
    parser.add_argument("--seed", type=int, default=0, help="of the first mission")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--case", type=Path, help="run the mission of this file, and print its history")
    options = parser.parse_args()
    if options.case is not None:
        verdict = run_chaos(read_case(options.case.read_text(encoding="utf-8")))
        print(verdict.trace(last=10_000))
        return int(verdict.broken is not None)
    begun_s = time.monotonic()
    broken: list[Result] = []
    for kind, count in (("light", options.missions), ("ranged", options.ranged), ("real", options.real)):
        if count:
            results = run_all([(kind, seed) for seed in range(options.seed, options.seed + count)], options.processes)
            report(results)
            broken += [result for result in results if result.broken]
    print(f"in {(time.monotonic() - begun_s) / 60:.1f} minutes")
    for result in broken[:3]:
        explain(result.kind, result.seed)
    return int(bool(broken))


if __name__ == "__main__":
    sys.exit(main())
