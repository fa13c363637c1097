"""Where robots wait that are no relays: behind the agent, where the next relay will be wanted."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.foresight import length, walk
from planning.geodesic import GeodesicMap
from protocol.messages import Point

STAND_OFF_M: Final = 0.4
"""Free distance between discs that wait."""

ROUNDING_M: Final = 1e-6

SETTLED_M: Final = 0.3
"""A place is not exchanged for one so near."""


class Waiting:
    """Waiting places for the spares of a team.

    Args:
        geodesics: shortest paths in the free space of the robots' centres.
        robot_radius_m: of their discs.
    """

    def __init__(self, geodesics: GeodesicMap, robot_radius_m: float) -> None:
        self._geodesics = geodesics
        self.pitch_m = 2 * robot_radius_m + STAND_OFF_M
        """Distance between one waiting robot and the next, and between the first and the agent."""

    def places(
        self, agent: Point, chain: Sequence[Point], spares: Mapping[str, Point], before: Mapping[str, Point]
    ) -> dict[str, Point]:
        """A place for each spare, the robot nearest to the agent nearest to it.

        Args:
            agent: where the agent is.
            chain: base station and relays, from the base station outward. The spares queue up along the geodesics from
                the agent back to the last relay, to the one before, and so on to the base station. Where that is too
                short a way for all, the farthest stay where they were sent last or, if nowhere, are.
            spares: where the spares are.
            before: where spares were sent last; they stay there if their new place is near it.
        """
        if not spares:
            return {}
        names = list(spares)
        lengths = self._geodesics.lengths(agent, [spares[name] for name in names])
        queue = self._queue(agent, chain, len(names))
        waiting = {name: before.get(name, spares[name]) for name in names}
        for place, index in zip(queue, np.argsort(lengths, kind="stable"), strict=False):
            name = names[index]
            if name not in before or math.dist(before[name], place) >= SETTLED_M:
                waiting[name] = place
        return waiting

    def _queue(self, agent: Point, chain: Sequence[Point], number: int) -> list[Point]:
        """Places one pitch apart and clear of the relays: so many, or as many as the way is long enough for."""
        queue: list[Point] = []
        start = agent
        offset = self.pitch_m
        for relay in reversed(chain):
            way = self._geodesics.path(start, self._geodesics.nearest(relay))
            whole = length(way)
            while offset < whole and len(queue) < number:
                place = _point(walk(way, np.array([offset]))[0])
                if all(math.dist(place, other) > self.pitch_m - ROUNDING_M for other in (agent, *chain[1:], *queue)):
                    queue.append(place)
                    offset += self.pitch_m
                else:
                    offset += 0.25 * self.pitch_m
            if len(queue) == number:
                return queue
            offset = max(0.0, offset - whole)
            start = _point(way[-1])
        return queue


def _point(place: NDArray[np.float64]) -> Point:
    return float(place[0]), float(place[1])
