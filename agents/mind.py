"""A mind made of parts, each one concern of a peer: whom it obeys, what its body does, how it leads, what it knows.

Every part is given every event, in the order of the parts, and answers with effects; of the messages it is given the
kinds that it hears. So parts need not know of each other; where one needs what another knows, it is given that other
one when the mind is composed (:mod:`agents.casting`), and comes after it.

A part asks for time by its :attr:`~Part.next_s`. One that finds out during an event of another kind that it has
something to do names a time that has passed, and is woken at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Protocol, TypeAlias

from agents.role import RETRY_S, Effect, Event, Heard, WakeAt, Woken
from protocol.messages import Point


class Part(Protocol):
    """One concern of a peer's mind. Pure, as a :class:`~agents.role.Role` is."""

    @property
    def hears(self) -> frozenset[str]:
        """Kinds of messages passed on to it."""

    @property
    def next_s(self) -> float:
        """Mission time at which it wants to be woken next; infinite: not by itself. It may be woken at other times."""

    def handle(self, event: Event, now_s: float) -> Iterable[Effect]:
        """Effects of one event, without a :class:`~agents.role.WakeAt`. The first event of all is being woken."""


Handle: TypeAlias = Callable[[Event, float], Iterable[Effect]]

Turn: TypeAlias = tuple[Part, Handle | None, bool]
"""A part at an event: what takes the event, if it is given it, and whether it has a time to be asked for."""


class Mind:
    """The role that its parts make up.

    Args:
        parts: in the order in which they are given events.
    """

    def __init__(self, parts: Sequence[Part]) -> None:
        self.parts = tuple(parts)
        self.hears = frozenset[str]().union(*(part.hears for part in parts))
        self._hearers = {kind: self._plan([kind in part.hears for part in parts]) for kind in self.hears}
        self._all, self._others = self._plan([True] * len(self.parts)), self._plan([False] * len(self.parts))

    def start(self, now_s: float, position: Point) -> Iterable[Effect]:
        """Wake all parts for the first time."""
        return self.handle(Woken(position), now_s)

    def handle(self, event: Event, now_s: float) -> Iterable[Effect]:
        """Effects of all parts, and when the first of them wants to be woken.

        A part that fails keeps none of the others from its work: what it failed on is raised when all have been asked.
        """
        failure: Exception | None = None
        wake_s = math.inf
        turns = self._hearers.get(event.address.kind, self._others) if isinstance(event, Heard) else self._all
        for part, handle, wakes in turns:
            if handle is not None:
                try:
                    effects = handle(event, now_s)
                    if effects:
                        yield from effects
                except Exception as problem:
                    failure = problem
                    wake_s = min(wake_s, now_s + RETRY_S)
                    continue
            if wakes:
                next_s = part.next_s
                if next_s < wake_s:
                    wake_s = next_s
        yield WakeAt(wake_s if wake_s > now_s else now_s)
        if failure is not None:
            raise failure

    def _plan(self, handles: Sequence[bool]) -> tuple[Turn, ...]:
        """Turns of all parts that handle an event or have a time of their own, as most parts have."""
        wakes = [getattr(type(part), "next_s", None) != math.inf for part in self.parts]
        turns = zip(self.parts, handles, wakes, strict=True)
        return tuple((part, part.handle if handle else None, wake) for part, handle, wake in turns if handle or wake)
