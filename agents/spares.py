"""Where robots wait that are no relays: behind the agent, where the next relay will be wanted, and out of the way."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import Final

import numpy as np
from numpy.typing import NDArray

from agents.assignment import assign
from planning.foresight import length, walk
from planning.geodesic import GeodesicMap
from protocol.messages import Point

Floats = NDArray[np.float64]

STAND_OFF_M: Final = 0.4
"""Free distance between discs that wait, and between them and the agent."""

APART_M: Final = 0.1
"""Least free distance between any two discs at their places, so that rounding is no touch."""

ROUNDING_M: Final = 1e-6

SETTLED_M: Final = 0.3
"""A place is not exchanged for one so near."""


class Waiting:
    """Waiting places for the spares of a team.

    Args:
        geodesics: shortest paths in the free space of the robots' centres.
        robot_radius_m: of their discs.
        refuges: (n, 2) float, metres: where robots can stand, for those that would be in the way elsewhere.
    """

    def __init__(self, geodesics: GeodesicMap, robot_radius_m: float, refuges: Floats) -> None:
        self._geodesics = geodesics
        self._refuges = refuges
        self.pitch_m = 2 * robot_radius_m + STAND_OFF_M
        """Distance between one waiting robot and the next, and between the first and the agent."""
        self.apart_m = 2 * robot_radius_m + APART_M
        """Least distance between the places of two robots."""

    def places(
        self,
        agent: Point,
        relays: Sequence[Point],
        spares: Mapping[str, Point],
        before: Mapping[str, Point],
        obstacles: Sequence[Point] = (),
    ) -> dict[str, Point]:
        """A place for each spare, so that all together drive little and nobody needs to overtake.

        All places are ``apart_m`` from each other, from the relays and from the obstacles, as far as the refuges allow.

        Args:
            agent: where the agent is.
            relays: base station and relays, from the base station outward. The spares queue up along the geodesics from
                the agent back to the last relay, to the one before, and so on to the base station. Where that is too
                short a way for all, the others stay where they were sent last or, if nowhere, are.
            spares: where the spares are.
            before: where spares were sent last; they stay there if their new place is near it.
            obstacles: where robots stand that nobody can send anywhere.
        """
        taken = [*relays[1:], *obstacles]
        names = list(spares)
        queue = self._queue(agent, relays, taken, len(names))
        chosen = assign(self._geodesics, spares, queue, before)
        waiting = {}
        for name, place in chain(
            zip(chosen, queue, strict=True),
            ((name, before.get(name, spares[name])) for name in names if name not in chosen),
        ):
            settled = name in before and math.dist(before[name], place) < SETTLED_M
            wishes = [before[name], place] if settled else [place]
            waiting[name] = self._clear(wishes, spares[name], taken)
            taken.append(waiting[name])
        return {name: waiting[name] for name in names}

    def _clear(self, wishes: Sequence[Point], here: Point, taken: Sequence[Point]) -> Point:
        """The first wish that is apart from all that is taken, else the refuge nearest to ``here`` that is."""
        for place in chain(wishes, self._nearest_refuges(here)):
            if all(math.dist(place, other) > self.apart_m - ROUNDING_M for other in taken):
                return place
        return here

    def _nearest_refuges(self, here: Point) -> Iterator[Point]:
        yield here
        for index in np.argsort(self._geodesics.lengths(here, self._refuges), kind="stable"):
            yield _point(self._refuges[index])

    def _queue(self, agent: Point, relays: Sequence[Point], taken: Sequence[Point], number: int) -> list[Point]:
        """Places one pitch apart and clear of what is taken: so many, or as many as the way is long enough for."""
        queue: list[Point] = []
        start = agent
        offset = self.pitch_m
        for relay in reversed(relays):
            way = self._geodesics.path(start, self._geodesics.nearest(relay))
            whole = length(way)
            while offset < whole and len(queue) < number:
                place = _point(walk(way, np.array([offset]))[0])
                if all(math.dist(place, other) > self.pitch_m - ROUNDING_M for other in (agent, *taken, *queue)):
                    queue.append(place)
                    offset += self.pitch_m
                else:
                    offset += 0.25 * self.pitch_m
            if len(queue) == number:
                return queue
            offset = max(0.0, offset - whole)
            start = _point(way[-1])
        return queue


def _point(place: Floats) -> Point:
    return float(place[0]), float(place[1])
