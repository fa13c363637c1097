"""Who leads: one peer at a time, by a lease that a majority of the voters has promised it.

A voter promises its vote for one lease (:mod:`protocol.voter`), a candidate counts votes into a lease
(:mod:`protocol.ballot`), everybody judges by their own clocks whom to obey (:mod:`protocol.obedience`); this module
joins them and does what each state of :mod:`protocol.election_states` is there for. ``docs/election.md`` says why it is
safe, and tests/protocol/election_exploration.py looks at every history of three voters for a counterexample.

Leases after C. Gray and D. Cheriton, "Leases", SOSP 1989, doi:10.1145/74850.74870, and for a majority of voters without
a common clock M. Trencseni et al., "PaxosLease", 2012, arXiv:1209.4187; promises on disk before they are said, and
epochs, after L. Lamport, "The part-time parliament", 1998, doi:10.1145/279227.279229.

How a role uses it: it hands over :class:`~protocol.core.Heard` votes and requests, :class:`~protocol.core.Written` and
:class:`~protocol.core.Tick`, carries out the effects, adds :meth:`Election.warrant` to every order it gives (and gives
none if that is None), and asks :meth:`Election.take` about every order it hears.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from random import Random
from typing import Final, TypeAlias

from protocol.ballot import CAUTION, Ballot
from protocol.core import Heard, Note, Persist, Say, Tick, WakeAt, Written
from protocol.election_states import TRANSITIONS, Occurrence, Standing
from protocol.messages import LastHeard, Reign, Vote, VoteRequest, Warrant
from protocol.obedience import Obedience, Obeys, ObeysNobody
from protocol.promises import encode_promise
from protocol.roster import Roster
from protocol.voter import Voter

LEASE_S: Final = 1.0
"""How long a promise runs."""

ROUND_S: Final = LEASE_S / 8
"""A candidate asks, and a leader renews its lease, once in this time: some loss costs no lease."""

CALM_ROUND_S: Final = LEASE_S / 4
"""A leader whose last round all have answered who vote for it loses nothing now, and asks again after this only."""

CALM_AFTER_S: Final = LEASE_S / 2
"""Not before it has asked for so long: the first rounds tell the team that it leads, which is to go fast."""

URGENT_ROUND_S: Final = LEASE_S / 16
"""A leader asks so often when half of its lease has gone by without enough answers."""

CANDIDACY_S: Final = LEASE_S / 2
"""A candidate that has not won by then gives back the promises that it has, so that others may try."""

WAITING_S: Final = ((0.02 * LEASE_S, 0.04 * LEASE_S), (0.05 * LEASE_S, 0.25 * LEASE_S))
"""Least and greatest waiting time of the voter listed first, and of the others. Drawn, so that few stand at once."""

REST_AFTER_FAILURE_S: Final = 5.0 * LEASE_S
"""A voter whose disk refuses a promise does not try again before this."""

LARGEST_LEAP: Final = 1 << 32
"""An epoch further ahead than this is damage, not an election; following it would use up all epochs at once."""


@dataclass(frozen=True, slots=True)
class Leads:
    """From now on it leads, in this reign. Said again when its reign moves to a higher epoch."""

    reign: Reign


@dataclass(frozen=True, slots=True)
class LeadsNoMore:
    """From now on it must not give any order."""

    reason: str


Event: TypeAlias = Heard | Written | Tick
Effect: TypeAlias = Say | Persist | WakeAt | Note | Leads | LeadsNoMore | Obeys | ObeysNobody


class Election:
    """One peer's part in the election. Times are of its own clock, in seconds.

    Args:
        roster: of the team; peers without a vote take part to learn whom to obey.
        team, name, incarnation: of this peer. An incarnation must never be used twice; 0 says that no process has borne
            the name before.
        promise: what :func:`protocol.promises.decode_promise` found.
        seed: of the waiting times.
        now_s: the present time.
    """

    def __init__(
        self, roster: Roster, *, team: str, name: str, incarnation: int, promise: Reign | None, seed: int, now_s: float
    ) -> None:
        self.standing = Standing.RESTING if name in roster.voters else Standing.OBSERVING
        """Its state."""
        self.office: Reign | None = None
        """The reign that it leads in; None while it does not lead."""
        votes = name in roster.voters
        self._voter = Voter(promise, LEASE_S, now_s, first=incarnation == 0)
        self.obedience = Obedience(name, incarnation, LEASE_S, self._voter if votes else None)
        """Judges orders, one's own too."""
        self.lease_until_s = -math.inf
        """When its lease ends; minus infinity while it holds none."""
        self._roster = roster
        self._team = team
        self._name = name
        self._incarnation = incarnation
        self._chance = Random(f"{seed}/{name}/{incarnation}/election")
        self._ballot: Ballot | None = None
        self._canvass: Ballot | None = None
        self._highest_epoch = promise.epoch if promise else 0
        self._marks: dict[str, tuple[str, float]] = {}
        """The latest mark of each peer that has answered it, and when it came."""
        self._rounds = self._token = 0
        self._reply_to: tuple[str, str] = ("", "")
        """Candidate and correlation of the request whose promise is being written."""
        self._withdrawn_epoch = -1
        self._outdated = self._failing = False
        self._leader_heard_s = -math.inf
        if name != roster.voters[0]:
            # When a team starts the base station has half a lease to be there.
            self._leader_heard_s = now_s - LEASE_S / 2
        self._waiting_since_s = self._patience_s = self._candidate_until_s = self._next_round_s = math.inf
        self._effects: list[Effect] = []

    def handle(self, event: Event, now_s: float) -> list[Effect]:
        """Effects of one event; the last of them says when to send the next :class:`~protocol.core.Tick`."""
        self._keep_time(now_s)
        match event:
            case Heard(peer, incarnation, VoteRequest() as request):
                if peer in self._roster.voters and peer != self._name:
                    self._answer(Reign(epoch=request.epoch, leader=peer, incarnation=incarnation), request, now_s)
            case Heard(peer, _, Vote() as vote):
                if vote.candidate == self._name and peer in self._roster.names and peer != self._name:
                    self._count(peer, vote, now_s)
            case Written(token, failure):
                if token == self._token and self._voter.writing is not None:
                    self._write_failed(failure, now_s) if failure else self._promised(self._voter.writing, now_s)
        self._keep_time(now_s)
        effects, self._effects = self._effects, []
        effects.append(WakeAt(self._next_wake_s(now_s)))
        return effects

    def leads(self, now_s: float) -> bool:
        """Whether it holds an unexpired lease."""
        return self.office is not None and now_s < self.lease_until_s

    def warrant(self, now_s: float) -> Warrant | None:
        """What goes with an order given now; None: no order may be given."""
        if not self.leads(now_s):
            return None
        marks = {**self._marks, self._name: (self.obedience.mark(now_s), now_s)}
        heard = tuple(LastHeard(peer=peer, mark=mark, age_s=now_s - at_s) for peer, (mark, at_s) in marks.items())
        return Warrant(lease_s=self.lease_until_s - now_s, marks=heard)

    def _answer(self, reign: Reign, request: VoteRequest, now_s: float) -> None:
        """Vote on a request, or say why not; heed a leader."""
        if reign.epoch > self._highest_epoch + LARGEST_LEAP:
            return
        voter = self._voter
        if request.withdrawn:
            voter.release(reign, now_s)
            return
        free = self.standing in (Standing.WAITING, Standing.CANVASSING, Standing.FOLLOWING)
        if request.canvass:
            self._say_vote(reign.leader, request.correlation, free and voter.may_promise(reign, now_s), now_s)
            return
        if request.warrant is not None:
            self._leader_heard_s = now_s
        self._make_way(reign.leader, request.warrant is not None, now_s)
        free = self.standing in (Standing.WAITING, Standing.CANVASSING, Standing.FOLLOWING)
        granted = free and voter.renew(reign, now_s)
        if granted:
            self._go(Occurrence.PROMISED, now_s)
        elif reign == voter.writing:
            self._reply_to = (reign.leader, request.correlation)
            return
        elif free and voter.may_promise(reign, now_s):
            self._reply_to = (reign.leader, request.correlation)
            self._write(reign, now_s)
            return
        self._say_vote(reign.leader, request.correlation, granted, now_s)
        if request.warrant is not None:
            self.obedience.heed(reign, request.warrant, now_s)

    def _make_way(self, peer: str, leads: bool, now_s: float) -> None:
        """Stand no longer if the other leads or is listed before; not when the decisive vote is being cast."""
        if self.standing is Standing.CANVASSING and leads:
            self._go(Occurrence.OUTRANKED, now_s)
        elif self.standing is Standing.CANDIDATE and self._voter.writing is None:
            order = self._roster.voters.index
            if leads or order(peer) < order(self._name):
                self._withdraw(now_s)
                self._go(Occurrence.OUTRANKED, now_s)

    def _count(self, peer: str, vote: Vote, now_s: float) -> None:
        """Take note of a peer's mark and promise, and of its vote if it has granted it."""
        self._marks[peer] = (vote.mark, now_s)
        granted = vote.granted and peer in self._roster.voters
        if self._canvass is not None and granted:
            self._canvass.count(peer, vote.correlation)
            self._use_canvass(now_s)
        promise, ballot = vote.promise, self._ballot
        if promise is None or promise.epoch > self._highest_epoch + LARGEST_LEAP:
            return
        self._highest_epoch = max(self._highest_epoch, promise.epoch)
        if granted:
            if ballot is not None and promise == ballot.reign:
                ballot.count(peer, vote.correlation)
                self._use_votes(now_s)
            elif self._is_withdrawn(promise):
                self._say_withdrawn()  # what was said before has not been heard
        elif ballot is not None and promise != ballot.reign and promise.epoch >= ballot.reign.epoch:
            self._outdated = True

    def _use_votes(self, now_s: float) -> None:
        """Prolong the lease, or cast one's own vote if no other is wanted, or take office."""
        ballot = self._ballot
        assert ballot is not None
        if ballot.reign == self.office:
            self.lease_until_s = max(self.lease_until_s, ballot.held_until_s)
            settled = ballot.asked_last_s - ballot.asked_since_s >= CALM_AFTER_S
            if settled and ballot.is_answered(now_s):
                self._next_round_s = ballot.asked_last_s + CALM_ROUND_S
        elif ballot.wants_only(self._name, now_s):
            if self._voter.renew(ballot.reign, now_s):
                ballot.count_from(self._name, now_s)
                self._use_votes(now_s)
            elif self._voter.may_promise(ballot.reign, now_s):
                self._write(ballot.reign, now_s)
        elif ballot.is_cast_by(self._name) and now_s < ballot.held_until_s:
            self.office = ballot.reign
            self.lease_until_s = max(self.lease_until_s, ballot.held_until_s)
            self._next_round_s = now_s
            self._effects.append(Leads(ballot.reign))
            self._go(Occurrence.ELECTED, now_s)

    def _write(self, reign: Reign, now_s: float) -> None:
        self._voter.begin(reign, now_s)
        self._token += 1
        content = encode_promise(reign, team=self._team, voter=self._name, incarnation=self._incarnation)
        self._effects.append(Persist(content, self._token))

    def _promised(self, reign: Reign, now_s: float) -> None:
        """A promise is on disk: say it, or cast one's own vote."""
        self._voter.finish(now_s)
        self._highest_epoch = max(self._highest_epoch, reign.epoch)
        self._failing = False
        if reign.leader != self._name:
            self._go(Occurrence.PROMISED, now_s)
            self._say_vote(*self._reply_to, True, now_s)
        elif self._ballot is not None and reign == self._ballot.reign:
            self._ballot.count_from(self._name, now_s)
            self._use_votes(now_s)
        elif self._is_withdrawn(reign):
            self._voter.release(reign, now_s)  # it took too long: the candidacy is over

    def _write_failed(self, failure: str, now_s: float) -> None:
        self._voter.fail(now_s + REST_AFTER_FAILURE_S)
        if not self._failing:
            self._failing = True
            text = f"{self._name} does not vote, because it cannot keep its promises on disk ({failure})"
            self._effects.append(Note("error", f"{text}; it tries again now and then: make room, or the file writable"))
        if self.standing is Standing.CANDIDATE:
            self._withdraw(now_s)
        elif self.standing is Standing.LEADING:
            self._leave_office("its promise of a new epoch cannot be written")
        self._go(Occurrence.WRITE_FAILED, now_s)

    def _keep_time(self, now_s: float) -> None:
        """Do all that is due."""
        if self.standing is Standing.RESTING and now_s >= self._voter.rests_until_s:
            self._go(Occurrence.RESTED, now_s)
        elif self.standing is Standing.FOLLOWING and self._voter.is_free(now_s):
            self._go(Occurrence.PROMISE_ENDED, now_s)
        elif self.standing is Standing.CANDIDATE and now_s >= self._candidate_until_s:
            self._withdraw(now_s)
            self._go(Occurrence.NOT_ELECTED, now_s)
        elif self.standing is Standing.LEADING and now_s >= self.lease_until_s:
            self._leave_office("no majority has renewed its lease")
            self._go(Occurrence.LEASE_ENDED, now_s)
        if self.standing is Standing.WAITING and self._voter.is_free(now_s) and now_s >= self._stands_at_s:
            self._next_round_s = now_s
            self._go(Occurrence.PATIENCE_ENDED, now_s)
        if self.standing is Standing.CANVASSING and now_s >= self._next_round_s:
            self._ask_who_would(now_s)
        if self.standing in (Standing.CANDIDATE, Standing.LEADING) and now_s >= self._next_round_s:
            self._ask(now_s)
        self._effects += self.obedience.changes(now_s)

    def _ask_who_would(self, now_s: float) -> None:
        """Say a round of canvassing."""
        reign = self._reign(self._highest_epoch + 1)
        if self._canvass is None or self._canvass.reign != reign:
            self._canvass = Ballot(reign, self._roster, LEASE_S)
        correlation = self._next_correlation()
        self._canvass.ask(correlation, now_s)
        self._effects.append(Say(VoteRequest(epoch=reign.epoch, correlation=correlation, canvass=True)))
        self._next_round_s = now_s + ROUND_S
        self._use_canvass(now_s)

    def _use_canvass(self, now_s: float) -> None:
        """Stand if enough would promise their votes, and one's own is free still."""
        if self._canvass is not None and self._canvass.wants_only(self._name, now_s) and self._voter.is_free(now_s):
            self._candidate_until_s, self._next_round_s = now_s + CANDIDACY_S, now_s
            self._open_ballot()
            self._go(Occurrence.ENCOURAGED, now_s)

    def _ask(self, now_s: float) -> None:
        """Say a round of requests; what is asked counts from now."""
        if self._outdated:
            self._open_ballot()  # somebody has promised this epoch to another, or a higher one
        ballot = self._ballot
        assert ballot is not None
        if ballot.is_cast_by(self._name) and self._voter.renew(ballot.reign, now_s):
            ballot.count_from(self._name, now_s)
        correlation = self._next_correlation()
        ballot.ask(correlation, now_s)
        warrant = self.warrant(now_s) if ballot.reign == self.office else None
        self._effects.append(Say(VoteRequest(epoch=ballot.reign.epoch, correlation=correlation, warrant=warrant)))
        urgent = self.office is not None and self.lease_until_s - now_s < CAUTION * LEASE_S / 2
        self._next_round_s = now_s + (URGENT_ROUND_S if urgent else ROUND_S)
        if warrant is not None:
            self.obedience.heed(ballot.reign, warrant, now_s)
        self._use_votes(now_s)

    def _next_correlation(self) -> str:
        self._rounds += 1
        return f"{self._incarnation}.{self._rounds}"

    def _open_ballot(self) -> None:
        self._outdated = False
        self._highest_epoch += 1
        self._ballot = Ballot(self._reign(self._highest_epoch), self._roster, LEASE_S)

    def _withdraw(self, now_s: float) -> None:
        """Give back what has been promised. Never after taking office: robots may be obeying until the lease ends."""
        assert self._ballot is not None
        self._withdrawn_epoch = self._ballot.reign.epoch
        self._voter.release(self._ballot.reign, now_s)
        self._ballot = None
        self._say_withdrawn()

    def _say_withdrawn(self) -> None:
        correlation = f"{self._incarnation}.0"  # of no round: no answer is wanted
        self._effects.append(Say(VoteRequest(epoch=self._withdrawn_epoch, correlation=correlation, withdrawn=True)))

    def _is_withdrawn(self, promise: Reign) -> bool:
        return promise == self._reign(promise.epoch) and promise.epoch <= self._withdrawn_epoch

    def _leave_office(self, reason: str) -> None:
        self.office = self._ballot = None
        self.lease_until_s = -math.inf
        self._effects.append(LeadsNoMore(reason))

    def _say_vote(self, candidate: str, correlation: str, granted: bool, now_s: float) -> None:
        promise = self.obedience.last if self.standing is Standing.OBSERVING else self._voter.promise
        mark = self.obedience.mark(now_s)
        self._effects.append(
            Say(Vote(candidate=candidate, correlation=correlation, granted=granted, promise=promise, mark=mark))
        )

    def _go(self, occurrence: Occurrence, now_s: float) -> None:
        self.standing = TRANSITIONS[self.standing][occurrence]
        if self.standing is not Standing.CANVASSING:
            self._canvass = None
        if self.standing is Standing.WAITING:
            self._waiting_since_s, self._patience_s = now_s, self._draw_patience_s()

    def _draw_patience_s(self) -> float:
        return self._chance.uniform(*WAITING_S[self._name != self._roster.voters[0]])

    @property
    def _stands_at_s(self) -> float:
        return max(self._waiting_since_s, self._leader_heard_s + LEASE_S) + self._patience_s

    def _next_wake_s(self, now_s: float) -> float:
        wake_s = self.obedience.until_s if self.obedience.obeyed(now_s) else math.inf
        match self.standing:
            case Standing.RESTING:
                return min(wake_s, self._voter.rests_until_s)
            case Standing.FOLLOWING if self._voter.writing is None:
                return min(wake_s, self._voter.runs_until_s)
            case Standing.WAITING if self._voter.writing is None:
                return min(wake_s, max(self._stands_at_s, self._voter.runs_until_s))
            case Standing.CANVASSING:
                return min(wake_s, self._next_round_s)
            case Standing.CANDIDATE:
                return min(wake_s, self._candidate_until_s, self._next_round_s)
            case Standing.LEADING:
                return min(wake_s, self.lease_until_s, self._next_round_s)
        return wake_s

    def _reign(self, epoch: int) -> Reign:
        return Reign(epoch=epoch, leader=self._name, incarnation=self._incarnation)
