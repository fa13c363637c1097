"""What has arrived and was not looked at yet: filled from any thread, emptied by the one that runs the role.

A bus calls back from threads of its own and must not be kept waiting, and a slow reader must neither grow without
bound nor fall behind for ever. So each key holds at most one publication of a periodic kind (the latest replaces the
one before), and at most :data:`PER_KEY` of any other kind (the oldest goes, and is counted): whoever floods a key
loses only their own messages.
"""

from __future__ import annotations

import threading
from collections import deque
from contextlib import suppress
from functools import lru_cache
from typing import Generic, TypeVar

from protocol.bus import BusEvent, Received
from protocol.keys import route
from protocol.messages import PERIODIC_KINDS

PER_KEY = 64
"""Publications of one key that wait, unless its kind is periodic."""

MAXIMUM_KEYS = 4096
"""Different keys that wait; publications under further ones are dropped until the inbox has been emptied."""

Local = TypeVar("Local")
"""Events of the process itself, e.g. the end of a job in a worker thread."""


class Inbox(Generic[Local]):
    """Events in order of arrival. ``put`` is what a bus wants as its ``deliver``."""

    def __init__(self) -> None:
        self.dropped = 0
        """Publications that nobody will see because too many waited; replaced periodic ones do not count."""
        self._lock = threading.Lock()
        self._arrived = 0
        self._waiting: dict[int, BusEvent | Local] = {}
        self._tickets: dict[str, deque[int]] = {}
        # A bell is a lock that is free once it has been rung. Unlike Event and Condition it holds no lock of its own
        # while it is waited for, so that a signal handler may ring it whatever it interrupted.
        self._bell = threading.Lock()
        self._bell.acquire()

    def put(self, event: BusEvent | Local) -> None:
        """Add an event and wake the reader. Any thread; not from a signal handler. Only publications can be dropped."""
        with self._lock:
            self._arrived += 1
            if isinstance(event, Received) and not self._make_room(event.key):
                return
            self._waiting[self._arrived] = event
        self.wake()

    def wake(self) -> None:
        """Let the present or else the next :meth:`wait` return at once. Any thread, and signal handlers too."""
        if self._bell.locked():
            with suppress(RuntimeError):  # somebody else has just rung it
                self._bell.release()

    def wait(self, timeout_s: float) -> list[BusEvent | Local]:
        """All events, in order of arrival, as soon as there is one, it was woken, or the time is over.

        Empty in the last two cases, and now and then for no reason.
        """
        self._bell.acquire(timeout=min(max(timeout_s, 0.0), threading.TIMEOUT_MAX))
        with self._lock:
            events = list(self._waiting.values())
            self._waiting.clear()
            self._tickets.clear()
        return events

    def _make_room(self, key: str) -> bool:
        """Register the present arrival under its key, at the cost of an older one if need be. False: no room."""
        tickets = self._tickets.get(key)
        if tickets is None:
            if len(self._tickets) >= MAXIMUM_KEYS:
                self.dropped += 1
                return False
            tickets = self._tickets[key] = deque()
        periodic = _is_periodic(key)
        if len(tickets) >= (1 if periodic else PER_KEY):
            del self._waiting[tickets.popleft()]
            self.dropped += not periodic
        tickets.append(self._arrived)
        return True


@lru_cache(maxsize=1024)  # the same few keys come again and again
def _is_periodic(key: str) -> bool:
    return route(key)[0] in PERIODIC_KINDS
