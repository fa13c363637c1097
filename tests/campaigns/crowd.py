"""Campaign: up to twenty real peers at 10 Hz on this machine: what they cost, and how late they hear each other.

    python -m tests.campaigns.crowd --robots 3 8 13 18 --seconds 30

Starts `sightline run` for each size and listens as an operator does; prints a table. Latency is from when a peer put
the time of its clock into an envelope until the bus delivers it in the process that listens: of messages, and of the
clocks of one machine. Processor time is read from /proc, of the peers without the launcher; so is what else the machine
did meanwhile, launcher and listener included, for figures from a busy machine say little.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Final

import msgspec
import numpy as np

from agents.mission import Mission
from protocol.bus import BusEvent, Received
from protocol.messages import decode
from protocol.zenoh_bus import ZenohBus

ROOT: Final = Path(__file__).parents[2]
PATIENCE_S: Final = 180.0

SCENARIO: Final = """
name = "crowd"
map = "hall.json"
duration_s = 600
[base]
position = [1.0, 1.0]
[agent]
start = [3.0, 10.0]
behaviour = "wander"
speed_m_s = 0.7
[robots]
count = {robots}
"""
HALL: Final = {
    "name": "hall", "units": "metres", "outer": [[0, 0], [30, 0], [30, 12], [0, 12]],
    "holes": [[[8, 4], [9, 4], [9, 8], [8, 8]], [[16, 4], [17, 4], [17, 8], [16, 8]]],
}  # fmt: skip


TITLES: Final = (
    "peers", "up after, s", "cores, all", "% of one, each", "the leader's", "in zenoh's threads, %", "messages/s",
    "p50, ms", "p99, ms", "said where it is, /s", "cores, others",
)  # fmt: skip

ZENOH_THREADS: Final = re.compile(r"(rx|tx|acc|net|app)-[0-9]+")


def processor_s(process: int) -> tuple[float, float]:
    """Processor time that a process has had, and its zenoh threads of that, seconds."""
    total_s = zenoh_s = 0.0
    for task in Path(f"/proc/{process}/task").iterdir():
        used_s = 1e-9 * int((task / "schedstat").read_text().split()[0])
        total_s += used_s
        if ZENOH_THREADS.fullmatch((task / "comm").read_text(errors="replace").strip()):
            zenoh_s += used_s
    return total_s, zenoh_s


def busy_s() -> float:
    """Time that all cores have been busy since the machine began, seconds."""
    user, nice, system, _, _, irq, soft, *_ = map(int, Path("/proc/stat").read_text().split("\n")[0].split()[1:])
    return (user + nice + system + irq + soft) / os.sysconf("SC_CLK_TCK")


def measure(folder: Path, robots: int, seconds: float) -> tuple[str, str]:
    """A row of the table, and a sentence: about a team of so many robots, with base station and agent."""
    (folder / "hall.json").write_text(json.dumps(HALL))
    (folder / "crowd.toml").write_text(SCENARIO.format(robots=robots))
    output = folder / "output.txt"
    with output.open("wb") as stream:
        launcher = subprocess.Popen(
            [sys.executable, "-m", "launcher.cli", "run", "crowd.toml", "--name", "crowd"],
            cwd=folder, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=stream, stderr=subprocess.STDOUT,
        )  # fmt: skip
    began_s = time.monotonic()
    try:
        deadline_s = began_s + PATIENCE_S
        while "First deployment obeyed" not in output.read_text():
            if launcher.poll() is not None or time.monotonic() > deadline_s:
                raise RuntimeError(f"the team did not come up:\n{output.read_text()}")
            time.sleep(0.2)
        up_after_s = time.monotonic() - began_s
        mission = msgspec.json.decode((folder / "runs/crowd/mission.json").read_bytes(), type=Mission)
        heard: list[tuple[float, bytes]] = []

        def hear(event: BusEvent) -> None:
            if isinstance(event, Received):
                heard.append((time.time(), event.payload))

        endpoints = [entry.endpoint for entry in mission.roster]
        bus = ZenohBus.open(mission.team, "crowd_watch", None, endpoints, hear, operator=True)
        try:
            time.sleep(3.0)  # until all links are there
            children = Path(f"/proc/{launcher.pid}/task/{launcher.pid}/children").read_text().split()
            names = {int(child): Path(f"/proc/{child}/comm").read_text().strip() for child in children}
            peers = [pid for pid, name in names.items() if name in {entry.name for entry in mission.roster}]
            before, busy_before_s = {pid: processor_s(pid) for pid in peers}, busy_s()
            heard.clear()
            began_s = time.monotonic()
            time.sleep(seconds)
            took_s, others_s = time.monotonic() - began_s, busy_s() - busy_before_s
            used_s, zenoh_s = np.transpose([np.subtract(processor_s(pid), before[pid]) for pid in peers]) / took_s
        finally:
            bus.close()
    finally:
        launcher.terminate()
        launcher.wait()
    late: list[float] = []
    kinds: Counter[str] = Counter()
    states: Counter[str] = Counter()
    for at_s, payload in heard:
        envelope = decode(payload)
        late.append(1e3 * (at_s - envelope.sent_at_s))
        kinds[envelope.kind] += 1
        states[envelope.sender] += envelope.kind in ("state", "intent")
    p50, p99 = np.percentile(late, [50.0, 99.0])
    rates = np.array([states[entry.name] for entry in mission.roster]) / took_s
    row = (
        f"{len(peers)}", f"{up_after_s:.0f}", f"{used_s.sum():.2f}", f"{100 * np.median(used_s):.1f}",
        f"{100 * used_s.max():.1f}", f"{100 * zenoh_s.sum() / used_s.sum():.0f}", f"{len(heard) / took_s:.0f}",
        f"{p50:.1f}", f"{p99:.1f}", f"{rates.min():.1f}–{rates.max():.1f}", f"{others_s / took_s - used_s.sum():.2f}",
    )  # fmt: skip
    said = ", ".join(f"{kind} {count / took_s:.1f}" for kind, count in kinds.most_common())
    return "| " + " | ".join(row) + " |", f"{len(peers)} peers, messages a second: {said}"


def main() -> None:
    """Measure each size once."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, nargs="+", default=[3, 8, 13, 18])
    parser.add_argument("--seconds", type=float, default=30.0)
    options = parser.parse_args()
    print("| " + " | ".join(TITLES) + " |\n" + "|---" * len(TITLES) + "|")
    notes = []
    for robots in options.robots:
        with tempfile.TemporaryDirectory() as folder:
            row, note = measure(Path(folder), robots, options.seconds)
        print(row, flush=True)
        notes.append(note)
    print("\n" + "\n".join(notes))


if __name__ == "__main__":
    main()
