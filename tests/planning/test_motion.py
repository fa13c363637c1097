"""Motions on small maps whose answer is known by hand or by trying everything, and judged by the certificate."""

from __future__ import annotations

from collections import deque

import networkx as nx
import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from planning.certificate import certify
from planning.environment import Environment
from planning.geodesic import GeodesicMap, NotInFreeSpace
from planning.motion import Motion, plan_motion
from planning.motion_plan import InvalidSchedule
from tests.planning.polygons import environment_of, free_points

Floats = NDArray[np.float64]
Deployment = tuple[tuple[int, int], ...]

RADIUS = 0.3
CORRIDOR = Environment([(0, 0), (12, 0), (12, 1), (0, 1)])
NICHE = Environment([(0, 0), (12, 0), (12, 1), (7, 1), (7, 2.5), (5, 2.5), (5, 1), (0, 1)])
PILLAR = Environment([(0, 0), (12, 0), (12, 12), (0, 12)], [[(4, 4), (8, 4), (8, 8), (4, 8)]])
CORNER = Environment([(0, 0), (10, 0), (10, 2), (2, 2), (2, 10), (0, 10)])
CROSSING = Environment([(0, 0), (12, 0), (12, 1), (6.5, 1), (6.5, 6), (5.5, 6), (5.5, 1), (0, 1)])


def check(motion: Motion, room: Environment, goals: object = None) -> None:
    """What has to be true of every motion."""
    asked = {"ends": motion.connection} if len(motion.connection) > 1 else {"links": ()}
    assert certify(motion.schedule, room, **asked).valid
    ends = np.array([path.waypoints[-1] for path in motion.schedule.paths])
    if goals is not None:
        assert motion.arrives == np.array_equal(ends[: len(np.array(goals))], np.array(goals, dtype=np.float64))
    assert motion.break_s == 0.0 or motion.way == "parted"
    assert motion.way != "parted" or motion.proven or not certify(motion.schedule, room).valid
    assert motion.length_m >= motion.geodesic_m - 1e-6 or not motion.arrives
    assert bool(motion.reason) == (motion.way != "direct" or not motion.arrives)


def test_everybody_goes_straight_where_that_is_possible() -> None:
    motion = plan_motion(CORRIDOR, [(1, 0.5), (3, 0.5)], [(8, 0.5), (10, 0.5)], RADIUS, members=["a", "b"])
    check(motion, CORRIDOR, [(8, 0.5), (10, 0.5)])
    assert motion.way == "direct" and motion.arrives and motion.connection == ("a", "b")
    assert motion.length_m == pytest.approx(14.0) == pytest.approx(motion.geodesic_m)
    assert motion.schedule.end_s == pytest.approx(7.0, abs=0.2)


def test_two_cannot_pass_in_a_corridor() -> None:
    starts, goals = [(2, 0.5), (10, 0.5)], [(10, 0.5), (2, 0.5)]
    motion = plan_motion(CORRIDOR, starts, goals, RADIUS, members=["a", "b"])
    check(motion, CORRIDOR, goals)
    assert not motion.arrives and motion.between == ("a", "b") and motion.break_s == 0.0


def test_two_pass_where_one_can_step_aside() -> None:
    starts, goals = [(2, 0.5), (10, 0.5)], [(10, 0.5), (2, 0.5)]
    motion = plan_motion(NICHE, starts, goals, RADIUS, members=["a", "b"], joined=())
    check(motion, NICHE, goals)
    assert motion.arrives and motion.connection == ()
    assert 16.0 < motion.length_m < 19.0


def test_the_order_changes_at_a_junction() -> None:
    """One has to wait in the stem: both see each other all the time only if they stay near the junction."""
    starts, goals = [(1, 0.5), (11, 0.5), (2, 0.5)], [(11, 0.5), (1, 0.5), (10, 0.5)]
    motion = plan_motion(CROSSING, starts, goals, RADIUS, members=["a", "b", "c"], joined=())
    check(motion, CROSSING, goals)
    assert motion.arrives
    with_base = plan_motion(
        CROSSING, [(6, 0.5), *starts[:2]], [(6, 0.5), *goals[:2]], [0.0, RADIUS, RADIUS], members=["base", "a", "b"]
    )
    check(with_base, CROSSING, [(6, 0.5), *goals[:2]])
    assert with_base.arrives and with_base.connection == ("base", "a", "b")


