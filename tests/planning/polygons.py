"""Random free spaces for tests, from a seed: the same seed gives the same map."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from planning.environment import Environment
from planning.polygon_validation import InvalidEnvironment

Floats = NDArray[np.float64]


def rectilinear_environment(seed: int, size: int = 12, rooms: int = 9) -> Environment:
    """Overlapping rectangles on whole coordinates less some pillars: many walls and corners lie in line."""

    def draw(rng: np.random.Generator) -> shapely.Geometry:
        corners = rng.integers(0, size - 2, (rooms, 2))
        spans = rng.integers(2, 6, (rooms, 2))
        space = shapely.union_all([shapely.box(*c, *(c + s)) for c, s in zip(corners, spans, strict=True)])
        pillars = rng.integers(1, size, (rooms // 2, 2))
        return space.difference(shapely.union_all([shapely.box(*c, *(c + 1)) for c in pillars]))

    return _first_valid(draw, seed, "rectilinear")


def oblique_environment(seed: int, size: float = 10.0, rooms: int = 8) -> Environment:
    """Overlapping triangles less some smaller ones, no two walls in line: general position, acute corners."""

    def draw(rng: np.random.Generator) -> shapely.Geometry:
        centres = rng.uniform(0.2 * size, 0.8 * size, (rooms, 1, 2))
        rooms_drawn = shapely.polygons(centres + rng.normal(0.0, 0.3 * size, (rooms, 3, 2)))
        pillars = shapely.polygons(rng.uniform(0.0, size, (4, 1, 2)) + rng.normal(0.0, 0.06 * size, (4, 3, 2)))
        return shapely.union_all(rooms_drawn).difference(shapely.union_all(pillars))

    return _first_valid(draw, seed, "oblique")


def environment_of(seed: int) -> Environment:
    """A rectilinear map for an even seed, an oblique one for an odd seed."""
    return rectilinear_environment(seed) if seed % 2 == 0 else oblique_environment(seed)


def free_points(environment: Environment, count: int, rng: np.random.Generator) -> Floats:
    """Points (count, 2) drawn evenly from free space; shapely decides what is free."""
    found: list[Floats] = []
    while sum(map(len, found)) < count:
        drawn = rng.uniform(environment.bounds[:2], environment.bounds[2:], (4 * count, 2))
        found.append(drawn[shapely.contains_xy(environment.polygon, drawn)])
    return np.concatenate(found)[:count]


def wall_points(environment: Environment, count: int, rng: np.random.Generator) -> Floats:
    """Points (count, 2) on walls, up to rounding, a third of them vertices."""
    walls = environment.walls[rng.integers(0, len(environment.walls), count)]
    share = rng.uniform(0.0, 1.0, (count, 1))
    share[::3] = 0.0
    return walls[:, 0] + share * (walls[:, 1] - walls[:, 0])


def covered_segments(environment: Environment, pairs: Floats) -> NDArray[np.bool_]:
    """Which of the segments ``pairs`` (n, 2, 2) lie in closed free space: (n,) bool, by shapely alone.

    GEOS 3.14's ``covers`` alone is no oracle: in `oblique_environment(20265)` it accepts a segment between two vertices
    that leads half a metre outside. So points along each segment that it accepts have to be in the polygon as well.
    """
    segments = shapely.linestrings(pairs)
    shapely.prepare(environment.polygon)
    covered = np.asarray(shapely.covers(environment.polygon, segments))
    for share in np.linspace(0.0, 1.0, 14)[1:-1]:
        places = shapely.points(pairs[covered, 0] + share * (pairs[covered, 1] - pairs[covered, 0]))
        covered[covered] = shapely.distance(environment.polygon, places) <= environment.tolerance_m
    return covered


def shared_maps(folder: str) -> list[Path]:
    """Map files of the shared data: ``../shared`` from the repository, or where SIGHTLINE_DATA says; skips without."""
    root = Path(os.environ.get("SIGHTLINE_DATA", Path(__file__).parents[3] / "shared"))
    files = sorted((root / "maps" / folder).glob("*.json"))
    if not files:
        pytest.skip(f"shared data not present: no maps in {root / 'maps' / folder} (set SIGHTLINE_DATA)")
    return files


def _first_valid(draw: object, seed: int, kind: str) -> Environment:
    """The largest component of the first drawing that has holes or bends and no pinches."""
    assert callable(draw)
    rng = np.random.default_rng(seed)
    for _ in range(100):
        part = max(shapely.get_parts(draw(rng)), key=lambda part: part.area)
        try:
            environment = Environment(part.exterior.coords, [hole.coords for hole in part.interiors], f"{kind} {seed}")
        except InvalidEnvironment:
            continue
        if environment.is_reflex.sum() >= 3:
            return environment
    raise AssertionError(f"no {kind} map from seed {seed}")
