"""The bus between processes: a zenoh session of its own for each peer, with every setting that zenoh 1.10 needs.

What the settings are for:

- Peers do not relay, and a link found by gossip is never dialled again after a cut. So multicast and gossip are off,
  every peer knows the whole roster, and goes on dialling for as long as it lives. Good to about 40 peers.
- Of two peers only one dials the other. When both do, and one of them is stopped for longer than the lease (a signal, a
  suspended machine), the other's new link can arrive before the old ones are seen to be gone; zenoh then adds it to
  what is a new session for the other side only, declares nothing there, and one of the two no longer hears the other,
  or never sees its token again. Measured: after one in ten of 80 such stops, and after none of 100 with one dialler.
- A process that ends takes its token with it within milliseconds; one that is stopped or cut off, within the lease of
  1 s (zenoh's own default is 10 s).
- A peer that vanishes silently can stop the reception of the survivors for 10 s when few threads receive
  (zenoh#2718); hence ``ZENOH_RUNTIME``, which is read when zenoh is first used.
- All is sent with congestion control DROP: to block would stall the sender for 5 s when one listener is stuck, and
  everything that matters is said again. Deployments overtake the rest.
- Shared memory is off: what a killed process leaves behind there, nobody tidies up.
"""

from __future__ import annotations

import json
import os
import re
import secrets
import socket
import threading
from collections.abc import Sequence
from typing import Any

os.environ.setdefault("ZENOH_RUNTIME", "(rx: (worker_threads: 16))")

import zenoh

from protocol import keys
from protocol.bus import Deliver, PeerAppeared, PeerVanished, Received
from protocol.messages import MAXIMUM_PAYLOAD_BYTES

LEASE_MS = 1000
CLOSE_WITHIN_S = 1.0
"""zenoh waits up to 10 s for a listener that is stuck; the token is gone by then, and the process may end."""

_ENDPOINT = re.compile(r"(?P<transport>[a-z]+)/(?P<host>[^/?#]+):(?P<port>[0-9]{1,5})(?P<rest>[?#].*)?\Z")


class BusUnavailable(ValueError):
    """A session cannot be opened; the text says what is in the way and what to do about it."""


