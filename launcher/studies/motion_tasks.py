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

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from launcher.standing_room import overlapping, stand_apart
from launcher.studies.redeployment_runs import RADIUS_M, TRIES, NothingToJoin
from planning import PlacementGraph, redeploy
from planning.tree import Ints

Floats = NDArray[np.float64]

WALK = 10
"""Redeployments with one base."""

ROOM_M = RADIUS_M + 0.01
"""Half the distance between the places where two members stand, at least."""


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
    standing: _Standing | None = None
    drawn = 0
    for _ in range(TRIES * number):
        if standing is None or drawn % WALK == 0:
            standing = _deploy_anew(graph, question, rng)
            if standing is None:
                continue
        choices = np.flatnonzero(graph.visible[standing.cells[1]]) if question.near else np.arange(len(graph))
        after = _redeploy(graph, standing, int(rng.choice(choices)), question.mu_m)
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


def _deploy_anew(graph: PlacementGraph, question: Question, rng: np.random.Generator) -> _Standing | None:
    """Base, agent and robots from random places; None where these cannot be joined or do not fit."""
    team = rng.integers(0, len(graph), question.nodes)
    if not 0 <= graph.relays_from(graph.positions[team[0]])[team[1]] - 1 <= question.nodes - 2:
        return None
    return _settle(graph, graph.distances[team], team[:2], None, question.mu_m)


def _redeploy(graph: PlacementGraph, standing: _Standing, agent: int, mu_m: float) -> _Standing | None:
    """The same team after its agent has gone elsewhere; None where it cannot be joined or does not fit."""
    base = standing.cells[0]
    if (
        agent in standing.cells[:2]
        or not 0 <= graph.relays_from(graph.positions[base])[agent] - 1 <= len(standing.cells) - 2
    ):
        return None
    move = np.array([graph.distances_from(place) for place in standing.places])
    return _settle(graph, move, np.array([base, agent]), standing, mu_m)


def _settle(
    graph: PlacementGraph, move: Floats, ends: Ints, standing: _Standing | None, mu_m: float
) -> _Standing | None:
    """The least costly deployment with base and agent in these placements, and places for all."""
    move[:2] = np.where(np.arange(len(graph)) == ends[:, None], 0.0, np.inf)
    found = redeploy(move, graph.weights, mu_m)
    tree = found.tree
    if tree is None:
        return None
    places = graph.positions[found.cells]
    stay = np.zeros(len(places), dtype=np.bool_)
    if standing is not None:
        stay = standing.cells == found.cells
        places = np.where(stay[:, None], standing.places, places)

    def fits(node: int, place: Floats, chosen: Floats) -> bool:
        """In its cell it sees all that it has to; beside a point that is to be seen."""
        if not graph.free.contains(place[None])[0]:
            return False
        if graph.kind == "cells":
            cell = shapely.Polygon(graph.outlines[graph.cells[found.cells[node]]])
            return bool(shapely.covers(cell, shapely.Point(place)))
        return _sees_all(graph, place, chosen[tree[(tree == node).any(axis=1)].sum(axis=1) - node])

    places = stand_apart(places, np.flatnonzero(stay).tolist(), np.full(len(places), ROOM_M), fits)
    joined = all(_sees_all(graph, places[u], places[v : v + 1]) for u, v in tree)
    if not joined or any(overlapping(places, np.full(len(places), RADIUS_M))):
        return None
    return _Standing(found.cells, places, tree)


def _sees_all(graph: PlacementGraph, place: Floats, others: Floats) -> bool:
    return bool(np.all(graph.environment.line_of_sight(place[None], others)))
