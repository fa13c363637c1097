from __future__ import annotations

import numpy as np
import pytest
import shapely

from estimation.feasible_set import EmptyFeasibleSet, FeasibleSet
from estimation.quartic import negative_intervals
from estimation.range_filter import RangeFilter
from tests.estimation.range_runs import Run

Floats = np.typing.NDArray[np.float64]


def grid_area(feasible: FeasibleSet, n: int = 500) -> tuple[float, Floats]:
    """Area and the points inside, on a fine grid over the base projection."""
    shadow = feasible.base_projection()
    reach = np.sqrt(((shadow.axes * shadow.semi_axes) ** 2).sum(axis=1))
    sides = [np.linspace(c - r, c + r, n) for c, r in zip(shadow.center, reach, strict=True)]
    X, Y = np.meshgrid(*sides)
    points = np.column_stack([X.ravel(), Y.ravel()])
    inside = feasible.contains(points)
    cell = (sides[0][1] - sides[0][0]) * (sides[1][1] - sides[1][0])
    return float(inside.sum() * cell), points[inside]


def polygon_area(feasible: FeasibleSet) -> float:
    shapes = [shapely.Polygon(region.outer, region.holes) for region in feasible.regions]
    assert all(shape.is_valid for shape in shapes)
    return float(sum(shape.area for shape in shapes))


def test_area_boundary_and_moments_against_a_fine_grid() -> None:
    kinds: dict[tuple[int, int], int] = {}
    for seed in range(24):
        run = Run(seed=seed, ranges=1 + seed % 12)
        f = RangeFilter()
        for step in run.steps():
            f.measure(step.anchor, step.range_m, run.epsilon_m)
        feasible = f.feasible_set()
        area, points = grid_area(feasible)
        assert feasible.area_m2 == pytest.approx(area, rel=1e-2), seed
        assert polygon_area(feasible) == pytest.approx(feasible.area_m2, rel=8e-3), seed
        spread = np.cov(points.T)
        assert feasible.centroid == pytest.approx(points.mean(axis=0), abs=0.02 * np.sqrt(np.trace(spread))), seed
        assert feasible.covariance == pytest.approx(spread, abs=0.02 * np.abs(spread).max()), seed
        assert feasible.base_projection().contains(points).all(), seed
        far = feasible.farthest_point((0.0, 0.0))
        assert np.hypot(*far) >= np.hypot(*points.T).max() - feasible.tolerance_m, seed
        kind = (len(feasible.regions), sum(len(region.holes) for region in feasible.regions))
        kinds[kind] = kinds.get(kind, 0) + 1
    assert {(1, 1), (1, 0), (2, 0)} <= set(kinds), kinds


def test_polygons_are_simple() -> None:
    """Two ranges leave mirror images that begin and end on the same line of the sweep, up to rounding."""
    for seed in range(150):
        run = Run(seed=seed, ranges=1 + seed % 6, robots=1 + seed % 2)
        f = RangeFilter()
        for step in run.steps():
            f.measure(step.anchor, step.range_m, run.epsilon_m)
        assert polygon_area(f.feasible_set()) == pytest.approx(f.feasible_set().area_m2, rel=1e-2), seed


def test_vertices_are_on_the_boundary() -> None:
    f = RangeFilter()
    for step in Run(seed=1, ranges=4).steps():
        f.measure(step.anchor, step.range_m, 0.5)
    feasible = f.feasible_set()
    for region in feasible.regions:
        for ring in (region.outer, *region.holes):
            normal = np.roll(ring, -1, axis=0) - np.roll(ring, 1, axis=0)
            normal = np.column_stack([normal[:, 1], -normal[:, 0]]) / np.hypot(*normal.T)[:, None]
            step_m = 1e-4 * np.sqrt(feasible.area_m2)
            assert (~feasible.contains(ring + step_m * normal)).mean() > 0.98
            assert feasible.contains(ring - step_m * normal).mean() > 0.98


def test_two_mirror_images() -> None:
    """Ranges from a straight line cannot tell left from right."""
    f = RangeFilter()
    target = np.array([3.0, 12.0])
    for x in np.linspace(-20.0, 20.0, 30):
        f.measure((x, 0.0), float(np.hypot(*(target - (x, 0.0)))), 0.3)
    feasible = f.feasible_set()
    assert len(feasible.regions) == 2
    assert feasible.contains([target, target * (1.0, -1.0)]).all()
    left, right = (shapely.Polygon(region.outer) for region in feasible.regions)
    assert left.area == pytest.approx(right.area, rel=0.05)
    assert feasible.area_m2 == pytest.approx(grid_area(feasible)[0], rel=1e-2)
    assert feasible.centroid[1] == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize("scale", [1e-5, 1.0, 1e4])
