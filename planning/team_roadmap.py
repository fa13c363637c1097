"""A roadmap for whole teams: places, the straight moves between them, and who sees a move from where.

A *move* takes one robot along an edge while all others stand at places. A standing robot sees the mover throughout if
the triangle of its place and the edge is free of walls, which is looked up once and then known.

Places are placements, the *mitres* of corners, where the walls at both sides of a corner, grown by the robot's radius,
would meet, so that one sees along both, and what a task adds: starts and goals, and a ring around each disc that may be
in the way. Two that see each other in the robots' free space are joined if no third place is nearly on the way,

    |u w|² + |w v|² < 0.6 |u v|²,

so that robots stop where others can take over and the graph stays thin (with 1 instead of 0.6 it would be the Gabriel
graph of the places that see each other, which holds a shortest tree).

Gabriel, Sokal, A new statistical approach to geographic variation analysis, 1969, doi:10.2307/2412323.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from planning.environment import Environment
from planning.kernel import kernel
from planning.line_of_sight import free_points_see
from planning.pair_sight import mark_sight

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Bytes = NDArray[np.int8]

_NEIGHBOURS: Final = 24
"""So many of the nearest places that it sees each place may be joined to."""

_WIDEST_TURN: Final = math.radians(100.0)
"""Of a corner with one mitre."""

_RING: Final = 6
"""Places around a disc."""

_LOOSE: Final = 1.001
"""How much farther than it must a place keeps from a wall or a disc."""

_ASIDE: Final = 0.6
"""A place between two others keeps them from being joined: see the module."""


@dataclass(frozen=True, slots=True, eq=False)
class TeamRoadmap:
    """N places and E edges.

    Attributes:
        environment: the map as drawn; robots see through it.
        places: (N, 2) float, metres, map frame.
        visible: (N, N) bool: who sees whom standing there.
        edges: (E, 2) int: the ends of each, the lower one first.
        starts: (N + 1,) int: the edges at place i are ``at[starts[i]:starts[i + 1]]``.
        at: (2 E,) int.
        watched: (E, N) int8: whether a place sees an edge throughout; -1 where nobody has asked yet.
    """

    environment: Environment
    places: Floats
    visible: Bools
    edges: Ints
    starts: Ints
    at: Ints
    watched: Bytes

    def lengths_to(self, places: Sequence[int]) -> Floats:
        """Lengths of the shortest ways to some places: (m, N) float, metres, inf where there is none. O(m E log N)."""
        spans = np.hypot(*(self.places[self.edges[:, 0]] - self.places[self.edges[:, 1]]).T)
        n = len(self.places)
        graph = csr_array((spans, (self.edges[:, 0], self.edges[:, 1])), shape=(n, n))
        found: Floats = dijkstra(graph, directed=False, indices=list(places))
        return found

    def watch_path(self, path: Floats) -> tuple[Bools, Bools]:
        """Which places (N,) and which edges (E,) see all of a path (m, 2), metres, throughout. O((N + E) m w)."""
        seen: tuple[Bools, Bools] = _watch_path(
            self.places, self.edges, path, self.environment.walls, self.environment.tolerance_m
        )
        return seen


def make_roadmap(environment: Environment, free: Environment, places: Floats) -> TeamRoadmap:
    """Join places.

    Args:
        environment: the map as drawn.
        free: where the robots' centres can be.
        places: (N, 2) float, metres; those outside of ``free`` have no edges.

    Complexity: O(N² w + N w_free) for w walls.
    """
    visible = environment.visibility_matrix(places)
    return _build(environment, free, places, visible, np.zeros((0, 2), dtype=np.int64), 0)


def extend_roadmap(roadmap: TeamRoadmap, free: Environment, places: Floats) -> TeamRoadmap:
    """A roadmap with more places (n, 2), numbered on from those that it has; what is known of these is kept.

    O(n (N w + w_free)) for walls w.
    """
    environment, known = roadmap.environment, len(roadmap.places)
    every = np.concatenate([roadmap.places, places])
    visible = np.empty((len(every), len(every)), dtype=np.bool_)
    visible[:known, :known] = roadmap.visible
    seen = environment.line_of_sight(np.repeat(places, len(every), axis=0), np.tile(every, (len(places), 1)))
    visible[known:] = np.reshape(seen, (len(places), len(every)))
    visible[:, known:] = visible[known:].T
    extended = _build(environment, free, every, visible, roadmap.edges, known)
    extended.watched[: len(roadmap.edges), :known] = roadmap.watched
    return extended


def see_throughout(environment: Environment, path: Floats, other: Floats) -> bool:
    """Whether every point of a path (m, 2), metres, sees every point of another (n, 2). O(m n w)."""
    table = np.zeros((2 * len(path) - 1, 2 * len(other) - 1), dtype=np.uint8)
    mark_sight(
        path, np.arange(len(path)), other, np.arange(len(other)), environment.walls, environment.tolerance_m, table, 1
    )
    return bool(table.all())


def find_mitres(environment: Environment, free: Environment, radius_m: float) -> Floats:
    """Places (n, 2), metres, at the map's reflex vertices from which a robot's ways lead along both walls.

    One for a turn of up to 100°, else two that share it; none where there is no room. O(r w) for r reflex vertices.
    """
    vertices, after = environment.vertices, environment.walls[:, 1]
    before = np.empty_like(vertices)
    before[environment.successors] = vertices
    found = []
    for corner in np.flatnonzero(environment.is_reflex):
        into, out = vertices[corner] - before[corner], after[corner] - vertices[corner]
        turn = math.atan2(out[0] * into[1] - out[1] * into[0], into @ out)
        step = turn / math.ceil(turn / _WIDEST_TURN)
        # The normal of the wall before, on its free side, turns clockwise to that of the wall after.
        first = math.atan2(into[0], -into[1])
        for angle in np.arange(first - 0.5 * step, first - turn, -step):
            reach = radius_m * _LOOSE / math.cos(0.5 * step)
            found.append(vertices[corner] + reach * np.array([math.cos(angle), math.sin(angle)]))
    mitres = np.array(found, dtype=np.float64).reshape(-1, 2)
    return mitres[free.contains(mitres)]


def ring(place: Floats, separation_m: float, free: Environment) -> Floats:
    """Places (n, 2) in ``free`` around a disc, so that straight moves between neighbours keep the separation to it."""
    angles = np.arange(_RING) * 2.0 * np.pi / _RING
    reach = separation_m * _LOOSE / math.cos(math.pi / _RING)
    around: Floats = place + reach * np.column_stack([np.cos(angles), np.sin(angles)])
    return around[free.contains(around)]


def _build(
    environment: Environment, free: Environment, places: Floats, visible: Bools, known_edges: Ints, known: int
) -> TeamRoadmap:
    added = _join_places(places, visible, free.contains(places), known, free.walls, free.tolerance_m)
    edges = np.concatenate([known_edges, added])
    both = np.concatenate([edges[:, 0], edges[:, 1]])
    order = np.argsort(both, kind="stable")
    starts = np.searchsorted(both[order], np.arange(len(places) + 1))
    watched = np.full((len(edges), len(places)), -1, dtype=np.int8)
    return TeamRoadmap(environment, places, visible, edges, starts, order % max(len(edges), 1), watched)


@kernel
def _join_places(places: Floats, visible: Bools, inside: Bools, known: int, walls: Floats, tolerance: float) -> Ints:
    """The edges (e, 2) that have at least one end that is not among the first ``known`` places."""
    n = places.shape[0]
    reach = np.zeros((n, n), np.bool_)
    squares = np.empty(n)
    for u in range(known, n):
        if not inside[u]:
            continue
        for v in range(n):
            dx, dy = places[v, 0] - places[u, 0], places[v, 1] - places[u, 1]
            squares[v] = dx * dx + dy * dy if visible[u, v] and inside[v] and u != v else np.inf
        count = 0
        for v in np.argsort(squares):
            if squares[v] == np.inf or count == _NEIGHBOURS:
                break
            if not reach[u, v]:
                reach[u, v] = reach[v, u] = free_points_see(
                    places[u, 0], places[u, 1], places[v, 0], places[v, 1], walls, tolerance
                )
            count += reach[u, v]
    edges = np.empty(((n - known) * n, 2), np.int64)
    count = 0
    for v in range(known, n):
        for u in range(v):
            if not reach[u, v]:
                continue
            dx, dy = places[v, 0] - places[u, 0], places[v, 1] - places[u, 1]
            limit = _ASIDE * (dx * dx + dy * dy)
            between = False
            for w in range(n):
                if reach[u, w] and reach[w, v]:
                    ax, ay = places[w, 0] - places[u, 0], places[w, 1] - places[u, 1]
                    bx, by = places[w, 0] - places[v, 0], places[w, 1] - places[v, 1]
                    if ax * ax + ay * ay + bx * bx + by * by < limit:
                        between = True
                        break
            if not between:
                edges[count, 0], edges[count, 1] = u, v
                count += 1
    return edges[:count].copy()


@kernel
def watches(
    edge: int, place: int, places: Floats, visible: Bools, edges: Ints, vertices: Floats, tolerance: float,
    watched: Bytes,
) -> bool:  # fmt: skip
    """Whether a place sees an edge throughout, remembered in ``watched``. O(1), and O(w) the first time.

    The ends of the edge see each other, so nothing blocks the triangle if they see the place, and no wall's end lies in
    it deeper than the tolerance.
    """
    if watched[edge, place] < 0:
        u, v = edges[edge, 0], edges[edge, 1]
        free = bool(visible[u, place] and visible[v, place])
        if free and place not in (u, v):
            free = not _holds_vertex(places[place], places[u], places[v], vertices, tolerance)
        watched[edge, place] = 1 if free else 0
    return bool(watched[edge, place] == 1)


@kernel
def _holds_vertex(a: Floats, b: Floats, c: Floats, vertices: Floats, tolerance: float) -> bool:
    """Whether one of ``vertices`` (w, 2) lies in a triangle, deeper than the tolerance."""
    turn = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    if turn < 0.0:
        b, c = c, b
    ab, bc = np.hypot(b[0] - a[0], b[1] - a[1]), np.hypot(c[0] - b[0], c[1] - b[1])
    ca = np.hypot(a[0] - c[0], a[1] - c[1])
    for k in range(vertices.shape[0]):
        x, y = vertices[k, 0], vertices[k, 1]
        if (
            (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) > tolerance * ab
            and (c[0] - b[0]) * (y - b[1]) - (c[1] - b[1]) * (x - b[0]) > tolerance * bc
            and (a[0] - c[0]) * (y - c[1]) - (a[1] - c[1]) * (x - c[0]) > tolerance * ca
        ):
            return True
    return False


@kernel
def _watch_path(places: Floats, edges: Ints, path: Floats, walls: Floats, tolerance: float) -> tuple[Bools, Bools]:
    corners = np.arange(path.shape[0])
    size = 2 * path.shape[0] - 1
    by_place, by_edge = np.ones(places.shape[0], np.bool_), np.ones(edges.shape[0], np.bool_)
    for i in range(places.shape[0]):
        table = np.zeros((1, size), np.uint8)
        mark_sight(places[i : i + 1], corners[:1], path, corners, walls, tolerance, table, 1)
        for e in range(size):
            by_place[i] = by_place[i] and table[0, e] == 1
    ends = np.empty((2, 2))
    for i in range(edges.shape[0]):
        by_edge[i] = by_place[edges[i, 0]] and by_place[edges[i, 1]]
        if by_edge[i]:
            ends[0], ends[1] = places[edges[i, 0]], places[edges[i, 1]]
            table = np.zeros((3, size), np.uint8)
            mark_sight(ends, np.arange(2), path, corners, walls, tolerance, table, 1)
            for e in range(size):
                by_edge[i] = by_edge[i] and table[1, e] == 1
    return by_place, by_edge
