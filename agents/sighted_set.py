"""The set that ranges and the map leave together: who answers is in line of sight of who asks.

A range alone cannot tell the agent from its mirror image behind a wall; the answer can, since the built-in radio, and
what the design asks of a real one, is heard along lines of sight only. So with each range go the pieces of the tight
set that the place of measuring does not see.
"""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from agents.target_set import describe
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

KEPT_STEPS: Final = 256
"""Steps from one set to the next that are kept: the peers of a simulation replay the same ranges one after another."""

KEPT_SKETCHES: Final = 8
"""Of the sets that have been looked at last: peers of a simulation look at the same one."""


@dataclass(frozen=True, slots=True)
class Move:
    """The agent may have moved so far, metres."""

    distance_m: float


@dataclass(frozen=True, slots=True)
class Seen:
    """A range from a place in the agent's sight, and by how much it may be too long and too short, metres."""

    anchor: Point
    range_m: float
    bound_m: tuple[float, float]


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
        self.nothing = TightSet()
        """What is known before the first range."""
        self.region = lru_cache(maxsize=KEPT_REGIONS)(self._region)
        """Of a place: all that it sees."""
        self.step = lru_cache(maxsize=KEPT_STEPS)(self._step)
        """The set after a step from another, as :meth:`_step` makes it."""
        self.left = lru_cache(maxsize=KEPT_SKETCHES)(self._left)
        """Of a set: all places in free space that it leaves; never empty."""
        self.sketch = lru_cache(maxsize=KEPT_SKETCHES)(lambda held: describe(self.left(held)))
        """Of a set: what planning and pictures need of these."""

    def _region(self, place: Point) -> shapely.Polygon:
        region = visible_region(self.environment, place)
        shapely.prepare(region)
        return region

    def _left(self, held: TightSet) -> shapely.Geometry:
        pieces = outlines(list(held.polygons))
        region = shapely.union_all(shapely.intersection(pieces, self.ground))
        if region.is_empty:
            # Somebody's ranges are wrong. What is left to say is where they point.
            region = shapely.Point(shapely.get_coordinates(shapely.shortest_line(self.ground, pieces[0]))[0])
        shapely.prepare(region)
        return region

    def _step(self, before: TightSet, step: Move | Seen) -> TightSet:
        """The set after a step. Nobody changes a set that has been made, so that many can go on from it."""
        after = deepcopy(before)
        match step:
            case Move(distance_m):
                after.predict(distance_m)
            case Seen(anchor, range_m, bound_m):
                if after.measure(anchor, range_m, bound_m).accepted:
                    self._drop_hidden(after, anchor, max(bound_m))
        return after

    def _drop_hidden(self, held: TightSet, anchor: Point, slack_m: float) -> None:
        """Drop the pieces farther than this from all that the anchor sees."""
        pieces = held.polygons
        kept = self._have_seen_corners(anchor, pieces)
        if kept.all():
            return
        hidden = np.flatnonzero(~kept)
        kept[hidden] = shapely.dwithin(self.region(anchor), outlines([pieces[i] for i in hidden]), slack_m)
        if kept.any() and not kept.all():
            held.keep(kept)

    def _have_seen_corners(self, anchor: Point, pieces: tuple[Floats, ...]) -> NDArray[np.bool_]:
        """Which pieces have a corner in sight, which is quick to say, and true of most."""
        corners = np.concatenate(pieces)
        begins = np.cumsum([0, *map(len, pieces[:-1])])
        in_sight = np.asarray(self.environment.line_of_sight(anchor, corners))
        return np.asarray(np.logical_or.reduceat(in_sight, begins))


class SightedSet:
    """A tight set of which each range leaves the pieces in sight; with the calls that shared ranges replay.

    Args:
        sight: of the map.
        tight: to go on from; to be changed by nobody from then on.
    """

    def __init__(self, sight: Sight, tight: TightSet | None = None) -> None:
        self._sight = sight
        self.tight = tight or sight.nothing
        """What is left; to be read."""

    def __deepcopy__(self, memo: object) -> SightedSet:
        return SightedSet(self._sight, self.tight)

    def measure(self, anchor_xy: ArrayLike, range_m: float, bound_m: float | tuple[float, float], /) -> None:
        """Take a range into account, and that the agent was seen.

        The bound covers how far the agent has moved since the range was measured, so what is farther than that from all
        that the anchor sees is out.
        """
        x, y = np.asarray(anchor_xy, dtype=np.float64).tolist()
        below_m, above_m = bound_m if isinstance(bound_m, tuple) else (bound_m, bound_m)
        self.tight = self._sight.step(self.tight, Seen((x, y), range_m, (below_m, above_m)))

    def predict(self, distance_m: float, /) -> None:
        """The agent may have moved so far; nothing before the first range."""
        if self.tight.started and distance_m > 0.0:
            self.tight = self._sight.step(self.tight, Move(distance_m))


def outlines(pieces: list[Floats]) -> NDArray[np.object_]:
    """(n,) polygons around convex pieces, valid whatever rounding has made of their corners."""
    hulls = shapely.convex_hull(np.array([shapely.MultiPoint(piece) for piece in pieces], dtype=object))
    return np.asarray(shapely.buffer(hulls, ROUNDING_M, quad_segs=1))


def rehearse(sight: Sight, places: list[Point], target: Point) -> None:
    """Go once through all that estimating takes, with ranges from some places: what it loads is there from then on."""
    held = SightedSet(sight)
    for place in places * 3:
        held.measure(place, math.dist(place, target), 0.2)
        held.predict(0.05)
    sight.sketch(held.tight)
