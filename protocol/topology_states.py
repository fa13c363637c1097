"""The states of a leader's negotiation of the tree, and what leads from one to the next. All of it is in this table.

:mod:`protocol.negotiation` finds out what occurs, and changes its state through :data:`TRANSITIONS` only: an occurrence
that the table does not name for a state cannot happen in it. The diagram in ``docs/topology.md`` is made from this
table.
"""

from __future__ import annotations

from enum import Enum
from typing import Final


class Phase(Enum):
    """Where a negotiation stands; the value is said to people."""

    IDLE = "idle"
    """This peer does not lead. It proposes nothing."""
    COLLECTING = "collecting"
    """It leads, and asks the others which tree was in force last."""
    KEEPING = "keeping"
    """A tree is in force, or none yet, and nothing is proposed."""
    PROPOSING = "proposing"
    """A proposal is open. The tree before stays in force."""


class Occurrence(Enum):
    """What happens in a negotiation; the value is the label in the diagram."""

    ELECTED = "has been elected"
    COLLECTED = "all that are there have answered, or time is up"
    PROPOSED = "another tree is wanted"
    CONFIRMED = "both ends of every new link have confirmed it"
    REFUSED = "an end refuses"
    ROUNDS_ENDED = "it has been said as often as may be"
    WITHDRAWN = "a member is lost, or the leader thinks better of it"
    LEASE_ENDED = "it leads no more"


TRANSITIONS: Final[dict[Phase, dict[Occurrence, Phase]]] = {
    Phase.IDLE: {
        Occurrence.ELECTED: Phase.COLLECTING,
    },
    Phase.COLLECTING: {
        Occurrence.COLLECTED: Phase.KEEPING,
        Occurrence.ELECTED: Phase.COLLECTING,
        Occurrence.LEASE_ENDED: Phase.IDLE,
    },
    Phase.KEEPING: {
        Occurrence.PROPOSED: Phase.PROPOSING,
        Occurrence.ELECTED: Phase.COLLECTING,
        Occurrence.LEASE_ENDED: Phase.IDLE,
    },
    Phase.PROPOSING: {
        Occurrence.CONFIRMED: Phase.KEEPING,
        Occurrence.REFUSED: Phase.KEEPING,
        Occurrence.ROUNDS_ENDED: Phase.KEEPING,
        Occurrence.WITHDRAWN: Phase.KEEPING,
        Occurrence.ELECTED: Phase.COLLECTING,
        Occurrence.LEASE_ENDED: Phase.IDLE,
    },
}
"""Phase → occurrence → phase. ``ELECTED`` while leading: it has moved its reign to a higher epoch."""
