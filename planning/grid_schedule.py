"""The thesis' way of scheduling, with the bodies and the sight that there truly are: search on the grid of box limits.

The grid of the coordination diagram is searched completely (`planning.diagram_search`), so if the search ends and finds
nothing there is no schedule on the grid. It grows exponentially with the number of robots: this is for a few of them,
and for judging what scales better.

Within boxes robots are judged piece by piece (`planning.diagram_pieces`). If long pieces do not do, they are cut into
shorter ones.

Where sight is asked for, paths are also cut at *critical points*, where a robot comes in sight of another that stands
at one of its limits, or goes out of it (`planning.visible_interval`); and robots see each other on two pieces only if
they do throughout. Thesis §4.3.5 takes visibility cells for that (`planning.hybrid_schedule`), which forbid more.

Thesis §4.3.2–4.3.3.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.coordination_diagram import CoordinationDiagram, Pair, measure_path
from planning.diagram_pieces import DiagramPieces
from planning.diagram_schedule import Team, schedule_in
from planning.environment import Environment
from planning.motion_plan import Schedule
from planning.no_schedule import NoSchedule
from planning.visible_interval import visible_intervals

Floats = NDArray[np.float64]

LONGEST_PIECES_M: Final = (np.inf, 1.0)
"""Tried one after the other."""

MOST_NODES: Final = 1_000_000
"""Successors, of the search with each length of pieces."""


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
    refusal = None
    for longest_m in LONGEST_PIECES_M:
        cuts = [np.append(_divide(path, longest_m), at) for path, at in zip(points, critical, strict=True)]
        diagram = CoordinationDiagram.of(points, radius_m, cuts_m=cuts, anywhere=unscheduled)
        pieces = DiagramPieces(diagram)
        diagram = replace(diagram, collides=pieces.find_collisions(radius_m))
        if env is not None and pairs:
            diagram = diagram.with_sight({pair: pieces.find_sight(pair, env) for pair in pairs}, required, together)
        try:
            return schedule_in(diagram, team, most_nodes)
        except NoSchedule as error:
            refusal = error
    assert refusal is not None
    raise refusal


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
