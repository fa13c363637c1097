"""Schedules: k members go along given paths, and who waits for whom keeps them apart and the team connected.

Paths are cut into elements (`planning.path_elements`). Of every pair of elements it is known whether robots there are
apart and whether they see each other throughout (`planning.pair_tables`). A search finds in which order the members
advance (`planning.order_search`), and that order becomes stages that run as much in parallel as can be
(`planning.staging`). Pieces are long at first; they are halved where that finds nothing, or where members have to wait.

Thesis §4.3.2–4.3.5; beyond it: connection by any links, stages instead of a clock, and a search for eight robots and
more.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.environment import Environment
from planning.motion_plan import Schedule
from planning.no_schedule import NoSchedule
from planning.obstruction import find_obstruction
from planning.order_search import Order, order_in_time, search_order
from planning.pair_tables import PairTables, make_tables
from planning.path_elements import PathElements, cut_path
from planning.schedule_request import Member, ScheduleRequest, read_request
from planning.staging import choose_cuts, time_stages

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LONGEST_PIECE_M: Final = 1.0
"""Of paths, metres, at first."""

HALVINGS: Final = 2
"""How often pieces may be halved."""

MOST_STATES: Final = 20_000
"""Of the search with each length of pieces."""

TOUCHING_M: Final = 1e-9
"""Robots that overlap by less touch, where there is no map whose tolerance says so."""

WAITING: Final = 1.02
"""Times as long as the slowest member takes alone: a schedule that takes no longer is not tried to be shortened."""


def schedule(
    paths: Sequence[ArrayLike],
    radius_m: ArrayLike,
    env: Environment | None = None,
    links: Sequence[tuple[Member, Member]] | None = None,
    *,
    joined: Collection[Member] | None = None,
    members: Sequence[str] | None = None,
    speed_m_s: ArrayLike = 1.0,
    unscheduled: Collection[Member] = (),
    search: Literal["order", "grid"] = "order",
) -> Schedule:
    """Who goes when, so that no two collide and the team stays connected, whoever is late.

    Members only go forward along their paths, and the paths are taken to keep clear of walls.

    Args:
        paths: k arrays (m, 2) float, metres, map frame; a single point is a member that stands.
        radius_m: of the discs, one or (k,). A member of radius 0 is in nobody's way.
        env: the map as drawn, through which members see each other. None: nobody asks for sight.
        links: pairs of members, by name or row, that must see each other throughout; an empty list asks for no
            connection. None, with a map and without ``joined``: the whole team must be one network, by any links.
        joined: members that must be in one network throughout, over any others.
        members: k different names; "0", "1", … if not given.
        speed_m_s: the greatest speeds, one or (k,), positive and finite.
        unscheduled: members that go along their paths as they please: they may be anywhere on them at any time.
        search: "order", or "grid": the thesis' A* on the grid of box limits, complete on it, for few robots.

    Returns:
        A schedule in stages from 0 s on (for "grid" one that is bound to the clock), as early as its stages allow.

    Raises:
        InvalidSchedule: arguments that make no sense.
        NoSchedule: no way was found; it names a pair to blame and holds the best effort. It is ``proven`` if there is
            none over pieces as short as are tried.

    Complexity: O(k² n²) for n pieces of each path where members go on together or a proof says that they cannot, which
        is mostly so; the search in between is bounded.
    """
    request = read_request(paths, radius_m, env, links, joined, members, speed_m_s, unscheduled)
    if search == "grid":
        from planning.grid_schedule import grid_schedule

        return grid_schedule(
            request.paths,
            request.radii_m,
            env,
            request.links,
            joined=request.joined,
            members=request.members,
            speed_m_s=request.speeds_m_s,
            unscheduled=request.anywhere,
        )
    if search != "order":
        raise ValueError(f"there is no search {search!r}: use 'order' or 'grid'")
    driving = [i for i in range(len(request.members)) if i not in request.anywhere]
    alone = max((_measure(request.paths[i]) / float(request.speeds_m_s[i]) for i in driving), default=0.0)
    best: tuple[float, Schedule] | None = None
    for halvings in range(HALVINGS + 1):
        attempt = _attempt(request, halvings)
        for found in attempt.schedules():
            ends = max((float(found.paths[i].times_s[-1]) for i in driving), default=0.0)
            if ends <= WAITING * alone:
                return found
            if best is None or ends < best[0]:
                best = ends, found
    if best is None:
        raise attempt.refuse()
    return best[1]


def _measure(path: Floats) -> float:
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


@dataclass(frozen=True, slots=True, eq=False)
class _Attempt:
    """What came of a request with pieces of one length."""

    request: ScheduleRequest
    elements: list[PathElements]
    tables: PairTables
    last: Ints
    durations: Floats
    order: Order

    def schedules(self) -> Iterator[Schedule]:
        """Those that get everybody to its goal; the second takes longer to find than it mostly wins."""
        if self.order.complete:
            yield self.execute(self.order.states)
            states = order_in_time(self.tables, self.request.demand, self.durations, self.last)
            if np.array_equal(states[-1], self.last):
                yield self.execute(states)

    def execute(self, states: Ints) -> Schedule:
        """An order in stages."""
        request = self.request
        cuts = np.zeros(2, dtype=np.int64)
        if len(states) > 1:
            cuts = choose_cuts(states, self.tables, request.demand)
        paths, stages = time_stages(states[cuts], self.elements, request.speeds_m_s, request.anywhere)
        anywhere = [request.members[i] for i in request.anywhere]
        return Schedule(request.members, paths, request.radii_m, request.speeds_m_s, stages, anywhere)

    def refuse(self) -> NoSchedule:
        """Why the order is not complete."""
        names = self.request.members
        blamed = find_obstruction(self.order, names, self.elements, self.tables, self.request.demand, self.last)
        between = None if blamed.between is None else (names[blamed.between[0]], names[blamed.between[1]])
        return NoSchedule(blamed.text, self.execute(self.order.states), between, proven=self.order.proven)


def _attempt(request: ScheduleRequest, halvings: int) -> _Attempt:
    demand = request.demand
    elements = [cut_path(path, LONGEST_PIECE_M, halvings) for path in request.paths]
    separations = request.radii_m[:, None] + request.radii_m
    separations[np.minimum(request.radii_m[:, None], request.radii_m) == 0.0] = 0.0
    walls = request.env.walls if request.env is not None and (demand.joined or demand.links.any()) else None
    tolerance_m = TOUCHING_M if request.env is None else request.env.tolerance_m
    tables = make_tables(elements, separations, request.anywhere, walls, tolerance_m)
    last = np.array([path.pieces for path in elements], dtype=np.int64)
    last[request.anywhere] = 0
    durations = np.zeros((len(elements), max(1, int(last.max()))))
    for i in np.flatnonzero(last):
        durations[i, : last[i]] = np.hypot(*np.diff(elements[i].nodes, axis=0).T) / request.speeds_m_s[i]
    order = search_order(tables, demand, durations, last, MOST_STATES)
    return _Attempt(request, elements, tables, last, durations, order)
