"""Real sessions on 127.0.0.1: who hears whom, who is seen to come and go, and that nothing hangs."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
import zenoh

from protocol import zenoh_bus
from protocol.bus import BusEvent, PeerAppeared, PeerVanished, Received
from protocol.messages import MAXIMUM_PAYLOAD_BYTES, Envelope, Heartbeat, decode, encode
from protocol.zenoh_bus import BusUnavailable, ZenohBus, free_endpoints

pytestmark = pytest.mark.processes

TEAM = "office"
PATIENCE_S = 20.0
"""Much longer than anything here takes, even on a busy machine."""


class Ear:
    """Keeps what a bus delivers, and waits for more."""

    def __init__(self) -> None:
        self.heard: list[BusEvent] = []
        self._changed = threading.Condition()

    def __call__(self, event: BusEvent) -> None:
        with self._changed:
            self.heard.append(event)
            self._changed.notify_all()

    def wait_for(self, *events: BusEvent) -> None:
        """Return once all have been heard, in any order."""
        self.wait_until(lambda: all(event in self.heard for event in events), f"{events}")

    def wait_until(self, holds: Callable[[], bool], what: str) -> None:
        """Return once something holds of what was heard."""
        with self._changed:
            assert self._changed.wait_for(holds, PATIENCE_S), f"never heard {what}; heard {self.heard[-10:]}"

    def wait_for_voice(self, peer: str) -> None:
        """Return once a peer has spoken, from now on."""
        seen = len(self.heard)
        key = f"{TEAM}/v1/{peer}/heartbeat"
        self.wait_until(lambda: any(isinstance(e, Received) and e.key == key for e in self.heard[seen:]), key)

    def wait_for_change(self, event: BusEvent, since: int) -> None:
        """Return once an event has been heard among those after the first ``since``."""
        self.wait_until(lambda: event in self.heard[since:], f"{event} again")


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


def join(
    stack: ExitStack, name: str, endpoints: list[str], index: int | None, kinds: Collection[str] | None = None
) -> tuple[ZenohBus, Ear]:
    ear = Ear()
    listen = None if index is None else endpoints[index]
    bus = ZenohBus.open(TEAM, name, listen, endpoints, ear, operator=index is None, kinds=kinds)
    stack.callback(bus.close)
    return bus, ear


def start(stack: ExitStack, name: str, endpoints: list[str], index: int, *how: str) -> subprocess.Popen[bytes]:
    """A peer as a process of its own, gone at the end of the test whatever happens."""
    process = subprocess.Popen(
        [
            sys.executable,
            Path(__file__).with_name("chatting_peer.py"),
            TEAM,
            name,
            endpoints[index],
            ",".join(endpoints),
            *how,
        ],
        stdin=subprocess.PIPE,
    )
    stack.enter_context(process)
    stack.callback(process.kill)
    return process


def test_peers_hear_one_another_and_not_themselves(stack: ExitStack) -> None:
    endpoints = free_endpoints(3)
    buses, ears = zip(*(join(stack, f"r{i}", endpoints, i) for i in range(3)), strict=True)
    for i, ear in enumerate(ears):
        ear.wait_for(*(PeerAppeared(f"r{j}") for j in range(3) if j != i))
    for i, bus in enumerate(buses):
        bus.publish(f"{TEAM}/v1/r{i}/state", b'{"from":%d}' % i)
        bus.publish(f"{TEAM}/v1/r{i}/deployment", b"\x00\xff" * 50_000)
    for i, ear in enumerate(ears):
        others = [j for j in range(3) if j != i]
        expected = [Received(f"{TEAM}/v1/r{j}/state", b'{"from":%d}' % j) for j in others]
        expected += [Received(f"{TEAM}/v1/r{j}/deployment", b"\x00\xff" * 50_000) for j in others]
        ear.wait_for(*expected)
        assert not [e for e in ear.heard if isinstance(e, PeerVanished)]
        assert all(f"/r{i}/" not in e.key for e in ear.heard if isinstance(e, Received)), "heard itself"
        assert PeerAppeared(f"r{i}") not in ear.heard


def test_teams_on_the_same_links_do_not_mix(stack: ExitStack) -> None:
    endpoints = free_endpoints(2)
    _, ear = join(stack, "r0", endpoints, 0)
    stranger = ZenohBus.open("factory", "r1", endpoints[1], endpoints, Ear())
    stack.callback(stranger.close)
    operator, _ = join(stack, "ada", endpoints, None)
    deadline = time.monotonic() + PATIENCE_S
    while not any(isinstance(e, Received) for e in ear.heard) and time.monotonic() < deadline:
        stranger.publish("factory/v1/r1/state", b"{}")
        operator.publish(f"{TEAM}/v1/operator/ada/goal", b"{}")
        time.sleep(0.05)
    assert set(ear.heard) == {Received(f"{TEAM}/v1/operator/ada/goal", b"{}")}


def test_operators_hear_all_and_have_no_token(stack: ExitStack) -> None:
    endpoints = free_endpoints(1)
    bus, ear = join(stack, "r0", endpoints, 0)
    operator, operator_ear = join(stack, "ada", endpoints, None)
    operator_ear.wait_for(PeerAppeared("r0"))
    bus.publish(f"{TEAM}/v1/r0/state", b"{}")
    operator_ear.wait_for(Received(f"{TEAM}/v1/r0/state", b"{}"))
    operator.publish(f"{TEAM}/v1/operator/ada/goal", b"{}")
    ear.wait_for(Received(f"{TEAM}/v1/operator/ada/goal", b"{}"))
    operator.close()
    bus.publish(f"{TEAM}/v1/r0/state", b"{}")
    assert ear.heard == [Received(f"{TEAM}/v1/operator/ada/goal", b"{}")], "an operator neither comes nor goes"


def test_peers_hear_the_kinds_that_they_listen_to_and_what_is_for_them(stack: ExitStack) -> None:
    endpoints = free_endpoints(3)
    speaker, _ = join(stack, "r0", endpoints, 0)
    _, ear = join(stack, "r1", endpoints, 1, {"state", "vote", "goal"})
    operator, operator_ear = join(stack, "ada", endpoints, None)
    ears = []
    for _ in range(2):  # r2 ends, and joins again
        bus, late_ear = join(stack, "r2", endpoints, 2, {"vote"})
        ears.append(late_ear)
        for other in (ear, late_ear, operator_ear):
            other.wait_for(PeerAppeared("r0"))
        late_ear.wait_for(PeerAppeared("r1"))
        ear.wait_for(PeerAppeared("r2"))
        operator.publish(f"{TEAM}/v1/operator/ada/goal", b"goal")
        for key in ("heartbeat", "state", "vote/r1", "vote/r2", "vote", "goal", "deployment"):
            speaker.publish(f"{TEAM}/v1/r0/{key}", b"{}")
        late_ear.wait_for(Received(f"{TEAM}/v1/r0/vote/r2", b"{}"))
        operator_ear.wait_until(lambda: len({e.key for e in operator_ear.heard if isinstance(e, Received)}) == 7, "all")
        bus.close()
        ear.wait_for(PeerVanished("r2"))
        ear.heard.remove(PeerVanished("r2"))
        ear.heard.remove(PeerAppeared("r2"))
    expected = {f"{TEAM}/v1/r0/state", f"{TEAM}/v1/r0/vote/r1", f"{TEAM}/v1/operator/ada/goal"}
    ear.wait_until(lambda: {e.key for e in ear.heard if isinstance(e, Received)} == expected, f"{expected} alone")
    for late_ear in ears:
        assert {e.key for e in late_ear.heard if isinstance(e, Received)} == {f"{TEAM}/v1/r0/vote/r2"}


def test_who_joins_late_is_told_what_stands_without_waiting_for_it_to_be_said_again(
    stack: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is said again here, so that without an answer nothing would be heard."""
    monkeypatch.setattr(zenoh_bus, "STANDS_FOR_S", 1e6)  # however slow the machine is
    endpoints = free_endpoints(2)
    bus, _ = join(stack, "r0", endpoints, 0)
    said: list[dict[str, bytes]] = []

    def say() -> None:
        words = {kind: f"{kind} {len(said)}".encode() for kind in ("deployment", "topology", "range_digest", "auction")}
        said.append(words)
        for kind, word in words.items():
            bus.publish(f"{TEAM}/v1/r0/{kind}", word)

    say()
    say()
    _, ear = join(stack, "r1", endpoints, 1, {"deployment", "topology", "auction"})
    ear.wait_for(*(Received(f"{TEAM}/v1/r0/{kind}", said[1][kind]) for kind in ("deployment", "topology")))
    heard = [event for event in ear.heard if isinstance(event, Received)]
    assert len(heard) == 2, "only what it listens to, only the latest, and only what stands"


