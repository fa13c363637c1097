"""Orders, prospects and cuts against plain searches that are complete."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planning.order_search import search_order
from planning.pair_conflicts import find_last_conflicts
from planning.pair_prospects import OPEN, mark_prospects
from planning.pair_tables import SEES
from planning.staging import choose_cuts
from planning.step_rules import Demand, is_joined
from tests.planning.order_oracle import Oracle, random_demand, random_tables

SEARCHED = {3: (8, 116, 204, 414, 680, 874, 1080, 1206), 4: (825, 1135, 1233, 1355, 1467, 1927, 9437)}
"""Seeds, by the number of members, for which going on together ends nowhere, and another order is found."""

IN_VAIN = {4: (9317, 5855, 6471, 9951, 3277, 5711, 9983, 2849, 7641, 8967)}
"""Seeds for which all orders have to be tried, as no pair is to blame."""


def durations_of(last: np.ndarray) -> np.ndarray:
    """A second for every piece."""
    return (np.arange(max(1, last.max())) < last[:, None]).astype(np.float64)


def check_order(seed: int, k: int) -> str:
    """Every step and every two stages are allowed; where no order is found a complete search finds none either."""
    rng = np.random.default_rng([seed, k])
    tables, last = random_tables(k, (0, 0, 12, 9, 6)[k], 3, rng)
    demand = random_demand(k, rng)
    oracle = Oracle(tables, demand, last)
    order = search_order(tables, demand, durations_of(last), last, 100_000)
    states = [tuple(state) for state in order.states.tolist()]
    assert states[0] == (0,) * k
    assert order.complete == (states[-1] == oracle.last)
    assert order.proven == (not order.complete)
    if not order.complete:
        assert not oracle.search()
    if len(states) > 1:
        for before, after in pairwise(states):
            assert before != after
            assert all(a <= b <= a + 1 for a, b in zip(before, after, strict=True))
            assert oracle.allows(before, after)
        cuts = choose_cuts(order.states, tables, demand)
        assert (cuts[0], cuts[-1]) == (0, len(states) - 1)
        assert np.all(np.diff(cuts) >= 0)
        at = [states[cut] for cut in cuts]
        assert all(oracle.allows(before, after) for before, after in pairwise(at))
        assert all(oracle.allows(before, after) for before, after in zip(at, at[2:], strict=False))
    return "complete" if order.complete else "closed" if len(order.closed) > 0 else "tried in vain"


@given(seed=st.integers(0, 100_000), k=st.integers(2, 4))
@settings(max_examples=150)
def test_an_order_is_found_exactly_where_a_complete_search_finds_one(seed: int, k: int) -> None:
    check_order(seed, k)


def test_so_it_is_where_going_on_together_ends_nowhere() -> None:
    assert {check_order(seed, k) for k, seeds in SEARCHED.items() for seed in seeds} == {"complete"}
    assert {check_order(seed, k) for k, seeds in IN_VAIN.items() for seed in seeds} == {"tried in vain"}


def test_all_at_once_is_one_stage_where_nothing_is_in_the_way() -> None:
    tables, last = random_tables(3, 8, 0, np.random.default_rng(1))
    demand = Demand(0b111, np.zeros(3, dtype=np.int64))
    order = search_order(tables, demand, durations_of(last), last, 100)
    assert len(order.states) == 1 + last.max()
    assert choose_cuts(order.states, tables, demand).tolist() == [0, last.max()]


@given(seed=st.integers(0, 100_000))
@settings(max_examples=40)
def test_two_members_have_prospects_exactly_where_a_way_leads_on(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tables, last = random_tables(2, 12, 3, rng)
    demand = random_demand(2, rng)
    oracle = Oracle(tables, demand, last)
    closed = mark_prospects(tables.bits, tables.starts, tables.sizes, last, demand.joined, demand.links)
    goal = tuple(last.tolist())
    leads_on: set[tuple[int, ...]] = set()
    for a in range(goal[0], -1, -1):
        for b in range(goal[1], -1, -1):
            onward = {(a + 1, b), (a, b + 1)} & leads_on
            free = (a, b) == goal and oracle.allows(goal, goal)
            if free or any(oracle.allows((a, b), after) for after in onward):
                leads_on.add((a, b))
    marked = {tuple(at) for at in np.argwhere(tables.table(0, 1)[::2, ::2] & OPEN).tolist()}
    assert marked == leads_on
    assert np.array_equal(tables.table(1, 0) & OPEN, (tables.table(0, 1) & OPEN).T)
    assert closed.tolist() == ([] if (0, 0) in leads_on else [[1, 0]])


@given(seed=st.integers(0, 100_000))
@settings(max_examples=40)
def test_conflicts_are_what_a_piece_meets_last(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tables, last = random_tables(3, 10, 3, rng)
    found = find_last_conflicts(tables.bits, tables.starts, tables.sizes, last)
    for i in range(3):
        for j in range(3):
            for a in range(int(last[i]) if i != j else 0):
                node, piece = tables.table(i, j)[2 * a], tables.table(i, j)[2 * a + 1]
                meets = [f for f in range(len(piece)) if not piece[f] & 1 or node[f] & SEES > piece[f] & SEES]
                assert found[i, j, a] == max(meets, default=-1)


@pytest.mark.parametrize(
    ("adjacent", "joined", "expected"),
    [
        ([0b10, 0b01, 0], 0b11, True),
        ([0b10, 0b01, 0], 0b111, False),
        ([0b100, 0b100, 0b011], 0b011, True),
        ([0, 0, 0], 0, True),
        ([0, 0, 0], 0b100, True),
    ],
)
def test_joined_means_one_component_over_any_others(adjacent: list[int], joined: int, expected: bool) -> None:
    assert is_joined(np.array(adjacent, dtype=np.int64), joined) == expected
