"""What the members find with their own edges, together, is what algorithm 7 finds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planning import redeploy
from planning.own_edges import OwnExchange, exchange_own, own_edges
from tests.planning.redeployment_oracles import Case, cases, one_edge_cost


def bids(case: Case, idle: bool) -> dict[int, OwnExchange]:
    """What each member finds; one alone has no edge, and keeps to its tree."""
    k = len(case.move)
    links = np.where(np.isinf(case.W), np.inf, case.mu * np.where(np.isinf(case.W), 0.0, case.W))
    np.fill_diagonal(links, 0.0)
    tree = np.array(case.tree, dtype=np.int64).reshape(-1, 2)
    ends = list(case.ends) if idle else list(range(k))
    own = own_edges(tree, ends[0])
    return {
        member: exchange_own(case.move, links, tree, ends, [own[member]] if member in own else [])
        for member in range(k)
    }


@settings(max_examples=120)
@given(cases(placements=(1, 6)), st.booleans())
def test_the_least_of_what_all_find_is_the_least_of_all_modifications(case: Case, idle: bool) -> None:
    found = min(bid.cost for bid in bids(case, idle).values())
    least = one_edge_cost(case, idle)
    assert found == least or abs(found - least) <= 1e-9


@pytest.mark.parametrize("seed", range(15))
def test_it_is_to_the_bit_what_the_leader_finds_alone(seed: int) -> None:
    rng = np.random.default_rng([seed, 7])
    k, number = int(rng.integers(3, 9)), 60
    places = rng.uniform(0, 10, (number, 2))
    W = np.hypot(*(places[:, None] - places).transpose(2, 0, 1))
    W[W > 3.5] = np.inf
    starts = rng.integers(number, size=k)
    move = np.hypot(*(places[starts][:, None] - places).transpose(2, 0, 1))
    move[0], move[1] = np.inf, np.inf
    move[0, starts[0]] = move[1, starts[1]] = 0.0
    tree = np.array([(0, 2), *((i, i + 1) for i in range(2, k - 1)), (k - 1, 1)])
    own = own_edges(tree, 0)
    assert set(own) == set(range(1, k)) and sorted(own.values()) == sorted(map(tuple, tree.tolist()))
    found = [exchange_own(move, W, tree, [0, 1], [edge]) for edge in own.values()]
    best = min(found, key=lambda bid: bid.cost)
    alone = redeploy(move, W, search="one-edge", tree=tree, ends=(0, 1), idle=True)
    assert best.cost == pytest.approx(alone.cost, abs=1e-9), f"seed {seed}"
    assert (alone.tree is None) is bool(np.isinf(best.cost))
    if alone.tree is not None and sum(bid.cost <= best.cost + 1e-9 for bid in found) == 1:
        assert best.tree.tolist() == alone.tree.tolist() and best.cells.tolist() == alone.cells.tolist()


def test_what_is_removed_is_the_members_own_and_what_is_added_is_in_its_place() -> None:
    W = np.array([[0.0, 9.0, 1.0, 9.0], [9.0, 0.0, 1.0, 9.0], [1.0, 1.0, 0.0, 9.0], [9.0, 9.0, 9.0, 0.0]])
    move = np.full((3, 4), np.inf)
    move[0, 0] = move[1, 1] = move[2, 2] = 0.0
    tree = np.array([(0, 1), (1, 2)])
    own = own_edges(tree, 0)
    assert own == {1: (0, 1), 2: (1, 2)}
    first, second = (exchange_own(move, W, tree, [0, 1, 2], [own[member]]) for member in (1, 2))
    assert (first.removed, set(first.added or ())) == ((0, 1), {0, 2}) and first.cost == 2.0
    assert second.removed is None and second.cost == 10.0
