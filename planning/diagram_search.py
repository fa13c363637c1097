"""A* in the coordination diagram of a team, on the grid of its limits, along straight lines.

From a grid point any set of robots may go on to their next limits together, or one may go back to its last. The moves
of single robots alone reach whatever can be reached on the grid; those together save time. But the pieces of a grid are
of all lengths, and robots that cross one piece each at a time wait for each other at every limit. So this is Theta*: A*
that tries, for every point that it comes to, the straight line in the diagram from the point where it last turned, on
which all robots go evenly, and takes that where it is free.

The cost of a line is the time of the robot that takes longest. The heuristic is the time that the slowest needs for
what is left of its path: never more than it takes, so what costs no more than that at the start is the best there is.
Else the schedule found need not be the fastest, for Theta* looks at lines between some grid points only. It is complete
as A* is: if the search ends without a way, there is none on the grid.

Thesis §4.3.3, where cost and heuristic are Euclidean in the diagram; a team is as late as its last, so here it is time.
Theta*: Daniel, Nash, Koenig and Felner, https://doi.org/10.1613/jair.2994.
"""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heappop, heappush
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.coordination_diagram import CoordinationDiagram
from planning.diagram_lines import admits, line_is_free, measure_left, span
from planning.kernel import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_FOUND: Final = 0
_EXHAUSTED: Final = 1
_GAVE_UP: Final = 2

_SAME: Final = 1e-6
"""Of the time that the slowest needs at least: costs nearer to each other than this are equal, and the point that is
nearer to the goal goes first."""


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """What a search found: a way of straight lines through the diagram.

    Attributes:
        turns: (n, k) int: the limit of each robot at each of n ≥ 1 turns, the first at the start.
        complete: whether it leads to the goal; else it leads to the point looked at that has least left to go, all
            robots together.
        exhausted: whether the search saw all that can be reached, so that no way leads to the goal if none was found.
    """

    turns: Ints
    complete: bool
    exhausted: bool


def search_diagram(diagram: CoordinationDiagram, speeds_m_s: ArrayLike, most_nodes: int, haste: float = 0.0) -> Route:
    """A way from the start of all paths to the end of all.

    Args:
        diagram: of k robots; the start must be allowed.
        speeds_m_s: (k,) float, above 0: of each robot.
        most_nodes: the search is given up after this many successors, whether they were known or not.
        haste: how much of the time that robots have left on average, if none waits, is added to the heuristic. With
            more than 0 far fewer points are looked at where robots have to wait, and the way may take longer.

    Complexity: O(2^k k²) for each grid point looked at, of which there can be as many as the product of the numbers of
    limits; lines between turns as long as a path cost O(k² n).
    """
    k = len(diagram)
    limits = np.concatenate(diagram.limits_m)
    firsts = np.cumsum([0, *map(len, diagram.limits_m)], dtype=np.int64)
    starts = np.zeros((k, k), dtype=np.int64)
    blocked, seen = [np.zeros(0, dtype=np.bool_)], [np.zeros(0, dtype=np.bool_)]
    total = 0
    for pair, table in diagram.blocked.items():
        starts[pair] = total
        total += table.size
        blocked.append(table.ravel())
        seen.append(diagram.seen[pair].ravel() if diagram.joined else blocked[0])
    joined = np.zeros(k, dtype=np.bool_)
    joined[list(diagram.joined)] = True
    status, turns = _search(
        limits,
        firsts,
        1.0 / np.array(speeds_m_s, dtype=np.float64),
        starts,
        np.concatenate(blocked),
        np.concatenate(seen),
        joined,
        most_nodes,
        haste / k,
    )
    return Route(turns, status == _FOUND, status == _EXHAUSTED)


@kernel
def _find_slot(at: Ints, points: Ints, slots: Ints) -> int:
    """Where a grid point (k,) is in a hash table of rows of ``points``, or the empty slot (−1) where it belongs."""
    code = 1469598103934665603
    for i in range(at.shape[0]):
        code = (code ^ at[i]) * 1099511628211
    slot = (code ^ (code >> 29)) & (slots.shape[0] - 1)
    while slots[slot] >= 0:
        row = points[slots[slot]]
        same = True
        for i in range(at.shape[0]):
            same = same and row[i] == at[i]
        if same:
            break
        slot = (slot + 1) & (slots.shape[0] - 1)
    return int(slot)


@kernel
def _double(
    points: Ints, costs: Floats, turned_at: Ints, done: Bools, known: int
) -> tuple[Ints, Floats, Ints, Bools, Ints]:
    """Room for twice as many points, and their hash table."""
    size, k = 2 * points.shape[0], points.shape[1]
    more_points, more_costs = np.zeros((size, k), np.int64), np.zeros(size)
    more_turned_at, more_done = np.zeros(size, np.int64), np.zeros(size, np.bool_)
    slots = np.empty(4 * size, np.int64)
    for slot in range(4 * size):
        slots[slot] = -1
    for point in range(known):
        for i in range(k):
            more_points[point, i] = points[point, i]
        more_costs[point], more_turned_at[point], more_done[point] = costs[point], turned_at[point], done[point]
        slots[_find_slot(more_points[point], more_points, slots)] = point
    return more_points, more_costs, more_turned_at, more_done, slots


