"""The negotiation of the tree: what it does without faults, what never happens with them, and that this is noticed."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.core import Heard, Tick
from protocol.held_tree import HeldTree
from protocol.messages import Confirmation, LinkView, Milestone, Tree
from protocol.negotiation import (
    COLLECTING_S,
    REST_S,
    ROUND_S,
    ROUNDS,
    Elected,
    InvalidProposal,
    Negotiation,
    Propose,
    Settled,
    Word,
)
from protocol.topology import find_fault
from protocol.topology_states import TRANSITIONS, Occurrence, Phase
from tests.protocol.topology_mutants import HOLDERS, NEGOTIATIONS
from tests.protocol.topology_team import Team, is_tree, live_through

CHAIN = (("base", "robot1"), ("robot1", "robot2"), ("robot2", "agent"))
SHORTER = (("base", "robot1"), ("robot1", "agent"))
ASKED = 40
"""Seeds within which every mutant is to be found out."""


def settled(team: Team) -> Team:
    team.elect("base")
    team.run(0.1)
    return team


def test_a_tree_comes_into_force_when_both_ends_of_all_new_links_have_said_so() -> None:
    team = settled(Team(3, 1))
    assert team.propose(CHAIN)
    assert not team.committed
    team.run(0.2)
    assert [tree.edges for tree in team.committed] == [CHAIN]
    assert all(team.links(name) == {frozenset(edge) for edge in CHAIN} for name in team.names)
    assert team.committed[0].number == (1, 0)


def test_only_new_links_are_asked_about_in_one_reign_and_all_of_them_in_the_next() -> None:
    team = settled(Team(3, 2))
    team.propose(CHAIN)
    team.run(0.2)
    mind = team.peers["base"].negotiation
    effects = mind.handle(Propose(("base", "robot1", "agent"), SHORTER, {}, "optimum", "x"), team.time.now_s)
    (word,) = (effect for effect in effects if isinstance(effect, Word))
    assert word.proposal is not None
    assert [link.ends for link in word.proposal.links] == [("robot1", "agent")]
    assert word.proposal.released == (("robot1", "robot2"), ("robot2", "agent"))
    assert word.committed is not None and word.committed.edges == CHAIN
    team.elect("robot1")
    team.run(0.1)
    mind = team.peers["robot1"].negotiation
    assert mind.committed.edges == CHAIN, "the highest tree that the others know is taken over"
    effects = mind.handle(Propose(("base", "robot1", "agent"), SHORTER, {}, "optimum", "x"), team.time.now_s)
    (word,) = (effect for effect in effects if isinstance(effect, Word))
    assert word.proposal is not None and [link.ends for link in word.proposal.links] == list(SHORTER)


def test_a_silent_end_costs_the_proposal_its_rounds_and_is_named() -> None:
    team = settled(Team(4, 3))
    team.propose(CHAIN)
    team.run(0.5)
    team.cut = {"robot3"}
    team.propose((("base", "robot3"), ("robot3", "agent")))
    team.run(ROUNDS * ROUND_S + 0.1)
    (given_up,) = team.given_up
    assert "robot3" in given_up.reason and "base" not in given_up.reason
    assert given_up.duration_s == pytest.approx(ROUNDS * ROUND_S, abs=1e-3)
    assert team.committed[-1].edges == CHAIN and team.links("robot1") == {frozenset(edge) for edge in CHAIN}


def test_a_refusal_ends_a_proposal_at_once_and_its_reason_is_passed_on() -> None:
    team = settled(Team(3, 4))
    team.refusals = 1.0
    team.propose(CHAIN)
    team.run(0.2)
    (given_up,) = team.given_up
    assert "the test does not see it" in given_up.reason and given_up.duration_s < ROUND_S
    assert not team.committed


def test_the_tree_rests_after_a_change_unless_it_does_not_serve_any_more() -> None:
    team = settled(Team(3, 5))
    assert team.propose(CHAIN, urgent=False)
    team.run(0.2)
    assert not team.propose(SHORTER, urgent=False)
    team.run(REST_S)
    assert team.propose(SHORTER, urgent=False)
    team.run(0.2)
    assert team.propose(CHAIN, urgent=True)
    team.run(0.2)
    assert [tree.edges for tree in team.committed] == [CHAIN, SHORTER, CHAIN]


def test_a_tree_in_force_is_not_negotiated_again() -> None:
    team = settled(Team(3, 6))
    team.propose(CHAIN)
    team.run(0.2)
    turned = tuple((other, one) for one, other in reversed(CHAIN))
    assert not team.propose(turned)


def test_the_new_leader_waits_for_what_the_others_know_but_not_for_ever() -> None:
    team = Team(3, 7)
    team.cut = {"robot2"}
    mind = Negotiation(team.names)
    mind.handle(Elected(1, frozenset(team.names)), 10.0)
    assert mind.phase is Phase.COLLECTING and not mind.may_propose(10.0, urgent=True)
    mind.handle(Heard("robot1", 0, Confirmation()), 10.1)
    mind.handle(Heard("base", 0, Confirmation()), 10.1)
    assert mind.phase is Phase.COLLECTING
    mind.handle(Tick(), 10.0 + COLLECTING_S)
    assert mind.phase is Phase.KEEPING and mind.may_propose(10.0 + COLLECTING_S, urgent=False)


def test_what_the_predecessor_left_open_is_given_up_and_said() -> None:
    mind = Negotiation(("base", "robot1"))
    mind.handle(Elected(4, frozenset({"base", "robot1"})), 0.0)
    known = Tree(number=(3, 1), members=("base",), edges=(), reason="")
    mind.handle(Heard("base", 0, Confirmation(committed=known)), 0.0)
    effects = mind.handle(Heard("robot1", 0, Confirmation(proposal=(3, 2))), 0.0)
    assert any("proposal 2 of epoch 3" in getattr(effect, "text", "") for effect in effects)
    assert mind.committed == known


def test_an_answer_that_comes_after_the_rounds_does_not_count() -> None:
    mind = Negotiation(("base", "robot1"))
    mind.handle(Elected(1, frozenset()), 0.0)
    mind.handle(Propose(("base", "robot1"), (("base", "robot1"),), {}, "auction", ""), 0.0)
    for peer, other in (("base", "robot1"), ("robot1", "base")):
        word = Confirmation(proposal=(1, 0), views=(LinkView(peer=other, verdict="will"),))
        effects = mind.handle(Heard(peer, 0, word), ROUNDS * ROUND_S)
        assert not [effect for effect in effects if isinstance(effect, Settled) and effect.committed]


def test_the_stage_from_which_a_link_holds_is_said() -> None:
    mind = Negotiation(("base", "robot1"))
    mind.handle(Elected(1, frozenset()), 0.0)
    since = Milestone(epoch=1, plan=2, revision=3, stage=4)
    wish = Propose(("base", "robot1"), (("base", "robot1"),), {frozenset(("robot1", "base")): since}, "optimum", "")
    (word, *_) = mind.handle(wish, 0.0)
    assert isinstance(word, Word) and word.proposal is not None and word.proposal.links[0].since == since


@pytest.mark.parametrize(
    ("members", "edges", "fault"),
    [
        (("base", "robot1"), (), "robot1 is not joined to base"),
        (("base", "robot1"), (("base", "robot1"), ("robot1", "base")), "circle"),
        (("base", "base"), (("base", "base"),), "base is a member 2 times"),
        (("base",), (("base", "robot1"),), "robot1 has a link and is no member"),
        (("base", "robot1"), (("base", "base"), ("base", "robot1")), "linked with itself"),
        (("base", "agent", "other"), (("base", "agent"), ("agent", "other")), "nobody can confirm"),
    ],
)
def test_what_is_no_tree_or_cannot_be_confirmed_is_not_proposed(
    members: tuple[str, ...], edges: tuple[tuple[str, str], ...], fault: str
) -> None:
    mind = Negotiation(("base", "robot1"))
    with pytest.raises(InvalidProposal, match="while the negotiation is idle"):
        mind.handle(Propose(members, edges, {}, "optimum", ""), 0.0)
    mind.handle(Elected(1, frozenset()), 0.0)
    with pytest.raises(InvalidProposal, match=fault):
        mind.handle(Propose(members, edges, {}, "optimum", ""), 0.0)
    assert mind.phase is Phase.KEEPING and mind.proposal is None


NAMES = st.sampled_from("abcde")


@given(st.lists(NAMES, min_size=1, max_size=6), st.lists(st.tuples(NAMES, NAMES), max_size=6))
def test_trees_are_told_from_what_is_none(members: list[str], edges: list[tuple[str, str]]) -> None:
    tree = Tree(number=(0, 0), members=tuple(members), edges=tuple(edges), reason="")
    assert (not find_fault(tree)) is is_tree(tree)


def test_a_peer_says_nothing_of_links_that_are_not_its_own_and_keeps_to_what_it_said() -> None:
    team = settled(Team(3, 8))
    held: HeldTree = team.peers["robot1"].held
    team.propose(CHAIN)
    team.run(0.02)
    assert {other for link in held.to_judge() for other in link.ends} <= {"base", "robot1", "robot2"}
    held.judge((1, 0), [LinkView(peer="base", verdict="sees")])
    held.judge((1, 0), [LinkView(peer="base", verdict="refuses")])
    held.judge((1, 7), [LinkView(peer="robot2", verdict="refuses")])
    assert next(view for view in held.confirmation.views if view.peer == "base").verdict == "sees"
    assert all(view.verdict == "sees" for view in held.confirmation.views)


@pytest.mark.parametrize("seed", range(60))
def test_no_rule_is_broken_whatever_fails_and_a_tree_comes_into_force_when_nothing_does(seed: int) -> None:
    team = Team(3 + seed % 3, seed)
    live_through(team, 60)
    team.loss, team.delay_s, team.refusals, team.cut = 0.0, (0.001, 0.01), 0.0, set()
    team.run(2.0)
    team.elect("base")
    team.run(COLLECTING_S)
    before = len(team.committed)
    assert team.propose(SHORTER)
    team.run(2 * ROUND_S)
    assert len(team.committed) == before + 1, f"seed {seed}"
    assert all(team.links(name) == {frozenset(edge) for edge in SHORTER} for name in team.names), f"seed {seed}"


@pytest.mark.parametrize("mutant", NEGOTIATIONS)
def test_each_rule_of_the_leader_is_needed(mutant: type[Negotiation]) -> None:
    assert any(is_found_out(seed, negotiation=mutant) for seed in range(ASKED))


@pytest.mark.parametrize("mutant", HOLDERS)
def test_each_rule_of_those_who_keep_links_is_needed(mutant: type[HeldTree]) -> None:
    assert any(is_found_out(seed, held=mutant) for seed in range(ASKED))


def is_found_out(seed: int, **kinds: type) -> bool:
    team = Team(3 + seed % 3, seed, **kinds)
    try:
        live_through(team, 60)
    except AssertionError:
        return True
    return False


def test_everything_in_the_table_happens() -> None:
    met: set[tuple[Phase, Occurrence]] = set()

    class Noting(Negotiation):
        def _occur(self, occurrence: Occurrence) -> None:
            met.add((self.phase, occurrence))
            super()._occur(occurrence)

    for seed in range(ASKED):
        live_through(Team(3, seed, negotiation=Noting), 60)
    assert met == {(phase, occurrence) for phase, row in TRANSITIONS.items() for occurrence in row}
