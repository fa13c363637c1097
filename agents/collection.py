"""What this peer has heard of the others: so whoever is elected knows already where everybody was last.

Whatever is standing is said again and again (``state`` and ``intent`` at the control rate, orders several times a
second), so a peer that joins late, or lost messages, has all of it within a second and need not ask.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby, takewhile

from agents.allegiance import Allegiance
from agents.retreat import MEMORY
from agents.role import Effect, Event, Heard
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
        self._is_there = allegiance.is_there
        self._agent = agent
        self._known: dict[str, Known] = {}
        self._behind: dict[str, deque[Point]] = {}
        """Where each robot has come by in its present plan, the oldest place first."""

    def handle(self, event: Event, _now_s: float) -> Iterable[Effect]:
        """Remember what is said."""
        if isinstance(event, Heard):
            peer, body = event.envelope.sender, event.envelope.body
            if isinstance(body, State) if peer != self._agent else isinstance(body, Intent):
                if isinstance(body, State):
                    self._follow(peer, body)
                self._known[peer] = Known(body, event.envelope.incarnation)  # type: ignore[arg-type]
        return ()

    def _follow(self, robot: str, now: State) -> None:
        """Note by which waypoints a robot has come since it was heard last."""
        behind = self._behind.get(robot)
        if behind is None:
            behind = self._behind[robot] = deque(maxlen=MEMORY)
        known = self._known.get(robot)
        before = known.body if known is not None else None
        if not isinstance(before, State) or _plan(now) is None or _plan(before) != _plan(now):
            behind.clear()
        elif not _turned(now):
            if not behind:
                behind.append(before.position)
            if before.path[1:2] != now.path[1:2]:
                ahead = set(now.path[1:])
                behind.extend(takewhile(lambda place: place not in ahead, before.path[1:]))

    def body(self, peer: str) -> State | Intent | None:
        """What a peer says of itself; None if it is not there, or this process of it has said nothing yet."""
        known = self._known.get(peer)
        if known is None or not self._is_there(peer, known.incarnation):
            return None
        return known.body

    def state(self, robot: str) -> State | None:
        """What a robot or the base station says of itself, as :meth:`body`."""
        known = self._known.get(robot)
        if known is None or not isinstance(known.body, State) or not self._is_there(robot, known.incarnation):
            return None
        return known.body

    def heard_at(self, robot: str) -> Point | None:
        """Where a robot has said last that it is, whatever has become of it; None: it has not been heard."""
        known = self._known.get(robot)
        return None if known is None else known.body.position

    def intent(self) -> Intent | None:
        """What the agent says of itself, as :meth:`body`."""
        body = self.body(self._agent)
        return body if isinstance(body, Intent) else None

    def whereabouts(self, robot: str, own: State | None) -> tuple[Point, ...]:
        """Where a robot may be that is not there any more; empty if unknown.

        Its last place, its way from there, and, if it may have gone back unheard, where it had come by in its plan. It
        has not while anybody who is there is in that plan and has not turned: all of a plan go back, or none.

        Args:
            robot: its name.
            own: what this peer says of itself, if it is a robot.
        """
        known = self._known.get(robot)
        if known is None:
            return ()
        places = [known.body.position, *known.body.path]
        there = (own, *(self.state(other) for other in self._known if other != robot))
        if isinstance(known.body, State) and not any(_holds_to(state, _plan(known.body)) for state in there):
            places += [*reversed(places), *reversed(self._behind[robot])]
        return tuple(place for place, _ in groupby(places))


def _plan(state: State) -> tuple[int, int] | None:
    return None if state.progress is None else (state.progress.epoch, state.progress.plan)


def _holds_to(state: State | None, plan: tuple[int, int] | None) -> bool:
    """Whether a robot is in a plan and has not turned."""
    return state is not None and plan is not None and _plan(state) == plan and not _turned(state)


def _turned(state: State) -> bool:
    return state.progress is not None and state.progress.retreat is not None
