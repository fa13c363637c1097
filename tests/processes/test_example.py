"""The example, run as a user runs it, among a team that is played by buses of this process."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from protocol import keys
from protocol.bus import BusEvent, Received
from protocol.messages import (
    AnyBody,
    Authority,
    Deployment,
    Envelope,
    Goal,
    GoalReply,
    Heartbeat,
    Intent,
    Placement,
    Warrant,
    decode,
    encode,
    kind_of,
)
from protocol.zenoh_bus import ZenohBus, free_endpoints

pytestmark = pytest.mark.processes

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "watch_and_send_goal.py"
TEAM = "office"


class Actor:
    """Plays one peer: says the same things ten times a second, and answers goals if it is the agent."""

    def __init__(self, name: str, endpoints: list[str], index: int, bodies: list[AnyBody]) -> None:
        self.goals: list[Goal] = []
        self._name = name
        self._bodies = bodies
        self._sequence = 0
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._bus = ZenohBus.open(TEAM, name, endpoints[index], endpoints, self._hear)
        self._thread = threading.Thread(target=self._act)
        self._thread.start()

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        self._bus.close()

    def _hear(self, event: BusEvent) -> None:
        if isinstance(event, Received) and self._name == "agent":
            address, envelope = keys.parse(event.key), decode(event.payload)
            if isinstance(envelope.body, Goal):
                assert address is not None
                assert address.operator
                assert address.speaker == envelope.sender == "visitor"
                with self._lock:
                    self.goals.append(envelope.body)

    def _act(self) -> None:
        answered = 0
        while not self._ended.wait(0.1):
            for body in self._bodies:
                self._say(body)
            with self._lock:
                unanswered, answered = self.goals[answered:], len(self.goals)
            for goal in unanswered:
                inside = goal.goal[0] < 100.0
                reason = "" if inside else "goal lies outside the map"
                self._say(GoalReply(correlation="of somebody else", accepted=not inside))
                self._say(GoalReply(correlation=goal.correlation, accepted=inside, reason=reason))

    def _say(self, body: AnyBody) -> None:
        self._sequence += 1
        envelope = Envelope(sender=self._name, incarnation=0, sequence=self._sequence, sent_at_s=0.0, body=body)
        self._bus.publish(keys.Address(TEAM, self._name, kind_of(body)).key, encode(envelope))


@pytest.fixture
def team() -> Iterator[tuple[list[str], Actor]]:
    """Endpoints of base, agent and one robot that are up, and the agent."""
    endpoints = free_endpoints(3)
    deployment = Deployment(
        authority=Authority(epoch=1, leader="base", sequence=1),
        warrant=Warrant(lease_s=0.8, marks=()),
        decision=3,
        placements=(Placement(robot="robot1", position=(4.0, 2.0), cell=1),),
        edges=(("base", "robot1"), ("robot1", "agent")),
        cost=1.0,
        relays_needed=1,
        reason="first deployment",
    )
    intent = Intent(position=(3.0, 4.5), velocity=(0.0, 0.0), mode="moving", goal=(5.0, 6.0))
    scripts: dict[str, list[AnyBody]] = {
        "base": [Heartbeat(role="base_station", mode="arrived"), deployment],
        "agent": [intent],
        "robot1": [Heartbeat(role="robot", mode="moving")],
    }
    with ExitStack() as stack:
        actors = {}
        for index, (name, bodies) in enumerate(scripts.items()):
            actors[name] = Actor(name, endpoints, index, bodies)
            stack.callback(actors[name].close)
        yield endpoints, actors["agent"]


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, EXAMPLE, *arguments], capture_output=True, text=True, timeout=50, check=False
    )


def test_it_watches_and_its_goal_is_accepted(team: tuple[list[str], Actor], tmp_path: Path) -> None:
    endpoints, agent = team
    mission = tmp_path / "mission.json"
    roster = [{"name": name, "endpoint": endpoint} for name, endpoint in zip("abc", endpoints, strict=True)]
    mission.write_text(json.dumps({"team": TEAM, "roster": roster}), encoding="utf-8")
    result = run("--mission", str(mission), "--goal", "12.5,4", "--seconds", "4")
    assert result.returncode == 0, result
    assert result.stderr == ""
    lines = result.stdout.splitlines()
    assert lines.count("agent accepts") == 1
    assert lines[-1].endswith(
        "up: agent base robot1; agent at (3.0, 4.5); going to (5.0, 6.0); "
        "chain base–robot1, robot1–agent (decision 3 of base: first deployment)"
    )
    assert {goal.goal for goal in agent.goals} == {(12.5, 4.0)}
    assert len({goal.correlation for goal in agent.goals}) == 1


def test_a_refused_goal_is_said_to_be_refused(team: tuple[list[str], Actor]) -> None:
    endpoints, _ = team
    connect = [word for endpoint in endpoints for word in ("--connect", endpoint)]
    result = run("--team", TEAM, *connect, "--goal=100,-4", "--seconds", "4")
    assert result.returncode == 1, result
    assert "agent refuses: goal lies outside the map" in result.stdout


def test_without_a_team_it_says_so(tmp_path: Path) -> None:
    (endpoint,) = free_endpoints(1)
    result = run("--team", TEAM, "--connect", endpoint, "--goal", "1,2", "--seconds", "0.7")
    assert result.returncode == 1
    assert "up: nobody yet" in result.stdout
    assert "nobody answered" in result.stdout
    result = run("--mission", str(tmp_path / "none.json"))
    assert result.returncode == 2
    assert "cannot be read" in result.stderr
    assert "Traceback" not in result.stderr


def test_it_needs_nothing_but_zenoh_and_the_standard_library() -> None:
    tree = ast.parse(EXAMPLE.read_text(encoding="utf-8"))
    imported = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    imported |= {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert {name.split(".")[0] for name in imported} - sys.stdlib_module_names == {"zenoh"}
