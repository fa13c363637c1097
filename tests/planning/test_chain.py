"""The cheapest chain against every choice, order and place of robots, and against the recursion without bounds."""

from __future__ import annotations

from itertools import combinations, pairwise, permutations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import planning.chain
from planning.chain import Chain, chain_between, cheapest_chain
from planning.ordered_chain import search_in_order
from tests.benchmarks.chain_cases import least_cost

Floats = NDArray[np.float64]
Question = tuple[Floats, Floats, Floats, Floats, float]

SEEDS = st.integers(0, 2**32 - 1)
SHARES = st.sampled_from([0.1, 0.3, 0.6, 1.0])


def _ask(seed: int, number: int, robots: int, share: float, relay_cost: float = 0.25) -> Question:
    """Arguments of a chain: this share of the links exists, and robots cannot go everywhere (in time)."""
    random = np.random.default_rng(seed)
    W = np.where(random.random((number, number)) < share, random.uniform(0, 3, (number, number)), np.inf)
    W = np.minimum(W, W.T)
    np.fill_diagonal(W, 0.0)
    near = random.uniform(0, 4, number)
    move = np.where(random.random((robots, number)) < 0.7, near + random.uniform(0, 4, (robots, number)), np.inf)
    ends = np.where(random.random((2, number)) < 0.4, random.uniform(0, 3, (2, number)), np.inf)
    return W, move, ends[0], ends[1], relay_cost


def _ask_along_a_corridor(seed: int, robots: int, spare: int) -> Question:
    """A chain that takes nearly all robots, in which the cheapest one would like to stand everywhere."""
    random = np.random.default_rng(seed)
    number = 2 * (robots - spare)
    apart = np.abs(np.subtract.outer(np.arange(number), np.arange(number)))
    W = np.where(apart <= 2, random.uniform(0, 3, (number, number)), np.inf)
    W = np.minimum(W, W.T)
    np.fill_diagonal(W, 0.0)
    move = random.uniform(0, 1, (robots, 1)) * random.uniform(2, 20, (robots, number))
    ends = np.where([np.arange(number) < 2, np.arange(number) >= number - 2], random.uniform(0, 3, (2, number)), np.inf)
    return W, move, ends[0], ends[1], 0.25


def _cost(question: Question, robots: tuple[int, ...], cells: tuple[int, ...]) -> float:
    W, move, from_base, to_agent, relay_cost = question
    links = from_base[cells[0]] + sum(W[hop] for hop in pairwise(cells)) + to_agent[cells[-1]]
    return float(links + sum(move[robot, cell] + relay_cost for robot, cell in zip(robots, cells, strict=True)))


def _check(question: Question, chain: Chain | None) -> None:
    """The chain is one, and costs what it says."""
    if chain is not None:
        assert 0 < len(chain.robots) == len(set(chain.robots)) == len(chain.cells)
        assert np.isfinite(chain.cost)
        assert chain.cost == pytest.approx(_cost(question, chain.robots, chain.cells))
        assert chain.lower_bound <= chain.cost


@settings(max_examples=100)
@given(seed=SEEDS, number=st.integers(1, 5), robots=st.integers(0, 4), share=SHARES)
def test_no_choice_of_robots_order_and_cells_is_cheaper(seed: int, number: int, robots: int, share: float) -> None:
    question = _ask(seed, number, robots, share)
    least = min(
        (
            _cost(question, chosen, cells)
            for size in range(1, robots + 1)
            for chosen in permutations(range(robots), size)
            for cells in product(range(number), repeat=size)
        ),
        default=np.inf,
    )
    chain = cheapest_chain(*question)
    _check(question, chain)
    assert (np.inf if chain is None else chain.cost) == pytest.approx(least)
    if chain is not None:
        assert chain.lower_bound == chain.cost
        assert len(set(chain.cells)) == len(chain.cells)


@settings(max_examples=100)
@given(seed=SEEDS, robots=st.integers(1, 7), share=st.sampled_from([0.05, 0.1, 0.2]), relay=st.sampled_from([0.0, 2.0]))
def test_bounds_leave_nothing_out(seed: int, robots: int, share: float, relay: float) -> None:
    question = _ask(seed, 20, robots, share, relay)
    chain = cheapest_chain(*question)
    _check(question, chain)
    assert (np.inf if chain is None else chain.cost) == pytest.approx(least_cost(*question))


@settings(max_examples=100)
@given(seed=SEEDS, robots=st.integers(2, 7), spare=st.integers(0, 1))
def test_a_chain_that_takes_all_robots(seed: int, robots: int, spare: int) -> None:
    question = _ask_along_a_corridor(seed, robots, spare)
    chain = cheapest_chain(*question)
    _check(question, chain)
    assert (np.inf if chain is None else chain.cost) == pytest.approx(least_cost(*question))


