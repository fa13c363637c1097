"""Random successive deployments of a team on a map: where each member stands, and its geodesic to the next place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.compiled_map import CompiledMap
from planning.environment import Environment
from planning.placement_graph import PlacementGraph
from planning.redeployment import redeploy

Floats = NDArray[np.float64]

RADIUS_M = 0.2


@dataclass(frozen=True)
class Change:
    """From one deployment to the next."""

    paths: list[Floats]
    """Of base station, agent, and robots, metres."""
    radii: Floats
    tree: NDArray[np.int64]
    """The links that the next deployment stands on."""


def placements_of(environment: Environment, kind: str = "aspect") -> PlacementGraph:
    """Cells of a kind, or points."""
    compiled = CompiledMap(environment, "aspect" if kind == "points" else kind, RADIUS_M)
    return compiled.point_placements() if kind == "points" else compiled.cell_placements


def random_changes(graph: PlacementGraph, members: int, rng: np.random.Generator) -> Iterator[Change]:
    """Base station first, then the agent, then robots: exact deployments, one after the other, without end.

    The agent goes to random placements, and the team redeploys at the least cost. Members that would stand in each
    other's way take the nearest placements in sight of where they should be.
    """
    costs = graph.weights + 0.0
    mu = float(np.median(graph.distances))
    cells = _first(graph, members, rng)
    radii = np.array([0.0] + [RADIUS_M] * (members - 1))
    while True:
        move = graph.distances[cells].copy()
        goal = rng.integers(len(graph))
        for terminal, cell in ((0, cells[0]), (1, goal)):
            move[terminal] = np.inf
            move[terminal, cell] = 0.0
        found = redeploy(move, costs, mu)
        after = None if found.tree is None else _spread(graph, found.cells)
        if after is None:
            cells = _first(graph, members, rng)
            continue
        paths = [
            graph.geodesics.path(graph.positions[a], graph.positions[b]) for a, b in zip(cells, after, strict=True)
        ]
        assert found.tree is not None
        yield Change([p[:1] if np.array_equal(p[0], p[-1]) else p for p in paths], radii, found.tree)
        cells = after


def _first(graph: PlacementGraph, members: int, rng: np.random.Generator) -> NDArray[np.int64]:
    while True:
        move = np.zeros((members, len(graph)))
        for terminal in (0, 1):
            move[terminal] = np.inf
            move[terminal, rng.integers(len(graph))] = 0.0
        found = redeploy(move, graph.weights, 1.0)
        if found.tree is not None:
            after = _spread(graph, found.cells)
            if after is not None:
                return after


def _spread(graph: PlacementGraph, cells: NDArray[np.int64]) -> NDArray[np.int64] | None:
    """Placements in sight of these, each for one member, all apart; the team stays connected. None if it fails."""
    taken: list[int] = []
    apart = 2.0 * RADIUS_M + 0.01
    gaps = np.hypot(*(graph.positions[:, None] - graph.positions).transpose(2, 0, 1))
    for cell in cells:
        free = np.all(gaps[taken] >= apart, axis=0)
        order = np.argsort(gaps[cell])
        chosen = next((int(c) for c in order if free[c] and graph.visible[cell, c]), None)
        if chosen is None or (len(taken) < 2 and chosen != cell):
            return None
        taken.append(chosen)
    seen = graph.environment.visibility_matrix(graph.positions[taken])
    reached = np.linalg.matrix_power(seen.astype(np.int64), len(taken)) > 0
    return np.array(taken) if reached.all() else None
