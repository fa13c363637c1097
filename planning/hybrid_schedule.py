"""The thesis' hybrid: geodesics cut at the borders of visibility cells, boxes for collisions, cells for sight.

Each path is cut at its bends and wherever it leaves a cell. A piece lies in one cell, or along the border of two; two
robots see each other on two pieces if these lie in or border upon cells that are mutually visible (thesis §4.3.5). That
is enough for sight, and far from needed: cells see each other only with all their points. So it keeps a chain that
holds from cell to cell; where topology changes on the way, with required links no schedule can exist.

The connection by any links needs no such choice: the cells that the team occupies must be a connected part of the
mutual visibility graph at every instant. For adjacency paths that is the visibility chain of §4.3.4.

Collisions are those of boxes, for both kinds of path: of the pieces, so they are smaller than those of whole segments.

Thesis §4.3.4–4.3.5, and §4.3.3 for the search.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from planning.adjacency_path import AdjacencyPath
from planning.coordination_diagram import CoordinationDiagram, Pair, measure_path, place_on_path, spread_pieces
from planning.decomposition import Cells
from planning.diagram_schedule import Team, schedule_in
from planning.grid_schedule import MOST_NODES, choose_demand
from planning.motion_plan import Schedule, read_points

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_ASIDE = 0.5
"""Of the tolerance: how far beside a piece the cells are asked for that it lies in or borders upon."""


def hybrid_schedule(
    paths: Sequence[ArrayLike],
    radius_m: ArrayLike,
    cells: Cells,
    seen: csr_array,
    links: Collection[Pair] | None = None,
    *,
    joined: Collection[int] | None = None,
    members: Sequence[str],
    speed_m_s: ArrayLike = 1.0,
    unscheduled: Collection[int] = (),
    most_nodes: int = MOST_NODES,
) -> Schedule:
    """A schedule of k robots that keep their links from cell to cell.

    Args:
        paths: k arrays (m, 2) float, metres, map frame, in the free space that the cells cover.
        radius_m: of the discs, one or (k,); a robot of radius 0 is in nobody's way.
        cells: of the map as drawn.
        seen: (N, N) bool, see `planning.mutual_visibility.mutual_visibility`.
        links: pairs of rows that must see each other throughout: the deployment's topology. None, without ``joined``:
            the whole team must be one network, by any links.
        joined: rows that must be in one network throughout, over any others.
        members: k names.
        speed_m_s: the greatest speeds, one or (k,), positive and finite.
        unscheduled: rows of robots that may be anywhere on their paths at any time.
        most_nodes: of the search, see `planning.diagram_search.search_diagram`.

    Returns:
        A schedule that is bound to the clock, from 0 s on.

    Raises:
        NoSchedule: none exists on the grid of boxes and cells (``proven``), or the search was given up.

    Complexity: O(k m C) for C corners of cells to cut the paths; the search is exponential in k.
    """
    points = [read_points(path) for path in paths]
    radii, speeds = (np.array(np.broadcast_to(value, len(points)), dtype=float) for value in (radius_m, speed_m_s))
    required, together = choose_demand(len(points), True, links, joined)
    pairs = list(combinations(range(len(points)), 2)) if together else sorted(required)
    cuts = [cut_at_cells(path, cells) for path in points]
    diagram = CoordinationDiagram.of(points, radii, cuts_m=cuts, anywhere=unscheduled)
    occupied = [
        _find_cells(path, cut if robot in unscheduled else limits, cells)
        for robot, (path, cut, limits) in enumerate(zip(points, cuts, diagram.limits_m, strict=True))
    ]
    sight = {}
    for i, j in pairs:
        visible = _find_visible(occupied[i], occupied[j], seen)
        for axis, robot in enumerate((i, j)):
            if robot in unscheduled:
                visible = np.logical_and.reduce(visible, axis=axis, keepdims=True)
        sight[i, j] = ~spread_pieces(~visible, len(diagram.limits_m[i]), len(diagram.limits_m[j]))
    return schedule_in(
        diagram.with_sight(sight, required, together), Team(members, radii, speeds, unscheduled), most_nodes
    )


def adjacency_schedule(
    paths: Sequence[AdjacencyPath],
    radius_m: ArrayLike,
    cells: Cells,
    seen: csr_array,
    links: Collection[Pair] | None = None,
    *,
    joined: Collection[int] | None = None,
    members: Sequence[str],
    speed_m_s: ArrayLike = 1.0,
    unscheduled: Collection[int] = (),
    most_nodes: int = MOST_NODES,
) -> Schedule:
    """A schedule of k robots along adjacency paths: from cell to cell, under visibility-chain connectivity.

    A robot that stays in its cell sees what the cell sees, wherever in it it is. So the coordinates of the diagram are
    the cells of each path (thesis §4.3.4); robots go along the lines of the paths, and keep apart on them.

    Args:
        paths: k adjacency paths through these cells.
        radius_m: of the discs, one or (k,), as they were when the paths were planned, or smaller.
        cells: of the map as drawn.
        seen: (N, N) bool, the mutual visibility graph.
        links: pairs of rows, see `hybrid_schedule`. None, without ``joined``: the cells that robots are in must be a
            connected part of that graph.
        joined: rows that must be in one network throughout, over any others.
        members: k names.
        speed_m_s: the greatest speeds, one or (k,), positive and finite.
        unscheduled: rows of robots that may be anywhere on their paths at any time.
        most_nodes: of the search.

    Raises:
        NoSchedule: none exists on the grid of boxes and cells (``proven``), or the search was given up.
    """
    lines = [path.points for path in paths]
    return hybrid_schedule(
        lines, radius_m, cells, seen, links,
        joined=joined, members=members, speed_m_s=speed_m_s, unscheduled=unscheduled, most_nodes=most_nodes,
    )  # fmt: skip


def cut_at_cells(path: ArrayLike, cells: Cells) -> Floats:
    """Where a path bends or leaves a cell: metres of path, rising, its ends included.

    Args:
        path: (m, 2) float, metres, map frame.
        cells: C corners in all.

    Complexity: O(m C).
    """
    points = np.array(path, dtype=np.float64).reshape(-1, 2)
    covered = measure_path(points)
    after = np.arange(1, len(cells.corners) + 1)
    after[cells.starts[1:] - 1] = cells.starts[:-1]
    near = cells.environment.tolerance_m
    cuts = [covered]
    for start, end, base in zip(points, points[1:], covered, strict=False):
        length = float(np.hypot(*(end - start)))
        if length > near:
            along = (end - start) / length
            offset = cells.corners - start
            ahead, aside = offset @ along, along[0] * offset[:, 1] - along[1] * offset[:, 0]
            crossed = np.flatnonzero((aside > near) & (aside[after] < -near))
            share = aside[crossed] / (aside[crossed] - aside[after[crossed]])
            reached = ahead[crossed] + share * (ahead[after[crossed]] - ahead[crossed])
            # Of a border along the piece, or one that ends at it, the corners.
            at = np.concatenate([reached, ahead[np.abs(aside) <= near]])
            cuts.append(base + np.unique(at[(at > 0.0) & (at < length)]))
    return np.unique(np.concatenate(cuts))


def _find_cells(path: Floats, limits: Floats, cells: Cells) -> Ints:
    """The cells that each piece between limits (n,) lies in or borders upon: (n − 1, 8), with repetitions.

    Of a robot that stands, for which there is one limit, those of its place: (1, 8).
    """
    middles = place_on_path(path, 0.5 * (limits[1:] + limits[:-1]) if len(limits) > 1 else limits)
    angles = np.arange(8) * (np.pi / 4.0)
    around = _ASIDE * cells.environment.tolerance_m * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return cells.locate((middles[:, None] + around).reshape(-1, 2)).reshape(-1, 8)


def _find_visible(occupied_i: Ints, occupied_j: Ints, seen: csr_array) -> Bools:
    """Which pieces (n_i, c) and (n_j, c), given by their cells, have two that see each other: (n_i, n_j)."""
    rows, row = np.unique(occupied_i, return_inverse=True)
    columns, column = np.unique(occupied_j, return_inverse=True)
    dense = seen[rows][:, columns].toarray()
    dense[rows < 0] = False
    dense[:, columns < 0] = False
    row, column = row.reshape(occupied_i.shape), column.reshape(occupied_j.shape)
    visible: Bools = np.logical_or.reduce(dense[row[:, None, :, None], column[None, :, None, :]], axis=(2, 3))
    return visible
