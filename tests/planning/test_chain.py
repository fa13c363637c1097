"""The cheapest chain against every choice of robots and cells."""

from __future__ import annotations

from itertools import combinations, pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from planning.chain import cheapest_chain

Floats = NDArray[np.float64]

RELAY = 0.25


def _cost(
    W: Floats, move: Floats, from_base: Floats, to_agent: Floats, robots: tuple[int, ...], cells: tuple[int, ...]
) -> float:
    links = from_base[cells[0]] + sum(W[hop] for hop in pairwise(cells)) + to_agent[cells[-1]]
    return float(links + sum(move[robot, cell] + RELAY for robot, cell in zip(robots, cells, strict=True)))


@settings(deadline=None, max_examples=80)
@given(seed=st.integers(0, 2**32 - 1), robots=st.integers(0, 3), share=st.sampled_from([0.2, 0.5, 1.0]))
def test_no_choice_of_robots_and_cells_is_cheaper(seed: int, robots: int, share: float) -> None:
    random = np.random.default_rng(seed)
    number = 5
    W = np.where(random.random((number, number)) < share, random.uniform(1, 3, (number, number)), np.inf)
    W = np.minimum(W, W.T)
    np.fill_diagonal(W, 0.0)
    move = np.where(random.random((robots, number)) < 0.8, random.uniform(0, 4, (robots, number)), np.inf)
    from_base = np.where(random.random(number) < 0.5, random.uniform(1, 3, number), np.inf)
    to_agent = np.where(random.random(number) < 0.5, random.uniform(1, 3, number), np.inf)
    least = min(
        (
            _cost(W, move, from_base, to_agent, chosen, cells)
            for size in range(1, robots + 1)
            for chosen in combinations(range(robots), size)
            for cells in product(range(number), repeat=size)
        ),
        default=np.inf,
    )
    chain = cheapest_chain(W, move, from_base, to_agent, RELAY)
    if np.isinf(least):
        assert chain is None
        return
    assert chain is not None
    assert chain.cost == pytest.approx(least)
    assert list(chain.robots) == sorted(set(chain.robots))
    assert len(set(chain.cells)) == len(chain.cells) == len(chain.robots)
    assert _cost(W, move, from_base, to_agent, chain.robots, chain.cells) == pytest.approx(least)
