"""Steps and sequences of deployments against all ways to identify their robots."""

from __future__ import annotations

from itertools import pairwise, permutations, product

import numpy as np
import pytest
from numpy.typing import NDArray

from planning.deployment import IDLE, Deployment, InvalidDeployment, TooFewRobots
from planning.deployment_sequence import identify_deployment, identify_sequence, physical_cost

Floats = NDArray[np.float64]

CELLS = 8


def _weights(random: np.random.Generator, missing: float = 0.0) -> Floats:
    """Costs between cells, not symmetric, some infinite."""
    costs = random.uniform(0, 10, (CELLS, CELLS))
    costs[random.random(costs.shape) < missing] = np.inf
    np.fill_diagonal(costs, 0.0)
    return costs


def _chain(random: np.random.Generator, robots: tuple[str, ...], used: int | None = None) -> Deployment:
    """Base, some robots in random cells and order, agent; the other robots idle."""
    order = [robots[i] for i in random.permutation(len(robots))]
    placed, idle = order[:used], order[len(order[:used]) :]
    nodes = ("base", *placed, "agent")
    cells = random.integers(0, CELLS, len(nodes)).tolist()
    return Deployment((*nodes, *idle), tuple(pairwise(nodes)), (*cells, *(IDLE for _ in idle)), robots)


def _cells(deployment: Deployment) -> list[int]:
    return [deployment.cell_of(robot) for robot in deployment.robots]


@pytest.mark.parametrize("seed", range(20))
def test_a_step_costs_the_least_of_all_identifications(seed: int) -> None:
    random = np.random.default_rng(seed)
    W_p = _weights(random, missing=0.2)
    before, after = _chain(random, ("a", "b", "c", "d")), _chain(random, ("1", "2", "3", "4"))
    least = min(
        sum(W_p[step] for step in zip(_cells(before), order, strict=True)) for order in permutations(_cells(after))
    )
    assert physical_cost(before, after, W_p) == pytest.approx(least)


@pytest.mark.parametrize("seed", range(10))
def test_names_change_and_nothing_else(seed: int) -> None:
    random = np.random.default_rng(seed)
    W_p = _weights(random)
    standing = dict(zip("abcd", random.integers(0, CELLS, 4).tolist(), strict=True))
    after = _chain(random, ("1", "2", "3"))
    named, cost = identify_deployment(after, standing, W_p)
    assert set(named.robots) == set(standing)
    assert (named.cell_of("base"), named.cell_of("agent")) == (after.cell_of("base"), after.cell_of("agent"))
    ends = [sorted(tuple(sorted((d.cell_of(a), d.cell_of(b)))) for a, b in d.edges) for d in (named, after)]
    assert ends[0] == ends[1]
    moved = {robot: named.cell_of(robot) for robot in named.robots if named.cell_of(robot) != IDLE}
    assert len(moved) == 3
    assert cost == pytest.approx(sum(W_p[standing[robot], cell] for robot, cell in moved.items()))


@pytest.mark.parametrize("seed", range(6))
def test_no_identification_of_any_step_makes_a_sequence_cheaper(seed: int) -> None:
    random = np.random.default_rng(seed)
    W, W_p, mu = _weights(random), _weights(random), 0.7
    deployments = [_chain(random, ("a", "b", "c")) for _ in range(4)]
    found = identify_sequence(deployments, W, W_p, mu)
    least = min(
        sum(
            W_p[step]
            for before, after in pairwise([tuple(_cells(deployments[0])), *orders])
            for step in zip(before, after, strict=True)
        )
        for orders in product(*(permutations(_cells(deployment)) for deployment in deployments[1:]))
    )
    assert found.physical_cost == pytest.approx(least)
    assert found.virtual_cost == pytest.approx(sum(deployment.virtual_cost(W) for deployment in deployments))
    assert found.total_cost == pytest.approx(found.physical_cost + mu * found.virtual_cost)
    # The costs are those of the named robots, and each step's is eq. 38 of that step alone.
    for (before, after), cost in zip(pairwise(found.deployments), found.physical_costs, strict=True):
        assert cost == pytest.approx(sum(W_p[step] for step in zip(_cells(before), _cells(after), strict=True)))
        assert cost == pytest.approx(physical_cost(before, after, W_p))


def test_a_robot_that_idles_stays_where_it_was() -> None:
    """Robot b is needed again where it was left: it is there already."""
    W_p = np.abs(np.subtract.outer(np.arange(8.0), np.arange(8.0)))
    chain = (("base", "a"), ("a", "b"), ("b", "agent"))
    both = Deployment(("base", "a", "b", "agent"), chain, (0, 2, 6, 7), ("a", "b"))
    one = Deployment(("base", "x", "agent"), (("base", "x"), ("x", "agent")), (0, 3, 4), ("x",))
    found = identify_sequence([both, one, both], np.zeros((8, 8)), W_p)
    assert found.physical_costs == (1.0, 1.0)
    assert found.deployments[1].cell_of("a") == 3
    assert found.deployments[1].cell_of("b") == IDLE
    assert found.deployments[2].cell_of("b") == 6


def test_a_hidden_link_costs_everything_whatever_mu() -> None:
    W = np.array([[0.0, np.inf], [np.inf, 0.0]])
    apart = Deployment(("base", "agent"), (("base", "agent"),), (0, 1), ())
    assert identify_sequence([apart], W, W, mu=0.0).total_cost == np.inf


def test_steps_that_no_team_can_take_are_refused() -> None:
    random = np.random.default_rng(1)
    W_p = _weights(random)
    few, many = _chain(random, ("a",)), _chain(random, ("a", "b"))
    assert physical_cost(few, many, W_p) == np.inf
    assert physical_cost(few, few, np.full((CELLS, CELLS), np.inf)) == np.inf
    with pytest.raises(TooFewRobots, match="1 too few"):
        identify_sequence([few, many], W_p, W_p)
    other = Deployment(("base", "a"), (("base", "a"),), (0, 0), ("a",))
    with pytest.raises(InvalidDeployment, match="one deployment joins agent, base, the next base"):
        physical_cost(few, other, W_p)
    with pytest.raises(InvalidDeployment, match="robot 'b' idles before the step"):
        physical_cost(_chain(np.random.default_rng(0), ("b",), used=0), few, W_p)
    with pytest.raises(InvalidDeployment, match="at least one deployment"):
        identify_sequence([], W_p, W_p)
    with pytest.raises(ValueError, match="μ"):
        identify_sequence([few], W_p, W_p, mu=-1.0)
