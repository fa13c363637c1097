"""Strips of the lifted state against the distances themselves, for random geometry."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.ellipsoid import Ellipsoid
from estimation.range_embedding import NotAMeasurement, RangeEmbedding, range_bounds
from estimation.strip_cut import cut

SEEDS = st.integers(0, 100_000)


@given(seed=SEEDS, nodes=st.integers(1, 4), dimension=st.integers(2, 3))
@settings(deadline=None, max_examples=100)
def test_a_strip_holds_exactly_what_the_range_allows(seed: int, nodes: int, dimension: int) -> None:
    rng = np.random.default_rng(seed)
    embedding = RangeEmbedding(nodes, dimension)
    truth = rng.normal(scale=20, size=(nodes, dimension))
    others = rng.normal(scale=20, size=(50, nodes, dimension))
    for i in range(nodes):
        anchor = rng.normal(scale=20, size=dimension)
        distance = np.linalg.norm(truth[i] - anchor)
        below, above = rng.uniform(0, 3, 2)
        measured = distance + rng.choice([-above, below, rng.uniform(-above, below)])
        low, high = range_bounds(max(measured, 0.0), below, above)
        strip = embedding.strip_to_anchor(i, anchor, low, high)
        assert strip.contains(embedding.lift(truth))
        inside = np.linalg.norm(others[:, i] - anchor, axis=1)
        assert (strip.contains(embedding.lift(others)) == ((inside >= low) & (inside <= high))).all()
        for j in range(i):
            distance = np.linalg.norm(truth[i] - truth[j])
            measured = distance + rng.uniform(-above, below)
            low, high = range_bounds(max(measured, 0.0), below, above)
            for strip in (embedding.strip_between(i, j, low, high), embedding.strip_between(j, i, low, high)):
                assert strip.contains(embedding.lift(truth))
                inside = np.linalg.norm(others[:, i] - others[:, j], axis=1)
                assert (strip.contains(embedding.lift(others)) == ((inside >= low) & (inside <= high))).all()


def test_layout_of_the_state() -> None:
    embedding = RangeEmbedding(nodes=3)
    assert embedding.size == 6 + 3 + 3
    state = embedding.lift([[1, 2], [3, 4], [5, 6]])
    assert state.tolist() == [1, 2, 3, 4, 5, 6, 5, 25, 61, 11, 17, 39]
    assert state[embedding.position(1)].tolist() == [3, 4]
    assert state[embedding.square(2)] == 61
    assert state[embedding.product(2, 0)] == state[embedding.product(0, 2)] == 17
    sparse = RangeEmbedding(nodes=3, pairs=((1, 2),))
    assert sparse.lift([[1, 2], [3, 4], [5, 6]]).tolist() == [1, 2, 3, 4, 5, 6, 5, 25, 61, 39]
    assert RangeEmbedding(1).lift(np.ones((7, 1, 2))).shape == (7, 4 - 1)


def test_a_range_shorter_than_its_bound_keeps_near_targets() -> None:
    """z = 0.2, ε = 0.5: the thesis' lower end (z − ε)² = 0.09 would exclude a target 0.1 m away."""
    embedding = RangeEmbedding()
    low, high = range_bounds(0.2, 0.5, 0.5)
    assert (low, high) == (0.0, 0.7)
    strip = embedding.strip_to_anchor(0, [3.0, 4.0], low, high)
    assert strip.contains(embedding.lift([[3.1, 4.0]]))
    assert strip.low == -25.0
    assert embedding.strip_to_anchor(0, [3.0, 4.0], -0.3, 0.7).low == -25.0


def test_a_least_distance_alone_is_a_half_space() -> None:
    embedding = RangeEmbedding()
    strip = embedding.strip_to_anchor(0, [0.0, 0.0], 2.0, np.inf)
    assert strip.contains(embedding.lift([[[3.0, 0.0]], [[1.0, 0.0]]])).tolist() == [True, False]


@pytest.mark.parametrize("seed", range(5))
def test_two_nodes_are_located_by_anchors_and_each_other(seed: int) -> None:
    """From the whole space on: every range is a cut, the truth is never lost, and what is left is small."""
    rng = np.random.default_rng(seed)
    embedding = RangeEmbedding(nodes=2)
    truth = rng.uniform(-10, 10, (2, 2))
    lifted = embedding.lift(truth)
    state = Ellipsoid.whole_space(embedding.size)
    bound = 0.2
    for _ in range(60):
        if rng.random() < 0.3:
            z = np.linalg.norm(truth[0] - truth[1]) + rng.uniform(-bound, bound)
            strip = embedding.strip_between(0, 1, z - bound, z + bound)
        else:
            node, anchor = int(rng.integers(2)), rng.uniform(-12, 12, 2)
            z = np.linalg.norm(truth[node] - anchor) + rng.uniform(-bound, bound)
            strip = embedding.strip_to_anchor(node, anchor, z - bound, z + bound)
        result = cut(state, strip)
        assert result.ellipsoid is not None
        state = result.ellipsoid
        assert state.contains(lifted, 1e-6), f"seed {seed}"
    assert state.bounded
    shadow = state.project(embedding.base_size)
    assert shadow.semi_axes.max() < 8
    assert np.abs(shadow.center - truth.ravel()).max() < 2


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: RangeEmbedding(0), "at least one node"),
        (lambda: RangeEmbedding(2, pairs=((1, 0),)), "no pair"),
        (lambda: RangeEmbedding(2, pairs=((0, 1), (0, 1))), "twice"),
        (lambda: RangeEmbedding(3, pairs=((0, 1),)).strip_between(1, 2, 0, 1), "have no product"),
        (lambda: RangeEmbedding(2).strip_to_anchor(2, [0, 0], 0, 1), "no node 2"),
        (lambda: RangeEmbedding(2).strip_to_anchor(0, [0, 0, 0], 0, 1), "2 finite numbers"),
        (lambda: RangeEmbedding(2).strip_to_anchor(0, [0, 0], 2, 1), "lies between"),
        (lambda: RangeEmbedding(2).strip_to_anchor(0, [0, 0], 0, np.inf), "lies between"),
        (lambda: RangeEmbedding(2).strip_to_anchor(0, [0, 0], -2, -1), "lies between"),
        (lambda: RangeEmbedding(2).lift([1, 2]), "2 positions"),
        (lambda: range_bounds(1, -1, 1), "at least 0"),
        (lambda: range_bounds(-3, 1, 1), "negative"),
        (lambda: range_bounds(np.nan, 1, 1), "finite"),
    ],
)
def test_bad_input_is_refused_in_a_sentence(make: object, sentence: str) -> None:
    with pytest.raises(NotAMeasurement, match=sentence):
        make()  # type: ignore[operator]
