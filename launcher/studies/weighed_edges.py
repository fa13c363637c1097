"""The edges of the thesis' maps, weighed: all pairs of cells that see each other, by each measure of thesis §3.3.1."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import kurtosis, skew

import maps
from launcher.studies.thesis_tables import EXPONENTIAL_AREA, Kind
from planning import Cells, Environment, decompose, mutual_visibility, virtual_weights

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MEASURES = {
    "distance": "centroid distance, eq. 20",
    "inverse area": "1 / area + 1 / area, eq. 21",
    "exponential area": "exp(−area) + exp(−area), eq. 22",
    "normalised": "mean of both costs, each divided by its greatest, eq. 25 without 1.01",
}


@dataclass(frozen=True, slots=True, eq=False)
class Weighed:
    """The pairs of cells of one map that see each other, and what their edges cost by each measure."""

    map: str
    kind: Kind
    unit: str
    """``metres``, or ``thesis`` for the scale of fig. 26."""
    scale: float
    """Length of the map here per length as packaged."""
    cells: Cells
    pairs: tuple[Ints, Ints]
    """The different cells that see each other, each pair once."""
    costs: Mapping[str, Floats]
    """(pairs,) float by measure."""
    distance: Floats
    """(N, N) float: the first measure as weights; inf where two cells do not see each other, 0 on the diagonal."""

    @property
    def name(self) -> str:
        """For titles."""
        return f"{self.map}, {self.kind} cells"


def weigh(name: str, kind: Kind) -> tuple[Weighed, Weighed]:
    """The edges of a map in metres, and at the scale of fig. 26."""
    environment = Environment.load(maps.path(name))
    cells = decompose(environment, kind)
    metres = _weigh_cells(name, kind, "metres", 1.0, cells)
    scale = find_scale(cells.areas, metres.pairs)
    holes = [hole * scale for hole in environment.holes]
    scaled = decompose(Environment(environment.outer * scale, holes, environment.name), kind)
    return metres, _weigh_cells(name, kind, "thesis", scale, scaled)


def find_scale(areas: Floats, pairs: tuple[Ints, Ints]) -> float:
    """The factor of lengths at which exp(−area) + exp(−area) has the mean of fig. 26."""

    def excess(logarithm: float) -> float:
        costs = np.exp(-areas * np.exp(2.0 * logarithm))
        return float((costs[pairs[0]] + costs[pairs[1]]).mean()) - EXPONENTIAL_AREA[0]

    return float(np.exp(brentq(excess, -20.0, 20.0, xtol=1e-12)))


def describe(costs: Floats) -> tuple[float, float, float, float, float]:
    """Mean, standard deviation, skewness, excess kurtosis, greatest."""
    return float(costs.mean()), float(costs.std()), float(skew(costs)), float(kurtosis(costs)), float(costs.max())


def _weigh_cells(name: str, kind: Kind, unit: str, scale: float, cells: Cells) -> Weighed:
    seen = mutual_visibility(cells)
    first, second = seen.nonzero()
    once = first < second
    pairs = first[once].astype(np.int64), second[once].astype(np.int64)
    distance = virtual_weights(cells, seen, form="combined", area_weight=0.0)
    costs = {
        "distance": distance[pairs],
        # As printed; `virtual_weights` would count the smallest slivers larger than they are.
        "inverse area": 1.0 / cells.areas[pairs[0]] + 1.0 / cells.areas[pairs[1]],
        "exponential area": virtual_weights(cells, seen, form="combined", distance_weight=0.0)[pairs],
        "normalised": virtual_weights(cells, seen, robot_penalty=0.0)[pairs],
    }
    return Weighed(name, kind, unit, scale, cells, pairs, costs, distance)
