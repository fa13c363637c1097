"""Every history of a small election: breadth-first over the states of three voters, their disks and the network.

The voters are the product's :class:`~protocol.election.Election`, not a model of it. What is modelled is their world:

* **Time** goes in steps of a part of a lease, and each voter's clock has a rate of its own.
* **The network** keeps all that was ever said and may deliver it to a voter at any moment, again and again, or never:
  this is loss, duplication, reordering and any delay in one.
* **Processes** may be paused as long as one likes, because nothing needs to happen to anybody. They die and begin
  again at any moment, with their disk or without it. Patience may end at any moment.
* **Disks** write at once, or (``slow_disks``) at any moment after they were asked to. A process that dies between a
  write and what it says then is one whose word was lost; one that dies before the write did not hear the request.

At every state it is checked that at most one voter believes that it holds an unexpired lease; that whoever is obeyed
is that one, and all obey the same; that a warrant is said inside a lease only; that no voter promises two processes
overlapping leases, unless the first gave its promise back; and, if no disk is lost, that later reigns have higher
epochs. The first history that breaks a rule is the shortest.

What a voter does on an event depends on its own state only, so that it is computed once for each state, event and
time. States that behave alike from now on are one state. Left out is what no history needs: a voter looks at its clock
at once where that makes it say nothing and changes nobody it obeys; and time does not pass before the first candidacy.
"""

from __future__ import annotations

import copy
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple, TypeAlias

import msgspec

from protocol.ballot import Ballot
from protocol.core import Heard, Persist, Say, Tick, Written
from protocol.election import CANDIDACY_S, LEASE_S, Election, Leads
from protocol.election_states import Occurrence, Standing
from protocol.messages import Reign, Vote, VoteRequest, Warrant
from protocol.obedience import Obedience, Refusal
from protocol.promises import decode_promise
from protocol.roster import Roster
from protocol.voter import Voter

NAMES: Final = ("base", "robot1", "robot2")
ROSTER: Final = Roster(NAMES)
NEVER_S: Final = 1e9


class ExploredElection(Election):
    """Never stands by itself, and falls silent after some rounds: the exploration decides on both.

    It canvasses nobody: a canvass binds nobody, and whoever could be encouraged may stand here at any moment.
    """

    most_rounds = 99

    def _draw_patience_s(self) -> float:
        return NEVER_S

    def _ask_who_would(self, now_s: float) -> None:
        self._candidate_until_s = now_s + CANDIDACY_S
        self._open_ballot()
        self._go(Occurrence.ENCOURAGED, now_s)

    def _ask(self, now_s: float) -> None:
        if self._rounds < self.most_rounds:
            super()._ask(now_s)
        else:
            self._next_round_s = NEVER_S


class Unheeding(Obedience):
    """Obeys nobody, and says no marks."""

    def mark(self, _now_s: float) -> str:
        return "0.0"

    def heed(self, _reign: Reign, _warrant: Warrant, _now_s: float) -> Refusal:
        return ""


@dataclass(frozen=True)
class Bounds:
    """How far to look."""

    steps: int
    """Of time."""
    candidacies: int
    """That may begin, of all together."""
    steps_in_lease: float = 2
    rounds: tuple[int, int, int] = (1, 1, 1)
    """That a process of each voter may say; who may say none does not stand."""
    crashes: int = 0
    lose_disks: bool = False
    """Whether disks may be lost with their processes; then epochs may come again."""
    slow_disks: bool = False
    refusals: bool = True
    """Whether candidates may hear of votes refused, and by whose reigns; otherwise those are all lost."""
    heeding: tuple[str, ...] = ()
    """Who obeys leaders, so that it can be checked whom; the others say no marks, which multiply the states."""
    rates: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Seconds of each voter's clock in a second."""
    kind: type[ExploredElection] = ExploredElection
    """What is explored: the election, or a mutant of it."""


class Local(NamedTuple):
    """One voter and its disk."""

    voter: int
    mind: int
    write: int
    """What is being written; 0: nothing."""
    disk: int
    """What is written; 0: nothing."""
    promise: int
    """The reign that it voted for last, while that runs; 0: none."""
    promised: int
    """The step at which it did so."""


World: TypeAlias = tuple[int, tuple[int, int, int], int, int, int, tuple[int, ...]]
"""Step, locals, messages (a bit set), crashes, candidacies, reigns in order. Numbers stand for interned things."""

