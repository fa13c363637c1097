"""Closed visibility against shapely's predicates, and against hand-made degenerate cases."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from planning.environment import Environment
from tests.planning.polygons import covered_segments, environment_of, free_points, rectilinear_environment, wall_points

SQUARE_WITH_PILLAR = Environment([(0, 0), (8, 0), (8, 8), (0, 8)], [[(3, 3), (5, 3), (5, 5), (3, 5)]])

# Two blocks, one from below and one from above, whose facing corners lie in one line at y = 4.
OFFSET_BLOCKS = Environment(
    [(0, 0), (2, 0), (2, 4), (4, 4), (4, 0), (12, 0), (12, 8), (8, 8), (8, 4), (6, 4), (6, 8), (0, 8)]
)

# Two rooms and a door between them: its jambs lie in line, at x = 4 and at x = 5.
DOOR = Environment([(0, 0), (4, 0), (4, 3), (5, 3), (5, 0), (9, 0), (9, 8), (5, 8), (5, 5), (4, 5), (4, 8), (0, 8)])


@pytest.mark.parametrize(
    ("environment", "p", "q", "visible", "why"),
    [
        (SQUARE_WITH_PILLAR, (1, 1), (7, 1), True, "nothing between"),
        (SQUARE_WITH_PILLAR, (1, 4), (7, 4), False, "through the pillar"),
        (SQUARE_WITH_PILLAR, (1, 3), (7, 3), True, "along a wall of the pillar"),
        (SQUARE_WITH_PILLAR, (1, 5), (5, 1), True, "through the pillar's corner only"),
        (SQUARE_WITH_PILLAR, (2, 2), (6, 6), False, "through two opposite corners of the pillar"),
        (SQUARE_WITH_PILLAR, (2, 2), (3, 3), True, "ends at a corner"),
        (SQUARE_WITH_PILLAR, (2, 2), (3.5, 3.5), False, "through a corner into the wall"),
        (SQUARE_WITH_PILLAR, (3, 3), (5, 5), False, "from corner to corner inside the wall"),
        (SQUARE_WITH_PILLAR, (3, 3), (5, 3), True, "a wall itself"),
        (SQUARE_WITH_PILLAR, (3, 4), (4, 3), False, "from wall to wall across the pillar"),
        (SQUARE_WITH_PILLAR, (3, 4), (3, 8), True, "from a wall along that wall"),
        (SQUARE_WITH_PILLAR, (4, 3), (4, 0), True, "from a wall straight away"),
        (SQUARE_WITH_PILLAR, (4, 4), (1, 1), False, "from inside the pillar"),
        (SQUARE_WITH_PILLAR, (4, 4), (4, 4), False, "inside the pillar, to itself"),
        (SQUARE_WITH_PILLAR, (4, 4), (4.5, 4), False, "both inside the pillar"),
        (SQUARE_WITH_PILLAR, (1, 1), (1, 1), True, "to itself"),
        (SQUARE_WITH_PILLAR, (0, 0), (8, 0), True, "along the outer wall, corner to corner"),
        (SQUARE_WITH_PILLAR, (0, 0), (0, 0), True, "a corner to itself"),
        (SQUARE_WITH_PILLAR, (-1, 0), (9, 0), False, "along the outer wall, from outside"),
        (SQUARE_WITH_PILLAR, (1, 1), (1, 9), False, "to a point outside"),
        (SQUARE_WITH_PILLAR, (0, 4), (3, 4), True, "from wall to wall across free space"),
        (OFFSET_BLOCKS, (0, 4), (12, 4), True, "between two walls in line, one below and one above"),
        (OFFSET_BLOCKS, (2, 4), (8, 4), True, "the same, from corner to corner"),
        (OFFSET_BLOCKS, (0, 4.1), (12, 3.9), True, "slanting between the blocks"),
        (OFFSET_BLOCKS, (0, 3.9), (12, 4.1), False, "slanting the other way"),
        (OFFSET_BLOCKS, (2, 4), (6, 4), True, "corner of one block to corner of the next"),
        (OFFSET_BLOCKS, (3, 4), (7, 4), True, "wall of one block to wall of the next"),
        (OFFSET_BLOCKS, (1, 3), (5, 3), False, "through the lower block"),
        (DOOR, (3, 2), (6, 5), True, "through a door, touching its jamb"),
        (DOOR, (4, 0), (4, 8), True, "along two walls in one line, across the door"),
        (DOOR, (4, 0), (5, 8), False, "leaves the wall into the door's other side"),
        (DOOR, (4, 3), (5, 5), True, "from jamb to jamb"),
        (DOOR, (3, 3), (9, 3), True, "along the door's sill"),
        (DOOR, (3, 1), (6, 4), False, "below the jamb"),
    ],
)
def test_degenerate_segment(
    environment: Environment, p: tuple[float, float], q: tuple[float, float], visible: bool, why: str
) -> None:
    assert environment.line_of_sight(p, q) is visible, why
    assert environment.line_of_sight(q, p) is visible, f"{why}, backwards"


@given(seed=st.integers(0, 10_000))
@settings(deadline=None, max_examples=25)
def test_whole_coordinates_agree_exactly_with_shapely(seed: int) -> None:
    """Points on the same grid as the walls: most segments touch something, and shapely's predicates are exact."""
    environment = rectilinear_environment(2 * seed)
    x_min, y_min, x_max, y_max = environment.bounds
    grid = np.stack(np.meshgrid(np.arange(x_min, x_max + 1), np.arange(y_min, y_max + 1)), axis=-1).reshape(-1, 2)
    points = np.random.default_rng(seed).permutation(grid)[:40]
    pairs = np.array(list(itertools.combinations(points, 2)))
    expected = covered_segments(environment, pairs)
    visible = environment.line_of_sight(pairs[:, 0], pairs[:, 1])
    wrong = np.flatnonzero(expected != visible)
    assert wrong.size == 0, f"{environment.name}: {pairs[wrong[:3]].tolist()}"
    assert np.array_equal(environment.contains(grid), shapely.covers(environment.polygon, shapely.points(grid)))