@pytest.mark.parametrize(("p", "q"), [(0.0, 0.0), (0.2, 0.1), (0.5, 0.0)])
def test_random_normal_forms_against_a_grid(scale: float, p: float, q: float) -> None:
    """Every shape there is, tiny and huge: a random ellipsoid near the paraboloid."""
    rng = np.random.default_rng(17)
    seen = set()
    for seed in range(12):
        L = np.diag([1.0, rng.uniform(0.1, 1.0), rng.uniform(0.02, 1.0)]) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
        c = np.array([p, q, rng.uniform(-0.3, 0.9)])
        lift = np.array([scale, scale, scale**2])
        feasible = FeasibleSet((0.0, 0.0), c * lift, L * lift[:, None])
        area, _ = grid_area(feasible, 300)
        assert feasible.area_m2 == pytest.approx(area, rel=3e-2, abs=3e-4 * scale**2), seed
        assert polygon_area(feasible) == pytest.approx(feasible.area_m2, rel=1.5e-2, abs=1e-5 * scale**2), seed
        seen.add((len(feasible.regions), sum(len(region.holes) for region in feasible.regions)))
    assert (1, 0) in seen


def test_an_exact_annulus() -> None:
    """c = (0, 0, h), L = diag(a, a, b): the set is a ring with radii in closed form."""
    a, b, h = 3.0, 0.4, 4.0
    feasible = FeasibleSet((100.0, -50.0), (0.0, 0.0, h), np.diag([a, a, b]))
    # τ/a² + (τ − h)²/b² = 1.
    tau = np.roots([1 / b**2, 1 / a**2 - 2 * h / b**2, h**2 / b**2 - 1])
    assert feasible.area_m2 == pytest.approx(np.pi * abs(tau[0] - tau[1]), rel=1e-4)
    (region,) = feasible.regions
    assert len(region.holes) == 1
    assert np.hypot(*(region.outer - (100.0, -50.0)).T) == pytest.approx(np.sqrt(tau.max()), rel=1e-9)
    assert np.hypot(*(region.holes[0] - (100.0, -50.0)).T) == pytest.approx(np.sqrt(tau.min()), rel=1e-9)
    assert feasible.determinant == pytest.approx((a * a * b) ** -2)
    assert feasible.trace == pytest.approx(2 / a**2 + 1 / b**2)


def test_tangent_slice_is_the_tangent_planes() -> None:
    feasible = FeasibleSet((0.0, 0.0), (0.3, -0.2, 0.2), np.diag([1.0, 0.8, 0.5]))
    flat = feasible.tangent_slice()
    x = np.array([0.3, -0.2])
    rng = np.random.default_rng(0)
    points = x + rng.normal(size=(2000, 2))
    heights = points @ (2 * x) - x @ x
    inside = (((np.column_stack([points, heights]) - (0.3, -0.2, 0.2)) / (1.0, 0.8, 0.5)) ** 2).sum(axis=1) <= 1
    assert (flat.contains(points) == inside).all()  # type: ignore[union-attr]


def test_nothing_feasible() -> None:
    feasible = FeasibleSet((0.0, 0.0), (0.0, 0.0, -5.0), np.eye(3))
    assert feasible.is_empty and feasible.area_m2 == 0.0 and feasible.regions == ()
    with pytest.raises(EmptyFeasibleSet, match="nothing is feasible"):
        _ = feasible.centroid
    with pytest.raises(ValueError, match="regular factor"):
        FeasibleSet((0.0, 0.0), (0.0, 0.0, 0.0), np.diag([1.0, 1.0, 0.0]))


def test_quartics_against_numpy() -> None:
    rng = np.random.default_rng(9)
    ends = np.zeros(4)
    for seed in range(500):
        roots = np.sort(rng.uniform(-1.0, 1.0, 4))
        if rng.random() < 0.3:
            coefficients = np.polymul(np.poly(roots[:2]), [1.0, 0.0, rng.uniform(0.1, 1.0)])
            roots = roots[:2]
        else:
            coefficients = np.poly(roots)
        coefficients = coefficients * 10.0 ** rng.uniform(-8, 8)
        n = negative_intervals(coefficients[::-1].copy(), -1.5, 1.5, ends)
        assert n == len(roots), seed
        assert ends[:n] == pytest.approx(roots, abs=1e-5), seed
