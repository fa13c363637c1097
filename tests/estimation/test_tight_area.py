"""How much larger the tight set is than what the ranges leave, against exact areas."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from estimation.tight_set import TightSet

Floats = np.typing.NDArray[np.float64]
Ring = tuple[Floats, float, float]
"""Centre, inner and outer radius."""


def exact_area(rings: list[Ring], near: Floats) -> float:
    """Of the intersection, by Green's theorem over the arcs of all circles that bound it. Take a place near to it."""
    centers = np.array([center for center, _, _ in rings]) - near
    bounds = np.array([[inner, outer] for _, inner, outer in rings])
    radii, other = bounds.ravel(), np.repeat(centers, 2, axis=0)
    total = 0.0
    for i, center in enumerate(centers):
        for r, sign in zip(bounds[i], (-1.0, 1.0), strict=True):
            if r <= 0.0:
                continue
            x, y = (other - center).T
            apart = np.hypot(x, y)
            with np.errstate(divide="ignore", invalid="ignore"):
                cosine = (apart + (r - radii) * (r + radii) / apart) / (2.0 * r)
            meets = np.abs(cosine) < 1.0
            turn, half = np.arctan2(y, x)[meets], np.arccos(cosine[meets])
            angles = np.concatenate([turn - half, turn + half]) % (2.0 * np.pi)
            angles = np.unique(np.concatenate([angles, np.linspace(0.0, 2.0 * np.pi, 9)]))
            middle = 0.5 * (angles[:-1] + angles[1:])
            points = center + r * np.column_stack([np.cos(middle), np.sin(middle)])
            distances = np.hypot(*(points[:, None] - centers).transpose(2, 0, 1))
            inside = (bounds[:, 0] <= distances) & (distances <= bounds[:, 1])
            inside[:, i] = True
            kept = inside.all(axis=1)
            first, last = (center + r * np.column_stack([np.cos(a), np.sin(a)]) for a in (angles[:-1], angles[1:]))
            step = np.diff(angles)
            # θ − sin θ without cancelling.
            bow = r * r * np.where(step < 1e-2, step**3 / 6.0 - step**5 / 120.0, step - np.sin(step))
            cross = first[:, 0] * last[:, 1] - first[:, 1] * last[:, 0]
            total += sign * 0.5 * float((cross + bow)[kept].sum())
    return total


def places(kind: str, rng: np.random.Generator, target: Floats, n: int) -> Floats:
    """(n, 2) where the ranges are measured."""
    turn = rng.uniform(0.0, 2.0 * np.pi)
    along, across = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    if kind == "wandering":
        return target + rng.uniform(-20, 20, 2) + np.cumsum(rng.normal(0.0, 0.8, (n, 2)), axis=0)
    if kind == "around":
        turns = rng.uniform(0.0, 2.0 * np.pi, n)
        return target + rng.uniform(5, 30, n)[:, None] * np.column_stack([np.cos(turns), np.sin(turns)])
    if kind == "mirror images":
        return target + across * rng.uniform(2, 15) + along * rng.uniform(-20, 20, n)[:, None]
    if kind == "almost on a line":
        on_line = target + across * rng.uniform(0, 15) + along * np.linspace(-10, 10, n)[:, None]
        return on_line + rng.normal(0.0, 0.05, (n, 2))
    if kind == "far away":
        return target + rng.uniform(200, 2000) * along + rng.uniform(-1, 1, (n, 2)) * rng.choice([5, 50, 300])
    if kind == "few anchors":
        count = int(rng.integers(2, 5))
        return (target + rng.uniform(-30, 30, (count, 2)))[np.arange(n) % count] + rng.normal(0.0, 0.01, (n, 2))
    if kind == "at the target":
        return target + rng.normal(0.0, 2.0, (n, 2))
    if kind == "one side, then another":
        sides = target + rng.uniform(-30, 30, (2, 2))
        return np.where(np.arange(n)[:, None] < 6, sides[0], sides[1]) + rng.normal(0.0, 1.0, (n, 2))
    if kind == "hardly moving":
        return target + rng.uniform(5, 25) * along + rng.normal(0.0, 0.2, (n, 2))
    return target + rng.uniform(-25, 25, 2) + along * 0.2 * np.arange(n)[:, None]


