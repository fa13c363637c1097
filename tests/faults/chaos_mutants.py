"""Rules of the protocol left out one at a time: the campaign must find out each of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from typing import Any, Final, TypeAlias

import pytest
from msgspec import structs

from agents import dispatcher
from agents.allegiance import Allegiance
from agents.dispatcher import Dispatcher
from agents.mission import Ranging
from agents.movement_authority import MovementAuthority
from agents.ranging import Transponder
from agents.reign_duty import ReignDuty
from agents.retreat import Retreat
from agents.robot import Robot
from agents.shared_estimate import SharedEstimate
from agents.shell import PeerShell
from agents.sighted_set import SightedSet
from agents.stage_follower import StageFollower
from estimation.shared_ranges import SharedRanges
from protocol.ballot import Ballot
from protocol.core import Persist
from protocol.election import LEASE_S, Election
from protocol.held_tree import HeldTree
from protocol.messages import Authority, Reign, Topology, Tree, Warrant
from protocol.negotiation import Negotiation
from protocol.obedience import Obedience
from protocol.roster import Roster
from protocol.voter import Voter
from tests.faults.light_team import LightPlanner

Patch: TypeAlias = pytest.MonkeyPatch
Mutant: TypeAlias = Callable[[Patch], None]

MUTANTS: Final[dict[str, Mutant]] = {}
"""By name. Each breaks one rule for as long as the patch lasts."""


def _mutant(function: Mutant) -> Mutant:
    MUTANTS[function.__name__] = function
    return function


@_mutant
def skips_the_write(patch: Patch) -> None:
    """Promises without a disk."""

    def write(self: Any, reign: Reign, now_s: float) -> None:
        self._voter.begin(reign, now_s)
        self._promised(reign, now_s)

    patch.setattr(Election, "_write", write)


@_mutant
def says_before_it_is_written(patch: Patch) -> None:
    """Promises when it has asked the disk, not when the disk has answered."""
    write = Election._write

    def write_and_say(self: Any, reign: Reign, now_s: float) -> None:
        write(self, reign, now_s)
        self._promised(reign, now_s)

    patch.setattr(Election, "_write", write_and_say)


@_mutant
def does_not_write_its_own_vote(patch: Patch) -> None:
    """A candidate votes for itself without a promise on disk."""
    write = Election._write

    def write_for_others(self: Any, reign: Reign, now_s: float) -> None:
        write(self, reign, now_s)
        if reign.leader == self._name:
            self._effects = [effect for effect in self._effects if not isinstance(effect, Persist)]
            self._promised(reign, now_s)

    patch.setattr(Election, "_write", write_for_others)


@_mutant
def ignores_the_epoch(patch: Patch) -> None:
    """Promises an epoch again, or an earlier one."""
    patch.setattr(Voter, "may_promise", lambda self, _reign, now_s: self.is_free(now_s))


@_mutant
def ignores_its_promise(patch: Patch) -> None:
    """Promises a higher epoch while an earlier promise runs."""
    patch.setattr(
        Voter, "may_promise", lambda self, reign, _now_s: self.promise is None or reign.epoch > self.promise.epoch
    )
    patch.setattr(Voter, "is_free", lambda _self, _now_s: True)


@_mutant
def votes_at_once_after_a_restart(patch: Patch) -> None:
    """Does not rest."""
    begin = Voter.__init__

    def begin_awake(self: Any, *arguments: Any, **named: Any) -> None:
        begin(self, *arguments, **named)
        self.rests_until_s = -math.inf

    patch.setattr(Voter, "__init__", begin_awake)


@_mutant
def counts_the_lease_from_the_reply(patch: Patch) -> None:
    """A leader's lease begins when the votes arrive."""
    handle, now = Election.handle, [0.0]

    def handle_at(self: Any, event: Any, now_s: float) -> Any:
        now[0] = now_s
        return handle(self, event, now_s)

    def count(self: Any, voter: str, correlation: str) -> None:
        if correlation in self._asked_s:
            self.count_from(voter, now[0])

    patch.setattr(Election, "handle", handle_at)
    patch.setattr(Ballot, "count", count)


@_mutant
def counts_votes_of_any_round(patch: Patch) -> None:
    """Does not compare correlations: a late vote counts for the latest round."""

    def count(self: Any, voter: str, _correlation: str) -> None:
        self.count_from(voter, max(self._asked_s.values()))

    patch.setattr(Ballot, "count", count)


