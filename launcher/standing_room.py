"""Places beside each other, for members of a team that a plan sends to one place, or to where somebody stands."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

REACH = 4
"""Steps in either direction as far as which a place beside a place is sought; a step is a little more than needed."""

_AROUND = np.stack(np.meshgrid(*2 * [np.arange(-REACH, REACH + 1)]), axis=-1).reshape(-1, 2)
_NEAREST_FIRST = _AROUND[np.argsort(np.hypot(*_AROUND.T), kind="stable")]


def stand_apart(
    places: ArrayLike, settled: Iterable[int], radii_m: ArrayLike, fits: Callable[[int, Floats, Floats], bool]
) -> Floats:
    """Let those who would overlap stand beside each other.

    Args:
        places: (k, 2) float, metres, map frame: where all are sent.
        settled: rows that stay where they are sent in any case.
        radii_m: (k,) float, metres; who has no body is in nobody's way.
        fits: whether a row can stand at a place (2,), given where all stand, (k, 2); not asked of where it is sent.

    Returns:
        (k, 2) float: those who find no place near by stay where they are sent.

    Complexity: O(k²) tries of ``fits`` at most.
    """
    chosen, radii = np.array(places, dtype=np.float64), np.asarray(radii_m, dtype=np.float64)
    done = [*settled]
    for row in sorted({*range(len(chosen))} - {*done}):
        others = [other for other in done if min(radii[row], radii[other]) > 0.0]
        for place in _look_around(chosen[row], 2.1 * float(radii[[row, *others]].max())):
            if all(math.dist(place, chosen[other]) >= radii[row] + radii[other] for other in others) and (
                np.array_equal(place, chosen[row]) or fits(row, place, chosen)
            ):
                chosen[row] = place
                break
        done.append(row)
    return chosen


def overlapping(places: Floats, radii_m: Floats) -> Iterator[tuple[int, int]]:
    """Pairs of rows whose discs overlap."""
    for one in range(len(places)):
        for other in range(one):
            apart = radii_m[one] + radii_m[other]
            if min(radii_m[one], radii_m[other]) > 0.0 and math.dist(places[one], places[other]) < apart:
                yield other, one


def _look_around(place: Floats, step_m: float) -> Floats:
    """The place itself, then others around it, the nearest first: (n, 2)."""
    around: Floats = place + step_m * _NEAREST_FIRST
    return around
