"""What is true of members wherever each is on its piece of path, in every window of two stages.

Part of the certificate, and written apart from all planners. Pieces are given as rows of one list of points (p, 2):
in window w member i is on the way from ``points[first[i, w]]`` to ``points[last[i, w]]``, which may be one point.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from planning.certificate_clearance import approach
from planning.certificate_hull import see_throughout
from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@kernel
def time_stages(times: Floats, points: Floats, stages: Ints, start: float) -> tuple[Floats, Floats]:
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
        Two (k, n) float, seconds: when each member begins each stage, NaN for never, and when it has finished it.

    Complexity: O(k n + p).
    """
    members, count = stages.shape[0], stages.shape[1] - 1
    begun, finished = np.full((members, count), np.nan), np.empty((members, count))
    for n in range(count):
        for i in range(members):
            leaves, comes = stages[i, n], stages[i, n + 1]
            while leaves < comes and np.all(points[leaves + 1] == points[leaves]):
                leaves += 1
            while comes > leaves and np.all(points[comes - 1] == points[comes]):
                comes -= 1
            if leaves < comes:
                begun[i, n], finished[i, n] = times[leaves], times[comes]
            else:
                finished[i, n] = start if n == 0 else finished[i, n - 1]
                if n > 1:
                    finished[i, n] = max(finished[i, n], finished[:, n - 2].max())
    return begun, finished


@kernel
def find_distances(points: Floats, first: Ints, last: Ints, radii: Floats) -> tuple[Floats, Floats]:
    """How near members with bodies can come to each other.

    Args:
        points: (p, 2) float, metres.
        first: (k, w) int, see above.
        last: (k, w) int.
        radii: (k,) float, metres.

    Returns:
        distances: (k, k, w) float, metres, of members i > j; inf where they are farther apart than both radii together,
            or one has no body.
        places: (k, k, w, 2) float, metres: of i where it is so near.

    Complexity: O(k² w) where all keep clear of each other, else O(m²) more for pieces of m points each.
    """
    members, windows = first.shape
    distances = np.full((members, members, windows), np.inf)
    places = np.full((members, members, windows, 2), np.nan)
    bounds = _bound(points, first, last)
    for i in range(members):
        for j in range(i):
            reach = radii[i] + radii[j]
            if min(radii[i], radii[j]) == 0.0:
                continue
            for w in range(windows):
                a, b = bounds[i, w], bounds[j, w]
                if a[0] - b[1] > reach or b[0] - a[1] > reach or a[2] - b[3] > reach or b[2] - a[3] > reach:
                    continue
                for s in range(first[i, w], max(first[i, w] + 1, last[i, w])):
                    for t in range(first[j, w], max(first[j, w] + 1, last[j, w])):
                        p, r, q, u = (
                            points[s],
                            points[min(s + 1, last[i, w])],
                            points[t],
                            points[min(t + 1, last[j, w])],
                        )
                        distance, x, y = approach(p[0], p[1], r[0], r[1], q[0], q[1], u[0], u[1])
                        if distance < distances[i, j, w]:
                            distances[i, j, w], places[i, j, w, 0], places[i, j, w, 1] = distance, x, y
    return distances, places


@kernel
def _bound(points: Floats, first: Ints, last: Ints) -> Floats:
    """Least and greatest x, least and greatest y of every piece: (k, w, 4)."""
    bounds = np.empty((*first.shape, 4))
    for i in range(first.shape[0]):
        for w in range(first.shape[1]):
            piece = points[first[i, w] : last[i, w] + 1]
            bounds[i, w, 0], bounds[i, w, 1] = piece[:, 0].min(), piece[:, 0].max()
            bounds[i, w, 2], bounds[i, w, 3] = piece[:, 1].min(), piece[:, 1].max()
    return bounds


@kernel
def find_link(points: Floats, first: Ints, last: Ints, i: int, j: int, walls: Floats) -> Bools:
    """In which windows all of the piece of i certainly sees all of that of j: (w,) bool."""
    held = np.empty(first.shape[1], np.bool_)
    for w in range(first.shape[1]):
        p, q = points[first[i, w] : last[i, w] + 1], points[first[j, w] : last[j, w] + 1]
        held[w] = see_throughout(p, q, walls)
    return held


@kernel
def find_networks(points: Floats, first: Ints, last: Ints, asked: Ints, walls: Floats) -> tuple[Ints, Ints]:
    """Which members are joined in each window, by links that hold wherever they are.

    No more links are looked at than it takes to join those asked for: first those that did it in the window before,
    then the shortest.

    Args:
        points: (p, 2) float, metres.
        first: (k, w) int, see above.
        last: (k, w) int.
        asked: members to be joined.
        walls: (v, 2, 2) float, metres: receded.

    Returns:
        parts: (w, k) int: the lowest member of the part of each; where those asked for are joined, others need not be.
        links: (w, k - 1, 2) int: a forest that joins the parts, −1 where it has fewer.

    Complexity: O(k² w log k), and in each window O(k) links to look at where the last ones hold, else O(k²).
    """
    members, windows = first.shape
    parts = np.empty((windows, members), np.int64)
    links = np.full((windows, members - 1, 2), -1, np.int64)
    bounds = _bound(points, first, last)
    number = members * (members - 1) // 2
    pairs, spans = np.empty((number, 2), np.int64), np.empty(number)
    for w in range(windows):
        n = 0
        for i in range(members):
            for j in range(i):
                a, b = bounds[i, w], bounds[j, w]
                pairs[n, 0], pairs[n, 1] = j, i
                spans[n] = math.hypot(a[0] + a[1] - b[0] - b[1], a[2] + a[3] - b[2] - b[3])
                n += 1
        order = pairs[np.argsort(spans)]
        if w > 0:
            order = np.concatenate((links[w - 1], order))
        root = np.arange(members)
        found = 0
        for i, j in order:
            if i < 0 or root[i] == root[j]:
                continue
            p, q = points[first[i, w] : last[i, w] + 1], points[first[j, w] : last[j, w] + 1]
            if not see_throughout(p, q, walls):
                continue
            low, high = min(root[i], root[j]), max(root[i], root[j])
            root[root == high] = low
            links[w, found, 0], links[w, found, 1] = i, j
            found += 1
            if np.all(root[asked] == root[asked[0]]):
                break
        parts[w] = root
    return parts, links
