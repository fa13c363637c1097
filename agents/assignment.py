"""Who goes to which place. Robots are alike, so nobody needs to overtake anybody."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.deployment import identify_robots
from planning.geodesic import GeodesicMap
from protocol.messages import Point

Floats = NDArray[np.float64]

KEEPING_M2: Final = 0.5
"""So much less, in squared metres, must an exchange cost."""

NEAR_M: Final = 1.0
"""A robot that was sent so near to a place before keeps it for that."""


def assign(
    geodesics: GeodesicMap, robots: Mapping[str, Point], places: Sequence[Point], before: Mapping[str, Point]
) -> list[str]:
    """The robot of each place, such that the squares of their ways add up to the least.

    On one way it is all the same to the sum of the ways who overtakes whom; the squares are least if nobody does.

    Args:
        geodesics: shortest paths of the robots.
        robots: where they are, at least as many as places.
        places: where some are to go.
        before: where they were sent last.

    Complexity: O(k n²) for k robots and n places, and a search for each robot.
    """
    names = list(robots)
    costs = np.zeros((len(names), len(places)))
    for row, name in enumerate(names):
        costs[row] = geodesics.lengths(robots[name], places) ** 2
        if name in before:
            costs[row] -= [KEEPING_M2 * (math.dist(before[name], place) < NEAR_M) for place in places]
    return [names[row] for row in identify_robots(costs)]
