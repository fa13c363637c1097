"""Paths through cells that touch: which cells to cross, one after the other, from one cell to another.

Thesis §4.2.2. The adjacency graph joins cells that share a piece of border; an edge is as long as the way between the
centroids of its cells, and a shortest path in it is a sequence of cells. A penalty on every edge makes paths smoother:
of fewer jumps from cell to cell. Adjacent cells see each other wholly (theorem 3.2.1), so whoever moves along such a
sequence while the others keep their cells changes sight relations only at the borders.

As a line, a path leads from stop to stop, through the middle of each border on the way: a cell is convex, so that line
stays in the cells of the sequence, which the straight line between two centroids need not do.

A disc does not reach every centroid and does not fit through every border. In the free space of its centre, a stop is
the point of the cell nearest to its centroid, the passage the middle of what is free of the border, and the ways
between them geodesics, which leave a cell only where a wall is to be rounded.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from planning.decomposition import Cells
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from planning.placement import reachable_positions
from planning.shortest_paths import NO_PREDECESSOR, NoPath, path

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class AdjacencyPath:
    """A sequence of cells, each adjacent to the next, and a way through them."""

    cells: tuple[int, ...]
    """From the first to the last, both included."""
    points: Floats
    """(m, 2) float, metres, map frame: from the stop of the first cell to that of the last."""
    length_m: float
    """The sum of the distances between stops of successive cells (thesis §3.4.1); the way itself may be longer."""


class AdjacencyPaths:
    """Shortest paths in the adjacency graph of visibility cells.

    Args:
        cells: the cells.
        free: the environment inflated by a robot's radius, the part that robots are in. None: robots are points.
        jump_penalty_m: metres, at least 0, that a path may be longer for one jump less.

    Raises:
        ValueError: the penalty is negative or not finite.

    Complexity: O(C log C) for C corners of cells; with ``free`` one intersection for each border, too.
    """

    def __init__(self, cells: Cells, free: Environment | None = None, jump_penalty_m: float = 0.0) -> None:
        if not 0.0 <= jump_penalty_m < np.inf:
            raise ValueError(f"the penalty of a jump is at least 0 m and finite, not {jump_penalty_m}")
        self.stops: Floats = cells.centroids if free is None else reachable_positions(cells, free)
        """(N, 2) float, metres, map frame: where robots stop in each cell; NaN where they cannot be."""
        self.cells = cells
        self._penalty_m = jump_penalty_m
        self._geodesics = None if free is None else GeodesicMap(free)
        pairs, borders = _find_borders(cells)
        passages = borders.mean(axis=1) if free is None else _pass_borders(borders, free)
        usable = np.isfinite(passages[:, 0]) & np.isfinite(self.stops[pairs]).all(axis=(1, 2))
        self._pairs: Ints = pairs[usable]
        self._passages: Floats = passages[usable]
        spans = np.hypot(*(self.stops[self._pairs[:, 0]] - self.stops[self._pairs[:, 1]]).T)
        self._graph = csr_array((spans + jump_penalty_m, self._pairs.T), shape=(len(cells), len(cells)))

    def lengths_from(self, cell: int) -> Floats:
        """Lengths of the paths from one cell to all cells, metres: (N,), inf where none leads. O(N log N).

        Raises:
            ValueError: the cell does not exist.
        """
        self._check(cell)
        lengths: Floats = self._measure(np.array([cell]))[0]
        return lengths

    @cached_property
    def lengths(self) -> Floats:
        """(N, N) float, metres: lengths of the paths between all cells, inf where there is none.

        Complexity: O(N² log N), and memory for a few such arrays; above some thousand cells take single rows.
        """
        return self._measure(np.arange(len(self.cells)))

    def path(self, start: int, goal: int) -> AdjacencyPath:
        """The path from one cell to another.

        Raises:
            NoPath: none leads there.
            ValueError: one of the cells does not exist.

        Complexity: O(N log N); two geodesics for each jump where robots are discs.
        """
        self._check(start, goal)
        if np.isnan(self.stops[start, 0]):
            raise NoPath(f"no path starts in cell {start}: a robot cannot be there")
        _, before = dijkstra(self._graph, directed=False, indices=np.array([start]), return_predecessors=True)
        cells = path(np.where(before[0] < 0, NO_PREDECESSOR, before[0]), start, goal)
        points = np.empty((2 * len(cells) - 1, 2))
        points[::2] = self.stops[cells]
        points[1::2] = self._passages[[self._find(*hop) for hop in pairwise(cells)]]
        length = float(np.hypot(*np.diff(points[::2], axis=0).T).sum())
        if self._geodesics is not None:
            ways = [self._geodesics.path(*leg) for leg in pairwise(points)]
            points = np.concatenate([points[:1], *(way[1:] for way in ways)])
        return AdjacencyPath(tuple(cells), points, length)

    def _measure(self, sources: Ints) -> Floats:
        """Lengths of the cheapest paths from these cells, without penalties: (s, N)."""
        costs, before = dijkstra(self._graph, directed=False, indices=sources, return_predecessors=True)
        costs[:, np.isnan(self.stops[:, 0])] = np.inf
        if self._penalty_m > 0.0:
            costs -= self._penalty_m * _count_jumps(before.astype(np.int64))
        return np.asarray(costs)

    def _find(self, u: int, v: int) -> int:
        """Where in the pairs, which are sorted, that of two adjacent cells stands."""
        first, last = np.searchsorted(self._pairs[:, 0], [min(u, v), min(u, v) + 1])
        return int(first + np.searchsorted(self._pairs[first:last, 1], max(u, v)))

    def _check(self, *cells: int) -> None:
        for cell in cells:
            if not 0 <= cell < len(self.cells):
                raise ValueError(
                    f"cell {cell} does not exist: there are {len(self.cells)}, and -1 means outside the map"
                )


def _find_borders(cells: Cells) -> tuple[Ints, Floats]:
    """Pairs of adjacent cells (b, 2), each once, lower cell first, sorted; and their borders (b, 2, 2), metres.

    Corners are shared exactly, and every vertex on a cell's border is one of its corners, so the border of two cells is
    an edge of the one and the same edge, the other way round, of the other.
    """
    _, corner = np.unique(cells.unit_corners, axis=0, return_inverse=True)
    after = np.arange(1, len(corner) + 1)
    after[cells.starts[1:] - 1] = cells.starts[:-1]
    owner = np.repeat(np.arange(len(cells)), np.diff(cells.starts))
    edges = corner * len(corner) + corner[after]
    reversed_edges = corner[after] * len(corner) + corner
    order = np.argsort(edges)
    other = order[np.searchsorted(edges[order], reversed_edges).clip(max=len(order) - 1)]
    shared = np.flatnonzero((edges[other] == reversed_edges) & (owner < owner[other]))
    shared = shared[np.lexsort([owner[other[shared]], owner[shared]])]
    borders = np.stack([cells.corners[shared], cells.corners[after[shared]]], axis=1)
    return np.column_stack([owner[shared], owner[other[shared]]]), borders


def _pass_borders(borders: Floats, free: Environment) -> Floats:
    """The middle of the longest free piece of each border (b, 2, 2): (b, 2), NaN where nothing is free."""
    shapely.prepare(free.polygon)
    pieces, border = shapely.get_parts(
        shapely.intersection(shapely.linestrings(borders), free.polygon), return_index=True
    )
    longest_last = np.argsort(shapely.length(pieces))
    pieces, border = pieces[longest_last], border[longest_last]
    wide = shapely.length(pieces) > free.tolerance_m
    passages = np.full((len(borders), 2), np.nan)
    passages[border[wide]] = shapely.get_coordinates(shapely.line_interpolate_point(pieces[wide], 0.5, normalized=True))
    return passages


def _count_jumps(before: Ints) -> Ints:
    """How many jumps lead to each cell: (s, N), from the cells before them (s, N), negative at the start.

    Every step doubles how far the jumps counted so far reach back: O(log N) steps.
    """
    jumps = (before >= 0).astype(np.int64)
    reached = np.where(before >= 0, before, np.arange(before.shape[1]))
    while True:
        farther = np.take_along_axis(jumps, reached, axis=1)
        if not farther.any():
            return jumps
        jumps += farther
        reached = np.take_along_axis(reached, reached, axis=1)