KINDS = (
    "wandering",
    "around",
    "mirror images",
    "almost on a line",
    "far away",
    "few anchors",
    "at the target",
    "one side, then another",
    "hardly moving",
    "slowly on a line",
)


def test_the_exact_area_is_that_of_finely_drawn_rings() -> None:
    rng = np.random.default_rng(0)
    for kind in ("wandering", "around", "at the target"):
        target = rng.uniform(-10, 10, 2)
        anchors = places(kind, rng, target, 4)
        rings, drawn = [], []
        for anchor in anchors:
            r = float(np.hypot(*(anchor - target)))
            inner, outer = max(0.0, r - 0.7), r + 0.4
            rings.append((anchor, inner, outer))
            hole = shapely.Point(anchor).buffer(inner, quad_segs=2000)
            drawn.append(shapely.Point(anchor).buffer(outer, quad_segs=2000).difference(hole))
        assert exact_area(rings, target) == pytest.approx(shapely.intersection_all(drawn).area, rel=1e-4), kind


@pytest.mark.parametrize("kind", KINDS)
def test_at_most_a_tenth_too_large(kind: str) -> None:
    ratios = []
    for seed in range(8):
        rng = np.random.default_rng([seed, KINDS.index(kind)])
        epsilon = (0.5, 0.3, 0.1, 0.05)[seed % 4]
        target = rng.uniform(-10, 10, 2)
        anchors = places(kind, rng, target, 40)
        # Of every eight runs four have errors at their bounds: all circles nearly meet at the target.
        errors = rng.choice([-1.0, 1.0], 40) if seed % 8 < 4 else rng.uniform(-1.0, 1.0, 40)
        held, rings = TightSet(), []
        for k, (anchor, error) in enumerate(zip(anchors, epsilon * errors, strict=True), start=1):
            z = max(0.0, float(np.hypot(*(anchor - target))) + error)
            held.measure(anchor, z, epsilon)
            assert held.contains(target), (seed, k)
            rings.append((anchor, max(0.0, z - epsilon - 1e-6), z + epsilon + 1e-6))
            if k in (5, 10, 20, 40):
                truth = exact_area(rings, held.centroid)
                # Of less than (30 µm)² neither the polygons nor the arcs are right to a tenth.
                if truth > 1e-9:
                    ratios.append((held.area_m2 / truth, seed, k))
    assert len(ratios) > 15
    # The arcs themselves are right to a thousandth.
    assert min(ratios)[0] > 0.999, min(ratios)
    assert max(ratios)[0] <= 1.1, max(ratios)


@pytest.mark.parametrize("step_m", [0.02, 0.1])
def test_of_a_moving_target_too(step_m: float) -> None:
    """Against finely drawn sets, grown by discs and cut by rings."""
    ratios = []
    for seed in range(16):
        rng = np.random.default_rng(seed)
        target = rng.uniform(-5, 5, 2)
        robots = target + rng.uniform(-20, 20, (1 + seed % 3, 2))
        heading, walk = rng.uniform(0.0, 2.0 * np.pi, (2, len(robots)))
        held, drawn = TightSet(), shapely.Point(target).buffer(1e3)
        for k in range(1, 31):
            i = k % len(robots)
            heading[i] += rng.normal(0.0, 0.3)
            robots[i] += 0.8 * np.array([np.cos(heading[i]), np.sin(heading[i])])
            walk[0] += rng.normal(0.0, 0.2)
            target = target + step_m * np.array([np.cos(walk[0]), np.sin(walk[0])])
            z = float(np.hypot(*(robots[i] - target))) + rng.uniform(-0.5, 0.5)
            held.predict(step_m)
            held.measure(robots[i], z, 0.5)
            assert held.contains(target), (seed, k)
            ring = shapely.Point(robots[i]).buffer(z + 0.5, quad_segs=128)
            ring = ring.difference(shapely.Point(robots[i]).buffer(z - 0.5, quad_segs=128)) if z > 0.5 else ring
            drawn = drawn.buffer(step_m, quad_segs=16).intersection(ring).simplify(1e-4)
            if k >= 5:
                ratios.append(held.area_m2 / drawn.area)
    assert min(ratios) > 0.99
    # The worst are pieces that overlap where no line parts them.
    median, most, worst = np.quantile(ratios, [0.5, 0.99, 1.0])
    assert median < 1.03 and most < 1.1 and worst < 1.3, (median, most, worst)
