"""The monitor: silent while the promise is kept, loud soon after it is broken; its chances against scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from estimation.containment_monitor import ContainmentMonitor, NotMonitored


def watch(seed, ranges, true_bound, bound, corrupt=0.0):
    """A static target on a line of candidates, the intersection of intervals as the set; ranges until the alarm."""
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(np.linspace(-4, 4, 161), np.linspace(-4, 4, 161)), axis=-1).reshape(-1, 2)
    held, rejected = grid, 0
    monitor = ContainmentMonitor()
    for count in range(1, ranges + 1):
        anchor = rng.uniform(-15, 15, 2)
        z = np.hypot(*anchor) + rng.uniform(-true_bound, true_bound)
        if rng.random() < corrupt:
            z += rng.uniform(5, 20)
        r = np.hypot(*(held - anchor).T)
        verdict = monitor.observe(z, bound, r.min(), r.max())
        if verdict.too_small:
            return count, verdict
        rest = held[np.abs(r - z) <= bound]
        rejected = 0 if len(rest) else rejected + 1
        held = rest if len(rest) else grid if rejected == 3 else held
    return None, monitor.verdict()


@pytest.mark.parametrize("seed", range(5))
def test_silent_while_the_promise_is_kept(seed):
    # The grid of candidates is 0.05 m wide: so much is added to the bound.
    assert watch(seed, 400, 0.5, 0.54)[0] is None
    assert watch(seed, 400, 0.5, 0.54, corrupt=0.01)[0] is None


@pytest.mark.parametrize("share, within", [(0.4, 40), (0.6, 120), (0.8, 400)])
def test_loud_when_the_bound_is_too_small(share, within):
    counts = []
    for seed in range(5):
        count, verdict = watch(seed, within, 0.5, 0.5 * share)
        assert count is not None, f"seed {seed}"
        assert verdict.suggested_bound_m > 0.5 * share
        counts.append(count)
    assert np.median(counts) < within / 2


def test_the_chance_is_the_binomial_tail():
    monitor = ContainmentMonitor(corrupt_share=0.05, window=50)
    for number in range(80):
        verdict = monitor.observe(10.0 if number % 7 else 13.0, 1.0, 9.5, 10.5)
        n, k = verdict.ranges, verdict.contradictions
        assert verdict.chance == pytest.approx(binom.sf(k - 1, n, 0.05), rel=1e-9)
    assert verdict.ranges == 50


def test_no_corrupt_ranges_promised_means_none_forgiven():
    monitor = ContainmentMonitor(corrupt_share=0.0)
    assert not monitor.verdict().too_small
    assert not monitor.observe(10, 1, 8, 9.5).too_small
    verdict = monitor.observe(10, 1, 11.4, 12)
    assert verdict.too_small
    assert verdict.suggested_bound_m == pytest.approx(1.4)


def test_a_monitor_that_cannot_be():
    with pytest.raises(NotMonitored, match="share"):
        ContainmentMonitor(corrupt_share=0.5)
    with pytest.raises(NotMonitored, match="window"):
        ContainmentMonitor(window=3)


@pytest.mark.parametrize("place", range(4))
def test_what_is_not_finite_is_no_agreement(place):
    monitor, told = ContainmentMonitor(), [5.0, 0.1, 4.8, 5.2]
    told[place] = float("nan")
    with pytest.raises(NotMonitored, match="finite"):
        monitor.observe(*told)
    assert monitor.verdict().ranges == 0
