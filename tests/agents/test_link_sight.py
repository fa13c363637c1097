"""From which stage on two members see each other, against places looked at one by one."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from agents.link_sight import Scene, judge_links, places_on, stages_in_sight
from planning.environment import Environment
from protocol.messages import MemberWay, Milestone, Motion, NewLink, Point

PILLARS = Environment(
    [(0, 0), (12, 0), (12, 12), (0, 12)],
    [[(2, 2), (4, 2), (4, 5), (2, 5)], [(6, 7), (9, 7), (9, 9), (6, 9)], [(7, 2), (8, 2), (8, 4), (7, 4)]],
    name="pillars",
)
ROOM, WIDE = PILLARS.inflated(0.2), PILLARS.inflated(0.25)
STAGES = 6
SEEDS = 16


def random_motion(seed: int, first_stage: int = 0) -> Motion:
    """Two robots between the pillars, one straight a stage or a stop, and a base station."""
    rng = np.random.default_rng([seed, 3])

    def free_place() -> Point:
        while True:
            place = rng.uniform(0.5, 11.5, 2)
            if WIDE.contains([place])[0]:
                return float(place[0]), float(place[1])

    ways = [MemberWay(member="base", radius_m=0.0, speed_m_s=0.0, waypoints=((1.0, 1.0),), stages=(0,) * (STAGES + 1))]
    for name in ("robot1", "robot2"):
        waypoints, marks = [free_place()], [0]
        while len(marks) <= STAGES:
            after = free_place()
            near = np.array(waypoints[-1]) + 0.35 * (np.array(after) - np.array(waypoints[-1]))
            after = (float(near[0]), float(near[1]))
            if rng.random() < 0.3:
                marks.append(marks[-1])
            elif ROOM.line_of_sight(waypoints[-1], after):
                waypoints.append(after)
                marks.append(len(waypoints) - 1)
        ways.append(
            MemberWay(member=name, radius_m=0.2, speed_m_s=1.0, waypoints=tuple(waypoints), stages=tuple(marks))
        )
    return Motion(
        plan=1, revision=2, first_stage=first_stage, released=first_stage - 1, ways=tuple(ways), connection="none"
    )


def sampled_places(way: MemberWay, stage: int) -> np.ndarray:
    points = np.array(way.waypoints[way.stages[stage] : way.stages[stage + 1] + 1])
    if len(points) == 1:
        return points
    shares = np.linspace(0.0, 1.0, 41)[:, None]
    return np.concatenate([a + shares * (b - a) for a, b in pairwise(points)])


def sampled_first_stage(motion: Motion, one: str, other: str) -> int | None:
    """By looking at all pairs of places in all stages that can be under way together."""
    ways = {way.member: way for way in motion.ways}

    def see(stage: int, later: int) -> bool:
        for a, b in ((stage, later), (later, stage)):
            for place in sampled_places(ways[one], a):
                if not np.all(PILLARS.line_of_sight(place, sampled_places(ways[other], b))):
                    return False
        return True

    if not PILLARS.line_of_sight(ways[one].waypoints[-1], ways[other].waypoints[-1]):
        return None
    first = STAGES
    while first > 0 and see(first - 1, first - 1) and (first == STAGES or see(first - 1, first)):
        first -= 1
    return motion.first_stage + first


@pytest.mark.parametrize("seed", range(SEEDS))
def test_a_link_holds_from_the_stage_that_is_said_on_and_not_from_an_earlier_one(seed: int) -> None:
    motion = random_motion(seed, first_stage=seed % 3)
    scene = Scene(PILLARS, motion, {}, "agent")
    links = [("robot1", "robot2"), ("base", "robot1"), ("robot2", "base")]
    found = stages_in_sight(scene, links)
    assert found == [sampled_first_stage(motion, *link) for link in links], f"seed {seed}"


def test_all_answers_occur() -> None:
    found = {sampled_first_stage(random_motion(seed), "robot1", "robot2") for seed in range(SEEDS)}
    assert None in found and 0 in found and len(found) > 4


def link(stage: int | None, ends: tuple[str, str] = ("robot1", "robot2")) -> NewLink:
    since = None if stage is None else Milestone(epoch=1, plan=1, revision=2, stage=stage)
    return NewLink(ends=ends, since=since)


@pytest.mark.parametrize("seed", range(6))
def test_an_end_confirms_what_is_so_and_refuses_what_is_not(seed: int) -> None:
    motion = random_motion(seed)
    scene = Scene(PILLARS, motion, {}, "agent")
    (first,) = stages_in_sight(scene, [("robot1", "robot2")])
    for stage in range(STAGES + 1):
        (view,) = judge_links(scene, "robot1", [link(stage)])
        assert view.peer == "robot2"
        holds = first is not None and first <= stage
        assert view.verdict == (("sees" if stage == 0 else "will") if holds else "refuses")
        assert bool(view.reason) is not holds


def test_stages_that_all_have_finished_are_not_held_against_a_link() -> None:
    seed = next(
        seed
        for seed in range(SEEDS)
        if stages_in_sight(Scene(PILLARS, random_motion(seed), {}, "agent"), [("robot1", "robot2")]) == [0]
    )
    later = random_motion(seed, first_stage=4)
    (view,) = judge_links(Scene(PILLARS, later, {}, "agent"), "robot2", [link(2)])
    assert view.verdict == "sees"


def test_who_stands_is_judged_by_where_it_is() -> None:
    places = {"robot1": (1.0, 3.0), "robot2": (5.0, 3.0), "robot3": (1.0, 6.0)}
    scene = Scene(PILLARS, None, places, "agent", ((0.5, 8.0),))
    links = [("robot1", "robot2"), ("robot1", "robot3"), ("robot3", "agent"), ("robot2", "robot9")]
    assert stages_in_sight(scene, links) == [None, 0, 0, None]
    refused, seen = judge_links(scene, "robot1", [link(None), link(None, ("robot3", "robot1"))])
    assert refused.verdict == "refuses" and "robot1 and robot2 do not see each other" in refused.reason
    assert (seen.peer, seen.verdict) == ("robot3", "sees")


def test_a_relay_is_linked_with_the_agent_if_it_sees_some_place_where_that_may_be() -> None:
    way = MemberWay(
        member="robot1", radius_m=0.2, speed_m_s=1.0, waypoints=((1.0, 3.0), (1.0, 6.0), (5.0, 6.0)), stages=(0, 1, 2)
    )
    motion = Motion(plan=1, revision=2, first_stage=3, released=2, ways=(way,), connection="none")
    link_of_agent = ("robot1", "agent")
    hidden, open_, both = ((5.0, 3.0),), ((1.0, 11.0),), ((5.0, 3.0), (1.0, 11.0))
    for may_be, stage in ((hidden, 5), (open_, 3), (both, 3), ((), None), (((7.5, 10.0),), None), (None, 3)):
        assert stages_in_sight(Scene(PILLARS, motion, {}, "agent", may_be), [link_of_agent]) == [stage]


def test_an_agent_that_may_be_anywhere_is_refused_by_nobody_whose_own_place_is_known() -> None:
    scene = Scene(PILLARS, None, {"robot1": (1.0, 3.0)}, "agent", None)
    assert stages_in_sight(scene, [("robot1", "agent"), ("robot2", "agent")]) == [0, None]
    (view,) = judge_links(scene, "robot1", [link(None, ("robot1", "agent"))])
    assert (view.peer, view.verdict) == ("agent", "sees")


def test_an_announced_way_is_looked_at_from_where_the_agent_is_to_some_metres_on() -> None:
    places = places_on([(0.0, 0.0), (100.0, 0.0)])
    assert places[0] == (0.0, 0.0) and places[-1][0] == pytest.approx(16.0, abs=0.6)
    assert set(places_on([(3.0, 4.0)])) == {(3.0, 4.0)}
