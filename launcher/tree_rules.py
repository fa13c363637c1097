"""Rules on the team's tree: it spans its members, and links are released only when what replaces them is confirmed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from agents.topology import TeamTree
from launcher.simulated_peer import SimulatedPeer
from launcher.violation import Violation
from protocol.membership import Presence
from protocol.messages import Confirmation, Deployment, Edge, Envelope, Topology, Tree, TreeNumber
from protocol.negotiation import ROUNDS

Links = frozenset[frozenset[str]]

REMEMBERED: Final = 500
"""Trees, and what was said of them."""


class TreeRules:
    """See the module. What is confirmed is known from what the peers have said, not from what leaders believe.

    Args:
        voters: who can confirm: base station and robots, in this order. The base station stands where everybody knows:
            it is not asked by a leader to whom it is not there.
    """

    def __init__(self, voters: Sequence[str]) -> None:
        self._base = voters[0]
        self._voters = frozenset(voters)
        self._asked: dict[TreeNumber, frozenset[str]] = {}
        """By proposal: who has to confirm its links."""
        self._committed: dict[TreeNumber, Tree] = {}
        self._confirmed: dict[tuple[str, TreeNumber], frozenset[str]] = {}
        """By end and proposal: whom it sees, or will."""
        self._held: dict[str, Tree] = {}
        self._released: dict[tuple[int, int], int] = {}

    def hear(self, peer: SimulatedPeer, envelope: Envelope) -> None:
        """Judge the words of leaders by the answers of the others."""
        match envelope.body:
            case Confirmation(proposal=number, views=views) if number is not None:
                seen = frozenset(view.peer for view in views if view.verdict != "refuses")
                self._confirmed[peer.name, number] = self._confirmed.get((peer.name, number), frozenset()) | seen
                if len(self._confirmed) > REMEMBERED:
                    del self._confirmed[next(iter(self._confirmed))]
            case Topology(committed=tree, proposal=proposal):
                if proposal is not None and proposal.round >= ROUNDS:
                    raise Violation("proposals are bounded", f"{proposal.tree.number} is said {proposal.round} times")
                if proposal is not None and proposal.tree.number not in self._asked:
                    self._asked[proposal.tree.number] = self._voters - self._away(peer)
                if tree is not None and self._committed.get(tree.number) != tree:
                    self._commit(tree)
            case Deployment():
                self._judge_release(envelope.body)

    def look(self, peer: SimulatedPeer) -> None:
        """What a peer keeps is a tree that came into force, and never an earlier one than before."""
        part = peer.part(TeamTree)
        tree = None if part is None else part.held.committed
        before = self._held.get(peer.name)
        if tree is before:
            return
        if tree is None:
            del self._held[peer.name]  # another process
            return
        self._held[peer.name] = tree
        if self._committed.get(tree.number) != tree:
            raise Violation("links kept are of a tree in force", f"{peer.name} keeps {tree.edges}")

    def _away(self, leader: SimulatedPeer) -> frozenset[str]:
        """The base station, if it is not there as far as a leader knows."""
        known = leader.allegiance
        away = known is not None and leader.name != self._base and known.presence(self._base) is not Presence.PRESENT
        return frozenset({self._base} if away else ())

    def _commit(self, tree: Tree) -> None:
        """A tree is said to be in force for the first time."""
        number = tree.number
        if number in self._committed:
            raise Violation("trees are numbered", f"two trees are number {number}")
        if not _spans(tree):
            raise Violation("trees span their members", f"{number}: {tree.edges} do not join {tree.members}")
        earlier = [known for other, known in self._committed.items() if other[0] == number[0] and other < number]
        kept = _links(max(earlier, key=lambda known: known.number).edges) if earlier else frozenset()
        for link in _links(tree.edges) - kept:
            for end in link & self._asked.get(number, self._voters):
                (other,) = link - {end}
                if other not in self._confirmed.get((end, number), ()):
                    text = f"{number} is in force, and {end} has not confirmed its link with {other}"
                    raise Violation("links are released when their replacement is confirmed", text)
        self._committed[number] = tree
        if len(self._committed) > REMEMBERED:
            del self._committed[next(iter(self._committed))]

    def _judge_release(self, orders: Deployment) -> None:
        """Robots are let go on only by orders whose tree is in force."""
        motion, epoch = orders.motion, orders.authority.epoch
        if motion is None:
            return
        key = (epoch, motion.plan)
        if motion.released <= self._released.get(key, motion.first_stage - 1):
            return
        self._released[key] = motion.released
        if len(self._released) > REMEMBERED:
            del self._released[next(iter(self._released))]
        latest = max((number for number in self._committed if number[0] == epoch), default=None)
        if latest is None or _links(self._committed[latest].edges) != _links(orders.edges):
            text = f"stage {motion.released} of plan {motion.plan} is released, and {orders.edges} are not in force"
            raise Violation("nobody goes where another tree is needed", text)


def _links(edges: tuple[Edge, ...]) -> Links:
    return frozenset(frozenset(edge) for edge in edges)


def _spans(tree: Tree) -> bool:
    """Whether all members, and nobody else, are joined without a circle: by growing parts together."""
    part = {member: {member} for member in tree.members}
    for one, other in tree.edges:
        if one not in part or other not in part or part[one] is part[other]:
            return False
        joined = part[one] | part[other]
        for member in joined:
            part[member] = joined
    return len(part) == len(tree.members) == len(tree.edges) + 1