def test_one_who_stays_steps_aside_and_comes_back() -> None:
    """c starts at its goal, in the middle of a corridor with a niche in it."""
    starts, goals = [(2, 0.5), (4.4, 0.5)], [(10, 0.5), (4.4, 0.5)]
    stays = plan_motion(NICHE, starts, goals, RADIUS, members=["a", "c"])
    check(stays, NICHE, goals)
    assert not stays.arrives and stays.between == ("a", "c")
    yields = plan_motion(NICHE, starts, goals, RADIUS, members=["a", "c"], yielding=["c"])
    check(yields, NICHE, goals)
    assert yields.arrives and yields.way in ("stepwise", "bridge")


def test_around_one_who_stands_in_the_way() -> None:
    room = Environment([(0, 0), (12, 0), (12, 6), (0, 6)])
    starts, goals = [(2, 3), (6, 3.1)], [(10, 3), (6, 3.1)]
    motion = plan_motion(room, starts, goals, RADIUS, members=["a", "b"])
    check(motion, room, goals)
    assert motion.way == "detour" and motion.arrives and motion.between == ("a", "b")
    # Below b: two tangents and an arc of radius 0.6, made of straight pieces around it.
    assert motion.length_m == pytest.approx(8.0 + 2.0 * (np.hypot(4.0, 0.5) - 4.0), abs=0.02)
    # Nobody bumps into what has no body.
    bodiless = plan_motion(room, starts, goals, [RADIUS, 0.0], members=["a", "b"])
    assert bodiless.way == "direct"


def test_lost_robots_are_obstacles_and_no_relays() -> None:
    room = Environment([(0, 0), (12, 0), (12, 6), (0, 6)])
    where = np.array([[6.0, 2.0], [6.0, 3.5]])
    motion = plan_motion(
        room, [(2, 3), (2, 1)], [(10, 3), (10, 1)], RADIUS, members=["a", "b"], obstacles=[(where, RADIUS)]
    )
    check(motion, room, [(10, 3), (10, 1)])
    assert motion.arrives and motion.schedule.members == ("a", "b")
    shape = shapely.LineString(where)
    for path in motion.schedule.paths:
        assert shapely.LineString(path.waypoints).distance(shape) >= 2 * RADIUS - 1e-6
    # Around a corner a chain is needed; the lost robot at the corner is none of it.
    lost = plan_motion(CORNER, [(9, 1)], [(8, 1)], RADIUS, members=["a"], unscheduled={"agent": [(1, 9)]},
                       obstacles=[((1, 1), RADIUS)])  # fmt: skip
    assert lost.way == "parted" and lost.proven and lost.break_s == np.inf


def test_relays_hand_over_around_a_corner() -> None:
    """Base and a member stand in the two arms; one relay leaves the corner when the other is there."""
    starts = [(9, 1), (1, 9), (1, 1), (5, 1)]
    goals = [(9, 1), (1, 9), (1, 5), (1, 1)]
    names = ["base", "end", "one", "two"]
    motion = plan_motion(CORNER, starts, goals, [0.0, 0.0, RADIUS, RADIUS], members=names)
    check(motion, CORNER, goals)
    assert motion.arrives and motion.connection == tuple(names)


def test_one_relay_cannot_change_sides_of_a_pillar() -> None:
    """It has to see two who stand on either side of the pillar: below it, or above it, and nowhere in between."""
    names = ["left", "right", "relay"]
    starts, goals = [(1, 6), (11, 6), (6, 1)], [(1, 6), (11, 6), (6, 11)]
    radii = [0.0, 0.0, RADIUS]
    motion = plan_motion(PILLAR, starts, goals, radii, members=names)
    check(motion, PILLAR, goals)
    assert motion.way == "parted" and motion.arrives and not motion.proven and motion.connection == ()
    assert motion.between == ("left", "right") and "left and right" in motion.reason
    # As long as the clock says: the relay sees both while it is far enough below the pillar or above it.
    times = np.linspace(0.0, motion.schedule.end_s, 4001)
    solid = shapely.Polygon(PILLAR.holes[0]).buffer(-1e-9)
    places = motion.schedule.positions(times)
    both = [not any(shapely.LineString([at[2], at[i]]).intersects(solid) for i in (0, 1)) for at in places]
    assert motion.break_s == pytest.approx(times[-1] * (1.0 - np.mean(both)), abs=0.01)
    # Two relays can: one goes first, the other stays until it is there.
    starts, goals = [*starts, (5, 1)], [*goals, (5, 11)]
    two = plan_motion(PILLAR, starts, goals, [*radii, RADIUS], members=[*names, "other"])
    check(two, PILLAR, goals)
    assert two.arrives and two.break_s == 0.0 and two.way != "parted"