Event: TypeAlias = Heard | Written | Tick

STAND: Final = Tick()
"""The :class:`Tick` at which patience ends."""


class Move(NamedTuple):
    """What comes of an event at one voter."""

    text: str
    local: int
    said: int
    """Bit set of messages."""
    reigns: tuple[int, ...]
    """That begin."""
    overlap: int
    """Reign that it had promised a lease that overlaps with one promised now; 0: none."""
    fault: str
    stands: bool = False


@dataclass
class Look:
    """What is known of one voter in one state at one step."""

    voter: int
    tick: Move
    others: list[Move]
    """That need no message."""
    tested: int = 0
    heard: list[tuple[int, Move]] = field(default_factory=list)
    """Messages that change something, as bits, and what."""
    effective: int = 0
    """Those messages."""


class Found(NamedTuple):
    """A history that breaks a rule."""

    rule: str
    history: tuple[str, ...]


@dataclass
class Explored:
    """What came of it."""

    states: int = 0
    computed: int = 0
    """Events at voters that were not known yet."""
    led: int = 0
    """States in which somebody leads."""
    obeyed: int = 0
    """States in which somebody obeys another."""
    reigns: int = 0
    """The most that followed each other in one history."""
    found: Found | None = None


class TooLarge(Exception):
    """There are more states than allowed."""


class Interned:
    """Things with equal keys get one number, from 1 on."""

    def __init__(self) -> None:
        self.things: list[Any] = [None]
        self._numbers: dict[Any, int] = {}

    def number(self, key: Any, thing: Any) -> int:
        """The number of the first thing that had this key."""
        found = self._numbers.setdefault(key, len(self.things))
        if found == len(self.things):
            self.things.append(thing)
        return found


PASSED: Final = ("until_s", "next_round_s", "waiting_since_s")
"""Ends of names of moments of which it does not matter by how much they are over."""


CONSTANT: Final = frozenset({"_roster", "_team", "_name", "_lease_s", "_most_s", "_chance", "_effects", "most_rounds"})
"""Attributes that are equal in all states of a voter."""


def key_of(thing: Any, now_s: float, name: str = "") -> Any:
    """Equal for objects that behave alike from now on: moments that are over are one moment."""
    if isinstance(thing, float):
        over = thing <= now_s if name.endswith(PASSED) else thing + LEASE_S <= now_s
        return None if over else thing
    if isinstance(thing, dict):
        return tuple((name, key_of(value, now_s)) for name, value in sorted(thing.items()))
    if isinstance(thing, list | tuple):
        return tuple(key_of(value, now_s) for value in thing)
    if isinstance(thing, Election | Voter | Ballot | Obedience):
        return tuple(key_of(value, now_s, name) for name, value in vars(thing).items() if name not in CONSTANT)
    return thing


