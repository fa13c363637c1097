from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from estimation import minkowski_sum, range_cut
from estimation.outlier_rule import Relaxation
from estimation.range_filter import RangeFilter
from estimation.range_measurement import BadRange, NothingMeasured
from tests.estimation.range_runs import Run, varied_runs


def replay(run: Run, f: RangeFilter) -> list[bool]:
    """Whether the target was inside after each range."""
    inside = []
    for step in run.steps():
        f.predict(step.moved_m)
        f.measure(step.anchor, step.range_m, run.epsilon_m)
        inside.append(bool(f.feasible_set().contains(step.target)))
    return inside


@pytest.mark.parametrize("part", range(4))
def test_never_loses_the_target(part: int) -> None:
    for run in varied_runs(1000 * part, 64):
        f = RangeFilter()
        for k, step in enumerate(run.steps()):
            f.predict(step.moved_m)
            report = f.measure(step.anchor, step.range_m, run.epsilon_m)
            assert report.accepted and not report.empty, (run, k)
            assert f.feasible_set().contains(step.target), (run, k)


@pytest.mark.parametrize("far_m", [0.0, 500e3])
@pytest.mark.parametrize("target_step_m", [0.0, 0.1])
def test_five_hundred_updates(far_m: float, target_step_m: float) -> None:
    run = Run(seed=7, robots=2, ranges=500, noise="bang-bang", far_m=far_m, target_step_m=target_step_m)
    f = RangeFilter()
    assert all(replay(run, f)), run
    assert f.feasible_set().area_m2 < (0.3 if target_step_m == 0.0 else 10.0), run


def on_paraboloid(points: np.ndarray, state: np.ndarray) -> np.ndarray:
    """|v|² of points (n, 2) in the frame of a state, 1 on the boundary."""
    lifted = np.column_stack([points, (points**2).sum(axis=1)])
    v = np.linalg.solve(state[5:].reshape(3, 3), (lifted - state[2:5]).T)
    return (v**2).sum(axis=0)


@pytest.mark.parametrize(("r0", "r1"), [(0.0, 1.0), (3.0, 4.0), (19.5, 20.5), (999.9, 1000.1)])
def test_the_first_ellipsoid_touches_both_edges_of_the_annulus_and_is_minimal(r0: float, r1: float) -> None:
    state = np.empty(range_cut.STATE)
    range_cut.begin(0.0, 0.0, r0, r1, state)
    ring = np.column_stack([np.linspace(r0, r1, 200), np.zeros(200)])
    reach = on_paraboloid(ring, state)
    assert reach.max() <= 1.0 + 1e-9
    assert reach[-1] == pytest.approx(1.0, abs=1e-6)
    assert reach[0] == pytest.approx(1.0, abs=1e-6) or r0 == 0.0

    # Independent: axis-symmetric ellipsoids around both edges, by their centre's height.
    def log_volume(log_rise: float) -> float:
        t0, t1 = r0**2, r1**2
        height = (t0 + t1) / 2 + math.exp(log_rise)
        # τ/a² + (τ − height)²/b² = 1 at both edges τ = r²: two linear equations in 1/a², 1/b².
        x = np.linalg.solve([[t0, (t0 - height) ** 2], [t1, (t1 - height) ** 2]], [1.0, 1.0])
        return float(-np.log(x[0]) - 0.5 * np.log(x[1])) if (x > 0).all() else math.inf

    if r0 > 0.0:
        top = math.log((r1**2 - r0**2) / 2)
        best = minimize_scalar(log_volume, bounds=(top - 12.0, top), method="bounded", options={"xatol": 1e-9})
        mine = math.log(range_cut.volume(state) / (4 / 3 * math.pi))
        assert mine == pytest.approx(best.fun, abs=1e-6)


def test_moving_the_frame_moves_nothing() -> None:
    rng = np.random.default_rng(3)
    state = np.concatenate([np.zeros(2), rng.normal(size=3), rng.normal(size=9)])
    points = rng.normal(size=(50, 2))
    before = on_paraboloid(points, state)
    volume = range_cut.volume(state)
    range_cut.move_origin(state, 3.25, -1.5)
    assert np.allclose(on_paraboloid(points - [3.25, -1.5], state), before, rtol=1e-9)
    assert range_cut.volume(state) == pytest.approx(volume, rel=1e-12)


