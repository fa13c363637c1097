"""Where an independent agent may go: from anywhere in a set, by shortest ways, to anywhere in reach.

Whoever can go anywhere has no way that could be planned for. But after d metres it is in the set *grown by d*: at a
place whose shortest way from the set is no longer. So chains are made for the set as it is and for the set grown by so
many metres, and weighed on a few ways that lead, each by the shortest way, to places in reach that are as far from each
other as can be; and on that it stays where it may be now.

Somebody who walks mostly walks on. If the middle of the set has been moving, ways in that direction are likelier.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from agents.target_set import TargetSet
from agents.whereabouts import PIECE_M, Aim, Whereabouts, name_place
from planning.foresight import length, tail, walk
from planning.geodesic import GeodesicMap
from planning.geodesic_table import GeodesicTable
from protocol.messages import Point

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NODES: Final = 600
"""About so many places stand for all that the agent can go to."""

GROWTHS_M: Final = (1.5, 4.0, 8.0)
"""Chains are considered for the set grown by so much."""

SAMPLES: Final = 16
PITCH_M: Final = 0.3
"""So many places stand for the set, at most, and no nearer to each other."""

UNKNOWN: Final = 100
"""So many stand for the map."""

REACH_S: Final = 8.0
"""Ways are so long, as the agent goes."""

WAYS: Final = 12
"""So many ways, at most."""

AIMED: Final = 3
"""Of so many of them, the likeliest, chains are made for the set and all of the way."""

STAYS: Final = 0.2
"""Chance that it stays where it may be now."""

STAYING: Final = 4
"""At so many places, at most."""

INSISTENCE: Final = 2.0
"""A way straight on is e² times as likely as one at right angles to an agent that has gone at full speed."""

NEAR_M: Final = 1.5
"""The direction in which a way begins is where it is after this."""


class Roaming:
    """The ways of an agent in one map.

    Args:
        geodesics: its shortest paths.
        speed_m_s: the most that it can go.
        home: while nothing is known of it, robots wait on the way from there.
    """

    def __init__(self, geodesics: GeodesicMap, speed_m_s: float, home: Point) -> None:
        self._geodesics, self._speed_m_s, self._home = geodesics, speed_m_s, home
        self._nodes = _spread(geodesics)
        self._table = GeodesicTable(geodesics, self._nodes)
        self._between = self._table.between

    def whereabouts(self, target: TargetSet | None, drift_m_s: Point, lead_s: float) -> Whereabouts:
        """Where the agent may be in a moment.

        Args:
            target: where it may be now; None: anywhere.
            drift_m_s: how the middle of that has been moving.
            lead_s: how long until then.

        Complexity: that of a row of a geodesic table for each of up to SAMPLES places, and of WAYS shortest paths.
        """
        if target is None:
            return self._anywhere()
        samples = thin(self._inside(np.array([target.center, *target.samples])), SAMPLES, PITCH_M)
        gone_m = self._speed_m_s * lead_s
        drift = np.array(drift_m_s) * min(1.0, self._speed_m_s / max(math.hypot(*drift_m_s), 1e-9))
        x, y = self._geodesics.nearest(samples[0] + lead_s * drift).tolist()
        rows = np.array([self._table.lengths(sample) for sample in samples])
        nearest, lengths = rows.argmin(axis=0), rows.min(axis=0)
        reach_m = self._speed_m_s * REACH_S
        ends = self._far_apart(np.flatnonzero((lengths > PIECE_M) & (lengths <= reach_m + gone_m)), lengths)
        going = [self._geodesics.path(samples[nearest[end]], self._nodes[end]) for end in ends]
        chances = self._chances(going, drift)
        going = [tail(way, gone_m) for way in going]
        staying = [sample[None] for sample in thin(samples, STAYING)]
        stays = STAYS if going else 1.0
        ways = (*going, *staying)
        likely = np.concatenate([(1.0 - stays) * chances, np.full(len(staying), stays / len(staying))])
        title = f"the estimate of {in_words(target.area_m2)} around {name_place(target.center)}"
        now = np.concatenate([samples, *(way[:1] for way in going)])
        likeliest = [going[index] for index in np.argsort(-chances, kind="stable")[:AIMED]]
        aims = self._aims(title, now, lengths - gone_m, likeliest)
        return Whereabouts((x, y), ways, likely, aims, announced=False)

    def _aims(self, title: str, now: Floats, lengths: Floats, likeliest: list[Floats]) -> tuple[Aim, ...]:
        """For the set, the set grown, the set and each of the likeliest ways; nodes are so far away (n,), metres."""
        aims = [_aim(now, np.empty((0, 2)), 0.0, title, f"for {title}")]
        for growth_m in GROWTHS_M:
            if np.any(lengths <= growth_m):
                grown = self._nodes[lengths <= growth_m]
                aims.append(_aim(now, grown, growth_m, title, f"for {title} and all within {growth_m:.1f} m of it"))
        for way in likeliest:
            pieces = walk(way, np.arange(0.0, length(way) + PIECE_M, PIECE_M))
            aims.append(_aim(now, pieces, length(way), title, f"for {title} and the way to {name_place(way[-1])}"))
        return tuple(aims)

    def _anywhere(self) -> Whereabouts:
        """Of an agent of which nothing has been measured."""
        title = "an agent of which nothing is known yet"
        places = thin(self._nodes, UNKNOWN)
        ways = tuple(place[None] for place in thin(places, WAYS))
        aims = (_aim(places, np.empty((0, 2)), 0.0, title, f"for {title}"),)
        return Whereabouts(self._home, ways, np.full(len(ways), 1.0 / len(ways)), aims, announced=False)

    def _inside(self, points: Floats) -> Floats:
        """Points, those too near to walls moved away from them."""
        free = self._geodesics.environment.contains(points)
        return np.array([
            point if inside else self._geodesics.nearest(point) for point, inside in zip(points, free, strict=True)
        ])  # fmt: skip

    def _far_apart(self, nodes: Ints, lengths: Floats) -> list[int]:
        """Up to WAYS of these nodes, the farthest from the set first, each as far from those before as can be."""
        chosen: list[int] = []
        gaps = lengths[nodes].copy()
        while len(chosen) < WAYS and len(nodes) and gaps.max() > NEAR_M:
            chosen.append(int(nodes[gaps.argmax()]))
            gaps = np.minimum(gaps, self._between[chosen[-1], nodes])
        return chosen

    def _chances(self, ways: list[Floats], drift_m_s: Floats) -> Floats:
        """How likely each of the ways is taken, of sum 1."""
        if not ways:
            return np.empty(0)
        begins = np.array([walk(way, np.array([NEAR_M]))[0] - way[0] for way in ways])
        along = begins @ drift_m_s / np.maximum(np.hypot(*begins.T), 1e-9) / self._speed_m_s
        chances = np.exp(INSISTENCE * along)
        return np.asarray(chances / chances.sum())


def _aim(now: Floats, later: Floats, ahead_m: float, title: str, whole: str) -> Aim:
    """Half of what is seen counts for the set as it is, half for what is added."""
    part = f"for the most of {title}" + (f", {ahead_m:.1f} m ahead" if len(later) else "")
    shares = np.concatenate([np.full(len(places), 1.0 / max(len(places), 1)) for places in (now, later)])
    return Aim(np.concatenate([now, later]), shares / shares.sum(), ahead_m, whole, part)


def thin(points: Floats, number: int, pitch_m: float = 0.0) -> Floats:
    """So many of some points (m, 2), at most: the first, then always the one farthest from those before, if it is."""
    chosen = [0]
    gaps = np.hypot(*(points - points[0]).T)
    while len(chosen) < number and gaps.max() > pitch_m:
        chosen.append(int(gaps.argmax()))
        gaps = np.minimum(gaps, np.hypot(*(points - points[chosen[-1]]).T))
    return points[chosen]


def in_words(area_m2: float) -> str:
    """An area, to two digits."""
    return f"{area_m2:.2f} m²" if area_m2 < 1.0 else f"{area_m2:.1f} m²" if area_m2 < 100.0 else f"{area_m2:.0f} m²"


def _spread(geodesics: GeodesicMap) -> Floats:
    """The corners that are hardest to see into, and a square grid."""
    free = geodesics.environment
    spacing_m = math.sqrt(free.area / NODES)
    low, high = np.array(free.bounds[:2]), np.array(free.bounds[2:])
    numbers = np.floor((high - low) / spacing_m).astype(int) + 1
    first = low + 0.5 * (high - low - (numbers - 1) * spacing_m)
    grid = np.stack(np.meshgrid(*(np.arange(number) for number in numbers), indexing="ij"), axis=-1).reshape(-1, 2)
    points = first + grid * spacing_m
    return np.concatenate([free.vertices[~free.is_reflex], points[free.contains(points)]])
