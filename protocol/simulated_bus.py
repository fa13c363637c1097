"""A bus in virtual time: one process, one thread, one seed.

:class:`VirtualTime` is the clock: it jumps to the next thing that is due, so that minutes of protocol take
milliseconds. :class:`SimulatedNetwork` carries publications between the peers attached to it, each with a delay drawn
from the seed, and loses some. The same seed and the same calls give the same history, to the last bit, on every machine
and under every ``PYTHONHASHSEED``.

Like a zenoh session over tcp, a link keeps the order of what it carries, and tokens are not lost. Each kind of chance
draws from a stream of its own, so that more loss does not change the delays of what arrives. The other faults
(duplicates, reordering, partitions, crashes, pauses, clock skew) each have one place to go to:
:meth:`SimulatedNetwork._send` for links, :meth:`SimulatedNetwork.attach` for peers.

Models: trio's MockClock; FoundationDB's simulation testing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from heapq import heappop, heappush
from random import Random
from typing import Any

from protocol.bus import BusEvent, Deliver, PeerAppeared, PeerVanished, Received


class VirtualTime:
    """A clock that stands still while functions run, and jumps from one to the next.

    Functions due at the same time run in the order in which they were asked for.
    """

    def __init__(self, start_s: float = 0.0) -> None:
        self.now_s = start_s
        """Virtual seconds; read it, never set it."""
        self._asked = 0
        self._due: list[tuple[float, int, Callable[..., object], tuple[Any, ...]]] = []

    def call_at(self, time_s: float, function: Callable[..., object], *arguments: Any) -> None:
        """Call ``function(*arguments)`` once it is ``time_s``; a time that has passed means now. O(log n).

        Raises:
            ValueError: the time is not a finite number.
        """
        if not math.isfinite(time_s):
            raise ValueError(f"cannot call a function at {time_s} s: the time must be finite")
        self._asked += 1
        heappush(self._due, (max(time_s, self.now_s), self._asked, function, arguments))

    def run_until(self, time_s: float) -> None:
        """Run all that is due until ``time_s`` inclusive, also what is asked for on the way; then it is that time.

        What a function raises comes out here; what was due after it is still due.
        """
        due = self._due
        while due and due[0][0] <= time_s:
            self.now_s, _, function, arguments = heappop(due)
            function(*arguments)
        self.now_s = max(self.now_s, time_s)


class SimulatedBus:
    """The connection of one peer (or one operator) to a simulated network. Made by :meth:`SimulatedNetwork.attach`."""

    def __init__(
        self, network: SimulatedNetwork, peer: str, deliver: Deliver, operator: bool, kinds: Collection[str] | None
    ) -> None:
        self.peer = peer
        self.operator = operator
        self.kinds = None if kinds is None else frozenset(kinds)
        self.dropped = 0
        """Publications that were not sent, because the bus was closed."""
        self._network = network
        self._deliver = deliver
        self._open = True

    def publish(self, key: str, payload: bytes) -> None:
        """Send to all that are attached now, except the sender."""
        if self._open:
            self._network._publish(self, Received(key, payload))
        else:
            self.dropped += 1

    def close(self) -> None:
        """Leave: nothing is delivered here any more, and the others see the peer vanish. Closing again does nothing."""
        if self._open:
            self._open = False
            self._network._detach(self)

    def _arrive(self, event: BusEvent) -> None:
        if self._open:
            self._deliver(event)


class SimulatedNetwork:
    """All links of one simulated team; everybody hears everybody.

    Args:
        time: the clock that deliveries are put on.
        seed: of all that is left to chance here.
        delay_s: least and greatest delay of a message; drawn uniformly for each message and receiver.
        loss: probability that a receiver misses a publication.

    Raises:
        ValueError: a delay is negative, not finite or out of order, or the loss is not in [0, 1].
    """

    def __init__(
        self, time: VirtualTime, seed: int, delay_s: tuple[float, float] = (0.001, 0.005), loss: float = 0.0
    ) -> None:
        if not 0.0 <= delay_s[0] <= delay_s[1] < math.inf:
            raise ValueError(f"delays must be 0 <= least <= greatest, in seconds, not {delay_s}")
        if not 0.0 <= loss <= 1.0:
            raise ValueError(f"loss is a probability between 0 and 1, not {loss}")
        self.published = 0
        """Publications so far."""
        self.delivered = 0
        """Publications that were put on a link, counted once for each receiver."""
        self.lost = 0
        """Publications that chance took, counted once for each receiver."""
        self._time = time
        self._least_s, self._greatest_s = delay_s
        self._loss = loss
        self._delays = Random(f"{seed}/delay")
        self._losses = Random(f"{seed}/loss")
        self._attached: dict[str, SimulatedBus] = {}
        self._last_arrivals_s: dict[tuple[str, str], float] = {}

    def attach(
        self, peer: str, deliver: Deliver, *, operator: bool = False, kinds: Collection[str] | None = None
    ) -> SimulatedBus:
        """Open a bus. A peer's token is seen by all others, and it sees theirs; operators have no token.

        Args:
            peer: its name.
            deliver: takes what arrives.
            operator: whether it is an operator and no peer.
            kinds: kinds of messages (last chunks of keys) that it listens to; None: all.

        Raises:
            ValueError: somebody of that name is attached already.
        """
        name = f"operator/{peer}" if operator else peer
        if name in self._attached:
            raise ValueError(f"{name} is attached to the simulated network already: close its bus first")
        bus = SimulatedBus(self, name, deliver, operator, kinds)
        for other_name, other in self._attached.items():
            if not operator:
                self._send(name, other, PeerAppeared(name))
            if not other.operator:
                self._send(other_name, bus, PeerAppeared(other_name))
        self._attached[name] = bus
        return bus

    def _detach(self, bus: SimulatedBus) -> None:
        del self._attached[bus.peer]
        if not bus.operator:
            for other in self._attached.values():
                self._send(bus.peer, other, PeerVanished(bus.peer))

    def _publish(self, sender: SimulatedBus, publication: Received) -> None:
        self.published += 1
        kind = publication.key.rpartition("/")[2]
        for other in self._attached.values():
            if other is sender or (other.kinds is not None and kind not in other.kinds):
                continue
            if self._loss and self._losses.random() < self._loss:
                self.lost += 1
                self._draw_delay_s()
            else:
                self.delivered += 1
                self._send(sender.peer, other, publication)

    def _send(self, sender: str, receiver: SimulatedBus, event: BusEvent) -> None:
        """Put one event on one link, behind what is on its way there."""
        link = (sender, receiver.peer)
        arrival_s = max(self._time.now_s + self._draw_delay_s(), self._last_arrivals_s.get(link, 0.0))
        self._last_arrivals_s[link] = arrival_s
        self._time.call_at(arrival_s, receiver._arrive, event)

    def _draw_delay_s(self) -> float:
        return self._least_s + (self._greatest_s - self._least_s) * self._delays.random()
