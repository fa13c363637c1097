"""Deployments D = (V, E, m): a structure of relations between team members, and where it is mapped to.

Thesis §3.3. V are the members, E ⊆ V × V their relations (lines of sight), m maps members into cells. A deployment is
mutually visible if (V, E) is connected and every edge joins cells that see each other. With one agent and one base
station the shortest path between their cells solves it (§3.3.2): the cells in between are where the relays go.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from planning.shortest_paths import NoPath, from_source, path

NO_CHAIN = -1
"""In counts of relays: no number of relays makes a chain."""


class NoChain(ValueError):
    """No chain of relays joins the base station and the agent; the text says why."""


class TooFewRobots(ValueError):
    """There are fewer robots than places, or too few that can get there."""


@dataclass(frozen=True, slots=True)
class Deployment:
    """D = (V, E, m) of thesis §3.3, with its virtual cost."""

    nodes: tuple[str, ...]
    """V: names of the members."""
    edges: tuple[tuple[str, str], ...]
    """E: pairs of members that are to see each other."""
    cells: tuple[int, ...]
    """m: the cell of each node, in the order of ``nodes``."""
    cost: float
    """Sum of the virtual weights of the edges."""


def shortest_path_deployment(
    W: NDArray[np.float64], base_cell: int, agent_cell: int, placements: NDArray[np.bool_] | None = None
) -> Deployment:
    """The cheapest chain between a base station and an agent (thesis §3.3.2).

    Args:
        W: (N, N) float, virtual weights, inf where cells do not see each other.
        base_cell: cell of the base station.
        agent_cell: cell of the agent; that of the base station gives a chain without relays.
        placements: (N,) bool: cells that a relay can stand in. None: all.

    Returns:
        Nodes ``base``, ``relay1`` …, ``agent`` in the order of the chain, joined each to the next.

    Raises:
        NoChain: the two cells are not joined through cells that relays can stand in.

    Complexity: O(N² + N log N).
    """
    _check_cells(len(W), base_cell, agent_cell)
    distances, predecessors = from_source(W, base_cell, placements)
    if base_cell == agent_cell:
        return Deployment(("base", "agent"), (("base", "agent"),), (base_cell, agent_cell), 0.0)
    try:
        cells = path(predecessors, base_cell, agent_cell)
    except NoPath:
        raise NoChain(
            f"no chain of relays joins the base's cell {base_cell} to the agent's cell {agent_cell}"
        ) from None
    nodes = ("base", *(f"relay{place}" for place in range(1, len(cells) - 1)), "agent")
    return Deployment(nodes, tuple(pairwise(nodes)), tuple(cells), float(distances[agent_cell]))


def relays_needed(
    W: NDArray[np.float64], base_cell: int, placements: NDArray[np.bool_] | None = None
) -> NDArray[np.int32]:
    """The fewest relays of a chain from the base station to an agent in each cell.

    The greatest of them is what the map can ask for: the eccentricity of the base's cell, less one.

    Args:
        W: (N, N) float as in :func:`shortest_path_deployment`; only whether a weight is finite matters.
        base_cell: cell of the base station.
        placements: (N,) bool: cells that a relay can stand in. None: all.

    Returns:
        (N,) int32; :data:`NO_CHAIN` for cells that no chain reaches.

    Complexity: O(N²), breadth first.
    """
    _check_cells(len(W), base_cell)
    visible = np.isfinite(W)
    usable = np.ones(len(W), dtype=np.bool_) if placements is None else np.asarray(placements, dtype=np.bool_)
    needed = np.full(len(W), NO_CHAIN, dtype=np.int32)
    needed[base_cell] = 0
    frontier = visible[base_cell] & (needed == NO_CHAIN)
    relays = 0
    while frontier.any():
        needed[frontier] = relays
        relays += 1
        frontier = visible[frontier & usable].any(axis=0) & (needed == NO_CHAIN)
    return needed


def identify_robots(costs: NDArray[np.float64]) -> NDArray[np.int64]:
    """Which robot goes to which place, so that the costs add up to the least (thesis §3.4, optimal identification).

    Args:
        costs: (k, n) float: what it costs robot i to go to place j; inf where it cannot.

    Returns:
        (n,) int: the robot of each place; all different.

    Raises:
        TooFewRobots: fewer robots than places, or no complete assignment of finite cost.

    Complexity: O(k n²).
    """
    costs = np.asarray(costs, dtype=np.float64)
    robots, places = costs.shape
    if robots < places:
        raise TooFewRobots(f"{places} places need as many robots, and there are {robots}: {places - robots} too few")
    try:
        chosen, filled = linear_sum_assignment(costs)
    except ValueError:
        raise TooFewRobots(f"no assignment of {robots} robots fills all of the {places} places") from None
    by_place = np.empty(places, dtype=np.int64)
    by_place[filled] = chosen
    return by_place


def _check_cells(number: int, *cells: int) -> None:
    for cell in cells:
        if not 0 <= cell < number:
            raise NoChain(f"cell {cell} does not exist: there are {number}, and -1 means outside the map")
