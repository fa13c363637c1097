"""A map with all that planning computes from it before the first decision, each part once and then from disk.

A team's processes all plan on the same map. The first of them, or the launcher before them, divides it and finds who
sees whom; the others, and the same map tomorrow, read that in milliseconds (`planning.map_cache`). A part is computed
or read when it is first asked for, so a robot that only drives never touches the cells.

What depends on where a robot starts is kept by what it comes to: the space for a robot's centre by map, radius and the
point it holds, but the shortest paths by that space itself. So a team in one room keeps them once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from planning.decomposition import Cells, Frame, Kind, decompose
from planning.edge_weights import virtual_weights
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from planning.geodesic_table import GeodesicTable
from planning.map_cache import Arrays, digest, fetch
from planning.mutual_visibility import mutual_visibility
from planning.placement_graph import NoPlacement, PlacementGraph
from planning.placement_sight import CellSight, PointSight
from planning.shortest_paths import all_pairs

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


def _say_nothing(_: str) -> None: ...


@dataclass(frozen=True, eq=False)
class CompiledMap:
    """A map and what planning needs of it. All parts are what their makers return, to the last bit.

    Every part raises what its maker raises: `decompose`, `mutual_visibility`, `virtual_weights`, `all_pairs`,
    `Environment.inflated`, and the makers of a `PlacementGraph`.
    """

    environment: Environment
    """As drawn."""
    kind: Kind = "inflection"
    """Of the cells."""
    radius_m: float = 0.0
    """Of the robots, metres."""
    max_bitangent_m: float | None = None
    """As in `decompose`."""
    least_area_m2: float = 0.0
    """Smaller cells are no placements. They stay cells that an agent can be in, so nothing of the map is lost, but
    chains may take more relays.
    """
    containing: tuple[float, float] | None = None
    """Robots are in the part of the free space at this point, metres, as in `Environment.inflated`."""
    announce: Callable[[str], None] = _say_nothing
    """Is told of files that are damaged or cannot be written, which is no error."""

    def __post_init__(self) -> None:
        if not isinstance(self.environment, Environment):
            raise TypeError(
                f"a compiled map is made of an Environment, not of {self.environment!r}: Environment.load it"
            )
        if self.kind not in get_args(Kind):
            raise ValueError(f"there are no {self.kind!r} cells: use one of {', '.join(get_args(Kind))}")
        if not 0.0 <= self.radius_m < np.inf:
            raise ValueError(f"a robot's radius is a finite number of metres, at least 0, not {self.radius_m!r}")

    @cached_property
    def cells(self) -> Cells:
        """The decomposition."""
        arrays = self._fetch(
            "cells", self._cells_key, lambda: _pack_cells(decompose(self.environment, self.kind, self.max_bitangent_m))
        )
        return _unpack_cells(arrays, self.environment, self.kind)

    @cached_property
    def seen(self) -> csr_array:
        """Which cells are mutually visible: (N, N) bool."""
        arrays = self._fetch("seen", self._cells_key, lambda: _pack_graph("seen", mutual_visibility(self.cells)))
        return _unpack_graph("seen", arrays)

    @cached_property
    def weights(self) -> Floats:
        """The normalised virtual weights of the cells, (N, N)."""
        rows, columns = self.seen.nonzero()
        arrays = self._fetch(
            "weights", self._cells_key, lambda: {"seen": virtual_weights(self.cells, self.seen)[rows, columns]}
        )
        weights = np.full(self.seen.shape, np.inf)
        weights[rows, columns] = arrays["seen"]
        return weights

    @property
    def distances(self) -> Floats:
        """Costs of the cheapest paths between cells, (N, N)."""
        return self._paths["distances"]

    @property
    def predecessors(self) -> Ints:
        """The cells before the last on those paths, (N, N)."""
        return self._paths["predecessors"]

    @cached_property
    def free(self) -> Environment:
        """The map inflated by the radius: where a robot's centre can be."""
        drawn = self.environment
        if self.radius_m == 0.0:
            return drawn
        arrays = self._fetch(
            "free", self._free_key, lambda: _pack_rings(drawn.inflated(self.radius_m, containing=self.containing))
        )
        rings = np.split(arrays["vertices"], arrays["starts"][1:-1])
        return Environment(rings[0], rings[1:], drawn.name, source=drawn.source, validate=False)

    @cached_property
    def geodesics(self) -> GeodesicMap:
        """Shortest paths of the robots' centres, with the table of the reflex vertices."""

        def compute() -> Arrays:
            lengths, predecessors = GeodesicMap(self.free).corner_paths
            return {"lengths": lengths, "predecessors": predecessors}

        arrays = self._fetch("corners", digest(*self.free.rings), compute)
        return GeodesicMap(self.free, (arrays["lengths"], arrays["predecessors"]))

    @cached_property
    def cell_placements(self) -> PlacementGraph:
        """`PlacementGraph.from_cells` of these cells, with the virtual weights, less the smallest.

        Raises:
            NoPlacement: no cell is large enough, or none can be stood in.
        """

        def compute() -> Arrays:
            graph = PlacementGraph.from_cells(
                self.cells, self.seen, self.environment, self.radius_m, weights=self.weights, containing=self.containing
            )
            kept = self.cells.areas[graph.cells] >= self.least_area_m2
            if not kept.any():
                name, least = self.environment.name, f"{self.least_area_m2:g} m²"
                raise NoPlacement(
                    f"the map {name!r} has no cell of {least} for a robot to stand in: allow smaller ones"
                )
            return {"positions": graph.positions[kept], "cells": graph.cells[kept]}

        arrays = self._fetch("standing", digest(self._cells_key, self._free_key, self.least_area_m2), compute)
        positions, kept = arrays["positions"], arrays["cells"]
        weights = np.ascontiguousarray(self.weights[np.ix_(kept, kept)])
        sight = CellSight(self.cells, self.weights, kept)
        return PlacementGraph(
            "cells", self.environment, self.radius_m, self.free, positions, np.isfinite(weights), weights, kept, sight,
            _KeptTable(self.geodesics, positions, self._fetch),
        )  # fmt: skip

    def point_placements(self, spacing_m: float | None = None) -> PlacementGraph:
        """`PlacementGraph.from_points` at this spacing, metres, or at one that suits the map."""

        def compute() -> Arrays:
            graph = PlacementGraph.from_points(self.environment, self.radius_m, spacing_m, containing=self.containing)
            sight = graph.sight
            assert isinstance(sight, PointSight)
            return {
                "positions": graph.positions,
                "visible": graph.visible,
                "weights": graph.weights,
                "greatest_m": np.array(sight.greatest_m),
            }

        arrays = self._fetch("points", digest(self._free_key, spacing_m), compute)
        positions = arrays["positions"]
        sight = PointSight(self.environment, self.free, positions, float(arrays["greatest_m"]))
        no_cells = np.full(len(positions), -1)
        return PlacementGraph(
            "points", self.environment, self.radius_m, self.free, positions, arrays["visible"], arrays["weights"],
            no_cells, sight, _KeptTable(self.geodesics, positions, self._fetch),
        )  # fmt: skip

    @cached_property
    def _paths(self) -> Arrays:
        def compute() -> Arrays:
            distances, predecessors = all_pairs(self.weights)
            return {"distances": distances, "predecessors": predecessors}

        return self._fetch("paths", self._cells_key, compute)

    @cached_property
    def _cells_key(self) -> str:
        return digest(*self.environment.rings, self.kind, self.max_bitangent_m)

    @cached_property
    def _free_key(self) -> str:
        return digest(*self.environment.rings, self.radius_m, self.containing)

    def _fetch(self, part: str, key: str, compute: Callable[[], Mapping[str, NDArray[Any]]]) -> Arrays:
        return fetch(part, key, compute, self.announce)


