"""What is true of members wherever each is on its piece of path, in every window of two stages.

Part of the certificate, and written apart from all planners. Pieces are given as rows of one list of points (p, 2):
in window w member i is on the way from ``points[first[i, w]]`` to ``points[last[i, w]]``, which may be one point.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planning.certificate_clearance import approach
from planning.certificate_hull import find_bounds, see_throughout
from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@kernel
def _stands(points: Floats, start: int) -> bool:
    """Whether one point of a list is where the next one is."""
    return bool(points[start, 0] == points[start + 1, 0] and points[start, 1] == points[start + 1, 1])


@kernel
def time_stages(times: Floats, points: Floats, stages: Ints, start: float) -> tuple[Floats, Floats, Floats]:
    """When members begin and finish their stages on the nominal clock, if they do so as soon as they may.

    A stage begins when its member leaves the place where it begins, and is finished when it comes to where it ends, so
    that a stop between two stages belongs to neither. One without motion begins never, and is finished as soon as the
    stage before it is, and all have finished the stage before that.

    Args:
        times: (p,) float, seconds: of all waypoints.
        points: (p, 2) float, metres.
        stages: (k, n + 1) int: the waypoint at which each stage begins, and the last one ends.
        start: of the schedule, seconds.

    Returns:
        begun: (k, n) float, seconds: when each member begins each stage, NaN for never.
        finished: (k, n) float, seconds: when it has finished it.
        barriers: (n,) float, seconds: when all have.

    Complexity: O(k n + p).
    """
    members, count = stages.shape[0], stages.shape[1] - 1
    begun, finished = np.full((members, count), np.nan), np.empty((members, count))
    barriers = np.full(count, start)
    for n in range(count):
        for i in range(members):
            leaves, comes = stages[i, n], stages[i, n + 1]
            while leaves < comes and _stands(points, leaves):
                leaves += 1
            while comes > leaves and _stands(points, comes - 1):
                comes -= 1
            if leaves < comes:
                begun[i, n], finished[i, n] = times[leaves], times[comes]
            else:
                finished[i, n] = max(finished[i, n - 1] if n > 0 else start, barriers[n - 2] if n > 1 else start)
            barriers[n] = max(barriers[n], finished[i, n])
    return begun, finished, barriers


@kernel
def bound_pieces(points: Floats, first: Ints, last: Ints) -> Floats:
    """Least and greatest x, least and greatest y of every piece: (k, w, 4) float, metres."""
    bounds = np.empty((first.shape[0], first.shape[1], 4))
    for i in range(first.shape[0]):
        for w in range(first.shape[1]):
            left, right, low, high = find_bounds(points, first[i, w], last[i, w] + 1)
            bounds[i, w, 0], bounds[i, w, 1], bounds[i, w, 2], bounds[i, w, 3] = left, right, low, high
    return bounds


@kernel
def _approach(points: Floats, i: int, i_last: int, j: int, j_last: int) -> tuple[float, float, float]:
    """The least distance between two pieces, and the place on the first where it is."""
    nearest, x, y = np.inf, np.nan, np.nan
    for s in range(i, max(i + 1, i_last)):
        for t in range(j, max(j + 1, j_last)):
            r, u = min(s + 1, i_last), min(t + 1, j_last)
            found = approach(
                points[s, 0], points[s, 1], points[r, 0], points[r, 1],
                points[t, 0], points[t, 1], points[u, 0], points[u, 1],
            )  # fmt: skip
            if found[0] < nearest:
                nearest, x, y = found
    return nearest, x, y


@kernel
def find_distances(points: Floats, first: Ints, last: Ints, bounds: Floats, radii: Floats) -> Floats:
    """How near members with bodies can come to each other.

    Args:
        points: (p, 2) float, metres.
        first: (k, w) int, see above.
        last: (k, w) int.
        bounds: (k, w, 4) float, metres: of the pieces.
        radii: (k,) float, metres.

    Returns:
        (k, k, w, 3) float, metres, of members i < j: their least distance, and the place (x, y) of i where it is; inf
        where they are farther apart than both radii together, or one has no body.

    Complexity: O(k² w) where all keep clear of each other, else O(m²) more for pieces of m points each.
    """
    members, windows = first.shape
    found = np.full((members, members, windows, 3), np.inf)
    for i in range(members):
        for j in range(i + 1, members):
            reach = radii[i] + radii[j]
            if radii[i] == 0.0 or radii[j] == 0.0:
                continue
            for w in range(windows):
                a, b = bounds[i, w], bounds[j, w]
                if a[0] - b[1] > reach or b[0] - a[1] > reach or a[2] - b[3] > reach or b[2] - a[3] > reach:
                    continue
                nearest, x, y = _approach(points, first[i, w], last[i, w], first[j, w], last[j, w])
                found[i, j, w, 0], found[i, j, w, 1], found[i, j, w, 2] = nearest, x, y
    return found


@kernel
def _sees(points: Floats, first: Ints, last: Ints, w: int, i: int, j: int, walls: Floats) -> bool:
    return see_throughout(points[first[i, w] : last[i, w] + 1], points[first[j, w] : last[j, w] + 1], walls)


@kernel
def find_link(points: Floats, first: Ints, last: Ints, i: int, j: int, walls: Floats) -> Bools:
    """In which windows all of the piece of i certainly sees all of that of j: (w,) bool."""
    held = np.empty(first.shape[1], np.bool_)
    for w in range(first.shape[1]):
        held[w] = _sees(points, first, last, w, i, j, walls)
    return held


@kernel
def find_networks(
    points: Floats, first: Ints, last: Ints, pairs: Ints, asked: Ints, walls: Floats
) -> tuple[Ints, Ints]:
    """Which members are joined in each window, by links that hold wherever they are.

    No more links are looked at than it takes to join those asked for, and first those that did it in the window before.

    Args:
        points: (p, 2) float, metres.
        first: (k, w) int, see above.
        last: (k, w) int.
        pairs: (w, n, 2) int: all pairs of members, in the order in which to look at them in each window.
        asked: members to be joined.
        walls: (v, 2, 2) float, metres: receded.

    Returns:
        parts: (w, k) int: the lowest member of the part of each; where those asked for are joined, others need not be.
        links: (w, k − 1, 2) int: a forest that joins the parts, −1 where it has fewer.

    Complexity: in each window O(k) links to look at where the last ones hold, else O(k²).
    """
    members, windows = first.shape
    parts = np.empty((windows, members), np.int64)
    links = np.full((windows, members - 1, 2), -1, np.int64)
    for w in range(windows):
        root = parts[w]
        for i in range(members):
            root[i] = i
        found = 0
        kept = members - 1 if w > 0 else 0
        for k in range(kept + pairs.shape[1]):
            i, j = (
                (links[w - 1, k, 0], links[w - 1, k, 1]) if k < kept else (pairs[w, k - kept, 0], pairs[w, k - kept, 1])
            )
            if i < 0 or root[i] == root[j] or not _sees(points, first, last, w, i, j, walls):
                continue
            _join(root, i, j)
            links[w, found, 0], links[w, found, 1] = i, j
            found += 1
            if _are_joined(root, asked):
                break
    return parts, links


@kernel
def _join(root: Ints, i: int, j: int) -> None:
    """Make one part of two, with the lower of their lowest members."""
    low, high = min(root[i], root[j]), max(root[i], root[j])
    for member in range(root.shape[0]):
        if root[member] == high:
            root[member] = low


@kernel
def _are_joined(root: Ints, asked: Ints) -> bool:
    joined = True
    for member in asked:
        joined = joined and root[member] == root[asked[0]]
    return joined
