"""Goals of an agent that explores: somewhere in its sight, or just around a corner that it sees (Thesis §4.4.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planning.environment import Environment
from protocol.messages import Point

AROUND_CORNER_M = (0.5, 3.0)
"""How far from the corner a goal around it lies."""

NEAREST_GOAL_M = 0.5
"""Goals nearer than this are no exploration."""

_DRAWS = 64
_TRIES = 64


class Wanderer:
    """Draws goals; equal seeds and equal positions give equal goals.

    Args:
        free: where the agent's centre can be; its reflex vertices are the corners.
        seed: of all draws.
        around_corner_share: share of the goals that lie around a corner, as far as there is one in sight.
    """

    def __init__(self, free: Environment, seed: int, around_corner_share: float) -> None:
        self._free = free
        self._chance = np.random.default_rng(seed)
        self._around_corner_share = around_corner_share

    def choose(self, position: Point) -> Point | None:
        """The next goal for an agent that stands here; None if none was found."""
        goal = None
        if self._chance.random() < self._around_corner_share:
            goal = self._around_a_corner(position)
        if goal is None:
            goal = self._in_sight(position)
        return goal

    def _around_a_corner(self, position: Point) -> Point | None:
        """A place that some corner in sight sees and the position does not: a random place by a random corner."""
        corners = self._free.reflex_vertices
        if len(corners) == 0:
            return None
        here = np.asarray(position, dtype=np.float64)
        for index in self._chance.permutation(np.flatnonzero(self._free.line_of_sight(here, corners))):
            corner = corners[index]
            angle = self._chance.uniform(0.0, 2.0 * np.pi, _DRAWS)
            distance = self._chance.uniform(*AROUND_CORNER_M, _DRAWS)
            places = corner + distance[:, None] * np.column_stack((np.cos(angle), np.sin(angle)))
            goal = self._first(places, self._free.line_of_sight(corner, places), here, hidden=True)
            if goal is not None:
                return goal
        return None

    def _in_sight(self, position: Point) -> Point | None:
        """A place that the position sees, uniformly by area as far as the draws suffice."""
        here = np.asarray(position, dtype=np.float64)
        west, south, east, north = self._free.bounds
        for _ in range(_TRIES):
            places = self._chance.uniform((west, south), (east, north), (_DRAWS, 2))
            goal = self._first(places, self._free.contains(places), here, hidden=False)
            if goal is not None:
                return goal
        return None

    def _first(
        self, places: NDArray[np.float64], fit: NDArray[np.bool_], here: NDArray[np.float64], *, hidden: bool
    ) -> Point | None:
        """First fit place, far enough from here, that is hidden from here or not, as wanted."""
        fit = fit & (np.hypot(*(places - here).T) >= NEAREST_GOAL_M)
        fit &= self._free.line_of_sight(here, places) != hidden
        chosen = np.flatnonzero(fit)
        return None if len(chosen) == 0 else (float(places[chosen[0], 0]), float(places[chosen[0], 1]))
