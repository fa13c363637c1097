"""Who of the robots a leader counts on: those that are there, have said where they are, and answer.

A robot that is heard but does not hear the leader would keep everybody waiting for ever; so one that does not answer an
order to hold is done without until it has.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from agents.collection import Collection
from agents.dispatcher import Dispatcher, has_heard
from protocol.messages import Authority, State


class Body(Protocol):
    """What the leader needs of its own body."""

    @property
    def state(self) -> State | None:
        """What this robot says of itself."""


class RollCall:
    """See the module.

    Args:
        robots: of the roster.
        name: of the leader.
        collection: what the others have said.
        body: the leader's own, if it is a robot.
        dispatcher: is told of every change.
    """

    def __init__(
        self, robots: Iterable[str], name: str, collection: Collection, body: Body | None, dispatcher: Dispatcher
    ) -> None:
        self.states: dict[str, State] = {}
        """Of those that are counted on."""
        self._robots, self._name = tuple(robots), name
        self._collection, self._body, self._dispatcher = collection, body, dispatcher
        self._deaf: dict[str, Authority] = {}
        """Robots that do not answer, and what was ordered when they were given up."""

    @property
    def missing(self) -> tuple[str, ...]:
        """Robots of the roster that are not counted on."""
        return tuple(robot for robot in self._robots if robot not in self.states)

    def hold(self, authority: Authority, now_s: float) -> tuple[bool, tuple[str, ...]]:
        """Look at all robots once.

        Args:
            authority: of the last order.
            now_s: the time.

        Returns:
            Whether anybody is new or lost; and who has been given up now.
        """
        before = self.states.keys() | ()
        for robot in self._robots:
            own = self._body if robot == self._name else None
            state = self._collection.state(robot) if own is None else own.state
            if state is not self.states.get(robot) or robot in self._deaf:
                self._look_at(robot, state, now_s)
        given_up = self._dispatcher.deaf(now_s)
        for robot in given_up:
            self._deaf[robot] = authority
            self._lose(robot)
        return before != self.states.keys(), given_up

    def _look_at(self, robot: str, state: State | None, now_s: float) -> None:
        """See to a robot of which there is news, or that did not answer."""
        if robot in self._deaf and (state is None or has_heard(state, self._deaf[robot])):
            del self._deaf[robot]
        if state is None or robot in self._deaf:
            self._lose(robot)
        elif state is not self.states.get(robot):
            self.states[robot] = state
            self._dispatcher.hear(robot, state, now_s)

    def _lose(self, robot: str) -> None:
        if self.states.pop(robot, None) is not None:
            self._dispatcher.lose(robot)