class _KeptTable(GeodesicTable):
    """A table whose legs, and later whose lengths, are fetched."""

    def __init__(
        self,
        geodesics: GeodesicMap,
        places: ArrayLike,
        fetch: Callable[[str, str, Callable[[], Mapping[str, NDArray[Any]]]], Arrays],
    ) -> None:
        def compute() -> Arrays:
            return dict(zip(("starts", "bends", "lengths"), GeodesicTable(geodesics, places).legs, strict=True))

        self._fetch, self._key = fetch, digest(*geodesics.environment.rings, np.asarray(places))
        legs = fetch("legs", self._key, compute)
        super().__init__(geodesics, places, (legs["starts"], legs["bends"], legs["lengths"]))

    @cached_property
    def between(self) -> Floats:
        """As in `GeodesicTable`."""
        arrays = self._fetch(
            "between", self._key, lambda: {"metres": GeodesicTable(self.geodesics, self.places, self.legs).between}
        )
        arrays["metres"].flags.writeable = False
        return arrays["metres"]


def _pack_rings(environment: Environment) -> Arrays:
    return {"vertices": environment.vertices, "starts": environment.ring_starts}


def _pack_graph(name: str, graph: csr_array) -> Arrays:
    return {f"{name}_columns": graph.indices, f"{name}_starts": graph.indptr}


def _unpack_graph(name: str, arrays: Arrays) -> csr_array:
    columns, starts = arrays[f"{name}_columns"], arrays[f"{name}_starts"]
    n = len(starts) - 1
    return csr_array((np.ones(len(columns), np.bool_), columns, starts), shape=(n, n))


def _pack_cells(cells: Cells) -> Arrays:
    return {
        "counted": np.array(list(cells.counts)),
        "counts": np.array(list(cells.counts.values())),
        "areas": cells.areas,
        "centroids": cells.centroids,
        **_pack_graph("adjacent", cells.adjacency),
        "starts": cells.starts,
        "corners": cells.corners,
        "unit_corners": cells.unit_corners,
    }


def _unpack_cells(arrays: Arrays, environment: Environment, kind: Kind) -> Cells:
    return Cells(
        environment,
        kind,
        dict(zip(arrays["counted"].tolist(), arrays["counts"].tolist(), strict=True)),
        arrays["areas"],
        arrays["centroids"],
        _unpack_graph("adjacent", arrays),
        arrays["starts"],
        arrays["corners"],
        Frame.of(environment),
        arrays["unit_corners"],
    )
