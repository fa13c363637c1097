"""Boxes of collision regions against dense sampling, distances to segments, and the conic of the thesis."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from planning.coordination import bound_collisions, collision_boxes, collision_sections

Floats = NDArray[np.float64]
WHOLE = [0.0, 1.0, 0.0, 1.0]


def distance_to_segments(points: Floats, segments: Floats) -> Floats:
    """From points (..., 2) to segments (..., 2, 2)."""
    along = segments[..., 1, :] - segments[..., 0, :]
    offset = points - segments[..., 0, :]
    squared = np.einsum("...i,...i", along, along)
    share = np.clip(np.einsum("...i,...i", offset, along) / np.where(squared > 0.0, squared, 1.0), 0.0, 1.0)
    return np.linalg.norm(offset - share[..., None] * along, axis=-1)


def at(segments: Floats, shares: Floats) -> Floats:
    return segments[..., 0, :] + shares[..., None] * (segments[..., 1, :] - segments[..., 0, :])


def forced_pairs(count: int, seed: int) -> tuple[Floats, Floats]:
    """Pairs of segments, 5 in 6 degenerate: on a grid, parallel, nearly so, of no length, in line."""
    rng = np.random.default_rng(seed)
    i, j = rng.uniform(-1.0, 1.0, (2, count, 2, 2))
    kind = np.arange(count) % 6
    grid = kind == 1
    i[grid], j[grid] = rng.integers(-2, 3, (2, grid.sum(), 2, 2)) * 0.5
    along = i[:, 1] - i[:, 0]
    turned = np.where(kind == 3, rng.choice([1e-4, 1e-7, 1e-9, 1e-11, 1e-14], count), 0.0)
    tilt = along + turned[:, None] * along[:, ::-1] * [-1.0, 1.0]
    parallel = (kind == 2) | (kind == 3)
    stretched = rng.choice([-2.0, -1.0, -0.5, 0.5, 1.0, 3.0], count)
    j[parallel, 1] = j[parallel, 0] + (stretched[:, None] * tilt)[parallel]
    for segments, drawn in ((i, rng.uniform(size=count) < 0.6), (j, rng.uniform(size=count) < 0.6)):
        points = (kind == 4) & drawn
        segments[points, 1] = segments[points, 0]
    inline = kind == 5
    j[inline] = at(i[inline][:, None], rng.choice([-1.5, -0.5, 0.0, 0.3, 1.0, 1.2, 2.0], (inline.sum(), 2)))
    return i, j


@pytest.mark.parametrize("separation", [0.1, 1.2])
def test_boxes_of_many_pairs_are_tight_and_never_too_small(separation: float) -> None:
    i, j = forced_pairs(50_000, 7)
    boxes = bound_collisions(i, j, separation)
    none = np.isnan(boxes[:, 0])
    assert 0 < none.sum() < len(boxes)
    assert np.array_equal(np.isnan(boxes), np.repeat(none[:, None], 4, axis=1))
    assert np.nanmin(boxes) >= 0.0
    assert np.nanmax(boxes) <= 1.0
    # Dense sampling of κ_i: within the separation of the other segment exactly inside the box.
    for mine, other, least, greatest in ((i, j, boxes[:, 0], boxes[:, 1]), (j, i, boxes[:, 2], boxes[:, 3])):
        for share in np.linspace(0.0, 1.0, 41):
            distance = distance_to_segments(at(mine, np.full(len(mine), share)), other)
            boxed = (least <= share) & (share <= greatest)
            assert np.all(boxed[distance < separation])
            assert np.all(distance[boxed] <= separation + 1e-9)
        # Tight: the ends of the box collide themselves, and just outside of it nothing does.
        for end, outward in ((least, -1e-6), (greatest, 1e-6)):
            kept = ~none
            ends = distance_to_segments(at(mine[kept], end[kept]), other[kept])
            assert np.all(ends <= separation + 1e-10)
            inner = kept & (end + outward >= 0.0) & (end + outward <= 1.0)
            beyond = distance_to_segments(at(mine[inner], end[inner] + outward), other[inner])
            assert np.all(beyond >= separation)


def test_every_colliding_point_of_a_dense_grid_is_in_its_box() -> None:
    i, j = forced_pairs(6_000, 11)
    separation = 0.5
    boxes = bound_collisions(i, j, separation)
    shares = np.linspace(0.0, 1.0, 33)
    places_i, places_j = (at(segments[:, None], shares[None]) for segments in (i, j))
    for a, share_i in enumerate(shares):
        collides = np.linalg.norm(places_i[:, a, None] - places_j, axis=-1) < separation
        inside = (boxes[:, 2, None] <= shares) & (shares <= boxes[:, 3, None])
        inside &= ((boxes[:, 0] <= share_i) & (share_i <= boxes[:, 1]))[:, None]
        assert np.all(inside[collides])


def conic_box(i: Floats, j: Floats, S: float) -> Floats | None:
    """The box from the conic of thesis eq. 51: root intervals on the square's edges, and extrema inside it."""
    v, w, d = i[1] - i[0], j[1] - j[0], i[0] - j[0]
    A, B, C, D, E, F = v @ v, -2 * v @ w, w @ w, 2 * d @ v, -2 * d @ w, d @ d - S * S
    found: list[tuple[float, float]] = []
    for fixed in (0.0, 1.0):
        for a, b, c, flip in (
            (C, B * fixed + E, A * fixed**2 + D * fixed + F, False),
            (A, B * fixed + D, C * fixed**2 + E * fixed + F, True),
        ):
            if b * b >= 4 * a * c:
                roots = [(-b - np.sqrt(b * b - 4 * a * c)) / (2 * a), (-b + np.sqrt(b * b - 4 * a * c)) / (2 * a)]
                if roots[0] <= 1.0 and roots[1] >= 0.0:
                    found += [(root, fixed) if flip else (fixed, root) for root in np.clip(roots, 0.0, 1.0)]
    cross = abs(v[0] * w[1] - v[1] * w[0])
    centre = np.linalg.solve([[2 * A, B], [B, 2 * C]], [-D, -E])
    for sign in (-1.0, 1.0):
        x = centre[0] + sign * S * np.sqrt(C) / cross
        y = centre[1] + sign * S * np.sqrt(A) / cross
        found += [p for p in ((x, -(B * x + E) / (2 * C)), (-(B * y + D) / (2 * A), y)) if 0 <= min(p) <= max(p) <= 1]
    if not found:
        return None
    points = np.array(found)
    return np.array([points[:, 0].min(), points[:, 0].max(), points[:, 1].min(), points[:, 1].max()])