@settings(max_examples=100)
@given(seed=SEEDS, robots=st.integers(1, 4), share=SHARES)
def test_chain_in_order_is_the_cheapest_of_its_order(seed: int, robots: int, share: float) -> None:
    question = _ask(seed, 5, robots, share, relay_cost=0.0)
    W, costs, from_base, to_agent, _ = question
    least = min(
        _cost(question, chosen, cells)
        for size in range(1, robots + 1)
        for chosen in combinations(range(robots), size)
        for cells in product(range(5), repeat=size)
    )
    found = search_in_order(W, costs, from_base, to_agent)
    if found is None:
        assert np.isinf(least)
        return
    robots_found, cells_found, cost = found
    assert robots_found == sorted(set(robots_found))
    assert cost == pytest.approx(least)
    assert cost == pytest.approx(_cost(question, tuple(robots_found), tuple(cells_found)))


@settings(max_examples=100)
@given(seed=SEEDS, robots=st.integers(5, 7), most=st.integers(2, 4), corridor=st.booleans())
def test_more_robots_than_subsets_can_do(seed: int, robots: int, most: int, corridor: bool) -> None:
    """What is said to be proven is; the cost is no more than in order, and the bound below the least."""
    question = _ask_along_a_corridor(seed, robots, robots - most) if corridor else _ask(seed, 16, robots, 0.1)
    W, move, from_base, to_agent, relay_cost = question
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(planning.chain, "MOST_IN_SUBSETS", most)
        chain = cheapest_chain(*question)
    _check(question, chain)
    least = least_cost(*question)
    ordered = search_in_order(W, move + relay_cost, from_base, to_agent)
    if chain is None:
        assert ordered is None
        return
    assert chain.lower_bound <= least + 1e-9
    assert chain.cost >= least - 1e-9
    if ordered is not None:
        assert chain.cost <= ordered[2] + 1e-9
    if chain.lower_bound == chain.cost:
        assert chain.cost == pytest.approx(least)


def test_who_takes_which_place_does_not_depend_on_the_order_of_rows() -> None:
    """Two robots on a line stand the wrong way round for their rows: they do not change places."""
    W = np.full((4, 4), np.inf)
    np.fill_diagonal(W, 0.0)
    for v in range(3):
        W[v, v + 1] = W[v + 1, v] = 1.0
    move = 10.0 * np.abs(np.array([[2.0], [1.0]]) - np.arange(4.0))
    chain = cheapest_chain(W, move, W[0], W[3], 0.0)
    assert chain == Chain((1, 0), (1, 2), 3.0, 3.0)


def test_a_deadline_changes_who_goes_or_leaves_no_chain() -> None:
    """The near robot would go, but for it cannot be in time; then the far one does; then nobody can."""
    W = np.zeros((1, 1))
    link = np.ones(1)
    drive = np.array([[2.0], [5.0]])
    for late, expected in (((), 0), ((0,), 1), ((0, 1), None)):
        move = drive.copy()
        move[list(late)] = np.inf
        chain = cheapest_chain(W, move, link, link, 0.5)
        assert (None if chain is None else chain.robots[0]) == expected


@settings(max_examples=100)
@given(seed=SEEDS, robots=st.integers(2, 5), share=SHARES, fixed=st.booleans())
def test_chain_between_two_of_the_robots(seed: int, robots: int, share: float, fixed: bool) -> None:
    """Ends may have one place (terminals) or several; every order and place of the others in between is dearer."""
    W, move, *_ = _ask(seed, 4, robots, share)
    ends = tuple(np.random.default_rng(seed).permutation(robots)[:2].tolist())
    if fixed:
        for end in ends:
            place = end % 4
            move[end] = np.where(np.arange(4) == place, 0.0, np.inf)
    others = [robot for robot in range(robots) if robot not in ends]

    def cost(chosen: tuple[int, ...], cells: tuple[int, ...]) -> float:
        links = sum(W[hop] for hop in pairwise(cells))
        return float(links + sum(move[robot, cell] for robot, cell in zip(chosen, cells, strict=True)))

    least = min(
        cost((ends[0], *between, ends[1]), cells)
        for size in range(len(others) + 1)
        for between in permutations(others, size)
        for cells in product(range(4), repeat=size + 2)
    )
    chain = chain_between(move, W, ends)
    if chain is None:
        assert np.isinf(least)
        return
    assert (chain.robots[0], chain.robots[-1]) == ends
    assert len(set(chain.robots)) == len(chain.robots) == len(chain.cells)
    assert chain.cost == pytest.approx(least)
    assert chain.lower_bound == chain.cost
    assert cost(chain.robots, chain.cells) == pytest.approx(least)
