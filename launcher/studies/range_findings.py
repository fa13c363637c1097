"""What a data set gives: its beacons from the path, or its moving node from the beacons.

*Beacons.* For each beacon in turn, scale and offset of the ranges are calibrated on the *other* beacons, so that
nothing about it is known but its ranges. The ellipsoid hears them five times over, since a target at rest may be cut by
the same strips again; the tight set once; and least squares is started from the tight set.

*Target.* The offset of each beacon's ranges is learned on the first fifth of the time, where the path is taken as
known; on the rest the moving node is followed with nothing but a bound on its speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.calibration import calibrate
from estimation.containment_monitor import ContainmentMonitor, Verdict
from estimation.feasible_set import FeasibleSet
from estimation.range_filter import RangeFilter
from estimation.tight_set import TightSet
from launcher.studies.range_data import BadData, RangeData

Floats = NDArray[np.float64]

PASSES = 5
MARGIN = 1.15
"""What a learned bound is multiplied with: the largest of the errors seen understates those to come."""
USUAL_SHARE = 0.99
"""Share of the ranges that are not out of the ordinary."""
LEARNED_SHARE = 0.2
"""Part of the time on which a moving node's offsets are learned."""


@dataclass(frozen=True)
class BeaconFinding:
    """What became of one beacon.

    Attributes:
        beacon: its name.
        place: (2,) float, metres, its true place.
        scale, offset_m, bound_m: how its ranges were read.
        usual_m: the bound that 99 % of the ranges of the other beacons keep; far below ε, a few decide that.
        ranges: how many.
        feasible: the ellipsoid's set after all passes.
        tight: polygons of the tight set.
        center: (2,) float, metres: the ellipsoid's centre.
        solved: (2,) float, metres: least squares from the tight set.
        tight_m2: area of the tight set.
        inside, tight_inside: whether they hold the true place.
        verdict: of the monitor over the tight set, where it was most alarmed.
    """

    beacon: str
    place: Floats
    scale: float
    offset_m: float
    bound_m: float
    usual_m: float
    ranges: int
    feasible: FeasibleSet
    tight: tuple[Floats, ...]
    center: Floats
    solved: Floats
    tight_m2: float
    inside: bool
    tight_inside: bool
    verdict: Verdict

    @property
    def center_error_m(self) -> float:
        """Distance of the ellipsoid's centre from the true place."""
        return float(np.hypot(*(self.center - self.place)))

    @property
    def solved_error_m(self) -> float:
        """Distance of the least-squares position from the true place."""
        return float(np.hypot(*(self.solved - self.place)))


@dataclass(frozen=True)
class TargetFinding:
    """What became of the moving node, at each time that ranges came.

    Attributes:
        bound_m, speed_m_s: as used.
        times: (k,) float, seconds.
        truth: (k, 2) float, metres.
        centers: (k, 2) float, metres: the ellipsoid's centre.
        areas, tight_areas: (k,) float, m².
        inside, tight_inside: (k,) bool.
        rejected: ranges that the ellipsoid rejected.
        ranges: ranges in all.
        verdict: of the monitor over the tight set, where it was most alarmed.
    """

    bound_m: float
    speed_m_s: float
    times: Floats
    truth: Floats
    centers: Floats
    areas: Floats
    tight_areas: Floats
    inside: NDArray[np.bool_]
    tight_inside: NDArray[np.bool_]
    rejected: int
    ranges: int
    verdict: Verdict

    @property
    def errors_m(self) -> Floats:
        """(k,) float: distance of the centre from the truth."""
        return np.asarray(np.hypot(*(self.centers - self.truth).T))

    @property
    def rmse_m(self) -> float:
        """Root of the mean squared error."""
        return math.sqrt(float(np.mean(self.errors_m**2)))


def find_beacons(data: RangeData, bound_m: float | None = None) -> list[BeaconFinding]:
    """Localise every beacon; ε as given, or learned on the other beacons.

    Raises:
        BadData: fewer than two beacons with ranges.
    """
    names = [name for name in data.beacons if (data.names == name).sum() >= 3]
    if len(names) < 2:
        raise BadData(
            f"{data.name}: {len(names)} beacons have three ranges or more; calibrating one on the others takes two"
        )
    return [_find_beacon(data, name, bound_m) for name in names]


def _find_beacon(data: RangeData, name: str, bound_m: float | None) -> BeaconFinding:
    own = data.names == name
    learned = calibrate(data.distances[~own], data.ranges[~own])
    bound = MARGIN * learned.bound_m if bound_m is None else bound_m
    anchors, read = data.places[own], learned.read(data.ranges[own])
    ellipsoid, tight, monitor = RangeFilter(), TightSet(), ContainmentMonitor()
    verdict = monitor.verdict()
    for number in range(PASSES):
        for anchor, z in zip(anchors, read, strict=True):
            ellipsoid.measure(anchor, float(z), bound)
            if number == 0:
                verdict = _graver(verdict, _watch(monitor, tight, anchor, float(z), bound))
                tight.measure(anchor, float(z), bound)
    feasible, place = ellipsoid.feasible_set(), data.beacons[name]
    return BeaconFinding(
        name,
        place,
        learned.scale,
        learned.offset_m,
        bound,
        calibrate(data.distances[~own], data.ranges[~own], coverage=USUAL_SHARE).bound_m,
        int(own.sum()),
        feasible,
        tight.polygons,
        ellipsoid.center,
        _solve(anchors, read, tight.centroid),
        tight.area_m2,
        bool(feasible.contains(place)),
        bool(tight.contains(place)),
        verdict,
    )


