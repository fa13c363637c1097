"""Collisions and connection of a schedule that is bound to the clock, at every instant.

Part of the certificate, and written apart from all planners.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from planning.certificate_clearance import find_collisions
from planning.certificate_motion import join_motions
from planning.certificate_network import find_breaks, find_gaps
from planning.certificate_sight import watch
from planning.certificate_violation import Violation, name_parts
from planning.motion_plan import Schedule

Floats = NDArray[np.float64]
Motions = dict[tuple[int, int], tuple[Floats, Floats, Floats]]


def check_clock(
    schedule: Schedule,
    walls: Floats,
    depth: float,
    required: Sequence[tuple[int, int]] | None,
    ends: Sequence[int] | None,
) -> Iterator[Violation]:
    """What is wrong between members at any time.

    Args:
        schedule: of k members.
        walls: (w, 2, 2) float, metres: receded.
        depth: by which they are, and by which discs may overlap, metres.
        required: rows of members that must see each other; None: no such pair.
        ends: rows of members that one network must hold; None: all, unless there are required links.
    """
    start, end = schedule.start_s, schedule.end_s
    motions = {
        (i, j): join_motions(p.times_s, p.waypoints, q.times_s, q.waypoints, start, end)
        for (i, p), (j, q) in combinations(enumerate(schedule.paths), 2)
    }
    yield from _check_collisions(schedule, motions, depth)
    yield from _check_connection(schedule, motions, walls, depth, required, ends)


def merge_intervals(intervals: Floats) -> list[tuple[float, float]]:
    """Intervals (n, 2 or more) in any order, joined where they touch or overlap."""
    merged: list[tuple[float, float]] = []
    for start, end in sorted((float(row[0]), float(row[1])) for row in intervals):
        if merged and start <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        else:
            merged.append((start, end))
    return merged


def _until(schedule: Schedule, end_s: float) -> float:
    """What is so when all have come to stand stays so."""
    return end_s if end_s < schedule.end_s else np.inf


def _check_collisions(schedule: Schedule, motions: Motions, depth: float) -> Iterator[Violation]:
    for (i, j), motion in motions.items():
        if min(schedule.radii_m[i], schedule.radii_m[j]) == 0.0:
            continue
        separation = float(schedule.radii_m[i] + schedule.radii_m[j])
        for start, end in merge_intervals(find_collisions(*motion, separation - depth)):
            one, other = schedule.members[i], schedule.members[j]
            text = f"{one} and {other} are nearer than {separation:g} m to each other from {start:.6g} s on"
            yield Violation(start, _until(schedule, end), "collision", (one, other), text)


def _check_connection(
    schedule: Schedule,
    motions: Motions,
    walls: Floats,
    depth: float,
    required: Sequence[tuple[int, int]] | None,
    ends: Sequence[int] | None,
) -> Iterator[Violation]:
    names = schedule.members
    network = required is None or ends is not None
    sight = {
        pair: watch(*motion, walls, depth) for pair, motion in motions.items() if network or pair in (required or ())
    }
    for i, j in required or ():
        for start, end in find_gaps(sight[i, j], schedule.start_s, schedule.end_s):
            text = f"{names[i]} and {names[j]} do not see each other from {start:.6g} s on"
            yield Violation(start, _until(schedule, end), "connection", (names[i], names[j]), text)
    if network:
        for gap in find_breaks(sight, len(schedule), schedule.start_s, schedule.end_s, ends):
            lost, parts = name_parts(names, gap.parts, gap.lost)
            why = f"as {lost} lose sight of each other, " if lost else ""
            i, j = gap.between
            text = f"{why}the team is parted from {gap.start_s:.6g} s on: {parts}"
            yield Violation(gap.start_s, _until(schedule, gap.end_s), "connection", (names[i], names[j]), text)
