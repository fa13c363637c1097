"""Sequences of deployments D_0, D_1, …: which robot becomes which in the next, and what all of it costs.

Thesis §3.4. A step from one deployment to the next moves robots, and robots can take each other's places. The physical
cost of a step is that of the cheapest identification of the robots before with those after (eq. 38), an assignment
problem. A sequence costs

    C = C_p + μ C_v = Σ C_p(D_i, D_{i+1}) + μ Σ C_v(D_i)                                       (eq. 39–41)

Base stations and agents keep their names. They move on their own account, so their ways are not counted; eq. 38 counts
and exchanges all nodes alike, while algorithm 4 gives terminals no physical cost.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from planning.deployment import IDLE, Deployment, InvalidDeployment, TooFewRobots, identify_robots

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class DeploymentSequence:
    """Deployments of one team, in each of which a name stands for the same robot, and what they cost."""

    deployments: tuple[Deployment, ...]
    virtual_costs: tuple[float, ...]
    """C_v(D_i) (eq. 37); as many as deployments."""
    physical_costs: tuple[float, ...]
    """C_p(D_i, D_{i+1}) (eq. 38); one less."""
    mu: float
    """μ ≥ 0: what virtual costs count beside physical ones."""

    @property
    def virtual_cost(self) -> float:
        """C_v of the sequence (eq. 39)."""
        return sum(self.virtual_costs)

    @property
    def physical_cost(self) -> float:
        """C_p of the sequence (eq. 40)."""
        return sum(self.physical_costs)

    @property
    def total_cost(self) -> float:
        """C of the sequence (eq. 41); inf if a deployment is not mutually visible, whatever μ."""
        return self.physical_cost + (self.mu * self.virtual_cost if np.isfinite(self.virtual_cost) else np.inf)


def physical_cost(before: Deployment, after: Deployment, W_p: Floats) -> float:
    """C_p(D_i, D_j), what a step costs at least when every robot may take any robot's place (thesis eq. 38).

    Args:
        before: all of its robots are in a cell.
        after: of the same base stations and agents; what its robots are called does not matter.
        W_p: (N, N) float: [u, v] is what it costs a robot in u to go to v; inf where it cannot.

    Returns:
        inf if the robots of ``before`` are too few, or cannot get there.

    Raises:
        InvalidDeployment: base stations and agents differ, or a robot of ``before`` is in no cell.

    Complexity: O(k³) for k robots.
    """
    _check_members(before, after)
    try:
        return identify_deployment(after, _stand(before), W_p)[1]
    except TooFewRobots:
        return float("inf")


def identify_deployment(after: Deployment, standing: Mapping[str, int], W_p: Floats) -> tuple[Deployment, float]:
    """Which robot goes where in the next deployment, so that all of them move at the least cost (thesis eq. 38).

    Args:
        after: what its robots are called does not matter, nor how many of them idle.
        standing: the cell that each robot of the team is in.
        W_p: as for :func:`physical_cost`.

    Returns:
        ``after`` with the team's names for its robots, those idle that it does not need, and what the step costs.

    Raises:
        TooFewRobots: ``after`` has more places for robots than there are robots that can get there.

    Complexity: O(k³) for k robots.
    """
    places = [node for node in after.robots if after.cell_of(node) != IDLE]
    team = list(standing)
    costs = W_p[np.ix_(list(standing.values()), [after.cell_of(node) for node in places])]
    chosen = identify_robots(costs)
    names = {node: node for node in after.nodes if node not in after.robots}
    names |= {node: team[robot] for node, robot in zip(places, chosen, strict=True)}
    idle = [robot for robot in team if robot not in names.values()]
    identified = Deployment(
        (*names.values(), *idle),
        tuple((names[a], names[b]) for a, b in after.edges),
        (*(after.cell_of(node) for node in names), *(IDLE for _ in idle)),
        tuple(team),
    )
    return identified, float(costs[chosen, np.arange(len(places))].sum())


def identify_sequence(deployments: Sequence[Deployment], W: Floats, W_p: Floats, mu: float = 1.0) -> DeploymentSequence:
    """Deployments as steps of one team, each identified with the one before, and their costs (thesis eq. 37–41).

    If no robot ever idles, no other identification of any step makes the sequence cheaper. A robot that idles stays
    where it was last.

    Args:
        deployments: of the same base stations and agents. The first names the robots, all of which are in a cell; what
            the others call theirs does not matter.
        W: (N, N) float, virtual weights.
        W_p: as for :func:`physical_cost`.
        mu: μ, at least 0.

    Raises:
        InvalidDeployment: there is no deployment, base stations and agents differ, or a robot of the first one is in no
            cell.
        TooFewRobots: a deployment needs more robots than the first one has, or robots cannot get there.
        ValueError: μ is negative or not finite.

    Complexity: O(n k³) for n deployments.
    """
    if not 0 <= mu < np.inf:
        raise ValueError(f"μ weighs virtual costs and is at least 0 and finite, not {mu}")
    if not deployments:
        raise InvalidDeployment("a sequence has at least one deployment; none was given")
    for before, after in pairwise(deployments):
        _check_members(before, after)
    standing = _stand(deployments[0])
    identified, moved = [deployments[0]], []
    for deployment in deployments[1:]:
        named, cost = identify_deployment(deployment, standing, W_p)
        standing |= {robot: named.cell_of(robot) for robot in named.robots if named.cell_of(robot) != IDLE}
        identified.append(named)
        moved.append(cost)
    virtual = tuple(deployment.virtual_cost(W) for deployment in identified)
    return DeploymentSequence(tuple(identified), virtual, tuple(moved), mu)


def _stand(deployment: Deployment) -> dict[str, int]:
    """The cell of each robot."""
    standing = {robot: deployment.cell_of(robot) for robot in deployment.robots}
    for robot, cell in standing.items():
        if cell == IDLE:
            raise InvalidDeployment(
                f"robot {robot!r} idles before the step, so nobody knows where: give it a cell and an edge"
            )
    return standing


def _check_members(before: Deployment, after: Deployment) -> None:
    fixed = [sorted(set(deployment.nodes) - set(deployment.robots)) for deployment in (before, after)]
    if fixed[0] != fixed[1]:
        raise InvalidDeployment(
            f"one deployment joins {', '.join(fixed[0])}, the next {', '.join(fixed[1])}: only robots are exchangeable"
        )
