"""Map files: what is read, what is refused, and with which sentence."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from planning.environment import Environment
from planning.polygon_file import UnreadableMap
from planning.polygon_validation import InvalidEnvironment
from tests.planning.polygons import environment_of, shared_maps

SQUARE = [[0, 0], [10, 0], [10, 10], [0, 10]]
PILLAR = [[4, 4], [6, 4], [6, 6], [4, 6]]
DEEP = "DEEP"
SMALL = [[20, 0], [23, 0], [23, 3], [20, 3]]


def closed(ring: list[list[int]]) -> list[list[int]]:
    return [*ring, ring[0]]


def polygon(*rings: list[list[int]]) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": [closed(ring) for ring in rings]}


def write(folder: Path, content: object, name: str = "map.json") -> Path:
    path = folder / name
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


@pytest.mark.parametrize("seed", range(4))
def test_saved_map_loads_to_the_same_floats(tmp_path: Path, seed: int) -> None:
    drawn = environment_of(seed)
    environment = Environment(drawn.outer, drawn.holes, 'Ü "quoted"', source="drawn by hand, CC0")
    environment.save(tmp_path / "map.json")
    again = Environment.load(tmp_path / "map.json")
    assert np.array_equal(again.vertices, environment.vertices)
    assert np.array_equal(again.ring_starts, environment.ring_starts)
    assert (again.name, again.source) == (environment.name, environment.source)
    assert [path.name for path in tmp_path.iterdir()] == ["map.json"]


def test_failed_save_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path, "the old map")

    def fail(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        Environment(SQUARE).save(path)
    assert path.read_text() == "the old map"
    assert [file.name for file in tmp_path.iterdir()] == ["map.json"]


def test_project_map_without_the_optional_fields(tmp_path: Path) -> None:
    environment = Environment.load(write(tmp_path, {"outer": SQUARE}, "hall.json"))
    assert (environment.name, environment.area, environment.holes) == ("hall", 100.0, ())


@pytest.mark.parametrize(
    ("content", "area", "name"),
    [
        (polygon(SQUARE, PILLAR), 96.0, "map"),
        ({"type": "MultiPolygon", "coordinates": [[closed(SMALL)], [closed(SQUARE), closed(PILLAR)]]}, 96.0, "map"),
        ({"type": "Feature", "properties": {"name": "hall"}, "geometry": polygon(SQUARE)}, 100.0, "hall"),
        ({"type": "Feature", "properties": None, "geometry": polygon(SQUARE)}, 100.0, "map"),
        (
            {
                "type": "FeatureCollection",
                "name": "floor",
                "features": [
                    {"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": [1, 2]}},
                    {"type": "Feature", "properties": {}, "geometry": None},
                    {"type": "Feature", "properties": {}, "geometry": polygon(SMALL)},
                    {"type": "Feature", "properties": {"name": "hall"}, "geometry": polygon(SQUARE)},
                ],
            },
            100.0,
            "hall",
        ),
        ({"type": "GeometryCollection", "geometries": [polygon(SMALL)]}, 9.0, "map"),
        (
            {"type": "Polygon", "coordinates": [[[x, y, 2.5] for x, y in closed(SQUARE)]]},
            100.0,
            "map",
        ),
        (
            {**polygon(SQUARE), "crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::25832"}}},
            100.0,
            "map",
        ),
    ],
)
def test_geojson_forms(tmp_path: Path, content: dict[str, Any], area: float, name: str) -> None:
    for suffix in ("geojson", "json"):
        environment = Environment.load(write(tmp_path, content, f"map.{suffix}"))
        assert environment.area == pytest.approx(area)
        assert environment.name == name


@pytest.mark.parametrize(
    ("point", "area"), [((21, 1), 9.0), ((20, 0), 9.0), ((1, 1), 96.0), ((5, 5), 96.0), ((-50, 0), 96.0), (None, 96.0)]
)
def test_component_that_holds_a_point_else_the_largest(
    tmp_path: Path, point: tuple[float, float] | None, area: float
) -> None:
    content = {"type": "MultiPolygon", "coordinates": [[closed(SMALL)], [closed(SQUARE), closed(PILLAR)]]}
    assert Environment.load(write(tmp_path, content), containing=point).area == pytest.approx(area)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("", r"bad JSON at line 1, column 1"),
        ('{"outer": [\n[0, 0],\n[1, 0]\n[1, 1]]}', r"bad JSON at line 4, column 1 .*correct it there"),
        ("[" * 100_000, r"nested too deeply"),
        ('{"outer": [[' + "9" * 5000 + ", 0], [1, 0], [1, 1]]}", r"a number of thousands of digits"),
        ([SQUARE], r"holds no JSON object"),
        ({"name": "hall"}, r'the field "outer" is missing: add it as a list of \[x, y\] in metres'),
        ({"outer": SQUARE, "hole": [PILLAR]}, r'unknown field "hole"'),
        ({"outer": SQUARE, "units": "feet"}, r"its units are 'feet': convert it to metres"),
        ({"outer": SQUARE, "units": ["metres"]}, r"its units are \['metres'\]: convert it to metres"),
        ({"outer": SQUARE, "holes": {"a": PILLAR}}, r'"holes" is not a list of rings'),
        ({"outer": SQUARE, "name": 7}, r'"name" and "source" must be texts'),
        ({"type": "LineString", "coordinates": SQUARE}, r"holds no Polygon or MultiPolygon"),
        ({"type": "FeatureCollection"}, r"incomplete or of the wrong form"),
        ({"type": "FeatureCollection", "features": [3]}, r"incomplete or of the wrong form"),
        ({"type": "Polygon", "coordinates": []}, r"incomplete or of the wrong form"),
        ({"type": "Polygon", "coordinates": [[1, 2, 3]]}, r"incomplete or of the wrong form"),
        (
            {**polygon(SQUARE), "crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}},
            r'its "crs" is geographic \(degrees\): project it to a local frame in metres',
        ),
        (
            {**polygon(SQUARE), "crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::4326"}}},
            r'its "crs" is geographic',
        ),
        ({**polygon(SQUARE), "crs": {"type": "name", "properties": {"name": "EPSG:4326"}}}, r'its "crs" is geographic'),
    ],
)
def test_unreadable_file_says_what_to_do(tmp_path: Path, content: object, sentence: str) -> None:
    path = write(tmp_path, content)
    with pytest.raises(UnreadableMap, match=sentence) as refusal:
        Environment.load(path)
    assert str(refusal.value).startswith(f"{path}: ")
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ({"outer": [[0, 0], [10, 10], [10, 0], [0, 10]]}, r"the outer ring crosses itself"),
        (polygon([[0, 0], [10, 10], [10, 0], [0, 10]]), r"the outer ring crosses itself"),
        (
            {"type": "MultiPolygon", "coordinates": [[closed(SMALL)], [[[0, 0], [1, "x"], [1, 1]]]]},
            r"the outer ring is not a list of points",
        ),
        ('{"outer": [[0, 0], [NaN, 0], [1, 1]]}', r"not a finite number at its point 2"),
        ('{"outer": [[0, 0], [true, 0], [1, 1]]}', r"not a finite number at its point 2"),
        ('{"outer": [[0, 0], [1, 0], [1, "1"]]}', r"not a finite number at its point 3"),
        ('{"outer": [[0, 0], [1, null], [1, 1]]}', r"not a finite number at its point 2"),
        ({"outer": [[0, 0], [10**400, 0], [1, 1]]}, r"a coordinate beyond 1000000000 m: give metres in a local frame"),
        ({"outer": SQUARE, "holes": [[[4, 4], [4, 5], [-2e9, 5]]]}, r"hole 1 .* beyond 1000000000 m at its point 3"),
        ({"outer": [[1e300, 0], [1e300, 1], [0, -1e308]]}, r"a coordinate beyond 1000000000 m at its point 1"),
    ],
)
def test_invalid_rings_name_the_file(tmp_path: Path, content: object, sentence: str) -> None:
    path = write(tmp_path, content)
    with pytest.raises(InvalidEnvironment, match=sentence) as refusal:
        Environment.load(path)
    assert str(refusal.value).startswith(f"{path}: ")
    assert len(str(refusal.value)) < len(str(path)) + 150


@pytest.mark.parametrize("name", ["map.txt", "map", "map.pgm"])
def test_what_is_no_map_by_name_and_content_is_told_the_formats(tmp_path: Path, name: str) -> None:
    with pytest.raises(UnreadableMap, match=r"this is no map: name a .json, .geojson or .wkt file .*\.yaml"):
        Environment.load(write(tmp_path, "P2 2 2 255", name))
    assert Environment.load(write(tmp_path, {"outer": SQUARE}, name)).area == 100.0


@pytest.mark.parametrize("depth", [50, 400, 700, 900, 4000])
@pytest.mark.parametrize(
    ("before", "after"),
    [
        ('{"outer": ' + DEEP + "}", ""),
        ('{"outer": [[0, 0], [1, 0], [1, 1]], "units": ' + DEEP + "}", ""),
        ('{"type": "Polygon", "coordinates": [], "crs": ' + DEEP + "}", ""),
        ('{"type": "GeometryCollection", "geometries": [', "]}"),
        ('{"type": "Feature", "properties": null, "geometry": ', "}"),
    ],
)
def test_deep_nesting_is_refused_in_a_sentence(tmp_path: Path, before: str, after: str, depth: int) -> None:
    text = before * depth + "{}" + after * depth if after else before.replace(DEEP, "[" * depth + "]" * depth)
    path = write(tmp_path, text)
    with pytest.raises((UnreadableMap, InvalidEnvironment)) as refusal:
        Environment.load(path)
    assert str(refusal.value).startswith(f"{path}: ")
    assert len(str(refusal.value)) < len(str(path)) + 150


def test_absent_folder_binary_and_forbidden_files(tmp_path: Path) -> None:
    with pytest.raises(UnreadableMap, match=r"nowhere.json: no such map file: check the path"):
        Environment.load(tmp_path / "nowhere.json")
    with pytest.raises(UnreadableMap, match="this is a folder"):
        Environment.load(tmp_path)
    (tmp_path / "picture.json").write_bytes(b"\x89PNG\xff\xfe\x00")
    with pytest.raises(UnreadableMap, match="this is not text"):
        Environment.load(tmp_path / "picture.json")
    if os.geteuid() != 0:
        locked = write(tmp_path, {"outer": SQUARE}, "locked.json")
        locked.chmod(0)
        with pytest.raises(UnreadableMap, match="cannot be read"):
            Environment.load(locked)


def test_shared_thesis_maps_load() -> None:
    for path in shared_maps("thesis"):
        environment = Environment.load(path)
        assert environment.name == path.stem
        assert environment.area == pytest.approx(environment.polygon.area)


WKT_SQUARE = "((0 0, 10 0, 10 10, 0 10, 0 0), (4 4, 6 4, 6 6, 4 6, 4 4))"
WKT_SMALL = "((20 0, 23 0, 23 3, 20 3, 20 0))"


@pytest.mark.parametrize(
    ("text", "area"),
    [
        (f"POLYGON {WKT_SQUARE}", 96.0),
        (f"polygon{WKT_SQUARE}\n", 96.0),
        ("Polygon Z ((0 0 7, 1e1 0 7, 10. +10 7, .0 10 7))", 100.0),
        ("POLYGONZM((0 0 7 1, 10 0 7 1, 10 10 7 1, 0 10 7 1, 0 0 7 1))", 100.0),
        ("POLYGON M ((0 0 7,10 0 7,10 10 7,0 10 7,0 0 7))", 100.0),
        (f"SRID=25832;POLYGON {WKT_SMALL}", 9.0),
        (f"MULTIPOLYGON ({WKT_SMALL},\n  {WKT_SQUARE})", 96.0),
        (f"MULTIPOLYGON (EMPTY, {WKT_SMALL})", 9.0),
        (
            f"GEOMETRYCOLLECTION (POINT (1 2), MULTIPOINT ((1 2), (3 4)), LINESTRING EMPTY, POLYGON EMPTY, "
            f"GEOMETRYCOLLECTION (POLYGON {WKT_SMALL}))",
            9.0,
        ),
        (f"POLYGON {WKT_SMALL}\nPOLYGON {WKT_SQUARE}\n", 96.0),
        (f"POLYGON {WKT_SMALL};\nLINESTRING (0 0, 1 1);\n", 9.0),
    ],
)
def test_wkt_forms(tmp_path: Path, text: str, area: float) -> None:
    for name in ("hall.wkt", "hall.txt"):
        environment = Environment.load(write(tmp_path, text, name))
        assert environment.name == "hall"
        assert environment.area == pytest.approx(area)


@pytest.mark.parametrize("seed", range(4))
def test_wkt_as_another_library_writes_it_reads_back(tmp_path: Path, seed: int) -> None:
    drawn = environment_of(seed)
    far = shapely.box(100.0, 0.0, 101.0, 1.0)
    for geometry in (drawn.polygon, shapely.MultiPolygon([far, drawn.polygon]), shapely.force_3d(drawn.polygon, 2.0)):
        path = write(tmp_path, shapely.to_wkt(geometry, rounding_precision=-1), "map.wkt")
        environment = Environment.load(path, containing=drawn.vertices[0])
        again, once = shapely.normalize(environment.polygon), shapely.normalize(drawn.polygon)
        assert shapely.equals_exact(again, once, tolerance=1e-14)  # it writes 16 digits


def test_wkt_component_that_holds_a_point(tmp_path: Path) -> None:
    path = write(tmp_path, f"MULTIPOLYGON ({WKT_SQUARE}, {WKT_SMALL})", "map.wkt")
    assert Environment.load(path, containing=(21, 1)).area == pytest.approx(9.0)
    assert Environment.load(path, containing=(1, 1)).area == pytest.approx(96.0)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", r"holds no Polygon or MultiPolygon"),
        ("LINESTRING (0 0, 1 1)", r"holds no Polygon or MultiPolygon"),
        ("POLYGON EMPTY", r"holds no Polygon or MultiPolygon"),
        ("hello", r"bad WKT at line 1, column 1: expected the name of a geometry such as POLYGON and found 'hello'"),
        ("POLYGON", r"bad WKT at line 1, column 8: expected '\(' and found the end of the text: correct it there"),
        ("POLYGON ((0 0, 1 0,\n 1 x))", r"bad WKT at line 2, column 4: expected a number and found 'x\)\)'"),
        ("POLYGON ((0 0, 1 0, 1 1)", r"line 1, column 25: expected ',' or '\)' and found the end"),
        ("POLYGON ((0 0, 1 0, 1 1)))", r"column 26: expected the name of a geometry such as POLYGON and found '\)'"),
        ("POLYGON ((0 0, 1 nan, 1 1))", r"column 18: expected a number and found 'nan"),
        ("POLYGON ((0 0, 1 0 0 0 0, 1 1))", r"column 24: expected ',' or '\)'"),
        ("POLYGON ((0 0, 1 0, #))", r"column 21: expected a word, a number or a bracket and found '#\)\)'"),
        ("POINT (0 0", r"expected '\)' and found the end"),
        ("CURVEPOLYGON ((0 0, 1 0, 1 1))", r"expected the name of a geometry such as POLYGON"),
        ("SRID=;POLYGON EMPTY", r"column 6: expected a number"),
        ("SRID=4326;POLYGON ((0 0, 1 0, 1 1))", r'its "SRID" is geographic \(degrees\)'),
        ("GEOMETRYCOLLECTION (" * 5000, r"nested too deeply"),
    ],
)
def test_unreadable_wkt_says_what_to_do(tmp_path: Path, text: str, sentence: str) -> None:
    path = write(tmp_path, text, "map.wkt")
    with pytest.raises(UnreadableMap, match=sentence) as refusal:
        Environment.load(path)
    assert str(refusal.value).startswith(f"{path}: ")
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("POLYGON ((0 0, 1 0))", r"the outer ring has 2 point\(s\): a ring needs at least 3"),
        ("POLYGON ((0 0, 1e999 0, 1 1))", r"not a finite number at its point 2"),
        ("POLYGON ((0 0, 10 10, 10 0, 0 10))", r"the outer ring crosses itself"),
    ],
)
def test_invalid_wkt_rings_name_the_file(tmp_path: Path, text: str, sentence: str) -> None:
    path = write(tmp_path, text, "map.wkt")
    with pytest.raises(InvalidEnvironment, match=sentence) as refusal:
        Environment.load(path)
    assert str(refusal.value).startswith(f"{path}: ")
