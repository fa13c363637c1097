"""Polygon maps as files: the project's JSON, GeoJSON and well-known text (WKT).

The project's JSON is ``{"name", "units": "metres", "outer", "holes", "source"}`` with rings as lists of [x, y]. GeoJSON
may be a Polygon, MultiPolygon, GeometryCollection, Feature or FeatureCollection; its coordinates are taken as **metres
in a local frame**, not as longitude and latitude, so a file that names a geographic coordinate system is refused. WKT
is treated alike, polygons of several geometries included.
"""

from __future__ import annotations

import json
import os
import re
import reprlib
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planning.line_of_sight import point_is_free
from planning.polygon_validation import InvalidEnvironment, read_ring, signed_area
from planning.well_known_text import BadText, is_well_known_text, parse

Floats = NDArray[np.float64]

_FIELDS = frozenset({"name", "units", "outer", "holes", "source", "licence", "description"})
_METRES = frozenset({"metres", "meters", "metre", "meter", "m"})
_GEOGRAPHIC_NAME = re.compile(r"CRS:?(?:84|83|27)\b", re.IGNORECASE)
_GEOGRAPHIC_EPSG = frozenset(
    {4171, 4230, 4258, 4267, 4269, 4277, 4283, 4326, 4490, 4612, 4617, 4674, 4979, 6318, 6668, 7844, 9000}
)
_EPSG = re.compile(r"EPSG:+(?:[\d.]*:)?(\d+)", re.IGNORECASE)

_FORMATS = "name a .json, .geojson or .wkt file with polygons, or the .yaml of an occupancy grid"


class UnreadableMap(ValueError):
    """A map file that cannot be read; the text is one sentence with file, place and remedy."""


@dataclass(frozen=True, slots=True)
class PolygonMap:
    """What a polygon file says, rings unchecked."""

    name: str
    outer: ArrayLike
    holes: tuple[ArrayLike, ...]
    source: str


def read_polygon_file(path: Path, containing: Floats | None = None) -> PolygonMap:
    """Read a polygon map.

    Args:
        path: ``.json``, ``.geojson`` or ``.wkt``; what is inside decides, not the suffix.
        containing: (2,) metres: of several polygons take the one that holds this point, else the largest.

    Raises:
        UnreadableMap: the file is absent, unreadable, none of the forms, or not in metres.
    """
    try:
        text = _read_text(path)
        if path.suffix.lower() == ".wkt" or is_well_known_text(text):
            return _choose_polygon(path, _find_in_text(path, text), containing)
        content = _parse_json(path, text)
        if not isinstance(content, dict):
            raise UnreadableMap(
                f'{path}: the file holds no JSON object: expected {{"outer": [[x, y], ...], ...}} or GeoJSON'
            )
        if "type" in content and "outer" not in content:
            _refuse_degrees(path, content)
            return _choose_polygon(path, list(_find_polygons(path, content, path.stem)), containing)
        return _read_project_map(path, content)
    except RecursionError:
        raise UnreadableMap(f"{path}: its lists are nested too deeply for a map: rings are lists of points") from None


def write_polygon_file(path: Path, name: str, outer: Floats, holes: Sequence[Floats], source: str) -> None:
    """Write the project's JSON, one ring a line, in one step: readers see the old file or the new one.

    Coordinates are written so that they read back to the same floats.
    """
    rings = [json.dumps(hole.tolist()) for hole in holes]
    text = (
        f'{{\n  "name": {json.dumps(name)},\n  "units": "metres",\n  "source": {json.dumps(source)},\n'
        f'  "outer": {json.dumps(outer.tolist())},\n'
        '  "holes": [' + ",".join(f"\n    {ring}" for ring in rings) + ("\n  ]\n}\n" if rings else "]\n}\n")
    )
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _read_text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise UnreadableMap(f"{path}: no such map file: check the path") from None
    except IsADirectoryError:
        raise UnreadableMap(f"{path}: this is a folder: name the map file in it") from None
    except OSError as error:
        raise UnreadableMap(f"{path}: cannot be read ({error.strerror}): check its permissions") from None
    except UnicodeDecodeError:
        raise UnreadableMap(f"{path}: this is not text: {_FORMATS}") from None


def _parse_json(path: Path, text: str) -> Any:
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        if path.suffix.lower() not in {".json", ".geojson"}:
            raise UnreadableMap(f"{path}: this is no map: {_FORMATS}") from None
        raise UnreadableMap(
            f"{path}: bad JSON at line {error.lineno}, column {error.colno} ({error.msg}): correct it there"
        ) from None
    except ValueError:  # the interpreter reads whole numbers of at most 4300 digits
        raise UnreadableMap(f"{path}: it holds a number of thousands of digits: give coordinates in metres") from None


