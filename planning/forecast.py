"""What a map will cost before it is computed: how many cells, how much time and memory for who sees whom.

The critical lines are cheap to find. Of their pairs a sample tells how many cross, and by Euler's formula that is how
many cells there are (counts as in the thesis' Table 1, in general position):

    N = 1 + I − H − V − Lr + 2 r + La / 3        I = V + ends of lines in walls + crossings

Where maps are drawn on a grid, many crossings are one point, and the figure is somewhat too high.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from planning.critical_lines import NONE, CriticalLines, find_critical_lines
from planning.decomposition import Frame, Kind
from planning.environment import Environment

Floats = NDArray[np.float64]

PAIRS = 100_000
"""Pairs of lines that are looked at: enough for a few per cent of the crossings."""

SECONDS_PER_PAIR_OF_CELLS = 2.5e-7
"""Mutual visibility, as measured on maps of 50 to 820 vertices; half as much on some, twice on others."""

SECONDS_PER_PAIR_OF_LINES = 4e-8
SECONDS_PER_CELL = 1e-5
"""Decomposition."""

BYTES_PER_PAIR_OF_CELLS = 30
"""The graph, its weights, and what they are made from."""


@dataclass(frozen=True, slots=True)
class Forecast:
    """What a decomposition and its mutual visibility graph will cost.

    Attributes:
        lines: critical lines: rays and bitangents. Exact.
        cells: about how many.
        decomposition_s: seconds for the cells, roughly, on one core.
        visibility_s: seconds for who sees whom.
        memory_bytes: for the graph and its weights.
    """

    lines: int
    cells: int
    decomposition_s: float
    visibility_s: float
    memory_bytes: float

    @property
    def seconds(self) -> float:
        """Everything, in seconds."""
        return self.decomposition_s + self.visibility_s


def forecast_cells(environment: Environment, kind: Kind, max_bitangent_m: float | None = None) -> Forecast:
    """What `decompose` and `mutual_visibility` will make of these arguments, and at which cost.

    Complexity: O(r² V) at worst for r reflex vertices, as the critical lines take; the same sample for the same map.
    """
    frame = Frame.of(environment)
    vertices = frame.enter(environment.vertices)
    after = np.arange(1, len(vertices) + 1)
    after[environment.ring_starts[1:] - 1] = environment.ring_starts[:-1]
    longest = 0.0 if kind == "inflection" else math.inf if max_bitangent_m is None else max_bitangent_m / frame.size_m
    reflex = np.flatnonzero(environment.is_reflex)
    lines = find_critical_lines(vertices, after, np.argsort(after), reflex, frame.tolerance, longest, frame.resolution)
    number = len(lines.base)
    crossings = _estimate_crossings(lines, vertices, frame.tolerance)
    ends = int(np.count_nonzero(lines.end_wall != NONE))
    cells = round(
        1 + ends + crossings - len(environment.holes) - lines.ray_count + 2 * len(reflex) + lines.bitangent_count
    )
    return Forecast(
        number,
        max(cells, 1),
        SECONDS_PER_PAIR_OF_LINES * number**2 + SECONDS_PER_CELL * cells,
        SECONDS_PER_PAIR_OF_CELLS * cells**2,
        BYTES_PER_PAIR_OF_CELLS * float(cells) ** 2,
    )


def _estimate_crossings(lines: CriticalLines, vertices: Floats, tolerance: float) -> float:
    """How many pairs of lines cross elsewhere than at a vertex of the map."""
    number = len(lines.base)
    pairs = number * (number - 1) // 2
    if pairs <= PAIRS:
        first, second = np.triu_indices(number, 1)
    else:
        first, second = np.random.default_rng(0).integers(0, number, (2, PAIRS))
        different = first != second
        first, second = first[different], second[different]
    offset = vertices[lines.base[second]] - vertices[lines.base[first]]
    u, v = lines.direction[first], lines.direction[second]
    sine = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (offset[:, 0] * v[:, 1] - offset[:, 1] * v[:, 0]) / sine
        t = (offset[:, 0] * u[:, 1] - offset[:, 1] * u[:, 0]) / sine
        (back, ahead), (back_too, ahead_too) = lines.reach[first].T, lines.reach[second].T
        crosses = (back <= s) & (s <= ahead) & (back_too <= t) & (t <= ahead_too) & (np.abs(sine) > 1e-14)
    places = vertices[lines.base[first[crosses]]] + s[crosses, None] * u[crosses]
    distances, _ = KDTree(vertices).query(places)
    return float(np.count_nonzero(distances > tolerance)) * (pairs / max(len(first), 1))
