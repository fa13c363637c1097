"""What the tracked agent does by itself: a source of goals."""

from __future__ import annotations

from typing import Protocol

from agents.mission import Mission, Scripted, Wandering
from agents.wander import Wanderer
from planning.environment import Environment
from protocol.messages import Point


class Routine(Protocol):
    """A behaviour at work."""

    def choose(self, position: Point) -> Point | None:
        """Where an agent that stands here and is free wants to go; None: nowhere for now."""

    def reached(self) -> None:
        """The place chosen last has been reached. An interrupted walk does not get here."""


class Script:
    """Goals in order; one that was interrupted is taken up again."""

    def __init__(self, goals: tuple[Point, ...]) -> None:
        self._ahead = list(reversed(goals))

    def choose(self, position: Point) -> Point | None:  # noqa: ARG002 - a script goes on wherever the agent is
        """The first goal not reached yet."""
        return self._ahead[-1] if self._ahead else None

    def reached(self) -> None:
        """Strike out the goal."""
        self._ahead.pop()


class Exploration:
    """Goals of a :class:`~agents.wander.Wanderer`; an interrupted one is given up."""

    def __init__(self, wanderer: Wanderer) -> None:
        self._wanderer = wanderer

    def choose(self, position: Point) -> Point | None:
        """A new goal, in sight or around a corner."""
        return self._wanderer.choose(position)

    def reached(self) -> None:
        """Every goal is new anyway."""


def begin(mission: Mission, free: Environment) -> Routine:
    """The mission's behaviour, at its beginning, for an agent whose centre can be in ``free``."""
    match mission.behaviour:
        case Scripted(goals=goals):
            return Script(goals)
        case Wandering(around_corner_share=share):
            return Exploration(Wanderer(free, mission.seed, share))
        case _:
            return Script(())
