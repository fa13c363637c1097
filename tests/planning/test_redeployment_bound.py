"""Counting robots instead of naming them, bounds, and the search for more robots than can be searched exactly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from math import inf
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planning import iterated_modification, redeploy
from planning.distant_nodes import bound_by_distant
from planning.iterated_modification import improve, search_with_bound
from planning.known_topology import topology_cost
from planning.min_plus import LANES, min_plus, scaled_links
from planning.redeployment import EXACT_STATES, RELAXED_STATES
from planning.redeployment_bound import PriceAscent, count_nodes, relax, without_rounding
from planning.subset_programme import solve_subsets, states_of
from tests.planning.redeployment_oracles import (
    Case,
    cases,
    check_redeployment,
    naive_one_edge,
)

LARGER = cases(nodes=(7, 9), placements=(2, 12))


def optimum(case: Case, idle: bool) -> float:
    return redeploy(case.move, case.W, case.mu, "exact", None, case.ends, idle).cost


def spread_case(k: int, seed: int, number: int = 20) -> Case:
    """Points in a square that see each other when they are near; the nodes start from different ones."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(0, 10, (number, 2))
    lengths = np.hypot(*(points[:, None] - points[None]).T)
    W = np.where(lengths < 6.0, 1.0 + 0.1 * lengths, inf)
    np.fill_diagonal(W, 0.0)
    move = lengths[:k]
    move[:2] = np.where(np.arange(number) == np.arange(2)[:, None], 0.0, inf)
    return Case(move, W, 3.0, [(i, i + 1) for i in range(k - 1)], (0, 1))


@pytest.mark.parametrize("rows", [1, 2, 3, LANES, 2 * LANES + 1])
@pytest.mark.parametrize("mu", [0.0, 2.5])
def test_min_plus_products_are_what_they_are_defined_to_be(rows: int, mu: float) -> None:
    rng = np.random.default_rng(rows)
    W = rng.uniform(0, 1, (37, 37))
    W = W + W.T
    W[W < 0.8] = inf
    costs = rng.uniform(0, 3, (rows, 37))
    costs[rng.random(costs.shape) < 0.3] = inf
    plain = np.full(costs.shape, inf)
    for n in range(rows):
        for v in range(37):
            for u in range(37):
                weight = 0.0 if u == v else mu * W[u, v] if W[u, v] < inf else inf
                plain[n, v] = min(plain[n, v], costs[n, u] + weight)
    assert np.array_equal(min_plus(scaled_links(W, mu), costs), plain)


@settings(max_examples=200)
@given(cases(nodes=(1, 6), placements=(1, 6)), st.booleans())
def test_the_subset_programme_is_the_plain_recurrence(case: Case, idle: bool) -> None:
    """The recurrence of `algorithms.md` §6, a table for each root, against the programme without roots."""
    k, number = case.move.shape
    links = np.where(np.isinf(case.W), inf, case.mu * np.where(np.isinf(case.W), 0.0, case.W))
    trees: dict[tuple[int, int], np.ndarray] = {}
    for nodes in range(1, 2**k):
        for i in range(k):
            if not nodes >> i & 1:
                continue
            rest = nodes & ~(1 << i)
            trees[nodes, i] = case.move[i] if rest == 0 else np.full(number, inf)
            branch = rest
            while branch:
                if branch & (rest & -rest):
                    hung = np.min([trees[branch, j] for j in range(k) if branch >> j & 1], axis=0)
                    hung = (links + hung[:, None]).min(axis=0)
                    trees[nodes, i] = np.minimum(trees[nodes, i], trees[nodes & ~branch, i] + hung)
                branch = (branch - 1) & rest
    needed = sum(1 << i for i in (case.ends if idle else range(k)))
    least = min(tree.min() for (nodes, _), tree in trees.items() if nodes & needed == needed)
    root = case.ends[0] if idle else 0
    programme = solve_subsets(
        scaled_links(case.W, case.mu),
        case.move[root],
        np.delete(case.move, root, axis=0),
        [1] * (k - 1),
        [bool(needed >> i & 1) for i in range(k) if i != root],
    )
    assert programme.cost == least or abs(programme.cost - least) < 1e-9


