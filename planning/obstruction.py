"""Whom to blame where members cannot get to the ends of their paths: two of them, and where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.order_search import Order
from planning.pair_prospects import OPEN, find_isolation, find_seen, mark_prospects
from planning.pair_tables import APART, SEES, PairTables
from planning.path_elements import PathElements
from planning.step_rules import Demand

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Obstruction:
    """Two members by row, None where no two can be named, and one sentence about them."""

    between: tuple[int, int] | None
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class _Scene:
    names: Sequence[str]
    elements: Sequence[PathElements]
    tables: PairTables
    demand: Demand
    last: Ints

    def place(self, i: int, element: int) -> str:
        """A place on an element, in words."""
        nodes = self.elements[i].nodes
        x, y = 0.5 * (nodes[element // 2] + nodes[(element + 1) // 2])
        return f"({x:.4g}, {y:.4g})"

    def gap(self, i: int, j: int, element: int) -> float:
        """How far the path of member j is from an element of member i, about."""
        return float(np.hypot(*(self.elements[j].nodes - self.elements[i].nodes[element // 2]).T).min())

    def lacks(self, i: int, j: int, element: int, other: int, bit: int) -> bool:
        return not int(self.tables.table(i, j)[element, other]) & bit


def find_obstruction(
    order: Order,
    names: Sequence[str],
    elements: Sequence[PathElements],
    tables: PairTables,
    demand: Demand,
    last: Ints,
) -> Obstruction:
    """Why an order is not complete.

    Args:
        order: the best that was found.
        names: of the k members.
        elements: of their paths.
        tables: of all pairs.
        demand: what has to be connected.
        last: (k,) int: each member's last node.
    """
    scene = _Scene(names, elements, tables, demand, last)
    return (
        _find_at_start(scene)
        or _find_in_the_way(scene)
        or _find_isolated(scene)
        or _find_closed(scene, order.closed)
        or _find_at_end(scene, order.states[-1])
    )


def _find_at_start(scene: _Scene) -> Obstruction | None:
    k = len(scene.names)
    for i in range(k):
        for j in range(i):
            one, other = scene.names[j], scene.names[i]
            if scene.lacks(i, j, 0, 0, APART):
                text = f"{one} at {scene.place(j, 0)} and {other} at {scene.place(i, 0)} overlap at the start"
                return Obstruction((j, i), text)
            if scene.demand.links[i] >> j & 1 and scene.lacks(i, j, 0, 0, SEES):
                text = f"{one} at {scene.place(j, 0)} does not see {other} at {scene.place(i, 0)} at the start"
                return Obstruction((j, i), text)
    joined = [i for i in range(k) if scene.demand.joined >> i & 1]
    part = set(joined[:1])
    while True:
        near = {j for i in part for j in range(k) if j not in part and not scene.lacks(i, j, 0, 0, SEES)}
        if not near:
            break
        part |= near
    outside = [i for i in joined if i not in part]
    if not outside:
        return None
    j, i = min(((j, i) for i in outside for j in part), key=lambda pair: scene.gap(pair[0], pair[1], 0))
    text = (
        f"{scene.names[j]} at {scene.place(j, 0)} and {scene.names[i]} at {scene.place(i, 0)} are not in one network "
        "at the start"
    )
    return Obstruction((j, i), text)


def _find_in_the_way(scene: _Scene) -> Obstruction | None:
    """Two members whose bodies block each other, or who must see each other and cannot, whoever goes first."""
    links = np.zeros_like(scene.demand.links)
    for required, bit, why in (
        (links, APART, "are in each other's way, whichever goes first"),
        (scene.demand.links, SEES, "would have to part, whichever goes first"),
    ):
        bits = scene.tables.bits & np.uint8(APART | SEES)
        closed = mark_prospects(bits, scene.tables.starts, scene.tables.sizes, scene.last, 0, required)
        for i, j in closed.tolist():
            table = scene.tables.table(j, i)
            element = int(np.argmax((table & bit == 0).any(axis=1)))
            return Obstruction((j, i), f"{scene.names[j]} near {scene.place(j, element)} and {scene.names[i]} {why}")
    return None


def _find_isolated(scene: _Scene) -> Obstruction | None:
    """A member that goes where it cannot be joined with the others, wherever these are, and who saw it last."""
    seen = find_seen(scene.tables.bits, scene.tables.starts, scene.tables.sizes)
    i, element = find_isolation(seen, scene.tables.sizes, scene.demand.joined)
    if i < 0:
        return None
    witnesses = [
        [j for j in range(len(scene.names)) if seen[i, e] >> j & 1] for e in range(max(element - 1, 0), -1, -1)
    ]
    saw = next((members for members in witnesses if members), [j for j in range(len(scene.names)) if j != i])
    j = min(saw, key=lambda j: scene.gap(i, j, element))
    text = (
        f"{scene.names[i]} and {scene.names[j]} would have to part where {scene.names[i]} comes to "
        f"{scene.place(i, element)}: from nowhere on the others' paths is there a connection to that"
    )
    return Obstruction((i, j), text)


def _find_closed(scene: _Scene, closed: Ints) -> Obstruction | None:
    """Two members that cannot keep in touch over the others, wherever these are."""
    for i, j in closed.tolist():
        seen = scene.tables.table(j, i) & SEES != 0
        element = int(np.argmin(seen.any(axis=1)))
        text = (
            f"{scene.names[j]} and {scene.names[i]} would have to part on their ways, about where {scene.names[j]} is "
            f"at {scene.place(j, element)}, whichever goes first and wherever the others are"
        )
        return Obstruction((j, i), text)
    return None


def _find_at_end(scene: _Scene, state: Ints) -> Obstruction:
    """What stops a member at the end of an order: one in its way, or one that it would part from."""
    k = len(scene.names)
    waiting = [i for i in range(k) if state[i] < scene.last[i]]
    at = 2 * state
    for bit, why in (
        (APART, "are in each other's way"),
        (OPEN, "would block each other"),
        (SEES, "would have to part"),
    ):
        for i in waiting:
            ahead = int(at[i]) + (2 if bit == OPEN else 1)
            found = [j for j in range(k) if j != i and scene.lacks(i, j, ahead, int(at[j]), bit)]
            if bit == SEES:
                found = [j for j in found if not scene.lacks(i, j, int(at[i]), int(at[j]), SEES)]
            if found:
                j = min(found, key=lambda j: scene.gap(i, j, int(at[i])))
                return Obstruction(
                    (i, j),
                    f"{scene.names[i]} on its way from {scene.place(i, int(at[i]))} and {scene.names[j]} at "
                    f"{scene.place(j, int(at[j]))} {why} in every order that was tried",
                )
    return Obstruction(None, "the members do not get to the ends of their paths in any order that was tried")
