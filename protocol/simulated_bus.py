"""A bus in virtual time: one process, one thread, one seed.

:class:`VirtualTime` is the clock: it jumps to the next thing that is due, so that minutes of protocol take
milliseconds. :class:`SimulatedNetwork` carries publications between the peers attached to it, each with a delay drawn
from the seed, and has all go wrong that is asked for. The same seed and the same calls give the same history, to the
last bit, under every ``PYTHONHASHSEED``, and on every machine as far as its logarithms round alike.

Like a zenoh session over tcp, a sound link keeps the order of what it carries, and tokens are not lost. What can be
wrong with links says :mod:`protocol.simulated_links`; what can be wrong with peers is for whoever attaches them.

Models: trio's MockClock; FoundationDB's simulation testing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from heapq import heappop, heappush
from typing import Any

from protocol.bus import BusEvent, Deliver, PeerAppeared, PeerVanished, Received
from protocol.keys import route
from protocol.simulated_links import SOUND, Delays, Link, LinkFaults


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
        if not -math.inf < time_s < math.inf:
            raise ValueError(f"cannot call a function at {time_s} s: the time must be finite")
        self._asked += 1
        heappush(self._due, (time_s if time_s > self.now_s else self.now_s, self._asked, function, arguments))

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
        self,
        network: SimulatedNetwork,
        peer: str,
        number: int,
        deliver: Deliver,
        operator: bool,
        kinds: Collection[str] | None,
    ) -> None:
        self.peer = peer
        self.number = number
        """Of the attachment: those that come later have greater ones."""
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

    def close(self, noticed_after_s: float = 0.0) -> None:
        """Leave: nothing is delivered here any more, and the others see the peer vanish. Closing again does nothing.

        Args:
            noticed_after_s: the token goes so much later, unless the peer has come back by then.
        """
        if self._open:
            self._open = False
            self._network._detach(self, noticed_after_s)

    def _arrive(self, event: BusEvent) -> None:
        if self._open:
            self._deliver(event)


class SimulatedNetwork:
    """All links of one simulated team; everybody hears everybody.

    Args:
        time: the clock that deliveries are put on.
        seed: of all that is left to chance here.
        delay_s: least and greatest delay of a message on a sound link; drawn uniformly for each message and receiver.
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
        """Publications that were put on a link, counted once for each time that one arrives."""
        self.lost = 0
        """Publications that chance or a cut took, counted once for each receiver."""
        self.usual = LinkFaults(loss=loss) if loss else SOUND
        """What is wrong with every link."""
        self._time = time
        self._seed = seed
        self._delays = Delays(delay_s[0], 0.5 * (delay_s[1] - delay_s[0]))
        self._attachments = 0
        self._attached: dict[str, SimulatedBus] = {}
        self._links: dict[tuple[str, str], Link] = {}
        self._routes: dict[tuple[str, str], list[tuple[Link, SimulatedBus]]] = {}
        """By speaker and key; of those that are attached now."""

    def attach(
        self, peer: str, deliver: Deliver, *, operator: bool = False, kinds: Collection[str] | None = None
    ) -> SimulatedBus:
        """Open a bus. A peer's token is seen by all others, and it sees theirs; operators have no token.

        Args:
            peer: its name.
            deliver: takes what arrives.
            operator: whether it is an operator and no peer.
            kinds: kinds of messages that it listens to; None: all. What is for one peer reaches it, and operators.

        Raises:
            ValueError: somebody of that name is attached already.
        """
        name = f"operator/{peer}" if operator else peer
        if name in self._attached:
            raise ValueError(f"{name} is attached to the simulated network already: close its bus first")
        self._attachments += 1
        bus = SimulatedBus(self, name, self._attachments, deliver, operator, kinds)
        others = tuple(self._attached.values())
        self._attached[name] = bus
        self._routes.clear()
        for other in others:
            self._show_token(name, other)
            self._link(other.peer, name).token = 0  # a process that begins has seen nobody
            self._show_token(other.peer, bus)
        return bus

    def set_faults(self, speaker: str, hearer: str, faults: LinkFaults | None) -> None:
        """What is wrong with the link from one peer to another from now on; None: no more than everywhere.

        Tokens that went or came while it was cut are seen to have done so as soon as it is not.
        """
        link = self._link(speaker, hearer)
        if link.faults.delays is not None and (faults is None or faults.delays is None):
            link.heal()
        link.faults = self.usual if faults is None else faults
        if hearer in self._attached:
            self._show_token(speaker, self._attached[hearer])

    def hide_token(self, speaker: str, hearer: str) -> None:
        """Let a peer see the token of another vanish now, which it cannot reach, if the link is cut."""
        link, bus = self._link(speaker, hearer), self._attached.get(hearer)
        if link.faults.cut and link.token and bus is not None:
            link.token = 0
            self._send(link, bus, PeerVanished(speaker))

    def _detach(self, bus: SimulatedBus, noticed_after_s: float) -> None:
        del self._attached[bus.peer]
        self._routes.clear()
        if noticed_after_s > 0.0:
            self._time.call_at(self._time.now_s + noticed_after_s, self._show_tokens, bus.peer)
        else:
            self._show_tokens(bus.peer)

    def _show_tokens(self, speaker: str) -> None:
        for other in tuple(self._attached.values()):
            if other.peer != speaker:
                self._show_token(speaker, other)

    def _show_token(self, speaker: str, hearer: SimulatedBus) -> None:
        """Bring up to date what a hearer sees of a peer's token, if anything passes."""
        link, bus = self._link(speaker, hearer.peer), self._attached.get(speaker)
        number = 0 if bus is None or bus.operator else bus.number
        if number == link.token or link.faults.cut:
            return
        if link.token:
            self._send(link, hearer, PeerVanished(speaker))
        if number:
            self._send(link, hearer, PeerAppeared(speaker))
        link.token = number

    def _publish(self, sender: SimulatedBus, publication: Received) -> None:
        self.published += 1
        routes = self._routes.get((sender.peer, publication.key))
        if routes is None:
            kind, to = route(publication.key)
            routes = self._routes[sender.peer, publication.key] = [
                (self._link(sender.peer, other.peer), other)
                for other in self._attached.values()
                if other is not sender
                and (other.kinds is None or kind in other.kinds)
                and (not to or other.operator or other.peer == to)
            ]
        now_s, call_at = self._time.now_s, self._time.call_at
        for link, other in routes:
            if link.faults is SOUND:
                self.delivered += 1
                call_at(link.carry(now_s), other._arrive, publication)
                continue
            arrivals = list(link.carry_badly(publication, now_s))
            self.lost += not arrivals
            self.delivered += len(arrivals)
            for arrival_s, arriving in arrivals:
                call_at(arrival_s, other._arrive, arriving)

    def _send(self, link: Link, receiver: SimulatedBus, event: BusEvent) -> None:
        """Put a token on a link, behind what is on its way there."""
        self._time.call_at(link.carry_token(self._time.now_s), receiver._arrive, event)

    def _link(self, speaker: str, hearer: str) -> Link:
        link = self._links.get((speaker, hearer))
        if link is None:
            link = self._links[speaker, hearer] = Link(f"{self._seed}/{speaker}/{hearer}", self._delays)
            link.faults = self.usual
        return link
