from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from planning.arrangement import _merge, arrange
from planning.critical_lines import NONE, CriticalLines, find_critical_lines
from planning.environment import Environment
from tests.planning.polygons import environment_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def ring_neighbours(environment: Environment) -> tuple[Ints, Ints]:
    after = np.concatenate(
        [
            np.roll(np.arange(a, b), -1)
            for a, b in zip(environment.ring_starts, environment.ring_starts[1:], strict=False)
        ]
    )
    return after, np.argsort(after)


def find_lines(environment: Environment, longest: float) -> CriticalLines:
    after, before = ring_neighbours(environment)
    reflex = np.flatnonzero(environment.is_reflex)
    return find_critical_lines(environment.vertices, after, before, reflex, environment.tolerance_m, longest, 0.0)


@pytest.mark.parametrize("seed", range(8))
def test_lines_stay_in_free_space_and_end_at_walls(seed: int) -> None:
    environment = environment_of(seed)
    lines = find_lines(environment, np.inf)
    origin = environment.vertices[lines.base]
    low, high = (origin + lines.reach[:, [k]] * lines.direction for k in (0, 1))
    assert environment.line_of_sight(low, high).all()
    beyond = 1e-3 * np.ones(len(origin))[:, None] * lines.direction
    assert not environment.line_of_sight(origin, high + beyond)[lines.end_vertex[:, 1] == NONE].any()
    for k in (0, 1):
        at_vertex = lines.end_vertex[:, k] != NONE
        ends = (low, high)[k]
        expected = environment.vertices[lines.end_vertex[at_vertex, k]]
        np.testing.assert_allclose(ends[at_vertex], expected, atol=environment.tolerance_m)
        wall = environment.walls[lines.end_wall[~at_vertex, k]]
        span, offset = wall[:, 1] - wall[:, 0], ends[~at_vertex] - wall[:, 0]
        across = (span[:, 0] * offset[:, 1] - span[:, 1] * offset[:, 0]) / np.hypot(*span.T)
        np.testing.assert_allclose(across, 0.0, atol=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_faces_satisfy_eulers_formula(seed: int) -> None:
    environment = environment_of(seed)
    after, _ = ring_neighbours(environment)
    arrangement = arrange(environment.vertices, after, find_lines(environment, np.inf), environment.tolerance_m)
    faces = np.split(arrangement.corners, arrangement.starts[1:-1])
    edges = {frozenset(edge) for face in faces for edge in zip(face, np.roll(face, -1), strict=True)}
    used = np.unique(arrangement.corners)
    np.testing.assert_array_equal(used, np.arange(len(arrangement.points)))
    assert len(used) - len(edges) + len(faces) == 1 - len(environment.holes)
    np.testing.assert_array_equal(arrangement.points[: len(environment.vertices)], environment.vertices)
    gaps = np.linalg.norm(arrangement.points[:, None] - arrangement.points[None], axis=2)
    assert gaps[~np.eye(len(gaps), dtype=bool)].min() > environment.tolerance_m


def test_near_points_become_the_first_of_them() -> None:
    rng = np.random.default_rng(4)
    places = rng.uniform(-0.5, 0.5, (40, 2))
    which = rng.integers(0, 40, 300)
    points = places[which] + rng.uniform(-3e-10, 3e-10, (300, 2))
    order = np.argsort(points @ np.array([0.8090173, 0.5877849]), kind="stable")
    first = [int(np.flatnonzero(which == w)[0]) for w in which]
    assert _merge(points, order, 1e-9).tolist() == first
