"""Virtual edge weights of the mutual visibility graph: what makes one deployment better than another.

Thesis §3.3.1. Three preferences add up on every edge (i, j) of the graph (eq. 19): a tight deployment (distance of the
centroids, eq. 20), large cells (inverse area, eq. 21, or negative exponential of the area, eq. 22), and few robots (a
constant penalty Z, eq. 23–24). The normalised form (eq. 25–26) divides the first two by their greatest values, takes
their mean, and sets Z = 1.01.

What Z promises. With Z above every other edge cost (eq. 24), two hops never beat one, so the shortest path between
two cells that see each other is their edge. It does *not* make every shortest path one of fewest hops, as the text
suggests: three hops of cost near 0 beat two of cost near 1 (3 Z < 2 Z + 2). ``robot_penalty="fewest"`` does: a path of
h hops costs at most h (Z + s), one of h + 1 hops at least (h + 1) Z, and Z > h s for every h ≤ N − 1.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.sparse import csr_array

    from planning.decomposition import Cells

Form: TypeAlias = Literal["normalised", "combined"]
AreaCost: TypeAlias = Literal["negative-exponential", "inverse"]
RobotPenalty: TypeAlias = int | float | Literal["pairwise", "fewest"]

NORMALISED_PENALTY = 1.01
"""Z of eq. 26; the other terms of that form do not exceed 1."""

SMALLEST_AREA_SHARE = 1e-6
"""For the inverse area, cells count as at least this share of the free area: slivers are arbitrarily small."""


def virtual_weights(
    cells: Cells,
    seen: csr_array,
    *,
    form: Form = "normalised",
    distance_weight: float = 1.0,
    area_weight: float = 1.0,
    area_cost: AreaCost = "negative-exponential",
    robot_penalty: RobotPenalty | None = None,
) -> NDArray[np.float64]:
    """Weights of the mutual visibility graph (thesis §3.3.1, eq. 19–26).

    ``"normalised"`` is ½ (a / max a + b / max b) + 1.01 with a the distance and b the area cost; the maxima are taken
    over the pairs of different cells that see each other, which are the pairs of the thesis' histograms (the text's
    max over i, j would let two far cells that never see each other set the scale). ``"combined"`` is
    k_a a + k_b b + Z.

    Args:
        cells: the N cells; areas in square metres, centroids in metres.
        seen: (N, N) bool, symmetric: which cells are mutually visible.
        form: see above.
        distance_weight: k_a of eq. 20; combined form only.
        area_weight: k_b of eq. 21–22; combined form only.
        area_cost: exp(−area) of both cells (eq. 22), or 1 / area of both (eq. 21), the areas not below
            :data:`SMALLEST_AREA_SHARE` of the free area.
        robot_penalty: Z of eq. 23. A number; ``"pairwise"``: 1.01 times the greatest edge cost, so that one hop beats
            two (eq. 24); ``"fewest"``: N times the greatest edge cost, so that fewest hops always win; None: 1.01 in
            the normalised form, 0 in the combined one.

    Returns:
        (N, N) float, symmetric, without unit: inf where two cells do not see each other, 0 on the diagonal.

    Raises:
        ValueError: a coefficient or penalty is negative or not finite, or has no place in the normalised form.
    """
    if form not in ("normalised", "combined"):
        raise ValueError(f"unknown form of virtual weights {form!r}: use 'normalised' or 'combined'")
    if form == "normalised" and (distance_weight != 1.0 or area_weight != 1.0):
        raise ValueError("the normalised weights have no coefficients: use form='combined' with k_a and k_b")
    if not (0 <= distance_weight < np.inf and 0 <= area_weight < np.inf):
        raise ValueError(f"weights must be finite and at least 0, not {distance_weight} and {area_weight}")

    number = len(cells.areas)
    first, second = seen.nonzero()
    different = first != second
    first, second = first[different], second[different]

    distance = np.linalg.norm(cells.centroids[first] - cells.centroids[second], axis=1)
    of_cell = _area_costs(cells.areas, area_cost)
    area = of_cell[first] + of_cell[second]

    if form == "normalised":
        cost = 0.5 * (_divided_by_maximum(distance) + _divided_by_maximum(area))
    else:
        cost = distance_weight * distance + area_weight * area

    W = np.full((number, number), np.inf)
    W[first, second] = cost + _penalty(robot_penalty, form, cost, number)
    np.fill_diagonal(W, 0.0)
    return W


def _area_costs(areas: NDArray[np.float64], area_cost: AreaCost) -> NDArray[np.float64]:
    """Each cell's share of c_b: (N,)."""
    if area_cost == "negative-exponential":
        return np.asarray(np.exp(-areas))
    if area_cost == "inverse":
        return np.asarray(1.0 / np.maximum(areas, SMALLEST_AREA_SHARE * areas.sum()))
    raise ValueError(f"unknown area cost {area_cost!r}: use 'negative-exponential' or 'inverse'")


def _divided_by_maximum(cost: NDArray[np.float64]) -> NDArray[np.float64]:
    """The costs as shares of the greatest. All zero (no pairs, or exp(−area) below the smallest float) stay zero."""
    greatest = cost.max(initial=0.0)
    return cost / greatest if greatest > 0 else cost


def _penalty(robot_penalty: RobotPenalty | None, form: Form, cost: NDArray[np.float64], number: int) -> float:
    """Z of eq. 23 in numbers. Costs that are all zero count as 1, so that Z is above them."""
    if robot_penalty is None:
        return NORMALISED_PENALTY if form == "normalised" else 0.0
    greatest = float(cost.max(initial=0.0)) or 1.0
    if robot_penalty == "pairwise":
        return 1.01 * greatest
    if robot_penalty == "fewest":
        return number * greatest
    if isinstance(robot_penalty, (int, float)) and 0 <= robot_penalty < np.inf:
        return float(robot_penalty)
    raise ValueError(f"robot penalty {robot_penalty!r}: use a number of at least 0, 'pairwise' or 'fewest'")
