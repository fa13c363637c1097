"""Rules on the team's tree: it spans its members, and links are released only when what replaces them is confirmed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from agents.topology import TeamTree
from launcher.order_rules import agree
from launcher.simulated_peer import SimulatedPeer
from launcher.violation import Violation
from protocol.membership import Presence
from protocol.messages import (
    Confirmation,
    Deployment,
    Edge,
    Envelope,
    Motion,
    Topology,
    Tree,
    TreeNumber,
    TreeProposal,
)
from protocol.negotiation import ROUNDS

Links = frozenset[frozenset[str]]

REMEMBERED: Final = 500
"""Trees, and what was said of them."""


@dataclass(slots=True)
class _Proposed:
    """A proposal, from when it was said first."""

    tree: Tree
    asked: frozenset[str]
    """Who has to confirm its links."""
    times: int = 0
    """How often it has been said."""


class TreeRules:
    """See the module. What is confirmed is known from what the peers have said, not from what leaders believe.

    Args:
        voters: who can confirm: base station and robots, in this order. The base station stands where everybody knows:
            it is not asked by a leader to whom it is not there.
    """

    def __init__(self, voters: Sequence[str]) -> None:
        self._base = voters[0]
        self._voters = frozenset(voters)
        self._proposed: dict[TreeNumber, _Proposed] = {}
        self._committed: dict[TreeNumber, Tree] = {}
        self._latest: dict[int, Tree] = {}
        """By epoch: the last tree that came into force."""
        self._confirmed: dict[tuple[str, TreeNumber], frozenset[str]] = {}
        """By end and proposal: whom it sees, or will."""
        self._open: dict[int, frozenset[tuple[int, int]]] = {}
        """By epoch: plans and revisions that lead to the tree of the open proposal, if there is one."""
        self._held: dict[str, tuple[int, Tree]] = {}
        """By peer: its incarnation, and the tree whose links it keeps."""
        self._released: dict[tuple[int, int], int] = {}
        """By epoch and plan: the last stage that anybody may begin."""
        self._ordered: dict[tuple[int, int, int], Motion] = {}
        """By epoch, plan and revision: the motion as it was ordered first."""

    def hear(self, peer: SimulatedPeer, envelope: Envelope) -> None:
        """Judge the words of leaders by the answers of the others."""
        match envelope.body:
            case Confirmation(proposal=number, views=views) if number is not None and views:
                seen = frozenset(view.peer for view in views if view.verdict != "refuses")
                self._confirmed[peer.name, number] = self._confirmed.get((peer.name, number), frozenset()) | seen
                _forget(self._confirmed)
            case Topology(authority=authority, committed=tree, proposal=proposal):
                self._open.pop(authority.epoch, None)
                if proposal is not None:
                    self._propose(peer, proposal)
                if tree is not None and self._committed.get(tree.number) != tree:
                    self._commit(tree)
            case Deployment(motion=motion) if motion is not None:
                self._judge_release(envelope.body, motion)

    def look(self, peer: SimulatedPeer) -> None:
        """What a peer keeps is a tree that came into force, and never an earlier one than before."""
        part = peer.part(TeamTree)
        tree = None if part is None else part.held.committed
        if tree is None:
            return
        incarnation, before = self._held.get(peer.name, (-1, None))
        if tree is before:
            return
        self._held[peer.name] = peer.incarnation, tree
        if self._committed.get(tree.number) != tree:
            raise Violation("links kept are of a tree in force", f"{peer.name} keeps {tree.edges}")
        if before is not None and incarnation == peer.incarnation and tree.number < before.number:
            text = f"{peer.name} keeps the links of {tree.number} after those of {before.number}"
            raise Violation("nobody goes back to an earlier tree", text)

    def _propose(self, leader: SimulatedPeer, proposal: TreeProposal) -> None:
        """A proposal is said, for the first time or again."""
        number, tree = proposal.tree.number, proposal.tree
        known = self._proposed.get(number)
        if known is None:
            known = self._proposed[number] = _Proposed(tree, self._voters - self._away(leader))
            _forget(self._proposed)
        elif known.tree != tree:
            raise Violation("trees are numbered", f"two trees are proposed as number {number}")
        known.times += 1
        if known.times > ROUNDS:
            raise Violation("proposals are bounded", f"{number} is said {known.times} times")
        since = (link.since for link in proposal.links)
        self._open[number[0]] = frozenset((mark.plan, mark.revision) for mark in since if mark is not None)

    def _away(self, leader: SimulatedPeer) -> frozenset[str]:
        """The base station, if it is not there as far as a leader knows."""
        known = leader.allegiance
        away = known is not None and leader.name != self._base and known.presence(self._base) is not Presence.PRESENT
        return frozenset({self._base} if away else ())

    def _commit(self, tree: Tree) -> None:
        """A tree is said to be in force for the first time."""
        number, epoch = tree.number, tree.number[0]
        known, latest = self._proposed.get(number), self._latest.get(epoch)
        if number in self._committed:
            raise Violation("trees are numbered", f"two trees are number {number}")
        if latest is not None and number < latest.number:
            raise Violation("trees are numbered", f"{number} comes into force after {latest.number}")
        if not spans(tree.members, tree.edges):
            raise Violation("trees span their members", f"{number}: {tree.edges} do not join {tree.members}")
        if known is not None and known.tree != tree:
            raise Violation("trees in force were proposed", f"{number} was another tree when it was")
        kept = _links(latest.edges) if latest is not None else frozenset()
        for link in _links(tree.edges) - kept:
            for end in link & (self._voters if known is None else known.asked):
                (other,) = link - {end}
                if other not in self._confirmed.get((end, number), ()):
                    text = f"{number} is in force, and {end} has not confirmed its link with {other}"
                    raise Violation("links are released when their replacement is confirmed", text)
        self._committed[number] = self._latest[epoch] = tree
        _forget(self._committed)

    def _judge_release(self, orders: Deployment, motion: Motion) -> None:
        """Robots are let go on only by orders whose tree is in force, and not to one that is being negotiated."""
        epoch, key = orders.authority.epoch, (orders.authority.epoch, motion.plan)
        is_first = (*key, motion.revision) not in self._ordered
        self._ordered.setdefault((*key, motion.revision), motion)
        _forget(self._ordered)
        if motion.released <= self._released.get(key, motion.first_stage - 1):
            return
        self._released[key] = motion.released
        _forget(self._released)
        latest = self._latest.get(epoch)
        stage = f"stage {motion.released} of plan {motion.plan} is released"
        if latest is None or _links(latest.edges) != _links(orders.edges):
            raise Violation("nobody goes where another tree is needed", f"{stage}, and {orders.edges} are not in force")
        # What the revision before has too was released on the way to the tree in force, and is only said now.
        is_new = not is_first or not self._is_of_the_revision_before(epoch, motion)
        if is_new and (motion.plan, motion.revision) in self._open.get(epoch, ()):
            text = f"{stage}, and the tree that revision {motion.revision} leads to is being negotiated"
            raise Violation("nobody goes where another tree is needed", text)

    def _is_of_the_revision_before(self, epoch: int, motion: Motion) -> bool:
        """Whether all that is released of a motion is in the one that it revises, too."""
        known = [
            other
            for (other_epoch, plan, revision), other in self._ordered.items()
            if (other_epoch, plan) == (epoch, motion.plan) and revision < motion.revision
        ]
        return bool(known) and agree(known[-1], motion)


def _forget(memory: dict[Any, Any]) -> None:
    """The oldest, if there is too much."""
    if len(memory) > REMEMBERED:
        del memory[next(iter(memory))]


def _links(edges: tuple[Edge, ...]) -> Links:
    return frozenset(frozenset(edge) for edge in edges)


def spans(members: Sequence[str], edges: Sequence[Edge]) -> bool:
    """Whether all members, and nobody else, are joined without a circle: by growing parts together."""
    part = {member: {member} for member in members}
    for one, other in edges:
        if one not in part or other not in part or part[one] is part[other]:
            return False
        joined = part[one] | part[other]
        for member in joined:
            part[member] = joined
    return len(part) == len(members) == len(edges) + 1
