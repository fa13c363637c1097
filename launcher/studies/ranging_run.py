"""One run of an experiment of thesis §2.5: robots range a target that stands, and choose where to go (figs. 12–18).

Per step every robot measures once, in turn, and all sets are told; then every robot that moves asks its law for a
direction, on the shared set and its own position, and drives one step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from estimation.ellipsoid import Ellipsoid
from estimation.feasible_set import FeasibleSet
from estimation.information_control import Limits, covariance_direction, information_gradient
from estimation.information_filter import InformationFilter
from estimation.look_ahead import look_ahead
from estimation.outlier_rule import Relaxation
from estimation.range_filter import RangeFilter
from estimation.thesis_filter import ThesisRangeFilter
from estimation.tight_set import TightSet

Floats = NDArray[np.float64]

BOUND_M = 0.3
STEP_M = 0.4
STEPS = 60
LIMITS = Limits(STEP_M, BOUND_M)
CORRUPT_STEP = 34
"""Step of the flawed position, as in fig. 13."""
FLAW_M = 3.0
"""How far the flawed position is off, along the line of sight, where it shows most."""
RESOLVED_M2 = 0.1
RESOLVED_M = 0.5
"""A tight set of less area and less spread counts as the target found; two mirror images are far apart."""


@dataclass(frozen=True)
class Experiment:
    """Who takes part.

    Attributes:
        name: short, for files and tables.
        title: for figures.
        moving: robots that choose where to go.
        standing: robots that only measure.
    """

    name: str
    title: str
    moving: int
    standing: int


EXPERIMENTS = (
    Experiment("one", "one robot", 1, 0),
    Experiment("one-and-standing", "one moving, one standing", 1, 1),
    Experiment("two", "two moving", 2, 0),
)


@dataclass
class Belief:
    """All that the team holds of the target: our sets, and the baselines that hear the same ranges."""

    ellipsoid: RangeFilter = field(default_factory=RangeFilter)
    tight: TightSet = field(default_factory=TightSet)
    relaxed: TightSet = field(default_factory=lambda: TightSet(Relaxation()))
    thesis: ThesisRangeFilter = field(default_factory=ThesisRangeFilter)
    gaussian: InformationFilter = field(default_factory=InformationFilter.uninformed)


Law = Callable[[Belief, Floats, int], Floats]
"""Belief, position, robot's number → direction."""


def _look(steps: int) -> Law:
    return lambda belief, position, _: look_ahead(belief.tight, position, LIMITS, steps)


LAWS: Mapping[str, Law] = {
    "thesis' gradient": lambda belief, position, _: information_gradient(belief.ellipsoid, position, LIMITS),
    "covariance": lambda belief, position, _: covariance_direction(belief.ellipsoid.feasible_set(), position, LIMITS),
    "1 step ahead": _look(1),
    "5 steps ahead": _look(5),
    "Gaussian": lambda belief, position, _: belief.gaussian.direction(position, LIMITS),
}
STRAIGHT = "straight line"
"""Not a law: every robot drives past the target at 1 to 3 m, whatever it hears."""
THROUGH = "line through the target"
"""The same at 0 m: as near as it gets, and no range tells anything across the line."""


@dataclass(frozen=True)
class Scene:
    """What one step looks like: for snapshots.

    Attributes:
        places: (robots, 2) float, metres, where the robots measured.
        claimed: (robots, 2) float, metres, where they said they were; differs in the corrupt step.
        ranges: (robots,) float, metres.
        feasible: the ellipsoid's set after the step.
        tight: the tight set after it.
        thesis: base projection of the thesis' filter after it; None while it is unbounded or E bounds no set.
    """

    places: Floats
    claimed: Floats
    ranges: Floats
    feasible: FeasibleSet
    tight: tuple[Floats, ...]
    thesis: Ellipsoid | None


SERIES = (
    "log10_det",
    "thesis_det",
    "thesis_definite",
    "area_m2",
    "tight_m2",
    "spread_m",
    "error_m",
    "gaussian_error_m",
    "angle_deg",
    "distance_m",
    "inside",
    "tight_inside",
    "relaxed_inside",
    "thesis_inside",
    "gaussian_inside",
)
"""What is kept of every step, in this order."""


@dataclass(frozen=True)
class Run:
    """A finished run.

    Attributes:
        target: (2,) float, metres.
        series: (steps, len(SERIES)) float, one row per step; see :data:`SERIES`.
        weights: (steps, robots) float, λ of every range in our filter.
        thesis_weights: (steps, robots) float, the same in the thesis' filter.
        scenes: of every step, where asked for.
    """

    target: Floats
    series: Floats
    weights: Floats
    thesis_weights: Floats
    scenes: tuple[Scene, ...]

    def __getitem__(self, name: str) -> Floats:
        return self.series[:, SERIES.index(name)]

    @property
    def resolved_at(self) -> float:
        """Ranges per robot until the tight set was small and in one place; inf when it never was."""
        found = np.flatnonzero((self["tight_m2"] < RESOLVED_M2) & (self["spread_m"] < RESOLVED_M))
        return float(found[0] + 1) if len(found) else math.inf


