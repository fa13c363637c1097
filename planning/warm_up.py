"""Every kernel of the package, run once with the argument types of real use, so that all are compiled.

In parts that share few kernels, so that several processes can compile them at the same time.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from planning.environment import Environment

POINTS = np.array([[1.0, 1.0], [17.0, 1.0], [9.0, 4.0], [17.0, 7.0]])
"""In the rooms."""


def exercise() -> None:
    """Run all parts."""
    for part in PARTS:
        part()


def exercise_motion() -> None:
    """Schedule and certify in two rooms with a pillar."""
    from planning.certificate import certify
    from planning.coordination import bound_collisions, collision_boxes
    from planning.foresight import chain_holds
    from planning.grid_schedule import grid_schedule
    from planning.motion import plan_motion
    from planning.motion_plan import Schedule, TimedPath
    from planning.no_schedule import NoSchedule
    from planning.reach_in_sight import time_in_sight
    from planning.schedule import schedule
    from planning.visible_interval import sees_throughout, visible_intervals, visible_times

    rooms, points = _rooms(), POINTS
    chain_holds(rooms, points[None])
    collision_boxes(points[:2], points[2:], 0.4)
    bound_collisions(points[None, :2], points[None, 2:], 0.4)
    visible_intervals(rooms, points[:2], points[2:])
    visible_times(rooms, TimedPath(points[:2], [0.0, 1.0]), TimedPath.standing(points[2]))
    sees_throughout(rooms, points[:2], points[2:])
    two = Schedule(["a", "b"], [TimedPath(points[:2], [0.0, 1.0]), TimedPath.standing(points[2])], 0.2)
    certify(two, rooms)
    schedule([points[2:3], [(8.0, 4.0), (1.0, 4.0)], [(10.0, 4.0), (17.0, 4.0)]], 0.2, rooms)
    # Going on together ends nowhere here: the order has to be searched for. And there it is not possible at all.
    schedule([[(1, 2), (0, 2), (3, 2)], [(2, 3), (1, 2)], [(0, 3), (2, 2), (2, 3)]], 0.3)
    with suppress(NoSchedule):
        schedule([[(2.0, 4.0)], [(9.0, 4.0), (12.0, 4.0), (12.0, 7.0)]], 0.2, rooms)
    crossing = [[(8.0, 4.0), (1.0, 4.5)], [(7.0, 6.0), (7.0, 5.0), (10.0, 4.0)]]
    grid_schedule(crossing, np.full(2, 0.2), rooms, members=["a", "b"], speed_m_s=np.ones(2))
    certify(Schedule(two.members, two.paths, 0.2, stages=[(0, 1), (0, 0)]), rooms, links=[("a", "b")], ends=("a", "b"))
    past_each_other = [(7.0, 4.0), (11.0, 4.0)], [(11.0, 4.0), (7.0, 4.0)]
    plan_motion(rooms, *past_each_other, 0.2, members=["a", "b"], unscheduled={"c": [(9.0, 4.0), (9.0, 4.5)]})
    time_in_sight(rooms, [(1.0, 1.0), (2.0, 1.0)], (6.0, 1.0), 1.0, 0.5)


def exercise_places() -> None:
    """Decompose the rooms, and find trees and redeployments there."""
    from planning.chain import cheapest_chain
    from planning.connectivity import connected
    from planning.decomposition import decompose
    from planning.edge_weights import virtual_weights
    from planning.geodesic import GeodesicMap
    from planning.grid_outline import outline
    from planning.mutual_visibility import mutual_visibility
    from planning.ordered_chain import search_in_order
    from planning.placement import reachable_positions
    from planning.placement_graph import PlacementGraph
    from planning.redeployment import redeploy
    from planning.shortest_paths import all_pairs, from_source
    from planning.steiner import steiner_tree

    outline(np.ones((4, 4), dtype=np.bool_), np.ones((4, 4)), 1.0)
    rooms, points = _rooms(), POINTS
    free = rooms.inflated(0.2)
    connected(rooms.visibility_matrix(points))
    rooms.line_of_sight(points[0], points[1])
    rooms.contains(points)
    geodesics = GeodesicMap(free)
    geodesics.path(points[0], points[1])
    geodesics.lengths(points[0], points[1:])
    geodesics.nearest((-1.0, -1.0))
    graph = PlacementGraph.from_points(rooms, 0.2, 2.0)
    graph.distances_from(points[0])
    _ = graph.distances
    graph.sees(points[0])
    for kind in ("inflection", "aspect"):
        cells = decompose(rooms, kind)
        cells.locate(points)
        weights = virtual_weights(cells, mutual_visibility(cells))
        all_pairs(weights)
        all_pairs(np.triu(weights))
        from_source(weights, 0)
        steiner_tree(weights, [0, 1, 2, 3])
        cheapest_chain(weights, np.ones((2, len(weights))), weights[0], weights[-1], 1.0)
        redeploy(
            np.ones((5, len(weights))) * np.arange(5)[:, None],
            weights,
            search="one-edge",
            tree=[(0, 1), (1, 2), (1, 3), (3, 4)],
        )
        search_in_order(weights, np.ones((2, len(weights))), weights[0], weights[-1])
        reachable_positions(cells, free)


def _rooms() -> Environment:
    from planning.environment import Environment

    return Environment(
        [(0, 0), (8, 0), (8, 3), (10, 3), (10, 0), (18, 0), (18, 8), (10, 8), (10, 5), (8, 5), (8, 8), (0, 8)],
        [[(3, 3), (4, 3), (4, 4), (3, 4)]],
        name="warm-up",
    )


PARTS = (exercise_motion, exercise_places)