def test_the_multiplier_keeps_the_paraboloid_and_is_the_best_one() -> None:
    rng = np.random.default_rng(5)
    used = 0
    for seed in range(60):
        state = np.concatenate([np.zeros(2), rng.normal(size=3), rng.normal(size=9)])
        state[4] = state[2:4] @ state[2:4] + 0.3 * rng.normal()
        points = rng.normal(size=(4000, 2)) * 2.0
        inside = on_paraboloid(points, state) <= 1.0
        tight = state.copy()
        empty, multiplier = range_cut.tighten(tight)
        if empty:
            assert not inside.any(), seed
            continue
        assert (on_paraboloid(points[inside] - tight[:2], tight) <= 1.0 + 1e-9).all(), seed
        inverse = np.linalg.inv(state[5:].reshape(3, 3))
        E, c = inverse.T @ inverse, state[2:5]
        P, half_s = np.diag([1.0, 1.0, 0.0]), np.array([0.0, 0.0, 0.5])

        def volume(mu: float, E: np.ndarray = E, c: np.ndarray = c) -> float:
            # (x − c)ᵀE(x − c) + μ(xᵀPx − s) ≤ 1, completed to a square.
            X = E + mu * P  # noqa: B023
            center = np.linalg.solve(X, E @ c + mu * half_s)  # noqa: B023
            k = 1.0 - c @ E @ c + center @ X @ center
            return float(k**3 / np.linalg.det(X)) if k > 0 else math.inf

        best = range_cut.volume(tight) ** 2 / (4 / 3 * math.pi) ** 2
        assert best <= volume(0.0) * (1 + 1e-9), seed
        if multiplier != 0.0:
            used += 1
            assert best == pytest.approx(volume(multiplier), rel=1e-6), seed
            assert best <= min(volume(0.9 * multiplier), volume(1.1 * multiplier)) * (1 + 1e-6), seed
    assert used > 20


def test_prediction_contains_every_move() -> None:
    rng = np.random.default_rng(8)
    for seed in range(40):
        state = np.concatenate([np.zeros(2), rng.normal(size=3), rng.normal(size=9)])
        state[4] = state[2:4] @ state[2:4] + 0.2 * rng.normal()
        points = rng.normal(size=(4000, 2)) * 2.0
        points = points[on_paraboloid(points, state) <= 1.0]
        distance = float(rng.choice([1e-3, 0.1, 1.0, 10.0]))
        turns = rng.uniform(0.0, 2.0 * np.pi, len(points))
        moved = points + distance * np.column_stack([np.cos(turns), np.sin(turns)])
        grown = state.copy()
        range_cut.grow(grown, distance)
        assert (on_paraboloid(moved - grown[:2], grown) <= 1.0 + 1e-9).all(), seed


def test_the_summing_parameter_is_the_best_one() -> None:
    rng = np.random.default_rng(12)
    for seed in range(40):
        L, D = rng.normal(size=(3, 3)), 10.0 ** rng.uniform(-3.0, 2.0, 3)

        def log_volume(p: float, L: np.ndarray = L, D: np.ndarray = D) -> float:
            return float(np.linalg.slogdet((1 + 1 / p) * L @ L.T + (1 + p) * np.diag(D**2))[1])

        p = minkowski_sum.summing_parameter(L, D)
        assert log_volume(p) <= min(log_volume(0.99 * p), log_volume(1.01 * p)) + 1e-9, seed


def test_reports() -> None:
    f = RangeFilter()
    f.predict(5.0)
    assert not f.started
    with pytest.raises(NothingMeasured, match="measure"):
        f.feasible_set()
    first = f.measure((0.0, 0.0), 20.0, 0.5)
    assert first.accepted and first.volume_before == math.inf and first.weight == 0.0
    again = f.measure((0.0, 0.0), 20.0, 3.0)
    assert again.accepted and again.redundant and again.weight == 1.0
    assert again.volume == again.volume_before
    other = f.measure((15.0, 5.0), 10.0, 0.5)
    assert other.accepted and not other.redundant and other.volume < other.volume_before and 0.0 < other.weight < 1.0
    for _ in range(2):
        wrong = f.measure((0.0, 0.0), 90.0, 0.5)
        assert wrong.empty and not wrong.accepted and wrong.volume == wrong.volume_before
    assert f.measure((0.0, 0.0), 90.0, 0.5).restarted
    assert f.feasible_set().contains((90.0, 0.0))
    f.reset()
    assert not f.started


