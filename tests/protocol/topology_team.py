"""A team that negotiates its tree in virtual time, with every fault of a network, and the rules that must hold.

What is in force is judged by what the peers themselves have said, which is kept apart from what the leaders believe.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import partial
from itertools import combinations
from random import Random

from protocol.core import Heard, Tick, WakeAt
from protocol.held_tree import HeldTree
from protocol.messages import (
    AnyBody,
    Authority,
    Confirmation,
    LinkView,
    NewLink,
    Topology,
    Tree,
    TreeNumber,
    Warrant,
)
from protocol.negotiation import (
    ROUND_S,
    ROUNDS,
    Deposed,
    Elected,
    Event,
    InvalidProposal,
    Negotiation,
    Propose,
    Settled,
    Withdraw,
    Word,
)
from protocol.simulated_bus import VirtualTime

AGENT = "agent"
WARRANT = Warrant(lease_s=1.0, marks=())


class Peer:
    """One process of a name after the other."""

    negotiation: Negotiation
    held: HeldTree

    def __init__(self, name: str) -> None:
        self.name = name
        self.incarnation = -1
        self.obeyed = (-1, -1)
        """Order of the last word taken."""
        self.said = 0
        self.wakings = 0


class Team:
    """Voters and an agent; breaks off with AssertionError where a rule is broken.

    Args:
        voters: how many.
        seed: of all chance.
        negotiation, held: kinds, so that mutants can take part.
    """

    def __init__(
        self,
        voters: int,
        seed: int,
        negotiation: type[Negotiation] = Negotiation,
        held: type[HeldTree] = HeldTree,
    ) -> None:
        self.chance = Random(f"topology {seed}")
        self.time = VirtualTime()
        self.names = ("base", *(f"robot{number}" for number in range(1, voters)))
        self.loss, self.delay_s, self.refusals = 0.0, (0.001, 0.01), 0.0
        self.cut: set[str] = set()
        """Peers that hear nobody and are not heard."""
        self.epoch = 0
        self.leader: str | None = None
        self.committed: list[Tree] = []
        """In the order in which they came into force."""
        self.given_up: list[Settled] = []
        self._kinds = negotiation, held
        self._judged: set[tuple[str, TreeNumber, str]] = set()
        """Who has said of which proposal that it sees whom, or will."""
        self._opened: dict[TreeNumber, float] = {}
        self._closed: set[TreeNumber] = set()
        self.peers = {name: Peer(name) for name in self.names}
        for name in self.names:
            self.start(name)

    def start(self, name: str) -> None:
        """Begin a process, in the place of the one that there is."""
        peer = self.peers[name]
        negotiation, held = self._kinds
        peer.incarnation += 1
        peer.negotiation, peer.held = negotiation(self.names), held(name)
        peer.obeyed, peer.said = (-1, -1), 0

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self.time.run_until(self.time.now_s + seconds)

    def elect(self, name: str) -> None:
        """Give the lease to another peer, the one before having noticed that it leads no more; or a new epoch to it."""
        if name != self.leader:
            self.depose()
        self.epoch += 1
        self.leader = name
        self.tell(name, Elected(self.epoch, frozenset(self.names) - self.cut))

    def depose(self) -> None:
        """Let nobody lead."""
        if self.leader is not None:
            self.tell(self.leader, Deposed())
            self.leader = None

    def crash(self, name: str) -> None:
        """End a process and start the next; a leader loses its lease."""
        if name == self.leader:
            self.leader = None
        self.start(name)

    def propose(self, edges: Iterable[tuple[str, str]], members: Iterable[str] = (), urgent: bool = True) -> bool:
        """Have the leader propose a tree if it may; whether it did."""
        assert self.leader is not None
        edges = tuple(edges)
        known = tuple(members) or tuple(dict.fromkeys(end for edge in edges for end in edge))
        mind: Negotiation = self.peers[self.leader].negotiation
        if not mind.may_propose(self.time.now_s, urgent) or mind.is_in_force(known, edges):
            return False
        self.tell(self.leader, Propose(known, edges, {}, "optimum", "the test wants it"))
        return True

    def withdraw(self) -> None:
        """Have the leader think better of it."""
        if self.leader is not None:
            self.tell(self.leader, Withdraw("the test thinks better of it"))

    def links(self, name: str) -> set[frozenset[str]]:
        """What a peer keeps."""
        held: HeldTree = self.peers[name].held
        return {frozenset(link) for link in held.links}

    def tell(self, name: str, event: Event) -> None:
        """Give a leader's negotiation an event, and carry out what comes of it."""
        peer, now_s = self.peers[name], self.time.now_s
        mind: Negotiation = peer.negotiation
        for effect in mind.handle(event, now_s):
            match effect:
                case Settled():
                    self._check_settled(effect)
                case Word(committed, proposal):
                    if proposal is not None:
                        number = proposal.tree.number
                        assert number not in self._closed, f"{number} is open again"
                        opened_s = self._opened.setdefault(number, now_s)
                        assert now_s < opened_s + ROUNDS * ROUND_S, f"{number} is open for too long"
                        still = self._opened.keys() - self._closed - {number}
                        assert not {other for other in still if other[0] == number[0]}, f"{still} and {number} are open"
                    peer.said += 1
                    authority = Authority(epoch=self.epoch, leader=name, sequence=peer.said)
                    body = Topology(authority=authority, warrant=WARRANT, committed=committed, proposal=proposal)
                    self._send(name, body)
                    self._hear(name, name, peer.incarnation, body)
                case WakeAt(wake_s) if wake_s < math.inf:
                    peer.wakings += 1
                    self.time.call_at(max(wake_s, now_s) + 1e-6, self._wake, peer, peer.wakings, peer.incarnation)

    def _wake(self, peer: Peer, waking: int, incarnation: int) -> None:
        if (waking, incarnation) == (peer.wakings, peer.incarnation):
            self.tell(peer.name, Tick())

    def _send(self, sender: str, body: AnyBody) -> None:
        incarnation = self.peers[sender].incarnation
        for name in self.names:
            for _ in range(self.chance.choice((1, 1, 2))):
                if name != sender and self.chance.random() >= self.loss:
                    at_s = self.time.now_s + self.chance.uniform(*self.delay_s)
                    self.time.call_at(at_s, self._hear, name, sender, incarnation, body)

    def _hear(self, name: str, sender: str, incarnation: int, body: AnyBody) -> None:
        peer = self.peers[name]
        if name != sender and self.cut & {name, sender}:
            return
        held: HeldTree = peer.held
        if isinstance(body, Confirmation):
            self.tell(name, Heard(sender, incarnation, body))
        elif isinstance(body, Topology):
            order = (body.authority.epoch, body.authority.sequence)
            if order <= peer.obeyed:
                return
            peer.obeyed = order
            before = set(self.links(name)), held.committed
            fault = held.take(body)
            assert not fault, fault
            self._check_kept(name, before[0], before[1], held.committed)
            if links := held.to_judge():
                assert held.proposal is not None
                at_s = self.time.now_s + self.chance.uniform(0.0, 0.05)
                judge = partial(self._judge, name, peer.incarnation, held.proposal.tree.number, links)
                self.time.call_at(at_s, judge)
            self._answer(name)

    def _judge(self, name: str, incarnation: int, number: TreeNumber, links: tuple[NewLink, ...]) -> None:
        peer = self.peers[name]
        held: HeldTree = peer.held
        if incarnation != peer.incarnation or held.proposal is None or held.proposal.tree.number != number:
            return
        views = []
        for link in links:
            (other,) = set(link.ends) - {name}
            if self.chance.random() < self.refusals:
                views.append(LinkView(peer=other, verdict="refuses", reason="the test does not see it"))
            else:
                self._judged.add((name, number, other))
                views.append(LinkView(peer=other, verdict="sees"))
        held.judge(number, views)
        self._answer(name)

    def _answer(self, name: str) -> None:
        peer = self.peers[name]
        confirmation = peer.held.confirmation
        self._send(name, confirmation)
        self.tell(name, Heard(name, peer.incarnation, confirmation))

    def _check_settled(self, done: Settled) -> None:
        number = done.proposal.tree.number
        assert number not in self._closed, f"{number} is settled twice"
        self._closed.add(number)
        assert done.duration_s <= ROUNDS * ROUND_S + 1e-5 or not done.committed, f"{number} took {done.duration_s} s"
        if not done.committed:
            assert done.reason
            self.given_up.append(done)
            return
        tree = done.proposal.tree
        assert number[0] == self.epoch, f"{number} comes into force in epoch {self.epoch}"
        last = self.committed[-1] if self.committed else None
        assert last is None or number > last.number, f"{number} comes after {last}"
        assert is_tree(tree), f"{tree} does not span its members"
        here = {frozenset(e) for e in last.edges} if last is not None and last.number[0] == number[0] else set()
        for edge in {frozenset(e) for e in tree.edges} - here:
            for end in edge - {AGENT}:
                (other,) = edge - {end}
                assert (end, number, other) in self._judged, f"{number}: {end} has not confirmed {other}"
        self.committed.append(tree)

    def _check_kept(self, name: str, before: set[frozenset[str]], known: Tree | None, committed: Tree | None) -> None:
        if committed != known:
            assert committed in self.committed, f"{name} keeps {committed}, which never came into force"
            assert known is None or (committed is not None and committed.number > known.number), (
                f"{name} goes from {known} back to {committed}"
            )
        released = before - self.links(name)
        assert not released or committed != known, f"{name} releases {released} before a tree without it is in force"


