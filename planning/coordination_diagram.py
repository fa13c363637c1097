"""The coordination diagram of a team: boxes as cylinders, the grid of their limits, and where one can go from a point.

A place of k robots on their paths is a point (s_1, …, s_k), metres of path. What two robots do is true wherever the
others are, so the boxes of each pair are cylinders in the diagram of all (thesis §4.3.2). Along each path the limits of
all boxes, its start and its end are the interesting places (§4.3.3). They cut it into *elements*: limit 0, the open
piece after it, limit 1, …; element 2 a is limit a, element 2 a + 1 the piece that follows. What a pair may do is a
table over the elements of the one and of the other.

The inside of a box is forbidden and its edge is not: discs that touch do not overlap. But two boxes that share an edge
leave no way between them, and a box at the border of the diagram reaches over it. So an element is blocked if all
pieces that it borders are. This is the rule of figure 67, corrected: there a direction that is tangent to two boxes is
blocked, which it is only if they lie on different sides of it, or one lies at the border.

Sight is a table of the same form. Links that are required block what does not see each other; members that are to be
joined by any links are judged for all together. Where two pieces see each other throughout, so do their ends; hence
whatever a piece allows its limits allow, and whoever may pass through a piece may stop at its ends.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.coordination import collision_boxes
from planning.motion_plan import read_points

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Pair = tuple[int, int]

_OVERLAP: Final = 1e-9
"""Of the separation: by so much discs may overlap, for touching is no collision, and boxes are never too small."""

_MERGED: Final = 1e-11
"""Of the longest path: limits that are nearer to each other than this are one. The limits of the two boxes at a bend
are the same but for rounding, which must not leave a way between them."""


class Trouble(NamedTuple):
    """Why robots must not be where they are."""

    between: Pair
    kind: Literal["collision", "link", "network"]
    """They could collide; they lose a link that is required; they are joined by no links at all."""


@dataclass(frozen=True, eq=False)
class CoordinationDiagram:
    """Where on their paths k robots may be together.

    Made by :meth:`of`; :meth:`with_sight` adds what must be seen.
    """

    paths: tuple[Floats, ...]
    """Each (m, 2) float, metres, map frame."""
    limits_m: tuple[Floats, ...]
    """Each (n,) float, metres of path, rising from 0 to its length; only 0 for a robot that has nowhere to go, or that
    may be anywhere on its path."""
    collides: Mapping[Pair, Bools]
    """For each pair i < j on which of their elements they could collide: (2 n_i − 1, 2 n_j − 1)."""
    seen: Mapping[Pair, Bools]
    """Which elements see each other throughout, of the same form; of the pairs that are asked for."""
    links: frozenset[Pair]
    """Pairs i < j that must see each other at all times."""
    joined: tuple[int, ...]
    """Who must be in one network at all times, over any others; none, or at least two."""

    @classmethod
    def of(
        cls,
        paths: Sequence[ArrayLike],
        radii_m: ArrayLike,
        *,
        cuts_m: Sequence[ArrayLike] | None = None,
        anywhere: Collection[int] = (),
    ) -> CoordinationDiagram:
        """The diagram of collisions alone.

        Args:
            paths: k arrays (m, 2), metres, map frame; a single point is a robot that stands.
            radii_m: (k,) float, of the discs; a robot of radius 0 has no body and is in nobody's way.
            cuts_m: for each path more places that are to be limits, metres of path. Boxes are of the pieces between
                them and so are smaller.
            anywhere: robots that may be anywhere on their path at any time; two of those are not judged.

        Complexity: O(k² m²) for the boxes, and the size of the tables.
        """
        points = tuple(read_points(path) for path in paths)
        radii = np.asarray(radii_m, dtype=np.float64)
        cuts = [np.asarray(at, dtype=np.float64) for at in cuts_m or [()] * len(points)]
        cut = [_insert(path, at) for path, at in zip(points, cuts, strict=True)]
        boxes = {
            (i, j): collision_boxes(cut[i], cut[j], (radii[i] + radii[j]) * (1.0 - _OVERLAP))[0]
            for i, j in combinations(range(len(points)), 2)
            if min(radii[i], radii[j]) > 0.0 and not (i in anywhere and j in anywhere)
        }
        places = [[at] for at in cuts]
        for (i, j), found in boxes.items():
            places[i].append(found[:, :2].ravel())
            places[j].append(found[:, 2:].ravel())
        lengths = [float(measure_path(path)[-1]) for path in points]
        nearest = _MERGED * max(lengths, default=0.0)
        limits = tuple(
            np.zeros(1) if i in anywhere else _merge(np.concatenate(mine), length, nearest)
            for i, (mine, length) in enumerate(zip(places, lengths, strict=True))
        )
        collides = {
            (i, j): spread_pieces(
                _cover(limits[i], limits[j], boxes.get((i, j), np.empty((0, 4)))), len(limits[i]), len(limits[j])
            )
            for i, j in combinations(range(len(points)), 2)
        }
        return cls(points, limits, collides, {}, frozenset(), ())

    def with_sight(
        self, seen: Mapping[Pair, Bools], links: Collection[Pair] = (), joined: Collection[int] = ()
    ) -> CoordinationDiagram:
        """The same with what must be seen.

        Args:
            seen: for each pair i < j which elements see each other throughout: (2 n_i − 1, 2 n_j − 1) bool; of all
                pairs if any are joined, else of the links.
            links: pairs i < j that must see each other throughout.
            joined: who must be in one network, over any others.
        """
        return replace(self, seen=seen, links=frozenset(links), joined=tuple(sorted(joined)) if len(joined) > 1 else ())

    @cached_property
    def blocked(self) -> Mapping[Pair, Bools]:
        """On which of their elements each pair must not be together: they could collide, or lose a required link."""
        return {
            pair: table | ~self.seen[pair] if pair in self.links else table for pair, table in self.collides.items()
        }

    def __len__(self) -> int:
        return len(self.paths)

    def places(self, robot: int, covered_m: ArrayLike) -> Floats:
        """Where a robot is when it has covered so many metres of its path (n,): (n, 2) float, metres, map frame."""
        return place_on_path(self.paths[robot], np.asarray(covered_m, dtype=np.float64))

    def find_elements(self, point_m: ArrayLike) -> Ints:
        """The element that each robot is in at a point (k,) of the diagram, metres of path: (k,) int."""
        point = np.asarray(point_m, dtype=np.float64)
        found = np.empty(len(self), dtype=np.int64)
        for robot, (limits, at) in enumerate(zip(self.limits_m, point, strict=True)):
            after = int(np.searchsorted(limits, at))
            found[robot] = 2 * after if after < len(limits) and limits[after] == at else 2 * after - 1
        return found

    def find_trouble(self, elements: ArrayLike) -> Trouble | None:
        """What is wrong if each robot is in its element (k,); None if nothing is. O(k²)."""
        at = [int(element) for element in np.asarray(elements)]
        for (i, j), table in self.blocked.items():
            if table[at[i], at[j]]:
                return Trouble((i, j), "collision" if self.collides[i, j][at[i], at[j]] else "link")
        part = list(range(len(self)))
        for (i, j), table in self.seen.items():
            if table[at[i], at[j]]:
                part = [part[i] if other == part[j] else other for other in part]
        parted = (robot for robot in self.joined if part[robot] != part[self.joined[0]])
        return next((Trouble((self.joined[0], robot), "network") for robot in parted), None)

    def free_directions(self, point_m: ArrayLike) -> tuple[Bools, Bools]:
        """Which robots can go on from a point of the diagram, and which can go back, if all others stand.

        Args:
            point_m: (k,) float, metres of path; allowed itself.

        Returns:
            forward, backward: (k,) bool each, the two vectors of thesis §4.3.3.

        Complexity: O(k³) for k robots.
        """
        elements = self.find_elements(point_m)
        free = np.zeros((2, len(self)), dtype=np.bool_)
        for robot, limits in enumerate(self.limits_m):
            for way, step in enumerate((1, -1)):
                moved = elements.copy()
                # In the middle of a piece both directions lead through that piece.
                moved[robot] += step if elements[robot] % 2 == 0 else 0
                inside = 0 <= moved[robot] <= 2 * len(limits) - 2
                free[way, robot] = inside and self.find_trouble(moved) is None
        return free[0], free[1]


def measure_path(path: Floats) -> Floats:
    """Metres of path covered at each point (m, 2) of a path: (m,) float."""
    return np.append(0.0, np.cumsum(np.hypot(*np.diff(path, axis=0).T)))


def place_on_path(path: Floats, covered_m: Floats) -> Floats:
    """Where so many metres (n,) of a path (m, 2) are covered: (n, 2) float, metres, map frame."""
    covered = measure_path(path)
    return np.stack([np.interp(covered_m, covered, path[:, axis]) for axis in (0, 1)], axis=-1)


def spread_pieces(blocked: Bools, limits_i: int, limits_j: int) -> Bools:
    """A table over pieces as one over elements: blocked where all pieces are that an element borders.

    Args:
        blocked: (n_i − 1, n_j − 1) bool; a robot of one limit has one piece here, and one element.
        limits_i: n_i, how many limits robot i has.
        limits_j: n_j.

    Returns:
        (2 n_i − 1, 2 n_j − 1) bool.
    """
    (before_i, after_i), (before_j, after_j) = _border(limits_i), _border(limits_j)
    rows = blocked[before_i] & blocked[after_i]
    spread: Bools = rows[:, before_j] & rows[:, after_j]
    return spread


def _insert(path: Floats, cuts: Floats) -> Floats:
    """A path (m, 2) with more points on it."""
    cuts = np.sort(cuts)
    after = np.searchsorted(measure_path(path), cuts)
    inner = (after > 0) & (after < len(path))
    return np.insert(path, after[inner], place_on_path(path, cuts[inner]), axis=0)


def _merge(places: Floats, length: float, nearest: float) -> Floats:
    """Limits on a path: its ends, and of the other places those that are not near an end or each other."""
    if length <= nearest:
        return np.zeros(1)
    inner = np.sort(places[(places > nearest) & (places < length - nearest)])
    return np.concatenate([[0.0], inner[np.diff(inner, prepend=0.0) > nearest], [length]])


def _cover(limits_i: Floats, limits_j: Floats, boxes: Floats) -> Bools:
    """Which pieces of i exclude which of j: covered by a box (b, 4). A robot without pieces has one."""
    covered = np.zeros((max(len(limits_i) - 1, 1), max(len(limits_j) - 1, 1)), dtype=np.bool_)
    spans = []
    for limits, sides in ((limits_i, boxes[:, :2]), (limits_j, boxes[:, 2:])):
        # The nearest limit is the one that the side was merged into.
        span = np.searchsorted(0.5 * (limits[1:] + limits[:-1]), sides)
        spans.append(span if len(limits) > 1 else np.broadcast_to([0, 1], sides.shape))
    for (first_i, last_i), (first_j, last_j) in zip(*spans, strict=True):
        covered[first_i:last_i, first_j:last_j] = True
    return covered


def _border(limits: int) -> tuple[Ints, Ints]:
    """The piece before and the one after each element of a path with so many limits; at the ends they are the same."""
    element = np.arange(2 * limits - 1)
    return np.maximum((element - 1) // 2, 0), np.minimum(element // 2, max(limits - 2, 0))