def run_experiment(
    experiment: Experiment, law: str, seed: int, *, corrupt: bool = False, steps: int = STEPS, keep_scenes: bool = False
) -> Run:
    """Run one experiment.

    Args:
        experiment: who takes part.
        law: a key of LAWS, STRAIGHT or THROUGH.
        seed: decides starts and noise; the same for every law, so that runs can be compared one by one.
        corrupt: in step CORRUPT_STEP the first robot's position is FLAW_M off, as in fig. 12.
        steps: ranges per robot.
        keep_scenes: keep what snapshots are drawn from.
    """
    rng = np.random.default_rng(seed)
    target = rng.uniform(-1, 1, 2)
    robots = experiment.moving + experiment.standing
    bearings, radii = rng.uniform(0, 2 * np.pi, robots), rng.uniform(5, 8, robots)
    places = target + radii[:, None] * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    passing = np.arcsin(rng.uniform(1, 3, robots) / radii) * rng.choice([-1, 1], robots)
    course = bearings + np.pi + (passing if law != THROUGH else 0.0)
    straight = np.stack([np.cos(course), np.sin(course)], axis=1)
    noise = rng.uniform(-BOUND_M, BOUND_M, (steps, robots))
    guess_at = float(rng.uniform(0, 2 * np.pi))
    belief = Belief()
    rows, scenes = [], []
    weights, thesis_weights = np.empty((steps, robots)), np.empty((steps, robots))
    for step in range(steps):
        claimed = places.copy()
        if corrupt and step == CORRUPT_STEP:
            away = places[0] - target
            claimed[0] += FLAW_M * away / np.hypot(*away)
        ranges = np.hypot(*(places - target).T) + noise[step]
        row, weights[step], thesis_weights[step] = _measure(belief, claimed, ranges, guess_at)
        row.update(_judge(belief, places, target))
        rows.append([row[name] for name in SERIES])
        if keep_scenes:
            feasible, thesis = belief.ellipsoid.feasible_set(), belief.thesis.ellipsoid()
            shadow = thesis.project(2) if thesis is not None and thesis.bounded else None
            scenes.append(Scene(places.copy(), claimed, ranges, feasible, belief.tight.polygons, shadow))
        for robot in range(experiment.moving):
            move = straight[robot] if law in (STRAIGHT, THROUGH) else LAWS[law](belief, places[robot], robot)
            places[robot] = places[robot] + STEP_M * move
    return Run(target, np.array(rows), weights, thesis_weights, tuple(scenes))


def _measure(
    belief: Belief, claimed: Floats, ranges: Floats, guess_at: float
) -> tuple[dict[str, float], list[float], list[float]]:
    """Tell all sets the ranges of one step: what the last one left, and λ of each in our filter and the thesis'."""
    if not belief.gaussian.known:
        # A Gaussian needs a guess. The first range says how far, nothing says where: any bearing is as good.
        guess = claimed[0] + ranges[0] * np.array([np.cos(guess_at), np.sin(guess_at)])
        belief.gaussian = InformationFilter.from_guess(guess, ranges[0] ** 2 * np.eye(2))
    row: dict[str, float] = {}
    weights, thesis_weights = [], []
    for place, measured in zip(claimed, ranges, strict=True):
        z = max(0.0, float(measured))
        weights.append(belief.ellipsoid.measure(place, z, BOUND_M).weight)
        report = belief.thesis.measure(place, z, BOUND_M)
        thesis_weights.append(report.weight)
        row["thesis_det"], row["thesis_definite"] = report.determinant, float(report.definite)
        belief.tight.measure(place, z, BOUND_M)
        belief.relaxed.measure(place, z, BOUND_M)
        belief.gaussian = belief.gaussian.measure([place], [z], BOUND_M / math.sqrt(3))
    return row, weights, thesis_weights


def _judge(belief: Belief, places: Floats, target: Floats) -> dict[str, float]:
    """Sizes, errors, and whether the target is inside."""
    feasible = belief.ellipsoid.feasible_set()
    lines = places - target
    angle = math.nan
    if len(places) > 1:
        cosine = float(lines[0] @ lines[1] / (np.hypot(*lines[0]) * np.hypot(*lines[1])))
        # Ranges from opposite sides say the same: the angle between the lines of sight is at most 90°.
        angle = math.degrees(math.acos(min(1.0, abs(cosine))))
    off = belief.gaussian.mean - target
    return {
        "log10_det": math.log10(feasible.determinant),
        "area_m2": feasible.area_m2,
        "tight_m2": belief.tight.area_m2,
        "spread_m": math.sqrt(float(np.trace(belief.tight.covariance))),
        "error_m": float(np.hypot(*(feasible.centroid - target))),
        "gaussian_error_m": float(np.hypot(*off)),
        "angle_deg": angle,
        "distance_m": float(np.hypot(*lines[0])),
        "inside": float(feasible.contains(target)),
        "tight_inside": float(belief.tight.contains(target)),
        "relaxed_inside": float(not belief.relaxed.started or belief.relaxed.contains(target)),
        "thesis_inside": float(belief.thesis.definite and belief.thesis.contains(target)),
        "gaussian_inside": float(off @ belief.gaussian.matrix @ off <= 9),
    }