def test_only_those_who_should_be_are_kept_joined() -> None:
    starts, goals = [(1, 6), (6, 1), (2, 1)], [(1, 6), (11, 6), (2, 2)]
    names, radii = ["base", "far", "near"], [0.0, RADIUS, RADIUS]
    whole = plan_motion(PILLAR, starts, goals, radii, members=names)
    assert whole.way == "parted" and whole.proven and whole.break_s == np.inf
    assert whole.between in (("base", "far"), ("far", "near")) and whole.reason.startswith("not possible: ")
    motion = plan_motion(PILLAR, starts, goals, radii, members=names, joined=["base", "near"])
    check(motion, PILLAR, goals)
    assert motion.way == "direct" and motion.connection == ("base", "near")


def test_a_team_that_is_apart_at_the_start_comes_together() -> None:
    starts, goals = [(1, 6), (11, 6)], [(1, 6), (6, 1)]
    motion = plan_motion(PILLAR, starts, goals, [0.0, RADIUS], members=["base", "a"])
    check(motion, PILLAR, goals)
    assert motion.way == "parted" and motion.proven and motion.arrives and 0.0 < motion.break_s < np.inf
    assert motion.reason.startswith("not possible: ") and "not connected at the start" in motion.reason


def test_a_goal_that_cannot_be_reached_is_named() -> None:
    room = Environment(
        [(0, 0), (4, 0), (4, 1.9), (6, 1.9), (6, 0), (10, 0), (10, 4), (6, 4), (6, 2.1), (4, 2.1), (4, 4), (0, 4)]
    )
    starts, goals = [(1, 1), (2, 3)], [(9, 1), (3, 3)]
    motion = plan_motion(room, starts, goals, RADIUS, members=["a", "b"])
    assert not motion.arrives and motion.proven and "no way for a to its goal" in motion.reason
    assert motion.schedule.paths[1].waypoints[-1].tolist() == [3.0, 3.0]
    with pytest.raises(NotInFreeSpace, match="a cannot set out"):
        plan_motion(room, [(0.1, 1), (2, 3)], goals, RADIUS, members=["a", "b"])


def test_an_agent_that_goes_as_it_pleases_is_seen_all_along() -> None:
    way = [(4, 1), (8, 1)]
    starts, goals = [(1, 1), (6, 2)], [(1, 1), (2, 2)]
    radii = [0.0, RADIUS]
    motion = plan_motion(PILLAR, starts, goals, radii, members=["base", "a"], unscheduled={"agent": way})
    check(motion, PILLAR, goals)
    assert motion.arrives and motion.connection == ("base", "a", "agent")
    assert motion.schedule.unscheduled == {"agent"} and motion.length_m == pytest.approx(4.0)
    away = plan_motion(PILLAR, starts, goals, radii, members=["base", "a"], unscheduled={"agent": [(8, 1), (11, 6)]})
    assert away.way == "parted" and away.proven


def test_where_two_take_turns_to_see_an_agent_nothing_is_proven() -> None:
    """Nobody sees all of its way, and yet it is always seen: only no motion can be planned by that."""
    starts, goals, way = [(6, 1), (11, 6)], [(5.5, 1), (11, 6)], [(2, 2), (10, 2), (10, 10)]
    motion = plan_motion(PILLAR, starts, goals, RADIUS, members=["a", "b"], unscheduled={"agent": way})
    check(motion, PILLAR, goals)
    assert motion.way == "parted" and motion.arrives and not motion.proven
    farther = plan_motion(PILLAR, starts, goals, RADIUS, members=["a", "b"], unscheduled={"agent": [*way, (2, 10)]})
    check(farther, PILLAR, goals)
    assert farther.way == "parted" and farther.arrives and farther.proven and "agent at (2, 10)" in farther.reason


