"""The bus as everybody above it sees it: publish bytes under a key; hear what others publish; hear who comes and goes.

Two buses keep this promise: :mod:`protocol.zenoh_bus` (processes, sockets, wall clock) and
:mod:`protocol.simulated_bus` (one process, virtual time, a seed). Neither guarantees delivery, order between
speakers, or the absence of duplicates; everything above copes with that.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeAlias

import msgspec


class Received(msgspec.Struct, frozen=True):
    """A publication arrived."""

    key: str
    payload: bytes


class PeerAppeared(msgspec.Struct, frozen=True):
    """The liveliness token of a peer was seen."""

    peer: str


class PeerVanished(msgspec.Struct, frozen=True):
    """The liveliness token of a peer is gone: its process ended, or its lease ran out."""

    peer: str


BusEvent: TypeAlias = Received | PeerAppeared | PeerVanished

Deliver: TypeAlias = Callable[[BusEvent], None]
"""Given to a bus when it opens. Called from any thread; must only enqueue, never call the bus and never block."""


class Bus(Protocol):
    """An open connection of one peer (or one operator) to its team."""

    def publish(self, key: str, payload: bytes) -> None:
        """Send to all peers that listen. Never blocks for long; what cannot be sent is dropped and counted."""

    def close(self) -> None:
        """Take the token back and leave. Returns within two seconds whatever the network does."""
