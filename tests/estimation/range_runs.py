"""Seeded runs of robots that range a target with truly bounded noise; shared by the tests and the campaign."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Step:
    moved_m: float
    anchor: Floats
    range_m: float
    target: Floats
    corrupt: bool


@dataclass(frozen=True)
class Run:
    """What a run is like; the seed decides the rest."""

    seed: int
    robots: int = 1
    ranges: int = 40
    noise: str = "uniform"
    epsilon_m: float = 0.5
    target_step_m: float = 0.0
    far_m: float = 0.0
    corrupt: float = 0.0

    def steps(self) -> Iterator[Step]:
        """Robots wander about ±25 m around a target that stays or walks; one range after another."""
        rng = np.random.default_rng(self.seed)
        turn = rng.uniform(0.0, 2.0 * np.pi)
        base = self.far_m * np.array([np.cos(turn), np.sin(turn)])
        target = base + rng.uniform(-15.0, 15.0, 2)
        robots = base + rng.uniform(-25.0, 25.0, (self.robots, 2))
        headings = rng.uniform(0.0, 2.0 * np.pi, self.robots)
        walk = rng.uniform(0.0, 2.0 * np.pi)
        for k in range(self.ranges):
            i = k % self.robots
            headings[i] += rng.normal(0.0, 0.3)
            robots[i] += 0.8 * np.array([np.cos(headings[i]), np.sin(headings[i])])
            away = robots[i] - base
            if np.hypot(*away) > 30.0:
                headings[i] = np.arctan2(-away[1], -away[0])
            moved = self.target_step_m if k else 0.0
            walk += rng.normal(0.0, 0.2)
            target = target + moved * np.array([np.cos(walk), np.sin(walk)])
            error = self.epsilon_m * (rng.choice([-1.0, 1.0]) if self.noise == "bang-bang" else rng.uniform(-1.0, 1.0))
            corrupt = k > 0 and rng.random() < self.corrupt
            if corrupt:
                error = rng.choice([-1.0, 1.0]) * self.epsilon_m * rng.uniform(3.0, 30.0)
            distance = float(np.hypot(*(robots[i] - target)))
            yield Step(moved, robots[i].copy(), max(0.0, distance + error), target, corrupt)


def varied_runs(first_seed: int, number: int, ranges: int = 40) -> list[Run]:
    """1–4 robots, uniform and bang-bang noise, static and moving, here and 500 km away, in turn."""
    return [
        Run(
            seed=first_seed + i,
            robots=1 + i % 4,
            ranges=ranges,
            noise=("uniform", "bang-bang")[i // 4 % 2],
            target_step_m=(0.0, 0.1)[i // 8 % 2],
            far_m=(0.0, 500e3)[i // 16 % 2],
            epsilon_m=(0.5, 0.05)[i // 32 % 2],
        )
        for i in range(number)
    ]
