"""What is said about who leads: votes, and what every order bears (docs/election.md)."""

from __future__ import annotations

from typing import Annotated

import msgspec

from protocol.wire_types import Body, Correlation, Count, Name, Seconds


class Authority(msgspec.Struct, frozen=True, kw_only=True):
    """In whose name, and in which order, a command is given. Later beats earlier: compare (epoch, sequence)."""

    epoch: Count
    leader: Name
    sequence: Count
    """Rises with every command of an epoch, repetitions included."""


class Reign(msgspec.Struct, frozen=True, kw_only=True):
    """Who leads in an epoch, and which process of that name. No two leaders share an epoch."""

    epoch: Count
    leader: Name
    incarnation: Count
    """Of the leader: started again, it has to be elected again."""


class LastHeard(msgspec.Struct, frozen=True, kw_only=True):
    """The latest mark that a speaker had heard of a peer."""

    peer: Name
    mark: Correlation
    age_s: Seconds = 0.0
    """How long before it spoke it had heard it."""


class Warrant(msgspec.Struct, frozen=True, kw_only=True):
    """How long what a leader says may be obeyed; each hearer judges on its own clock how old it is.

    Obey for nine tenths of ``lease_s`` and the mark's ``age_s`` together from when you said the mark of yours that is
    in ``marks``, and not at all without one of this incarnation. The leader had heard that mark ``age_s`` before it
    spoke, so that delay makes orders run out sooner, not later.
    """

    lease_s: Seconds
    """What was left of the leader's lease when it spoke, by its own clock and with its caution."""
    marks: Annotated[tuple[LastHeard, ...], msgspec.Meta(max_length=64)]


class VoteRequest(Body, frozen=True, kw_only=True, tag="vote_request"):
    """Promise me the lease of this epoch, or renew your promise. Said in rounds by who would lead, stands or leads."""

    epoch: Count
    correlation: Correlation
    """Of this round."""
    warrant: Warrant | None = None
    """Of a leader in office; none while it only stands."""
    canvass: bool = False
    """Promise nothing yet, but say whether you would."""
    withdrawn: bool = False
    """It has not won, and will not lead in this epoch or one before: promises of these are void. Wants no answer."""


class Vote(Body, frozen=True, kw_only=True, tag="vote"):
    """The answer to a :class:`VoteRequest`. Peers that have no vote answer too: what is obeyed depends on marks."""

    candidate: Name
    correlation: Correlation
    granted: bool
    """Whether nobody else will be promised a lease for one lease from now on; to a canvass, whether it would be so."""
    promise: Reign | None = None
    """The last one made; it is on disk. Of a peer that has no vote: whom it obeyed last."""
    mark: Correlation
    """Chosen by the voter, another one each time that time has passed; comes back in warrants."""
