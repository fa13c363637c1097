"""Elections that break one rule each, and the bounds within which the exploration finds out."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, ClassVar

from protocol.ballot import Ballot
from protocol.core import Persist
from protocol.election import Effect
from protocol.messages import Reign, Warrant
from protocol.obedience import Obedience, Refusal
from protocol.roster import Roster
from protocol.voter import Voter
from tests.protocol.election_exploration import Bounds, ExploredElection

SLOW, RIGHT, FAST = 0.95, 1.0, 1.05
TWO_STAND = Bounds(steps=2, candidacies=2, rounds=(1, 1, 0), refusals=False, rates=(SLOW, RIGHT, FAST))
ONE_DIES = Bounds(steps=2, candidacies=2, rounds=(1, 1, 0), refusals=False, rates=(SLOW, RIGHT, FAST), crashes=1)
DISKS_ARE_SLOW = Bounds(steps=2, candidacies=2, rounds=(1, 1, 0), refusals=False, crashes=1, slow_disks=True)
ONE_OBEYS = Bounds(
    steps=2, candidacies=2, rounds=(2, 1, 0), refusals=False, rates=(FAST, FAST, SLOW), heeding=("robot2",)
)
LEASE_JUST_OVER = Bounds(
    steps=1,
    candidacies=2,
    rounds=(2, 1, 0),
    refusals=False,
    rates=(FAST, FAST, SLOW),
    heeding=("robot2",),
    steps_in_lease=10 / 9,
)
"""After one step the leader's lease is over by its own fast clock, and would not be by the slow one of the robot that
obeys, if that counted the whole of it."""


class Mutant(ExploredElection):
    """An election with a part replaced."""

    bounds: ClassVar[Bounds]
    """Within which it is found out."""
    voter: ClassVar[type[Voter]] = Voter
    ballot: ClassVar[type[Ballot]] = Ballot
    judge: ClassVar[type[Obedience]] = Obedience

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self._voter.__class__ = self.voter
        self.obedience.__class__ = self.judge

    def _open_ballot(self) -> None:
        super()._open_ballot()
        assert self._ballot is not None
        self._ballot.__class__ = self.ballot


class SkipsTheWrite(Mutant):
    """Promises without a disk."""

    bounds = ONE_DIES

    def _write(self, reign: Reign, now_s: float) -> None:
        self._voter.begin(reign, now_s)
        self._promised(reign, now_s)


class SaysBeforeItIsWritten(Mutant):
    """Promises when it has asked the disk, not when the disk has answered."""

    bounds = DISKS_ARE_SLOW

    def _write(self, reign: Reign, now_s: float) -> None:
        super()._write(reign, now_s)
        self._promised(reign, now_s)


class DoesNotWriteItsOwnVote(Mutant):
    """A candidate votes for itself without a promise on disk."""

    bounds = ONE_DIES

    def _write(self, reign: Reign, now_s: float) -> None:
        super()._write(reign, now_s)
        if reign.leader == self._name:
            self._effects = [effect for effect in self._effects if not isinstance(effect, Persist)]
            self._promised(reign, now_s)


class IgnoresTheEpoch(Mutant):
    """Promises an epoch again, or an earlier one."""

    bounds = TWO_STAND

    class Changed(Voter):
        def may_promise(self, _reign: Reign, now_s: float) -> bool:
            return self.is_free(now_s)

    voter = Changed


class IgnoresItsPromise(Mutant):
    """Promises a higher epoch while an earlier promise runs."""

    bounds = TWO_STAND

    class Changed(Voter):
        def may_promise(self, reign: Reign, _now_s: float) -> bool:
            return self.promise is None or reign.epoch > self.promise.epoch

        def is_free(self, _now_s: float) -> bool:
            return True

    voter = Changed


class VotesAtOnceAfterARestart(Mutant):
    """Does not rest."""

    bounds = ONE_DIES

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self._voter.rests_until_s = -math.inf


class CountsFromTheReply(Mutant):
    """A leader's lease begins when the votes arrive."""

    bounds = TWO_STAND

    class Changed(Ballot):
        now_s = 0.0

        def count(self, voter: str, correlation: str) -> None:
            if correlation in self._asked_s:
                self.count_from(voter, self.now_s)

    def handle(self, event: Any, now_s: float) -> list[Effect]:
        self.Changed.now_s = now_s
        return super().handle(event, now_s)

    ballot = Changed


class CountsVotesOfAnyRound(Mutant):
    """Does not compare correlations: a late vote counts for the latest round."""

    bounds = replace(TWO_STAND, rounds=(2, 1, 0))

    class Changed(Ballot):
        def count(self, voter: str, _correlation: str) -> None:
            self.count_from(voter, max(self._asked_s.values()))

    ballot = Changed


class ElectedByWhoIsThere(Mutant):
    """A majority of those that answered is enough."""

    bounds = TWO_STAND

    class Changed(Ballot):
        def wants_only(self, voter: str, _now_s: float) -> bool:
            return voter not in self._voted_s

        @property
        def held_until_s(self) -> float:
            self._roster = Roster(tuple(self._voted_s) or ("nobody",))
            return super().held_until_s

    ballot = Changed


class LeadsAsLongAsItLikes(Mutant):
    """Looks at the clock when it is woken only."""

    bounds = TWO_STAND

    def leads(self, _now_s: float) -> bool:
        return self.office is not None


class ReusesAnEpoch(Mutant):
    """Stands again for an epoch that it has withdrawn from: the withdrawal may arrive late."""

    bounds = replace(TWO_STAND, steps=1, candidacies=3, rounds=(2, 1, 0), rates=(RIGHT, RIGHT, RIGHT))

    def _withdraw(self, now_s: float) -> None:
        super()._withdraw(now_s)
        self._highest_epoch -= 1


class CountsFromArrival(Mutant):
    """Obeys for what was left of the lease from when the order arrived."""

    bounds = ONE_OBEYS

    class Changed(Obedience):
        def heed(self, reign: Reign, warrant: Warrant, now_s: float) -> Refusal:
            self._said_s = dict.fromkeys(self._said_s, now_s)
            return super().heed(reign, warrant, now_s)

    judge = Changed


class ObeysWithoutAMark(Mutant):
    """Takes an order for fresh that brings back none of its marks."""

    bounds = ONE_OBEYS

    class Changed(Obedience):
        def _end_s(self, _warrant: Warrant) -> float:
            return math.inf

    judge = Changed


class LeavesOfficeFree(Mutant):
    """Forgets its promise to itself when its lease has ended, although robots may still obey it."""

    bounds = replace(LEASE_JUST_OVER, candidacies=3, rounds=(2, 2, 0))

    def _leave_office(self, reason: str) -> None:
        super()._leave_office(reason)
        self._voter.runs_until_s = -math.inf


MUTANTS = Mutant.__subclasses__()
