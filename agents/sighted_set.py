"""The set that ranges and the map leave together: who answers is in sight of who asks, and nobody walks through walls.

A range alone cannot tell the agent from its mirror image behind a wall; the answer can, since the built-in radio, and
what the design asks of a real one, is heard along lines of sight only. So with each range go the pieces of the tight
set that the place of measuring does not see; and those that the agent cannot have walked to since the range before.

What is left in the end is a region of free space: what the last range left in sight, widened by what the agent can have
walked since, around walls. A tight set alone would be widened through them, and an agent that nobody has measured for
ten seconds would seem to be in any room.
"""

from __future__ import annotations

import math
from copy import copy, deepcopy
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from agents.target_set import TargetSet, describe
from agents.walkable_ground import WalkableGround, outlines, widened
from estimation.tight_set import TightSet
from planning.environment import Environment
from planning.visible_region import visible_region
from protocol.messages import Point

Floats = NDArray[np.float64]

KEPT_REGIONS: Final = 256
"""Regions in sight that are kept: relays measure from the same place for long, and all peers of a simulation from the
same places."""

KEPT_STEPS: Final = 256
"""Steps from one set to the next that are kept: the peers of a simulation replay the same ranges one after another."""

KEPT_WALKS: Final = 128
"""Regions that are kept: a walk is continued, and peers of a simulation look at the same set."""

STRIDE_M: Final = 0.5
"""A walk is followed in steps of this length: less than would seem to lead through walls."""

LONG_WALK_M: Final = 60.0
"""After a longer one the region is that of the tight set: walls hardly matter any more."""


@dataclass(frozen=True, slots=True)
class Sighting:
    """What the last range has left. Nobody changes a tight set that has been made, so that it can stand for itself."""

    held: TightSet
    anchor: Point
    """Where it was measured: the agent was in sight of it,"""
    slack_m: float
    """or has gone away so far since."""


@dataclass(frozen=True, slots=True)
class Move:
    """The agent may have moved so far, metres."""

    distance_m: float


@dataclass(frozen=True, slots=True)
class Seen:
    """A range from a place in the agent's sight."""

    anchor: Point
    range_m: float
    bound_m: tuple[float, float]
    """By how much it may be too long and too short."""
    walk: tuple[Sighting, float] | None
    """What it has walked from, and how far at most, if that says more than the set before."""


class Sight:
    """What can be seen, and where the agent can be; one for all sets on a map, which share what they compute.

    Args:
        environment: the walls that block sight.
        room: where the centre of the agent can be.
    """

    def __init__(self, environment: Environment, room: Environment) -> None:
        self.environment = environment
        self.room = room
        self.ground = WalkableGround(room)
        self.nothing = TightSet()
        """What is known before the first range."""
        self.region = lru_cache(maxsize=KEPT_REGIONS)(self._region)
        """Of a place: all that it sees."""
        self.step = lru_cache(maxsize=KEPT_STEPS)(self._step)
        """The set after a step from another."""
        self.clip = lru_cache(maxsize=KEPT_WALKS)(lambda held: self.ground.clip(held.polygons))
        """Of a tight set: what of it is in free space."""
        self._strides = lru_cache(maxsize=KEPT_WALKS)(self._follow)
        self.walk = lru_cache(maxsize=KEPT_WALKS)(self._walk)
        """Of a sighting and a length: where one can be who was there, and has walked at most so far since."""
        self.sketch = lru_cache(maxsize=KEPT_WALKS)(self._sketch)
        """Of the same, or a tight set: what planning and pictures need of it."""

    def _region(self, place: Point) -> shapely.Polygon:
        region = visible_region(self.environment, place)
        shapely.prepare(region)
        return region

    def _walk(self, seen: Sighting, distance_m: float) -> shapely.Geometry:
        strides = int(distance_m / STRIDE_M)
        region, rest_m = self._strides(seen, strides), distance_m - strides * STRIDE_M
        return self.ground.walked(region, rest_m) if rest_m > 0.0 else region

    def _follow(self, seen: Sighting, strides: int) -> shapely.Geometry:
        if strides:
            return self.ground.walked(self._strides(seen, strides - 1), STRIDE_M)
        region = self.clip(seen.held)
        in_sight = shapely.intersection(region, widened(self.region(seen.anchor), seen.slack_m))
        return region if in_sight.is_empty else in_sight

    def _sketch(self, what: TightSet | tuple[Sighting, float]) -> TargetSet:
        return describe(self.clip(what) if isinstance(what, TightSet) else self.walk(*what))

    def _step(self, before: TightSet, step: Move | Seen) -> TightSet:
        after = deepcopy(before)
        match step:
            case Move(distance_m):
                after.predict(distance_m)
            case Seen(anchor, range_m, bound_m, walk):
                if after.measure(anchor, range_m, bound_m).accepted:
                    slack_m = max(bound_m)
                    pieces = after.polygons
                    kept = self._are_in_sight(anchor, pieces, slack_m)
                    if walk is not None:
                        kept &= shapely.dwithin(self.walk(*walk), outlines(pieces), slack_m)
                    if kept.any() and not kept.all():
                        after.keep(kept)
        return after

    def _are_in_sight(self, anchor: Point, pieces: tuple[Floats, ...], slack_m: float) -> NDArray[np.bool_]:
        """Which pieces are no farther than this from all that the anchor sees."""
        corners = np.concatenate(pieces)
        begins = np.cumsum([0, *map(len, pieces[:-1])])
        in_sight = np.asarray(self.environment.line_of_sight(anchor, corners))
        near = np.asarray(np.logical_or.reduceat(in_sight, begins))
        if not near.all():  # a corner in sight is quick to find, and most pieces have one
            hidden = np.flatnonzero(~near)
            near[hidden] = shapely.dwithin(self.region(anchor), outlines([pieces[i] for i in hidden]), slack_m)
        return near