def test_boxes_are_those_of_the_conic() -> None:
    rng = np.random.default_rng(3)
    i, j = rng.uniform(-1.0, 1.0, (2, 2_000, 2, 2))
    boxes = bound_collisions(i, j, 0.6)
    colliding = 0
    for a, b, box in zip(i, j, boxes, strict=True):
        expected = conic_box(a, b, 0.6)
        assert (expected is None) == np.isnan(box[0])
        if expected is not None:
            colliding += 1
            assert box == pytest.approx(expected, abs=1e-7)
    assert colliding > 500


@pytest.mark.parametrize(
    ("i", "j", "separation", "box"),
    [
        ([(0, 0), (1, 0)], [(0, 0), (0, 1)], 1.2, WHOLE),  # where algorithm 9 as printed gives [0.66, 1]²
        ([(0, 0), (1, 0)], [(0.5, 0.5), (0.5, -0.5)], 0.1, [0.4, 0.6, 0.4, 0.6]),
        ([(0, 0), (4, 0)], [(4, 0), (0, 0)], 1.0, WHOLE),  # head on
        ([(0, 0), (4, 0)], [(0, 1), (4, 1)], 0.5, None),  # side by side
        ([(0, 0), (4, 0)], [(3, 1), (7, 1)], 1.25, [0.5625, 1.0, 0.0, 0.4375]),  # one ahead in the next lane
        ([(0, 0), (4, 0)], [(6, 0), (8, 0)], 1.0, None),  # in line
        ([(0, 0), (4, 0)], [(5, 0), (9, 0)], 2.0, [0.75, 1.0, 0.0, 0.25]),
        ([(0, 0), (4, 0)], [(2, 1), (2, 1)], 1.25, [0.3125, 0.6875, 0.0, 1.0]),  # one stands
        ([(2, 1), (2, 1)], [(0, 0), (4, 0)], 1.25, [0.0, 1.0, 0.3125, 0.6875]),
        ([(0, 0), (0, 0)], [(0, 1), (0, 1)], 1.5, WHOLE),  # both stand, too near
        ([(0, 0), (0, 0)], [(0, 1), (0, 1)], 0.5, None),
        ([(0, 0), (4, 0)], [(2, 1), (2, 3)], 0.9, None),  # too far by a little
        ([(0, 0), (4, 0)], [(0, 0), (4, 0)], 9.0, WHOLE),  # near everywhere
    ],
)
def test_boxes_known_by_hand(
    i: list[tuple[float, float]], j: list[tuple[float, float]], separation: float, box: list[float] | None
) -> None:
    found = bound_collisions([i], [j], separation)[0]
    if box is None:
        assert np.isnan(found).all()
    else:
        assert found == pytest.approx(box, abs=1e-9)


