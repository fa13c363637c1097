"""Campaign: twenty real peers at 10 Hz on this machine: what they cost, and how late they hear each other.

    python -m tests.campaigns.crowd --robots 18 --seconds 30

Starts `sightline run` and listens as an operator does. Latency is from when a peer put the time of its clock into an
envelope until zenoh calls back in the process that listens: of messages, and of the clocks of one machine. Processor
time is read from /proc, of the peers without the launcher.
"""

from __future__ import annotations

import argparse
import json
import os
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


def processor_s(pids: list[int]) -> float:
    """Processor time that processes have had, seconds."""
    ticks = 0
    for pid in pids:
        fields = Path(f"/proc/{pid}/stat").read_text(errors="replace").rpartition(")")[2].split()
        ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def measure(folder: Path, robots: int, seconds: float) -> str:
    """A sentence or two about a team of so many robots, with base station and agent."""
    (folder / "hall.json").write_text(json.dumps(HALL))
    (folder / "crowd.toml").write_text(SCENARIO.format(robots=robots))
    output = folder / "output.txt"
    with output.open("wb") as stream:
        launcher = subprocess.Popen(
            [sys.executable, "-m", "launcher.cli", "run", "crowd.toml", "--name", "crowd"],
            cwd=folder, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=stream, stderr=subprocess.STDOUT,
        )  # fmt: skip
    try:
        deadline_s = time.monotonic() + PATIENCE_S
        while "First deployment obeyed" not in output.read_text():
            if launcher.poll() is not None or time.monotonic() > deadline_s:
                raise RuntimeError(f"the team did not come up:\n{output.read_text()}")
            time.sleep(0.2)
        mission = msgspec.json.decode((folder / "runs/crowd/mission.json").read_bytes(), type=Mission)
        heard: list[tuple[float, bytes]] = []

        def hear(event: BusEvent) -> None:
            if isinstance(event, Received):
                heard.append((time.time(), event.payload))

        endpoints = [entry.endpoint for entry in mission.roster]
        bus = ZenohBus.open(mission.team, "crowd_watch", None, endpoints, hear, operator=True)
        try:
            time.sleep(3.0)  # until all links are there
            pids = [int(pid) for pid in Path(f"/proc/{launcher.pid}/task/{launcher.pid}/children").read_text().split()]
            began_s, used_s = time.monotonic(), processor_s(pids)
            heard.clear()
            time.sleep(seconds)
            took_s, used_s = time.monotonic() - began_s, processor_s(pids) - used_s
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
    p50, p99, worst = np.percentile(late, [50.0, 99.0, 100.0])
    rates = np.array([states[entry.name] for entry in mission.roster]) / took_s
    kinds_text = ", ".join(f"{kind} {count / took_s:.0f}" for kind, count in kinds.most_common())
    return (
        f"{len(pids)} peers at {mission.control_hz:g} Hz for {took_s:.0f} s: {100 * used_s / took_s:.0f} % of one core "
        f"in all, {100 * used_s / took_s / len(pids):.1f} % each; {len(heard) / took_s:.0f} messages a second "
        f"({kinds_text}); latency p50 {p50:.1f} ms, p99 {p99:.1f} ms, worst {worst:.0f} ms; each said where it is "
        f"{rates.min():.1f} to {rates.max():.1f} times a second; load of the machine {os.getloadavg()[0]:.1f} on "
        f"{os.cpu_count()} cores"
    )


def main() -> None:
    """Measure once, print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=18)
    parser.add_argument("--seconds", type=float, default=30.0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        print(measure(Path(folder), options.robots, options.seconds))


if __name__ == "__main__":
    main()
