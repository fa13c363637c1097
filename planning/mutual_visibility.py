"""The mutual visibility graph: which pairs of cells see each other with all their points.

Two convex cells P and Q are mutually visible iff the hull of P ∪ Q lies in free space (thesis §3.2.1). The hull's
border is a part of P's, a part of Q's, and two *bridges*, the outer common tangents. So the hull is free iff no wall
crosses a bridge and no hole lies between the bridges (§4.1.1, steps 2–5). Three observations make that cheap:

- A segment from p to q that enters an obstacle crosses a wall with p strictly in front and q strictly behind. So only
  walls matter that have a corner of P in front and a corner of Q behind; if there is none, the cells see each other.
- A hole between the bridges has such a wall, and that wall has an end between the bridges. So the same walls tell of
  the bridges and of the holes.
- The wall that hides a cell mostly hides its neighbours too. It is tried first, on the segment of the centroids.
- Every aspect cell lies in one inflection cell, and inherits what that one sees.

Cells touch walls, and bridges of cells run along walls and through vertices: grazing is seeing. So every cell is first
shrunk about its centroid by the factor 1 − `SHRINKAGE`; then a bridge meets a wall only if it crosses it. An obstacle
that enters the hull by less than this share of a cell's size is not noticed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import depth_first_order

from planning.decomposition import Cells, decompose, measure_cells
from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SHRINKAGE = 1e-6
"""Smaller is less forgiving towards rounding: 1e-9 loses edges between slivers."""

MOST_CELLS = 20_000
"""Above this the graph alone takes hundreds of megabytes, and what is computed from it gigabytes."""


class TooManyCells(ValueError):
    """More cells than a mutual visibility graph is made for; the text is one sentence with map and remedy."""


def mutual_visibility(cells: Cells) -> csr_array:
    """The mutual visibility graph Q of thesis §3.2.1.

    Returns:
        (N, N) bool, symmetric, True on the diagonal.

    Raises:
        TooManyCells: more than `MOST_CELLS`.

    Complexity: O(N² V) for N cells and V walls, of which a hidden pair mostly costs O(1).
    """
    environment, frame = cells.environment, cells.frame
    n = len(cells)
    if n > MOST_CELLS:
        raise TooManyCells(
            f"{environment.name or 'the map'} has {n} {cells.kind} cells, more than the {MOST_CELLS} that a mutual "
            f"visibility graph is made for: use inflection cells, shorter bitangents or a simpler map"
        )
    centroids = measure_cells(cells.unit_corners, cells.starts)[1]
    centre = np.repeat(centroids, np.diff(cells.starts), axis=0)
    shrunk = centre + (1.0 - SHRINKAGE) * (cells.unit_corners - centre)
    walls = frame.enter(environment.walls.reshape(-1, 2)).reshape(-1, 4)
    # Neighbours after each other: depth first along adjacency.
    order = depth_first_order(cells.adjacency, 0, directed=False, return_predecessors=False).astype(np.int64)
    parent, inherited = _find_parents(cells)
    seen = _find_visible(shrunk, cells.starts, centroids, order, walls, parent, inherited)
    flat = np.flatnonzero(seen)
    starts = np.concatenate([[0], np.cumsum(np.count_nonzero(seen, axis=1))])
    return csr_array((np.ones(len(flat), np.bool_), flat % n, starts), shape=(n, n))


def _find_parents(cells: Cells) -> tuple[Ints, Bools]:
    """For each cell the inflection cell around it, and which of those see each other; without them, nothing."""
    if cells.kind == "inflection":
        return np.zeros(len(cells), np.int64), np.zeros((1, 1), np.bool_)
    parents = decompose(cells.environment, "inflection")
    return parents.locate(cells.centroids), mutual_visibility(parents).toarray()


@kernel
def _sort_walls(corners: Floats, starts: Ints, walls: Floats) -> tuple[Bools, Bools]:
    """Which cells have a corner strictly in front of which walls, and strictly behind: (N, V) bool each. O(C V)."""
    n = len(starts) - 1
    front, behind = np.zeros((n, len(walls)), np.bool_), np.zeros((n, len(walls)), np.bool_)
    for w in range(len(walls)):
        ax, ay = walls[w, 0], walls[w, 1]
        dx, dy = walls[w, 2] - ax, walls[w, 3] - ay
        for i in range(n):
            for k in range(starts[i], starts[i + 1]):
                side = dx * (corners[k, 1] - ay) - dy * (corners[k, 0] - ax)
                front[i, w] = front[i, w] or side > 0.0
                behind[i, w] = behind[i, w] or side < 0.0
    return front, behind


@kernel
def _side(px: float, py: float, qx: float, qy: float, x: float, y: float) -> float:
    """Positive when (x, y) is left of the line from p to q, negative when right."""
    return (qx - px) * (y - py) - (qy - py) * (x - px)


@kernel
def _crosses(walls: Floats, w: int, px: float, py: float, qx: float, qy: float) -> bool:
    """Whether the segment from p to q goes through wall w from its front."""
    ax, ay, bx, by = walls[w, 0], walls[w, 1], walls[w, 2], walls[w, 3]
    if _side(ax, ay, bx, by, qx, qy) >= 0.0 or _side(ax, ay, bx, by, px, py) <= 0.0:
        return False
    return bool((_side(px, py, qx, qy, ax, ay) > 0.0) != (_side(px, py, qx, qy, bx, by) > 0.0))


@kernel
def _find_bridge(corners: Floats, p: int, p_end: int, q: int, q_end: int, side: float) -> tuple[int, int]:
    """Corners of two disjoint convex polygons whose line has no corner of either on the given side.

    ``side`` is 1 for the left of the line from the first polygon to the second, -1 for the right. From one end of the
    line to the tangent through the other, in turn; every turn moves the line towards that side. O(corners) a turn,
    two or three turns.
    """
    p_first, q_first = p, q
    for _ in range(p_end - p + q_end - q):
        moved = False
        x, y = corners[q, 0], corners[q, 1]
        for k in range(p_first, p_end):
            if side * _side(corners[p, 0], corners[p, 1], x, y, corners[k, 0], corners[k, 1]) > 0.0:
                p = k
                moved = True
        x, y = corners[p, 0], corners[p, 1]
        for k in range(q_first, q_end):
            if side * _side(x, y, corners[q, 0], corners[q, 1], corners[k, 0], corners[k, 1]) > 0.0:
                q = k
                moved = True
        if not moved:
            break
    return p, q


@kernel
def _find_obstacle(
    corners: Floats, p: int, p_end: int, q: int, q_end: int, walls: Floats, candidates: Ints, count: int
) -> int:
    """The first of the ``count`` candidate walls that enters the hull of two shrunk cells, or -1."""
    a, b = _find_bridge(corners, p, p_end, q, q_end, 1.0)
    c, d = _find_bridge(corners, p, p_end, q, q_end, -1.0)
    ax, ay, bx, by = corners[a, 0], corners[a, 1], corners[b, 0], corners[b, 1]
    cx, cy, dx, dy = corners[c, 0], corners[c, 1], corners[d, 0], corners[d, 1]
    for f in range(count):
        w = candidates[f]
        x, y = walls[w, 0], walls[w, 1]
        start_left = _side(ax, ay, bx, by, x, y) > 0.0
        start_right = _side(cx, cy, dx, dy, x, y) < 0.0
        end_left = _side(ax, ay, bx, by, walls[w, 2], walls[w, 3]) > 0.0
        end_right = _side(cx, cy, dx, dy, walls[w, 2], walls[w, 3]) < 0.0
        if (start_left and end_left) or (start_right and end_right):
            continue
        if start_left != end_left and _crosses(walls, w, ax, ay, bx, by):
            return int(w)
        if start_right != end_right and _crosses(walls, w, cx, cy, dx, dy):
            return int(w)
        if (
            not (start_left or start_right)
            and _side(cx, cy, ax, ay, x, y) <= 0.0
            and _side(dx, dy, bx, by, x, y) >= 0.0
        ):
            return int(w)
    return -1


@kernel
def _find_visible(
    corners: Floats, starts: Ints, centroids: Floats, order: Ints, walls: Floats, parent: Ints, inherited: Bools
) -> Bools:
    """`mutual_visibility` as a dense (N, N) array; ``order`` puts near cells after each other."""
    n = len(order)
    seen = np.zeros((n, n), np.bool_)
    front, behind = _sort_walls(corners, starts, walls)
    hides = np.zeros(n, np.int64)  # by cell: the wall that last hid it
    facing, candidates = np.empty(len(walls), np.int64), np.empty(len(walls), np.int64)
    for row in range(n):
        i = order[row]
        seen[i, i] = True
        px, py = centroids[i, 0], centroids[i, 1]
        faces = 0
        for w in range(len(walls)):
            if front[i, w]:
                facing[faces] = w
                faces += 1
        last = 0  # the wall that last hid a cell of this row
        for column in range(row + 1, n):
            j = order[column]
            qx, qy = centroids[j, 0], centroids[j, 1]
            if _crosses(walls, last, px, py, qx, qy):
                continue
            if _crosses(walls, hides[j], px, py, qx, qy):
                last = hides[j]
                continue
            if inherited[parent[i], parent[j]]:
                seen[i, j] = seen[j, i] = True
                continue
            count = 0
            for f in range(faces):
                candidates[count] = facing[f]
                count += behind[j, facing[f]]
            obstacle = -1
            if count > 0:
                obstacle = _find_obstacle(
                    corners, starts[i], starts[i + 1], starts[j], starts[j + 1], walls, candidates, count
                )
            if obstacle < 0:
                seen[i, j] = seen[j, i] = True
            else:
                last = hides[j] = obstacle
    return seen
