"""Proposals of every search on both kinds of placements, their costs added up anew and against the engine's own."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import cache
from itertools import pairwise, permutations
from typing import get_args

import networkx as nx
import numpy as np
import pytest

import maps
from agents.leader import DeploymentPlanner, PlacementKind, Plan
from agents.proposals import LATENESS, METRES_PER_WEIGHT, RELAY_M, Proposer, path_between
from agents.whereabouts import PIECE_M, PREVIEWS_M, announce
from planning.chain import cheapest_chain
from planning.environment import Environment
from planning.foresight import chain_holds, length, walk
from planning.redeployment import Search, redeploy
from protocol.messages import Point

BASE = (1.5, 11.0)
RADIUS_M = 0.2
KINDS = get_args(PlacementKind)
SEARCHES = get_args(Search)


@cache
def _office() -> Environment:
    return Environment.load(maps.path("office"))


@cache
def _planner(kind: PlacementKind, search: Search) -> DeploymentPlanner:
    return DeploymentPlanner(_office(), BASE, RADIUS_M, "inflection", placements=kind, search=search)


def _places(number: int, seed: int) -> list[Point]:
    free = _office().inflated(RADIUS_M, containing=BASE)
    points = np.random.default_rng(seed).uniform(free.bounds[:2], free.bounds[2:], (40 * number + 200, 2))
    return [(float(x), float(y)) for x, y in points[free.contains(points)][:number]]


def _team(places: list[Point]) -> dict[str, Point]:
    return {f"robot{number}": place for number, place in enumerate(places, 1)}


def _relays(plan: Plan) -> list[tuple[str, Point]]:
    return [(place.robot, place.position) for place in plan.placements if not place.spare]


def _links(kind: PlacementKind, stops: list[Point]) -> list[float]:
    """Virtual weights of a chain's links, by the graph alone."""
    graph = _planner(kind, "chain").graph
    return [float(graph.direct_weights(p, [q])[0]) for p, q in pairwise(stops)]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize("seed", range(4))
def test_a_plan_costs_what_its_robots_drive_and_its_links_weigh(kind: PlacementKind, search: Search, seed: int) -> None:
    """Agents at rest are already where they are, so every metre counts as late."""
    *agents, home = _places(5, seed)
    robots = _team([home] * 6)
    planner = _planner(kind, search)
    plan: Plan | None = None
    for agent in agents:
        plan = planner.plan(announce([agent]), robots, None if plan is None else replace(plan, serves=False))
        relays = _relays(plan)
        links = _links(kind, [BASE, *(place for _, place in relays), agent])
        driven = [planner.graph.geodesics.length(robots[name], place) for name, place in relays]
        assert plan.cost == pytest.approx(sum(links))
        assert plan.total_cost_m == pytest.approx(
            (1.0 + LATENESS) * sum(driven) + RELAY_M * len(relays) + METRES_PER_WEIGHT * sum(links)
        )
        assert plan.lower_bound_m is not None and plan.total_cost_m is not None
        assert plan.lower_bound_m <= plan.total_cost_m
        if search == "chain":
            assert plan.lower_bound_m == plan.total_cost_m
        robots = {place.robot: place.position for place in plan.placements}


HOOK = Environment([(0, 0), (20, 0), (20, 6), (18, 6), (18, 2), (2, 2), (2, 6), (0, 6)], name="hook")
"""A corridor of 20 m with a stub up at each end."""


def test_the_fixed_search_pays_for_the_relays_that_it_keeps_alone() -> None:
    """Two relays where one does: both may be put in one place, and then only one of them is sent, and paid for."""
    planner = DeploymentPlanner(HOOK, (1.0, 1.0), RADIUS_M, "inflection", placements="points", search="fixed")
    graph = planner.graph
    proposer = Proposer(graph, (1.0, 1.0), "fixed", robot_speed_m_s=1.0, agent_speed_m_s=1.0, apart_m=0.1)
    robots = {"robot1": (10.0, 1.0), "robot2": (18.5, 1.0), "robot3": (1.0, 5.0)}
    found = 0
    for standing in permutations(robots):
        way = np.array([(19.0, 5.5)])
        for proposal in proposer.chains(announce(way), robots, standing):
            driven = sum(graph.geodesics.length(robots[relay.robot], relay.position) for relay in proposal.relays)
            assert proposal.total_cost_m == pytest.approx(
                (1.0 + LATENESS) * driven + RELAY_M * len(proposal.relays) + METRES_PER_WEIGHT * proposal.cost
            )
            assert len({relay.position for relay in proposal.relays}) == len(proposal.relays)
            found += len(proposal.relays) < len(standing)
    assert found > 0


