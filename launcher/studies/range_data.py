"""Data sets of ranges: a moving node with a known path, beacons with known places, and ranges between them.

Three CSV files in a folder: ``path.csv`` with columns t, x, y; ``beacons.csv`` with beacon, x, y; ``ranges.csv`` with
t, beacon, range; seconds and metres.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class BadData(ValueError):
    """A data set that cannot be used; the text names file, place and remedy."""


@dataclass(frozen=True, eq=False)
class RangeData:
    """A data set, in the order of time.

    Attributes:
        name: of the folder.
        path: (p, 3) float: t [s], x, y [m].
        beacons: by name, (2,) float, metres.
        times: (n,) float, seconds, never falling.
        names: (n,) str, the beacon of each range.
        ranges: (n,) float, metres, as measured.
        places: (n, 2) float, metres: the moving node at those times, between the path's points.
    """

    name: str
    path: Floats
    beacons: dict[str, Floats]
    times: Floats
    names: NDArray[np.str_]
    ranges: Floats
    places: Floats

    @property
    def distances(self) -> Floats:
        """(n,) float, metres: true distances."""
        anchors = np.array([self.beacons[name] for name in self.names])
        return np.asarray(np.hypot(*(self.places - anchors).T))


def read_range_data(folder: Path) -> RangeData:
    """Read a data set.

    Raises:
        BadData: a file is missing, has other columns, holds something that is no number, times that fall, a beacon
            that is not in ``beacons.csv``, or nothing at all.
    """
    path = np.array([[_number(row, key) for key in ("t", "x", "y")] for row in _read(folder / "path.csv", "t,x,y")])
    if len(path) < 2 or (np.diff(path[:, 0]) <= 0).any():
        raise BadData(f"{folder / 'path.csv'}: the times must rise, with at least two of them; sort the file by t")
    beacons = {
        row.cells["beacon"]: np.array([_number(row, "x"), _number(row, "y")])
        for row in _read(folder / "beacons.csv", "beacon,x,y")
    }
    rows = _read(folder / "ranges.csv", "t,beacon,range")
    for row in rows:
        if row.cells["beacon"] not in beacons:
            raise BadData(f"{row.place}: beacon '{row.cells['beacon']}' has no line in beacons.csv; add it there")
    if not rows:
        raise BadData(f"{folder / 'ranges.csv'}: there is no range in it; give at least one line below the header")
    times, ranges = (np.array([_number(row, key) for row in rows]) for key in ("t", "range"))
    order = np.argsort(times, kind="stable")
    order = order[(times[order] >= path[0, 0]) & (times[order] <= path[-1, 0])]
    if not len(order):
        raise BadData(f"{folder / 'ranges.csv'}: no range lies within the times of path.csv; give both the same clock")
    places = np.stack([np.interp(times[order], path[:, 0], path[:, axis]) for axis in (1, 2)], axis=1)
    names = np.array([row.cells["beacon"] for row in rows])[order]
    name = folder.resolve().name
    return RangeData(name, path, beacons, times[order], names, ranges[order], places)


@dataclass(frozen=True)
class _Row:
    place: str
    cells: dict[str, str]


def _read(file: Path, columns: str) -> list[_Row]:
    wanted = columns.split(",")
    try:
        text = file.read_text(encoding="utf-8-sig")
    except FileNotFoundError as problem:
        raise BadData(
            f"{file}: there is no such file; a data set has path.csv, beacons.csv and ranges.csv"
        ) from problem
    except UnicodeDecodeError as problem:
        raise BadData(f"{file}: this is not text in UTF-8; save it as CSV") from problem
    lines = list(csv.reader(text.splitlines()))
    head = [cell.strip() for cell in lines[0]] if lines else []
    if head != wanted:
        raise BadData(f"{file}, line 1: the columns must be {columns}, not {','.join(head)}")
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        if len(line) != len(wanted):
            raise BadData(f"{file}, line {number}: {len(line)} columns where {len(wanted)} belong; write {columns}")
        rows.append(_Row(f"{file}, line {number}", dict(zip(wanted, map(str.strip, line), strict=True))))
    return rows


def _number(row: _Row, key: str) -> float:
    try:
        value = float(row.cells[key])
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BadData(
            f"{row.place}: {key} is '{row.cells[key]}', which is no finite number; correct it or drop the line"
        )
    return value
