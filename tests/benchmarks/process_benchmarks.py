"""Whole processes, timed from outside: what a user waits for."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
import tempfile
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

TEAM = """
map = "office"
[base]
position = [1.5, 11.0]
[agent]
start = [4.5, 10.5]
[robots]
count = 4
"""


def cases() -> Iterator[tuple[str, float, Callable[[], object]]]:
    """Name, target in seconds, what to time."""
    folder = Path(tempfile.mkdtemp(prefix="sightline-bench-"))
    comb = folder / "comb.json"
    comb.write_text(json.dumps(_comb(vertices=200)), encoding="utf-8")

    def plan() -> None:
        subprocess.run(
            [sys.executable, "-m", "launcher.cli", "plan", str(comb), "--base", "1,1", "--agent", "47,1", "--json"],
            check=True,
            capture_output=True,
        )

    yield "sightline plan, 200 vertices, whole process", 2.0, plan

    (folder / "team.toml").write_text(TEAM, encoding="utf-8")

    def obey() -> float:
        command = [sys.executable, "-m", "launcher.cli", "run", "team.toml", "--duration", "3", "--name"]
        done = subprocess.run([*command, uuid.uuid4().hex], cwd=folder, check=True, capture_output=True, text=True)
        said = re.search(r"First deployment obeyed ([0-9.]+) s after the command", done.stdout)
        if said is None:
            raise RuntimeError(done.stdout)
        return float(said.group(1))

    yield "6 processes, command to first deployment obeyed", 6.0, obey


def _comb(vertices: int) -> dict[str, object]:
    """A corridor with niches: a rectilinear polygon with the given number of vertices, in metres."""
    niches = (vertices - 4) // 4
    ring = [[0.0, 0.0], [2.0 * niches + 2.0, 0.0], [2.0 * niches + 2.0, 3.0]]
    for niche in reversed(range(niches)):
        left, depth = 2.0 * niche + 1.0, 2.0 + math.fmod(0.37 * niche, 1.0)
        ring += [[left + 1.0, 3.0], [left + 1.0, 3.0 + depth], [left, 3.0 + depth], [left, 3.0]]
    ring.append([0.0, 3.0])
    return {"name": "comb", "units": "metres", "outer": ring, "holes": []}
