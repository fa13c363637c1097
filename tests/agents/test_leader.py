"""The planner's invariants on a floor plan, the fewest relays against networkx, and what it does in motion."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import networkx as nx
import numpy as np
import pytest

import agents.leader
import maps
from agents.leader import DeploymentPlanner, Plan
from agents.roaming import Roaming
from agents.target_set import TargetSet
from agents.whereabouts import Whereabouts, announce
from planning.decomposition import decompose
from planning.deployment import NoChain
from planning.environment import Environment
from planning.foresight import chain_holds, walk
from planning.geodesic import GeodesicMap
from planning.mutual_visibility import TooManyCells, mutual_visibility
from planning.placement import reachable_positions
from protocol.messages import Point

RADIUS_M = 0.2
BASE = (1.5, 11.0)


@pytest.fixture(scope="module")
def office() -> Environment:
    return Environment.load(maps.path("office"))


@pytest.fixture(scope="module")
def planner(office: Environment) -> DeploymentPlanner:
    return DeploymentPlanner(
        office, BASE, RADIUS_M, "inflection", placements="cells", base_name="home", agent_name="visitor"
    )


def _places(environment: Environment, number: int, seed: int) -> list[Point]:
    free = environment.inflated(RADIUS_M, containing=BASE)
    random = np.random.default_rng(seed)
    points = random.uniform(free.bounds[:2], free.bounds[2:], (40 * number + 200, 2))
    return [(float(x), float(y)) for x, y in points[free.contains(points)][:number]]


def _team(places: list[Point]) -> dict[str, Point]:
    return {f"robot{number}": place for number, place in enumerate(places, 1)}


def _check(plan: Plan, environment: Environment, robots: Mapping[str, Point]) -> None:
    """What every plan promises."""
    assert sorted(placement.robot for placement in plan.placements) == sorted(robots)
    free = environment.inflated(RADIUS_M, containing=BASE)
    assert free.contains([placement.position for placement in plan.placements]).all()
    relays = [placement for placement in plan.placements if not placement.spare]
    assert list(plan.placements[: len(relays)]) == relays
    names = ["home", *(relay.robot for relay in relays), *(["visitor"] if plan.serves else [])]
    assert list(plan.edges) == list(pairwise(names))
    stops = [BASE, *(relay.position for relay in relays)]
    assert all(environment.line_of_sight(a, b) for a, b in pairwise(stops))
    assert math.isfinite(plan.cost)


@pytest.mark.parametrize("seed", range(12))
def test_every_plan_is_a_chain_that_robots_can_stand_in(
    planner: DeploymentPlanner, office: Environment, seed: int
) -> None:
    agent, goal, *starts = _places(office, 2 + planner.most_relays_needed() + seed % 3, seed)
    robots = _team(starts)
    way = [(float(x), float(y)) for x, y in GeodesicMap(office.inflated(RADIUS_M)).path(agent, goal)]
    plan = planner.plan(announce([agent, *way]), robots, None)
    _check(plan, office, robots)
    assert plan.serves
    assert plan.relays_needed == planner.relays_needed(agent)
    for _ in range(3):
        robots = {placement.robot: placement.position for placement in plan.placements}
        plan = planner.plan(announce([agent, *way]), robots, plan)
        _check(plan, office, robots)


@pytest.mark.parametrize("seed", range(6))
def test_a_chain_for_an_agent_at_rest_sees_it(planner: DeploymentPlanner, office: Environment, seed: int) -> None:
    agent, *starts = _places(office, 1 + planner.most_relays_needed(), 50 + seed)
    plan = planner.plan(announce([agent]), _team(starts), None)
    last = plan.placements[len(plan.edges) - 2].position if len(plan.edges) > 1 else BASE
    assert office.line_of_sight(last, agent)


def test_fewest_relays_are_those_of_a_breadth_first_search(planner: DeploymentPlanner, office: Environment) -> None:
    cells = decompose(office, "inflection")
    positions = reachable_positions(cells, office.inflated(RADIUS_M, containing=BASE))
    seen = mutual_visibility(cells)
    graph: Any = nx.DiGraph()
    base = int(cells.locate([BASE])[0])
    for u, v in zip(*seen.nonzero(), strict=True):
        if u == base or not np.isnan(positions[u, 0]):
            graph.add_edge(int(u), int(v))
    hops = nx.single_source_shortest_path_length(graph, base)
    for place in _places(office, 60, 3):
        assert planner.relays_needed(place) == max(0, hops[int(cells.locate([place])[0])] - 1)
    assert planner.most_relays_needed() == max(hops.values()) - 1


def test_too_few_robots_man_the_chain_from_the_base_outward(planner: DeploymentPlanner, office: Environment) -> None:
    agent = (31.0, 12.5)
    needed = planner.relays_needed(agent)
    assert needed >= 3
    for number in range(needed):
        robots = _team(_places(office, number, number))
        plan = planner.plan(announce([agent]), robots, None)
        _check(plan, office, robots)
        assert not plan.serves
        assert len(plan.edges) == number
        assert f" needed and {needed - number} missing" in plan.reason


def test_an_agent_in_sight_of_the_base_needs_no_relay(planner: DeploymentPlanner, office: Environment) -> None:
    plan = planner.plan(announce([(4.5, 10.5)]), {}, None)
    assert plan == Plan((), (("home", "visitor"),), 0.0, 0, True, plan.reason, 0.0, 0.0)
    robots = _team(_places(office, 3, 1))
    plan = planner.plan(announce([(4.5, 10.5)]), robots, None)
    assert all(placement.spare for placement in plan.placements)


def test_a_chain_that_serves_is_kept(planner: DeploymentPlanner, office: Environment) -> None:
    """While the agent stands and everybody has arrived, every plan repeats the relays of the one before."""
    agent = (31.0, 12.5)
    robots = _team([BASE] * planner.most_relays_needed())
    plan = planner.plan(announce([agent]), robots, None)
    robots = {placement.robot: placement.position for placement in plan.placements}
    again = planner.plan(announce([agent]), robots, plan)
    assert again.edges == plan.edges
    assert [p for p in again.placements if not p.spare] == [p for p in plan.placements if not p.spare]
    assert again.reason == plan.reason


def test_a_lost_relay_is_replaced(planner: DeploymentPlanner, office: Environment) -> None:
    agent = (31.0, 12.5)
    robots = _team([BASE] * (planner.most_relays_needed() + 1))
    plan = planner.plan(announce([agent]), robots, None)
    robots = {placement.robot: placement.position for placement in plan.placements}
    del robots[plan.placements[1].robot]
    after = planner.plan(announce([agent]), robots, plan)
    _check(after, office, robots)
    assert after.serves


def test_an_agent_outside_the_map_makes_everybody_wait(planner: DeploymentPlanner, office: Environment) -> None:
    robots = _team(_places(office, 2, 5))
    plan = planner.plan(announce([(-50.0, 0.0)]), robots, None)
    assert not plan.serves
    assert "(-50, 0) m is outside the map" in plan.reason
    assert {placement.robot: placement.position for placement in plan.placements} == robots
    with pytest.raises(NoChain, match="outside the map"):
        planner.relays_needed((-50.0, 0.0))


def test_equal_questions_have_equal_answers(office: Environment) -> None:
    agent, goal, *starts = _places(office, 8, 11)
    answers = []
    for _ in range(2):
        planner = DeploymentPlanner(office, BASE, RADIUS_M, "inflection")
        plan = planner.plan(announce([agent, goal]), _team(starts), None)
        answers.append((plan, planner.plan(announce([goal]), _team(starts), plan)))
    assert answers[0] == answers[1]


def test_a_decomposition_too_fine_to_plan_on_is_refused(office: Environment, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(agents.leader, "MOST_TO_PLAN_ON", 10)
    with pytest.raises(TooManyCells, match="146 inflection cells, and at most 10"):
        DeploymentPlanner(office, BASE, RADIUS_M, "inflection", placements="cells")


@pytest.fixture(scope="module")
def roaming(office: Environment) -> Roaming:
    return Roaming(GeodesicMap(office.inflated(RADIUS_M, containing=BASE)), 0.9, BASE)


@pytest.fixture(scope="module")
def points(office: Environment) -> DeploymentPlanner:
    return DeploymentPlanner(office, BASE, RADIUS_M, "inflection", base_name="home", agent_name="visitor")


def _surmise(office: Environment, roaming: Roaming, center: Point, radius_m: float) -> tuple[TargetSet, Whereabouts]:
    """A disc, as far as it is free, of an agent that announces nothing."""
    random = np.random.default_rng(0)
    drawn = np.array([center, *(center + random.uniform(-radius_m, radius_m, (80, 2)))])
    near = drawn[office.contains(drawn) & (np.hypot(*(drawn - center).T) <= radius_m)]
    samples = tuple((float(x), float(y)) for x, y in near)
    target = TargetSet(0.0, center, samples, (), math.pi * radius_m**2, 0.0)
    return target, roaming.whereabouts(target, (0.0, 0.0), 0.0)


def _sight_of_last(plan: Plan, office: Environment, places: Any) -> Any:
    relays = [placement.position for placement in plan.placements if not placement.spare]
    return office.line_of_sight(np.array([*[BASE], *relays][-1]), np.array(places))


@pytest.mark.parametrize("seed", range(4))
def test_the_last_relay_sees_all_places_of_a_small_set(
    points: DeploymentPlanner, office: Environment, roaming: Roaming, seed: int
) -> None:
    center, *starts = _places(office, 1 + points.most_relays_needed() + 2, 30 + seed)
    target, agent = _surmise(office, roaming, center, 0.4)
    robots = _team(starts)
    plan = points.plan(agent, robots, None)
    _check(plan, office, robots)
    assert plan.serves
    assert f"for the estimate of 0.50 m² around ({round(center[0], 2):.12g}, " in plan.reason
    assert _sight_of_last(plan, office, agent.aims[0].places).all()
    again = points.plan(agent, {place.robot: place.position for place in plan.placements}, plan)
    assert again.edges == plan.edges
    # No more relays than for any one place of the set are too few.
    assert plan.relays_needed >= max(points.relays_needed(sample) for sample in target.samples[:10])


def test_of_a_set_that_is_too_large_the_last_relay_sees_much(
    points: DeploymentPlanner, office: Environment, roaming: Roaming
) -> None:
    _, agent = _surmise(office, roaming, (15.5, 18.5), 9.0)
    robots = _team([BASE] * (points.most_relays_needed() + 1))
    plan = points.plan(agent, robots, None)
    _check(plan, office, robots)
    assert plan.serves
    assert "for the most of the estimate" in plan.reason
    assert not any(points.graph.sees_all(agent.aims[0].places))
    # What it says of it is true of one of the aims.
    said = float(plan.reason.split(", ")[-1].partition("%")[0]) / 100.0
    seen = [float(aim.shares @ _sight_of_last(plan, office, aim.places)) for aim in agent.aims]
    assert min(abs(share - said) for share in seen) < 0.006
    assert said > 0.25


def test_an_agent_never_measured_is_looked_for(
    points: DeploymentPlanner, office: Environment, roaming: Roaming
) -> None:
    robots = _team([BASE] * 4)
    agent = roaming.whereabouts(None, (0.0, 0.0), 0.0)
    plan = points.plan(agent, robots, None)
    _check(plan, office, robots)
    assert "an agent of which nothing is known yet" in plan.reason
    assert np.sum(_sight_of_last(plan, office, agent.aims[0].places)) > 10


@pytest.mark.parametrize("spares", [0, 2])
def test_the_chain_mostly_holds_while_the_agent_walks(
    planner: DeploymentPlanner, office: Environment, spares: int
) -> None:
    """Point robots as quick as the agent, which walks through the floor; plans every 0.4 s."""
    step_s, period = 0.1, 4
    geodesics = GeodesicMap(office.inflated(RADIUS_M, containing=BASE))
    agent: Point = (4.5, 10.5)
    robots = _team([BASE] * (planner.most_relays_needed() + spares))
    held = []
    plan: Plan | None = None
    for goal in [(15.5, 18.5), (31.0, 12.5), (32.5, 19.0)]:
        way = geodesics.path(agent, goal)
        steps = math.ceil(float(np.hypot(*np.diff(way, axis=0).T).sum()) / step_s)
        for step in range(steps):
            if step % period == 0:
                plan = planner.plan(announce([agent, *_rest(way, step * step_s)]), robots, plan)
            assert plan is not None
            for placement in plan.placements:
                way_there = geodesics.path(robots[placement.robot], placement.position)
                robots[placement.robot] = _point(walk(way_there, np.array([step_s]))[0])
            agent = _point(walk(way, np.array([(step + 1) * step_s]))[0])
            held.append(chain_holds(office, np.array([[BASE, *robots.values(), agent]]))[0])
    assert np.mean(held) > 0.95


def _point(place: Any) -> Point:
    return float(place[0]), float(place[1])


def _rest(way: Any, walked_m: float) -> list[Point]:
    """Corners of a way that are still ahead."""
    passed = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))))
    return [_point(corner) for corner in way[passed > walked_m + 1e-9]]
