"""Campaign: real processes that lose their leader, a robot, or each other, many times; how long the team takes.

    make takeover
    python -m tests.campaigns.takeover --trials 20 --only kill pause

Runs `sightline run` with timetables of faults, several trials in each run, and reads everything from the recordings.
It prints a table, and ends with status 1 if a bound was missed or a rule was broken. What else the machine has to do
counts: it prints the load, and times from a busy machine say little.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Final

from msgspec import structs

from agents.records import AnyRecord, Decision, Ordered, Track
from launcher.fault_timetable import Fault, Kill, Loss, Partition, Pause, Timetable, write_timetable
from launcher.reigns import Reigns, find_reigns
from launcher.review import read_records
from launcher.run_folder import RunFolder

Records = list[tuple[float, str, AnyRecord]]

ROOT: Final = Path(__file__).parents[2]
BEGIN_S: Final = 8.0
"""Mission time of the first trial: the team has a leader and a deployment by then."""
TRIALS_IN_A_RUN: Final = 10

ROOMS: Final = {
    "name": "three rooms", "units": "metres", "holes": [],
    "outer": [[0, 0], [8, 0], [8, 2.5], [9, 2.5], [9, 0], [17, 0], [17, 2.5], [18, 2.5], [18, 0], [26, 0], [26, 6],
              [18, 6], [18, 3.5], [17, 3.5], [17, 6], [9, 6], [9, 3.5], [8, 3.5], [8, 6], [0, 6]],
}  # fmt: skip
SCENARIO: Final = """
name = "takeover"
map = "rooms.json"
duration_s = {duration_s}
seed = {seed}
[base]
position = [1.0, 1.0]
[agent]
start = [3.0, 3.0]
behaviour = "wander"
speed_m_s = 0.7
[robots]
count = 4
speed_m_s = 1.2
"""


@dataclass
class Outcome:
    """What came of the trials of one kind."""

    title: str
    median_s: float | None
    """The bound, as is the next; None: none."""
    worst_s: float | None
    took_s: list[float] = field(default_factory=list)
    void: int = 0
    """Trials in which what was to happen did not, e.g. the peer was down already."""
    missed: list[str] = field(default_factory=list)
    """What must not happen, and did."""

    def row(self) -> str:
        """Of the table."""
        bound = "–" if self.worst_s is None else f"{self.median_s:g} / {self.worst_s:g}"
        if not self.took_s:
            return f"| {self.title} | {bound} | 0 | – | – | – |"
        took = sorted(self.took_s)
        p90 = took[min(len(took) - 1, int(0.9 * len(took)))]
        return f"| {self.title} | {bound} | {len(took)} | {median(took):.2f} | {p90:.2f} | {took[-1]:.2f} |"

    @property
    def failures(self) -> list[str]:
        """What was missed, as sentences."""
        failures = [f"{self.title}: {text}" for text in self.missed]
        if self.worst_s is not None and self.median_s is not None and self.took_s:
            if median(self.took_s) > self.median_s:
                failures.append(
                    f"{self.title}: the median is {median(self.took_s):.2f} s, more than {self.median_s:g} s"
                )
            if max(self.took_s) > self.worst_s:
                failures.append(f"{self.title}: the worst is {max(self.took_s):.2f} s, more than {self.worst_s:g} s")
        if not self.took_s:
            failures.append(f"{self.title}: no trial")
        return failures


@dataclass(frozen=True)
class Run:
    """A run that is over."""

    records: Records
    reigns: Reigns
    metrics: dict[str, object]


def run(folder: Path, name: str, faults: Sequence[Fault], duration_s: float, seed: int) -> Run:
    """Have a team run with these faults, and read what it recorded."""
    (folder / "rooms.json").write_text(json.dumps(ROOMS))
    (folder / f"{name}.toml").write_text(SCENARIO.format(duration_s=duration_s, seed=seed))
    (folder / f"{name}-faults.toml").write_text(write_timetable(Timetable(faults=tuple(faults))))
    command = [sys.executable, "-m", "launcher.cli", "run", f"{name}.toml", "--chaos", f"{name}-faults.toml"]
    done = subprocess.run(
        [*command, "--name", name], cwd=folder, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    (folder / f"{name}.txt").write_text(done.stdout + done.stderr)
    if done.returncode not in (0, 1):
        raise RuntimeError(f"the run did not take place:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    files = RunFolder(folder / "runs" / name)
    records = read_records(files.recording)
    metrics = json.loads((files.path / "metrics.json").read_text())
    return Run(records, find_reigns(records, files.read_mission().epoch_unix_s), metrics)


def lose_leaders(outcome: Outcome, run_team: Callable[[Sequence[Fault], float], Run], trials: int) -> None:
    """The leader is killed; how long until all others obey a new one."""
    _take_over(outcome, run_team, [Kill(at_s=0.0, for_s=1.0, who="leader")] * trials, 11.0)


def hang_leaders(outcome: Outcome, run_team: Callable[[Sequence[Fault], float], Run], trials: int) -> None:
    """The leader is paused; how long until all others obey a new one. It goes on, and nobody may obey it again."""
    _take_over(outcome, run_team, [Pause(at_s=0.0, for_s=3.0, who="leader")] * trials, 7.0)


def _take_over(
    outcome: Outcome, run_team: Callable[[Sequence[Fault], float], Run], faults: Sequence[Fault], every_s: float
) -> None:
    done = run_team(_spread(faults, every_s), BEGIN_S + len(faults) * every_s)
    outcome.missed += done.reigns.broken
    for takeover in done.reigns.takeovers:
        if takeover.took_s is None:
            outcome.missed.append(f"nobody took over from {takeover.before} at {takeover.at_s:.2f} s")
        else:
            outcome.took_s.append(takeover.took_s)
    outcome.void += len(faults) - len(done.reigns.takeovers)


def lose_robots(outcome: Outcome, run_team: Callable[[Sequence[Fault], float], Run], trials: int) -> None:
    """A robot is killed; how long until the others have a motion without it."""
    robots = [f"robot{1 + trial % 4}" for trial in range(trials)]
    done = run_team(_spread([Kill(at_s=0.0, for_s=2.0, who=robot) for robot in robots], 11.0), BEGIN_S + 11.0 * trials)
    outcome.missed += done.reigns.broken
    for at_s, mishap in done.reigns.mishaps:
        if mishap.kind != "kill" or mishap.over:
            continue
        if mishap.text.startswith("nothing done"):
            outcome.void += 1
        else:
            re_formed_s = find_motion_without(done.records, mishap.who[0], at_s)
            if re_formed_s is None:
                outcome.missed.append(f"{mishap.text} at {at_s:.2f} s, and no motion without it")
            else:
                outcome.took_s.append(re_formed_s - at_s)


def find_motion_without(records: Records, robot: str, from_s: float) -> float | None:
    """When the first motion was ordered in which a robot has no part, though its body may be in the way."""
    for time_s, _, record in records:
        if not isinstance(record, Ordered) or time_s < from_s:
            continue
        if all(way.member != robot or not way.scheduled for way in record.motion.ways):
            return time_s
    return None


def part_teams(outcome: Outcome, run_team: Callable[[Sequence[Fault], float], Run], trials: int) -> None:
    """Two of five voters are cut off; they must hold, and after the cut all must obey one leader."""
    pairs = [("base", "robot1"), ("robot2", "robot3"), ("robot1", "robot4"), ("base", "robot2")]
    faults = [Partition(at_s=0.0, for_s=4.0, group=pairs[trial % 4]) for trial in range(trials)]
    done = run_team(_spread(faults, 9.0), BEGIN_S + 9.0 * trials)
    outcome.missed += done.reigns.broken
    voters = {spell.peer for spell in done.reigns.obeyed}
    begun_s = 0.0
    for at_s, mishap in done.reigns.mishaps:
        if not mishap.over:
            begun_s = at_s
            continue
        for spell in done.reigns.obeyed:
            if spell.peer in mishap.who and spell.from_s < at_s and spell.until_s > begun_s + 1.2:
                outcome.missed.append(f"{spell.peer} obeyed {spell.leader} while cut off, at {spell.until_s:.2f} s")
        outcome.missed += _moves(done.records, mishap.who, begun_s + 1.5, at_s)
        moments_s = [at_s, *(spell.from_s for spell in done.reigns.obeyed if spell.from_s > at_s)]
        for moment_s in moments_s:
            obeying = [spell for spell in done.reigns.obeyed if spell.from_s <= moment_s < spell.until_s]
            if {spell.peer for spell in obeying} == voters and len({spell.epoch for spell in obeying}) == 1:
                outcome.took_s.append(moment_s - at_s)
                break
        else:
            outcome.missed.append(f"not all obeyed one leader after the cut that ended at {at_s:.2f} s")


def _moves(records: Records, peers: Sequence[str], from_s: float, until_s: float) -> list[str]:
    """Who moved in that time, of these."""
    moved = []
    for peer in peers:
        places = [
            record.position
            for time_s, name, record in records
            if name == peer and isinstance(record, Track) and from_s <= time_s < until_s
        ]
        if places and max(abs(x - places[0][0]) + abs(y - places[0][1]) for x, y in places) > 0.02:
            moved.append(f"{peer} moved while cut off, between {from_s:.2f} s and {until_s:.2f} s")
    return moved


def lose_messages(run_team: Callable[[Sequence[Fault], float], Run]) -> list[str]:
    """30 % of all messages are lost for a minute: what went wrong."""
    done = run_team([Loss(at_s=BEGIN_S, share=0.3)], BEGIN_S + 60.0)
    since = done.metrics["since_first_deployment"]
    decisions = sum(isinstance(record, Decision) for time_s, _, record in done.records if time_s > BEGIN_S)
    reigns = [spell for spell in done.reigns.led if spell.from_s > BEGIN_S]
    print(
        f"\n30 % loss on every link for 60 s: {decisions} decisions, {len(reigns)} changes of leader; shares of time "
        f"since the first deployment: {since}"
    )
    print(f"failures of the run: {done.metrics['failures'] or 'none'}")
    failures = [f"30 % loss: {text}" for text in (*done.reigns.broken, *done.metrics["failures"])]  # type: ignore[misc]
    if not decisions:
        failures.append("30 % loss: the mission did not go on")
    return failures


def _spread(faults: Sequence[Fault], every_s: float) -> list[Fault]:
    """One after the other."""
    return [structs.replace(fault, at_s=BEGIN_S + place * every_s) for place, fault in enumerate(faults)]


KINDS: Final = {
    "kill": (lose_leaders, Outcome("leader killed → a new one obeyed by all others", 1.2, 2.0)),
    "pause": (hang_leaders, Outcome("leader paused → a new one obeyed by all others", 1.5, 2.5)),
    "robot": (lose_robots, Outcome("robot killed → the others ordered on without it", None, None)),
    "partition": (part_teams, Outcome("2 of 5 cut off, link back → one leader obeyed by all", 3.0, 3.0)),
}


def main() -> int:
    """Run the trials, print the table; 1 if a bound was missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=20, help="of each kind")
    parser.add_argument("--only", nargs="+", choices=[*KINDS, "loss"], default=[*KINDS, "loss"])
    parser.add_argument("--seed", type=int, default=1, help="of the first scenario; the processes go their own ways")
    parser.add_argument("--keep", type=Path, help="folder for the runs; else they are removed")
    options = parser.parse_args()
    failures: list[str] = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.keep or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        runs = 0

        def run_team(faults: Sequence[Fault], duration_s: float) -> Run:
            nonlocal runs
            runs += 1
            print(f"{time.strftime('%H:%M:%S')} a run of {duration_s:.0f} s, {len(faults)} faults", file=sys.stderr)
            return run(folder, f"trial{options.seed}-{runs}", faults, duration_s, options.seed + runs)

        outcomes = []
        for kind, (trial, outcome) in KINDS.items():
            if kind in options.only:
                left = options.trials
                while left > 0:
                    trial(outcome, run_team, min(left, TRIALS_IN_A_RUN))
                    left -= TRIALS_IN_A_RUN
                outcomes.append(outcome)
        if outcomes:
            print("| what | bound, s: median / worst | trials | median, s | 90 %, s | worst, s |\n" + "|---" * 6 + "|")
        for outcome in outcomes:
            print(outcome.row())
            failures += outcome.failures
        if "loss" in options.only:
            failures += lose_messages(run_team)
    print(f"load of the machine at the end: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    for failure in failures:
        print(failure)
    return int(bool(failures))


if __name__ == "__main__":
    sys.exit(main())