def test_what_was_not_said_lately_does_not_stand(stack: ExitStack, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zenoh_bus, "STANDS_FOR_S", 0.0)
    endpoints = free_endpoints(2)
    bus, ear = join(stack, "r0", endpoints, 0)
    bus.publish(f"{TEAM}/v1/r0/deployment", b"old")
    _, late_ear = join(stack, "r1", endpoints, 1)
    ear.wait_for(PeerAppeared("r1"))
    key = f"{TEAM}/v1/r0/ranges"
    deadline = time.monotonic() + PATIENCE_S
    while Received(key, b"new") not in late_ear.heard and time.monotonic() < deadline:
        bus.publish(key, b"new")
        time.sleep(0.05)
    assert {event for event in late_ear.heard if isinstance(event, Received)} == {Received(key, b"new")}


def test_other_programs_may_ask_as_the_page_on_messages_says(
    stack: ExitStack, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(zenoh_bus, "STANDS_FOR_S", 1e6)
    page = (Path(__file__).parents[2] / "docs/messages/README.md").read_text()
    program = page.partition("```python\n")[2].partition("```")[0]
    endpoints = free_endpoints(2)
    for i in range(2):
        bus, _ = join(stack, f"r{i}", endpoints, i)
        body = Heartbeat(role="robot", mode="waiting")
        envelope = Envelope(sender=f"r{i}", incarnation=0, sequence=0, sent_at_s=0.0, body=body)
        bus.publish(f"{TEAM}/v1/r{i}/heartbeat", encode(envelope))
    mission = {"team": TEAM, "roster": [{"endpoint": endpoint} for endpoint in endpoints]}
    exec(program, {"json": json, "zenoh": zenoh, "mission": mission})
    said = "{'kind': 'heartbeat', 'role': 'robot', 'mode': 'waiting'}"
    assert sorted(capsys.readouterr().out.splitlines()) == [f"{TEAM}/v1/r{i}/heartbeat {said}" for i in range(2)]


def test_a_late_joiner_sees_who_is_there_and_is_seen_to_leave(stack: ExitStack) -> None:
    endpoints = free_endpoints(3)
    (_, ear), (_, other_ear) = (join(stack, f"r{i}", endpoints, i) for i in range(2))
    ear.wait_for(PeerAppeared("r1"))
    late, late_ear = join(stack, "r2", endpoints, 2)
    late_ear.wait_for(PeerAppeared("r0"), PeerAppeared("r1"))
    ear.wait_for(PeerAppeared("r2"))
    other_ear.wait_for(PeerAppeared("r2"))
    late.close()
    late.close()
    ear.wait_for(PeerVanished("r2"))
    other_ear.wait_for(PeerVanished("r2"))
    before = len(late_ear.heard)
    late.publish(f"{TEAM}/v1/r2/state", b"{}")
    assert late.dropped == 1
    assert len(late_ear.heard) == before


def test_a_killed_peer_vanishes_and_is_found_again_when_it_is_back(stack: ExitStack) -> None:
    endpoints = free_endpoints(2)
    _, ear = join(stack, "r0", endpoints, 0)
    process = start(stack, "r1", endpoints, 1)
    ear.wait_for(PeerAppeared("r1"))
    ear.wait_for_voice("r1")
    decode(next(event.payload for event in ear.heard if isinstance(event, Received)))
    process.kill()
    ear.wait_for(PeerVanished("r1"))
    before = len(ear.heard)
    again = start(stack, "r1", endpoints, 1)
    ear.wait_for_change(PeerAppeared("r1"), before)
    ear.wait_for_voice("r1")
    before = len(ear.heard)
    assert again.stdin is not None
    again.stdin.close()
    ear.wait_for_change(PeerVanished("r1"), before)
    assert again.wait(PATIENCE_S) == 0


@pytest.mark.parametrize("dials", [True, False])
def test_a_stopped_peer_vanishes_others_go_on_and_leaving_does_not_wait_for_it(stack: ExitStack, dials: bool) -> None:
    endpoints = sorted(free_endpoints(3), reverse=not dials)
    bus, ear = join(stack, "r0", endpoints, 0)
    stopped = start(stack, "r1", endpoints, 1)
    start(stack, "r2", endpoints, 2)
    ear.wait_for(PeerAppeared("r1"), PeerAppeared("r2"))
    stopped.send_signal(signal.SIGSTOP)
    full = threading.Event()

    def flood() -> None:
        while not full.wait(0.005):
            bus.publish(f"{TEAM}/v1/r0/state", b"x" * 20_000)

    flooding = threading.Thread(target=flood)
    flooding.start()
    try:
        ear.wait_for(PeerVanished("r1"))
        ear.wait_for_voice("r2")
    finally:
        full.set()
        flooding.join()
    assert PeerVanished("r2") not in ear.heard
    before = len(ear.heard)
    stopped.send_signal(signal.SIGCONT)
    ear.wait_for_change(PeerAppeared("r1"), before)
    ear.wait_for_voice("r1")
    stopped.send_signal(signal.SIGSTOP)
    bus.publish(f"{TEAM}/v1/r0/state", b"x" * 20_000)
    began_s = time.monotonic()
    bus.close()
    assert time.monotonic() - began_s < 5.0, "zenoh alone takes 10 s when a listener is stuck"


def test_a_process_that_forgets_to_close_ends_all_the_same(stack: ExitStack) -> None:
    endpoints = free_endpoints(2)
    _, ear = join(stack, "r0", endpoints, 0)
    process = start(stack, "r1", endpoints, 1, "forget")
    ear.wait_for_voice("r1")
    assert process.stdin is not None
    process.stdin.close()
    assert process.wait(PATIENCE_S) == 0
    ear.wait_for(PeerVanished("r1"))


def test_payloads_that_are_too_long_are_not_delivered(stack: ExitStack) -> None:
    endpoints = free_endpoints(2)
    bus, _ = join(stack, "r0", endpoints, 0)
    listener, ear = join(stack, "r1", endpoints, 1)
    ear.wait_for(PeerAppeared("r0"))
    key = f"{TEAM}/v1/r0/ranges"
    for length in (MAXIMUM_PAYLOAD_BYTES + 1, 4 * MAXIMUM_PAYLOAD_BYTES):
        bus.publish(key, bytes(length))
    deadline = time.monotonic() + PATIENCE_S
    while Received(key, b"short") not in ear.heard and time.monotonic() < deadline:
        bus.publish(key, b"short")
        time.sleep(0.05)
    assert {event for event in ear.heard if isinstance(event, Received)} == {Received(key, b"short")}
    assert listener.dropped == 1, "of the longest not even the pieces are put together"


def test_a_taken_port_is_one_sentence() -> None:
    (endpoint,) = free_endpoints(1)
    with socket.socket() as other:
        other.bind(("127.0.0.1", int(endpoint.rpartition(":")[2])))
        other.listen()
        with pytest.raises(BusUnavailable, match=f"{endpoint} is taken by another program: .*choose another port") as e:
            ZenohBus.open(TEAM, "r0", endpoint, [], Ear())
    assert "\n" not in str(e.value)


@pytest.mark.parametrize(
    ("listen", "remedy"),
    [
        ("127.0.0.1:17447", "write it as tcp/HOST:PORT"),
        ("tcp/127.0.0.1", "write it as tcp/HOST:PORT"),
        ("tcp/127.0.0.1:99999", "write it as tcp/HOST:PORT"),
        ("tcp/127.0.0.1:0", "write it as tcp/HOST:PORT"),
        ("", "write it as tcp/HOST:PORT"),
        ("carrier/pigeon:1", "zenoh cannot use the endpoints carrier/pigeon:1"),
        ("tcp/203.0.113.1:17447", "no address of this machine"),
    ],
)
def test_unusable_endpoints_are_one_sentence(listen: str, remedy: str) -> None:
    with pytest.raises(BusUnavailable, match=remedy) as problem:
        ZenohBus.open(TEAM, "r0", listen, [], Ear())
    assert "\n" not in str(problem.value)
    assert ".cargo" not in str(problem.value)
    if "address" not in remedy:
        with pytest.raises(BusUnavailable, match=remedy):
            ZenohBus.open(TEAM, "r0", None, [listen], Ear())


@pytest.mark.parametrize(("team", "name"), [("Office", "r0"), ("office", "r 0"), ("office", "operator"), ("", "r0")])
def test_names_that_are_no_chunk_of_a_key_are_refused(team: str, name: str) -> None:
    with pytest.raises(BusUnavailable, match="cannot be the name of"):
        ZenohBus.open(team, name, None, [], Ear())


def test_free_endpoints_are_free_different_and_below_the_ports_of_outgoing_connections() -> None:
    endpoints = free_endpoints(40)
    ports = [int(endpoint.removeprefix("tcp/127.0.0.1:")) for endpoint in endpoints]
    assert len(set(ports)) == 40
    assert all(1024 < port < 32768 for port in ports)
    with pytest.raises(BusUnavailable, match="ports are free"):
        free_endpoints(20_000)