def _solve(anchors: Floats, read: Floats, start: Floats) -> Floats:
    """Least squares over the ranges, from a start that is known to be near."""
    from scipy.optimize import least_squares

    def misfit(x: Floats) -> Floats:
        return np.asarray(np.hypot(*(anchors - x).T) - read)

    return np.asarray(least_squares(misfit, start).x, dtype=np.float64)


def _watch(monitor: ContainmentMonitor, tight: TightSet, anchor: Floats, z: float, bound: float) -> Verdict:
    """Show the monitor a range and the set before it."""
    if not tight.started:
        return monitor.verdict()
    nearest, farthest = measure_polygons(tight.polygons, anchor)
    return monitor.observe(z, bound, nearest, farthest)


def _graver(one: Verdict, other: Verdict) -> Verdict:
    return other if other.chance < one.chance else one


def measure_polygons(polygons: tuple[Floats, ...], point: Floats) -> tuple[float, float]:
    """Least and greatest distance of convex polygons, counter-clockwise, from a point, metres."""
    nearest, farthest = math.inf, 0.0
    for ring in polygons:
        away = ring - point
        edges = np.roll(ring, -1, axis=0) - ring
        farthest = max(farthest, float(np.hypot(*away.T).max()))
        if (edges[:, 0] * away[:, 1] - edges[:, 1] * away[:, 0] <= 0).all():
            return 0.0, max(farthest, *(float(np.hypot(*(other - point).T).max()) for other in polygons))
        lengths = np.maximum((edges**2).sum(axis=1), 1e-300)
        share = np.clip(-(away * edges).sum(axis=1) / lengths, 0, 1)
        nearest = min(nearest, float(np.hypot(*(away + share[:, None] * edges).T).min()))
    return nearest, farthest


def find_target(data: RangeData, speed_m_s: float, bound_m: float | None = None) -> TargetFinding:
    """Follow the moving node from the known beacons; ε as given, or learned with the offsets.

    Raises:
        BadData: a beacon has fewer than three ranges in the learning time, or nothing is left after it.
    """
    until = data.times[0] + LEARNED_SHARE * (data.times[-1] - data.times[0])
    early = data.times <= until
    offsets, bounds = {}, []
    for name in data.beacons:
        some = early & (data.names == name)
        if some.sum() < 3:
            raise BadData(
                f"{data.name}: beacon '{name}' has {some.sum()} ranges in the first fifth of the time, and its offset "
                "is learned there; it takes three"
            )
        learned = calibrate(data.distances[some], data.ranges[some], scale=1.0)
        offsets[name] = learned.offset_m
        bounds.append(learned.bound_m)
    bound = MARGIN * max(bounds) if bound_m is None else bound_m
    late = np.flatnonzero(~early)
    if not len(late):
        raise BadData(f"{data.name}: no range comes after the learning time; record for longer")
    ellipsoid, tight, monitor = RangeFilter(), TightSet(), ContainmentMonitor()
    rows: list[tuple[float, float, float, bool, bool]] = []
    centers, moments = [], []
    rejected, last_s = 0, data.times[late[0]]
    verdict = monitor.verdict()
    for place, index in enumerate(late):
        moved = speed_m_s * float(data.times[index] - last_s)
        ellipsoid.predict(moved)
        tight.predict(moved)
        last_s, name = data.times[index], str(data.names[index])
        z = max(0.0, float(data.ranges[index]) + offsets[name])
        anchor = data.beacons[name]
        verdict = _graver(verdict, _watch(monitor, tight, anchor, z, bound))
        rejected += ellipsoid.measure(anchor, z, bound).empty
        tight.measure(anchor, z, bound)
        if place + 1 == len(late) or data.times[late[place + 1]] > last_s:
            feasible, truth = ellipsoid.feasible_set(), data.places[index]
            inside = bool(feasible.contains(truth)), bool(tight.contains(truth))
            rows.append((float(last_s), feasible.area_m2, tight.area_m2, *inside))
            centers.append(ellipsoid.center)
            moments.append(truth)
    times, areas, tight_areas, holds, tight_holds = (np.array(column) for column in zip(*rows, strict=True))
    return TargetFinding(
        bound,
        speed_m_s,
        times,
        np.array(moments),
        np.array(centers),
        areas,
        tight_areas,
        holds,
        tight_holds,
        rejected,
        len(late),
        verdict,
    )
