"""The four searches against every tree and every placement, and against each other."""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from planning import Redeployment, redeploy
from planning.redeployment import InvalidRedeployment, Search
from planning.tree import InvalidWeights
from tests.planning.redeployment_oracles import (
    Case,
    cases,
    check_redeployment,
    kept_cost,
    least_chain,
    least_cost,
    one_edge_cost,
)


def solve(case: Case, search: Search, idle: bool) -> Redeployment:
    tree = case.tree if search in ("fixed", "one-edge") else None
    found = redeploy(case.move, case.W, case.mu, search, tree, case.ends, idle)
    check_redeployment(case, found, idle)
    return found


def equal(first: float, second: float) -> bool:
    return first == second or abs(first - second) <= 1e-9


@settings(max_examples=400)
@given(cases())
def test_exact_is_the_least_of_all_trees_and_placements(case: Case) -> None:
    found = solve(case, "exact", idle=False)
    assert equal(found.cost, least_cost(case, idle=False))
    assert found.lower_bound == found.cost


@settings(max_examples=250)
@given(cases(placements=(1, 6)))
def test_exact_leaves_out_whom_it_may(case: Case) -> None:
    found = solve(case, "exact", idle=True)
    assert equal(found.cost, least_cost(case, idle=True))
    assert found.lower_bound == found.cost


@settings(max_examples=250)
@given(cases(), st.booleans())
def test_fixed_is_the_least_of_all_placements(case: Case, idle: bool) -> None:
    assert equal(solve(case, "fixed", idle).cost, kept_cost(case, case.tree, idle))


@settings(max_examples=300)
@given(cases(placements=(1, 6)), st.booleans())
def test_one_edge_is_the_least_of_all_modifications(case: Case, idle: bool) -> None:
    assert equal(solve(case, "one-edge", idle).cost, one_edge_cost(case, idle))


@settings(max_examples=200)
@given(cases(nodes=(2, 5), placements=(1, 6)))
def test_a_chain_is_the_least_of_all_chains_and_of_all_trees_that_may_idle(case: Case) -> None:
    ends = (case.ends[0], next(node for node in range(len(case.move)) if node != case.ends[0]))
    case = Case(case.move, case.W, case.mu, case.tree, ends)
    found = solve(case, "chain", idle=True)
    assert equal(found.cost, least_chain(case, ends))
    assert equal(found.cost, solve(case, "exact", idle=True).cost)
    assert found.tree is None or (np.bincount(found.tree.ravel()) <= 2).all()


@settings(max_examples=150)
@given(cases(nodes=(2, 9), placements=(2, 20)), st.booleans())
def test_a_wider_search_is_not_dearer_and_bounds_hold(case: Case, idle: bool) -> None:
    exact, one_edge, fixed = (solve(case, search, idle) for search in ("exact", "one-edge", "fixed"))
    tolerance = 1e-9
    assert exact.cost <= one_edge.cost + tolerance
    assert one_edge.cost <= fixed.cost + tolerance
    assert max(one_edge.lower_bound, fixed.lower_bound) <= exact.cost


def test_a_known_topology_without_costs_of_moving() -> None:
    # Thesis §3.3.4: three targets at the ends of a star of corridors, one robot that has to find the middle.
    W = np.full((7, 7), inf)
    for spoke in ((0, 1, 6), (2, 3, 6), (4, 5, 6)):
        for u, v in ((spoke[0], spoke[1]), (spoke[1], spoke[2]), (spoke[0], spoke[2])):
            W[u, v] = W[v, u] = 1.0
    np.fill_diagonal(W, 0.0)
    move = np.full((4, 7), inf)
    move[[0, 1, 2], [0, 2, 4]] = 0.0
    move[3] = 0.0
    found = redeploy(move, W, search="fixed", tree=[(0, 3), (1, 3), (2, 3)])
    assert found.cost == 3.0
    assert found.cells.tolist() == [0, 2, 4, 6]


def test_robots_that_are_not_needed_stay_at_least_cost_or_idle() -> None:
    W = np.array([[0.0, 1.0, inf], [1.0, 0.0, inf], [inf, inf, 0.0]])
    move = np.array([[0.0, inf, inf], [inf, 0.0, inf], [3.0, 2.5, 0.0]])
    staying = redeploy(move, W)
    assert (staying.cost, staying.cells.tolist()) == (3.5, [0, 1, 1])
    idling = redeploy(move, W, idle=True)
    assert (idling.cost, idling.cells.tolist()) == (1.0, [0, 1, -1])
    assert idling.tree is not None
    assert idling.tree.tolist() == [[0, 1]]


def test_nothing_is_free_because_links_are() -> None:
    # μ = 0 makes links free; where there is none there is none.
    W = np.array([[0.0, inf], [inf, 0.0]])
    apart = redeploy([[0.0, inf], [inf, 0.0]], W, mu=0.0)
    assert (apart.cost, apart.lower_bound, apart.tree, apart.cells.tolist()) == (inf, inf, None, [-1, -1])
    assert redeploy([[0.0, inf], [7.0, 0.0]], W, mu=0.0).cost == 7.0


def test_the_tree_that_is_kept_is_the_tree_that_was_given() -> None:
    W = np.ones((3, 3)) - np.eye(3)
    tree = [(2, 1), (0, 2)]
    found = redeploy(np.zeros((3, 3)), W, search="one-edge", tree=tree)
    assert found.tree is not None
    assert found.tree.tolist() == [[2, 1], [0, 2]]


