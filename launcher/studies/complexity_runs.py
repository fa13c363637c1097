"""What the complexity study measures: counts of maps, times of what is computed once, times of deployments."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

import maps
from launcher.studies.scaling import shortest_time
from launcher.studies.thesis_tables import ROWS, Kind, Row
from planning import AdjacencyPaths, Environment, decompose, mutual_visibility, redeploy, steiner_tree, virtual_weights
from planning.edge_modification import best_modification
from planning.known_topology import place_nodes
from planning.min_plus import Links, scaled_links
from planning.shortest_paths import all_pairs
from planning.tree import Ints

Floats = NDArray[np.float64]

BEYOND: tuple[tuple[str, Kind, bool], ...] = (
    ("maze", "aspect", True),
    ("l457", "aspect", False),
    ("cityblocks", "aspect", False),
)
"""Maps with the bitangents that were too many for the thesis; whether more than their cells is computed."""

MU = 5.0
"""Metres that a robot moves for one unit of virtual weight."""

TERMINALS = (3, 4, 5, 6, 7, 8)
TRIALS = 5
"""Sets of terminals for each number of them."""

NODES = (4, 5, 6, 7, 8, 9, 10)


@dataclass(frozen=True, slots=True, eq=False)
class MapRun:
    """One map with one decomposition: counts, and seconds of what is computed once."""

    map: str
    kind: Kind
    thesis: Row | None
    counts: dict[str, int]
    holes: int
    links: int
    """Pairs of different cells that see each other; 0 if it was not computed."""
    decomposition_s: float
    visibility_s: float
    all_pairs_s: float
    adjacency_paths_s: float
    """The last three are nan where they were not computed."""
    W: Floats
    """(N, N) float, virtual weights; (0, 0) likewise."""
    lengths: Floats
    """(N, N) float, metres: between centroids; likewise."""

    @property
    def name(self) -> str:
        """For titles and labels."""
        return f"{self.map} ({'w/' if self.kind == 'aspect' else 'w/o'} bit.)"

    @property
    def segments(self) -> int:
        """L: line segments of walls, inflection rays and bitangents."""
        return self.counts["Lb"] + self.counts["Lr"] + self.counts["La"]


@dataclass(frozen=True, slots=True)
class Timing:
    """Seconds of one algorithm on one map."""

    map: str
    cells: int
    links: int
    size: int
    """Terminals, or nodes of a tree."""
    algorithm: str
    mean_s: float
    least_s: float
    most_s: float


def run_maps(quick: bool, tell: Callable[[str], None]) -> Iterator[MapRun]:
    """The thesis' ten rows, then those beyond it; quick: those of at most 200 cells."""
    wanted: list[tuple[str, Kind, bool, Row | None]] = [(row.map, row.kind, True, row) for row in ROWS]
    wanted += [(*beyond, None) for beyond in BEYOND]
    for name, kind, whole, row in wanted:
        if not quick or (row is not None and row.N <= 200):
            tell(f"{name}, {kind}: cells" + (", visibility, shortest paths" if whole else ""))
            yield run_map(name, kind, whole, row)


def run_map(name: str, kind: Kind, whole: bool, row: Row | None) -> MapRun:
    """Count and time one map."""
    environment = Environment.load(maps.path(name))
    decomposing = partial(decompose, environment, kind)
    cells = decomposing()
    decomposition_s = shortest_time(decomposing)
    if not whole:
        nothing, nan = np.empty((0, 0)), float("nan")
        return MapRun(
            name, kind, row, cells.counts, len(environment.holes), 0, decomposition_s, nan, nan, nan, nothing, nothing
        )
    seen = mutual_visibility(cells)
    W = virtual_weights(cells, seen)
    return MapRun(
        name,
        kind,
        row,
        cells.counts,
        len(environment.holes),
        (seen.nnz - len(cells)) // 2,
        decomposition_s,
        shortest_time(lambda: mutual_visibility(cells)),
        shortest_time(lambda: all_pairs(W)),
        shortest_time(lambda: AdjacencyPaths(cells).lengths),
        W,
        np.hypot(*(cells.centroids[:, None] - cells.centroids).transpose(2, 0, 1)),
    )


def time_steiner(run: MapRun, seed: int = 0) -> Iterator[Timing]:
    """Exact Steiner trees between random terminals."""
    rng = np.random.default_rng(seed)
    for number in TERMINALS:
        asked = [rng.choice(len(run.W), number, replace=False) for _ in range(TRIALS)]
        times = [shortest_time(partial(steiner_tree, run.W, terminals)) for terminals in asked]
        yield _timing(run, number, "Steiner tree", times)


def time_redeployment(run: MapRun, seed: int = 0) -> Iterator[Timing]:
    """Redeployments of a base, an agent and robots in a line, from random places (figures 46 to 50).

    One tree, all modifications one tree after the other as the thesis has it (algorithm 7), all of them by messages,
    and the optimum over all trees. The links are made once for all, as W does not change.
    """
    rng = np.random.default_rng(seed)
    links = scaled_links(run.W, MU)
    for number in NODES:
        move = run.lengths[rng.integers(0, len(run.W), number)].copy()
        move[:2] = np.inf
        move[[0, 1], rng.integers(0, len(run.W), 2)] = 0.0
        line = line_tree(number)
        nodes = list(range(number))
        works: dict[str, Callable[[], object]] = {
            "one tree": partial(place_nodes, links, move, line, nodes),
            "tree by tree": partial(place_each, links, move, modifications(line), MU * run.W),
            "by messages": partial(best_modification, links, move, line, nodes),
            "exact": partial(redeploy, move, run.W, MU),
        }
        for name, work in works.items():
            yield _timing(run, number, name, [shortest_time(work)])


def line_tree(number: int) -> Ints:
    """Base 0, robots 2 to k − 1, agent 1 in a line: (k − 1, 2) int."""
    order = np.array([0, *range(2, number), 1])
    return np.column_stack((order[:-1], order[1:]))


def place_each(links: Links, move: Floats, topologies: Sequence[Ints], priced: Floats) -> float:
    """The least cost of some trees, placed one by one; inf if none can be.

    Args:
        links: of N placements.
        move: (k, N) float: costs of moving.
        topologies: (k − 1, 2) int each.
        priced: (N, N) float: μ W, which the links are made of.
    """
    nodes = list(range(len(move)))
    least = np.inf
    for topology in topologies:
        placed = place_nodes(links, move, topology, nodes)
        if placed is not None:
            edges, cells = placed
            least = min(least, float(move[nodes, cells].sum() + priced[cells[edges[:, 0]], cells[edges[:, 1]]].sum()))
    return least


def modifications(tree: Ints) -> list[Ints]:
    """The tree, and all that differ from it in one edge (thesis eq. 46 and 47); (k − 1, 2) int each."""
    found = [tree]
    for cut in range(len(tree)):
        rest = np.delete(tree, cut, axis=0)
        side = {int(tree[cut, 0])}
        while grown := {int(v) for edge in rest for v in edge if side & set(edge.tolist())} - side:
            side |= grown
        others = set(range(len(tree) + 1)) - side
        for a in sorted(side):
            for b in sorted(others):
                if {a, b} != set(tree[cut].tolist()):
                    modified = tree.copy()
                    modified[cut] = a, b
                    found.append(modified)
    return found


def _timing(run: MapRun, size: int, algorithm: str, times: Sequence[float]) -> Timing:
    mean = float(np.mean(times))
    return Timing(run.name, len(run.W), run.links, size, algorithm, mean, min(times), max(times))
