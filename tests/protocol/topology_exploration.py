"""Every history of a negotiation within bounds: two voters and an agent, messages late, lost, doubled and reordered.

A state is the minds of all, what each has said so far (any of it may arrive at any moment, as often as it likes, or
never), and what has been confirmed by whom. Breadth first, so that what breaks a rule is found by its shortest history.
"""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

from protocol.core import Heard, Tick
from protocol.held_tree import HeldTree
from protocol.messages import Authority, Confirmation, Edge, LinkView, Topology, Tree, TreeNumber, Warrant
from protocol.negotiation import ROUND_S, ROUNDS, Deposed, Elected, Event, Negotiation, Propose, Settled, Word

VOTERS: Final = ("base", "robot1")

Wishes = tuple[tuple[str, tuple[Edge, ...]], ...]
"""Who proposes what, one after the other; the second leader has an epoch of its own."""

NEAR: Final[tuple[Edge, ...]] = (("base", "agent"),)
FAR: Final[tuple[Edge, ...]] = (("base", "robot1"), ("agent", "robot1"))
SHORT: Final[tuple[Edge, ...]] = (("base", "robot1"),)

ONE_REIGN: Final[Wishes] = (("base", FAR), ("base", FAR), ("base", NEAR))
TWO_REIGNS: Final[Wishes] = (("base", FAR), ("robot1", SHORT))

WARRANT: Final = Warrant(lease_s=1.0, marks=())
LATE_S: Final = ROUNDS * ROUND_S


class Broken(AssertionError):
    """A rule has been broken; the text is the history."""


@dataclass
class State:
    """One moment."""

    wishes: Wishes
    minds: dict[str, Negotiation]
    held: dict[str, HeldTree]
    obeyed: dict[str, tuple[int, int]] = field(default_factory=lambda: dict.fromkeys(VOTERS, (-1, -1)))
    words: list[Topology] = field(default_factory=list)
    answers: list[tuple[str, Confirmation]] = field(default_factory=list)
    confirmed: set[tuple[str, TreeNumber, str]] = field(default_factory=set)
    trees: list[Tree] = field(default_factory=list)
    """That came into force."""
    turn: int = 0
    """How many trees have been wished."""
    late: int = 0
    """How often so much time has passed that what is open has to be given up."""
    refused: int = 0
    said: int = 0

    @property
    def now_s(self) -> float:
        """By the one clock: nothing here depends on clocks that differ."""
        return 100.0 + self.late * LATE_S

    @property
    def leader(self) -> str:
        """Who leads."""
        return self.wishes[self.turn - 1][0] if self.turn else "base"

    def epoch(self, leader: str) -> int:
        """Of a leader's reign."""
        return 1 if leader == "base" else 2


def explore(
    wishes: Wishes, negotiation: type[Negotiation] = Negotiation, held: type[HeldTree] = HeldTree, refusals: int = 0
) -> int:
    """Go through all histories; says how many states there are.

    Raises:
        Broken: a rule is broken.
    """
    first = State(wishes, {name: negotiation(VOTERS) for name in VOTERS}, {name: held(name) for name in VOTERS})
    _tell(first, "base", Elected(1, frozenset()))
    frontier, met = [(pickle.dumps(first), ())], {_key(first)}
    while frontier:
        after: list[tuple[bytes, tuple[str, ...]]] = []
        for packed, history in frontier:
            for name, arguments in _actions(pickle.loads(packed), refusals):
                state: State = pickle.loads(packed)
                done = (*history, f"{name.__name__.strip('_')} {' '.join(map(str, arguments))}")
                try:
                    name(state, *arguments)
                except AssertionError as problem:
                    raise Broken(f"{problem}, after: {'; '.join(done)}") from problem
                key = _key(state)
                if key not in met:
                    met.add(key)
                    after.append((pickle.dumps(state), done))
        frontier = after
    return len(met)


def _key(state: State) -> int:
    minds = tuple(
        (
            mind.phase,
            mind.committed,
            mind.proposal,
            frozenset((peer, heard.word) for peer, heard in mind._heard.items()),
        )
        for mind in state.minds.values()
    )
    held = tuple((held.confirmation, held.proposal) for held in state.held.values())
    known = tuple(state.obeyed.values()), len(state.words), frozenset(state.answers)
    return hash((minds, held, known, state.turn, state.late, state.refused))