def test_who_must_not_part_stays_connected_and_comes_near() -> None:
    names, radii = ["left", "right", "relay"], [0.0, 0.0, RADIUS]
    starts, goals = [(1, 6), (11, 6), (6, 1)], [(1, 6), (11, 6), (6, 11)]
    motion = plan_motion(PILLAR, starts, goals, radii, members=names, may_part=False)
    check(motion, PILLAR, goals)
    assert not motion.arrives and motion.way == "stepwise" and motion.connection == tuple(names)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(InvalidSchedule, match="2 members have 1 starts"):
        plan_motion(CORRIDOR, [(1, 0.5)], [(1, 0.5), (2, 0.5)], RADIUS, members=["a", "b"])
    with pytest.raises(InvalidSchedule, match="'c' is to be joined, but no member"):
        plan_motion(CORRIDOR, [(1, 0.5)], [(2, 0.5)], RADIUS, members=["a"], joined=["c"])
    with pytest.raises(InvalidSchedule, match="'c' may step aside, but is no member"):
        plan_motion(CORRIDOR, [(1, 0.5)], [(2, 0.5)], RADIUS, members=["a"], yielding=["c"])
    with pytest.raises(InvalidSchedule, match="the radius of 1 members is given as nan"):
        plan_motion(CORRIDOR, [(1, 0.5)], [(2, 0.5)], np.nan, members=["a"])
    with pytest.raises(InvalidSchedule, match="the way of agent has no points"):
        plan_motion(CORRIDOR, [(1, 0.5)], [(2, 0.5)], RADIUS, members=["a"], unscheduled={"agent": []})
    with pytest.raises(InvalidSchedule, match="one name"):
        plan_motion(CORRIDOR, [(1, 0.5), (3, 0.5)], [(2, 0.5), (4, 0.5)], RADIUS, members=["a", "a"])


def block_map(seed: int, size: int = 5) -> tuple[Environment, list[tuple[int, int]]]:
    """Unit blocks on a grid, some of them solid, so that what is free is one piece; and the free blocks."""
    rng = np.random.default_rng(seed)
    while True:
        solid = rng.random((size, size)) < 0.3
        free = [(int(x), int(y)) for x, y in np.argwhere(~solid)]
        graph = nx.grid_2d_graph(size, size).subgraph(free)
        if len(free) > 8 and nx.is_connected(graph):
            space = shapely.union_all([shapely.box(x, y, x + 1, y + 1) for x, y in free])
            # Blocks that touch at a corner only leave no room to see or go through there.
            space = space.buffer(-1e-3, join_style="mitre")
            if isinstance(space, shapely.Polygon):
                return Environment(space.exterior.coords, [hole.coords for hole in space.interiors]), free


class BlockWorld:
    """All deployments of robots in the middles of blocks, one of which goes to the next block at a time."""

    def __init__(self, room: Environment, free: list[tuple[int, int]]) -> None:
        self.free = set(free)
        self._space = shapely.Polygon(room.outer, room.holes).buffer(1e-9)
        self._seen: dict[tuple[tuple[int, int], ...], bool] = {}

    def sees(self, place: tuple[int, int], *blocks: tuple[int, int]) -> bool:
        """Whether a block's middle sees the way between the middles of two others throughout."""
        key = place, *sorted(blocks)
        if key not in self._seen:
            points = [(x + 0.5, y + 0.5) for x, y in (place, *blocks)]
            self._seen[key] = self._space.covers(shapely.MultiPoint(points).convex_hull)
        return self._seen[key]

    def is_joined(self, standing: Deployment, *mover: tuple[int, int]) -> bool:
        """Whether those who stand, and one on the way between two blocks, are one network."""
        bodies = [(place,) for place in standing] + ([mover] if mover else [])
        joined, fresh = {0}, [0]
        while fresh:
            i = fresh.pop()
            for j in range(len(bodies)):
                one, other = sorted((bodies[i], bodies[j]), key=len)
                if j not in joined and self.sees(one[0], *other):
                    joined.add(j)
                    fresh.append(j)
        return len(joined) == len(bodies)

    def reach(self, start: Deployment) -> set[Deployment]:
        """Every deployment that the team can get to, connected all the way."""
        reached, waiting = {start}, deque([start])
        while waiting:
            here = waiting.popleft()
            for i, (x, y) in enumerate(here):
                others = here[:i] + here[i + 1 :]
                for block in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
                    after = (*here[:i], block, *here[i + 1 :])
                    if block not in self.free or block in others or after in reached:
                        continue
                    if self.is_joined(others, (x, y), block):
                        reached.add(after)
                        waiting.append(after)
        return reached


