"""Random redeployments on the thesis' maps, each planned by every search.

Base, agents and robots are at random places, and the team is deployed at the least cost, by the exact search: that is
the deployment before. Then every agent is at a random place again, the base stays, and the team is redeployed: each
robot pays its geodesic way in metres, each link μ times its virtual weight (thesis eq. 42). Robots that are not needed
stay in the tree. Places that k nodes cannot join, before or after, are drawn again.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

import maps
from launcher.studies.thesis_tables import Kind
from planning import Environment, PlacementGraph, decompose, mutual_visibility, redeploy
from planning.edge_modification import best_modification
from planning.known_topology import place_nodes
from planning.min_plus import Links, scaled_links
from planning.redeployment import EXACT_STATES
from planning.redeployment_bound import count_nodes, relax
from planning.tree import Ints

Floats = NDArray[np.float64]

GROUNDS: tuple[tuple[str, Kind], ...] = (
    ("room1", "aspect"),
    ("room2", "aspect"),
    ("room3", "aspect"),
    ("cityblocks", "inflection"),
    ("maze", "inflection"),
    ("l457", "inflection"),
    ("l457mod", "aspect"),
)
"""The finest decomposition of each map that the thesis used."""

RADIUS_M = 0.2
"""Of the robots."""

MU_M = 5.0
"""μ: metres that a robot goes for one unit of virtual weight; a link has 1.01 to 2.01."""

SEARCHES = ("exact", "one-edge", "one-edge, repeated", "fixed")

TRIES = 2000
"""Draws after which places that k nodes can join are given up on."""


class NothingToJoin(ValueError):
    """Hardly any places on this map can be joined by so few nodes; the text says where."""


@dataclass(frozen=True, slots=True)
class Question:
    """What is asked of a map, again and again."""

    nodes: int
    """k: base, agents and robots."""
    agents: int = 1
    mu_m: float = MU_M
    near: bool = False
    """Agents go where they see from where they are, and not anywhere."""
    idle: bool = False
    """Robots that are not needed need not stay in the tree; before, they were all in it."""

    @property
    def ends(self) -> list[int]:
        """Nodes that have to be in the tree."""
        return list(range(1 + self.agents if self.idle else self.nodes))


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """One redeployment."""

    before: Ints
    """(k,) int: where base, agents and robots stand."""
    tree: Ints
    """(k − 1, 2) int: who sees whom."""
    move: Floats
    """(k, N) float, metres: what it costs each to go where; base and agents have one place each."""
    drawn: int
    """Draws of places until this one could be joined."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What all searches made of one task."""

    costs: Mapping[str, float]
    """Metres; inf where none was found."""
    seconds: Mapping[str, float]
    """Of processor time; the links are made beforehand, as they do not change."""
    drawn: int


def load_ground(name: str, kind: Kind | None) -> PlacementGraph:
    """The placements of a map: those of its cells, or points where no kind of cell is named."""
    environment = Environment.load(maps.path(name))
    if kind is None:
        return PlacementGraph.from_points(environment, RADIUS_M)
    cells = decompose(environment, kind)
    return PlacementGraph.from_cells(cells, mutual_visibility(cells), environment, RADIUS_M)


def draw_tasks(ground: PlacementGraph, question: Question, number: int, seed: int) -> Iterator[Task]:
    """Random redeployments, always the same for the same arguments.

    Raises:
        NothingToJoin: of :data:`TRIES` draws none could be joined.
    """
    rng = np.random.default_rng([seed, question.nodes, question.agents])
    places, fixed = len(ground), 1 + question.agents
    for _ in range(number):
        for drawn in range(1, TRIES + 1):
            before = rng.choice(places, fixed, replace=False)
            after = before.copy()
            for agent in range(1, fixed):
                choices = np.flatnonzero(ground.visible[before[agent]]) if question.near else np.arange(places)
                after[agent] = rng.choice(choices[choices != before[0]])
            team = np.concatenate((before, rng.integers(0, places, question.nodes - fixed)))
            start = redeploy(_terminals(before, ground.distances[team]), ground.weights, question.mu_m)
            if start.tree is None:
                continue
            move = _terminals(after, ground.distances[start.cells])
            if np.isfinite(redeploy(move, ground.weights, question.mu_m).cost):
                yield Task(start.cells, start.tree, move, drawn)
                break
        else:
            raise NothingToJoin(
                f"{question.nodes} nodes join hardly any places of the map {ground.environment.name!r}: ask for more"
            )


def answer(task: Task, ends: list[int], links: Links, priced: Floats) -> Answer:
    """Plan a redeployment by every search.

    Args:
        task: the redeployment.
        ends: nodes that have to be in the tree.
        links: of the placements.
        priced: (N, N) float: μ W, which the links are made of.
    """
    prices = np.zeros(len(task.move))
    searches: dict[str, Callable[[], float]] = {
        "exact": lambda: relax(links, task.move, count_nodes(task.move, ends, EXACT_STATES), prices).bound,
        "one-edge": partial(_search_one_edge, task, ends, links, priced, False),
        "one-edge, repeated": partial(_search_one_edge, task, ends, links, priced, True),
        "fixed": lambda: _cost(task.move, priced, place_nodes(links, task.move, task.tree, ends)),
    }
    costs, seconds = {}, {}
    for name, search in searches.items():
        begin = time.thread_time()
        costs[name] = search()
        seconds[name] = time.thread_time() - begin
    return Answer(costs, seconds, task.drawn)


def answer_all(ground: PlacementGraph, question: Question, number: int, seed: int) -> list[Answer]:
    """Draw some redeployments and plan each by every search."""
    links = scaled_links(ground.weights, question.mu_m)
    priced = question.mu_m * ground.weights
    tasks = list(draw_tasks(ground, question, number, seed))
    answer(tasks[0], question.ends, links, priced)  # caches are cold
    return [answer(task, question.ends, links, priced) for task in tasks]


def _search_one_edge(task: Task, ends: list[int], links: Links, priced: Floats, repeated: bool) -> float:
    """Algorithm 7 from the present tree; repeated, until no modification is cheaper."""
    cost, tree = best_modification(links, task.move, task.tree, ends)
    while repeated:
        better, tree = best_modification(links, task.move, tree, ends)
        repeated, cost = better < cost, better
    return _cost(task.move, priced, place_nodes(links, task.move, tree, ends))


def _cost(move: Floats, priced: Floats, placed: tuple[Ints, Ints] | None) -> float:
    """Ways and links of a tree whose nodes are placed; inf if they could not be."""
    if placed is None:
        return np.inf
    tree, cells = placed
    nodes = np.flatnonzero(cells >= 0)
    return float(move[nodes, cells[nodes]].sum() + priced[cells[tree[:, 0]], cells[tree[:, 1]]].sum())


def _terminals(places: Ints, move: Floats) -> Floats:
    """Costs of moving (k, N), with the first nodes bound to these places."""
    move[: len(places)] = np.where(np.arange(move.shape[1]) == places[:, None], 0.0, np.inf)
    return move