class Exploration:
    """All worlds that can be reached within the bounds."""

    def __init__(self, bounds: Bounds) -> None:
        self.bounds = bounds
        self.explored = Explored()
        self._minds, self._locals, self._messages = Interned(), Interned(), Interned()
        self._disks, self._reigns = Interned(), Interned()
        self._hearable = [0, 0, 0]
        """Bit sets of the messages that each voter may hear."""
        self._votes = [0, 0, 0]
        """Bit sets of the votes for each voter."""
        self._looks: dict[tuple[int, int], Look] = {}
        self._aged: dict[tuple[int, int], int] = {}
        self._rebirths: dict[tuple[int, int], list[tuple[str, int]]] = {}
        self._facts: dict[tuple[int, int], tuple[Reign | None, Reign | None]] = {}
        self._verdicts: dict[tuple[int, tuple[int, int, int]], str] = {}

    def run(self, most_states: int) -> Explored:
        """Look at all states, nearest first, until one breaks a rule.

        Raises:
            TooLarge: there are more.
        """
        start: World = (0, tuple(self._begun(voter) for voter in range(3)), 0, 0, 0, ())  # type: ignore[assignment]
        came_from: dict[World, tuple[World, str] | None] = {start: None}
        waiting = deque([start])
        explored = self.explored
        while waiting:
            world = waiting.popleft()
            explored.states += 1
            if explored.states > most_states:
                raise TooLarge(f"more than {most_states} states")
            for text, after, fault in self._successors(world):
                if after in came_from:
                    continue
                came_from[after] = (world, text)
                rule = fault or self._broken_rule(after)
                if rule:
                    explored.found = Found(rule, tuple(_history(after, came_from)))
                    return explored
                waiting.append(after)
        return explored

    def _clock_s(self, voter: int, step: int) -> float:
        return step * LEASE_S / self.bounds.steps_in_lease * self.bounds.rates[voter]

    def _begun(self, voter: int) -> int:
        """A voter that has rested."""
        mind = self._process(voter, 0, None, -2.0 * LEASE_S)
        mind.handle(Tick(), 0.0)
        return self._local(0, Local(voter, self._mind(voter, 0, mind), 0, 0, 0, 0))

    def _process(self, voter: int, incarnation: int, promise: Reign | None, now_s: float) -> ExploredElection:
        name = NAMES[voter]
        process = self.bounds.kind(
            ROSTER, team="t", name=name, incarnation=incarnation, promise=promise, seed=0, now_s=now_s
        )
        process._chance = None  # type: ignore[assignment]  # large, and without use here
        process.most_rounds = self.bounds.rounds[voter]
        if name not in self.bounds.heeding:
            process.obedience = Unheeding(name, incarnation, LEASE_S, None)
        return process

    def _mind(self, voter: int, step: int, mind: ExploredElection) -> int:
        return self._minds.number((voter, key_of(mind, self._clock_s(voter, step))), mind)

    def _local(self, step: int, local: Local) -> int:
        over = local.promise and self._clock_s(local.voter, step - local.promised) >= LEASE_S
        return (
            self._locals.number(local, local) if not over else self._local(step, local._replace(promise=0, promised=0))
        )

    def _age(self, step: int, number: int) -> int:
        """A voter of one step at the next one, when it has looked at its clock if that makes it say nothing."""
        aged = self._aged.get((step, number))
        if aged is None:
            local: Local = self._locals.things[number]
            mind = self._mind(local.voter, step + 1, self._minds.things[local.mind])
            aged = self._local(step + 1, local._replace(mind=mind))
            tick = self._look(step + 1, aged).tick
            if not tick.said and self._fact(step + 1, tick.local) == self._fact(step + 1, aged):
                aged = tick.local
            self._aged[step, number] = aged
        return aged

    def _look(self, step: int, number: int) -> Look:
        """What this voter can do now without hearing anything."""
        look = self._looks.get((step, number))
        if look is None:
            local: Local = self._locals.things[number]
            name = NAMES[local.voter]
            others = []
            if self._minds.things[local.mind].standing is Standing.WAITING and self.bounds.rounds[local.voter]:
                others.append(self._move(step, local, STAND, f"{name} stands")._replace(stands=True))
            if local.write:
                done = local._replace(write=0, disk=local.write)
                written = Written(self._disks.things[local.write][1])
                others.append(self._move(step, done, written, f"{name} has written"))
            tick = self._move(step, local, Tick(), f"{name} looks at its clock")
            look = self._looks[step, number] = Look(local.voter, tick, others)
        return look

    def _move(self, step: int, local: Local, event: Event, text: str) -> Move:
        """What this voter does on an event."""
        self.explored.computed += 1
        voter, now_s = local.voter, self._clock_s(local.voter, step)
        mind = _duplicate(self._minds.things[local.mind])
        if event is STAND:
            mind._patience_s = 0.0
        queue: deque[Event] = deque([event])
        said = overlap = 0
        reigns, fault = [], ""
        while queue:
            for effect in mind.handle(queue.popleft(), now_s):
                match effect:
                    case Say(body):
                        bit = self._said(voter, mind, body)
                        said |= bit if any(bit & hearable for hearable in self._hearable) else 0
                        if isinstance(body, VoteRequest) and body.warrant is not None and not mind.leads(now_s):
                            fault = "a warrant is said outside a lease"
                        if isinstance(body, Vote) and body.granted and body.promise is not None:
                            before = self._reigns.things[local.promise]
                            if before is not None and not _same_process(before, body.promise):
                                overlap = local.promise
                            promise = self._reigns.number(body.promise, body.promise)
                            local = local._replace(promise=promise, promised=step)
                    case Persist(content, token):
                        number = self._disks.number((content, token), (content, token))
                        if self.bounds.slow_disks:
                            local = local._replace(write=number)
                        else:
                            local = local._replace(disk=number)
                            queue.append(Written(token))
                    case Leads(reign):
                        reigns.append(self._reigns.number(reign, reign))
                        local = local._replace(promise=reigns[-1], promised=step)
        mind._patience_s = NEVER_S
        mind._marks = {peer: mark for peer, mark in mind._marks.items() if peer in self.bounds.heeding}
        after = self._local(step, local._replace(mind=self._mind(voter, step, mind)))
        return Move(text, after, said, tuple(reigns), overlap, fault)

    def _said(self, voter: int, mind: ExploredElection, body: Any) -> int:
        """The bit of a message."""
        content = (NAMES[voter], mind._incarnation, body)
        bit = 1 << self._messages.number((voter, mind._incarnation, msgspec.json.encode(body)), content)
        for hearer in range(3):
            if isinstance(body, Vote) and body.candidate == NAMES[hearer] and (body.granted or self.bounds.refusals):
                self._votes[hearer] |= bit
                self._hearable[hearer] |= bit
            if isinstance(body, VoteRequest) and hearer != voter:
                self._hearable[hearer] |= bit
        return bit

    def _hear(self, step: int, number: int, said: int) -> Look:
        """What this voter can do now, hearing any of these messages."""
        look = self._looks.get((step, number)) or self._look(step, number)
        untested = said & self._hearable[look.voter] & ~look.tested
        if not untested:
            return look
        local: Local = self._locals.things[number]
        look.tested |= untested
        for message in _bits(untested):
            heard = Heard(*self._messages.things[message])
            text = f"{NAMES[local.voter]} hears {heard.peer}.{heard.incarnation}: {heard.body}"
            move = self._move(step, local, heard, text)
            if move[1:] != look.tick[1:] and (move.local != number or move.said & ~said):
                look.heard.append((1 << message, move))
                look.effective |= 1 << message
        return look

    def _successors(self, world: World) -> Iterator[tuple[str, World, str]]:
        step, places, said, crashes, candidacies, _ = world
        for voter, number in enumerate(places):
            look = self._hear(step, number, said)
            if look.tick.local != number:
                yield self._moved(world, voter, look.tick)
            for move in look.others:
                if not move.stands or candidacies < self.bounds.candidacies:
                    yield self._moved(world, voter, move)
            for bit, move in look.heard:
                if said & bit:
                    yield self._moved(world, voter, move)
            if crashes < self.bounds.crashes:
                yield from self._crashes(world, voter)
        if candidacies and step < self.bounds.steps:
            aged = tuple(self._age(step, number) for number in places)
            yield "time goes on", (step + 1, aged, *world[2:]), ""  # type: ignore[misc]

    def _moved(self, world: World, voter: int, move: Move) -> tuple[str, World, str]:
        step, places, said, crashes, candidacies, reigns = world
        fault = move.fault
        if move.overlap and not fault and not self._is_withdrawn(move.overlap, said):
            fault = f"{NAMES[voter]} promises a lease while one of {self._reigns.things[move.overlap]} runs"
        if move.reigns:
            if not self.bounds.lose_disks and reigns:
                epochs = [self._reigns.things[reign].epoch for reign in (*reigns, *move.reigns)]
                if epochs[-1] <= epochs[-2]:
                    fault = fault or "a reign does not have a higher epoch than the one before"
            reigns += move.reigns
        places = (*places[:voter], move.local, *places[voter + 1 :])  # type: ignore[assignment]
        heard = said | move.said
        for candidate, for_it in enumerate(
            self._votes
        ):  # forget votes that do not change their candidate, and will not
            if heard & for_it and (candidate == voter or move.said & for_it):
                heard &= ~for_it | self._hear(step, places[candidate], heard & for_it).effective
        return move.text, (step, places, heard, crashes, candidacies + move.stands, reigns), fault

    def _crashes(self, world: World, voter: int) -> Iterator[tuple[str, World, str]]:
        """The worlds in which this voter has died and begun again, just now."""
        step, places, said, crashes, candidacies, reigns = world
        for text, reborn in self._reborn(step, places[voter]):
            born = (*places[:voter], reborn, *places[voter + 1 :])
            heard = said & ~self._votes[voter]  # they are for a process that is no more
            yield text, (step, born, heard, crashes + 1, candidacies, reigns), ""  # type: ignore[misc]

    def _reborn(self, step: int, number: int) -> list[tuple[str, int]]:
        """How this voter can begin again now, if it has anything to forget; otherwise that is no more than a pause."""
        known = self._rebirths.get((step, number))
        if known is not None:
            return known
        known = self._rebirths[step, number] = []
        local: Local = self._locals.things[number]
        mind: ExploredElection = self._minds.things[local.mind]
        if mind._voter.promise is None and mind._voter.writing is None and not mind._rounds:
            return known
        disks = {"with its disk": local.disk}
        if local.write:
            disks["with its disk, just written"] = local.write
        if self.bounds.lose_disks and local.disk:
            disks["without its disk"] = 0
        name = NAMES[local.voter]
        for text, disk in disks.items():
            content = self._disks.things[disk][0] if disk else None
            incarnation = mind._incarnation + 1
            promise = decode_promise(content, file="", team="t", voter=name, incarnation=incarnation)
            process = self._process(local.voter, incarnation, promise, self._clock_s(local.voter, step))
            begun = local._replace(mind=self._mind(local.voter, step, process), write=0, disk=disk)
            known.append((f"{name} dies and begins again {text}", self._local(step, begun)))
        return known

    def _is_withdrawn(self, reign: int, said: int) -> bool:
        """Whether the promise of this reign has been given back."""
        before: Reign = self._reigns.things[reign]
        return any(
            isinstance(body, VoteRequest)
            and body.withdrawn
            and body.epoch >= before.epoch
            and (sender, incarnation) == (before.leader, before.incarnation)
            for sender, incarnation, body in (self._messages.things[message] for message in _bits(said))
        )

    def _broken_rule(self, world: World) -> str:
        step, places, *_, reigns = world
        self.explored.reigns = max(self.explored.reigns, len(reigns))
        verdict = self._verdicts.get((step, places))
        if verdict is None:
            verdict = self._verdicts[step, places] = self._judge(step, places)
        return verdict

    def _judge(self, step: int, places: tuple[int, int, int]) -> str:
        facts = [self._fact(step, number) for number in places]
        leaders = [office for office, _ in facts if office is not None]
        obeyed = {(reign.leader, reign.incarnation) for _, reign in facts if reign is not None}
        self.explored.led += len(leaders)
        self.explored.obeyed += sum(reign is not None and office is None for office, reign in facts)
        if len(leaders) > 1:
            return f"two hold a lease: {leaders}"
        if len(obeyed) > 1:
            return f"two are obeyed: {sorted(obeyed)}"
        if leaders and obeyed and obeyed != {(leaders[0].leader, leaders[0].incarnation)}:
            return f"{obeyed} is obeyed while {leaders[0]} holds the lease"
        return ""

    def _fact(self, step: int, number: int) -> tuple[Reign | None, Reign | None]:
        """The reign in which a voter holds an unexpired lease, and the one that it obeys."""
        fact = self._facts.get((step, number))
        if fact is None:
            local: Local = self._locals.things[number]
            now_s, mind = self._clock_s(local.voter, step), self._minds.things[local.mind]
            office = mind.office if mind.leads(now_s) else None
            fact = self._facts[step, number] = (office, mind.obedience.obeyed(now_s))
        return fact