@given(LARGER, st.integers(1, 30), st.booleans(), st.integers(0, 2**32 - 1))
def test_any_prices_bound_the_optimum(case: Case, most_states: int, idle: bool, seed: int) -> None:
    ends = list(case.ends) if idle else list(range(len(case.move)))
    counted = count_nodes(case.move, ends, most_states)
    prices = np.random.default_rng(seed).normal(0, 2, len(case.move))
    idling = [i for i in range(len(prices)) if i not in ends]
    prices[idling] = -np.abs(prices[idling])
    best = optimum(case, idle)
    links = scaled_links(case.W, case.mu)
    assert relax(links, case.move, counted, prices).bound <= best
    assert relax(links, case.move, counted, np.zeros(len(prices))).bound <= best


@given(LARGER, st.integers(1, 30), st.booleans())
def test_a_search_that_is_not_exact_says_how_far_off_it_can_be(case: Case, most_states: int, idle: bool) -> None:
    ends = list(case.ends) if idle else list(range(len(case.move)))
    found = search_with_bound(scaled_links(case.W, case.mu), case.move, ends, np.array(case.tree), most_states)
    best = optimum(case, idle)
    assert found.lower_bound <= best <= found.cost + 1e-9
    tree = found.edges if np.isfinite(found.cost) else None
    check_redeployment(case, SimpleNamespace(**{**asdict(found), "tree": tree}), idle)


@pytest.mark.parametrize("seed", range(4))
def test_the_search_that_is_not_exact_comes_near_the_optimum(seed: int) -> None:
    case = spread_case(9, seed)
    best = optimum(case, idle=False)
    found = search_with_bound(scaled_links(case.W, case.mu), case.move, list(range(9)), None, 60)
    assert found.cost <= 1.05 * best
    assert found.lower_bound >= 0.5 * best


@pytest.mark.parametrize("idle", [False, True])
def test_more_robots_than_can_be_searched(idle: bool) -> None:
    case = spread_case(16, seed=1)
    assert not count_nodes(case.move, list(range(16)), EXACT_STATES).exact
    found = redeploy(case.move, case.W, case.mu, tree=case.tree, idle=idle)
    check_redeployment(case, found, idle)
    assert 0.0 < found.lower_bound <= found.cost < inf
    modified = redeploy(case.move, case.W, case.mu, "one-edge", case.tree, idle=idle)
    assert found.cost <= modified.cost
    again = redeploy(case.move, case.W, case.mu, tree=case.tree, idle=idle)
    assert (again.cost, again.lower_bound) == (found.cost, found.lower_bound)


def test_forty_two_nodes_take_bounded_work_and_a_bound_that_says_something(monkeypatch: pytest.MonkeyPatch) -> None:
    case = spread_case(42, seed=1, number=60)
    links, calls = scaled_links(case.W, case.mu), {"find_exchanges": 0, "relax": 0}

    def counted(name: str) -> Callable[..., object]:
        plain = getattr(iterated_modification, name)

        def count(*arguments: object) -> object:
            calls[name] += 1
            return plain(*arguments)

        return count

    for name in calls:
        monkeypatch.setattr(iterated_modification, name, counted(name))
    monkeypatch.setattr(iterated_modification, "EFFORT", 200_000_000)
    found = redeploy(case.move, case.W, case.mu, tree=case.tree)
    check_redeployment(case, found, idle=False)
    work = len(links.weights) + iterated_modification.OVERHEAD * links.number
    assert 2 <= calls["find_exchanges"] <= 200_000_000 / (3 * 42**2 * work)
    assert 1 <= calls["relax"] <= 200_000_000 / (RELAXED_STATES * work)
    assert found.cost <= redeploy(case.move, case.W, case.mu, "one-edge", case.tree).cost
    assert found.cost < 5.0 * found.lower_bound


@given(LARGER, st.integers(0, 8), st.booleans())
def test_distant_nodes_bound_the_optimum(case: Case, number: int, idle: bool) -> None:
    ends = list(case.ends) if idle else list(range(len(case.move)))
    best = optimum(case, idle)
    bound = bound_by_distant(scaled_links(case.W, case.mu), case.move, ends, number)
    assert bound <= best
    if number >= len(case.move) - 1 and not idle:
        assert bound == best or bound > best - 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_distant_nodes_bound_well(seed: int) -> None:
    """Five of fourteen nodes that pay to move a long way already cost half as much as all of them."""
    case = spread_case(14, seed, number=30)
    links, everyone = scaled_links(case.W, case.mu), list(range(14))
    best = optimum(case, idle=False)
    bounds = [bound_by_distant(links, case.move, everyone, number) for number in (1, 4, 8)]
    assert bounds == sorted(bounds)
    assert 0.5 * best < bounds[1] <= bounds[2] <= best
    kept = redeploy(case.move, case.W, case.mu, "fixed", case.tree)
    assert kept.lower_bound >= bounds[1]