def test_a_tree_that_idled_is_a_tree_to_go_on_with() -> None:
    W = np.array([[0.0, 1.0, 1.0], [1.0, 0.0, inf], [1.0, inf, 0.0]])
    move = np.array([[inf, 0.0, inf], [inf, 0.0, inf], [1.0, 1.0, 1.0]])
    first = redeploy(move, W, search="one-edge", tree=[(0, 2), (2, 1)], idle=True)
    assert first.tree is not None
    assert (first.cost, sorted(first.tree[0])) == (0.0, [0, 1])
    move[1] = [inf, inf, 0.0]  # the agent goes on to where a relay is needed
    second = redeploy(move, W, search="one-edge", tree=first.tree, idle=True)
    assert (second.cost, second.cells.tolist()) == (3.0, [1, 2, 0])
    assert redeploy(move, W, search="fixed", tree=first.tree, idle=True).cost == inf


MOVE, W = np.zeros((3, 2)), np.array([[0.0, 1.0], [1.0, 0.0]])
SQUARE = [(0, 1), (1, 2), (2, 3), (3, 0)]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"move": "much"}, "move is a table of numbers, not str"),
        ({"move": [1.0, 2.0]}, r"its shape is \(2,\)"),
        ({"move": np.zeros((0, 2))}, r"its shape is \(0, 2\)"),
        ({"move": [[0.0, 1.0], [2.0, -1.0]]}, r"move\[1, 1\] is -1.0: say inf"),
        ({"move": [[0.0, np.nan]]}, r"move\[0, 1\] is nan"),
        ({"move": np.zeros((3, 5))}, "move is for 5 placements and W for 2"),
        ({"mu": inf}, "mu is a finite number of at least 0, not inf"),
        ({"mu": -1.0}, "mu is a finite number"),
        ({"mu": np.ones(2)}, "mu is a finite number"),
        ({"mu": [[1.0], [1.0, 2.0]]}, "mu is a finite number"),
        ({"search": "best"}, "no search 'best': use one of exact, one-edge, fixed, chain"),
        ({"search": "fixed"}, "a fixed search starts from a topology: give tree"),
        ({"search": "one-edge"}, "a one-edge search starts from a topology: give tree"),
        ({"search": "chain", "ends": (0, 1, 2)}, "a chain has two ends, not 3"),
        ({"idle": True, "ends": (0, 3)}, "node 3 cannot be an end: nodes are 0 to 2"),
        ({"idle": True, "ends": (1, 1)}, r"ends are different nodes, but \[1, 1\] repeats one"),
        ({"idle": True, "ends": ()}, r"at least one; they are \(\)"),
        ({"idle": True, "ends": (0.5, 1)}, "ends are the nodes that stay"),
        ({"idle": True, "ends": [(0, 1), 2]}, "ends are the nodes that stay"),
        ({"tree": [(0, 1), (2,)]}, "tree is a list of pairs of nodes"),
        ({"tree": [(0, 1, 2)]}, "tree is a list of pairs of nodes"),
        ({"tree": [(0, 1), (1, 3)]}, "tree names node 3, but nodes are 0 to 2"),
        ({"tree": [(0, 1)]}, "node 2 is not joined to node 0: add an edge"),
        ({"tree": [(0, 1), (1, 2), (2, 0)]}, "tree has 3 edges between 3 nodes and so a cycle"),
        ({"tree": SQUARE, "move": np.zeros((4, 2))}, "tree has 4 edges between 4 nodes and so a cycle"),
        ({"tree": [(0, 1), (0, 1)]}, "tree joins nodes 0 and 1 twice"),
        ({"tree": [(0, 1), (1, 0), (1, 2)], "search": "fixed"}, "tree joins nodes 0 and 1 twice"),
        ({"tree": [(0, 1), (2, 1), (1, 2)], "idle": True}, "tree joins nodes 1 and 2 twice"),
        ({"tree": [(0, 1), (2, 2)]}, "tree joins node 2 to itself"),
        ({"tree": [(1, 2)], "idle": True, "search": "fixed"}, "node 1 is not joined to node 0"),
    ],
)
def test_what_makes_no_sense_is_said_in_a_sentence(arguments: dict[str, Any], says: str) -> None:
    with pytest.raises(InvalidRedeployment, match=says):
        redeploy(**{"move": MOVE, "W": W, **arguments})


def test_weights_that_are_not_symmetric_are_refused() -> None:
    with pytest.raises(InvalidWeights, match="symmetric"):
        redeploy(MOVE, [[0.0, 1.0], [2.0, 0.0]])


def test_weights_that_are_symmetric_but_for_rounding_are_taken() -> None:
    sums = np.array([[0.0, 0.1 + 0.2], [0.3, 0.0]])
    move = [[0.0, inf], [inf, 0.0]]
    assert redeploy(move, sums, mu=np.array(2.0)).cost == redeploy(move, sums.T, mu=2).cost == 0.6
    assert sums[0, 1] != sums[1, 0]


@settings(max_examples=30)
@given(cases())
def test_arguments_are_left_as_they_are(case: Case) -> None:
    assume(len(case.move) > 1)
    move, weights = case.move.copy(), case.W.copy()
    for search in ("exact", "one-edge", "fixed"):
        solve(case, search, idle=False)
    assert np.array_equal(case.move, move)
    assert np.array_equal(case.W, weights)


def test_a_team_of_one_may_idle_and_makes_no_chain() -> None:
    assert redeploy([[2.0, 1.0]], [[0.0, 1.0], [1.0, 0.0]], idle=True).cells.tolist() == [1]
    with pytest.raises(InvalidRedeployment, match="joins two nodes"):
        redeploy([[2.0, 1.0]], [[0.0, 1.0], [1.0, 0.0]], search="chain")
