"""Placements for `map` and `plan` are computed once for a map, and read from then on."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import maps
from launcher.placements import PlacementOptions, Weighting, place
from planning.environment import Environment


@pytest.mark.parametrize(
    "options",
    [
        PlacementOptions("points", 0.2),
        PlacementOptions("cells", 0.2),
        PlacementOptions("cells", 0.2, weighting=Weighting("combined", 2.0)),
    ],
)
def test_the_second_time_nothing_is_decomposed_and_no_lines_of_sight_are_found(
    options: PlacementOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("computed again")

    monkeypatch.setenv("SIGHTLINE_CACHE", str(tmp_path))
    file = maps.path("room1")
    said: list[str] = []
    graph, cells = place(file, Environment.load(file), options, None, said.append)
    for module, name in (
        ("compiled_map", "decompose"), ("mutual_visibility", "_find_visible"), ("placement_graph", "choose_points")
    ):  # fmt: skip
        monkeypatch.setattr(import_module(f"planning.{module}"), name, refuse)
    again, the_same = place(file, Environment.load(file), options, None, said.append)
    np.testing.assert_array_equal(again.weights, graph.weights)
    np.testing.assert_array_equal(again.positions, graph.positions)
    assert (cells is None) == (the_same is None) == (options.kind == "points")
    assert not said
