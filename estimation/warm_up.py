"""Every kernel of the package, run once with the argument types of real use, so that all are compiled."""

from __future__ import annotations

import numpy as np


def exercise() -> None:
    """Find a target that moves, by ranges from three places, with every set and law."""
    from estimation.ellipsoid import Ellipsoid
    from estimation.fusion import fuse
    from estimation.information_control import Limits
    from estimation.look_ahead import look_ahead
    from estimation.range_filter import RangeFilter
    from estimation.strip import Strip
    from estimation.strip_cut import cut
    from estimation.thesis_filter import ThesisRangeFilter
    from estimation.tight_set import TightSet

    anchors = ((0.0, 0.0), (4.0, 0.0), (0.0, 3.0))
    target = np.array([2.0, 1.5])
    ellipsoids, tight, thesis = RangeFilter(), TightSet(), ThesisRangeFilter()
    for anchor in anchors:
        range_m = float(np.hypot(*(target - anchor)))
        for estimate in (ellipsoids, tight, thesis):
            estimate.measure(anchor, range_m, 0.1)
        ellipsoids.predict(0.1)
        tight.predict(0.1)
        for region in (ellipsoids.feasible_set(), tight):
            region.contains(target[None])
            region.farthest_point(target)
            _ = region.area_m2, region.centroid, region.covariance
        _ = ellipsoids.feasible_set().regions
    # More ranges than a tight set remembers, none of them redundant.
    for turn in np.linspace(0.0, 2.0 * np.pi, 40):
        tight.measure(target - 5.0 * np.array([np.cos(turn), np.sin(turn)]), 5.0, 0.1)
    look_ahead(tight, (1.0, 1.0), Limits(step_m=0.5, bound_m=0.1), steps=2)
    ball = Ellipsoid.ball(np.zeros(3), 1.0)
    fuse(ball, Ellipsoid.ball(np.full(3, 0.5), 1.0))
    cut(ball, Strip(np.array([1.0, 0.0, 0.0]), -0.5, 0.5))


PARTS = (exercise,)
