"""What one peer knows of the team's tree: the links that it keeps, the open proposal, and what it says of that."""

from __future__ import annotations

from collections.abc import Collection

from protocol.messages import Confirmation, Edge, LinkView, NewLink, Topology, Tree, TreeNumber, TreeProposal
from protocol.topology import find_fault


class HeldTree:
    """Takes the leader's words in their order, and makes the answer to them.

    A link of the tree in force is kept until another tree is in force, whatever is proposed. Whose word counts, and
    that an old one does not, is for :mod:`protocol.obedience` to say.

    Args:
        name: of this peer.
    """

    def __init__(self, name: str) -> None:
        self.committed: Tree | None = None
        """The last tree in force that it knows of."""
        self.proposal: TreeProposal | None = None
        """The open proposal, as far as it knows."""
        self.latest: Topology | None = None
        """The last word heard of who is obeyed, also if it was not taken because a tree in it is none."""
        self._name = name
        self._views: dict[str, LinkView] = {}
        self._confirmation: Confirmation | None = None
        """The standing answer, once it has been asked for."""

    @property
    def links(self) -> tuple[Edge, ...]:
        """Links that are kept."""
        return () if self.committed is None else self.committed.edges

    def take(self, word: Topology) -> str:
        """Learn what is in force and what is proposed; says what is wrong with the word, nothing if all is well."""
        self.latest, self._confirmation = word, None
        tree, proposal = word.committed, word.proposal
        for stated in (tree, proposal.tree if proposal is not None else None):
            if stated is not None and stated != self.committed and (fault := find_fault(stated)):
                return f"tree {stated.number[1]} of epoch {stated.number[0]} is none: {fault}"
        if tree is not None and (self.committed is None or tree.number > self.committed.number):
            self.committed = tree
        if proposal is None or self.proposal is None or proposal.tree.number != self.proposal.tree.number:
            self._views.clear()
        self.proposal = proposal
        return ""

    def to_judge(self) -> tuple[NewLink, ...]:
        """New links of the open proposal that this peer is an end of, and has not judged yet."""
        if self.proposal is None:
            return ()
        return tuple(
            link
            for link in self.proposal.links
            if self._name in link.ends and not self._views.keys() & (set(link.ends) - {self._name})
        )

    def judge(self, number: TreeNumber, views: Collection[LinkView]) -> None:
        """Say of links of a proposal whether they hold; of one that is not open any more this has no effect.

        What has been said of a link stays said: the other end, and the leader, rely on it.
        """
        if self.proposal is not None and self.proposal.tree.number == number:
            self._confirmation = None
            for view in views:
                self._views.setdefault(view.peer, view)

    @property
    def confirmation(self) -> Confirmation:
        """The standing answer."""
        if self._confirmation is None:
            self._confirmation = Confirmation(
                proposal=None if self.proposal is None else self.proposal.tree.number,
                views=tuple(self._views.values()),
                committed=self.committed,
            )
        return self._confirmation
