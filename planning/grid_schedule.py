"""The thesis' way of scheduling, with the sight that there truly is: search on the grid of box limits.

The grid of the coordination diagram is searched completely (`planning.diagram_search`), so if the search ends and finds
nothing there is no schedule on the grid. It grows exponentially with the number of robots: this is for a few of them,
and for judging what scales better.

A box is larger than the region in it. Of two robots that follow each other along a corridor it is all of the corridor,
and the second waits until the first is out of it. So paths are cut into short pieces as well, whose boxes are small.

Where sight is asked for, paths are also cut at *critical points*, where a robot comes in sight of another that stands
at one of its limits, or goes out of it (`planning.visible_interval`); and robots see each other on two pieces only if
they do throughout. Thesis §4.3.5 takes visibility cells for that (`planning.hybrid_schedule`), which forbid more.

Thesis §4.3.2–4.3.3.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.coordination_diagram import CoordinationDiagram, Pair, measure_path
from planning.diagram_schedule import Team, schedule_in
from planning.environment import Environment
from planning.motion_plan import Schedule
from planning.no_schedule import NoSchedule
from planning.pair_sight import mark_sight
from planning.visible_interval import visible_intervals

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

LONGEST_PIECES_M: Final = (np.inf, 1.0)
"""Tried one after the other, unless nobody has to wait; the earlier end counts."""

MOST_NODES: Final = 1_000_000
"""Successors, of the search with each length of pieces."""

_NO_LATER: Final = 1e-9
"""Of the time that the slowest robot needs: what rounding may add."""


def grid_schedule(
    paths: Sequence[ArrayLike],
    radius_m: Floats,
    env: Environment | None = None,
    links: Collection[Pair] | None = None,
    *,
    joined: Collection[int] | None = None,
    members: Sequence[str],
    speed_m_s: Floats,
    unscheduled: Collection[int] = (),
    most_nodes: int = MOST_NODES,
) -> Schedule:
    """A schedule of k robots on given paths, by search on the grid of their coordination diagram.

    Args:
        paths: k arrays (m, 2) float, metres, map frame; a single point is a robot that stands.
        radius_m: (k,) float; a robot of radius 0 is in nobody's way.
        env: the map as drawn, through which robots see each other. None: nobody asks for sight.
        links: pairs of rows that must see each other throughout; empty: no connection is asked for. None, with a map
            and without ``joined``: the whole team must be one network, by any links.
        joined: rows that must be in one network throughout, over any others.
        members: k names.
        speed_m_s: (k,) float, positive and finite.
        unscheduled: rows of robots that may be anywhere on their paths at any time.
        most_nodes: of the search with each length of pieces; see `planning.diagram_search.search_diagram`.

    Returns:
        A schedule that is bound to the clock, from 0 s on.

    Raises:
        NoSchedule: none exists on the grid (``proven``), or the search was given up.

    Complexity: exponential in k.
    """
    team = Team(members, radius_m, speed_m_s, unscheduled)
    points = [np.array(path, dtype=np.float64).reshape(-1, 2) for path in paths]
    required, together = choose_demand(len(points), env is not None, links, joined)
    pairs = list(combinations(range(len(points)), 2)) if together else sorted(required)
    critical: list[Floats] = [np.zeros(0) for _ in points]
    if env is not None and pairs:
        bends = [measure_path(path) for path in points]
        coarse = CoordinationDiagram.of(points, radius_m, cuts_m=bends, anywhere=unscheduled)
        critical = _find_critical_points(coarse, env, pairs, bends)
    fastest = max(float(measure_path(path)[-1]) / speed for path, speed in zip(points, speed_m_s, strict=True))
    found: list[Schedule] = []
    refusals: list[NoSchedule] = []
    for longest_m in LONGEST_PIECES_M:
        cuts = [np.append(_divide(path, longest_m), at) for path, at in zip(points, critical, strict=True)]
        diagram = CoordinationDiagram.of(points, radius_m, cuts_m=cuts, anywhere=unscheduled)
        if env is not None and pairs:
            seen = {pair: _find_sight(diagram, env, pair) for pair in pairs}
            diagram = diagram.with_sight(seen, required, together)
        try:
            found.append(schedule_in(diagram, team, most_nodes))
        except NoSchedule as refusal:
            refusals.append(refusal)
        if found and found[-1].end_s <= fastest * (1.0 + _NO_LATER):
            break
    if not found:
        raise refusals[-1]
    return min(found, key=lambda schedule: schedule.end_s)


def choose_demand(
    robots: int, sight: bool, links: Collection[Pair] | None, joined: Collection[int] | None
) -> tuple[set[Pair], Collection[int]]:
    """The pairs i < j that must see each other, and who must be in one network; see `grid_schedule`."""
    required = {(min(link), max(link)) for link in links or ()}
    if joined is None:
        joined = range(robots) if sight and links is None else ()
    return required, joined if len(joined) > 1 else ()


def _divide(path: Floats, longest_m: float) -> Floats:
    """The bends of a path, and between them cuts into equal pieces that are no longer than that, metres of path."""
    covered = measure_path(path)
    counts = np.maximum(np.ceil(np.diff(covered) / longest_m), 1.0).astype(np.int64)
    cuts = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(covered, covered[1:], counts, strict=False)]
    return np.concatenate([*cuts, covered[-1:]])


def _find_critical_points(
    diagram: CoordinationDiagram, env: Environment, pairs: Collection[Pair], bends: Sequence[Floats]
) -> list[Floats]:
    """Where each robot comes in sight of another that stands at a limit, or goes out of it, metres of path."""
    found: list[list[float]] = [[] for _ in range(len(diagram))]
    for pair in pairs:
        for mover, watcher in (pair, pair[::-1]):
            posts = diagram.places(watcher, np.union1d(diagram.limits_m[watcher], bends[watcher]))
            path = diagram.paths[mover]
            for leg, (start, end) in enumerate(zip(bends[mover], bends[mover][1:], strict=False)):
                for post in posts:
                    shares = visible_intervals(env, path[leg : leg + 2], [post, post]).ravel()
                    found[mover] += [start + share * (end - start) for share in shares if 0.0 < share < 1.0]
    return [np.array(at) for at in found]


def _find_sight(diagram: CoordinationDiagram, env: Environment, pair: Pair) -> Bools:
    """Which elements of two robots i < j see each other throughout: (2 n_i − 1, 2 n_j − 1). All bends are limits."""
    (nodes_i, corners_i), (nodes_j, corners_j) = (_list_nodes(diagram, robot) for robot in pair)
    table = np.zeros((2 * len(nodes_i) - 1, 2 * len(nodes_j) - 1), dtype=np.uint8)
    mark_sight(nodes_i, corners_i, nodes_j, corners_j, env.walls, env.tolerance_m, table, 1)
    for axis, robot in enumerate(pair):
        if len(diagram.limits_m[robot]) == 1:
            table = np.minimum.reduce(table, axis=axis, keepdims=True)
    return table.astype(np.bool_)


def _list_nodes(diagram: CoordinationDiagram, robot: int) -> tuple[Floats, Ints]:
    """Where a robot's limits are (n, 2), metres, and which of them are bends or ends.

    One that may be anywhere has one limit, and all bends of its path are its nodes.
    """
    limits, bends = diagram.limits_m[robot], measure_path(diagram.paths[robot])
    nodes = limits if len(limits) > 1 or bends[-1] == 0.0 else bends
    return diagram.places(robot, nodes), np.unique(np.searchsorted(0.5 * (nodes[1:] + nodes[:-1]), bends))