def test_asymmetric_bounds() -> None:
    f = RangeFilter()
    f.measure((0.0, 0.0), 10.0, (0.1, 2.0))
    # The true distance lies in [9.9, 12]; the ellipsoid is a little larger.
    assert f.feasible_set().contains([[9.9, 0.0], [0.0, 12.0]]).all()
    assert not f.feasible_set().contains((8.9, 0.0))


@pytest.mark.parametrize(
    ("anchor", "range_m", "bound_m", "text"),
    [
        ((0.0, 0.0), math.nan, 0.5, "range of nan"),
        ((0.0, 0.0), 1.0, -0.5, "bound"),
        ((0.0, 0.0), 1.0, (0.1, math.inf), "bound"),
        ((0.0, math.nan), 1.0, 0.5, "anchor"),
        ((0.0, 0.0, 0.0), 1.0, 0.5, "anchor"),
        ((0.0, 0.0), "far", 0.5, "range of far"),
        ((0.0, 0.0), 1.0, [0.1, 0.2], "pair"),
        ((0.0, 0.0), 1.0, np.array([0.1, 0.2]), "pair"),
        ((0.0, 0.0), 1.0, (0.1, 0.2, 0.3), "pair"),
    ],
)
def test_bad_measurements_are_refused(anchor: tuple[float, ...], range_m: float, bound_m: Any, text: str) -> None:
    f = RangeFilter()
    f.measure((0.0, 0.0), 5.0, 0.5)
    before = f.snapshot()
    with pytest.raises(BadRange, match=text):
        f.measure(anchor, range_m, bound_m)
    with pytest.raises(BadRange, match="at least 0"):
        f.predict(-1.0)
    assert f.snapshot() == before


def test_a_snapshot_goes_on_exactly() -> None:
    run = Run(seed=11, ranges=20, target_step_m=0.1, far_m=500e3)
    f, g = RangeFilter(), RangeFilter()
    for k, step in enumerate(run.steps()):
        for each in (f, g) if k >= 10 else (f,):
            each.predict(step.moved_m)
            each.measure(step.anchor, step.range_m, run.epsilon_m)
        if k == 9:
            g.restore(f.snapshot())
    assert f.snapshot() == g.snapshot()


@pytest.mark.parametrize("outliers", ["reject", "relaxed"])
def test_five_per_cent_of_corrupt_ranges(outliers: str) -> None:
    lost = []
    for seed in range(200):
        run = Run(seed=seed, robots=1 + seed % 4, corrupt=0.05)
        f = RangeFilter(outliers=outliers)  # type: ignore[arg-type]
        for step in run.steps():
            f.measure(step.anchor, step.range_m, run.epsilon_m)
        if not f.feasible_set().contains(step.target):
            lost.append(seed)
    assert len(lost) <= 2, lost


def test_relaxed_keeps_its_promise_when_a_corrupt_range_does_not_show() -> None:
    for seed in range(40):
        rng = np.random.default_rng(seed)
        f = RangeFilter(outliers=Relaxation(tolerated=1, block=10))
        target = rng.uniform(-10.0, 10.0, 2)
        for k in range(30):
            anchor = rng.uniform(-20.0, 20.0, 2)
            wrong = 2.0 if k % 10 == seed % 10 else 0.0
            report = f.measure(anchor, np.hypot(*(anchor - target)) + rng.uniform(-0.5, 0.5) + wrong, 0.5)
            assert not report.empty, (seed, k)
            assert not f.started or f.feasible_set().contains(target), (seed, k)
        assert f.feasible_set().area_m2 < 60.0, seed


def test_unknown_ways_to_handle_outliers() -> None:
    with pytest.raises(ValueError, match="reject"):
        RangeFilter(outliers="hope")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="tolerate at least 1"):
        Relaxation(tolerated=3, block=3)
