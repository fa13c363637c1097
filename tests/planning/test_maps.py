from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
import shapely

import maps
from planning.environment import Environment
from tests.planning.polygons import shared_maps

SCALED = {"room1": 4, "room2": 4, "room3": 4, "cityblocks": 4, "maze": 8}
NARROWEST_M = {**dict.fromkeys(SCALED, 1.5), "l457": 1.0, "l457mod": 1.5, "office": 1.0}


def read(name: str) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(maps.path(name).read_text(encoding="utf-8"))
    return content


def test_the_maps_are_those_that_the_readme_lists() -> None:
    assert maps.names() == ["cityblocks", "l457", "l457mod", "maze", "office", "room1", "room2", "room3"]
    readme = (maps.path("office").parent / "README.md").read_text(encoding="utf-8")
    assert all(f"| `{name}` |" in readme for name in maps.names())


@pytest.mark.parametrize("name", ["nowhere", "", "../maps/room1", "room1.json"])
def test_an_unknown_name_is_told_the_known_ones(name: str) -> None:
    with pytest.raises(ValueError, match="choose one of cityblocks, l457, l457mod, maze, office, room1, room2, room3"):
        maps.path(name)


@pytest.mark.parametrize("name", maps.names())
def test_each_map_says_its_units_source_and_licence(name: str) -> None:
    content = read(name)
    assert content["name"] == name
    assert content["units"] == "metres"
    assert content["licence"] == "Apache-2.0"
    assert len(content["source"]) > 20


@pytest.mark.parametrize("name", maps.names())
def test_each_map_loads_and_loses_no_vertex(name: str) -> None:
    environment = Environment.load(maps.path(name))
    content = read(name)
    assert len(environment.vertices) == sum(len(ring) for ring in [content["outer"], *content["holes"]])


@pytest.mark.parametrize("name", maps.names())
def test_passages_are_as_wide_as_stated(name: str) -> None:
    """Walls moved inwards by half the width: the space stays whole, and goes round every hole."""
    space = Environment.load(maps.path(name)).polygon
    eroded = space.buffer(-0.499 * NARROWEST_M[name], join_style="mitre")
    assert isinstance(eroded, shapely.Polygon)
    assert len(eroded.interiors) == len(space.interiors)


def test_what_is_wider_than_a_door_is_a_corridor_or_a_room_and_all_hang_together() -> None:
    """l457: without what is narrower than 1.5 m, the corridors still run round all three blocks."""
    space = Environment.load(maps.path("l457")).polygon
    wide = shapely.get_parts(space.buffer(-0.75, join_style="mitre"))
    corridors = max(wide, key=lambda part: len(part.interiors))
    assert len(corridors.interiors) == 3
    rooms = [part for part in wide if part is not corridors]
    assert len(rooms) >= 20
    assert all(part.area > 1.0 for part in rooms)


def test_the_wing_of_l457_stands_at_an_angle() -> None:
    """Of 7, 24 and 25: all walls are along or across the building, or along or across the wing, but for one corner."""
    walls = Environment.load(maps.path("l457")).walls
    span = walls[:, 1] - walls[:, 0]
    angle = np.degrees(np.arctan2(span[:, 1], span[:, 0])) % 90.0
    tilt = np.degrees(np.arctan2(7.0, 24.0))
    straight, tilted = (np.abs((angle - of + 45.0) % 90.0 - 45.0) < 1e-6 for of in (0.0, tilt))
    assert np.count_nonzero(tilted) > 30
    assert np.count_nonzero(~straight & ~tilted) == 1


@pytest.mark.parametrize("name", SCALED)
def test_the_thesis_maps_are_scaled_to_the_last_bit(name: str) -> None:
    [file] = [file for file in shared_maps("thesis") if file.stem == name]
    original, ours = json.loads(file.read_text(encoding="utf-8")), read(name)
    for was, ring in zip([original["outer"], *original["holes"]], [ours["outer"], *ours["holes"]], strict=True):
        assert (SCALED[name] * np.array(was)).tolist() == ring


def test_the_office_stands_on_a_grid_of_5_centimetres() -> None:
    content = read("office")
    points = np.concatenate([np.array(ring) for ring in [content["outer"], *content["holes"]]])
    assert np.abs(points * 20 - np.rint(points * 20)).max() < 1e-9


def test_a_robot_can_stand_where_the_readme_puts_it() -> None:
    robots = [(3.4, 9.0), (3.4, 9.8), (3.4, 10.6), (3.4, 11.4), (3.4, 12.2)]
    walk = [(5.0, 9.0), (15.0, 3.0), (29.0, 3.5), (33.0, 19.0)]
    free = Environment.load(maps.path("office")).inflated(0.25)
    assert free.contains([(2.0, 11.0), *robots, *walk]).all()