@kernel
def _move(move: int, at: Ints, last: Ints, following: Ints, elements: Ints) -> bool:
    """Write where a move leads from ``at`` (k,), and the elements on the way; whether there is such a move.

    Moves below 2^m are the subsets of the m robots that are not at their last limits, who go on; those above are single
    robots that go back.
    """
    going = 0
    for i in range(at.shape[0]):
        following[i], elements[i] = at[i], 2 * at[i]
        if at[i] < last[i]:
            if (move >> going) & 1:
                following[i], elements[i] = at[i] + 1, 2 * at[i] + 1
            going += 1
    if move < 1 << going:
        return True
    back = move - (1 << going)
    for i in range(at.shape[0]):
        following[i], elements[i] = at[i], 2 * at[i]
    following[back], elements[back] = at[back] - 1, 2 * at[back] - 1
    return bool(at[back] > 0)


@kernel
def _search(
    limits: Floats, firsts: Ints, pace: Floats, starts: Ints, blocked: Bools, seen: Bools, joined: Bools, most: int,
    haste: float,
) -> tuple[int, Ints]:  # fmt: skip
    """`search_diagram`: how it ended, and the turns (n, k).

    Args:
        limits: (l,) of all robots, one after the other, metres.
        firsts: (k + 1,) where those of each begin.
        pace: (k,) seconds a metre.
        starts: (k, k), for i < j, where the table of a pair begins in ``blocked`` and ``seen`` (t,).
        blocked: see `CoordinationDiagram`.
        seen: empty if nobody is to be joined.
        joined: (k,) who is.
        most: successors.
        haste: part of the time that all robots have left that is added to the heuristic.
    """
    k = pace.shape[0]
    last = firsts[1:] - firsts[:-1] - 1
    sizes = 2 * last + 1
    following, elements, on_line, part = (
        np.empty(k, np.int64), np.empty(k, np.int64), np.empty(k, np.int64), np.empty(k, np.int64)
    )  # fmt: skip
    points, costs = np.zeros((256, k), np.int64), np.zeros(256)
    turned_at, done = np.zeros(256, np.int64), np.zeros(256, np.bool_)
    slots = np.full(1024, -1)
    slots[_find_slot(points[0], points, slots)] = 0
    known, successors = 1, 0
    unit = _SAME * span(points[0], last, limits, firsts, pace) + 1e-300
    nearest, least_left = 0, measure_left(points[0], limits, firsts, pace)
    waiting = [(0, least_left, 0)]
    status = _EXHAUSTED
    while len(waiting) > 0:
        _, left, point = heappop(waiting)
        if done[point]:
            continue
        done[point] = True
        if left < least_left:
            nearest, least_left = point, left
        going = 0
        for i in range(k):
            going += 1 if points[point, i] < last[i] else 0
        if going == 0:
            nearest, status = point, _FOUND
            break
        if successors > most:
            break
        for move in range(1, (1 << going) + k):
            successors += 1
            if successors > most:
                break
            if not _move(move, points[point], last, following, elements):
                continue
            slot = _find_slot(following, points, slots)
            target = slots[slot]
            if target >= 0 and done[target]:
                continue
            if not admits(elements, sizes, starts, blocked, seen, joined, part):
                continue
            if target < 0:
                if known == len(points):
                    points, costs, turned_at, done, slots = _double(points, costs, turned_at, done, known)
                    slot = _find_slot(following, points, slots)
                target = known
                known += 1
                slots[slot] = target
                for i in range(k):
                    points[target, i] = following[i]
                costs[target] = np.inf
            turn = turned_at[point]
            cost = costs[turn] + span(points[turn], following, limits, firsts, pace)
            if cost < costs[target] and not line_is_free(
                points[turn], following, limits, firsts, sizes, starts, blocked, seen, joined, on_line, part
            ):
                turn = point
                cost = costs[point] + span(points[point], following, limits, firsts, pace)
            if cost < costs[target]:
                costs[target], turned_at[target] = cost, turn
                left = measure_left(following, limits, firsts, pace)
                expected = cost + span(following, last, limits, firsts, pace) + haste * left
                heappush(waiting, (int(expected / unit), left, target))
    if status != _FOUND and successors > most:
        status = _GAVE_UP
    turns = 1
    point = nearest
    while point != 0:
        turns += 1
        point = turned_at[point]
    route = np.zeros((turns, k), np.int64)
    point = nearest
    for turn in range(turns - 1, 0, -1):
        for i in range(k):
            route[turn, i] = points[point, i]
        point = turned_at[point]
    return status, route
