"""Where a robot goes to learn more, by predicting the set: one step or several ahead over a fan of paths (spec E6).

The gradient laws ask how the next range's variance changes; this one asks how much of the set will be left. For a
hypothetical target x_i in the set and noise even in ±ε, a range from place p leaves another point x_j in the set with
probability max(0, 1 − | |x_j − p| − |x_i − p| | / 2ε), independently at every step. The mean over i of the sum over j
is the expected share of the set that is left: exactly, but for the points standing in for the set.
It sees what no gradient does: mirror images, two far regions, and paths that pay off only at their end.
"""

from __future__ import annotations

import math
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimation.information_control import Limits, NotAnEstimate, check_position
from estimation.kernel import kernel
from estimation.spread import spread_points

Floats = NDArray[np.float64]


POINTS = 64
"""Points that stand for the set; the cost rises with their square."""


class CoveredSet(Protocol):
    """A set as convex pieces: a :class:`estimation.tight_set.TightSet`."""

    @property
    def started(self) -> bool:
        """Whether anything is known."""

    @property
    def polygons(self) -> tuple[Floats, ...]:
        """The pieces, (n, 2) float each, counter-clockwise, metres, map frame."""


def look_ahead(
    shared: CoveredSet,
    position: ArrayLike,
    limits: Limits,
    steps: int = 1,
    judge: Literal["expected", "worst"] = "expected",
) -> Floats:
    """First heading of the path after which least of the set is left.

    Paths are straight, or turn by the same angle at each step, once to either side, so that ``steps`` of them make up a
    third of a circle: driving on past a target and rounding it are both in the fan.

    Args:
        shared: the set that the team shares; :data:`POINTS` points spread evenly stand for it.
        position: (2,) float, metres, map frame: the robot.
        limits: of the robot.
        steps: ranges to predict, at least 1; with 1 all paths are one straight step.
        judge: the expected share that is left, or an upper bound of the worst: for the target and the noise
            that leave most.

    Returns:
        (2,) float: a unit vector; zero when there is no estimate yet, when the robot cannot move, and when the set is
        no larger than a point. Ties go to the first heading, counter-clockwise from +x.

    Raises:
        NotAnEstimate: the position is not two finite numbers, or steps < 1.

    Complexity: O(paths · steps · points²): 5 steps of 24 headings, three paths each, take about 2 ms.
    """
    a = check_position(position)
    if steps < 1:
        raise NotAnEstimate(f"looking ahead takes at least 1 step, not {steps}")
    if not shared.started:
        return np.zeros(2)
    return best_heading(spread_points(shared.polygons, POINTS), a, limits, steps, judge)


def best_heading(
    points: Floats, position: Floats, limits: Limits, steps: int, judge: Literal["expected", "worst"]
) -> Floats:
    """:func:`look_ahead` for a set of points (k, 2) float, metres, that stand for the set."""
    if len(points) < 2 or limits.step_m == 0:
        return np.zeros(2)
    headings = 2 * math.pi * np.arange(limits.headings) / limits.headings
    turns = np.array([0.0]) if steps == 1 else np.array([0.0, -1.0, 1.0]) * (2 * math.pi / 3 / steps)
    angles = headings[:, None, None] + turns[:, None] * np.arange(steps)
    moves = limits.step_m * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    paths = (position + np.cumsum(moves, axis=2)).reshape(-1, steps, 2)
    left = predict_shares(points, paths, limits.bound_m, judge == "worst")
    # A tie, within rounding, must not be decided by rounding: peers on other machines decide too.
    best = int(np.argmax(left <= left.min() * (1 + 1e-9))) // len(turns)
    return np.array([math.cos(headings[best]), math.sin(headings[best])])


@kernel
def predict_shares(points: Floats, paths: Floats, bound_m: float, worst: bool) -> Floats:
    """Share of a set that ranges along each path are expected to leave, or will leave at worst.

    Args:
        points: (k, 2) float, metres: the set.
        paths: (m, n, 2) float, metres: where the n ranges are taken, for each path.
        bound_m: ε, metres.
        worst: instead of the mean over targets and noise, the most over both (an upper bound: noise at each step is
            taken to favour each other point).

    Returns:
        (m,) float in (0, 1].
    """
    k, n = len(points), paths.shape[1]
    shares = np.empty(len(paths))
    distances = np.empty((k, n))
    left = np.empty(k)
    for m in range(len(paths)):
        for i in range(k):
            for step in range(n):
                x, y = points[i, 0] - paths[m, step, 0], points[i, 1] - paths[m, step, 1]
                distances[i, step] = math.sqrt(x * x + y * y)
            left[i] = 1.0
        for i in range(k):
            for j in range(i):
                stays = 1.0
                for step in range(n):
                    stays *= max(0.0, 1.0 - abs(distances[i, step] - distances[j, step]) / (2.0 * bound_m))
                    if stays == 0.0:
                        break
                if worst and stays > 0.0:
                    stays = 1.0
                left[i] += stays
                left[j] += stays
        shares[m] = (left.max() if worst else left.mean()) / k
    return shares