def is_tree(tree: Tree) -> bool:
    """Whether the edges are as many as a tree's, and no part of the members is cut off from the rest."""
    edges = [set(edge) for edge in tree.edges]
    members = set(tree.members)
    if len(members) != len(tree.members) or len(edges) != len(members) - 1 or any(not e <= members for e in edges):
        return False
    return all(
        any(len(edge & set(part)) == 1 for edge in edges)
        for size in range(1, len(members))
        for part in combinations(sorted(members), size)
    )


def random_tree(chance: Random, members: list[str]) -> list[tuple[str, str]]:
    """Edges of a tree over all members, the agent a leaf."""
    order = [member for member in members if member != AGENT]
    chance.shuffle(order)
    edges = [(chance.choice(order[:i]), order[i]) for i in range(1, len(order))]
    if AGENT in members:
        edges.append((chance.choice(order), AGENT))
    return edges


def live_through(team: Team, steps: int) -> None:
    """Random faults and random wishes of the leaders, one after the other."""
    chance = team.chance
    team.elect("base")
    for _ in range(steps):
        match chance.randrange(12):
            case 0:
                team.elect(chance.choice([name for name in team.names if name not in team.cut] or ["base"]))
            case 1:
                team.depose()
            case 2:
                team.loss = chance.choice((0.0, 0.3, 0.7))
            case 3:
                team.delay_s = chance.choice(((0.001, 0.01), (0.001, 0.5), (0.3, 1.5)))
            case 4:
                team.refusals = chance.choice((0.0, 0.0, 0.3))
            case 5:
                team.crash(chance.choice(team.names))
            case 6:
                team.cut = set(chance.sample(team.names, chance.randrange(0, 2)))
            case 7:
                team.withdraw()
            case _ if team.leader is not None:
                others = [name for name in (*team.names, AGENT) if name != team.leader]
                members = [team.leader, *chance.sample(others, chance.randrange(0, len(others) + 1))]
                edges = random_tree(chance, members)
                if chance.random() < 0.1 and len(edges) > 1:
                    edges[-1] = edges[0]
                    try:
                        proposed = team.propose(edges, members, urgent=True)
                        assert not proposed, "what is no tree has been proposed"
                    except InvalidProposal:
                        pass
                else:
                    team.propose(edges, members, urgent=chance.random() < 0.7)
        team.run(chance.choice((0.0, 0.02, 0.1, 0.4, 1.0, 2.5)))
