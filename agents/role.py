"""The seam between what a peer decides and where it runs: events and the time go in, effects come out.

A :class:`Role` knows no socket, no clock, no thread and no file. :mod:`agents.shell` feeds it events and carries out
its effects, live (:mod:`agents.runtime`) and in virtual time (``launcher.simulation``) alike, so the very same role
objects run in both worlds. A role is deterministic: equal events at equal times give equal effects. Most are composed
of parts (:mod:`agents.mind`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Final, Protocol, TypeAlias

import msgspec

from agents.driver import Ranged
from agents.records import AnyRecord
from protocol.bus import PeerAppeared, PeerVanished
from protocol.core import Persist, Written
from protocol.keys import Address
from protocol.messages import AnyBody, Envelope, Point

__all__ = [
    "RETRY_S", "Compute", "Drive", "Effect", "Event", "Heard", "JobDone", "Persist", "Publish", "Ranged", "Record",
    "Role", "WakeAt", "Woken", "Written",
]  # fmt: skip


RETRY_S: Final = 0.2
"""Who failed while it was awake, and so asked for no further wake-up, is woken again after this."""


class Woken(msgspec.Struct, frozen=True):
    """The moment asked for with :class:`WakeAt` has come. ``position`` is where the driver says the body is."""

    position: Point


class Heard(msgspec.Struct, frozen=True):
    """A well-formed message arrived whose sender is the one its key names."""

    address: Address
    envelope: Envelope


class JobDone(msgspec.Struct, frozen=True):
    """A computation asked for with :class:`Compute` has ended: with a result, or with the text of its failure."""

    job: str
    result: Any
    duration_s: float
    failure: str = ""


Event: TypeAlias = Woken | Ranged | Heard | JobDone | Written | PeerAppeared | PeerVanished
"""``Written`` tells what became of a ``Persist``; both are those of :mod:`protocol.core`."""


class Publish(msgspec.Struct, frozen=True):
    """Say this; the shell puts it in an envelope and finds the key."""

    body: AnyBody


class Drive(msgspec.Struct, frozen=True):
    """Move at this velocity, in metres per second, for at most so long. A later one replaces an earlier one.

    Counted from the moment of the :class:`Woken` that it answers, so that a leg ends where it was meant to.
    """

    velocity: Point
    for_s: float = 0.5
    """Then the body stands by itself, whatever has become of the mind."""


class Record(msgspec.Struct, frozen=True):
    """Put this into the recording."""

    record: AnyRecord


class WakeAt(msgspec.Struct, frozen=True):
    """Send :class:`Woken` at this mission time, in seconds. A later request replaces an earlier one."""

    time_s: float


class Compute(msgspec.Struct, frozen=True):
    """Run a pure function beside the control loop; :class:`JobDone` carries the result back under the same name.

    Live it runs in a worker thread, in simulation inline with a modelled delay. A role has one job of a name
    under way at a time.
    """

    job: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...] = ()


Effect: TypeAlias = Publish | Drive | Record | WakeAt | Compute | Persist


class Role(Protocol):
    """A peer's mind. Times are seconds of mission time (``run_time``), which starts at the launcher's epoch."""

    hears: frozenset[str]
    """Kinds of messages that it listens to; the shell does not even decode the others."""

    def start(self, now_s: float, position: Point) -> Iterable[Effect]:
        """First effects; must contain a :class:`WakeAt`."""

    def handle(self, event: Event, now_s: float) -> Iterable[Effect]:
        """Effects of one event, carried out one by one as they come. Never raises on what other peers say."""
