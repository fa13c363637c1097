"""The filters on other people's ranges: radio beacons around a vehicle, and a tagged trolley among anchors."""

from __future__ import annotations

import csv
import os
from pathlib import Path

import numpy as np
import pytest

from estimation.range_filter import RangeFilter
from estimation.tight_set import TightSet

Floats = np.typing.NDArray[np.float64]

SHARED = Path(os.environ.get("SIGHTLINE_DATA", Path(__file__).resolve().parents[2].parent / "shared" / "data"))


def read(name: str) -> tuple[dict[int, Floats], Floats, list[tuple[float, int, float]]]:
    """Beacons, path (n, 3) of t, x, y and ranges (t, beacon, range)."""
    folder = SHARED / name
    if not folder.is_dir():
        pytest.skip(f"no data set {name} in {SHARED}: set SIGHTLINE_DATA to the folder that holds it")
    tables = []
    for table in ("beacons", "path", "ranges"):
        with (folder / f"{table}.csv").open() as file:
            tables.append([[float(value) for value in row] for row in list(csv.reader(file))[1:]])
    beacons = {int(row[0]): np.array(row[1:]) for row in tables[0]}
    return beacons, np.array(tables[1]), [(t, int(beacon), z) for t, beacon, z in tables[2]]


def positions(path: Floats, times: Floats) -> Floats:
    """(n, 2) along a path, interpolated."""
    return np.column_stack([np.interp(times, path[:, 0], path[:, i]) for i in (1, 2)])


def test_plaza_beacons() -> None:
    beacons, path, ranges = read("plaza1")
    samples = {}
    for beacon, xy in beacons.items():
        rows = np.array([(t, z) for t, b, z in ranges if b == beacon])
        anchors = positions(path, rows[:, 0])
        samples[beacon] = anchors, rows[:, 1], np.hypot(*(anchors - xy).T)
    centers, areas = [], []
    for beacon, xy in beacons.items():
        # Scale and offset from the *other* beacons.
        z = np.concatenate([samples[other][1] for other in beacons if other != beacon])
        truth = np.concatenate([samples[other][2] for other in beacons if other != beacon])
        scale, offset = np.linalg.lstsq(np.column_stack([z, np.ones_like(z)]), truth, rcond=None)[0]
        anchors, measured, _ = samples[beacon]
        f, tight = RangeFilter(), TightSet()
        for passing in range(5):
            for anchor, z_m in zip(anchors, scale * measured + offset, strict=True):
                f.measure(anchor, z_m, 2.0)
                if not passing:
                    tight.measure(anchor, z_m, 2.0)
        assert f.feasible_set().contains(xy) and tight.contains(xy), beacon
        assert tight.area_m2 <= 2.0, (beacon, tight.area_m2)
        centers.append(float(np.hypot(*(f.center - xy))))
        areas.append(tight.area_m2)
    print(f"plaza1: centre errors {np.round(centers, 3)} m, tight areas {np.round(areas, 2)} m²")
    assert np.mean(centers) <= 0.25, centers


def test_lias_trolley() -> None:
    beacons, path, ranges = read("lias_fast")
    times = np.array([t for t, _, _ in ranges])
    truth = positions(path, times)
    anchors = np.array([beacons[b] for _, b, _ in ranges])
    measured = np.array([z for _, _, z in ranges])
    early = times <= times[0] + (times[-1] - times[0]) / 5.0
    residual = measured - np.hypot(*(truth - anchors).T)
    # The bias of each anchor, on the first fifth: the middle of what was seen, as bounds and not means are promised.
    biases = {}
    for beacon in beacons:
        seen = residual[early & np.array([row[1] == beacon for row in ranges])]
        biases[beacon] = float(seen.min() + seen.max()) / 2.0
    f = RangeFilter()
    errors, before = [], times[0]
    for (t, beacon, z), xy in zip(ranges, truth, strict=True):
        f.predict(1.0 * (t - before))
        f.measure(beacons[beacon], z - biases[beacon], 0.39)
        before = t
        assert f.feasible_set().contains(xy), t
        errors.append(np.hypot(*(f.center - xy)))
    rmse = float(np.sqrt(np.mean(np.square(errors[len(errors) // 5 :]))))
    print(f"lias_fast: RMSE {rmse:.3f} m over {len(errors)} ranges")
    assert rmse <= 0.18
