"""The bus between processes: a zenoh session of its own for each peer (:mod:`protocol.zenoh_settings`).

- *Who hears what* is declared to zenoh, one expression for each kind of message, so that nobody is sent what it would
  throw away; operators hear everything.
- *What arrives* waits in rings of zenoh's, one for each expression, out of which the newest push the oldest; so a
  flood costs only its own kind. A thread of ours empties them all every few milliseconds: to wake a thread costs as
  much as to hear a message, and zenoh must not be called from its own threads.
- *What is sent* is sent with congestion control DROP: to block would stall the sender for 5 s when one listener is
  stuck, and everything that matters is said again. Deployments overtake the rest.
- *Whoever joins late asks*: when it sees the token of a peer it queries that peer's keys, and is answered with what the
  peer has said last of each standing kind, byte for byte. The answers are delivered like publications, so that whatever
  is old or double is dropped as always. Nothing is missed in between: zenoh tells the other side of our subscriptions
  before it passes on the query. Other programs may ask in the same way at any time, ``get("<team>/v1/**")``.
"""

from __future__ import annotations

import secrets
import socket
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from typing import Any, Final, TypeAlias

import zenoh

from protocol import keys
from protocol.bus import Deliver, PeerAppeared, PeerVanished, Received
from protocol.messages import MAXIMUM_PAYLOAD_BYTES, STANDING_KINDS, STANDS_FOR_S, Goal
from protocol.zenoh_settings import BusUnavailable, open_session

__all__ = ["BusUnavailable", "ZenohBus", "free_endpoints"]

CLOSE_WITHIN_S: Final = 1.0
"""zenoh waits up to 10 s for a listener that is stuck; the token is gone by then, and the process may end."""

READ_EVERY_S: Final = 0.01
"""Between two looks at what has arrived."""

MOST_WAITING: Final = 1024
"""Messages of one expression that wait to be read."""

ANSWER_WITHIN_S: Final = 1.0
"""Answers that come later are not waited for: by then all has been said again."""

OPERATORS_KIND: Final = str(Goal.__struct_config__.tag)
"""The only one that operators say."""

Take: TypeAlias = Callable[[], Any]
"""The next thing that has arrived somewhere, or None."""


