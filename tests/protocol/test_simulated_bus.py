"""Virtual time runs in order; the simulated network keeps its promises and repeats itself to the last bit."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from collections import defaultdict
from functools import partial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.bus import BusEvent, PeerAppeared, PeerVanished, Received
from protocol.simulated_bus import SimulatedNetwork, VirtualTime

times = st.floats(0.0, 100.0) | st.sampled_from([1.0, 2.0])


@given(st.lists(times, max_size=30), times)
@settings(deadline=None)
def test_time_runs_what_is_due_in_stable_order(due: list[float], until: float) -> None:
    time = VirtualTime()
    ran: list[tuple[float, int]] = []
    for number, moment in enumerate(due):
        time.call_at(moment, lambda number: ran.append((time.now_s, number)), number)
    time.run_until(until)
    expected = sorted((moment, number) for number, moment in enumerate(due) if moment <= until)
    assert ran == expected
    assert time.now_s == until
    time.run_until(200.0)
    assert [number for _, number in ran] == sorted(range(len(due)), key=due.__getitem__)


def test_what_is_asked_for_on_the_way_runs_too_and_the_past_is_now() -> None:
    time = VirtualTime(5.0)
    ran: list[tuple[float, str]] = []

    def note(text: str) -> None:
        ran.append((time.now_s, text))

    def first() -> None:
        note("first")
        time.call_at(1.0, note, "past")
        time.call_at(7.0, note, "later")

    time.call_at(6.0, first)
    time.call_at(6.0, note, "second")
    time.run_until(7.0)
    assert ran == [(6.0, "first"), (6.0, "second"), (6.0, "past"), (7.0, "later")]
    time.run_until(3.0)
    assert time.now_s == 7.0


@pytest.mark.parametrize("moment", [math.nan, math.inf])
def test_no_time_is_no_time(moment: float) -> None:
    with pytest.raises(ValueError, match="finite"):
        VirtualTime().call_at(moment, print)


def test_a_function_that_raises_leaves_time_usable() -> None:
    time = VirtualTime()
    ran: list[float] = []
    time.call_at(1.0, [].pop)
    time.call_at(2.0, lambda: ran.append(time.now_s))
    with pytest.raises(IndexError):
        time.run_until(3.0)
    assert time.now_s == 1.0
    time.run_until(3.0)
    assert ran == [2.0]


History = list[tuple[float, str, BusEvent]]


def chatter(seed: int, delay_s: tuple[float, float], loss: float, peers: int = 4) -> tuple[SimulatedNetwork, History]:
    """Peers that answer one another for two seconds; one of them leaves after one and comes back."""
    time = VirtualTime()
    network = SimulatedNetwork(time, seed, delay_s, loss)
    history: History = []
    names = [f"r{i}" for i in range(peers)]
    buses = {}

    def deliver(name: str, event: BusEvent) -> None:
        history.append((time.now_s, name, event))
        if isinstance(event, Received) and event.payload.endswith(b"0") and len(event.payload) < 8:
            buses[name].publish(f"t/v1/{name}/goal_reply", event.payload + b"!" + name.encode())

    def speak(name: str, number: int) -> None:
        buses[name].publish(f"t/v1/{name}/state", b"%d" % number)
        time.call_at(time.now_s + 0.02, speak, name, number + 1)

    def join(name: str) -> None:
        buses[name] = network.attach(name, partial(deliver, name))

    for name in names:
        join(name)
        speak(name, 0)
    time.call_at(1.0, lambda: buses[names[0]].close())
    time.call_at(1.5, join, names[0])
    time.run_until(2.0 + delay_s[1])
    return network, history


@given(st.integers(), st.floats(0.0, 0.05), st.floats(0.0, 0.05), st.floats(0.0, 1.0))
@settings(deadline=None, max_examples=20)
def test_the_same_seed_gives_the_same_history(seed: int, least: float, more: float, loss: float) -> None:
    delay_s = (least, least + more)
    assert chatter(seed, delay_s, loss)[1] == chatter(seed, delay_s, loss)[1]


def test_another_seed_gives_another_history() -> None:
    assert chatter(1, (0.0, 0.01), 0.1)[1] != chatter(2, (0.0, 0.01), 0.1)[1]


SCRIPT = """
import hashlib
from tests.protocol.test_simulated_bus import chatter
print(hashlib.sha256(repr(chatter(7, (0.001, 0.02), 0.2)[1]).encode()).hexdigest())
"""


def test_the_history_does_not_depend_on_hash_seeds() -> None:
    digests = {
        subprocess.run(
            [sys.executable, "-c", SCRIPT],
            env={**os.environ, "PYTHONHASHSEED": hash_seed, "PYTHONPATH": os.pathsep.join(sys.path)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for hash_seed in ("1", "2")
    }
    assert len(digests) == 1


@given(st.integers(), st.floats(0.0, 0.05), st.floats(0.0, 0.05), st.floats(0.0, 1.0))
@settings(deadline=None, max_examples=30)
def test_delays_are_bounded_links_keep_order_and_nothing_is_invented(
    seed: int, least: float, more: float, loss: float
) -> None:
    time = VirtualTime()
    network = SimulatedNetwork(time, seed, (least, least + more), loss)
    arrived: dict[tuple[str, str], list[tuple[float, float]]] = defaultdict(list)

    def deliver(name: str, event: BusEvent) -> None:
        if isinstance(event, Received):
            arrived[event.key, name].append((float(event.payload), time.now_s))

    buses = {name: network.attach(name, partial(deliver, name)) for name in "abc"}
    for number in range(60):
        for name, bus in buses.items():
            time.call_at(number * 0.01, lambda bus=bus, name=name: bus.publish(name, repr(time.now_s).encode()))
    time.run_until(10.0)
    assert network.published == 180
    assert network.delivered + network.lost == 360
    assert sum(map(len, arrived.values())) == network.delivered
    for (speaker, listener), messages in arrived.items():
        assert speaker != listener
        assert messages == sorted(messages), f"{speaker} to {listener} out of order"
        assert len({sent for sent, _ in messages}) == len(messages)
        for sent, heard in messages:
            assert least - 1e-9 <= heard - sent <= least + more + 1e-9
    if loss == 0.0:
        assert network.lost == 0


def test_loss_and_delay_are_what_was_asked_for() -> None:
    time = VirtualTime()
    network = SimulatedNetwork(time, 3, (0.01, 0.03), 0.25)
    delays: list[float] = []

    def deliver(event: BusEvent) -> None:
        if isinstance(event, Received):
            delays.append(time.now_s - float(event.payload))

    sender = network.attach("a", deliver)
    network.attach("b", deliver)
    for number in range(20_000):  # apart, so that none waits behind another
        time.call_at(number * 0.1, lambda: sender.publish("t/v1/a/state", repr(time.now_s).encode()))
    time.run_until(1e4)
    assert len(delays) / 20_000 == pytest.approx(0.75, abs=0.02)
    assert sum(delays) / len(delays) == pytest.approx(0.02, abs=0.0005)


def test_loss_does_not_change_the_delays_of_what_arrives() -> None:
    def arrivals(loss: float) -> set[tuple[bytes, float]]:
        time = VirtualTime()
        network = SimulatedNetwork(time, 5, (0.0, 0.01), loss)
        heard: set[tuple[bytes, float]] = set()
        sender = network.attach("a", str)
        network.attach(
            "b", lambda event: heard.add((event.payload, time.now_s)) if isinstance(event, Received) else None
        )
        for number in range(500):
            time.call_at(number * 0.1, sender.publish, "t/v1/a/state", b"%d" % number)
        time.run_until(100.0)
        return heard

    assert arrivals(0.3) < arrivals(0.0)


def test_peers_appear_and_vanish_and_operators_do_not() -> None:
    time = VirtualTime()
    network = SimulatedNetwork(time, 0, (0.001, 0.002))
    heard: dict[str, list[BusEvent]] = defaultdict(list)
    a = network.attach("a", heard["a"].append)
    time.run_until(1.0)
    network.attach("b", heard["b"].append)
    operator = network.attach("b", heard["operator"].append, operator=True)
    time.run_until(2.0)
    assert heard["a"] == [PeerAppeared("b")]
    assert heard["b"] == [PeerAppeared("a")]
    assert sorted(heard["operator"], key=repr) == [PeerAppeared("a"), PeerAppeared("b")]
    operator.publish("t/v1/operator/b/goal", b"{}")
    a.publish("t/v1/a/state", b"{}")
    a.close()
    operator.close()
    a.close()
    a.publish("t/v1/a/state", b"too late")
    time.run_until(3.0)
    assert a.dropped == 1
    assert heard["a"] == [PeerAppeared("b")], "nothing arrives once closed"
    # Two links, so b may hear the two speakers in either order; a's own words come before its leaving.
    from_a = [event for event in heard["b"][1:] if event != Received("t/v1/operator/b/goal", b"{}")]
    assert from_a == [Received("t/v1/a/state", b"{}"), PeerVanished("a")]
    assert len(heard["b"]) == 4
    network.attach("a", heard["a"].append)
    time.run_until(4.0)
    assert heard["b"][-1] == PeerAppeared("a")


def test_a_peer_hears_the_kinds_that_it_listens_to_and_who_comes_and_goes() -> None:
    time = VirtualTime()
    network = SimulatedNetwork(time, 0)
    heard: list[BusEvent] = []
    network.attach("a", heard.append, kinds={"deployment"})
    speaker = network.attach("b", print)
    for kind in ("state", "deployment", "heartbeat"):
        speaker.publish(f"t/v1/b/{kind}", b"{}")
    speaker.close()
    time.run_until(1.0)
    assert heard == [PeerAppeared("b"), Received("t/v1/b/deployment", b"{}"), PeerVanished("b")]
    assert network.delivered == 1


def test_what_is_for_one_peer_reaches_it_and_the_operators_that_listen() -> None:
    time = VirtualTime()
    network = SimulatedNetwork(time, 0)
    heard: dict[str, list[BusEvent]] = {name: [] for name in ("a", "b", "deaf", "ada", "anna")}
    network.attach("a", heard["a"].append)
    network.attach("b", heard["b"].append, kinds={"vote"})
    network.attach("deaf", heard["deaf"].append, kinds={"state"})
    network.attach("ada", heard["ada"].append, operator=True)
    network.attach("anna", heard["anna"].append, operator=True, kinds={"state"})
    speaker = network.attach("c", print)
    for to in ("a", "b", "deaf", "c", "nobody"):
        speaker.publish(f"t/v1/c/vote/{to}", b"{}")
    time.run_until(1.0)
    votes = {name: [event.key for event in events if isinstance(event, Received)] for name, events in heard.items()}
    assert votes == {
        "a": ["t/v1/c/vote/a"],
        "b": ["t/v1/c/vote/b"],
        "deaf": [],
        "ada": [f"t/v1/c/vote/{to}" for to in ("a", "b", "deaf", "c", "nobody")],
        "anna": [],
    }
    assert network.delivered == 7


def test_impossible_networks_are_refused() -> None:
    time = VirtualTime()
    for delay_s in ((-1.0, 1.0), (2.0, 1.0), (0.0, math.inf), (math.nan, 1.0)):
        with pytest.raises(ValueError, match="delays"):
            SimulatedNetwork(time, 0, delay_s)
    for loss in (-0.1, 1.1, math.nan):
        with pytest.raises(ValueError, match="loss"):
            SimulatedNetwork(time, 0, loss=loss)
    network = SimulatedNetwork(time, 0)
    network.attach("a", print)
    with pytest.raises(ValueError, match="attached"):
        network.attach("a", print)
