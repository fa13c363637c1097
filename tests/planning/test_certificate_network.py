"""Breaks of networks that change, against networkx at instants between all changes."""

from __future__ import annotations

from itertools import combinations

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planning.certificate_network import find_breaks, find_gaps


@given(seed=st.integers(0, 2**32 - 1), members=st.integers(1, 6), with_ends=st.booleans())
def test_breaks_are_those_of_the_graphs_between_all_changes(seed: int, members: int, with_ends: bool) -> None:
    rng = np.random.default_rng(seed)
    sight = {}
    for pair in combinations(range(members), 2):
        # Whole seconds: links often end as others begin.
        edges = np.sort(rng.choice(11, 2 * rng.integers(0, 4), replace=False)).astype(np.float64)
        sight[pair] = edges.reshape(-1, 2)
    ends = (0, members - 1) if with_ends and members > 1 else None
    breaks = find_breaks(sight, members, 0.0, 10.0, ends)
    for time in np.arange(0.5, 10.0):
        graph = nx.Graph()
        graph.add_nodes_from(range(members))
        graph.add_edges_from(
            pair for pair, intervals in sight.items() if np.any((intervals[:, 0] <= time) & (time <= intervals[:, 1]))
        )
        joined = nx.has_path(graph, *ends) if ends else nx.is_connected(graph)
        current = [gap for gap in breaks if gap.start_s < time < gap.end_s]
        assert len(current) == (0 if joined else 1)
        for gap in current:
            if time == gap.start_s + 0.5:
                parts = dict(enumerate(gap.parts))
                expected = {frozenset(part) for part in nx.connected_components(graph)}
                assert {frozenset(i for i in parts if parts[i] == part) for part in parts.values()} == expected
                assert parts[gap.between[0]] != parts[gap.between[1]]
                for pair in gap.lost:
                    assert gap.start_s in sight[pair][:, 1]
                    assert parts[pair[0]] != parts[pair[1]]


def test_gaps_of_intervals_and_of_an_instant() -> None:
    intervals = np.array([(0.0, 2.0), (3.0, 4.0)])
    assert find_gaps(intervals, 0.0, 5.0) == [(2.0, 3.0), (4.0, 5.0)]
    assert find_gaps(intervals, 0.0, 4.0) == [(2.0, 3.0)]
    assert find_gaps(np.empty((0, 2)), 0.0, 4.0) == [(0.0, 4.0)]
    assert find_gaps(np.empty((0, 2)), 4.0, 4.0) == [(4.0, 4.0)]
    assert find_gaps(np.array([(4.0, 4.0)]), 4.0, 4.0) == []


@pytest.mark.parametrize(("seen", "expected"), [([(1.0, 1.0)], 0), ([], 1)])
def test_an_instant_is_a_time_too(seen: list[tuple[float, float]], expected: int) -> None:
    sight = {(0, 1): np.array(seen).reshape(-1, 2)}
    assert len(find_breaks(sight, 2, 1.0, 1.0, None)) == expected