@pytest.mark.parametrize("search", SEARCHES)
def test_no_chain_of_the_named_kind_costs_less_than_the_bound(search: Search) -> None:
    """And the reason names the kind: in sight of the agent on all its way, or when it has arrived there."""
    graph = _planner("points", "chain").graph
    proposer = Proposer(graph, BASE, search, robot_speed_m_s=1.4, agent_speed_m_s=0.9, apart_m=0.1)
    whole = partial = cheaper = 0
    for seed in range(6):
        here, there, *starts = _places(6, 70 + seed)
        way, robots = graph.geodesics.path(here, there), _team(starts)
        drive = np.array([graph.distances_from(place) for place in robots.values()])
        for proposal in filter(lambda found: found.relays, proposer.chains(announce(way), robots, [])):
            ahead = re.search(r"([0-9.]+) m on", proposal.reason)
            preview = 0.0 if ahead is None else min({*PREVIEWS_M, length(way)}, key=lambda m: abs(m - float(ahead[1])))
            pieces = walk(way, np.linspace(0.0, preview, 1 + math.ceil(preview / PIECE_M)))
            sees = graph.sees_all(pieces if "all its way" in proposal.reason else pieces[-1:])
            weights = METRES_PER_WEIGHT * graph.link_weights(pieces[-1])
            costs = drive + LATENESS * np.maximum(0.0, drive - preview * 1.4 / 0.9)
            links = METRES_PER_WEIGHT * graph.weights, costs, METRES_PER_WEIGHT * graph.link_weights(BASE)
            least = cheapest_chain(*links, np.where(sees, weights, np.inf), RELAY_M)
            assert least is not None and proposal.lower_bound_m is not None and proposal.total_cost_m is not None
            assert proposal.lower_bound_m <= least.cost * (1 + 1e-9) <= proposal.total_cost_m * (1 + 2e-9)
            last = np.array(proposal.relays[-1].position)
            assert np.all(_office().line_of_sight(last, pieces if "all its way" in proposal.reason else pieces[-1:]))
            anyhow = cheapest_chain(*links, weights, RELAY_M)
            assert anyhow is not None
            cheaper += anyhow.cost < least.cost - 1e-6
            whole += "all its way" in proposal.reason
            partial += ahead is not None and "all its way" not in proposal.reason
    assert whole > 0 and partial > 0 and cheaper > 0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_the_plan_of_the_exact_search_costs_what_redeploy_says(kind: PlacementKind, seed: int) -> None:
    planner = _planner(kind, "exact")
    graph = planner.graph
    places = _places(30, 20 + seed)
    agent = next(place for place in places if planner.relays_needed(place) >= 2)
    robots = _team(places[-4:])
    size = len(graph)
    W = np.full((size + 2, size + 2), np.inf)
    W[2:, 2:] = graph.weights
    for end, place in enumerate((BASE, agent)):
        W[end, 2:] = W[2:, end] = graph.link_weights(place)
    move = np.full((2 + len(robots), size + 2), np.inf)
    move[0, 0] = move[1, 1] = 0.0
    for row, place in enumerate(robots.values(), 2):
        move[row, 2:] = (1.0 + LATENESS) * graph.distances_from(place) + RELAY_M
    expected = redeploy(move, W, mu=METRES_PER_WEIGHT, search="exact", idle=True)
    plan = planner.plan(announce([agent]), robots, None)
    assert plan.total_cost_m == pytest.approx(expected.cost)
    assert plan.lower_bound_m == pytest.approx(expected.lower_bound) == pytest.approx(expected.cost)
    assert plan.total_cost_m == pytest.approx(
        _planner(kind, "chain").plan(announce([agent]), robots, None).total_cost_m
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("search", SEARCHES)
def test_every_search_keeps_a_team_joined_to_its_agent(kind: PlacementKind, search: Search) -> None:
    """From plan to plan, robots having arrived in between; the bound is a bound, and better searches cost no more."""
    planner = _planner(kind, search)
    robots = _team(_places(planner.most_relays_needed() + 1, 30))
    plan: Plan | None = None
    for agent in _places(6, 31):
        plan = planner.plan(announce([agent]), robots, plan)
        assert plan.serves
        stops = [BASE, *(place for _, place in _relays(plan)), agent]
        assert chain_holds(_office(), np.array([stops]))[0]
        assert len({name for name, _ in _relays(plan)}) == len(_relays(plan))
        assert plan.total_cost_m is not None and plan.lower_bound_m is not None
        assert 0.0 <= plan.lower_bound_m <= plan.total_cost_m * (1.0 + 1e-9) < math.inf
        robots = {place.robot: place.position for place in plan.placements}


SNAKE = Environment(
    [(0, 0), (10, 0), (10, 8), (16, 8), (16, 0), (18, 0), (18, 10), (8, 10), (8, 2), (0, 2)], name="snake"
)
"""Four corridors of 2 m: the base in the first, and one relay more for each corner."""
CORRIDORS: list[Point] = [(9.0, 6.0), (14.0, 9.0), (17.0, 4.0)]


def _follow(search: Search, agents: list[Point]) -> list[Plan]:
    """Plans for an agent that is at one place after the other, robots having arrived in between."""
    planner = DeploymentPlanner(SNAKE, (1.0, 1.0), RADIUS_M, "inflection", placements="points", search=search)
    robots = _team([(1.0, 0.5), (1.5, 0.5), (2.0, 0.5), (2.5, 0.5)])
    plans: list[Plan] = []
    for agent in agents:
        plans.append(planner.plan(announce([agent]), robots, plans[-1] if plans else None))
        robots = {place.robot: place.position for place in plans[-1].placements}
    return plans


def test_one_edge_makes_a_spare_the_last_relay_and_back() -> None:
    """At every corner the standing chain stays, in its order, and grows by a robot; on the way back it is cut short."""
    plans = _follow("one-edge", [*CORRIDORS, *reversed(CORRIDORS)])
    chains = [[name for name, _ in _relays(plan)] for plan in plans]
    assert [len(chain) for chain in chains[:3]] == [1, 2, 3]
    for before, after in pairwise(chains):
        shorter, longer = sorted((before, after), key=len)
        assert [name for name in longer if name in shorter] == shorter


def test_the_fixed_search_keeps_relays_and_their_order() -> None:
    there, back = _follow("fixed", [(17.0, 4.0), (17.0, 6.0)])
    assert [name for name, _ in _relays(there)] == [name for name, _ in _relays(back)]
    assert len(_relays(back)) == 3


def test_a_tree_that_cannot_serve_is_replaced_by_a_new_chain() -> None:
    """One relay cannot see around two corners, and the fixed search takes no other to it."""
    for fixed, chain in zip(_follow("fixed", CORRIDORS), _follow("chain", CORRIDORS), strict=True):
        assert fixed.total_cost_m == pytest.approx(chain.total_cost_m)
        assert _relays(fixed) == _relays(chain)


def test_points_need_no_more_robots_than_cells_and_sometimes_fewer() -> None:
    points, cells = _planner("points", "chain"), _planner("cells", "chain")
    needed = [(points.relays_needed(place), cells.relays_needed(place)) for place in _places(40, 5)]
    assert all(fewer <= more for fewer, more in needed)
    assert any(fewer < more for fewer, more in needed)
    assert points.most_relays_needed() < cells.most_relays_needed()


@pytest.mark.parametrize("seed", range(20))
def test_the_chain_in_a_tree_is_its_path(seed: int) -> None:
    rng = np.random.default_rng(seed)
    number = int(rng.integers(2, 9))
    tree = nx.random_labeled_tree(number, seed=seed)
    expected = nx.shortest_path(tree, 0, 1)[1:-1]
    assert path_between(np.array(tree.edges)) == expected
