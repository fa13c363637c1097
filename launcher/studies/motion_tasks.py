"""Random successive deployments on the thesis' maps: who is where, who goes where, and who sees whom.

A base, an agent and robots are deployed on cells at the least cost, by the exact search. Then the agent goes to another
random place, or to one that it sees, and the team is redeployed: metres driven and μ times the links, least over all
trees (thesis eq. 42). The next redeployment sets out from there; after some of them a new walk begins with a new base.
All k members are in the tree; those that are not needed stand where they cost least.

Several members may share a placement. Who stays in its placement stays where it is; others take the placement's own
position, or the nearest place beside it that is free: in the same cell, from where linked members see each other
whatever the place; beside a point, where they do.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from launcher.studies.redeployment_runs import RADIUS_M, TRIES, NothingToJoin
from planning import PlacementGraph, redeploy
from planning.tree import Ints

Floats = NDArray[np.float64]

WALK = 10
"""Redeployments with one base."""

APART_M = 2.0 * RADIUS_M + 0.02
"""Between the places where two members stand, at least."""

REACH = 3
"""Places in a cell are sought so many steps of that width around its position."""


@dataclass(frozen=True, slots=True)
class Question:
    """What is asked of a map, again and again."""

    nodes: int
    """k: base, agent and robots."""
    mu_m: float = 25.0
    """Metres that a robot goes for one unit of virtual weight. With the 5 m of the study of redeployments hardly any
    robot moves: the agent's new place is seen by one of those that are spread over the map."""
    near: bool = False
    """The agent goes to places that it sees, and not anywhere."""
    governed: bool = True
    """The agent moves by the schedule, and belongs to the network. Else it goes as it pleases: robots only avoid it."""


@dataclass(frozen=True, slots=True, eq=False)
class MotionTask:
    """One redeployment.

    Attributes:
        starts: (k, 2) float, metres, map frame: base, agent and robots where they stand.
        goals: (k, 2) float, metres: where they go; the base stays.
        tree: (k − 1, 2) int: who sees whom before.
        next_tree: the same afterwards.
    """

    starts: Floats
    goals: Floats
    tree: Ints
    next_tree: Ints


class Rooms:
    """Where members can stand in the placements of a graph: at their positions, and beside them.

    Args:
        graph: the placements.
    """

    def __init__(self, graph: PlacementGraph) -> None:
        self._graph = graph
        self._free = graph.free.polygon
        shapely.prepare(self._free)
        around = APART_M * np.stack(np.meshgrid(*2 * [np.arange(-REACH, REACH + 1)]), axis=-1).reshape(-1, 2)
        self._around = around[np.argsort(np.hypot(*around.T), kind="stable")]
        self._places: dict[int, Floats] = {}

    def find(self, placement: int, taken: Sequence[Floats]) -> Iterator[Floats]:
        """Places (2,), metres, in a placement, away from all that are taken, the nearest to its position first."""
        if placement not in self._places:
            self._places[placement] = self._look_around(placement)
        for place in self._places[placement]:
            if all(np.hypot(*(place - other)) >= APART_M for other in taken):
                yield place

    def _look_around(self, placement: int) -> Floats:
        """The placement's own position, then others beside it: (n, 2)."""
        places: Floats = self._graph.positions[placement] + self._around
        points = shapely.points(places)
        inside = np.asarray(shapely.covers(self._free, points))
        if self._graph.kind == "cells":
            inside &= shapely.covers(shapely.Polygon(self._graph.outlines[self._graph.cells[placement]]), points)
        inside[0] = True  # which may lie on the border
        return places[inside]


def draw_tasks(graph: PlacementGraph, question: Question, number: int, seed: int) -> Iterator[MotionTask]:
    """Random redeployments, always the same for the same arguments.

    Args:
        graph: the placements.
        question: how many nodes, and how they are sent.
        number: of redeployments.
        seed: of the random places.

    Raises:
        NothingToJoin: hardly any places could be joined, or had room for all.
    """
    rng = np.random.default_rng([seed, question.nodes, question.near])
    rooms = Rooms(graph)
    standing: _Standing | None = None
    drawn = 0
    for _ in range(TRIES * number):
        if standing is None or drawn % WALK == 0:
            standing = _deploy_anew(graph, rooms, question, rng)
            if standing is None:
                continue
        choices = np.flatnonzero(graph.visible[standing.cells[1]]) if question.near else np.arange(len(graph))
        after = _redeploy(graph, rooms, standing, int(rng.choice(choices)), question.mu_m)
        if after is None:
            continue
        yield MotionTask(standing.places, after.places, standing.tree, after.tree)
        standing, drawn = after, drawn + 1
        if drawn == number:
            return
    raise NothingToJoin(
        f"{question.nodes} nodes join hardly any places of the map {graph.environment.name!r}, or have no room there: "
        "ask for more, or for another map"
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Standing:
    """A deployment: the placement of each node, where exactly it stands, and the tree."""

    cells: Ints
    places: Floats
    tree: Ints


def _deploy_anew(graph: PlacementGraph, rooms: Rooms, question: Question, rng: np.random.Generator) -> _Standing | None:
    """Base, agent and robots from random places; None where these cannot be joined or do not fit."""
    team = rng.integers(0, len(graph), question.nodes)
    if not 0 <= graph.relays_from(graph.positions[team[0]])[team[1]] - 1 <= question.nodes - 2:
        return None
    return _settle(graph, rooms, graph.distances[team], team[:2], None, question.mu_m)


def _redeploy(graph: PlacementGraph, rooms: Rooms, standing: _Standing, agent: int, mu_m: float) -> _Standing | None:
    """The same team after its agent has gone elsewhere; None where it cannot be joined or does not fit."""
    base = standing.cells[0]
    if (
        agent in standing.cells[:2]
        or not 0 <= graph.relays_from(graph.positions[base])[agent] - 1 <= len(standing.cells) - 2
    ):
        return None
    move = np.array([graph.distances_from(place) for place in standing.places])
    return _settle(graph, rooms, move, np.array([base, agent]), standing, mu_m)


def _settle(
    graph: PlacementGraph, rooms: Rooms, move: Floats, ends: Ints, standing: _Standing | None, mu_m: float
) -> _Standing | None:
    """The least costly deployment with base and agent in these placements, and places for all."""
    move[:2] = np.where(np.arange(len(graph)) == ends[:, None], 0.0, np.inf)
    found = redeploy(move, graph.weights, mu_m)
    if found.tree is None:
        return None
    places: list[Floats | None] = [None] * len(move)
    if standing is not None:
        places = [
            place if before == cell else None
            for before, place, cell in zip(standing.cells, standing.places, found.cells, strict=True)
        ]
    for node, cell in enumerate(found.cells.tolist()):
        if places[node] is None:
            partners = found.tree[(found.tree == node).any(axis=1)].sum(axis=1) - node
            seen = [place for place in (places[partner] for partner in partners) if place is not None]
            free = rooms.find(cell, [place for place in places if place is not None])
            places[node] = next((place for place in free if _sees_all(graph, place, seen)), None)
            if places[node] is None:
                return None
    chosen = np.array(places)
    if not all(_sees_all(graph, chosen[u], [chosen[v]]) for u, v in found.tree):
        return None  # two that stay beside their points
    return _Standing(found.cells, chosen, found.tree)


def _sees_all(graph: PlacementGraph, place: Floats, others: Sequence[Floats]) -> bool:
    return all(graph.environment.line_of_sight(tuple(place), tuple(other)) for other in others)
