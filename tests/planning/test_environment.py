"""Rings become an environment or a clear refusal; grown walls keep their distance."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from planning.environment import Environment
from planning.inflation import PIECES_PER_QUARTER, NothingLeft
from planning.polygon_file import read_polygon_file
from planning.polygon_validation import InvalidEnvironment
from tests.planning.polygons import environment_of, free_points, rectilinear_environment, shared_maps

SQUARE = [(0, 0), (10, 0), (10, 10), (0, 10)]
PILLAR = [(4, 4), (6, 4), (6, 6), (4, 6)]


@given(seed=st.integers(0, 10_000), turned=st.booleans(), closed=st.booleans())
@settings(deadline=None, max_examples=30)
def test_any_direction_and_start_gives_the_same_free_space(seed: int, turned: bool, closed: bool) -> None:
    drawn = environment_of(seed)
    rings = []
    for ring in drawn.rings:
        given_ring = ring[::-1] if turned else ring
        # Points that say nothing new: halfway along a wall, and a vertex twice.
        given_ring = np.insert(given_ring, 1, [(given_ring[0] + given_ring[1]) / 2.0, given_ring[1]], axis=0)
        rings.append(np.concatenate([given_ring, given_ring[:1]]) if closed else given_ring)
    environment = Environment(rings[0], rings[1:], drawn.name)
    assert len(environment.vertices) == len(drawn.vertices)
    assert environment.area == pytest.approx(drawn.polygon.area)
    assert shapely.LinearRing(environment.outer).is_ccw
    assert not any(shapely.LinearRing(hole).is_ccw for hole in environment.holes)
    assert {tuple(v) for v in environment.vertices} == {tuple(v) for v in drawn.vertices}


@given(seed=st.integers(0, 10_000))
@settings(deadline=None, max_examples=30)
def test_arrays_fit_together(seed: int) -> None:
    environment = environment_of(seed)
    walls, vertices, starts = environment.walls, environment.vertices, environment.ring_starts
    assert np.array_equal(walls[:, 0], vertices)
    assert [len(ring) for ring in environment.rings] == list(np.diff(starts))
    for k, ring in enumerate(environment.rings):
        assert np.array_equal(walls[starts[k] : starts[k + 1], 1], np.roll(ring, -1, axis=0))
    assert environment.bounds == environment.polygon.bounds
    # Free space is to the left: a step from the middle of each wall, and one the other way.
    along = walls[:, 1] - walls[:, 0]
    left = 1e-6 * np.stack([-along[:, 1], along[:, 0]], axis=1)
    middle = walls.mean(axis=1)
    assert shapely.contains_xy(environment.polygon, middle + left).all()
    assert not shapely.intersects_xy(environment.polygon, middle - left).any()
    assert environment.contains(middle).all()
    # A vertex is reflex where more than half of a small circle around it is free.
    for vertex, reflex in zip(vertices, environment.is_reflex, strict=True):
        disc = shapely.Point(vertex).buffer(1e-5, quad_segs=32)
        assert (environment.polygon.intersection(disc).area > disc.area / 2) == reflex
    assert np.array_equal(environment.reflex_vertices, vertices[environment.is_reflex])


def test_points_along_walls_vanish_wherever_the_ring_starts() -> None:
    corners = np.array(SQUARE, dtype=float)
    sampled = np.concatenate(
        [np.linspace(a, b, 7, endpoint=False) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    )
    for start in range(len(sampled)):
        outer = Environment(np.asfortranarray(np.roll(sampled, start, axis=0))).outer
        assert {tuple(v) for v in outer} == {tuple(v) for v in corners}


def test_nothing_can_be_changed() -> None:
    environment = Environment(SQUARE, [PILLAR], "hall")
    with pytest.raises(dataclasses.FrozenInstanceError):
        environment.name = "other"  # type: ignore[misc]
    for array in (environment.outer, environment.holes[0], environment.vertices, environment.walls):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
    assert repr(environment) == "Environment('hall', 8 vertices, 1 holes, 96 m²)"


@pytest.mark.parametrize(
    ("outer", "holes", "sentence"),
    [
        ([(0, 0), (1, 1)], [], r"^the outer ring has 2 point\(s\): a ring needs at least 3$"),
        ([], [], r"^the outer ring is not a list of points: give it as"),
        ("ring", [], r"^the outer ring is not a list of points"),
        ([(0, 0, 0), (1, 0, 0), (1, 1, 0)], [], r"^the outer ring is not a list of points"),
        (SQUARE, [PILLAR, [(1, 1), (2, 1), (2, np.nan)]], r"^hole 2 has a coordinate that is not a finite .* point 3:"),
        ([(0, 0), (np.inf, 0), (1, 1)], [], r"^the outer ring has a coordinate that is not a finite .* point 2:"),
        ([(0, 0), (5, 5), (9, 9)], [], r"^the outer ring encloses no area"),
        ([(1, 1), (1, 1), (1, 1)], [], r"^the outer ring encloses no area"),
        (SQUARE, [[(1, 1), (2, 2), (3, 3)]], r"^hole 1 encloses no area"),
        ([(0, 0), (4, 4), (4, 0), (0, 4)], [], r"^the outer ring crosses itself at \(2.000, 2.000\) m: put its points"),
        (
            [(0, 0), (4, 0), (4, 4), (2, 0), (0, 4)],
            [],
            r"^the outer ring touches itself at \(2.000, 0.000\) m: move the points there apart",
        ),
        (
            [(0, 0), (2, 2), (4, 0), (4, 4), (2, 2), (0, 4)],
            [],
            r"^the outer ring touches itself at \(2.000, 2.000\) m",
        ),
        (
            [(0, 0), (4, 0), (4, 2), (7, 2), (4, 2), (4, 4), (0, 4)],
            [],
            r"^the outer ring touches itself at \(4.000, 2.000\) m",
        ),
        (SQUARE, [PILLAR, [(1, 1), (3, 3), (3, 1), (1, 3)]], r"^hole 2 crosses itself at \(2.000, 2.000\) m"),
        (
            SQUARE,
            [[(8, 4), (12, 4), (12, 6), (8, 6)]],
            r"^hole 1 crosses the outer ring at \(10.000, [46].000\) m: cut",
        ),
        (SQUARE, [[(8, 4), (10, 5), (8, 6)]], r"^hole 1 touches the outer ring at \(10.000, 5.000\) m: cut it out"),
        (SQUARE, [[(10, 4), (12, 4), (12, 6), (10, 6)]], r"^hole 1 touches the outer ring at \(10.000, [46].000\) m"),
        (SQUARE, [PILLAR, [(5, 5), (8, 5), (8, 8), (5, 8)]], r"^hole 2 crosses hole 1 at \(\d.000, \d.000\) m: merge"),
        (SQUARE, [PILLAR, [(6, 6), (8, 6), (8, 8), (6, 8)]], r"^hole 2 touches hole 1 at \(6.000, 6.000\) m: merge"),
        (SQUARE, [PILLAR, PILLAR], r"^hole 2 touches hole 1 at"),
        (SQUARE, [[(20, 0), (21, 0), (21, 1)]], r"^hole 1 lies outside the outer ring at \(20.000, 0.000\) m: delete"),
        (SQUARE, [[(-1, -1), (11, -1), (11, 11), (-1, 11)]], r"^hole 1 lies outside the outer ring at"),
        (SQUARE, [PILLAR, [(4.5, 4.5), (5, 4.5), (5, 5)]], r"^hole 2 lies inside hole 1 at \(4.500, 4.500\) m: delete"),
        (SQUARE, [[(4.5, 4.5), (5, 4.5), (5, 5)], PILLAR], r"^hole 1 lies inside hole 2 at \(4.500, 4.500\) m: delete"),
    ],
)
def test_refusal_names_ring_place_and_remedy(outer: object, holes: list[object], sentence: str) -> None:
    with pytest.raises(InvalidEnvironment, match=sentence) as refusal:
        Environment(outer, holes)  # type: ignore[arg-type]
    assert "\n" not in str(refusal.value)


@given(seed=st.integers(0, 10_000))
@settings(deadline=None, max_examples=60)
def test_random_ring_is_refused_exactly_when_it_is_not_simple(seed: int) -> None:
    ring = np.random.default_rng(seed).integers(0, 8, (5, 2))
    shape = shapely.Polygon(ring)
    flat = shapely.MultiPoint(ring).convex_hull.area == 0.0
    try:
        environment = Environment(ring)
    except InvalidEnvironment:
        # Spikes of a repeated point aside, which vanish when points are cleaned, shapely sees the fault too.
        assert flat or not shape.is_valid, ring.tolist()
    else:
        assert environment.polygon.is_valid, ring.tolist()
        assert environment.area == pytest.approx(shape.area)


def test_shared_hard_polygons_are_accepted_or_refused_with_reason() -> None:
    for path in shared_maps("polygons"):
        drawn = read_polygon_file(path)
        try:
            environment = Environment.load(path)
        except InvalidEnvironment as refusal:
            # Weakly simple: shapely lets rings touch in a point, free space for robots does not.
            assert "touches" in str(refusal), path
        else:
            assert environment.area == pytest.approx(shapely.Polygon(drawn.outer, drawn.holes).area), path


@given(seed=st.integers(0, 10_000), radius=st.floats(0.05, 0.7))
@settings(deadline=None, max_examples=30)
def test_grown_walls_keep_at_least_the_radius_and_little_more(seed: int, radius: float) -> None:
    environment = environment_of(seed)
    boundary = environment.polygon.boundary
    most = radius / np.cos(np.pi / (4 * PIECES_PER_QUARTER)) + 1e-4  # the margin that parts what only touches
    try:
        left = environment.inflated(radius)
    except NothingLeft:
        assert environment.polygon.buffer(-most).is_empty
        return
    assert boundary.distance(left.polygon) >= radius
    assert environment.polygon.covers(left.polygon)
    # Nothing that is farther than the circumscribed arcs reach is lost, but for what lies in other components.
    sure = environment.polygon.buffer(-most, quad_segs=64)
    for part in shapely.get_parts(sure):
        point = part.representative_point()
        whole = environment.inflated(radius, containing=point.coords[0]).polygon
        assert whole.buffer(1e-6).covers(part), environment.name


def test_grown_walls_of_the_shared_maps_keep_their_distance() -> None:
    for path in [*shared_maps("thesis"), *shared_maps("polygons")]:
        try:
            environment = Environment.load(path)
        except InvalidEnvironment:
            continue
        radius = 0.004 * float(np.sqrt(environment.area))
        left = environment.inflated(radius)
        # Of two polygons one of which holds the other, the vertices of either tell the distance.
        to_walls = shapely.distance(environment.polygon.boundary, shapely.points(left.vertices)).min()
        to_corners = shapely.distance(left.polygon, shapely.points(environment.vertices)).min()
        assert min(to_walls, to_corners) >= radius, path


def test_grown_square_is_a_smaller_square_with_a_rounded_pillar() -> None:
    left = Environment(SQUARE, [PILLAR], "hall", source="CC0").inflated(1.0)
    assert left.bounds == pytest.approx((1, 1, 9, 9), abs=1e-7)
    assert [len(ring) for ring in left.rings] == [4, 4 * PIECES_PER_QUARTER]
    assert left.area == pytest.approx(64 - (4 + 8 + np.pi), abs=0.02)
    assert (left.name, left.source) == ("hall", "CC0")


def test_no_radius_changes_nothing_and_a_bad_one_is_refused() -> None:
    environment = Environment(SQUARE)
    assert environment.inflated(0.0) is environment
    for radius in (-0.1, np.nan, np.inf):
        with pytest.raises(ValueError, match="the radius is"):
            environment.inflated(radius)


DUMBBELL = Environment(
    [(0, 0), (6, 0), (6, 2.5), (9, 2.5), (9, 0), (13, 0), (13, 6), (9, 6), (9, 3.5), (6, 3.5), (6, 6), (0, 6)],
    name="two",
)


@pytest.mark.parametrize(
    ("point", "x_range"),
    [
        (None, (1, 5)),  # the larger room
        ((11, 3), (10, 12)),  # inside the smaller
        ((12.9, 5.9), (10, 12)),  # in its corner, where the robot cannot be: the nearest place in sight
        ((7, 3), (1, 5)),  # in the corridor, which is too narrow
        ((8, 3), (10, 12)),
    ],
)
def test_component_of_what_is_left(point: tuple[float, float] | None, x_range: tuple[float, float]) -> None:
    left = DUMBBELL.inflated(1.0, containing=point)
    # The corridor's mouths are wide enough for a part of a disc, hence the slack.
    assert (left.bounds[0], left.bounds[2]) == pytest.approx(x_range, abs=0.15)


def test_nothing_left_names_the_radius_and_the_place() -> None:
    with pytest.raises(NothingLeft, match=r"^a robot of radius 4 m fits nowhere on the map 'two': use a smaller robot"):
        DUMBBELL.inflated(4.0)
    hidden = Environment([(0, 0), (9, 0), (9, 9), (8.5, 9), (8.5, 0.5), (8, 0.5), (8, 8), (0, 8)])
    with pytest.raises(NothingLeft, match=r"fits nowhere in sight of \(8.750, 8.500\) m on the map: .* another place"):
        hidden.inflated(0.5, containing=(8.75, 8.5))


@pytest.mark.parametrize("radius", [0.5, 0.5 * np.sqrt(2.0), 1.0, 0.25])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_walls_that_grow_until_they_just_touch(radius: float, scale: float) -> None:
    """Gaps of exactly twice the radius, facing walls and facing corners, close or part without pinches."""
    for seed in range(0, 12, 2):
        exact = rectilinear_environment(seed)
        environment = Environment(exact.outer * scale, [hole * scale for hole in exact.holes])
        try:
            left = environment.inflated(radius * scale)
        except NothingLeft:
            continue
        assert environment.polygon.boundary.distance(left.polygon) >= radius * scale
        assert left.polygon.is_valid


@pytest.mark.parametrize("offset", [(1e5, -1e5), (0.1, 1e4)])
def test_growing_far_from_the_origin(offset: tuple[float, float]) -> None:
    for seed in range(4):
        drawn = environment_of(seed)
        moved = Environment(drawn.outer + offset, [hole + offset for hole in drawn.holes])
        left = moved.inflated(0.3)
        assert moved.polygon.boundary.distance(left.polygon) >= 0.3
        assert left.area == pytest.approx(drawn.inflated(0.3).area, rel=1e-6)


def test_contains_agrees_with_shapely() -> None:
    for seed in range(6):
        environment = environment_of(seed)
        rng = np.random.default_rng(seed)
        low, high = np.array(environment.bounds[:2]) - 1.0, np.array(environment.bounds[2:]) + 1.0
        points = rng.uniform(low, high, (500, 2))
        expected = shapely.intersects_xy(environment.polygon, points)
        assert np.array_equal(environment.contains(points), expected), environment.name
        assert environment.contains(free_points(environment, 50, rng)).all()
    assert environment.contains((1e9, 0)).tolist() == [False]
