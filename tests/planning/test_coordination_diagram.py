"""Elements and free directions against the boxes themselves, asked for just beside each point."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from planning import CoordinationDiagram
from planning.coordination import collision_boxes
from planning.coordination_diagram import measure_path, place_on_path

Floats = NDArray[np.float64]

BESIDE = 1e-6
"""Metres of path: boxes are asked for so far beside a point."""


def random_paths(seed: int, robots: int) -> list[Floats]:
    """Polylines, half of them on whole coordinates, so that boxes touch and share edges; some stand, some turn back."""
    rng = np.random.default_rng(seed)
    paths = []
    for _ in range(robots):
        corners = int(rng.integers(1, 5))
        path = rng.integers(0, 5, (corners, 2)) * 1.0 if rng.uniform() < 0.5 else rng.uniform(0.0, 4.0, (corners, 2))
        if rng.uniform() < 0.2:
            path = np.concatenate([path, path[::-1]])
        paths.append(path)
    return paths


class BoxOracle:
    """Whether boxes cover the diagram all around a point: beside it, in all quarters that the diagram has there."""

    def __init__(self, paths: list[Floats], radius: float) -> None:
        self.lengths = [float(measure_path(path)[-1]) for path in paths]
        self.boxes = {
            (i, j): collision_boxes(paths[i], paths[j], 2.0 * radius * (1.0 - 1e-9))[0]
            for i, j in combinations(range(len(paths)), 2)
        }

    def blocks(self, point: Sequence[float]) -> bool:
        return any(self._covers(boxes, i, point[i], j, point[j]) for (i, j), boxes in self.boxes.items())

    def _covers(self, boxes: Floats, i: int, x: float, j: int, y: float) -> bool:
        quarters = product(self._beside(i, x), self._beside(j, y))
        return all(np.any(np.all((boxes[:, ::2] <= at) & (at <= boxes[:, 1::2]), axis=1)) for at in quarters)

    def _beside(self, robot: int, at: float) -> list[float]:
        length = self.lengths[robot]
        return [x for x in (at - BESIDE, at + BESIDE) if 0.0 <= x <= length] if length > 0.0 else [0.0]


def middles(limits: Floats) -> Floats:
    """A point in each element."""
    return np.sort(np.concatenate([limits, 0.5 * (limits[1:] + limits[:-1])]))


def are_apart(diagram: CoordinationDiagram) -> bool:
    return all(np.all(np.diff(limits) > 10.0 * BESIDE) for limits in diagram.limits_m)


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), radius=st.sampled_from([0.2, 0.5]))
def test_elements_are_blocked_where_boxes_cover_all_around_them(seed: int, radius: float) -> None:
    paths = random_paths(seed, 2)
    diagram = CoordinationDiagram.of(paths, [radius, radius])
    if not are_apart(diagram):
        return
    table = diagram.collides[0, 1]
    oracle = BoxOracle(paths, radius)
    points = [middles(limits) for limits in diagram.limits_m]
    assert table.shape == (len(points[0]), len(points[1]))
    for a, x in enumerate(points[0]):
        for b, y in enumerate(points[1]):
            assert table[a, b] == oracle.blocks((x, y))
            assert diagram.find_elements([x, y]).tolist() == [a, b]


@given(seed=st.integers(0, 2**32 - 1))
def test_robots_on_elements_that_are_not_blocked_do_not_overlap(seed: int) -> None:
    rng = np.random.default_rng(seed)
    paths = random_paths(seed, 2)
    cuts = [rng.uniform(0.0, measure_path(path)[-1], 3) for path in paths]
    diagram = CoordinationDiagram.of(paths, [0.3, 0.4], cuts_m=cuts)
    # Eight points on each piece, and all limits.
    along = [
        np.interp(np.arange(8 * len(limits) - 7) / 8.0, np.arange(len(limits)), limits) for limits in diagram.limits_m
    ]
    places = [place_on_path(path, at) for path, at in zip(diagram.paths, along, strict=True)]
    distance = np.linalg.norm(places[0][:, None] - places[1][None], axis=-1)
    elements = [
        [diagram.find_elements((x, 0.0))[0] for x in along[0]],
        [diagram.find_elements((0.0, y))[1] for y in along[1]],
    ]
    blocked = diagram.collides[0, 1][np.ix_(*elements)]
    assert np.all(distance[~blocked] >= 0.7 * (1.0 - 3e-9))
    for cut, limits in zip(cuts, diagram.limits_m, strict=True):
        assert len(limits) == 1 or all(np.min(np.abs(limits - at)) < 1e-9 for at in cut)


@given(seed=st.integers(0, 2**32 - 1))
def test_free_directions_are_those_that_boxes_leave(seed: int) -> None:
    rng = np.random.default_rng(seed)
    paths = random_paths(seed, 3)
    diagram = CoordinationDiagram.of(paths, [0.3] * 3)
    if not are_apart(diagram):
        return
    oracle = BoxOracle(paths, 0.3)
    points = [middles(limits) for limits in diagram.limits_m]
    for _ in range(8):
        point = np.array([rng.choice(at) for at in points])
        if oracle.blocks(point):
            continue
        forward, backward = diagram.free_directions(point)
        for robot in range(3):
            for free, step in ((forward, 3.0 * BESIDE), (backward, -3.0 * BESIDE)):
                moved = point.copy()
                moved[robot] += step
                inside = 0.0 <= moved[robot] <= diagram.limits_m[robot][-1]
                assert free[robot] == (inside and not oracle.blocks(moved))


def test_figure_67_corrected() -> None:
    """Robot 1 crosses the end of a dead end that robot 2 goes into and out of again: two boxes, one edge in common."""
    diagram = CoordinationDiagram.of([[(0, 0), (4, 0)], [(2, -2), (2, 0), (2, -2)]], [0.3, 0.3])
    (near, far), (first, bend, last) = diagram.limits_m[0][1:3], diagram.limits_m[1][1:4]
    assert (near, far, first, bend, last) == pytest.approx((1.4, 2.6, 1.4, 2.0, 2.6))
    for point, forward, backward in [
        ((near, first), [True, True], [True, True]),  # A: a corner of the first box
        ((near, bend), [False, True], [True, True]),  # tangent to two boxes on one side: as printed, blocked
        ((near, 1.7), [False, True], [True, True]),  # C: on an edge
        ((far, bend), [True, True], [False, True]),
        ((2.0, first), [True, False], [True, True]),
        ((2.0, last), [True, True], [True, False]),
    ]:
        free = diagram.free_directions(point)
        assert [free[0].tolist(), free[1].tolist()] == [forward, backward], point
    # Between the two boxes, along the edge that they share, nobody passes.
    assert diagram.find_trouble(diagram.find_elements((2.0, bend))) is not None
    # A direction that is tangent to a box at the border of the diagram is blocked, though to one box only.
    border = CoordinationDiagram.of([[(0, 0), (4, 0)], [(2, 0), (2, 2)]], [0.3, 0.3])
    assert border.free_directions((border.limits_m[0][1], 0.0))[0].tolist() == [False, True]


def test_boxes_of_a_pair_are_cylinders() -> None:
    """What two robots do is true wherever a third is (thesis figure 64)."""
    paths = [np.array([(0, 0), (4, 0)]), np.array([(2, -2), (2, 2)]), np.array([(9, 9), (9, 12)])]
    two, three = CoordinationDiagram.of(paths[:2], [0.3] * 2), CoordinationDiagram.of(paths, [0.3] * 3)
    np.testing.assert_array_equal(two.collides[0, 1], three.collides[0, 1])
    assert not three.collides[0, 2].any()
    assert three.limits_m[2].tolist() == [0.0, 3.0]
    assert three.find_trouble([3, 3, 0]) == three.find_trouble([3, 3, 2]) == ((0, 1), "collision")
    assert three.find_trouble([1, 3, 1]) is None


@pytest.mark.parametrize(
    ("paths", "radii", "blocked"),
    [
        ([[(0, 0)], [(0.6, 0)]], [0.3, 0.3], False),  # both stand and touch
        ([[(0, 0)], [(0.59, 0)]], [0.3, 0.3], True),
        ([[(0, 0)], [(0, 0)]], [0.0, 0.3], False),  # no body, in nobody's way
        ([[(0, 0), (0, 0)], [(0.5, 0), (0.5, 0)]], [0.3, 0.3], True),  # no length
    ],
)
def test_robots_that_stand(paths: list[list[tuple[float, float]]], radii: list[float], blocked: bool) -> None:
    diagram = CoordinationDiagram.of(paths, radii)
    assert [limits.tolist() for limits in diagram.limits_m] == [[0.0], [0.0]]
    assert diagram.collides[0, 1].tolist() == [[blocked]]
    assert [free.tolist() for free in diagram.free_directions([0.0, 0.0])] == [[False, False]] * 2


def test_a_robot_that_may_be_anywhere_blocks_all_that_its_path_does() -> None:
    paths = [[(0, 0), (4, 0)], [(2, -2), (2, 2)]]
    table = CoordinationDiagram.of(paths, [0.3, 0.3]).collides[0, 1]
    anywhere = CoordinationDiagram.of(paths, [0.3, 0.3], anywhere=[1])
    assert anywhere.limits_m[1].tolist() == [0.0]
    assert anywhere.collides[0, 1][:, 0].tolist() == table.any(axis=1).tolist()


def test_sight_and_networks() -> None:
    paths = [[(0, 0), (1, 0)], [(0, 5), (1, 5)], [(0, 9)]]
    plain = CoordinationDiagram.of(paths, [0.1] * 3)
    sees = {(0, 1): np.ones((3, 3), bool), (0, 2): np.zeros((3, 1), bool), (1, 2): np.array([[1], [0], [0]], bool)}
    linked = plain.with_sight(sees, links=[(1, 2)])
    assert linked.find_trouble([0, 0, 0]) is None
    assert linked.find_trouble([0, 1, 0]) == ((1, 2), "link")
    assert linked.free_directions([0.0, 0.0, 0.0])[0].tolist() == [True, False, False]
    joined = plain.with_sight(sees, joined=range(3))
    assert joined.find_trouble([2, 0, 0]) is None  # over robot 1
    assert joined.find_trouble([2, 2, 0]) == ((0, 2), "network")
    assert plain.with_sight(sees, joined=[0, 1]).find_trouble([2, 2, 0]) is None
