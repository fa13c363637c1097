"""One robot at a time: a search over whole deployments that never disconnects the team and never lets robots touch.

A *deployment* is the place of each robot on a `planning.team_roadmap`. A move takes one robot along one edge. It is
allowed if the mover's disc keeps clear of all others on the way, and the network of the others' links and of those of
the mover's links that hold on the whole edge joins whom it should. So a robot moves while it is not an articulation
point of the network, and also while it is one but stays in sight of all that it holds together.

The search is best first, by the way gone and, weighed more, the ways that are left; it ends at the goals, or after a
given number of deployments, with the one nearest to the goals. Moves can be taken back, so nothing is lost by a bad one
but time.

E. Stump, N. Michael, V. Kumar, V. Isler, Visibility-based deployment of robot formations for communication maintenance,
2011, doi:10.1109/ICRA.2011.5980179, for searching deployments; the articulation point rule is folklore.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from planning.environment import Environment
from planning.kernel import kernel
from planning.order_search import is_joined
from planning.team_roadmap import TeamRoadmap, see_throughout, watches

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Bytes = NDArray[np.int8]

GREED: Final = 3.0
"""What a metre that is left counts more than a metre gone."""

ASIDE: Final = 0.25
"""What a metre that is left counts for one who only steps aside, and comes back."""


@dataclass(frozen=True, slots=True, eq=False)
class Crew:
    """Who is on the roadmap, and who has to be joined.

    Attributes:
        at: (k,) int: where each member starts, its place on the roadmap; robots that move first.
        radii_m: (k,) float, metres; 0 for one without a body.
        joined: members, by number, that have to be in one component, over any others; those on paths of their own
            count from k on. Fewer than two ask for nothing.
        paths: of members that may be anywhere on them at any time, each (m, 2) float, metres; they have no bodies.
    """

    at: Ints
    radii_m: Floats
    joined: Sequence[int]
    paths: Sequence[Floats] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Moves:
    """What was found.

    Attributes:
        places: (n + 1, m) int: where the m movers are before each move, and after the last one.
        complete: whether all movers are at their goals after it.
    """

    places: Ints
    complete: bool


def search_moves(roadmap: TeamRoadmap, crew: Crew, goals: Ints, effort: int, greed: float = GREED) -> Moves:
    """Moves that bring robots to their goals.

    Args:
        roadmap: the places.
        crew: who is where.
        goals: (m,) int, m ≤ k: where the first m members are to go. The others stand.
        effort: deployments to go on from, at most.
        greed: see :data:`GREED`; 1 finds a shortest plan on the roadmap if the effort is enough.

    Complexity: O(effort · (m d k + log)) for d edges at a place.
    """
    m = len(goals)
    to_go = roadmap.lengths_to(goals.tolist())
    starts = crew.at[:m]
    # Whoever cannot get there at all may be anywhere.
    to_go[np.isinf(to_go[np.arange(m), starts])] = 0.0
    to_go[goals == starts] *= ASIDE
    watched = [roadmap.watch_path(path) for path in crew.paths]
    path_sees = np.array([by_place for by_place, _ in watched], dtype=np.bool_).reshape(-1, len(roadmap.places))
    path_watches = np.array([by_edge for _, by_edge in watched], dtype=np.bool_).reshape(-1, len(roadmap.edges))
    needed = sum(1 << i for i in crew.joined) if len(crew.joined) > 1 else 0
    environment = roadmap.environment
    states, best = _search(
        np.asarray(crew.at, dtype=np.int64), to_go, crew.radii_m, needed,
        _link_paths(environment, crew.paths), path_sees, path_watches, roadmap.places,
        roadmap.visible, roadmap.edges, roadmap.starts, roadmap.at, roadmap.watched, environment.vertices,
        environment.tolerance_m, greed, effort,
    )  # fmt: skip
    trail = []
    while best >= 0:
        trail.append(states[best, :m])
        best = states[best, m]
    places = np.array(trail[::-1], dtype=np.int64)
    return Moves(places, bool(np.array_equal(places[-1], goals)))


def _link_paths(environment: Environment, paths: Sequence[Floats]) -> Bools:
    """Which members on paths of their own see each other wherever they are: (p, p) bool."""
    links = [see_throughout(environment, one, other) for one in paths for other in paths]
    return np.array(links, dtype=np.bool_).reshape(len(paths), len(paths))


@kernel
def _find_slot(state: Ints, known: Ints, slots: Ints) -> int:
    """Where a deployment is, or would be, in a table of hashes; ``slots`` holds rows of ``known``, -1 where empty."""
    key = np.uint64(0)
    for place in state:
        key = (key ^ np.uint64(place + 1)) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(32)
    mask = slots.shape[0] - 1
    slot = int(np.int64(key & np.uint64(mask)))
    while slots[slot] >= 0:
        row = known[slots[slot]]
        same = True
        for i in range(state.shape[0]):
            if row[i] != state[i]:
                same = False
                break
        if same:
            return slot
        slot = (slot + 1) & mask
    return slot


@kernel
def _keeps_clear(mover: int, u: Floats, v: Floats, at: Ints, radii: Floats, places: Floats, tolerance: float) -> bool:
    """Whether a mover's disc touches nobody's on the way from u to v."""
    if radii[mover] == 0.0:
        return True
    wx, wy = v[0] - u[0], v[1] - u[1]
    squared = wx * wx + wy * wy
    for j in range(at.shape[0]):
        if j == mover or radii[j] == 0.0:
            continue
        dx, dy = places[at[j], 0] - u[0], places[at[j], 1] - u[1]
        share = min(1.0, max(0.0, (dx * wx + dy * wy) / squared)) if squared > 0.0 else 0.0
        dx, dy = dx - share * wx, dy - share * wy
        apart = radii[mover] + radii[j] - tolerance
        if dx * dx + dy * dy < apart * apart:
            return False
    return True


@kernel
def _look_around(at: Ints, visible: Bools, path_sees: Bools, path_links: Bools, adjacent: Ints) -> None:
    """Write whom each member sees, as bits, all robots standing at their places."""
    k, p = at.shape[0], path_sees.shape[0]
    adjacent[:] = 0
    for i in range(k + p):
        for j in range(i):
            if i < k:
                sees = visible[at[i], at[j]]
            elif j < k:
                sees = path_sees[i - k, at[j]]
            else:
                sees = path_links[i - k, j - k]
            if sees:
                adjacent[i] |= 1 << j
                adjacent[j] |= 1 << i


@kernel
def _stays_joined(mover: int, seen: int, needed: int, adjacent: Ints, trial: Ints) -> bool:
    """Whether the network joins whom it should while a mover sees just these of the others."""
    if needed == 0 or seen == adjacent[mover]:
        return True
    for j in range(adjacent.shape[0]):
        trial[j] = adjacent[j] & ~(1 << mover) | ((seen >> j & 1) << mover)
    trial[mover] = seen
    return is_joined(trial, needed)


@kernel
def _search(
    start: Ints, to_go: Floats, radii: Floats, needed: int, path_links: Bools, path_sees: Bools,
    path_watches: Bools, places: Floats, visible: Bools, edges: Ints, starts: Ints, edges_at: Ints, watched: Bytes,
    vertices: Floats, tolerance: float, greed: float, effort: int,
) -> tuple[Ints, int]:  # fmt: skip
    """Deployments (n, m + 1), last the row of the one before; the row nearest to the goals."""
    k, m = start.shape[0], to_go.shape[0]
    size = 1 << 12
    known = np.empty((size, m + 1), np.int64)
    slots = np.full(4 * size, -1, np.int64)
    at, state = start.copy(), start[:m].copy()
    adjacent, trial = np.zeros(k + path_sees.shape[0], np.int64), np.zeros(k + path_sees.shape[0], np.int64)
    known[0, :m], known[0, m] = state, -1
    slots[_find_slot(state, known, slots)] = 0
    count, expanded = 1, 0
    best, least = 0, _sum_ways(state, to_go)
    # Of two that promise the same, the one found last.
    queue = [(greed * least, 0, 0.0)]
    while len(queue) > 0 and expanded < effort and least > 0.0:
        _, minus_row, gone = heapq.heappop(queue)
        row = -minus_row
        expanded += 1
        for i in range(m):
            at[i] = state[i] = known[row, i]
        _look_around(at, visible, path_sees, path_links, adjacent)
        for i in range(m):
            u = at[i]
            for e in edges_at[starts[u] : starts[u + 1]]:
                v = edges[e, 0] + edges[e, 1] - u
                state[i] = v
                slot = _find_slot(state, known, slots)
                if slots[slot] >= 0 or not _keeps_clear(i, places[u], places[v], at, radii, places, tolerance):
                    continue
                if needed != 0:
                    seen = 0
                    for j in range(k):
                        if j != i and watches(e, at[j], places, visible, edges, vertices, tolerance, watched):
                            seen |= 1 << j
                    for p in range(path_watches.shape[0]):
                        if path_watches[p, e]:
                            seen |= 1 << (k + p)
                    if not _stays_joined(i, seen, needed, adjacent, trial):
                        continue
                if count == size:
                    size *= 2
                    wider = np.empty((size, m + 1), np.int64)
                    wider[:count] = known
                    known = wider
                    slots = np.full(4 * size, -1, np.int64)
                    for other in range(count):
                        slots[_find_slot(known[other, :m], known, slots)] = other
                    slot = _find_slot(state, known, slots)
                known[count, :m], known[count, m] = state, row
                slots[slot] = count
                further = gone + np.hypot(places[v, 0] - places[u, 0], places[v, 1] - places[u, 1])
                left = _sum_ways(state, to_go)
                if left < least:
                    best, least = count, left
                heapq.heappush(queue, (further + greed * left, -count, further))
                count += 1
            state[i] = u
    return known[:count], best


@kernel
def _sum_ways(state: Ints, to_go: Floats) -> float:
    left = 0.0
    for i in range(state.shape[0]):
        left += to_go[i, state[i]]
    return left
