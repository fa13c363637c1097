"""From a map to shortest paths, on room3 with bitangents (681 cells) and on maps of thousands of cells.

References: what the thesis reports for its own room3 (638 cells, Table 2), and scipy, networkx and shapely on the same
input. Those that take minutes answer for a part of the input, and the time is scaled up.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from typing import Any

import networkx as nx
import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra, floyd_warshall

import maps
from planning.compiled_map import CompiledMap
from planning.critical_lines import find_critical_lines
from planning.decomposition import Cells, Frame, decompose
from planning.edge_weights import virtual_weights
from planning.environment import Environment
from planning.mutual_visibility import mutual_visibility
from planning.shortest_paths import all_pairs
from tests.benchmarks.timing import Case, Work

Floats = NDArray[np.float64]

THESIS_VISIBILITY_S = 2.8
"""Mutual visibility of 638 cells."""

THESIS_PATHS_S = 22.8
"""All shortest paths between them."""


def cases() -> Iterator[Case]:
    """Name, target in seconds, what to time, and what to compare it with."""
    room3 = Environment.load(maps.path("room3"))
    cells = decompose(room3, "aspect")
    size = f"room3 aspect, {len(cells)} cells"
    weights = virtual_weights(cells, mutual_visibility(cells))
    points = np.random.default_rng(1).uniform(room3.bounds[:2], room3.bounds[2:], (1000, 2))
    tree = shapely.STRtree([shapely.Polygon(polygon) for polygon in cells.polygons])
    edges = csr_array(np.where(np.isfinite(weights), weights, 0.0))

    segments = _critical_segments(room3)
    yield (
        f"decomposition, {size}", 0.015, lambda: decompose(room3, "aspect"),
        "shapely, given the lines", lambda: shapely.polygonize([shapely.node(segments)]),
    )  # fmt: skip
    yield (
        f"mutual visibility, {size}", 0.030, lambda: mutual_visibility(cells),
        "thesis", THESIS_VISIBILITY_S, "shapely", _covered_hulls(cells),
    )  # fmt: skip
    yield (
        f"all pairs, {size}", 0.120, lambda: all_pairs(weights),
        "thesis", THESIS_PATHS_S,
        "scipy, Dijkstra", lambda: dijkstra(edges, directed=False, return_predecessors=True),
        "scipy, Floyd–Warshall", lambda: floyd_warshall(edges, directed=False, return_predecessors=True),
        "networkx", _networkx_paths(weights),
    )  # fmt: skip
    yield (
        f"locate 1000 points, {size}", 0.001, lambda: cells.locate(points),
        "shapely", lambda: tree.query(shapely.points(points), predicate="intersects"),
    )  # fmt: skip

    yield from _compiled_case(room3, size)

    for name, longest_m, limit_s in (("maze", None, 0.5), ("cityblocks", 4.8, 2.0)):
        large = decompose(Environment.load(maps.path(name)), "aspect", longest_m)
        yield (
            f"mutual visibility, {name}, {len(large)} cells", limit_s, partial(mutual_visibility, large),
            "shapely", _covered_hulls(large),
        )  # fmt: skip


def _compiled_case(environment: Environment, size: str) -> Iterator[Case]:
    """Reading a compiled map with all its parts but the lengths between placements, against computing them."""

    def compile_parts() -> None:
        compiled = CompiledMap(environment, "aspect", 0.2)
        _ = compiled.distances, compiled.cell_placements.geodesics.corner_lengths

    def compute_parts() -> None:
        with tempfile.TemporaryDirectory() as empty:
            os.environ["SIGHTLINE_CACHE"] = empty
            compile_parts()

    before = os.environ.get("SIGHTLINE_CACHE", "")
    with tempfile.TemporaryDirectory() as folder:

        def read_parts() -> None:
            os.environ["SIGHTLINE_CACHE"] = folder
            compile_parts()

        yield f"loading a compiled map, {size}", 0.050, read_parts, "computing and keeping it", compute_parts
    os.environ["SIGHTLINE_CACHE"] = before


def _critical_segments(environment: Environment) -> shapely.MultiLineString:
    """Walls and critical lines, which divide the map into its aspect cells."""
    frame = Frame.of(environment)
    after = environment.successors
    vertices = frame.enter(environment.vertices)
    reflex = np.flatnonzero(environment.is_reflex)
    lines = find_critical_lines(vertices, after, np.argsort(after), reflex, frame.tolerance, np.inf, frame.resolution)
    ends = vertices[lines.base, None] + lines.reach[:, :, None] * lines.direction[:, None]
    return shapely.multilinestrings(np.concatenate([environment.walls, frame.leave(ends)]))


def _covered_hulls(cells: Cells, pairs: int = 1000) -> Work:
    """Mutual visibility by its definition: whether free space covers the hull of a pair. For some, scaled up to all."""
    polygons = np.array([shapely.Polygon(polygon) for polygon in cells.polygons])
    free = cells.environment.polygon
    shapely.prepare(free)
    i, j = np.random.default_rng(1).integers(0, len(cells), (2, pairs))

    def run() -> float:
        begin = time.perf_counter()
        hulls = shapely.convex_hull(shapely.geometrycollections(np.stack([polygons[i], polygons[j]], axis=1)))
        shapely.covers(free, hulls)
        return (time.perf_counter() - begin) / pairs * len(cells) * (len(cells) - 1) / 2

    return run


def _networkx_paths(weights: Floats, sources: int = 10) -> Work:
    """Dijkstra's algorithm from some sources, scaled up to all."""
    graph: Any = nx.Graph()
    graph.add_weighted_edges_from((u, v, weights[u, v]) for u, v in np.argwhere(np.triu(weights < np.inf, 1)).tolist())

    def run() -> float:
        begin = time.perf_counter()
        for source in range(sources):
            nx.single_source_dijkstra(graph, source)
        return (time.perf_counter() - begin) / sources * len(weights)

    return run