def _duplicate(mind: ExploredElection) -> ExploredElection:
    """A copy that shares nothing that changes."""
    double = copy.copy(mind)
    double._voter = copy.copy(mind._voter)
    double._marks, double._effects = mind._marks.copy(), []
    double.obedience = copy.copy(mind.obedience)
    double.obedience._said_s, double.obedience._taken = mind.obedience._said_s.copy(), mind.obedience._taken.copy()
    if mind.obedience._voter is not None:
        double.obedience._voter = double._voter
    if mind._ballot is not None:
        double._ballot = copy.copy(mind._ballot)
        double._ballot._asked_s, double._ballot._voted_s = mind._ballot._asked_s.copy(), mind._ballot._voted_s.copy()
    return double


def _history(world: World, came_from: dict[World, tuple[World, str] | None]) -> list[str]:
    lines: list[str] = []
    before = came_from[world]
    while before is not None:
        world, text = before
        lines.append(f"step {world[0]}: {text}")
        before = came_from[world]
    return lines[::-1]


def _same_process(one: Reign, other: Reign) -> bool:
    return (one.leader, one.incarnation) == (other.leader, other.incarnation)


def _bits(number: int) -> Iterator[int]:
    """Places of the ones."""
    while number:
        lowest = number & -number
        yield lowest.bit_length() - 1
        number ^= lowest