@_mutant
def is_elected_by_a_minority(patch: Patch) -> None:
    """One vote less than a majority is enough."""
    patch.setattr(Roster, "majority", property(lambda self: max(1, len(self.voters) // 2)))


@_mutant
def leads_on_when_its_lease_has_ended(patch: Patch) -> None:
    """Takes its lease for half as long again as it was promised."""
    held_until_s: Any = Ballot.__dict__["held_until_s"].fget
    patch.setattr(Ballot, "held_until_s", property(lambda self: held_until_s(self) + 0.5 * LEASE_S))


@_mutant
def obeys_without_a_warrant(patch: Patch) -> None:
    """Takes an order for fresh that brings back none of its marks."""
    patch.setattr(Obedience, "_end_s", lambda _self, _warrant: math.inf)


@_mutant
def judges_validity_on_arrival(patch: Patch) -> None:
    """Obeys for what was left of the lease from when the order arrived."""
    heed = Obedience.heed

    def heed_from_now(self: Any, reign: Reign, warrant: Warrant, now_s: float) -> Any:
        self._said_s = dict.fromkeys(self._said_s, now_s)
        return heed(self, reign, warrant, now_s)

    patch.setattr(Obedience, "heed", heed_from_now)


@_mutant
def ignores_the_sequence(patch: Patch) -> None:
    """Takes messages in the order in which they arrive."""

    def take(self: Any, _kind: str, _authority: Authority, reign: Reign, warrant: Warrant, now_s: float) -> Any:
        return self.heed(reign, warrant, now_s)

    patch.setattr(Obedience, "take", take)
    patch.setattr(PeerShell, "_is_news", lambda _self, _address, _envelope: True)


@_mutant
def drives_on_when_it_obeys_nobody(patch: Patch) -> None:
    """Tells its body to drive whenever obedience may end. Much is released, so that it can."""
    patch.setattr(dispatcher, "HORIZON_S", 10.0)
    patch.setattr(Allegiance, "obeyed_until_s", property(lambda _self: math.inf))


@_mutant
def begins_two_stages_ahead(patch: Patch) -> None:
    """Waits for nobody. Much is released, so that it can."""
    patch.setattr(dispatcher, "HORIZON_S", 10.0)
    patch.setattr(StageFollower, "_keeps_back", lambda _self, _name, _stage: False)


@_mutant
def goes_beyond_what_is_released(patch: Patch) -> None:
    """Goes on to the end of its way, if nobody keeps it back."""
    patch.setattr(
        StageFollower,
        "_may_begin",
        lambda self, stage: not any(self._keeps_back(name, stage) for name in self._ways),
    )


@_mutant
def releases_before_all_have_accepted(patch: Patch) -> None:
    """Does not wait for robots that have not said that they accept a revision."""
    patch.setattr(MovementAuthority, "undecided", property(lambda _self: ()))


@_mutant
def releases_links_first(patch: Patch) -> None:
    """Puts every tree in force when it is proposed."""
    patch.setattr(Negotiation, "unconfirmed", lambda _self: ())


@_mutant
def trusts_its_predecessor(patch: Patch) -> None:
    """Takes the links of an earlier reign's tree for confirmed."""
    patch.setattr(Negotiation, "_confirmed_here", lambda _self, _tree: True)


@_mutant
def takes_a_proposal_for_the_tree(patch: Patch) -> None:
    """Lets go of its links when others are proposed."""
    take = HeldTree.take

    def take_it_all(self: Any, word: Topology) -> str:
        tree: Tree | None = word.committed if word.proposal is None else word.proposal.tree
        return take(self, structs.replace(word, committed=tree))

    patch.setattr(HeldTree, "take", take_it_all)


@_mutant
def goes_before_the_tree_is_in_force(patch: Patch) -> None:
    """Releases the motion to another tree while that is being negotiated."""
    permit = Dispatcher.permit
    patch.setattr(Dispatcher, "permit", lambda self, _permitted: permit(self, True))


@_mutant
def keeps_proposals_open(patch: Patch) -> None:
    """Never gives a proposal up."""
    handle = Negotiation.handle

    def handle_for_ever(self: Any, event: Any, now_s: float) -> Any:
        if self._open is not None:
            self._open.opened_s = now_s
        return handle(self, event, now_s)

    patch.setattr(Negotiation, "handle", handle_for_ever)


@_mutant
def never_stands(patch: Patch) -> None:
    """Has no patience left to stand for election when a leader is gone."""
    patch.setattr(Election, "_stands_at_s", property(lambda self: math.inf if self._highest_epoch else 0.0))


@_mutant
def remembers_everything(patch: Patch) -> None:
    """Never forgets a mark."""

    def mark(self: Any, now_s: float) -> str:
        self._marks += 1
        name = f"{self._incarnation}.{self._marks}"
        self._said_s[name] = now_s
        return name

    patch.setattr(Obedience, "mark", mark)


@_mutant
def fails_on_a_vanished_peer(patch: Patch) -> None:
    """A role that raises where it should not."""
    handle = Robot.handle

    def handle_badly(self: Any, event: Any, now_s: float) -> Any:
        if type(event).__name__ == "PeerVanished":
            raise KeyError(event.peer)
        return handle(self, event, now_s)

    patch.setattr(Robot, "handle", handle_badly)


@_mutant
def forgets_the_round_trip(patch: Patch) -> None:
    """Takes an answer for as good as it was when the agent measured, however long it was on its way."""
    measured = SharedEstimate.measured

    def measured_exactly(self: Any, anchor: Any, range_m: float, _bound_m: float, now_s: float) -> Any:
        return measured(self, anchor, range_m, Ranging().bound_m, now_s)

    patch.setattr(SharedEstimate, "measured", measured_exactly)


@_mutant
def forgets_the_clock_bound(patch: Patch) -> None:
    """Takes all clocks for one."""
    begin = SharedRanges.__init__

    def begin_with_one_clock(self: Any, *arguments: Any, **named: Any) -> None:
        begin(self, *arguments, **named)
        self._widening = 0.0

    patch.setattr(SharedRanges, "__init__", begin_with_one_clock)


@_mutant
def predicts_half_the_walk(patch: Patch) -> None:
    """Takes the agent to walk at half its speed."""
    predict = SightedSet.predict
    patch.setattr(SightedSet, "predict", lambda self, distance_m: predict(self, 0.5 * distance_m))


@_mutant
def stamps_ranges_on_arrival(patch: Patch) -> None:
    """Takes what others have measured for measured when it is heard of."""
    receive = SharedRanges.receive

    def receive_now(self: Any, records: Any, now_s: float = math.inf) -> int:
        stamped = records if now_s == math.inf else [replace(record, time_s=now_s) for record in records]
        return receive(self, stamped, now_s)

    patch.setattr(SharedRanges, "receive", receive_now)


@_mutant
def folds_at_the_present_time(patch: Patch) -> None:
    """Takes the set in front of the log for that of the time at which it was folded."""
    fold = SharedRanges._fold

    def fold_for_now(self: Any, records: Any, given_up: int) -> None:
        fold(self, records, given_up)
        key, state = self._base
        self._base = (max(self._last_s, key[0]), *key[1:]), state
        self._now = self._base[0], deepcopy(state)
        self._marks = []

    patch.setattr(SharedRanges, "_fold", fold_for_now)


@_mutant
def believes_a_lying_radio(patch: Patch) -> None:
    """No rule of ours left out, but one of the radio's: its ranges are up to three times as wrong as it says."""
    reply = Transponder._reply

    def lie(self: Any, asker: str, request: Any, position: Any) -> Any:
        honest = reply(self, asker, request, position)
        error_m = honest.range_m - math.dist(request.position, position)
        return structs.replace(honest, range_m=max(0.0, honest.range_m + 2.0 * error_m))

    patch.setattr(Transponder, "_reply", lie)


@_mutant
def sends_all_to_one_lane(patch: Patch) -> None:
    """Plans as if robots had no bodies."""
    deploy = LightPlanner._deploy

    def deploy_in_one_lane(self: Any, *arguments: Any) -> Any:
        plan = deploy(self, *arguments)
        placements = tuple(structs.replace(place, position=(place.position[0], 1.0)) for place in plan.placements)
        return replace(plan, placements=placements)

    patch.setattr(LightPlanner, "_deploy", deploy_in_one_lane)


@_mutant
def gives_orders_after_its_lease(patch: Patch) -> None:
    """Stays in office when its lease has ended, and gives its last warrant again."""
    warrant, last = Election.warrant, dict[Any, Any]()

    def warrant_again(self: Any, now_s: float) -> Warrant | None:
        last[self] = warrant(self, now_s) or last.get(self)
        return last[self]

    patch.setattr(Election, "warrant", warrant_again)
    patch.setattr(Election, "_leave_office", lambda _self, _reason: None)


@_mutant
def obeys_after_the_lease(patch: Patch) -> None:
    """Obeys for two leases more than it was told to."""
    end_s = Obedience._end_s
    patch.setattr(Obedience, "_end_s", lambda self, warrant: end_s(self, warrant) + 2.0 * LEASE_S)


@_mutant
def takes_any_word_on_the_tree(patch: Patch) -> None:
    """Does not ask whether a leader's word on the tree is in force."""
    take = Allegiance.take

    def take_words(self: Any, kind: str, *arguments: Any) -> str:
        refusal = take(self, kind, *arguments)
        return "" if kind == "topology" else refusal

    patch.setattr(Allegiance, "take", take_words)


@_mutant
def takes_words_on_the_tree_as_they_come(patch: Patch) -> None:
    """Takes them in the order in which they arrive."""
    take, is_news = Obedience.take, PeerShell._is_news

    def take_in_any_order(
        self: Any, kind: str, authority: Authority, reign: Reign, warrant: Warrant, now_s: float
    ) -> Any:
        if kind == "topology":
            return self.heed(reign, warrant, now_s)
        return take(self, kind, authority, reign, warrant, now_s)

    patch.setattr(Obedience, "take", take_in_any_order)
    patch.setattr(
        PeerShell, "_is_news",
        lambda self, address, envelope: is_news(self, address, envelope) or address.kind == "topology",
    )  # fmt: skip


@_mutant
def counts_trees_anew(patch: Patch) -> None:
    """Numbers every tree of a reign as its first."""
    propose = Negotiation._propose

    def propose_first(self: Any, wish: Any, now_s: float) -> None:
        self._sequence = 0
        propose(self, wish, now_s)

    patch.setattr(Negotiation, "_propose", propose_first)


@_mutant
def puts_in_force_what_is_new(patch: Patch) -> None:
    """Forgets the links that a tree has in common with the one before."""
    commit = Negotiation._commit_if_confirmed

    def commit_new_links(self: Any, now_s: float) -> None:
        if self._open is not None and not self.unconfirmed():
            proposal = self._open.proposal
            tree = structs.replace(proposal.tree, edges=tuple(link.ends for link in proposal.links))
            self._open.proposal = structs.replace(proposal, tree=tree)
        commit(self, now_s)

    patch.setattr(Negotiation, "_commit_if_confirmed", commit_new_links)


@_mutant
def takes_an_earlier_tree(patch: Patch) -> None:
    """Keeps the links that were named last, whatever their number."""
    take = HeldTree.take

    def take_last(self: Any, word: Topology) -> str:
        if word.committed is not None:
            self.committed = word.committed
        return take(self, word)

    patch.setattr(HeldTree, "take", take_last)


@_mutant
def goes_while_another_tree_is_negotiated(patch: Patch) -> None:
    """Never takes back the leave to release more, once it has been given."""
    permit = Dispatcher.permit

    def permit_for_good(self: Any, permitted: bool) -> None:
        self.given = permitted or getattr(self, "given", False)
        permit(self, self.given)

    patch.setattr(Dispatcher, "permit", permit_for_good)


@_mutant
def waits_for_everybody(patch: Patch) -> None:
    """Plans only when all robots of the roster are there."""
    patch.setattr(ReignDuty, "_is_complete", lambda self, _now_s: not self._roll.missing)


@_mutant
def goes_back_on_its_own(patch: Patch) -> None:
    """Does not wait until all others have turned."""
    patch.setattr(Retreat, "missing", lambda _self, _now_s: ())


@_mutant
def goes_back_as_fast_as_it_can(patch: Patch) -> None:
    """Does not wait for those who are farther out."""
    patch.setattr(Retreat, "_may_enter", lambda self, _stage, now_s: bool(self.others) and not self.missing(now_s))