def _actions(state: State, refusals: int) -> Iterator[tuple[Any, tuple[Any, ...]]]:
    """What can happen next."""
    leader = state.leader
    if state.turn < len(state.wishes):
        yield _wish, ()
    if state.minds[leader].proposal is not None and state.late < 1:
        yield _pass_time, ()
    for name in VOTERS:
        for index, word in enumerate(state.words):
            order = (word.authority.epoch, word.authority.sequence)
            if order > state.obeyed[name] and word.authority.leader != name:
                yield _deliver_word, (name, index)
        if state.held[name].to_judge():
            yield _judge, (name, "sees")
            if state.refused < refusals:
                yield _judge, (name, "refuses")
    heard = state.minds[leader]._heard
    for index, (sender, answer) in enumerate(state.answers):
        if sender != leader and (sender not in heard or heard[sender].word != answer):
            yield _deliver_answer, (leader, index)


def _wish(state: State) -> None:
    """The next tree is proposed; by another leader if it is another's turn."""
    before = state.leader
    leader, edges = state.wishes[state.turn]
    state.turn += 1
    if leader != before:
        _tell(state, before, Deposed())
        _tell(state, leader, Elected(state.epoch(leader), frozenset()))
    mind = state.minds[leader]
    if mind.may_propose(state.now_s, urgent=True) and not mind.is_in_force(_members(edges), edges):
        _tell(state, leader, Propose(_members(edges), edges, {}, "optimum", ""))


def _members(edges: tuple[Edge, ...]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(end for edge in edges for end in edge))


def _pass_time(state: State) -> None:
    state.late += 1
    _tell(state, state.leader, Tick())
    assert state.minds[state.leader].proposal is None, "a proposal is open for longer than its rounds"


def _deliver_word(state: State, name: str, index: int) -> None:
    word = state.words[index]
    state.obeyed[name] = (word.authority.epoch, word.authority.sequence)
    _take(state, name, word)


def _take(state: State, name: str, word: Topology) -> None:
    held = state.held[name]
    before, links = held.committed, set(map(frozenset, held.links))
    held.take(word)
    assert held.committed is None or held.committed in state.trees, f"{name} keeps what never came into force"
    assert before is None or held.committed is before or held.committed.number > before.number, f"{name} goes back"
    released = links - set(map(frozenset, held.links))
    assert not released or held.committed != before, f"{name} releases {released} before another tree is in force"
    _answer(state, name)


def _judge(state: State, name: str, verdict: Any) -> None:
    held = state.held[name]
    assert held.proposal is not None
    number = held.proposal.tree.number
    others = [next(iter(set(link.ends) - {name})) for link in held.to_judge()]
    if verdict == "sees":
        state.confirmed |= {(name, number, other) for other in others}
    else:
        state.refused += 1
    held.judge(number, [LinkView(peer=other, verdict=verdict) for other in others])
    _answer(state, name)


def _answer(state: State, name: str) -> None:
    answer = (name, state.held[name].confirmation)
    empty = answer[1].proposal is None and answer[1].committed is None
    if answer not in state.answers and not empty:
        state.answers.append(answer)
    if name == state.leader:
        _tell(state, name, Heard(name, 0, answer[1]))


def _deliver_answer(state: State, leader: str, index: int) -> None:
    sender, answer = state.answers[index]
    _tell(state, leader, Heard(sender, 0, answer))


def _tell(state: State, name: str, event: Event) -> None:
    for effect in state.minds[name].handle(event, state.now_s):
        match effect:
            case Settled(committed=True):
                _check(state, effect.proposal.tree)
            case Word(committed, proposal):
                state.said += 1
                authority = Authority(epoch=state.epoch(name), leader=name, sequence=state.said)
                word = Topology(authority=authority, warrant=WARRANT, committed=committed, proposal=proposal)
                state.words.append(word)
                state.obeyed[name] = (authority.epoch, authority.sequence)
                _take(state, name, word)


def _check(state: State, tree: Tree) -> None:
    """Judge a tree that comes into force."""
    last = state.trees[-1] if state.trees else None
    assert last is None or tree.number > last.number, f"{tree.number} comes after {last}"
    here = set(map(frozenset, last.edges)) if last is not None and last.number[0] == tree.number[0] else set()
    for one, other in tree.edges:
        if frozenset((one, other)) not in here:
            for end, far in ((one, other), (other, one)):
                said = (end, tree.number, far) in state.confirmed
                assert said or end not in VOTERS, f"{end} has not confirmed {far} in {tree.number}"
    state.trees.append(tree)
