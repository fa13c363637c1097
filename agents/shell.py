"""Between a role and its world: decodes what arrives, carries out what the role wants, and survives both.

The world (:mod:`agents.runtime`, ``launcher.simulation``) owns time, threads and the bus. It calls
:meth:`PeerShell.start` once, then :meth:`~PeerShell.take` for every event of the bus, :meth:`~PeerShell.finish` for
every computation that has ended, :meth:`~PeerShell.written` for every promise that is on disk or could not be put
there, and :meth:`~PeerShell.wake` when :attr:`~PeerShell.wake_at_s` has come; all from one thread.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable
from functools import lru_cache
from typing import Final, Literal, TypeAlias

from agents.driver import RobotDriver
from agents.records import AnyRecord, LogLine
from agents.role import (
    RETRY_S,
    Compute,
    Drive,
    Effect,
    Event,
    Heard,
    JobDone,
    Persist,
    Publish,
    Ranged,
    Record,
    Role,
    WakeAt,
    Woken,
    Written,
)
from protocol.bus import Bus, BusEvent, PeerAppeared, PeerVanished, Received
from protocol.keys import Address, parse, route
from protocol.messages import AnyBody, Envelope, Goal, MalformedMessage, addressee_of, decode, encode, kind_of

MAXIMUM_OPERATORS: Final = 64
"""Operators remembered at a time. Their names are not on the roster, so that the memory must be bounded."""

MAXIMUM_KEYS: Final = 1024
"""Keys remembered at a time: those of operators are without end."""

Refusal: TypeAlias = str
"""Why a publication was not heard: it is foreign, malformed, impersonated, misplaced or stale, or of a stranger."""

_NOTHING: Final = (-1, -1)
"""Before all incarnations and sequences."""


def read(publication: Received) -> Heard | Refusal:
    """The message of a publication, or what is wrong with it whoever hears it."""
    address = parse(publication.key)
    if address is None:
        return "foreign"
    try:
        envelope = decode(publication.payload)
    except MalformedMessage:
        return "malformed"
    if envelope.sender != address.speaker:
        return "impersonated"
    if envelope.kind != address.kind or addressee_of(envelope.body) != address.to:
        return "misplaced"
    if isinstance(envelope.body, Goal) is not address.operator:
        return "misplaced"
    return Heard(address, envelope)


class PeerShell:
    """One peer: a role, its body and its bus.

    Args:
        role: the mind.
        driver: the body.
        bus: open connection to the team.
        name, team: of this peer; they make its keys.
        incarnation: of this process; greater than those of the processes that bore the name before.
        peers: names on the roster; what others say is not heard. Operators need not be on it.
        now: mission time, seconds.
        wall_clock: seconds since 1970 (virtual ones in simulation), for the envelopes.
        record: puts a record of this peer into the recording: ``record(time_s, record)``.
        execute: starts a computation, which is to end in :meth:`finish`. Must not call it before it returns.
        persist: puts a promise on disk, which is to end in :meth:`written`, likewise not before it returns.
        read: :func:`read`; in simulation all peers share what one of them has read.
    """

    def __init__(
        self,
        role: Role,
        driver: RobotDriver,
        bus: Bus,
        *,
        name: str,
        team: str,
        incarnation: int,
        peers: Collection[str],
        now: Callable[[], float],
        wall_clock: Callable[[], float],
        record: Callable[[float, AnyRecord], None],
        execute: Callable[[Compute], None],
        persist: Callable[[Persist], None],
        read: Callable[[Received], Heard | Refusal] = read,
    ) -> None:
        self.wake_at_s = math.inf
        """Mission time at which :meth:`wake` is due."""
        self.refused: Counter[Refusal] = Counter()
        """How many publications were not heard, by reason."""
        self.faults = 0
        """How many events the role failed on."""
        self._role = role
        self._driver = driver
        self._bus = bus
        self._name = name
        self._team = team
        self._incarnation = incarnation
        self._peers = frozenset(peers)
        self._now = now
        self._wall_clock = wall_clock
        self._record = record
        self._execute = execute
        self._persist = persist
        self._read = read
        self._sequence = 0
        self._listened: dict[str, Address] = {}
        """Addresses of the keys that it has heard something under."""
        self._heard: dict[tuple[str, str], tuple[int, int]] = {}
        self._incarnations: dict[str, int] = {}
        """The latest one heard of each peer: it has replaced all before, whatever they said last and of what kind."""
        self._operators: dict[tuple[str, str], tuple[int, int]] = {}
        self._complained: set[tuple[str, str]] = set()
        """What has been logged once and is only counted from then on."""

    def start(self) -> None:
        """Let the role begin."""
        now_s = self._now()
        self._driver.advance(now_s)
        self._carry_out(self._role.start(now_s, self._driver.pose()), now_s)

    def take(self, event: BusEvent) -> None:
        """Pass an event of the bus on to the role, if it is fit for it."""
        if isinstance(event, Received):
            address = self._listened.get(event.key) or self._listen(event.key)
            if address is None:
                return
            message = self._read(event)
            if isinstance(message, str):
                self._refuse(event.key, message)
            elif self._is_news(address, message.envelope):
                self._tell(message, self._now())
            else:
                self._refuse(event.key, "stale")
        elif event.peer in self._peers and event.peer != self._name:
            self._tell(event, self._now())

    def finish(self, done: JobDone) -> None:
        """Pass the end of a computation on to the role."""
        self._tell(done, self._now())

    def written(self, written: Written) -> None:
        """Pass on to the role that a promise is on disk, or why not."""
        self._tell(written, self._now())

    def wake(self) -> None:
        """Bring the body up to date and wake the role."""
        now_s = self._now()
        self.wake_at_s = math.inf
        self._driver.advance(now_s)
        for ranged in self._driver.ranges():
            self._tell(ranged, now_s)
        self._tell(Woken(self._driver.pose()), now_s)
        if self.wake_at_s == math.inf:
            self.wake_at_s = now_s + RETRY_S

    def _listen(self, key: str) -> Address | None:
        """The address of a key that has not been looked at yet, if what is under it is for this peer."""
        address = parse(key)
        kind, to = (address.kind, address.to) if address is not None else route(key)
        if kind not in self._role.hears or to not in ("", self._name):
            return None  # most of the traffic: not worth a closer look
        if address is None or address.team != self._team:
            self._refuse(key, "foreign")
        elif address.operator or address.speaker in self._peers - {self._name}:
            if len(self._listened) >= MAXIMUM_KEYS:
                self._listened.clear()
            self._listened[key] = address
            return address
        elif address.speaker != self._name:  # else it is one's own echo
            self._refuse(key, "stranger")
        return None

    def _is_news(self, address: Address, envelope: Envelope) -> bool:
        """Whether this is later than all that the sender has said of this kind; remembers it if so."""
        speaker, incarnation = address.speaker, envelope.incarnation
        source, order = (speaker, address.kind), (incarnation, envelope.sequence)
        if address.operator:
            memory = self._operators
        else:
            memory = self._heard
            if incarnation < self._incarnations.get(speaker, -1):
                return False
            self._incarnations[speaker] = incarnation
        if order <= memory.get(source, _NOTHING):
            return False
        memory[source] = order
        if address.operator and len(memory) > MAXIMUM_OPERATORS:
            del memory[next(iter(memory))]
        return True

    def _refuse(self, key: str, reason: Refusal) -> None:
        """Count a refusal; the first of its reason and speaker, and not those without end, is logged."""
        self.refused[reason] += 1
        address = parse(key)
        speaker = address.speaker if address is not None and address.speaker in self._peers else "others"
        if reason not in ("foreign", "stale"):
            self._complain("warning", (speaker, reason), f"refused a message under {key[:200]}: {reason}")

    def _tell(self, event: Event, now_s: float) -> None:
        """Give the role an event. Whatever fails on it costs this event and nothing else."""
        try:
            self._carry_out(self._role.handle(event, now_s), now_s)
        except Exception as problem:
            self.faults += 1
            failure = type(problem).__name__
            kind = event.envelope.kind if isinstance(event, Heard) else type(event).__name__
            self._complain("error", (kind, failure), f"failed on {_describe(event)}: {failure}: {problem}"[:400])

    def _carry_out(self, effects: Iterable[Effect], now_s: float) -> None:
        for effect in effects:  # the most frequent first
            if type(effect) is WakeAt:
                self.wake_at_s = effect.time_s
            elif type(effect) is Publish:
                self._publish(effect.body)
            elif type(effect) is Record:
                self._record(now_s, effect.record)
            elif type(effect) is Drive:
                self._driver.drive(effect.velocity, effect.for_s)
            elif type(effect) is Compute:
                self._execute(effect)
            elif type(effect) is Persist:
                self._persist(effect)

    def _publish(self, body: AnyBody) -> None:
        envelope = Envelope(
            sender=self._name, incarnation=self._incarnation, sequence=self._sequence,
            sent_at_s=self._wall_clock(), body=body,
        )  # fmt: skip
        self._sequence += 1
        self._bus.publish(_key(self._team, self._name, kind_of(body), addressee_of(body)), encode(envelope))

    def _complain(self, level: Literal["warning", "error"], what: tuple[str, str], text: str) -> None:
        if what not in self._complained:
            self._complained.add(what)
            self._record(self._now(), LogLine(level=level, text=f"{text}; further ones like this are only counted"))


@lru_cache(maxsize=1024)
def _key(team: str, speaker: str, kind: str, to: str) -> str:
    return Address(team, speaker, kind, to=to).key


def _describe(event: Event) -> str:
    match event:
        case Heard(_, envelope):
            return f"{envelope.kind} of {envelope.sender}"
        case JobDone(job):
            return f"the end of {job}"
        case Written():
            return "the end of writing"
        case PeerAppeared(peer) | PeerVanished(peer):
            return f"the coming or going of {peer}"
        case Ranged():
            return "a range"
        case Woken():
            return "waking up"
