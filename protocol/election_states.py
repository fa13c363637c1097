"""The states of a peer in the election, and what leads from one to the next. All of it stands in this table.

*Occurrences* are what :mod:`protocol.election` finds out about the time, its votes and its disk; it changes the state
through :data:`TRANSITIONS` only, and an occurrence that the table does not name for a state cannot happen in it. The
diagram in ``docs/election.md`` is made from this table.
"""

from __future__ import annotations

from enum import Enum
from typing import Final


class Standing(Enum):
    """Where a peer stands; the value is said to people."""

    OBSERVING = "observing"
    """It has no vote: the tracked agent."""
    RESTING = "resting"
    """It has just started, or could not write: it promises nothing for a while."""
    WAITING = "waiting"
    """It is free to promise. If nobody asks it will stand itself."""
    CANVASSING = "canvassing"
    """It asks who would promise, and binds nobody: who is cut off with a few others gets no further than this."""
    FOLLOWING = "following"
    """Its promise to another peer is running."""
    CANDIDATE = "candidate"
    """It asks for promises. It casts its own vote last, when that makes it the leader."""
    LEADING = "leading"
    """It holds the lease."""


class Occurrence(Enum):
    """What happens to a peer; the value is the label in the diagram."""

    RESTED = "has rested"
    PROMISED = "a promise to another is on disk"
    PROMISE_ENDED = "the promise has run out or is void"
    PATIENCE_ENDED = "nobody has led for a lease and its waiting time"
    ENCOURAGED = "a majority would promise"
    ELECTED = "a majority has voted, its own vote is on disk"
    OUTRANKED = "hears a leader, or a candidate listed before it"
    NOT_ELECTED = "no majority in half a lease"
    LEASE_ENDED = "no majority has renewed the lease"
    WRITE_FAILED = "a promise could not be written"


TRANSITIONS: Final[dict[Standing, dict[Occurrence, Standing]]] = {
    Standing.OBSERVING: {},
    Standing.RESTING: {
        Occurrence.RESTED: Standing.WAITING,
    },
    Standing.WAITING: {
        Occurrence.PROMISED: Standing.FOLLOWING,
        Occurrence.PATIENCE_ENDED: Standing.CANVASSING,
        Occurrence.WRITE_FAILED: Standing.RESTING,
    },
    Standing.CANVASSING: {
        Occurrence.PROMISED: Standing.FOLLOWING,
        Occurrence.ENCOURAGED: Standing.CANDIDATE,
        Occurrence.OUTRANKED: Standing.WAITING,
        Occurrence.WRITE_FAILED: Standing.RESTING,
    },
    Standing.FOLLOWING: {
        Occurrence.PROMISED: Standing.FOLLOWING,
        Occurrence.PROMISE_ENDED: Standing.WAITING,
        Occurrence.WRITE_FAILED: Standing.RESTING,
    },
    Standing.CANDIDATE: {
        Occurrence.ELECTED: Standing.LEADING,
        Occurrence.OUTRANKED: Standing.WAITING,
        Occurrence.NOT_ELECTED: Standing.WAITING,
        Occurrence.WRITE_FAILED: Standing.RESTING,
    },
    Standing.LEADING: {
        Occurrence.ELECTED: Standing.LEADING,
        Occurrence.LEASE_ENDED: Standing.WAITING,
        Occurrence.WRITE_FAILED: Standing.RESTING,
    },
}
"""State → occurrence → state. ``ELECTED`` while leading: it has moved its reign to a higher epoch."""
