"""Words on the tree are judged by the words before them: each rule by a few that are made by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import pytest

from launcher.tree_rules import TreeRules, spans
from launcher.violation import Violation
from protocol.membership import Presence
from protocol.messages import (
    AnyBody,
    Authority,
    Confirmation,
    Deployment,
    Edge,
    Envelope,
    LinkView,
    MemberWay,
    Milestone,
    Motion,
    NewLink,
    Topology,
    Tree,
    TreeNumber,
    TreeProposal,
    Warrant,
)
from protocol.negotiation import ROUNDS

MEMBERS = ("base", "robot1", "robot2", "agent")
CHAIN: tuple[Edge, ...] = (("base", "robot1"), ("robot1", "robot2"), ("robot2", "agent"))
STAR: tuple[Edge, ...] = (("base", "robot1"), ("base", "robot2"), ("robot2", "agent"))
"""One link of it is not in the chain."""
WARRANT = Warrant(lease_s=1.0, marks=())


@dataclass
class Peer:
    """What the rules see of a peer."""

    name: str
    committed: Tree | None = None
    incarnation: int = 0
    base: Presence = Presence.PRESENT
    """Whether the base station is there, as far as it knows."""

    @property
    def allegiance(self) -> object:
        return SimpleNamespace(presence=lambda _: self.base)

    def part(self, _: type[object]) -> object:
        return SimpleNamespace(held=self)


class Play:
    """A leader says words on the tree, and the others answer."""

    def __init__(self) -> None:
        self.rules = TreeRules(["base", "robot1", "robot2"])
        self.peers = {name: Peer(name) for name in ("base", "robot1", "robot2")}
        self._said = 0

    def say(self, name: str, body: AnyBody) -> None:
        envelope = Envelope(sender=name, incarnation=0, sequence=0, sent_at_s=0.0, body=body)
        self.rules.hear(cast(Any, self.peers[name]), envelope)

    def word(self, committed: Tree | None, proposal: TreeProposal | None = None, *, by: str = "base") -> None:
        self._said += 1
        epoch = (committed or cast(TreeProposal, proposal).tree).number[0]
        authority = Authority(epoch=epoch, leader=by, sequence=self._said)
        self.say(by, Topology(authority=authority, warrant=WARRANT, committed=committed, proposal=proposal))

    def confirm(self, number: TreeNumber, links: Sequence[Edge], *, but: str = "") -> None:
        """Both ends of links do, but for one."""
        for end in self.peers.keys() - {but}:
            others = tuple(
                LinkView(peer=one if end == other else other, verdict="sees")
                for one, other in links
                if end in (one, other)
            )
            self.say(end, Confirmation(proposal=number, views=others))

    def put_in_force(self, tree: Tree, links: Sequence[Edge], *, but: str = "") -> None:
        self.word(None, propose(tree, links))
        self.confirm(tree.number, links, but=but)
        self.word(tree)

    def look(self, name: str, committed: Tree | None, incarnation: int = 0) -> None:
        peer = self.peers[name]
        peer.committed, peer.incarnation = committed, incarnation
        self.rules.look(cast(Any, peer))

    def release(self, stage: int, edges: tuple[Edge, ...], revision: int = 0) -> None:
        """Order a motion of which stages up to this one may be begun."""
        way = MemberWay(
            member="robot1", radius_m=0.1, speed_m_s=1.0, stages=(0, 1, 2, 3, 4),
            waypoints=tuple((float(place), 0.0) for place in range(5)),
        )  # fmt: skip
        motion = Motion(plan=0, revision=revision, first_stage=0, released=stage, ways=(way,), connection="none")
        orders = Deployment(
            authority=Authority(epoch=1, leader="base", sequence=stage + 2), warrant=WARRANT, decision=1,
            placements=(), edges=edges, cost=0.0, relays_needed=0, reason="", motion=motion,
        )  # fmt: skip
        self.say("base", orders)


def tree(number: int = 0, edges: tuple[Edge, ...] = CHAIN, epoch: int = 1) -> Tree:
    return Tree(number=(epoch, number), members=MEMBERS, edges=edges, reason="")


def propose(of: Tree, links: Sequence[Edge], times: int = 0, revision: int | None = None) -> TreeProposal:
    since = None if revision is None else Milestone(epoch=of.number[0], plan=0, revision=revision, stage=0)
    new = tuple(NewLink(ends=link, since=since) for link in links)
    return TreeProposal(tree=of, links=new, released=(), method="optimum", round=times)


def test_a_tree_that_is_proposed_and_confirmed_is_in_force() -> None:
    play = Play()
    play.put_in_force(tree(0), CHAIN)
    play.word(tree(0))
    play.put_in_force(tree(1, STAR), [STAR[1]])
    play.look("robot1", tree(0))
    play.look("robot1", tree(1, STAR))


@pytest.mark.parametrize("end", ["base", "robot1", "robot2"])
def test_each_end_of_a_new_link_has_to_confirm_it(end: str) -> None:
    play = Play()
    with pytest.raises(Violation, match=f"{end} has not confirmed its link") as broken:
        play.put_in_force(tree(0), CHAIN, but=end)
    assert broken.value.rule == "links are released when their replacement is confirmed"


def test_what_is_said_of_one_proposal_is_not_said_of_the_next() -> None:
    play = Play()
    play.word(None, propose(tree(0), CHAIN))
    play.confirm((1, 0), CHAIN)
    play.word(None, propose(tree(1), CHAIN))
    with pytest.raises(Violation, match="has not confirmed"):
        play.word(tree(1))


def test_the_links_of_an_earlier_reign_are_confirmed_anew() -> None:
    play = Play()
    play.put_in_force(tree(0), CHAIN)
    play.word(None, propose(tree(0, epoch=2), []), by="robot1")
    with pytest.raises(Violation, match="has not confirmed"):
        play.word(tree(0, epoch=2), by="robot1")


def test_only_a_base_station_that_is_not_there_need_not_confirm() -> None:
    play = Play()
    play.peers["robot1"].base = Presence.GONE
    play.word(None, propose(tree(0), CHAIN), by="robot1")
    play.confirm((1, 0), CHAIN, but="base")
    play.word(tree(0), by="robot1")


@pytest.mark.parametrize(
    "edges",
    [CHAIN[:2], (*CHAIN, ("base", "agent")), (*CHAIN[:2], ("robot1", "base")), (*CHAIN[:2], ("robot2", "robot3"))],
)
def test_trees_span_their_members(edges: tuple[Edge, ...]) -> None:
    assert not spans(MEMBERS, edges) and spans(MEMBERS, CHAIN) and spans(MEMBERS, STAR)
    play = Play()
    with pytest.raises(Violation) as broken:
        play.put_in_force(tree(0, edges), edges)
    assert broken.value.rule == "trees span their members"


def test_no_two_trees_have_the_same_number() -> None:
    proposed_twice, in_force_twice = Play(), Play()
    proposed_twice.word(None, propose(tree(0), CHAIN))
    in_force_twice.put_in_force(tree(0), CHAIN)
    for play, proposal in ((proposed_twice, propose(tree(0, STAR), STAR)), (in_force_twice, None)):
        with pytest.raises(Violation) as broken:
            play.word(tree(0, STAR) if proposal is None else None, proposal)
        assert broken.value.rule == "trees are numbered"


def test_numbers_rise_within_a_reign() -> None:
    play = Play()
    play.word(None, propose(tree(0), CHAIN))
    play.put_in_force(tree(1), CHAIN)
    with pytest.raises(Violation, match=r"\(1, 0\) comes into force after \(1, 1\)") as broken:
        play.word(tree(0))
    assert broken.value.rule == "trees are numbered"


def test_what_is_in_force_is_what_was_proposed() -> None:
    play = Play()
    play.word(None, propose(tree(0), CHAIN))
    play.confirm((1, 0), CHAIN)
    with pytest.raises(Violation) as broken:
        play.word(tree(0, STAR))
    assert broken.value.rule == "trees in force were proposed"


def test_a_proposal_is_said_so_often_and_no_more_whatever_round_it_says_it_is() -> None:
    play = Play()
    for _ in range(ROUNDS):
        play.word(None, propose(tree(0), CHAIN))
    with pytest.raises(Violation, match=f"is said {ROUNDS + 1} times") as broken:
        play.word(None, propose(tree(0), CHAIN))
    assert broken.value.rule == "proposals are bounded"


def test_links_are_kept_of_trees_in_force_only_and_nobody_goes_back() -> None:
    play = Play()
    play.put_in_force(tree(0), CHAIN)
    play.put_in_force(tree(1, STAR), [STAR[1]])
    play.look("robot1", tree(1, STAR))
    play.look("robot1", None, incarnation=1)
    play.look("robot1", tree(0), incarnation=1)  # another process, which a late word of the leader reached
    play.look("robot1", tree(1, STAR), incarnation=1)
    with pytest.raises(Violation, match=r"robot1 keeps the links of \(1, 0\) after those of \(1, 1\)") as broken:
        play.look("robot1", tree(0), incarnation=1)
    assert broken.value.rule == "nobody goes back to an earlier tree"
    with pytest.raises(Violation) as broken:
        play.look("robot2", tree(2))
    assert broken.value.rule == "links kept are of a tree in force"


def test_nobody_is_let_go_on_to_a_tree_that_is_not_in_force() -> None:
    play = Play()
    play.release(-1, ())
    with pytest.raises(Violation, match="stage 0 of plan 0 is released") as broken:
        play.release(0, CHAIN)
    assert broken.value.rule == "nobody goes where another tree is needed"


def test_nothing_more_is_released_of_a_motion_while_the_tree_that_it_leads_to_is_negotiated() -> None:
    play = Play()
    play.put_in_force(tree(0), CHAIN)
    play.release(0, CHAIN, revision=0)
    play.word(tree(0), propose(tree(1, STAR), [STAR[1]], revision=1))
    play.release(0, CHAIN, revision=1)  # what was released before
    play.release(1, CHAIN, revision=0)  # the motion before, which leads elsewhere
    with pytest.raises(Violation, match="revision 1 leads to is being negotiated"):
        play.release(2, CHAIN, revision=1)
    play.word(tree(0))  # the proposal has been given up
    play.release(3, CHAIN, revision=1)


def test_what_two_revisions_have_in_common_may_be_released_with_the_second() -> None:
    play = Play()
    play.put_in_force(tree(0), CHAIN)
    play.release(0, CHAIN, revision=0)
    play.word(tree(0), propose(tree(1, STAR), [STAR[1]], revision=1))
    play.release(1, CHAIN, revision=1)
    with pytest.raises(Violation, match="revision 1 leads to is being negotiated"):
        play.release(2, CHAIN, revision=1)
