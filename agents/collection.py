"""What this peer has heard of the others: so whoever is elected knows already where everybody was last.

Whatever is standing is said again and again (``state`` and ``intent`` at the control rate, orders several times a
second), so a peer that joins late, or lost messages, has all of it within a second and need not ask.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from agents.allegiance import Allegiance
from agents.role import Effect, Event, Heard
from protocol.membership import Presence
from protocol.messages import Intent, Point, State


@dataclass(frozen=True, slots=True)
class Known:
    """What was last heard of a peer."""

    body: State | Intent
    incarnation: int


class Collection:
    """See the module.

    Args:
        allegiance: says who is there.
        agent: name of the tracked agent, the only one whose ``intent`` counts.
    """

    hears = frozenset({"state", "intent"})
    next_s = float("inf")

    def __init__(self, allegiance: Allegiance, agent: str) -> None:
        self._allegiance = allegiance
        self._agent = agent
        self._known: dict[str, Known] = {}

    def handle(self, event: Event, _now_s: float) -> Iterable[Effect]:
        """Remember what is said."""
        if isinstance(event, Heard):
            peer, body = event.envelope.sender, event.envelope.body
            if isinstance(body, State) if peer != self._agent else isinstance(body, Intent):
                self._known[peer] = Known(body, event.envelope.incarnation)  # type: ignore[arg-type]
        return ()

    def body(self, peer: str) -> State | Intent | None:
        """What a peer says of itself; None if it is not there, or this process of it has said nothing yet."""
        known = self._known.get(peer)
        if known is None or self._allegiance.presence(peer) is not Presence.PRESENT:
            return None
        return known.body if known.incarnation == self._allegiance.latest_incarnation(peer) else None

    def state(self, robot: str) -> State | None:
        """What a robot or the base station says of itself, as :meth:`body`."""
        body = self.body(robot)
        return body if isinstance(body, State) else None

    def intent(self) -> Intent | None:
        """What the agent says of itself, as :meth:`body`."""
        body = self.body(self._agent)
        return body if isinstance(body, Intent) else None

    def whereabouts(self, peer: str) -> tuple[Point, ...]:
        """Where a peer may be that is not there any more: its last place and its way from there; empty if unknown."""
        known = self._known.get(peer)
        return () if known is None else tuple(dict.fromkeys((known.body.position, *known.body.path)))
