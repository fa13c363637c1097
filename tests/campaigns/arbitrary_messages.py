"""Messages that nobody should send: noise, confused types, mutants of good ones, and good ones that make no sense.

What peers have said is remembered, and turns up again in what is made: names of moments and of rounds, epochs, plans.
So what is made is believed often enough to get past the first checks, and deep into what a peer does with it.
"""

from __future__ import annotations

import copy
import json
from collections import deque
from collections.abc import Collection, Sequence
from random import Random
from typing import Any, Final

import msgspec
from msgspec import inspect as types
from msgspec import structs

from protocol.bus import BusEvent, PeerAppeared, PeerVanished, Received
from protocol.examples import EXAMPLES
from protocol.keys import ADDRESSED_KINDS, Address
from protocol.messages import (
    BODIES,
    MAXIMUM_PAYLOAD_BYTES,
    AnyBody,
    Auction,
    Authority,
    Deployment,
    Envelope,
    LastHeard,
    Reign,
    Topology,
    Vote,
    VoteRequest,
    Warrant,
    addressee_of,
    encode,
    kind_of,
)

ODD: Final[tuple[Any, ...]] = (
    None, True, False, 0, -1, 1, 2**53, 2**63, -(2**63), 10**40, 0.0, -0.0, 1e-300, 1e300, -1e7, 1.5, "", "\x00", "NaN",
    "base", "robot1", "a" * 1000, "\ud7ff\U0010ffff", [], {}, [[]], [[[[[[[[]]]]]]]], {"kind": "state"}, [1e7, -1e7],
)  # fmt: skip
"""JSON values for places where they do not belong."""

OPERATOR: Final = "ada"
"""Who says what operators say."""

SHAPES: Final = {kind: types.type_info(body) for kind, body in BODIES.items()}
"""Types of all fields of all bodies."""

BAD_KEYS: Final = (
    "", "/", "team", "team/v1", "team/v1/robot1", "team/v1//state", "team/v2/robot1/state", "other/v1/robot1/state",
    "team/v1/robot1/state/more", "team/v1/operator/state", "team/v1/operator/robot1/state", "team/v1/nobody/state",
    "team/v1/robot1/alive", "team/v1/robot1/no_such_kind", "team/v1/robot1/**", "team/v1/\u0000/state",
)  # fmt: skip