class SightedSet:
    """A tight set of which each range leaves the pieces in sight; with the calls that shared ranges replay.

    Args:
        sight: of the map.
        tight: to go on from; to be changed by nobody from then on.
        seen: what the last range has left of it, if it did not contradict it.
    """

    def __init__(self, sight: Sight, tight: TightSet | None = None, seen: Sighting | None = None) -> None:
        self._sight = sight
        self.tight = tight or sight.nothing
        """What ranges leave, without regard to walls; to be read."""
        self.seen = seen
        """What the last range has left; None before the first one, and after one that contradicts the set."""
        self._walked_m = 0.0

    def __deepcopy__(self, memo: object) -> SightedSet:
        return copy(self)  # what it holds is replaced, never changed

    def measure(self, anchor_xy: ArrayLike, range_m: float, bound_m: float | tuple[float, float], /) -> None:
        """Take a range into account, and that the agent was seen.

        The bound covers how far the agent has moved since the range was measured, so what is farther than that from all
        that the anchor sees is out.
        """
        x, y = np.asarray(anchor_xy, dtype=np.float64).tolist()
        bounds_m = bound_m if isinstance(bound_m, tuple) else (bound_m, bound_m)
        walk = self._walk
        step = Seen((x, y), range_m, bounds_m, walk if walk is not None and self._walked_m >= STRIDE_M else None)
        self.tight = self._sight.step(self.tight, step)
        accepted = self.tight.started and self.tight.rejections == 0
        self.seen = Sighting(self.tight, (x, y), max(bounds_m)) if accepted else None
        self._walked_m = 0.0

    def predict(self, distance_m: float, /) -> None:
        """The agent may have moved so far; nothing before the first range."""
        if self.tight.started and distance_m > 0.0:
            self.tight = self._sight.step(self.tight, Move(distance_m))
            self._walked_m += distance_m

    @property
    def region(self) -> shapely.Geometry | None:
        """All places of the agent's centre that are left; None before the first range."""
        if not self.tight.started:
            return None
        walk = self._walk
        return self._sight.clip(self.tight) if walk is None else self._sight.walk(*walk)

    @property
    def sketch(self) -> TargetSet | None:
        """What planning and pictures need of the region, at no time yet; None before the first range."""
        return self._sight.sketch(self._walk or self.tight) if self.tight.started else None

    @property
    def _walk(self) -> tuple[Sighting, float] | None:
        if self.seen is None or self._walked_m > LONG_WALK_M:
            return None
        return self.seen, self._walked_m


def rehearse(sight: Sight, places: list[Point], target: Point) -> None:
    """Go once through all that estimating takes, with ranges from some places: what it loads is there from then on."""
    held = SightedSet(sight)
    for place in places * 3:
        held.measure(place, math.dist(place, target), 0.2)
        held.predict(0.05)
    assert held.sketch is not None
