from __future__ import annotations

import math

import numpy as np
import shapely

from agents.wander import AROUND_CORNER_M, NEAREST_GOAL_M, Wanderer
from planning.environment import Environment


def in_sight(environment: Environment, a: tuple[float, float], b: tuple[float, float]) -> bool:
    return bool(shapely.covers(environment.polygon.buffer(1e-9), shapely.LineString([a, b])))


def test_goals_in_sight_are_in_sight(corner: Environment) -> None:
    wanderer = Wanderer(corner, seed=3, around_corner_share=0.0)
    goals = [wanderer.choose((9.0, 1.0)) for _ in range(100)]
    for goal in goals:
        assert goal is not None
        assert in_sight(corner, (9.0, 1.0), goal)
        assert math.dist(goal, (9.0, 1.0)) >= NEAREST_GOAL_M
    assert len(set(goals)) == 100


def test_goals_around_a_corner_are_hidden_and_near_a_corner_in_sight(corner: Environment) -> None:
    wanderer = Wanderer(corner, seed=3, around_corner_share=1.0)
    for _ in range(100):
        goal = wanderer.choose((9.0, 1.0))
        assert goal is not None
        assert not in_sight(corner, (9.0, 1.0), goal)
        assert AROUND_CORNER_M[0] <= math.dist(goal, (5.0, 5.0)) <= AROUND_CORNER_M[1]
        assert in_sight(corner, (5.0, 5.0), goal)


def test_share_of_goals_around_corners_is_as_asked(corner: Environment) -> None:
    wanderer = Wanderer(corner, seed=5, around_corner_share=0.3)
    goals = [wanderer.choose((9.0, 1.0)) for _ in range(600)]
    hidden = np.mean([goal is not None and not in_sight(corner, (9.0, 1.0), goal) for goal in goals])
    assert abs(hidden - 0.3) < 4 * math.sqrt(0.3 * 0.7 / 600)


def test_without_a_corner_all_goals_are_in_sight() -> None:
    room = Environment([(0, 0), (4, 0), (4, 4), (0, 4)])
    assert Wanderer(room, seed=1, around_corner_share=1.0).choose((2.0, 2.0)) is not None


def test_equal_seeds_give_equal_goals(corner: Environment) -> None:
    walks = []
    for seed in (7, 7, 8):
        wanderer, place = Wanderer(corner, seed, 0.5), (1.0, 1.0)
        walk = []
        for _ in range(20):
            place = wanderer.choose(place) or place
            walk.append(place)
        walks.append(walk)
    assert walks[0] == walks[1] != walks[2]


def test_has_no_goal_where_there_is_no_room_to_walk() -> None:
    closet = Environment([(0, 0), (0.3, 0), (0.3, 0.3), (0, 0.3)])
    assert Wanderer(closet, seed=1, around_corner_share=0.5).choose((0.1, 0.1)) is None
