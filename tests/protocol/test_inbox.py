"""The inbox forgets only what it may, keeps order, and wakes its reader."""

from __future__ import annotations

import os
import signal
import threading
from collections import defaultdict
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.bus import BusEvent, PeerAppeared, PeerVanished, Received
from protocol.inbox import MAXIMUM_KEYS, PER_KEY, Inbox
from protocol.messages import PERIODIC_KINDS

KEYS = ["t/v1/a/state", "t/v1/b/state", "t/v1/a/deployment", "t/v1/operator/o/goal"]


def is_periodic(key: str) -> bool:
    return key.split("/")[-1] in PERIODIC_KINDS


events = st.one_of(
    st.builds(Received, st.sampled_from(KEYS), st.binary(max_size=1)),
    st.builds(PeerAppeared, st.sampled_from("ab")),
    st.builds(PeerVanished, st.sampled_from("ab")),
    st.integers(),  # stands for a job that is done
)


@given(st.lists(events | st.just(None), max_size=300))
@settings(deadline=None)
def test_it_holds_what_a_plain_list_would_after_forgetting(history: list[BusEvent | int | None]) -> None:
    inbox: Inbox[int] = Inbox()
    plain: list[BusEvent | int] = []
    dropped = 0
    for event in history:
        if event is None:
            assert inbox.wait(0.0) == plain
            plain = []
            continue
        inbox.put(event)
        if isinstance(event, Received):
            same = [i for i, old in enumerate(plain) if isinstance(old, Received) and old.key == event.key]
            if len(same) == (1 if is_periodic(event.key) else PER_KEY):
                del plain[same[0]]
                dropped += not is_periodic(event.key)
        plain.append(event)
    assert inbox.wait(0.0) == plain
    assert inbox.dropped == dropped


def test_a_flood_costs_only_its_own_key() -> None:
    inbox: Inbox[str] = Inbox()
    inbox.put(Received("t/v1/a/deployment", b"first"))
    inbox.put("job")
    for number in range(10 * PER_KEY):
        inbox.put(Received("t/v1/b/deployment", b"%d" % number))
    taken = inbox.wait(0.0)
    assert taken[:2] == [Received("t/v1/a/deployment", b"first"), "job"]
    assert taken[2:] == [Received("t/v1/b/deployment", b"%d" % n) for n in range(9 * PER_KEY, 10 * PER_KEY)]
    assert inbox.dropped == 9 * PER_KEY


def test_invented_keys_do_not_fill_the_memory() -> None:
    inbox: Inbox[str] = Inbox()
    for number in range(MAXIMUM_KEYS + 10):
        inbox.put(Received(f"t/v1/x{number}/state", b""))
    inbox.put("job")
    assert len(inbox.wait(0.0)) == MAXIMUM_KEYS + 1
    assert inbox.dropped == 10
    inbox.put(Received("t/v1/a/state", b""))
    assert inbox.wait(0.0) == [Received("t/v1/a/state", b"")]


def test_threads_lose_nothing_but_what_is_counted_and_replaced() -> None:
    inbox: Inbox[str] = Inbox()
    speakers, messages = 6, 400
    start = threading.Barrier(speakers)

    def speak(name: str) -> None:
        start.wait()
        for number in range(messages):
            inbox.put(Received(f"t/v1/{name}/goal_reply", b"%d" % number))
            inbox.put(Received(f"t/v1/{name}/state", b"%d" % number))
        inbox.put(name)

    threads = [threading.Thread(target=speak, args=(f"r{i}",)) for i in range(speakers)]
    for thread in threads:
        thread.start()
    heard: dict[str, list[int]] = defaultdict(list)
    ended: set[str] = set()
    while len(ended) < speakers:
        for event in inbox.wait(60.0):
            if isinstance(event, str):
                ended.add(event)
            elif isinstance(event, Received):
                heard[event.key].append(int(event.payload))
    for thread in threads:
        thread.join()
    replies = 0
    for key, numbers in heard.items():
        assert numbers == sorted(set(numbers)), f"{key} out of order"
        assert numbers[-1] == messages - 1
        replies += len(numbers) * (not is_periodic(key))
    assert replies + inbox.dropped == speakers * messages


def test_it_waits_no_longer_than_told() -> None:
    inbox: Inbox[str] = Inbox()
    assert inbox.wait(0.01) == []
    assert inbox.wait(-1.0) == []


def test_a_wake_counts_for_the_next_wait() -> None:
    inbox: Inbox[str] = Inbox()
    inbox.wake()
    inbox.wake()
    assert inbox.wait(float("inf")) == []
    assert inbox.wait(0.0) == []


@pytest.fixture
def alarm() -> Iterator[list[Inbox[str]]]:
    """The signal SIGUSR1 wakes the inboxes in this list."""
    woken: list[Inbox[str]] = []
    before = signal.signal(signal.SIGUSR1, lambda *_: [inbox.wake() for inbox in woken] and None)
    yield woken
    signal.signal(signal.SIGUSR1, before)


def test_a_signal_handler_wakes_it_at_any_moment(alarm: list[Inbox[str]]) -> None:
    inbox: Inbox[str] = Inbox()
    alarm.append(inbox)
    for _ in range(50):  # some of them find it between two waits, some within
        ringing = threading.Thread(target=os.kill, args=(os.getpid(), signal.SIGUSR1))
        ringing.start()
        while inbox.wait(3600.0):
            pass
        ringing.join()
