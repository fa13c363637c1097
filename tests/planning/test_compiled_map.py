"""A compiled map is what its parts' makers return, whether it was computed or read."""

from __future__ import annotations

from dataclasses import fields
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import maps
from planning.compiled_map import CompiledMap
from planning.decomposition import Cells, decompose
from planning.edge_weights import virtual_weights
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from planning.mutual_visibility import TooManyCells, mutual_visibility
from planning.placement_graph import NoPlacement, PlacementGraph
from planning.shortest_paths import all_pairs
from tests.planning.polygons import free_points

module = import_module("planning.compiled_map")
MAKERS = ("decompose", "mutual_visibility", "virtual_weights", "all_pairs")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Never the user's own."""
    monkeypatch.setenv("SIGHTLINE_CACHE", str(tmp_path / "maps"))
    return tmp_path / "maps"


def silent(words: str) -> None:
    raise AssertionError(words)


def forbid_computing(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("computed again")

    for name in MAKERS:
        monkeypatch.setattr(module, name, refuse)
    monkeypatch.setattr(Environment, "inflated", refuse)
    for maker in ("from_cells", "from_points"):
        monkeypatch.setattr(PlacementGraph, maker, refuse)
    monkeypatch.setattr(import_module("planning.geodesic"), "_join_corners", refuse)
    monkeypatch.setattr(import_module("planning.geodesic_table"), "_find_legs", refuse)
    monkeypatch.setattr(import_module("planning.geodesic_table"), "_find_table", refuse)


def check_cells(found: Cells, expected: Cells) -> None:
    for field in fields(Cells):
        ours, theirs = getattr(found, field.name), getattr(expected, field.name)
        if isinstance(theirs, np.ndarray):
            np.testing.assert_array_equal(ours, theirs, strict=True)
        elif field.name == "adjacency":
            assert (ours != theirs).nnz == 0
        elif field.name == "frame":
            assert (ours.size_m, ours.tolerance, *ours.origin) == (theirs.size_m, theirs.tolerance, *theirs.origin)
        else:
            assert ours == theirs


def check_placements(found: PlacementGraph, expected: PlacementGraph) -> None:
    assert found.kind == expected.kind
    for name in ("positions", "visible", "weights", "cells", "distances"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), strict=True)
    place = expected.positions[len(expected) // 2]
    np.testing.assert_array_equal(found.distances_from(place), expected.distances_from(place))
    np.testing.assert_array_equal(found.link_weights(place), expected.link_weights(place))
    np.testing.assert_array_equal(found.probes, expected.probes)
    path = expected.geodesics.path(place, expected.positions[0])
    np.testing.assert_array_equal(found.geodesics.path(place, expected.positions[0]), path)


def check_all(compiled: CompiledMap) -> None:
    drawn, radius_m = compiled.environment, compiled.radius_m
    cells = decompose(drawn, compiled.kind, compiled.max_bitangent_m)
    seen = mutual_visibility(cells)
    weights = virtual_weights(cells, seen)
    distances, predecessors = all_pairs(weights)
    check_cells(compiled.cells, cells)
    assert compiled.seen.dtype == np.bool_
    assert (compiled.seen != seen).nnz == 0
    np.testing.assert_array_equal(compiled.weights, weights, strict=True)
    np.testing.assert_array_equal(compiled.distances, distances, strict=True)
    np.testing.assert_array_equal(compiled.predecessors, predecessors, strict=True)
    free = drawn.inflated(radius_m, containing=compiled.containing)
    np.testing.assert_array_equal(compiled.free.walls, free.walls, strict=True)
    np.testing.assert_array_equal(compiled.free.ring_starts, free.ring_starts)
    assert (compiled.free.name, compiled.free.tolerance_m) == (free.name, free.tolerance_m)
    np.testing.assert_array_equal(compiled.geodesics.corner_lengths, GeodesicMap(free).corner_lengths, strict=True)
    containing = compiled.containing
    check_placements(
        compiled.cell_placements, PlacementGraph.from_cells(cells, seen, drawn, radius_m, containing=containing)
    )
    check_placements(
        compiled.point_placements(4.0), PlacementGraph.from_points(drawn, radius_m, 4.0, containing=containing)
    )


@pytest.mark.parametrize(
    "options",
    [
        {"kind": "aspect"},
        {"kind": "aspect", "radius_m": 0.25, "max_bitangent_m": 6.0},
        {"radius_m": 0.3, "containing": (20.0, 12.0)},
    ],
)
def test_equals_what_is_computed_afresh(options: dict[str, object], monkeypatch: pytest.MonkeyPatch) -> None:
    environment = Environment.load(maps.path("room2"))
    computed = CompiledMap(environment, announce=silent, **options)  # type: ignore[arg-type]
    check_all(computed)
    read = CompiledMap(environment, announce=silent, **options)  # type: ignore[arg-type]
    with monkeypatch.context() as patch:
        forbid_computing(patch)
        for part in ("cells", "seen", "weights", "distances", "predecessors", "free"):
            getattr(read, part)
        for graph in (read.cell_placements, read.point_placements(4.0)):
            _ = graph.distances, graph.geodesics.corner_lengths
    check_all(read)


@pytest.mark.parametrize("name", maps.names())
def test_the_space_of_a_robot_is_read_as_it_was_written(name: str) -> None:
    environment = Environment.load(maps.path(name))
    free = environment.inflated(0.2)
    for _ in range(2):
        found = CompiledMap(environment, radius_m=0.2, announce=silent).free
        np.testing.assert_array_equal(found.walls, free.walls)
        assert found.tolerance_m == free.tolerance_m


def test_other_maps_and_options_have_other_files(folder: Path) -> None:
    environment = Environment.load(maps.path("room1"))
    moved = Environment(environment.outer + 1e-6, environment.holes, environment.name)
    renamed = Environment(environment.outer, environment.holes, "another name")
    for chosen, kind, files in (
        (environment, "inflection", 1),
        (moved, "inflection", 2),
        (renamed, "inflection", 2),
        (environment, "aspect", 3),
    ):
        cells = CompiledMap(chosen, kind).cells  # type: ignore[arg-type]
        check_cells(cells, decompose(chosen, kind))  # type: ignore[arg-type]
        assert len(list(folder.glob("cells-*.npz"))) == files
    CompiledMap(environment, "aspect", max_bitangent_m=3.0).cells  # noqa: B018
    assert len(list(folder.glob("cells-*.npz"))) == 4


def test_a_robot_that_only_drives_needs_no_cells_and_shares_its_paths(folder: Path) -> None:
    environment = Environment.load(maps.path("room1"))
    free = environment.inflated(0.2)
    goal, *starts = free_points(free, 3, np.random.default_rng(1)).tolist()
    for x, y in starts:
        compiled = CompiledMap(environment, radius_m=0.2, containing=(x, y))
        assert compiled.geodesics.length((x, y), goal) == GeodesicMap(free).length((x, y), goal)
    assert sorted(file.name.split("-")[0] for file in folder.iterdir()) == ["corners", "free", "free"]


def test_parts_raise_what_their_makers_raise(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(import_module("planning.mutual_visibility"), "MOST_CELLS", 20)
    compiled = CompiledMap(Environment.load(maps.path("room1")))
    assert len(compiled.cells) == 26
    for _ in range(2):
        with pytest.raises(TooManyCells):
            _ = compiled.seen
    with pytest.raises(ValueError, match="max_bitangent_m"):
        _ = CompiledMap(compiled.environment, "aspect", max_bitangent_m=-1.0).cells


def test_small_cells_are_no_placements_but_an_agent_can_be_in_them() -> None:
    environment = Environment.load(maps.path("room2"))
    every = CompiledMap(environment, "aspect", 0.2).cell_placements
    compiled = CompiledMap(environment, "aspect", 0.2, least_area_m2=1.0)
    large, cells = compiled.cell_placements, compiled.cells
    assert large.cells.tolist() == [cell for cell in every.cells if cells.areas[cell] >= 1.0]
    np.testing.assert_array_equal(large.positions, every.positions[np.isin(every.cells, large.cells)])
    np.testing.assert_array_equal(large.visible, compiled.seen.toarray()[np.ix_(large.cells, large.cells)])
    small = np.flatnonzero(cells.areas < 1.0)
    assert len(small) > 20
    assert all(large.sees(cells.centroids[cell]).any() for cell in small)
    with pytest.raises(NoPlacement, match="no cell of 1e\\+06 m²"):
        _ = CompiledMap(environment, "aspect", 0.2, least_area_m2=1e6).cell_placements


@pytest.mark.parametrize(
    ("wrong", "fault", "says"),
    [
        ({"environment": "my.wkt"}, TypeError, "Environment.load"),
        ({"kind": "round"}, ValueError, "inflection, aspect"),
        ({"radius_m": -1.0}, ValueError, "at least 0"),
    ],
)
def test_what_cannot_be_compiled_is_refused_at_once(wrong: dict, fault: type[Exception], says: str) -> None:
    with pytest.raises(fault, match=says):
        CompiledMap(**({"environment": Environment.load(maps.path("room1"))} | wrong))