class ZenohBus:
    """The connection of one peer, or of one operator, to its team. Made by :meth:`open`."""

    def __init__(self, session: Any, team: str, name: str, deliver: Deliver, kinds: frozenset[str] | None) -> None:
        self.team = team
        self.name = name
        self.dropped = 0
        """Publications that were not sent because the bus was closed, or refused because they were too long."""
        self._session = session
        self._deliver = deliver
        self._kinds = kinds
        self._open = True
        self._declared: list[Any] = []
        self._sources: list[tuple[Take, Callable[[Any], None]]] = [(self._next_answer, self._hear_answer)]
        """What arrives, and what to do with it."""
        self._answers: deque[Any] = deque(maxlen=MOST_WAITING)
        """To our queries. No ring: what waits in one is lost when the query is over."""
        self._said: dict[str, tuple[float, bytes]] = {}
        """Of each standing key when it was said last, and what."""
        self._leaving = threading.Event()
        self._left = threading.Event()

    @classmethod
    def open(
        cls,
        team: str,
        name: str,
        listen: str | None,
        connect: Sequence[str],
        deliver: Deliver,
        *,
        operator: bool = False,
        kinds: Collection[str] | None = None,
    ) -> ZenohBus:
        """Join a team. Returns at once; links come up as the others do, and :class:`PeerAppeared` tells when.

        Args:
            team: the team's name.
            name: of the peer, or of the operator.
            listen: endpoint for others to dial, e.g. ``tcp/127.0.0.1:17447``; None if none shall.
            connect: endpoints of the team; none needs to be up. If ``listen`` is among them, they are taken for the
                roster that all have, and only those after it in alphabetical order are dialled.
            deliver: called from a thread of the bus with all that others say, and with the coming and going of peers.
            operator: join as an operator: have no token, and answer no queries.
            kinds: kinds of messages that are heard, of those for one peer only what is for this one; None: everything.

        Raises:
            BusUnavailable: a name or an endpoint is malformed, or the port to listen on cannot be had.
        """
        for what, text in (("team", team), ("operator" if operator else "peer", name)):
            if not keys.is_name(text):
                raise BusUnavailable(
                    f"'{text}' cannot be the name of a {what}: use up to 32 lower-case letters, digits and _, "
                    f"a letter first, and not '{keys.OPERATOR}'"
                )
        bus = cls(open_session(listen, connect), team, name, deliver, None if kinds is None else frozenset(kinds))
        bus._declare(peer=not operator)
        reader = threading.Thread(target=bus._read, name="zenoh bus reads", daemon=True)
        reader.start()
        threading.Thread(target=bus._leave, args=(reader,), name="zenoh bus leaves", daemon=True).start()
        threading.Thread(target=bus._close_with_main_thread, name="zenoh bus ends").start()
        return bus

    def publish(self, key: str, payload: bytes) -> None:
        """Send to all that are linked now and listen; what does not fit into the queue to one of them is dropped."""
        kind, _ = keys.route(key)
        if kind in STANDING_KINDS:
            self._said[key] = (time.monotonic(), payload)
        try:
            self._session.put(
                key,
                payload,
                encoding=zenoh.Encoding.APPLICATION_JSON,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=zenoh.Priority.INTERACTIVE_HIGH if kind == "deployment" else zenoh.Priority.DATA,
            )
        except zenoh.ZError:  # the session is closed
            self.dropped += 1

    def close(self) -> None:
        """Take the token back and leave. Returns within a second or so; a second call does nothing."""
        self._open = False
        self._leaving.set()
        self._left.wait(CLOSE_WITHIN_S)

    def _declare(self, *, peer: bool) -> None:
        session, remote = self._session, zenoh.Locality.REMOTE
        for expression in _expressions(self.team, self.name, self._kinds):
            self._listen(session.declare_subscriber(expression, _ring(), allowed_origin=remote), self._hear)
        if peer:
            own = keys.Address(self.team, self.name, "*").key
            queries = session.declare_queryable(own, _ring(), allowed_origin=remote)
            self._declared.append(queries)
            # Beside the reading: an answer goes as its query came, which may be to wait for an asker that is stuck.
            threading.Thread(target=self._answer_all, args=(queries,), name="zenoh bus answers", daemon=True).start()
        liveliness = session.liveliness()
        self._listen(liveliness.declare_subscriber(keys.tokens(self.team), _ring(), history=True), self._notice)
        if peer:
            alive = keys.Address(self.team, self.name, keys.ALIVE).key
            self._declared.append(liveliness.declare_token(alive))

    def _listen(self, declared: Any, handle: Callable[[Any], None]) -> None:
        self._declared.append(declared)
        self._sources.append((declared.handler.try_recv, handle))

    def _close_with_main_thread(self) -> None:
        """Take the token back when a process ends without :meth:`close`, before zenoh's threads are stopped anyhow."""
        threading.main_thread().join()
        self.close()

    def _leave(self, reader: threading.Thread) -> None:
        """Wait for :meth:`close`, then do what may hang, in a thread that nobody waits for any longer than that."""
        self._leaving.wait()
        reader.join()
        for declared in reversed(self._declared):  # the token first
            declared.undeclare()
        self._session.close()
        self._left.set()

    def _read(self) -> None:
        """Look at what has arrived again and again, until the bus is closed."""
        while self._open:
            for take, handle in self._sources:
                self._take_all(take, handle)
            time.sleep(READ_EVERY_S)

    def _take_all(self, take: Take, handle: Callable[[Any], None]) -> None:
        for _ in range(MOST_WAITING):  # not without end, whoever floods it
            item = take()
            if item is None:
                return
            try:
                handle(item)
            except Exception:  # costs this item and not the hearing
                traceback.print_exc()

    def _hear(self, sample: Any) -> None:
        if not self._open or sample.kind != zenoh.SampleKind.PUT:
            return
        if len(sample.payload) > MAXIMUM_PAYLOAD_BYTES:
            self.dropped += 1
            return
        self._deliver(Received(str(sample.key_expr), sample.payload.to_bytes()))

    def _notice(self, sample: Any) -> None:
        address = keys.parse(str(sample.key_expr))
        if not self._open or address is None or address.speaker == self.name:
            return
        if sample.kind == zenoh.SampleKind.PUT:
            self._deliver(PeerAppeared(address.speaker))
            self._ask(address.speaker)
        else:
            self._deliver(PeerVanished(address.speaker))

    def _ask(self, peer: str) -> None:
        """Ask a peer for its standing words."""
        if self._kinds is not None and not self._kinds & STANDING_KINDS:
            return
        self._session.get(
            keys.Address(self.team, peer, "*").key,
            zenoh.handlers.Callback(self._answers.append, indirect=False),  # no thread for each query
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=ANSWER_WITHIN_S,
            congestion_control=zenoh.CongestionControl.DROP,
            allowed_destination=zenoh.Locality.REMOTE,
        )

    def _answer_all(self, queries: Any) -> None:
        for query in queries:  # until it is declared no more
            with suppress(zenoh.ZError):  # costs this answer and not those to others
                self._answer(query)

    def _answer(self, query: Any) -> None:
        """Say the standing words that a query asks for to whoever asks."""
        now_s = time.monotonic()
        with query:
            for key, (said_s, payload) in tuple(self._said.items()):
                if now_s - said_s < STANDS_FOR_S and query.key_expr.intersects(zenoh.KeyExpr(key)):
                    query.reply(key, payload, encoding=zenoh.Encoding.APPLICATION_JSON)

    def _next_answer(self) -> Any:
        return self._answers.popleft() if self._answers else None

    def _hear_answer(self, reply: Any) -> None:
        sample = reply.ok
        if sample is not None and (self._kinds is None or keys.route(str(sample.key_expr))[0] in self._kinds):
            self._hear(sample)


def _ring() -> Any:
    return zenoh.handlers.RingChannel(MOST_WAITING)


def _expressions(team: str, name: str, kinds: Collection[str] | None) -> list[str]:
    """What to subscribe to, to hear these kinds and nothing else."""
    if kinds is None:
        return [keys.everything(team)]
    return [
        keys.Address(
            team, "*", kind, operator=kind == OPERATORS_KIND, to=name if kind in keys.ADDRESSED_KINDS else ""
        ).key
        for kind in sorted(kinds)
    ]


def free_endpoints(count: int) -> list[str]:
    """Endpoints on 127.0.0.1 whose ports nobody uses now, all different.

    Below 32768, where the system takes no ports for outgoing connections: the port of a peer that is down for a while
    stays its own.

    Raises:
        BusUnavailable: there are not that many.
    """
    chance = secrets.SystemRandom()  # two launchers that start together shall not try the same ports
    endpoints: list[str] = []
    for port in chance.sample(range(20000, 32768), 12768):
        if len(endpoints) == count:
            break
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
        endpoints.append(f"tcp/127.0.0.1:{port}")
    if len(endpoints) < count:
        raise BusUnavailable(f"only {len(endpoints)} of {count} ports are free on 127.0.0.1: end some other programs")
    return endpoints
