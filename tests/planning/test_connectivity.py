"""Laplacian, λ₂ and components against networkx."""

from __future__ import annotations

import networkx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planning.connectivity import algebraic_connectivity, chain_connected, component_labels, connected, laplacian


@given(seed=st.integers(0, 10_000), n=st.integers(2, 12), share=st.floats(0.05, 0.6))
@settings(deadline=None, max_examples=60)
def test_random_graph_agrees_with_networkx(seed: int, n: int, share: float) -> None:
    graph = networkx.gnp_random_graph(n, share, seed=seed)
    adjacency = networkx.to_numpy_array(graph, nodelist=range(n)).astype(bool)
    if seed % 2:
        np.fill_diagonal(adjacency, True)  # as a visibility matrix has it; it must make no difference
    assert np.array_equal(laplacian(adjacency), networkx.laplacian_matrix(graph, nodelist=range(n)).toarray())
    expected = networkx.laplacian_spectrum(graph)[1]
    assert algebraic_connectivity(adjacency) == pytest.approx(expected, abs=1e-9)
    assert connected(adjacency) is networkx.is_connected(graph)
    assert (algebraic_connectivity(adjacency) > 1e-9) is networkx.is_connected(graph)
    labels = component_labels(adjacency)
    for number, members in enumerate(sorted(networkx.connected_components(graph), key=min)):
        assert set(np.flatnonzero(labels == number)) == members
    for i in range(n):
        assert chain_connected(adjacency, 0, i) is networkx.has_path(graph, 0, i)


def test_known_spectra() -> None:
    complete = np.ones((5, 5))
    assert algebraic_connectivity(complete) == pytest.approx(5.0)
    path = np.eye(4, k=1) + np.eye(4, k=-1)
    assert algebraic_connectivity(path) == pytest.approx(2.0 - np.sqrt(2.0))


def test_small_teams() -> None:
    assert connected(np.zeros((0, 0)))
    assert connected([[True]])
    assert algebraic_connectivity([[True]]) == 0.0
    assert not connected([[True, False], [False, True]])
    with pytest.raises(ValueError, match="square"):
        connected(np.ones((2, 3)))