class ZenohBus:
    """The connection of one peer, or of one operator, to its team. Made by :meth:`open`."""

    def __init__(self, session: Any, team: str, name: str, deliver: Deliver) -> None:
        self.team = team
        self.name = name
        self.dropped = 0
        """Publications that were not sent because the bus was closed, or refused because they were too long."""
        self._session = session
        self._deliver = deliver
        self._open = True
        self._declared: list[Any] = []
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
    ) -> ZenohBus:
        """Join a team. Returns at once; links come up as the others do, and :class:`PeerAppeared` tells when.

        Args:
            team: the team's name.
            name: of the peer, or of the operator.
            listen: endpoint for others to dial, e.g. ``tcp/127.0.0.1:17447``; None if none shall.
            connect: endpoints of the team; none needs to be up. If ``listen`` is among them, they are taken for the
                roster that all have, and only those after it in alphabetical order are dialled.
            deliver: called from zenoh's threads with all that others say, and with the coming and going of peers.
            operator: join as an operator: hear everything, have no token.

        Raises:
            BusUnavailable: a name or an endpoint is malformed, or the port to listen on cannot be had.
        """
        for what, text in (("team", team), ("operator" if operator else "peer", name)):
            if not keys.is_name(text):
                raise BusUnavailable(
                    f"'{text}' cannot be the name of a {what}: use up to 32 lower-case letters, digits and _, "
                    f"a letter first, and not '{keys.OPERATOR}'"
                )
        for endpoint in [*connect, *([] if listen is None else [listen])]:
            _check_endpoint(endpoint)
        others = [endpoint for endpoint in connect if listen is None or listen not in connect or endpoint > listen]
        try:
            session = zenoh.open(_configuration(listen, others))
        except zenoh.ZError as problem:
            raise BusUnavailable(_explanation(listen, others, str(problem))) from problem
        bus = cls(session, team, name, deliver)
        bus._declare(token=not operator)
        threading.Thread(target=bus._leave, name="zenoh bus leaves", daemon=True).start()
        threading.Thread(target=bus._close_with_main_thread, name="zenoh bus ends").start()
        return bus

    def publish(self, key: str, payload: bytes) -> None:
        """Send to all that are linked now; what does not fit into the queue to one of them is dropped there."""
        urgent = key.endswith("/deployment")
        try:
            self._session.put(
                key,
                payload,
                encoding=zenoh.Encoding.APPLICATION_JSON,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=zenoh.Priority.INTERACTIVE_HIGH if urgent else zenoh.Priority.DATA,
            )
        except zenoh.ZError:  # the session is closed
            self.dropped += 1

    def close(self) -> None:
        """Take the token back and leave. Returns within a second or so; a second call does nothing."""
        self._open = False
        self._leaving.set()
        self._left.wait(CLOSE_WITHIN_S)

    def _declare(self, *, token: bool) -> None:
        session = self._session
        self._declared.append(
            session.declare_subscriber(keys.everything(self.team), self._hear, allowed_origin=zenoh.Locality.REMOTE)
        )
        liveliness = session.liveliness()
        self._declared.append(liveliness.declare_subscriber(keys.tokens(self.team), self._notice, history=True))
        if token:
            own = keys.Address(self.team, self.name, keys.ALIVE).key
            self._declared.append(liveliness.declare_token(own))

    def _close_with_main_thread(self) -> None:
        """Let no process wait for ever that ends without :meth:`close`.

        zenoh calls back from Python threads that the interpreter waits for before it does anything else, functions of
        ``atexit`` included. It waits for this thread as well, and starts no new ones by then.
        """
        threading.main_thread().join()
        self.close()

    def _leave(self) -> None:
        """Wait for :meth:`close`, then do what may hang, in a thread that nobody waits for any longer than that."""
        self._leaving.wait()
        for declared in reversed(self._declared):  # the token first
            declared.undeclare()
        self._session.close()
        self._left.set()

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
        appeared = sample.kind == zenoh.SampleKind.PUT
        self._deliver(PeerAppeared(address.speaker) if appeared else PeerVanished(address.speaker))


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


def _configuration(listen: str | None, others: Sequence[str]) -> Any:
    settings = {
        "mode": "peer",
        # Never with zeros in front: zenoh prints those ids short and then does not know them again.
        "id": f"1{secrets.token_hex(14)}1",
        "listen/endpoints": [] if listen is None else [listen],
        "connect/endpoints": list(others),
        "connect/timeout_ms": -1,
        "connect/exit_on_failure": False,
        "connect/retry": {"period_init_ms": 200, "period_max_ms": 500, "period_increase_factor": 2},
        "open/return_conditions": {"connect_scouted": False, "declares": False},
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/link/tx/lease": LEASE_MS,
        "transport/link/tx/keep_alive": 4,
        "transport/link/rx/max_message_size": 2 * MAXIMUM_PAYLOAD_BYTES,
        "transport/shared_memory/enabled": False,
    }
    configuration = zenoh.Config()
    for place, value in settings.items():
        configuration.insert_json5(place, json.dumps(value))
    return configuration


def _check_endpoint(endpoint: str) -> None:
    match = _ENDPOINT.match(endpoint)
    if match is None or not 0 < int(match["port"]) < 65536:
        raise BusUnavailable(f"'{endpoint}' is no endpoint: write it as tcp/HOST:PORT, e.g. tcp/127.0.0.1:17447")


def _explanation(listen: str | None, others: Sequence[str], problem: str) -> str:
    if "Address already in use" in problem:
        return f"port of {listen} is taken by another program: end that program or choose another port"
    if "Cannot assign requested address" in problem:
        return f"{listen} is no address of this machine: listen on one of its own, e.g. 127.0.0.1"
    if "Permission denied" in problem:
        return f"{listen} may not be listened on by this user: choose a port above 1023"
    endpoints = ", ".join([*([] if listen is None else [listen]), *others])
    return f"zenoh cannot use the endpoints {endpoints}: {problem.split(' at /')[0]}"
