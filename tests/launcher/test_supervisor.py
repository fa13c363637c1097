"""Supervision of stand-in processes: restarts within bounds, logs, and ends in time whatever a process does."""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from agents.mission import Mission
from launcher import supervisor as supervision
from launcher.supervisor import Peer, Supervisor

pytestmark = pytest.mark.processes

SLEEPS = "import time; print('up', flush=True); time.sleep(60)"
STUBBORN = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('up', flush=True); time.sleep(60)"


class Rehearsal(Supervisor):
    """Starts small programs instead of peers: ``scripts`` by name; all others sleep."""

    scripts: dict[str, str]

    def command(self, peer: Peer) -> list[str]:
        return [sys.executable, "-c", self.scripts.get(peer.name, SLEEPS), *super().command(peer)]


@pytest.fixture
def rehearse(mission: Mission, tmp_path: Path) -> Callable[[dict[str, str]], tuple[Rehearsal, list[str]]]:
    def make(scripts: dict[str, str]) -> tuple[Rehearsal, list[str]]:
        said: list[str] = []
        team = Rehearsal(mission, tmp_path, said.append, lambda _: (1.5, -2.5))
        team.scripts = scripts
        return team, said

    return make


async def until(condition: Callable[[], bool]) -> None:
    while not condition():
        await asyncio.sleep(0.02)


def exists(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def logged(folder: Path, name: str) -> list[str]:
    file = folder / "logs" / f"{name}.log"
    return file.read_text().splitlines() if file.exists() else []


def test_what_crashes_is_restarted_with_the_next_incarnation_until_it_is_given_up(
    rehearse: Callable[[dict[str, str]], tuple[Rehearsal, list[str]]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervision, "BACKOFF_S", 0.01)
    team, said = rehearse({"robot1": "import sys; print(' '.join(sys.argv[-5:])); sys.exit(3)"})

    async def play() -> None:
        await team.start()
        await until(lambda: team.peers["robot1"].given_up)
        assert all(team.peers[name].running for name in ("base", "agent", "robot2"))
        await team.stop()

    asyncio.run(play())
    lines = logged(tmp_path, "robot1")
    assert len(lines) == 1 + supervision.RESTARTS
    assert [line.partition(" | ")[0] for line in lines] == [f"robot1.{n}" for n in range(1 + supervision.RESTARTS)]
    assert "--position" not in lines[0]
    assert all(line.endswith("--position=1.5,-2.5") for line in lines[1:])
    assert said[0] == "robot1 ended with status 3; restarting it (1 of 3)"
    assert len(said) == 1 + supervision.RESTARTS
    assert "given up" in said[-1]
    assert "robot1.log" in said[-1]


def test_a_killed_process_is_named_with_its_signal_and_comes_back(
    rehearse: Callable[[dict[str, str]], tuple[Rehearsal, list[str]]], tmp_path: Path
) -> None:
    team, said = rehearse({})

    async def play() -> None:
        await team.start()
        await until(lambda: bool(logged(tmp_path, "robot2")))
        process = team.peers["robot2"].process
        assert process is not None
        process.kill()
        await until(lambda: len(logged(tmp_path, "robot2")) == 2)
        await team.stop()

    asyncio.run(play())
    assert said == ["robot2 was killed by SIGKILL; restarting it (1 of 3)"]
    assert [peer.incarnation for peer in team.peers.values()] == [0, 0, 0, 1]


def test_stop_kills_what_does_not_want_to_end_and_says_so(
    rehearse: Callable[[dict[str, str]], tuple[Rehearsal, list[str]]], tmp_path: Path
) -> None:
    team, said = rehearse({"agent": STUBBORN})
    processes = []

    async def play() -> None:
        await team.start()
        processes.extend(peer.process for peer in team.peers.values() if peer.process is not None)
        await until(lambda: all(logged(tmp_path, name) for name in team.peers))
        await team.stop()

    asyncio.run(play())
    assert said == ["killed, because they did not end within 2 s: agent"]
    assert len(processes) == 4
    assert not any(exists(process.pid) for process in processes)


def test_a_stop_during_the_pause_before_a_restart_starts_nothing(
    rehearse: Callable[[dict[str, str]], tuple[Rehearsal, list[str]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervision, "BACKOFF_S", 30.0)
    team, said = rehearse({"robot1": "raise SystemExit(1)"})

    async def play() -> None:
        await team.start()
        await until(lambda: bool(said))
        await team.stop()

    asyncio.run(play())
    assert team.peers["robot1"].incarnation == 0
    assert len(said) == 1


def test_a_line_without_end_does_not_stop_the_log(
    rehearse: Callable[[dict[str, str]], tuple[Rehearsal, list[str]]], tmp_path: Path
) -> None:
    babble = "import sys, time; sys.stdout.write('x' * (3 << 20) + '\\nafter\\n'); sys.stdout.flush(); time.sleep(60)"
    team, _ = rehearse({"base": babble})

    async def play() -> None:
        await team.start()
        await until(lambda: any(line.endswith("after") for line in logged(tmp_path, "base")))
        await team.stop()

    asyncio.run(play())
