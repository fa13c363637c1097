from __future__ import annotations

import numpy as np
import pytest

import maps
from planning.decomposition import Kind, decompose
from planning.environment import Environment
from planning.forecast import forecast_cells
from planning.polygon_validation import InvalidEnvironment
from tests.planning.polygons import oblique_environment, shared_maps

KINDS: tuple[Kind, ...] = ("inflection", "aspect")


def check(environment: Environment, kind: Kind, max_bitangent_m: float | None = None) -> None:
    forecast = forecast_cells(environment, kind, max_bitangent_m)
    if forecast.cells > 50_000:
        return
    counts = decompose(environment, kind, max_bitangent_m).counts
    assert forecast.lines == counts["Lr"] + counts["La"] // 3
    assert forecast.cells == pytest.approx(counts["N"], rel=0.2)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", maps.names())
def test_the_number_of_cells_of_the_maps_is_foreseen(name: str, kind: Kind) -> None:
    check(Environment.load(maps.path(name)), kind)


def test_short_bitangents_are_foreseen() -> None:
    for reach_m in (1e-6, 4.0, 10.0):
        check(Environment.load(maps.path("room3")), "aspect", reach_m)


@pytest.mark.parametrize("seed", range(1, 12))
def test_few_lines_in_general_position_are_counted_exactly(seed: int) -> None:
    """All pairs of lines are looked at, no three cross in a point: Euler's formula leaves no room."""
    environment = oblique_environment(seed)
    for kind in KINDS:
        forecast = forecast_cells(environment, kind)
        if forecast.lines < 400:
            assert forecast.cells == len(decompose(environment, kind))


def test_shared_polygons_are_foreseen() -> None:
    for file in shared_maps("polygons"):
        try:
            environment = Environment.load(file)
        except InvalidEnvironment:  # rings that touch
            continue
        for kind in KINDS:
            check(environment, kind)


def test_costs_grow_with_the_cells_and_are_those_of_thousands_of_them() -> None:
    small, large = (forecast_cells(Environment.load(maps.path("cityblocks")), kind) for kind in KINDS)
    assert small.seconds < 1.0 < 60.0 < large.seconds
    assert large.memory_bytes == pytest.approx(30.0 * 43675**2, rel=0.1)
    assert np.isclose(large.seconds, large.decomposition_s + large.visibility_s)


def test_a_convex_room_is_one_cell() -> None:
    assert forecast_cells(Environment([(0, 0), (4, 0), (4, 3), (0, 3)]), "aspect").cells == 1
