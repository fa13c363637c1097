"""The seam of the protocol's pure cores: events and the time go in, effects come out.

A core (:mod:`protocol.election`, :mod:`protocol.membership`) knows no bus, clock, thread or file. A role hands it
what concerns it, and passes on its effects; ``now_s`` is this peer's own monotonic clock, whatever its origin, and
must go on while the machine is suspended (``CLOCK_BOOTTIME``, not ``CLOCK_MONOTONIC``).
"""

from __future__ import annotations

from typing import Literal

import msgspec

from protocol.messages import AnyBody


class Tick(msgspec.Struct, frozen=True):
    """Time has passed; wanted at the latest when :class:`WakeAt` says, harmless at any other moment."""


class Heard(msgspec.Struct, frozen=True):
    """A well-formed message arrived whose sender is the one its key names."""

    peer: str
    incarnation: int
    """Of the sender."""
    body: AnyBody


class Written(msgspec.Struct, frozen=True):
    """A :class:`Persist` has been carried out, or could not be."""

    token: int
    failure: str = ""
    """Why the content may not be on disk; empty: it is, and stays there if the power fails now."""


class Say(msgspec.Struct, frozen=True):
    """Publish this: to all, or to whom it is for (:func:`protocol.messages.addressee_of`)."""

    body: AnyBody


class Persist(msgspec.Struct, frozen=True):
    """Put this on disk, in place of what was there; then, and not before, :class:`Written` with the same token.

    Whole or not at all: written to a file beside it, synchronised, renamed, the folder synchronised. One is under way
    at a time.
    """

    content: bytes
    token: int


class WakeAt(msgspec.Struct, frozen=True):
    """Send :class:`Tick` at this time; infinite: not before something else happens. Replaces the one before."""

    time_s: float


class Note(msgspec.Struct, frozen=True):
    """One sentence for the log."""

    level: Literal["info", "warning", "error"]
    text: str
