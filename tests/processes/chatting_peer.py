"""A peer for the tests: says a heartbeat 20 times a second until it is killed or told to close by the end of its input.

python chatting_peer.py TEAM NAME ENDPOINT ENDPOINTS [forget]
"""

from __future__ import annotations

import ctypes
import select
import signal
import sys

from protocol.bus import BusEvent
from protocol.keys import Address
from protocol.messages import Envelope, Heartbeat, encode
from protocol.zenoh_bus import ZenohBus


def hear(event: BusEvent) -> None:
    """Nothing to do; that there is a callback keeps zenoh's threads busy."""


def main(team: str, name: str, endpoint: str, endpoints: str, *how: str) -> None:
    """Speak until the end of the input; then leave properly, or just end."""
    ctypes.CDLL(None).prctl(1, signal.SIGKILL, 0, 0, 0)  # die with the test
    bus = ZenohBus.open(team, name, endpoint, endpoints.split(","), hear)
    key, sequence = Address(team, name, "heartbeat").key, 0
    while not select.select([sys.stdin], [], [], 0.05)[0]:
        body = Heartbeat(role="robot", mode="waiting")
        bus.publish(key, encode(Envelope(sender=name, incarnation=0, sequence=sequence, sent_at_s=0.0, body=body)))
        sequence += 1
    if "forget" not in how:
        bus.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