class Mischief:
    """A source of events, each different, all from one seed.

    Args:
        seed: of everything.
        team: whose keys it uses.
        names: of the peers in whose name it speaks.
        hearer: the one that is spoken to, who does not hear itself.
        kinds: what is mostly said.
    """

    def __init__(self, seed: int, team: str, names: Sequence[str], hearer: str, kinds: Collection[str]) -> None:
        self.chance = Random(seed)
        self._team = team
        self._names = tuple(names)
        self._speakers = tuple(name for name in names if name != hearer)
        self._elects = self.chance.random() < 0.5
        """Whether it would have the hearer lead, and says nothing that keeps it from that; else somebody else."""
        self._kinds = tuple(sorted({*kinds} - {"vote_request"} if self._elects and len(kinds) > 3 else kinds))
        self._hearer = hearer
        self._examples = tuple(self._direct(body) for body in EXAMPLES if kind_of(body) in self._kinds)
        self._incarnations = dict.fromkeys((*names, OPERATOR), 0)
        self._sequence = 0
        self._request: VoteRequest | None = None
        """The last one of the hearer."""
        self._mark = "x"
        """The last one of the hearer's votes."""
        self._reign = Reign(epoch=1, leader=self._speakers[-1], incarnation=0)
        """Of somebody who seems to lead."""
        self._said: deque[Received] = deque(maxlen=200)
        self._texts: deque[str] = deque(["x"], maxlen=40)
        self._numbers: deque[int] = deque([0, 1], maxlen=40)

    def overhear(self, envelope: Envelope) -> None:
        """Remember what the hearer has said."""
        match envelope.body:
            case VoteRequest(withdrawn=False) as request:
                self._request = request
            case Vote(mark=mark):
                self._mark = mark
        self._gather(msgspec.to_builtins(envelope.body))

    def event(self) -> BusEvent:
        """The next thing to happen to a peer."""
        draw = self.chance.random()
        if draw < 0.02:
            return self.chance.choice((PeerAppeared, PeerVanished))(self.chance.choice((*self._names, "nobody", "")))
        if draw < 0.10:
            return Received(self._key(), self.chance.randbytes(int(self.chance.expovariate(0.02))))
        if draw < 0.15 and self._said:
            return self.chance.choice(self._said)  # once more, and late
        if draw < 0.20:
            return self._remember(self._help())
        if draw < 0.40:
            return self._remember(self._sane(self._body()))
        if draw < 0.60:
            return self._mutate(self._sane(self._example()))
        if draw < 0.80:
            return self._confuse(self._sane(self._body()))
        if draw < 0.802:
            sane = self._sane(self._example())
            return Received(sane.key, sane.payload + b" " * MAXIMUM_PAYLOAD_BYTES)
        return self._remember(self._misplace(self._body()))

    def _remember(self, event: Received) -> Received:
        self._said.append(event)
        return event

    def _help(self) -> Received:
        """A vote for the hearer, a word of who seems to lead, or an order of it: in force, and without sense."""
        request, chance = self._request, self.chance
        if request is not None and self._elects:
            promise = Reign(epoch=request.epoch, leader=self._hearer, incarnation=0)
            vote = Vote(
                candidate=self._hearer,
                correlation=request.correlation,
                granted=True,
                promise=None if request.canvass else promise,
                mark=f"{self._sequence}",
            )
            return self._sane(vote)
        if chance.random() < 0.02:
            epoch = self._reign.epoch + chance.randrange(1, 3)
            self._reign = Reign(epoch=epoch, leader=chance.choice(self._speakers), incarnation=0)
        leader = self._reign.leader
        warrant = Warrant(lease_s=0.8, marks=(LastHeard(peer=self._hearer, mark=self._mark),))
        body = self._body()
        if self._elects:
            return self._sane(body)
        if isinstance(body, Deployment | Topology | Auction):
            authority = Authority(epoch=self._reign.epoch, leader=leader, sequence=self._sequence)
            return self._sane(structs.replace(body, authority=authority, warrant=warrant), leader)
        return self._sane(
            VoteRequest(epoch=self._reign.epoch, correlation=f"{self._sequence}", warrant=warrant), leader
        )

    def _sane(self, body: AnyBody, speaker: str = "") -> Received:
        """A message as a peer would send it, whose process is mostly the one that spoke last."""
        self._sequence += 1
        operator = kind_of(body) == "goal"
        name = speaker or (OPERATOR if operator else self.chance.choice(self._speakers))
        self._incarnations[name] += not speaker and self.chance.random() < 0.0005
        envelope = Envelope(
            sender=name,
            incarnation=max(0, self._incarnations[name] - (self.chance.random() < 0.02)),
            sequence=self._sequence,
            sent_at_s=float(self._sequence),
            body=body,
        )
        address = Address(self._team, name, kind_of(body), operator=operator, to=addressee_of(body))
        return Received(address.key, encode(envelope))

    def _misplace(self, body: AnyBody) -> Received:
        """Under a key that is not its own, or old."""
        sane = self._sane(body)
        if self.chance.random() < 0.5:
            return Received(self._key(), sane.payload)
        self._sequence = max(0, self._sequence - self.chance.randrange(3))
        return sane

    def _key(self) -> str:
        if self.chance.random() < 0.3:
            return self.chance.choice(BAD_KEYS)
        name, kind = self.chance.choice(self._names), self.chance.choice((*BODIES, "alive"))
        to = self.chance.choice(("", "nobody", self._hearer)) if kind in ADDRESSED_KINDS else ""
        return Address(self._team, name, kind, operator=self.chance.random() < 0.1, to=to).key

    def _mutate(self, event: Received) -> Received:
        """Some bytes changed, cut out or doubled."""
        payload = bytearray(event.payload)
        for _ in range(self.chance.randrange(1, 5)):
            place = self.chance.randrange(len(payload)) if payload else 0
            match self.chance.randrange(4):
                case 0:
                    payload[place : place + 1] = self.chance.randbytes(1)
                case 1:
                    del payload[place : place + self.chance.randrange(1, 20)]
                case 2:
                    payload[place:place] = payload[place : place + self.chance.randrange(1, 40)]
                case 3:
                    payload[place : place + 1] = self.chance.choice((b"0", b"9", b"-", b"e9", b'"', b"[", b"}", b"\\u"))
        return Received(event.key, bytes(payload))

    def _confuse(self, event: Received) -> Received:
        """Valid JSON in which some values are of another kind, missing, or too many."""
        value = json.loads(event.payload)
        for _ in range(self.chance.randrange(1, 3)):
            # An envelope of the last incarnation that there can be would make all that follows it old.
            self._spoil(value["body"] if isinstance(value.get("body"), dict) and self.chance.random() < 0.97 else value)
        return Received(event.key, json.dumps(value).encode("utf-8", "surrogatepass"))

    def _spoil(self, value: Any) -> None:
        while isinstance(value, dict | list) and value:
            place: Any = self.chance.choice(list(value) if isinstance(value, dict) else range(len(value)))
            if isinstance(value[place], dict | list) and value[place] and self.chance.random() < 0.75:
                value = value[place]
                continue
            match self.chance.randrange(4):
                case 0:
                    del value[place]
                case 1 if isinstance(value, list):
                    value.extend(value[:] * self.chance.randrange(1, 200 // len(value) + 2))
                case _:
                    value[place] = copy.deepcopy(self.chance.choice((*ODD, *self._texts, *self._numbers)))
            return

    def _body(self) -> AnyBody:
        """A valid body of any kind, with any content that its types allow."""
        kind = self.chance.choice(self._kinds)
        body: AnyBody = msgspec.convert(self._value(SHAPES[kind]), BODIES[kind])  # type: ignore[assignment]
        if self.chance.random() < 0.2:
            return body
        return self._mend(body) if isinstance(body, Auction) else self._direct(body)

    def _direct(self, body: AnyBody) -> AnyBody:
        """For the hearer, if it is for one peer."""
        return structs.replace(body, candidate=self._hearer) if isinstance(body, Vote) else body

    def _mend(self, auction: Auction) -> Auction:
        """An auction that is bid in: each place of an aim counts as much, and the chain is of robots in it."""
        aims = tuple(structs.replace(aim, shares=(1.0 / len(aim.places),) * len(aim.places)) for aim in auction.aims)
        robots = tuple(dict.fromkeys(placement.robot for placement in auction.robots))
        return structs.replace(auction, aims=aims, standing=robots[: self.chance.randrange(3)])

    def _example(self) -> AnyBody:
        return self.chance.choice(self._examples)

    def _value(self, kind: Any) -> Any:
        chance = self.chance
        match kind:
            case types.StructType(fields=fields):
                content = {
                    field.encode_name: self._value(field.type)
                    for field in fields
                    if field.required or chance.random() < 0.8
                }
                return content | ({kind.tag_field: kind.tag} if kind.tag_field else {})
            case types.UnionType(types=choices):
                return self._value(chance.choice(choices))
            case types.LiteralType(values=values):
                return chance.choice(values)
            case types.BoolType():
                return chance.random() < 0.5
            case types.NoneType():
                return None
            case types.IntType():
                return self._number(kind.ge or 0, kind.le)
            case types.FloatType(ge=least, le=most):
                return self._measure(least, most)
            case types.StrType(pattern=None):
                return chance.choice(self._texts)[: kind.max_length or 64] or "x"
            case types.StrType():
                return chance.choice(self._names)
            case types.TupleType(item_types=items):
                return [self._value(item) for item in items]
            case types.VarTupleType():
                most = min(kind.max_length or 12, chance.choice((0, 1, 2, 3, 12)))
                return [self._value(kind.item_type) for _ in range(max(kind.min_length or 0, most))]
        raise NotImplementedError(f"{kind} in a message: say here how to make one up")

    def _number(self, least: int, most: int | None) -> int:
        number = self.chance.choice((*self._numbers, 0, 1, 2, 3, 7, 2**32, 2**53 - 1))
        return max(least, min(number + self.chance.choice((0, 0, 0, 1, -1)), 2**53 - 1 if most is None else most))

    def _measure(self, least: float | None, most: float | None) -> float:
        measure = self.chance.choice((0.0, 1.0, 2.5, self.chance.uniform(-2.0, 20.0), 1e-9, 1e7, -1e7, 1e300))
        return max(-1e300 if least is None else least, min(measure, 1e300 if most is None else most))

    def _gather(self, value: Any) -> None:
        match value:
            case dict():
                for item in value.values():
                    self._gather(item)
            case list() | tuple():
                for item in value:
                    self._gather(item)
            case str() if value not in BODIES:
                self._texts.append(value)
            case int() if not isinstance(value, bool):
                self._numbers.append(value)
