"""Shortest paths in different homotopy classes: to the left of a pillar, to its right, and around the next one.

Two paths with the same ends are in one class if the one can be bent into the other without being lifted over a hole.
From a point inside each hole h a ray runs straight up (towards +y). The *word* of a path is the sequence of rays that
it crosses, h to the right and −h to the left; where a ray is crossed to and fro at once, both are struck out. What is
left is the same for two paths exactly if they are in one class (the rays cut the plane without its holes into a simply
connected piece; crossings are the generators of a free group).

A path that is shortest in its class is taut: its pieces are edges of the tangent visibility graph
(`planning.geodesic`). So a best-first search over pairs of a reflex vertex and a word, with the shortest path of any
class as the bound of what is still to go, reaches the end once for each class, the shortest first.

S. Bhattacharya, M. Likhachev, V. Kumar, Topological constraints in search-based robot path planning, 2012,
doi:10.1007/s10514-012-9304-1; with words instead of their complex integrals, which cannot tell all classes apart.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from typing import Final, TypeAlias

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from planning.environment import Environment
from planning.geodesic import GeodesicMap, reach_corners
from planning.geodesic_table import GeodesicTable

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Word: TypeAlias = tuple[int, ...]

_STRAIGHT: Final = 1e-9
"""A shortest path between two vertices that is longer than the line by less than this share is that line."""


class TautPaths:
    """Shortest paths class by class.

    Args:
        geodesics: of the space where the robot's centre may be.

    Complexity: O(r² + e n) for r reflex vertices, e tangent edges and n holes, besides what the geodesics cost.
    """

    def __init__(self, geodesics: GeodesicMap) -> None:
        self._geodesics = geodesics
        self._rays = _place_rays(geodesics.environment)
        self._corners: Floats = np.ascontiguousarray(geodesics.corners[:, 1])
        lengths = geodesics.corner_lengths
        # A line of sight that is tangent at both ends is itself the shortest path.
        direct = np.hypot(*(self._corners[:, None] - self._corners).transpose(2, 0, 1))
        joined = lengths <= direct * (1.0 + _STRAIGHT)
        np.fill_diagonal(joined, False)
        froms, tos = np.nonzero(joined)
        words = _write_words(self._corners[froms], self._corners[tos], self._rays)
        self._edges: list[list[tuple[int, float, Word]]] = [[] for _ in self._corners]
        for i, j, word in zip(froms.tolist(), tos.tolist(), words, strict=True):
            self._edges[i].append((j, float(direct[i, j]), word))

    def word(self, path: ArrayLike) -> Word:
        """The class of a path (m, 2), metres, m ≥ 1: holes by their number, from 1. O(m n log n)."""
        points = np.asarray(path, dtype=np.float64).reshape(-1, 2)
        word: Word = ()
        for crossed in _write_words(points[:-1], points[1:], self._rays):
            word = _append(word, crossed)
        return word

    def paths(
        self, p: ArrayLike, q: ArrayLike, count: int = 3, *, longest: float = 2.0, effort: int = 4000
    ) -> list[Floats]:
        """The shortest paths of up to ``count`` classes, the shortest first; none that crosses itself.

        Args:
            p: (2,) metres, map frame.
            q: (2,) metres.
            count: of classes, at least 1.
            longest: a path longer than this many times the shortest is left out.
            effort: vertices of the graph to go on from at most, each counted once for each class.

        Returns:
            One or more (m, 2) float arrays, metres, m ≥ 2, from p to q.

        Raises:
            NotInFreeSpace: p or q is no point of the space.

        Complexity: O(s d log s) for s vertices gone on from and d edges at each, besides that of a geodesic.
        """
        start, end = (np.array(point, dtype=np.float64).reshape(2) for point in (p, q))
        shortest = self._geodesics.path(start, end)
        bound = longest * float(np.hypot(*np.diff(shortest, axis=0).T).sum()) + self._geodesics.environment.tolerance_m
        found = [shortest]
        known = {self.word(shortest)}
        for bends in self._search(start, end, bound, effort):
            if len(found) >= count:
                break
            path = _without_repeats(
                np.array([start, *self._corners[bends], end]), self._geodesics.environment.tolerance_m
            )
            word = self.word(path)
            # All around a hole: nobody needs that.
            if word not in known and shapely.LineString(path).is_simple:
                known.add(word)
                found.append(path)
        return found

    def _search(self, start: Floats, end: Floats, bound: float, effort: int) -> Iterator[list[int]]:
        """The bends of the shortest path of each class that has any, in order of length."""
        geodesics, environment = self._geodesics, self._geodesics.environment
        starts, bends, lengths = GeodesicTable(geodesics, [start, end]).legs
        to_go, _ = reach_corners(
            end, geodesics.corners, geodesics.corner_lengths, environment.walls, environment.tolerance_m
        )
        finals = dict(zip(bends[starts[1] :].tolist(), lengths[starts[1] :].tolist(), strict=True))
        last_words = dict(
            zip(
                finals,
                _write_words(self._corners[list(finals)], np.broadcast_to(end, (len(finals), 2)), self._rays),
                strict=True,
            )
        )
        firsts = bends[: starts[1]]
        queue: list[tuple[float, float, int, Word, int]] = []  # bound, covered, vertex (-1: the end), word, came from
        words = _write_words(np.broadcast_to(start, (len(firsts), 2)), self._corners[firsts], self._rays)
        for i, covered, word in zip(firsts.tolist(), lengths[: starts[1]].tolist(), words, strict=True):
            heapq.heappush(queue, (covered + to_go[i], covered, i, word, -1))
        settled: set[tuple[int, Word]] = set()
        trail: list[tuple[int, int]] = []  # vertex, and the entry that it was reached from
        while queue and len(trail) < effort:
            _, covered, i, word, came_from = heapq.heappop(queue)
            if (i, word) in settled:
                continue
            settled.add((i, word))
            if i < 0:
                yield list(reversed([*_trace(trail, came_from)]))
                continue
            trail.append((i, came_from))
            if i in finals and covered + finals[i] <= bound:
                total = covered + finals[i]
                heapq.heappush(queue, (total, total, -1, _append(word, last_words[i]), len(trail) - 1))
            for j, length, crossed in self._edges[i]:
                further = covered + length
                if further + to_go[j] <= bound:
                    onward = _append(word, crossed)
                    if (j, onward) not in settled:
                        heapq.heappush(queue, (further + to_go[j], further, j, onward, len(trail) - 1))


def _trace(trail: list[tuple[int, int]], entry: int) -> Iterator[int]:
    while entry >= 0:
        vertex, entry = trail[entry]
        yield vertex


def _place_rays(environment: Environment) -> Floats:
    """Where the ray of each hole begins: (n, 2)."""
    points = [shapely.Polygon(hole).representative_point().coords[0] for hole in environment.holes]
    return np.array(points, dtype=np.float64).reshape(-1, 2)


def _write_words(froms: Floats, tos: Floats, rays: Floats) -> list[Word]:
    """What segments (n, 2) to (n, 2) cross, in order. A ray has the points exactly above its start at its right."""
    if len(rays) == 0:
        return [()] * len(froms)
    right_before, right_after = froms[:, :1] >= rays[:, 0], tos[:, :1] >= rays[:, 0]
    passes = right_before != right_after
    width = tos[:, :1] - froms[:, :1]
    share = np.divide(rays[:, 0] - froms[:, :1], width, out=np.zeros_like(passes, dtype=np.float64), where=passes)
    crosses = passes & (froms[:, 1:] + share * (tos[:, 1:] - froms[:, 1:]) > rays[:, 1])
    order = np.argsort(rays[:, 0], kind="stable")
    words: list[Word] = [()] * len(froms)
    for n in np.flatnonzero(crosses.any(axis=1)):
        crossed = [int(ray) + 1 for ray in order[crosses[n, order]]]
        words[n] = tuple(crossed) if width[n, 0] > 0.0 else tuple(-ray for ray in reversed(crossed))
    return words


def _append(word: Word, crossed: Word) -> Word:
    """The word of a path and its continuation: where these undo one another nothing is left."""
    n = 0
    while n < min(len(word), len(crossed)) and word[len(word) - 1 - n] == -crossed[n]:
        n += 1
    return word[: len(word) - n] + crossed[n:]


def _without_repeats(path: Floats, tolerance: float) -> Floats:
    """Without bends that are where the point before them is; both ends stay."""
    apart = np.hypot(*np.diff(path, axis=0).T) > tolerance
    kept = np.append(True, apart)
    kept[-1] = True
    if not apart[-1] and kept[:-1].sum() > 1:
        kept[np.flatnonzero(kept[:-1])[-1]] = False
    thinned: Floats = path[kept]
    return thinned
