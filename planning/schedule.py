"""Schedules: k members go along given paths, and who waits for whom keeps them apart and the team connected.

Paths are cut into elements (`planning.path_elements`); of every pair of elements it is known whether robots there are
apart and whether they see each other throughout (`planning.pair_tables`); a search finds in which order the members
advance (`planning.order_search`); and that order becomes stages that run as much in parallel as can be
(`planning.staging`). Pieces are long at first and shorter where that does not do.

Thesis §4.3.2–4.3.5; beyond it: connection by any links, stages instead of a clock, and a search for eight robots and
more.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.environment import Environment
from planning.motion_plan import InvalidSchedule, Schedule
from planning.no_schedule import NoSchedule
from planning.order_search import Demand, Order, search_order
from planning.pair_tables import APART, SEES, PairTables, make_tables
from planning.path_elements import PathElements, cut_path
from planning.staging import choose_cuts, time_stages

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

Search = Literal["order", "grid"]
Member = str | int

LONGEST_PIECES_M: Final = (0.5, 0.25)
"""Of paths, metres: tried one after the other."""

MOST_STATES: Final = 50_000
"""Of the search with each length of pieces."""

TOUCHING_M: Final = 1e-9
"""Robots that overlap by less touch, where there is no map whose tolerance says so."""

MOST_MEMBERS: Final = 62
"""Sets of members are bits of a 64-bit number."""


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
    search: Search = "order",
) -> Schedule:
    """Who goes when, so that no two collide and the team stays connected, whoever is late.

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
        InvalidSchedule: names, radii, speeds or links that do not fit the paths.
        NoSchedule: no way was found; it names a pair to blame and holds the best effort.
    """
    task = _Task(paths, radius_m, env, links, joined, members, speed_m_s, unscheduled)
    if search == "grid":
        raise ValueError("the search on the grid is not there yet")
    if search != "order":
        raise ValueError(f"there is no search {search!r}: use 'order' or 'grid'")
    refusal = None
    for longest_m in LONGEST_PIECES_M:
        try:
            return task.solve(longest_m)
        except NoSchedule as error:
            refusal = error
    assert refusal is not None
    raise refusal


class _Task:
    """The arguments of `schedule`, read."""

    def __init__(
        self,
        paths: Sequence[ArrayLike],
        radius_m: ArrayLike,
        env: Environment | None,
        links: Sequence[tuple[Member, Member]] | None,
        joined: Collection[Member] | None,
        members: Sequence[str] | None,
        speed_m_s: ArrayLike,
        unscheduled: Collection[Member],
    ) -> None:
        k = len(paths)
        self.names = [str(i) for i in range(k)] if members is None else list(members)
        if not 0 < k <= MOST_MEMBERS or len(self.names) != k:
            raise InvalidSchedule(
                f"a schedule of {k} paths for {len(self.names)} members: give as many, at most {MOST_MEMBERS}"
            )
        self.paths = [self._read_path(path, name) for path, name in zip(paths, self.names, strict=True)]
        self.radii = self._spread(radius_m, "radius", 0.0)
        self.speeds = self._spread(speed_m_s, "greatest speed", np.finfo(float).tiny)
        self.anywhere = sorted({self._find(member) for member in unscheduled})
        self.env = env
        self.demand = self._read_demand(links, joined)

    def _read_path(self, path: ArrayLike, name: str) -> Floats:
        points = np.array(path, dtype=np.float64, order="C").reshape(-1, 2)
        if len(points) == 0 or not np.isfinite(points).all():
            raise InvalidSchedule(f"the path of {name} has no points, or one that is not finite: give metres")
        return points

    def _spread(self, given: ArrayLike, name: str, least: float) -> Floats:
        values = np.array(given, dtype=np.float64)
        if values.shape not in {(), (len(self.names),)} or not (values >= least).all() or np.isinf(values).any():
            raise InvalidSchedule(
                f"the {name} of {len(self.names)} members is given as {values.tolist()}: give one finite number that is not "
                "negative, of speeds not 0 either, or one for each member"
            )
        return np.array(np.broadcast_to(values, len(self.names)))

    def _find(self, member: Member) -> int:
        if isinstance(member, str):
            if member in self.names:
                return self.names.index(member)
        elif 0 <= member < len(self.names):
            return int(member)
        raise InvalidSchedule(f"{member!r} is no member of the schedule: it has {', '.join(self.names)}")

    def _read_demand(self, links: Sequence[tuple[Member, Member]] | None, joined: Collection[Member] | None) -> Demand:
        if self.env is None and (links or joined):
            raise InvalidSchedule("members are asked to see each other on no map: give an environment")
        together = 0
        if joined is not None:
            together = sum(1 << i for i in {self._find(member) for member in joined})
        elif links is None and self.env is not None:
            together = (1 << len(self.names)) - 1
        required = np.zeros(len(self.names), dtype=np.int64)
        for one, other in links or ():
            i, j = self._find(one), self._find(other)
            if i != j:
                required[i] |= 1 << j
                required[j] |= 1 << i
        return Demand(together, required)

    @property
    def asks_for_sight(self) -> bool:
        return self.demand.joined != 0 or bool(self.demand.links.any())

    def solve(self, longest_m: float) -> Schedule:
        """The schedule with pieces no longer than that."""
        elements = [cut_path(path, longest_m) for path in self.paths]
        tolerance = TOUCHING_M if self.env is None else self.env.tolerance_m
        separations = self.radii[:, None] + self.radii
        separations[np.minimum(self.radii[:, None], self.radii) == 0.0] = 0.0
        walls = self.env.walls if self.env is not None and self.asks_for_sight else None
        tables = make_tables(elements, separations, self.anywhere, walls, tolerance)
        last = np.array([path.pieces for path in elements], dtype=np.int64)
        last[self.anywhere] = 0
        durations = np.zeros((len(elements), max(1, int(last.max()))))
        for i, path in enumerate(elements):
            if last[i] > 0:
                durations[i, : last[i]] = np.hypot(*np.diff(path.nodes, axis=0).T) / self.speeds[i]
        order = search_order(tables, self.demand, durations, last, MOST_STATES)
        found = self._execute(order, elements, tables)
        if order.complete:
            return found
        between, text = self._blame(order, elements, tables, last)
        raise NoSchedule(text, found, between)

    def _execute(self, order: Order, elements: Sequence[PathElements], tables: PairTables) -> Schedule:
        cuts = choose_cuts(order.states, tables, self.demand) if len(order.states) > 1 else np.zeros(2, np.int64)
        paths, stages = time_stages(order.states[cuts], elements, self.speeds, self.anywhere)
        return Schedule(self.names, paths, self.radii, self.speeds, stages, [self.names[i] for i in self.anywhere])

    def _blame(
        self, order: Order, elements: Sequence[PathElements], tables: PairTables, last: Ints
    ) -> tuple[tuple[str, str] | None, str]:
        """The pair that keeps the members from going on at the end of an order, and a sentence about it."""
        state = order.states[-1]
        places = [path.nodes[node] for path, node in zip(elements, state, strict=True)]
        waiting = [int(i) for i in np.flatnonzero(state < last)]
        for i in waiting or range(len(state)):
            for j in range(len(state)):
                if j != i and not tables.table(i, j)[2 * state[i] + (i in waiting), 2 * state[j]] & APART:
                    return self._name(i, j), (
                        f"{self.names[i]} at {_name_place(places[i])} and {self.names[j]} at {_name_place(places[j])} "
                        "are in each other's way"
                    )
        for i in waiting or range(len(state)):
            lost = [
                j
                for j in range(len(state))
                if j != i and not tables.table(i, j)[2 * state[i] + (i in waiting), 2 * state[j]] & SEES
            ]
            if lost:
                j = min(lost, key=lambda j: float(np.hypot(*(places[j] - places[i]))))
                return self._name(i, j), (
                    f"{self.names[i]} at {_name_place(places[i])} and {self.names[j]} at {_name_place(places[j])} "
                    "would have to part"
                )
        return None, "no order was found in which the members can go along their paths"

    def _name(self, i: int, j: int) -> tuple[str, str]:
        return self.names[i], self.names[j]


def _name_place(place: Floats) -> str:
    return f"({place[0]:.4g}, {place[1]:.4g})"
