"""Peers that must not join as things are: each says why in one sentence and ends, and nobody starts it again."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest
from msgspec import structs

from agents.mission import Mission
from agents.runtime import WOULD_JOIN_WRONGLY
from protocol.messages import Reign
from protocol.promises import encode_promise
from protocol.zenoh_bus import free_endpoints
from tests.agents.conftest import make_mission

pytestmark = [pytest.mark.processes, pytest.mark.skipif(sys.platform != "linux", reason="forks, limits files")]

# One process that has imported everything, and a fork of it for each case.
FORKS = """
import json, os, resource, sys
from pathlib import Path
from agents.runtime import import_all
from launcher.processes import fork_peer
import_all()
ended = {}
for case in sys.argv[1:]:
    folder = Path(case)
    if folder.name == "full_disk":
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
    pid = fork_peer([str(folder / "mission.json"), "robot1"], folder / "log", None)
    ended[folder.name] = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
print(json.dumps(ended))
"""


def twice_on_the_roster(mission: Mission) -> bytes:
    return msgspec.json.encode(structs.replace(mission, roster=(*mission.roster, mission.entry("robot1"))))


def test_each_says_why_in_one_sentence_and_ends(tmp_path: Path) -> None:
    endpoints = free_endpoints(4)
    mission = make_mission()
    roster = tuple(structs.replace(entry, endpoint=to) for entry, to in zip(mission.roster, endpoints, strict=True))
    mission = structs.replace(mission, roster=roster)
    corner = {"name": "corner", "units": "metres", "outer": [[0, 0], [10, 0], [10, 5], [5, 5], [5, 10], [0, 10]]}
    reign = Reign(epoch=7, leader="base", incarnation=0)
    cases = {
        "twice": "the roster lists robot1 2 times",
        "other_team": "team",
        "full_disk": "cannot be written to (File too large)",
    }
    for name in cases:
        folder = tmp_path / name
        (folder / "promises").mkdir(parents=True)
        (folder / "corner.json").write_text(json.dumps(corner | {"holes": []}))
        (folder / "mission.json").write_bytes(
            twice_on_the_roster(mission) if name == "twice" else msgspec.json.encode(mission)
        )
    promise = encode_promise(reign, team="others", voter="robot1", incarnation=0)
    (tmp_path / "other_team" / "promises" / "robot1.json").write_bytes(promise)
    done = subprocess.run(
        [sys.executable, "-c", FORKS, *(str(tmp_path / name) for name in cases)],
        cwd=Path(__file__).parents[2], capture_output=True, text=True, timeout=50, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    said = {name: (tmp_path / name / "log").read_text().splitlines() for name in cases}
    assert json.loads(done.stdout) == dict.fromkeys(cases, WOULD_JOIN_WRONGLY), "\n".join(said["full_disk"])
    for name, words in cases.items():
        assert len(said[name]) == 2, said[name]  # the first names the process
        assert said[name][1].startswith("robot1 does not join: ")
        assert words in said[name][1]
        assert "Traceback" not in said[name][1]
