"""Supervision of stand-in processes: restarts within bounds, logs, and ends in time whatever a process does."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from agents.leader import DeploymentPlanner
from agents.mission import Mission
from agents.runtime import WOULD_JOIN_WRONGLY
from agents.voter_file import VoterFile
from launcher import fork_server
from launcher import supervisor as supervision
from launcher.fork_server import ForkServer, ServerGone
from launcher.processes import spawn, wait_for_end
from launcher.supervisor import Peer, Supervisor
from planning.environment import Environment

pytestmark = pytest.mark.processes

ROOM = Environment([(0, 0), (4, 0), (4, 4), (0, 4)])
SLEEPS = "import time; print('up', flush=True); time.sleep(60)"
STUBBORN = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('up', flush=True); time.sleep(60)"


class Rehearsal(Supervisor):
    """Starts small programs instead of peers: ``scripts`` by name; all others sleep."""

    scripts: dict[str, str]

    def start_process(self, peer: Peer) -> int:
        script = self.scripts.get(peer.name, SLEEPS)
        return spawn([sys.executable, "-c", script, str(peer.incarnation)], self.log(peer))


@pytest.fixture
def rehearse(mission: Mission, tmp_path: Path) -> Callable[[dict[str, str]], tuple[Rehearsal, list[str]]]:
    def make(scripts: dict[str, str]) -> tuple[Rehearsal, list[str]]:
        said: list[str] = []
        planner = DeploymentPlanner(ROOM, (1.0, 1.0), 0.2, "inflection")
        team = Rehearsal(
            mission,
            tmp_path,
            planner,
            said.append,
            lambda _, text: said.append(text),
            lambda _: (1.5, -2.5),
            lambda name: said.append(f"{name} again"),
        )
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
    return file.read_text().split("\n")[:-1] if file.exists() else []  # lines that are complete


def test_what_crashes_is_restarted_with_the_next_incarnation_until_it_is_given_up(
    rehearse: Callable[[dict[str, str]], tuple[Rehearsal, list[str]]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervision, "BACKOFF_S", 0.01)
    team, said = rehearse({"robot1": "import sys; print('incarnation', sys.argv[1]); sys.exit(3)"})

    async def play() -> None:
        team.launch()
        team.watch()
        await until(lambda: team.peers["robot1"].given_up)
        assert all(team.peers[name].pid is not None for name in ("base", "agent", "robot2"))
        await team.stop()

    asyncio.run(play())
    assert logged(tmp_path, "robot1") == [f"incarnation {n}" for n in range(1 + supervision.RESTARTS)]
    assert said[0] == "robot1 ended with status 3; restarting it (1 of 3)"
    assert len(said) == 1 + supervision.RESTARTS
    assert "given up" in said[-1]
    assert "robot1.log" in said[-1]


def test_who_must_not_join_is_given_up_at_once_and_its_sentence_is_passed_on(
    rehearse: Callable[[dict[str, str]], tuple[Rehearsal, list[str]]], tmp_path: Path
) -> None:
    refusal = f"import sys; print('robot1 does not join: its file is bad; mend it'); sys.exit({WOULD_JOIN_WRONGLY})"
    team, said = rehearse({"robot1": refusal})

    async def play() -> None:
        team.launch()
        team.watch()
        await until(lambda: team.peers["robot1"].given_up)
        await team.stop()

    asyncio.run(play())
    again = f"`sightline fault {tmp_path} start robot1`"
    assert said == [f"robot1 does not join: its file is bad; mend it; given up, until {again}"]
    assert team.peers["robot1"].incarnation == 0


def test_a_killed_process_is_named_with_its_signal_and_comes_back(
    rehearse: Callable[[dict[str, str]], tuple[Rehearsal, list[str]]], tmp_path: Path
) -> None:
    team, said = rehearse({})

    async def play() -> None:
        team.launch()
        team.watch()
        await until(lambda: bool(logged(tmp_path, "robot2")))
        pid = team.peers["robot2"].pid
        assert pid is not None
        os.kill(pid, signal.SIGKILL)
        await until(lambda: len(logged(tmp_path, "robot2")) == 2)
        await team.stop()

    asyncio.run(play())
    assert said == ["robot2 was killed by SIGKILL; restarting it (1 of 3)"]
    assert [peer.incarnation for peer in team.peers.values()] == [0, 0, 0, 1]


def test_stop_kills_what_does_not_want_to_end_and_says_so(
    rehearse: Callable[[dict[str, str]], tuple[Rehearsal, list[str]]], tmp_path: Path
) -> None:
    team, said = rehearse({"agent": STUBBORN})
    pids: list[int] = []

    async def play() -> None:
        team.launch()
        team.watch()
        pids.extend(peer.pid for peer in team.peers.values() if peer.pid is not None)
        await until(lambda: all(logged(tmp_path, name) for name in team.peers))
        await team.stop()

    asyncio.run(play())
    assert said == ["killed, because they did not end within 2 s: agent"]
    assert len(pids) == 4
    assert not any(exists(pid) for pid in pids)


def test_a_stop_during_the_pause_before_a_restart_starts_nothing(
    rehearse: Callable[[dict[str, str]], tuple[Rehearsal, list[str]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervision, "BACKOFF_S", 30.0)
    team, said = rehearse({"robot1": "raise SystemExit(1)"})

    async def play() -> None:
        team.launch()
        team.watch()
        await until(lambda: bool(said))
        await team.stop()

    asyncio.run(play())
    assert team.peers["robot1"].incarnation == 0
    assert len(said) == 1


def state_of(pid: int) -> str:
    """``T``: stopped."""
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]


def test_who_is_killed_on_purpose_comes_back_when_it_is_to_and_that_is_no_crash(
    rehearse: Callable[[dict[str, str]], tuple[Rehearsal, list[str]]], tmp_path: Path
) -> None:
    team, said = rehearse({"robot1": "import sys; print(sys.argv[1], flush=True); import time; time.sleep(60)"})
    promise = VoterFile(tmp_path, "robot1").path
    promise.parent.mkdir()
    promise.touch()

    async def play() -> None:
        team.launch()
        team.watch()
        for incarnation in range(supervision.RESTARTS + 2):
            await until(lambda: len(logged(tmp_path, "robot1")) > incarnation)  # noqa: B023
            assert team.kill("robot1", 0.01, lose_disk=incarnation == 1)
            assert promise.exists() == (incarnation < 2)
        assert team.kill("base", None)
        await until(lambda: team.peers["base"].pid is None)
        assert team.peers["base"].gone
        assert not team.kill("base", 1.0), "what has no process cannot be killed"
        assert not team.pause("base", 1.0)
        await until(lambda: len(logged(tmp_path, "robot1")) == supervision.RESTARTS + 3)
        await team.stop()

    asyncio.run(play())
    assert said == ["robot1 again"] * (supervision.RESTARTS + 2)
    assert not team.peers["robot1"].gone


def test_who_is_gone_is_started_again_when_somebody_wants_it_to_be_and_where(
    rehearse: Callable[[dict[str, str]], tuple[Rehearsal, list[str]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervision, "BACKOFF_S", 0.01)
    team, said = rehearse({"robot1": "import sys; sys.exit(3)"})
    places = []
    start_process = team.start_process

    def note(peer: Peer) -> int:
        places.append((peer.name, peer.incarnation, peer.place))
        return start_process(peer)

    async def play() -> None:
        team.launch()
        monkeypatch.setattr(team, "start_process", note)
        team.watch()
        assert not team.start("robot2"), "it has a process"
        assert team.kill("robot2", None)
        assert team.kill("base", 60.0)
        await until(lambda: team.peers["robot2"].pid is team.peers["base"].pid is None)
        assert [peer.name for peer in team.peers.values() if peer.gone] == ["robot2"], "base would come back"
        assert team.start("robot2", (2.5, 3.0))
        assert team.start("base")
        await until(lambda: None not in (team.peers["robot2"].pid, team.peers["base"].pid))
        assert not team.peers["robot2"].gone
        assert team.peers["robot2"].place is None, "that was for one process"
        await until(lambda: team.peers["robot1"].given_up)
        team.scripts = {}
        assert team.start("robot1")
        await until(lambda: team.peers["robot1"].pid is not None)
        assert not team.peers["robot1"].gone
        assert team.kill("robot1", None)
        await until(lambda: team.peers["robot1"].pid is None)
        await team.stop()

    asyncio.run(play())
    again = [place for place in places if place[0] != "robot1"]
    assert sorted(again) == [("base", 1, None), ("robot2", 1, (2.5, 3.0))]
    assert places[-1] == ("robot1", supervision.RESTARTS + 1, None)
    assert sorted(text for text in said if text.endswith("again")) == ["base again", "robot1 again", "robot2 again"]


def test_a_paused_peer_goes_on_by_itself_and_can_be_stopped_in_order(
    rehearse: Callable[[dict[str, str]], tuple[Rehearsal, list[str]]], tmp_path: Path
) -> None:
    team, said = rehearse({})

    async def play() -> None:
        team.launch()
        team.watch()
        await until(lambda: all(logged(tmp_path, name) for name in team.peers))
        brief, long = (team.peers[name].pid for name in ("robot1", "robot2"))
        assert brief is not None
        assert long is not None
        assert team.pause("robot1", 0.2)
        assert team.pause("robot2", 60.0)
        assert not team.pause("robot1", 60.0), "it is paused already"
        await until(lambda: state_of(brief) == state_of(long) == "T")
        await until(lambda: state_of(brief) != "T")
        assert state_of(long) == "T"
        await team.stop()

    asyncio.run(play())
    assert said == []


@pytest.fixture
def planner() -> DeploymentPlanner:
    return DeploymentPlanner(ROOM, (1.0, 1.0), 0.2, "inflection")


def test_the_fork_server_forks_children_of_whoever_asks(
    planner: DeploymentPlanner, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with capfd.disabled():  # forks shall have the real sys.stdout
        server = ForkServer(planner)
    try:
        for incarnation in (1, 2):  # there is no mission, which ends the peer with a status of its own
            arguments = [str(tmp_path / "none.json"), "robot1", "--incarnation", str(incarnation)]
            pid = server.fork_peer([*arguments, "--launcher", str(os.getpid())], tmp_path / f"{incarnation}.log")
            assert asyncio.run(wait_for_end(pid)) == 1
            said = (tmp_path / f"{incarnation}.log").read_text()
            assert said.startswith(f"--- robot1, incarnation {incarnation}, process {pid}\n")
            assert "FileNotFoundError" in said
    finally:
        server.close()
    assert not exists(server.pid)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_fork_server_that_does_not_answer_is_done_without(
    number: signal.Signals, mission: Mission, planner: DeploymentPlanner, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(fork_server, "ANSWER_WITHIN_S", 0.2)
    said: list[str] = []
    team = Supervisor(mission, tmp_path, planner, said.append, lambda *_: None, lambda _: None, lambda _: None)
    (tmp_path / "logs").mkdir()
    server = team._forks = ForkServer(planner)
    os.kill(server.pid, number)
    peer = Peer("robot1", incarnation=1)
    pids = [team.start_process(peer) for _ in range(2)]
    assert [asyncio.run(wait_for_end(pid)) for pid in pids] == [1, 1], "for want of a mission"
    assert said == ["the process that forks peers is gone: those started from now on take seconds longer"]
    heads = [line for line in logged(tmp_path, "robot1") if line.startswith("---")]
    assert sorted(heads) == sorted(f"--- robot1, incarnation 1, process {pid}" for pid in pids)
    assert not exists(server.pid)
    with pytest.raises(ServerGone):
        server.fork_peer([], tmp_path / "log")