@pytest.mark.parametrize("seed", range(6))
def test_where_trying_everything_finds_a_connected_motion_so_do_we(seed: int) -> None:
    room, free = block_map(seed)
    world = BlockWorld(room, free)
    rng = np.random.default_rng(seed)
    robots = 2 + seed % 2
    reached: list[Deployment] = []
    while len(reached) < 5:
        start: Deployment = tuple(free[i] for i in rng.choice(len(free), robots, replace=False))
        reached = sorted(world.reach(start)) if world.is_joined(start) else []
    names = [f"robot_{i}" for i in range(robots)]
    for goal in (reached[i] for i in rng.choice(len(reached), 3, replace=False)):
        starts, goals = (np.array(blocks) + 0.5 for blocks in (start, goal))
        motion = plan_motion(room, starts, goals, 0.25, members=names, yielding=names)
        check(motion, room, goals)
        assert motion.arrives and motion.way != "parted", (start, goal, motion.reason)


@pytest.mark.parametrize("seed", range(6))
def test_whatever_is_asked_the_certificate_agrees(seed: int) -> None:
    """Random deployments on random maps, of whom some step aside, some stand, and one goes as it pleases."""
    room = environment_of(seed)
    rng = np.random.default_rng(seed)
    free = room.inflated(0.15)
    geodesics = GeodesicMap(free)
    names = ["base", "a", "b", "c"]
    for joined in (None, ["base", "a"], []):
        starts, goals = free_points(free, 4, rng), free_points(free, 4, rng)
        goals[[0, 3]] = starts[[0, 3]]
        apart = [
            np.hypot(*(places[:, None] - places).transpose(2, 0, 1))[np.triu_indices(4, 1)].min()
            for places in (starts, goals)
        ]
        if min(apart) < 0.3:
            continue
        way = free_points(free, 1, rng)
        motion = plan_motion(
            room, starts, goals, [0.0, 0.15, 0.15, 0.15], members=names, joined=joined, yielding=["c"],
            unscheduled={"agent": way} if seed % 2 else None, geodesics=geodesics, speed_m_s=[0.5, 1.0, 1.5, 2.0],
        )  # fmt: skip
        check(motion, room, goals)
        assert motion.proven == motion.reason.startswith("not possible: ")


def two_rooms() -> Environment:
    return Environment([(0, 0), (20, 0), (20, 10), (0, 10)], [[(9, 2), (11, 2), (11, 8), (9, 8)]])


@pytest.mark.parametrize(
    ("starts", "goals", "claimed"),
    [([(8, 5), (12, 5)], [(8, 9), (12, 9)], ()), ([(8, 9), (12, 9)], [(8, 5), (12, 5)], ("a", "b"))],
)
def test_who_may_not_part_and_cannot_but_part_is_told_so(
    starts: list[tuple[float, float]], goals: list[tuple[float, float]], claimed: tuple[str, ...]
) -> None:
    motion = plan_motion(two_rooms(), starts, goals, 0.3, members=["a", "b"], may_part=False)
    assert not motion.arrives
    assert motion.proven
    assert motion.between == ("a", "b")
    assert "not connected at the start" in motion.reason or "will not be at the goals" in motion.reason
    assert motion.connection == claimed
    assert certify(motion.schedule, two_rooms(), links=[], ends=motion.connection or None).valid


def test_what_the_widest_cannot_reach_is_not_proven_for_the_others() -> None:
    square = Environment([(0, 0), (10, 0), (10, 10), (0, 10)])
    starts, goals = [(1, 1), (3, 1)], [(0.2, 5), (7, 5)]
    assert not plan_motion(square, starts, goals, [0.1, 0.5], members=["a", "b"]).proven
    assert plan_motion(square, starts, goals, 0.5, members=["a", "b"]).proven


def test_points_of_three_numbers_are_refused() -> None:
    with pytest.raises(InvalidSchedule, match="give pairs"):
        plan_motion(two_rooms(), [(1, 1, 2), (2, 3, 4)], [(1, 1, 2), (2, 3, 4)], 0.3, members=["a", "b", "c"])
