"""``sightline run`` and ``goal`` as a user has them: real processes, one run for most of what there is to check."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from typer.testing import CliRunner

from launcher.cli import app
from launcher.fork_server import NAME as FORKS
from launcher.supervisor import TERMINATE_S

pytestmark = [pytest.mark.processes, pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc")]

SIGHTLINE = Path(sys.executable).with_name("sightline")
EXAMPLE = Path(__file__).parents[2] / "examples" / "watch_and_send_goal.py"
PATIENCE_S = 45.0
"""How long a test waits for what has to come; generous, since nothing is measured by it."""

ROOMS = """{"name": "two rooms", "units": "metres", "holes": [], "outer": [
    [0, 0], [8, 0], [8, 2.5], [9, 2.5], [9, 0], [17, 0], [17, 6], [9, 6], [9, 3.5], [8, 3.5], [8, 6], [0, 6]]}"""
SCENARIO = """
map = "rooms.json"
duration_s = 300
[base]
position = [1.0, 1.0]
[agent]
start = [3, 3]
behaviour = "goals"
speed_m_s = 1.5
[robots]
count = 2
speed_m_s = 2.0
"""


def processes_of(folder: Path) -> dict[str, int]:
    """Peers of the run in a folder that have a process, and its id; the process that forks them again, too."""
    found = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                name = (entry / "comm").read_text().strip()
                working = (entry / "cwd").readlink()
            except OSError:
                continue
            if working == folder and name != "sightline":
                found[name] = int(entry.name)
    return found


def wait_for(condition: Callable[[], object], what: str, patience_s: float = PATIENCE_S) -> None:
    deadline = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < deadline, f"waited {patience_s:g} s for {what}"
        time.sleep(0.05)


@dataclass
class Run:
    """A ``sightline run`` in a folder of its own."""

    folder: Path
    launcher: subprocess.Popen[bytes]

    @property
    def output(self) -> str:
        return (self.folder / "output.txt").read_text()

    @property
    def files(self) -> Path:
        return self.folder / "runs" / "trial"

    def says(self, text: str) -> None:
        def said() -> bool:
            assert self.launcher.poll() is None or text in self.output, self.output
            return text in self.output

        wait_for(said, f"'{text}' in the output:\n{self.output}")

    def sightline(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [SIGHTLINE, *arguments], cwd=self.folder, capture_output=True, text=True, timeout=PATIENCE_S, check=False
        )


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[[], Run]]:
    started: list[Run] = []

    def start_run() -> Run:
        (tmp_path / "rooms.json").write_text(ROOMS)
        (tmp_path / "trial.toml").write_text(SCENARIO)
        with (tmp_path / "output.txt").open("wb") as output:
            launcher = subprocess.Popen(
                [SIGHTLINE, "run", "trial.toml", "--name", "trial"],
                cwd=tmp_path,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        started.append(Run(tmp_path, launcher))
        return started[-1]

    yield start_run
    for run in started:
        if run.launcher.poll() is None:
            run.launcher.kill()
        run.launcher.wait()
        wait_for(lambda: not processes_of(tmp_path), "all processes to end")


def test_a_run_from_start_to_recording(start: Callable[[], Run], monkeypatch: pytest.MonkeyPatch) -> None:
    run = start()
    run.says("First deployment obeyed")
    peers = processes_of(run.folder)
    assert set(peers) == {"base", "agent", "robot1", "robot2", FORKS}
    held = [str(entry.readlink()) for entry in Path(f"/proc/{peers[FORKS]}/fd").iterdir()]
    network = {line.split()[9] for line in Path("/proc/net/tcp").read_text().splitlines()[1:]}
    assert not network & {name.removeprefix("socket:[").rstrip("]") for name in held}, held
    assert not any("logs" in name or "recordings" in name or "output.txt" in name for name in held), held

    refused = run.sightline("goal", "8.5,5")
    assert refused.returncode == 2
    assert refused.stderr.startswith("sightline: the agent refuses 8.5,5")
    example = subprocess.run(
        [sys.executable, EXAMPLE, "--mission", "runs/trial/mission.json", "--goal", "7,5", "--seconds", "2"],
        cwd=run.folder,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert example.returncode == 0, example.stdout + example.stderr
    accepted = run.sightline("goal", "14,5", "--run", "runs/trial")
    assert (accepted.returncode, accepted.stderr) == (0, "")
    assert "14, 5" in accepted.stdout

    # The leader, mostly the base station, is killed for good from another terminal; another one leads; it is replaced.
    killed = run.sightline("fault", "runs/trial", "kill", "leader")
    leader = killed.stdout.partition(" ")[0]
    assert leader in ("base", "robot1", "robot2"), killed.stderr
    assert (killed.returncode, killed.stdout) == (0, f"{leader} is killed.\n")
    run.says(f"{leader} is killed")
    since = run.output.index(f"{leader} is killed")
    wait_for(lambda: re.search(rf"(base|robot1|robot2)(?<!{leader}) leads", run.output[since:]), "another to lead")
    started = run.sightline("fault", "trial", "start", leader)
    assert (started.returncode, started.stdout) == (0, f"{leader} is started.\n"), started.stderr
    run.says(f"{leader} is started again")
    wait_for((run.files / "recordings" / f"{leader}.1.rrd").is_file, "a recording of the new process")
    again = processes_of(run.folder)[leader]
    assert again != peers[leader]
    command = Path(f"/proc/{run.launcher.pid}/cmdline").read_bytes()
    assert Path(f"/proc/{again}/cmdline").read_bytes() == command, "it is a fork"

    run.says("agent to 14.0, 5.0")
    time.sleep(3.0)  # the agent walks, and the rest of the team with it

    run.launcher.send_signal(signal.SIGINT)
    wait_for(lambda: not processes_of(run.folder), "all peers to end")
    assert TERMINATE_S <= 2.0, "all are gone 3 s after Ctrl-C: this long for an orderly end, then SIGKILL"
    assert run.launcher.wait(PATIENCE_S) == 130, run.output
    assert "share of time" in run.output
    assert "Traceback" not in run.output
    for file in ("run.rrd", "mission.json", "scenario.toml", "map.json", "versions.json", "metrics.json"):
        assert (run.files / file).stat().st_size > 0, file
    metrics = json.loads((run.files / "metrics.json").read_text())
    assert metrics["robots"] == 2
    takeover = metrics["takeovers"][0]
    assert (takeover["before"], takeover["what"]) == (leader, f"{leader} is killed")
    assert takeover["after"] in {"base", "robot1", "robot2"} - {leader}
    assert metrics["leading_faults"] == []
    assert "one leader at a time" in run.output
    assert metrics["since_first_deployment"]["agent_visible"] > 0.3
    assert metrics["agent_distance_m"] > 1.0
    for log in (run.files / "logs").glob("*.log"):
        assert "Traceback" not in log.read_text(), log.read_text()

    monkeypatch.chdir(run.folder)
    reviewed = CliRunner().invoke(app, ["review", "--json"])
    assert reviewed.exit_code == 0, reviewed.output
    assert json.loads(reviewed.stdout)["whole_run"] == metrics["whole_run"]
    nobody = CliRunner().invoke(app, ["goal", "1,1"])
    assert nobody.exit_code == 2
    assert "does not run" in nobody.stderr


SIGNALLED = """
import os, signal, sys
from launcher.cli import app
from launcher.fork_server import NAME as FORKS
from launcher.supervisor import TERMINATE_S
from launcher.supervisor import Supervisor
launch = Supervisor.launch
def signal_and_launch(self):
    os.kill(os.getpid(), signal.SIGTERM)  # as soon as there is something to stop, at the earliest
    launch(self)
