"""Settings of a zenoh session for one peer or one operator: all that zenoh 1.10 needs to be told.

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
- Shared memory is off: what a killed process leaves behind there, nobody tidies up.
"""

from __future__ import annotations

import json
import os
import re
import secrets
from collections.abc import Sequence
from typing import Any, Final

os.environ.setdefault("ZENOH_RUNTIME", "(rx: (worker_threads: 16))")

import zenoh

from protocol.messages import MAXIMUM_PAYLOAD_BYTES

LEASE_MS: Final = 1000

_ENDPOINT: Final = re.compile(r"(?P<transport>[a-z]+)/(?P<host>[^/?#]+):(?P<port>[0-9]{1,5})(?P<rest>[?#].*)?\Z")


class BusUnavailable(ValueError):
    """A session cannot be opened; the text says what is in the way and what to do about it."""


def open_session(listen: str | None, connect: Sequence[str]) -> Any:
    """A zenoh session. Links come up as the others do.

    Args:
        listen: endpoint for others to dial; None if none shall.
        connect: endpoints of the team; none needs to be up. If ``listen`` is among them, they are taken for the roster
            that all have, and only those after it in alphabetical order are dialled.

    Raises:
        BusUnavailable: an endpoint is malformed, or the port to listen on cannot be had.
    """
    for endpoint in [*connect, *([] if listen is None else [listen])]:
        _check(endpoint)
    others = [endpoint for endpoint in connect if listen is None or listen not in connect or endpoint > listen]
    configuration = zenoh.Config()
    for place, value in _settings(listen, others).items():
        configuration.insert_json5(place, json.dumps(value))
    try:
        return zenoh.open(configuration)
    except zenoh.ZError as problem:
        raise BusUnavailable(_explanation(listen, others, str(problem))) from problem


def _settings(listen: str | None, others: Sequence[str]) -> dict[str, object]:
    return {
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


def _check(endpoint: str) -> None:
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
