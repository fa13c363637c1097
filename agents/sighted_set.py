"""The set that ranges and the map leave together: who answers is in line of sight of who asks.

A range alone cannot tell the agent from its mirror image behind a wall; the answer can, since the built-in radio, and
what the design asks of a real one, is heard along lines of sight only. So with each range go the pieces of the tight
set that the place of measuring does not see.
"""

from __future__ import annotations

from copy import copy, deepcopy
from functools import lru_cache
from typing import Any, Final

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from estimation.tight_set import TightSet
from planning.environment import Environment
from planning.visible_region import visible_region
from protocol.messages import Point

Floats = NDArray[np.float64]

KEPT_REGIONS: Final = 256
"""Regions in sight that are kept: relays measure from the same place for long, and all peers of a simulation from the
same places."""

ROUNDING_M: Final = 1e-4
"""By this outlines of pieces are widened before they are joined, so that slivers are polygons too."""


class Sight:
    """What can be seen, and where the agent can be; one for all sets on a map.

    Args:
        environment: the walls that block sight.
        room: where the centre of the agent can be.
    """

    def __init__(self, environment: Environment, room: Environment) -> None:
        self.environment = environment
        self.room = room
        self.ground = room.polygon
        """The same as ``room``."""
        self.region = lru_cache(maxsize=KEPT_REGIONS)(self._region)
        """Of a place: all that it sees."""

    def _region(self, place: Point) -> shapely.Polygon:
        region = visible_region(self.environment, place)
        shapely.prepare(region)
        return region


class SightedSet:
    """A tight set of which each range leaves the pieces in sight; with the calls that shared ranges replay.

    Args:
        sight: of the map.
    """

    def __init__(self, sight: Sight) -> None:
        self._sight = sight
        self.tight = TightSet()

    def __deepcopy__(self, memo: dict[int, Any]) -> SightedSet:
        twin = copy(self)
        twin.tight = deepcopy(self.tight, memo)
        return twin

    def measure(self, anchor_xy: ArrayLike, range_m: float, bound_m: float | tuple[float, float], /) -> None:
        """Take a range into account, and that the agent was seen.

        The bound covers how far the agent has moved since the range was measured, so what is farther than that from all
        that the anchor sees is out.
        """
        x, y = np.asarray(anchor_xy, dtype=np.float64).tolist()
        report = self.tight.measure((x, y), range_m, bound_m)
        if not report.accepted:
            return
        pieces = self.tight.polygons
        seen = self._have_seen_corners((x, y), pieces)
        if seen.all():
            return
        slack_m = max(bound_m) if isinstance(bound_m, tuple) else bound_m
        hidden = np.flatnonzero(~seen)
        region = self._sight.region((x, y))
        seen[hidden] = shapely.dwithin(region, outlines([pieces[i] for i in hidden]), slack_m)
        if seen.any() and not seen.all():
            self.tight.keep(seen)

    def predict(self, distance_m: float, /) -> None:
        """The agent may have moved so far; nothing before the first range."""
        self.tight.predict(distance_m)

    def _have_seen_corners(self, anchor: Point, pieces: tuple[Floats, ...]) -> NDArray[np.bool_]:
        """Which pieces have a corner in sight, which is quick to say, and true of most."""
        corners = np.concatenate(pieces)
        begins = np.cumsum([0, *map(len, pieces[:-1])])
        in_sight = np.asarray(self._sight.environment.line_of_sight(anchor, corners))
        return np.asarray(np.logical_or.reduceat(in_sight, begins))


def outlines(pieces: list[Floats]) -> NDArray[np.object_]:
    """(n,) polygons around convex pieces, valid whatever rounding has made of their corners."""
    hulls = shapely.convex_hull(np.array([shapely.MultiPoint(piece) for piece in pieces], dtype=object))
    return np.asarray(shapely.buffer(hulls, ROUNDING_M, quad_segs=1))