Supervisor.launch = signal_and_launch
app(["run", "trial.toml", "--name", "trial"])
"""


def test_a_signal_during_the_start_stops_the_team_in_order(tmp_path: Path) -> None:
    (tmp_path / "rooms.json").write_text(ROOMS)
    (tmp_path / "trial.toml").write_text(SCENARIO)
    ended = subprocess.run(
        [sys.executable, "-c", SIGNALLED], cwd=tmp_path, capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert ended.returncode == 130, ended.stdout + ended.stderr
    assert "Stopping ..." in ended.stdout
    assert "killed" not in ended.stdout
    assert "Traceback" not in ended.stdout + ended.stderr
    assert not processes_of(tmp_path)


def test_what_cannot_run_starts_nothing_and_a_killed_launcher_leaves_nothing(start: Callable[[], Run]) -> None:
    run = start()
    wait_for(lambda: len(processes_of(run.folder)) == 5, "four peers, and what forks them again")
    again = run.sightline("run", "trial.toml", "--name", "trial")
    assert again.returncode == 2
    assert "runs/trial exists" in again.stderr
    (run.folder / "faulty.toml").write_text(SCENARIO.replace("[1.0, 1.0]", "[8.5, 1]"))
    failed = run.sightline("run", "faulty.toml")
    assert failed.returncode == 2
    assert failed.stderr.count("\n") == 1
    assert "base.position [8.5, 1] is inside a wall" in failed.stderr
    assert [folder.name for folder in (run.folder / "runs").iterdir() if not folder.is_symlink()] == ["trial"]
    peers = processes_of(run.folder)
    assert len(peers) == 5

    os.kill(peers["robot1"], signal.SIGKILL)
    run.says("robot1 was killed by SIGKILL; restarting it (1 of 3)")
    wait_for((run.files / "recordings" / "robot1.1.rrd").is_file, "another process of robot1")
    peers = processes_of(run.folder)
    for name in ("robot1", "robot2"):  # one of the second process' forks, and one of the launcher's
        os.kill(peers[name], signal.SIGSTOP)  # signals that can wait are not delivered to it any more
    run.launcher.kill()
    wait_for(lambda: not processes_of(run.folder), "all peers to end")