def test_a_tangent_pair_has_at_most_a_box_around_the_touching_point() -> None:
    box = bound_collisions([[(0, 0), (4, 0)]], [[(2, 1), (2, 3)]], 1.0)[0]
    assert np.isnan(box).all() or box == pytest.approx([0.5, 0.5, 0.0, 0.0], abs=1e-5)


@given(
    seed=st.integers(0, 2**32 - 1),
    scale=st.sampled_from([1e-3, 1.0, 1e3]),
    offset=st.sampled_from([0.0, 1e3, 5e5]),
)
def test_boxes_do_not_depend_on_frame_scale_or_order(seed: int, scale: float, offset: float) -> None:
    i, j = forced_pairs(60, seed)
    angle = np.random.default_rng(seed).uniform(0.0, 6.3)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    boxes = bound_collisions(i, j, 0.4)
    assert np.array_equal(boxes[:, [2, 3, 0, 1]], bound_collisions(j, i, 0.4), equal_nan=True)
    # What the moved frame rounds away is given to the radii, once for and once against.
    rounding = 1e-15 * (offset / scale + 10.0)
    moved = bound_collisions(i @ turn * scale + offset, j @ turn * scale + offset, 0.4 * scale)
    slack = 9 * rounding + 1e-10
    smaller, larger = bound_collisions(i, j, 0.4 - slack), bound_collisions(i, j, 0.4 + slack)
    for inner, outer in ((smaller, moved), (moved, larger)):
        present = ~np.isnan(inner[:, 0])
        assert not np.isnan(outer[present, 0]).any()
        assert np.all(outer[present][:, [0, 2]] <= inner[present][:, [0, 2]] + 1e-9)
        assert np.all(outer[present][:, [1, 3]] >= inner[present][:, [1, 3]] - 1e-9)


def test_sections_are_the_region_itself() -> None:
    i, j = forced_pairs(600, 5)
    shares = np.linspace(0.0, 1.0, 21)
    for a, b in zip(i, j, strict=True):
        sections = collision_sections(a, b, 0.5, shares)
        distances = np.linalg.norm(at(a[None, None], shares[None]) - at(b[None, None], shares[:, None]), axis=-1)
        inside = (sections[:, :1] <= shares) & (shares <= sections[:, 1:])
        assert np.all(inside[distances < 0.5])
        assert np.all(distances[inside] <= 0.5 + 1e-9)
        box = bound_collisions([a], [b], 0.5)[0]
        if not np.isnan(sections).all():
            assert box[0] <= np.nanmin(sections)
            assert np.nanmax(sections) <= box[1]


def test_boxes_of_paths_are_those_of_their_segments_in_metres() -> None:
    rng = np.random.default_rng(2)
    i, j = np.cumsum(rng.normal(size=(9, 2)), axis=0), np.cumsum(rng.normal(size=(6, 2)), axis=0)
    i[4] = i[3]
    boxes, segments = collision_boxes(i, j, 0.7)
    assert len(boxes) > 3
    expected = {}
    for a in range(len(i) - 1):
        for b in range(len(j) - 1):
            box = bound_collisions([i[a : a + 2]], [j[b : b + 2]], 0.7)[0]
            if not np.isnan(box[0]):
                expected[a, b] = box
    assert [tuple(pair) for pair in segments] == sorted(expected)
    covered_i, covered_j = (np.append(0.0, np.cumsum(np.hypot(*np.diff(path, axis=0).T))) for path in (i, j))
    for (a, b), box in zip(segments, boxes, strict=True):
        local = expected[a, b]
        assert box[:2] == pytest.approx(covered_i[a] + local[:2] * (covered_i[a + 1] - covered_i[a]))
        assert box[2:] == pytest.approx(covered_j[b] + local[2:] * (covered_j[b + 1] - covered_j[b]))


def test_a_robot_that_stands_has_a_path_of_one_point() -> None:
    boxes, segments = collision_boxes([(0, 0), (4, 0)], [(2, 0)], 0.5)
    assert segments.tolist() == [[0, 0]]
    assert boxes[0] == pytest.approx([1.5, 2.5, 0.0, 0.0])
    assert len(collision_boxes([(0, 0), (4, 0)], [(2, 3)], 0.5)[0]) == 0


def test_what_is_no_pair_is_refused() -> None:
    with pytest.raises(ValueError, match="2 segments with 1"):
        bound_collisions(np.zeros((2, 2, 2)), np.zeros((1, 2, 2)), 0.4)
    with pytest.raises(ValueError, match="separation of two robots is nan"):
        bound_collisions(np.zeros((1, 2, 2)), np.zeros((1, 2, 2)), np.nan)
    with pytest.raises(ValueError, match="not finite"):
        collision_boxes([(0, 0), (np.inf, 0)], [(0, 0)], 0.4)
    with pytest.raises(ValueError, match="no points"):
        collision_boxes(np.zeros((0, 2)), [(0, 0)], 0.4)