def _read_project_map(path: Path, content: dict[str, Any]) -> PolygonMap:
    if "outer" not in content:
        raise UnreadableMap(f'{path}: the field "outer" is missing: add it as a list of [x, y] in metres')
    unknown = sorted(content.keys() - _FIELDS)
    if unknown:
        raise UnreadableMap(f'{path}: unknown field "{unknown[0]}": a map has {", ".join(sorted(_FIELDS))}')
    units = content.get("units", "metres")
    if not isinstance(units, str) or units not in _METRES:
        raise UnreadableMap(
            f'{path}: its units are {reprlib.repr(units)}: convert it to metres and write "units": "metres"'
        )
    holes = content.get("holes", [])
    if not isinstance(holes, list):
        raise UnreadableMap(f'{path}: the field "holes" is not a list of rings: write [] for none')
    name, source = content.get("name", path.stem), content.get("source", "")
    if not isinstance(name, str) or not isinstance(source, str):
        raise UnreadableMap(f'{path}: the fields "name" and "source" must be texts: put them in quotes')
    return PolygonMap(name, content["outer"], tuple(holes), source)


def _find_in_text(path: Path, text: str) -> list[PolygonMap]:
    """All polygons of a file of well-known text."""
    try:
        found = parse(text)
    except BadText as error:
        raise UnreadableMap(f"{path}: {error}") from None
    if not _GEOGRAPHIC_EPSG.isdisjoint(found.reference_systems):
        raise UnreadableMap(
            f'{path}: its "SRID" is geographic (degrees): project it to a local frame in metres, then remove "SRID"'
        )
    return [PolygonMap(path.stem, rings[0], tuple(rings[1:]), "") for rings in found.polygons]


def _refuse_degrees(path: Path, content: dict[str, Any]) -> None:
    """Refuse GeoJSON that names a geographic coordinate system."""
    crs = json.dumps(content.get("crs"))
    code = _EPSG.search(crs)
    if _GEOGRAPHIC_NAME.search(crs) or (code and int(code[1]) in _GEOGRAPHIC_EPSG):
        raise UnreadableMap(
            f'{path}: its "crs" is geographic (degrees): project it to a local frame in metres, then remove "crs"'
        )


def _choose_polygon(path: Path, candidates: Sequence[PolygonMap], containing: Floats | None) -> PolygonMap:
    """The polygon that holds the point, or the largest."""
    if not candidates:
        raise UnreadableMap(f"{path}: it holds no Polygon or MultiPolygon: draw the free space as a polygon")
    if len(candidates) == 1:
        return candidates[0]
    measured = [(_measure(path, candidate, containing), candidate) for candidate in candidates]
    return max(measured, key=lambda pair: pair[0])[1]


def _find_polygons(path: Path, node: Any, name: str) -> Iterator[PolygonMap]:
    """All polygons below a GeoJSON object, with the name of the nearest feature that has one."""
    try:
        kind = node["type"]
        if kind == "FeatureCollection":
            for feature in node["features"]:
                yield from _find_polygons(path, feature, str(node.get("name", name)))
        elif kind == "Feature":
            if node["geometry"] is not None:
                yield from _find_polygons(path, node["geometry"], str((node.get("properties") or {}).get("name", name)))
        elif kind == "GeometryCollection":
            for geometry in node["geometries"]:
                yield from _find_polygons(path, geometry, name)
        elif kind in {"Polygon", "MultiPolygon"}:
            for rings in [node["coordinates"]] if kind == "Polygon" else node["coordinates"]:
                # A third coordinate, where there is one, is a height and no matter of a plan.
                outer, *holes = ([position[:2] for position in ring] for ring in rings)
                yield PolygonMap(name, outer, tuple(holes), "")
    except (AttributeError, IndexError, KeyError, TypeError, ValueError):
        raise UnreadableMap(
            f"{path}: a GeoJSON object is incomplete or of the wrong form: check type, features, geometry, coordinates"
        ) from None


def _measure(path: Path, candidate: PolygonMap, containing: Floats | None) -> tuple[bool, float]:
    """Whether a polygon holds the point, and its area: what the choice among several goes by."""
    try:
        rings = [read_ring(points, index) for index, points in enumerate([candidate.outer, *candidate.holes])]
    except InvalidEnvironment as error:
        raise InvalidEnvironment(f"{path}: {error}") from None
    area = abs(signed_area(rings[0])) - sum(abs(signed_area(ring)) for ring in rings[1:])
    if containing is None:
        return False, area
    walls = np.concatenate([np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in rings])
    walls = walls[np.any(walls[:, 0] != walls[:, 1], axis=1)]
    walls.flags.writeable = False  # as in an Environment, for which the kernel is compiled
    return bool(point_is_free(containing[0], containing[1], walls, 1e-9)), area