@given(cases(nodes=(1, 7)), st.booleans())
def test_a_topology_costs_what_its_placements_cost(case: Case, idle: bool) -> None:
    ends = list(case.ends) if idle else list(range(len(case.move)))
    cost = topology_cost(scaled_links(case.W, case.mu), case.move, np.array(case.tree, dtype=int).reshape(-1, 2), ends)
    plain = redeploy(case.move, case.W, case.mu, "fixed", case.tree, case.ends, idle).cost
    assert cost == plain or abs(cost - plain) < 1e-9


def test_that_many_robots_cannot_help_is_proven() -> None:
    case = spread_case(16, seed=1)
    case.W[0, 1:] = case.W[1:, 0] = inf
    case.move[2:, 0] = inf  # nobody sees the base, nor can anyone go there
    found = redeploy(case.move, case.W, case.mu)
    assert (found.cost, found.lower_bound, found.tree) == (inf, inf, None)
    assert (found.cells == -1).all()


def test_robots_that_start_together_are_counted_exactly() -> None:
    case = spread_case(20, seed=2)
    case.move[2:11] = case.move[2]
    case.move[11:] = case.move[11]
    found = redeploy(case.move, case.W, case.mu)
    check_redeployment(case, found, idle=False)
    assert found.lower_bound == found.cost
    fewer = Case(case.move[[0, 1, 2, 3, 4, 11, 12]], case.W, case.mu, [], ())
    named = np.delete(fewer.move, 0, axis=0)
    programme = solve_subsets(scaled_links(case.W, case.mu), fewer.move[0], named, [1] * 6, [True] * 6)
    assert np.isclose(programme.cost, redeploy(fewer.move, fewer.W, fewer.mu).cost)


@given(LARGER, st.integers(1, 40), st.booleans())
def test_nodes_are_counted_together_as_far_as_needed_and_never_ends_with_others(
    case: Case, most_states: int, idle: bool
) -> None:
    ends = list(case.ends) if idle else list(range(len(case.move)))
    counted = count_nodes(case.move, ends, most_states)
    assert sorted(i for kind in counted.kinds for i in kind) == sorted({*range(len(case.move))} - {ends[0]})
    for kind, needed in zip(counted.kinds, counted.needed, strict=True):
        assert {i in ends for i in kind} == {needed}
    assert counted.exact == all((case.move[kind] == case.move[kind[0]]).all() for kind in counted.kinds)
    if states_of([len(kind) for kind in counted.kinds]) > most_states:
        assert len(counted.kinds) == len(set(counted.needed))


def test_prices_raise_the_bound() -> None:
    case = spread_case(9, seed=0)
    best = optimum(case, idle=False)
    links, counted = scaled_links(case.W, case.mu), count_nodes(case.move, list(range(9)), 30)
    ascent = PriceAscent(counted)
    first = relax(links, case.move, counted, ascent.prices).bound
    for _ in range(30):
        if not ascent.step(relax(links, case.move, counted, ascent.prices), best):
            break
    assert first + 0.1 * (best - first) < ascent.bound <= best


def test_a_cost_below_the_bound_is_hidden_only_where_it_is_rounding() -> None:
    assert without_rounding(3.0, 5.0) == 3.0
    assert without_rounding(3.0 + 1e-12, 3.0) == 3.0
    assert without_rounding(9.0, 3.0) == 9.0
    assert without_rounding(inf, 3.0) == inf


def test_a_local_optimum_is_one() -> None:
    case = spread_case(8, seed=3)
    links = scaled_links(case.W, case.mu)
    found = improve(links, case.move, list(range(8)), np.array(case.tree), 100)[0]
    edges = [(int(i), int(j)) for i, j in found.edges]
    assert np.isclose(naive_one_edge(case.move, case.W, case.mu, edges), found.cost)