@given(seed=st.integers(0, 10_000))
@settings(deadline=None, max_examples=25)
def test_any_segment_lies_between_exact_and_tolerant_visibility(seed: int) -> None:
    """Covered segments are visible; visible segments leave free space by no more than rounding."""
    environment = environment_of(seed)
    rng = np.random.default_rng(seed)
    points = np.concatenate([free_points(environment, 25, rng), wall_points(environment, 25, rng)])
    pairs = np.array(list(itertools.combinations(points, 2)))
    segments = shapely.linestrings(pairs)
    wider = environment.polygon.buffer(1e-6, join_style="mitre")
    shapely.prepare(wider)
    visible = environment.line_of_sight(pairs[:, 0], pairs[:, 1])
    assert np.all(visible[covered_segments(environment, pairs)]), environment.name
    assert np.all(shapely.covers(wider, segments[visible])), environment.name
    inside = rng.permutation(25)[:10]
    matrix = environment.visibility_matrix(points[inside])
    i, j = np.triu_indices(10, k=1)
    expected = covered_segments(environment, np.stack([points[inside[i]], points[inside[j]]], axis=1))
    assert np.array_equal(matrix[i, j], expected), environment.name
    assert np.array_equal(matrix, matrix.T)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("offset", [(0.0, 0.0), (1e5, -1e5), (0.1, 0.3)])
@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_touches_survive_scale_and_distance_from_the_origin(
    scale: float, offset: tuple[float, float], angle: float
) -> None:
    """Rounded coordinates still graze: the exact answers on whole coordinates hold wherever the map lies."""
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    for seed in range(0, 8, 2):
        exact = rectilinear_environment(seed)
        moved = Environment(exact.outer @ turn * scale + offset, [hole @ turn * scale + offset for hole in exact.holes])
        assert len(moved.vertices) == len(exact.vertices), f"seed {seed}"
        points = np.floor(np.random.default_rng(seed).uniform(exact.bounds[:2], exact.bounds[2:], (40, 2)))
        expected = exact.visibility_matrix(points)
        assert np.array_equal(moved.visibility_matrix(points @ turn * scale + offset), expected), f"seed {seed}"


def test_visibility_matrix_is_reflexive_even_in_walls() -> None:
    seen = SQUARE_WITH_PILLAR.visibility_matrix([(1, 1), (4, 4), (1, 7)])
    assert seen.tolist() == [[True, False, True], [False, True, False], [True, False, True]]
    assert SQUARE_WITH_PILLAR.visibility_matrix(np.empty((0, 2))).shape == (0, 0)


def test_one_point_is_paired_with_many() -> None:
    many = np.array([(7.0, 2.0), (7.0, 4.0), (1.0, 4.0)])
    assert list(SQUARE_WITH_PILLAR.line_of_sight((1, 4), many)) == [False, False, True]
    assert list(SQUARE_WITH_PILLAR.line_of_sight(many, (1, 4))) == [False, False, True]
    assert list(SQUARE_WITH_PILLAR.line_of_sight(many, many)) == [True, True, True]
    assert SQUARE_WITH_PILLAR.line_of_sight((1, 4), np.empty((0, 2))).shape == (0,)
    with pytest.raises(ValueError, match="3 points and 2"):
        SQUARE_WITH_PILLAR.line_of_sight(many, many[:2])


def test_convex_room_sees_all_of_itself() -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 17)[:-1]
    room = Environment(np.stack([np.cos(angles), np.sin(angles)], axis=1))
    assert room.visibility_matrix(room.vertices).all()
