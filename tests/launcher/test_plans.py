"""``sightline map`` and ``sightline plan``: what they answer, and what they refuse."""

from __future__ import annotations

import json
import math
from functools import cache
from itertools import combinations, pairwise, product
from pathlib import Path
from typing import Any

import networkx as nx
import pytest
import shapely
from typer.testing import CliRunner, Result

import maps
from launcher.cli import app
from planning.environment import Environment

ROOM3 = ["plan", "room3", "--base", "10,36", "--agent", "70,10"]
TWO = [*ROOM3, "--agent", "30,45"]
STARTS = [(12.0, 36.0), (31.0, 33.0), (35.0, 15.0), (60.0, 6.0)]
ROBOTS = [word for x, y in STARTS for word in ("--robot", f"{x},{y}")]
LINE = [word for link in ("base-1", "1-2", "2-3", "3-4", "4-agent") for word in ("--link", link)]
MANY = [word for x, y in product((6, 10, 14, 27, 35), (32, 35, 40, 44, 48)) for word in ("--agent", f"{x},{y}")]


def sightline(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


@cache
def answer(*arguments: str) -> dict[str, Any]:
    result = sightline(*arguments, "--json")
    assert result.exit_code in (0, 2), (result.output, result.exception)
    facts: dict[str, Any] = json.loads(result.stdout)
    motion = facts.get("motion")
    assert result.exit_code == 2 * (motion is not None and not (motion["certified"] and motion["arrives"]))
    return facts


def check_tree(plan: dict[str, Any]) -> None:
    """The links join base, agents and relays without a cycle, and shapely sees none that leaves the free space."""
    links = nx.Graph([(tuple(here), tuple(there)) for here, there in plan["links"] if here != there])
    links.add_node(tuple(plan["base"]))
    assert nx.is_tree(links)
    assert set(links) == {tuple(place) for place in [plan["base"], *plan["agents"], *plan["relays"]]}
    floor = Environment.load(plan["map"]).polygon.buffer(1e-6)
    assert all(shapely.covers(floor, shapely.LineString(link)) for link in links.edges)


@pytest.mark.parametrize("method", ["exact", "mst", "takahashi-matsuyama"])
@pytest.mark.parametrize("placements", ["points", "cells"])
def test_trees_join_several_agents(method: str, placements: str) -> None:
    plan = answer(*TWO, "--method", method, "--placements", placements)
    check_tree(plan)
    assert plan["relays_needed"] <= len(plan["relays"])
    least = answer(*TWO, "--placements", placements)["cost"]
    assert least - 1e-9 <= plan["cost"] <= 2.0 * least


def test_points_need_fewer_robots_than_cells() -> None:
    points, cells = (answer(*ROOM3, "--placements", placements) for placements in ("points", "cells"))
    for plan in (points, cells):
        check_tree(plan)
    assert points["relays_needed"] < cells["relays_needed"]
    assert points["decomposition"] is None
    assert cells["decomposition"] == "inflection"


@pytest.mark.parametrize("vertices", [5, 6, 8])
def test_a_tree_has_as_many_nodes_as_asked_for(vertices: int) -> None:
    plan = answer(*ROOM3, "--vertices", str(vertices))
    check_tree(plan)
    assert 2 + len(plan["relays"]) == vertices


def test_spares_are_robots_that_the_tree_leaves() -> None:
    plan = answer(*TWO, "--robots", "9")
    assert plan["spares"] == 9 - len(plan["relays"])


def test_few_robots_take_the_dearer_tree_that_they_suffice_for() -> None:
    """Without a penalty for robots the cheapest tree has many short links."""
    options = [*ROOM3, "--placements", "cells", "--weights", "combined", "--area-weight", "0"]
    lavish = answer(*options)
    frugal = answer(*options, "--robots", str(lavish["relays_needed"]))
    assert lavish["relays_needed"] == len(frugal["relays"]) < len(lavish["relays"])
    assert frugal["cost"] > lavish["cost"]
    for plan in (lavish, frugal):
        check_tree(plan)
    fewest = answer(*options, "--robot-penalty", "fewest")
    assert len(fewest["relays"]) == lavish["relays_needed"]
    metres = sum(math.dist(*link) for link in lavish["links"])
    assert lavish["cost"] == pytest.approx(metres, rel=0.3)  # k_a times metres between centroids


@pytest.mark.parametrize("search", ["exact", "one-edge", "fixed", "chain", "tree"])
def test_robots_are_sent_with_costs_that_add_up(search: str) -> None:
    plan = answer(*ROOM3, *ROBOTS, "--search", search, "--movement", "euclidean", "--mu", "3", "--idle")
    check_tree(plan)
    assert [tuple(robot["from"]) for robot in plan["robots"]] == STARTS
    ways = [(robot["from"], robot["to"]) for robot in plan["robots"] if robot["to"] is not None]
    assert [end for _, end in ways] == plan["relays"]
    assert plan["movement"] == pytest.approx(sum(math.dist(*way) for way in ways))
    assert plan["cost"] == pytest.approx(plan["movement"] + 3.0 * plan["virtual"])
    if search == "tree":
        assert plan["virtual"] == pytest.approx(answer(*ROOM3)["cost"])
        assert plan["lower_bound"] is None
    else:
        assert plan["lower_bound"] <= plan["cost"] + 1e-9


def test_searches_are_in_order_of_their_costs() -> None:
    costs = [
        answer(*ROOM3, *ROBOTS, "--mu", "9", "--search", search)["cost"] for search in ("exact", "one-edge", "fixed")
    ]
    assert costs == sorted(costs)
    idle = answer(*ROOM3, *ROBOTS, "--idle")
    chain = answer(*ROOM3, *ROBOTS, "--search", "chain")
    assert idle["cost"] == pytest.approx(chain["cost"])
    assert any(robot["to"] is None for robot in idle["robots"])


def test_words_say_what_the_bound_is_of_and_how_to_need_fewer() -> None:
    whole, idle, chain = (
        sightline(*ROOM3, *ROBOTS, *options).stdout for options in ([], ["--idle"], ["--search", "chain"])
    )
    assert "4 relays (3 would do), 0 idle; --idle leaves robots out; cost" in whole
    assert "for any plan that leaves no robot out; reached: this is the least" in whole
    for text in (idle, chain):
        assert "leaves" not in text
        assert "for any plan; reached: this is the least" in text


def test_robots_take_the_places_that_are_nearest_together() -> None:
    """Identification: no other assignment of the robots to the places of the tree is shorter."""
    plan = answer(*ROOM3, *ROBOTS, "--search", "tree", "--movement", "euclidean")
    places = plan["relays"]
    best = min(
        sum(math.dist(STARTS[i], place) for i, place in zip(chosen, places, strict=True))
        for chosen in product(range(len(STARTS)), repeat=len(places))
        if len(set(chosen)) == len(places)
    )
    assert plan["movement"] == pytest.approx(best)


def test_movement_round_walls_and_through_cells_is_longer_than_straight() -> None:
    cells = [*ROOM3, "--robot", "12,36", "--robot", "13,36", "--robot", "14,36", "--robot", "15,36", "--robot", "16,36"]
    cells += ["--placements", "cells", "--search", "tree"]
    straight, geodesic, adjacency = (
        answer(*cells, "--movement", movement)["movement"] for movement in ("euclidean", "geodesic", "adjacency")
    )
    assert straight < geodesic < adjacency
    smoother = answer(*cells, "--movement", "adjacency", "--jump-penalty", "5")["movement"]
    assert smoother >= adjacency


def test_speed_makes_seconds_of_metres_and_a_deadline_forbids() -> None:
    metres, seconds = (
        answer(*ROOM3, *ROBOTS, "--search", "tree", *speed) for speed in ([], ["--speed", "2", "--deadline", "60"])
    )
    assert (metres["unit"], seconds["unit"]) == ("m", "s")
    assert seconds["movement"] == pytest.approx(metres["movement"] / 2)
    refused = sightline(*ROOM3, *ROBOTS, "--search", "chain", "--speed", "2", "--deadline", "0.1")
    assert refused.exit_code == 2
    assert "join" in refused.stderr


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--search", "chain"], "give --robot X,Y"),
        (["--idle"], "give --robot X,Y"),
        (["--mu", "nan"], "--mu nan is out of range"),
        (["--vertices", "7", "--robots", "5"], "leave out --robots"),
        (["--vertices", "7", "--method", "mst"], "leave out --method"),
        (["--vertices", "3"], "of --vertices 3 only 1 can be robots; give at least 5"),
        ([*ROBOTS, "--robots", "5"], "leave out --robots"),
        ([*ROBOTS, "--deadline", "5"], "give --speed"),
        ([*ROBOTS, "--jump-penalty", "5"], "say --movement adjacency"),
        ([*ROBOTS, "--movement", "adjacency"], "say --placements cells"),
        ([*ROBOTS, "--agent", "30,45", "--search", "chain"], "joins one agent, and there are 2"),
        (["--robot", "12,36"], "--robot was given 1 time; give at least 3"),
        (["--robot", "0,0"], "--robot [0, 0] is inside a wall"),
        (["--robot", "north"], "--robot: 'north' is no place"),
        (["--spacing", "1", "--placements", "cells"], "--spacing is of points"),
        (["--spacing", "0.01"], "a spacing of 0.01 m makes about"),
        (["--spacing", "0"], "--spacing 0.0 is out of range"),
        (["--weights", "combined"], "say --placements cells"),
        (["--placements", "cells", "--area-weight", "2"], "normalised weights have no coefficients"),
        (["--placements", "cells", "--robot-penalty", "many"], "give a number, 'pairwise' or 'fewest'"),
        (["--placements", "cells", "--max-bitangent", "5"], "say --decomposition aspect"),
        (["--agent", "0,0"], "--agent [0, 0] is inside a wall"),
        (["--agent", "30,45", *ROBOTS, "--search", "fixed"], "say --search exact"),
        (["--link", "base-agent"], "give --robot X,Y"),
        ([*ROBOTS, "--link", "base-5"], "--link: 'base-5' is no link; write A-B with two of base, agent, 1, 2, 3, 4"),
        ([*ROBOTS, *LINE, "--link", "1-agent"], "--link 1-agent joins what is joined already"),
        ([*ROBOTS, *LINE[2:]], "no --link joins agent to the base station"),
        ([*ROBOTS, *LINE[:-2]], "no --link joins agent to the base station"),
        ([*ROBOTS, *LINE, "--search", "chain"], "leave out --link, or say --search one-edge"),
    ],
)
def test_what_cannot_be_planned_is_refused_in_a_sentence(options: list[str], words: str) -> None:
    result = sightline(*ROOM3, *options)
    assert result.exit_code == 2, (result.output, result.exception)
    assert result.stderr.startswith("sightline: ")
    assert result.stderr.count("\n") == 1
    assert words in result.stderr


def test_a_map_of_too_many_cells_is_refused_before_they_are_made() -> None:
    options = ["plan", "cityblocks", "--base", "0,0", "--agent", "16,16", "--placements", "cells"]
    result = sightline(*options, "--decomposition", "aspect")
    assert result.exit_code == 2
    assert "aspect cells would be more than the 20,000" in result.stderr


def test_a_map_says_what_it_asks_for_and_what_it_costs() -> None:
    facts = answer("map", "room3")
    assert facts["robots"]["cells"] == {"placements": 98, "most_relays": 7, "parts": 1}
    assert facts["robots"]["points"]["most_relays"] == 4
    assert facts["forecast"]["cells"] == pytest.approx(facts["cells"], rel=0.2)
    text = sightline("map", "room3").stdout
    assert "any two of 98 cells need at most 7 relays" in text
    assert "need at most 4 relays; other places at most 2 more" in text


def test_what_takes_too_long_is_said_and_not_done() -> None:
    facts = answer("map", "cityblocks", "--decomposition", "aspect")
    assert facts["cells"] == 43675
    assert facts["robots"]["cells"] == {"left_out": "more than 20,000 cells"}
    hasty = answer("map", "office", "--decomposition", "aspect", "--patience", "0")
    assert hasty["counts"] is None
    assert hasty["forecast"]["cells"] == pytest.approx(2225, rel=0.1)
    assert "--patience 0" in hasty["robots"]["cells"]["left_out"]


def test_a_map_without_room_for_a_robot_is_described_all_the_same() -> None:
    facts = answer("map", "room1", "--radius", "50")
    assert facts["cells"] == 26
    assert "left_out" in facts["robots"]["cells"]


def test_short_bitangents_make_fewer_cells() -> None:
    all_, short = (
        answer("map", "room3", "--decomposition", "aspect", *options)["cells"]
        for options in ([], ["--max-bitangent", "4"])
    )
    assert short < all_


def test_maps_are_read_as_well_known_text(tmp_path: Path) -> None:
    file = tmp_path / "hall.wkt"
    file.write_text(shapely.to_wkt(Environment.load(maps.path("room1")).polygon, rounding_precision=-1))
    assert answer("map", str(file))["cells"] == 26
    plan = answer("plan", str(file), "--base", "5,10", "--agent", "55,15")
    check_tree(plan)


def test_pictures_show_movement_and_idle_robots(tmp_path: Path) -> None:
    pictures = [tmp_path / "still.svg", tmp_path / "moving.svg"]
    for picture, robots in zip(pictures, ([], [*ROBOTS, "--idle"]), strict=True):
        assert sightline(*ROOM3, *robots, "--picture", str(picture)).exit_code == 0
    still, moving = (picture.read_text() for picture in pictures)
    for words in ("start", "robot that stays", "lines of sight before", "lines of sight after", "seconds, if nobody"):
        assert f"<!-- {words}" in moving, words
        assert f"<!-- {words}" not in still
    assert "<!-- line of sight -->" in still


def test_the_present_tree_is_the_one_that_is_given() -> None:
    line, given, crossed = (
        answer(*ROOM3, *ROBOTS, "--search", "fixed", *links)
        for links in (
            [],
            LINE,
            [word for link in ("base-4", "4-3", "3-2", "2-1", "1-agent") for word in ("--link", link)],
        )
    )
    assert line["present_tree"] == ["base-1", "1-2", "2-3", "3-4", "4-agent"]
    assert given == line
    assert crossed["present_tree"] == ["base-4", "4-3", "3-2", "2-1", "1-agent"]
    assert crossed["cost"] > line["cost"]
    places = [crossed["base"], *(robot["to"] for robot in reversed(crossed["robots"])), crossed["agents"][0]]
    assert crossed["links"] == [list(link) for link in pairwise(places)]
    assumed, told = (sightline(*ROOM3, *ROBOTS, "--search", "one-edge", *links).stdout for links in ([], LINE))
    assert "base-1 1-2 2-3 3-4 4-agent, taken for the present tree; give --link for another" in assumed
    assert "base-1 1-2 2-3 3-4 4-agent\n" in told


def test_more_nodes_than_are_searched_exactly_are_joined_all_the_same() -> None:
    """15 terminals and 3 robots; the line of robots in their order cannot be placed at all."""
    places = ((6, 32), (6, 48), (14, 32), (14, 48), (27, 32), (35, 32), (27, 48), (35, 48), (46, 32), (62, 32))
    places += ((46, 48), (62, 48), (27, 3), (38, 20))
    agents = [word for x, y in places for word in ("--agent", f"{x},{y}")]
    starts = [word for place in ("60,35", "31,33", "42,45") for word in ("--robot", place)]
    plan = answer("plan", "room3", "--base", "10,36", *agents, *starts)
    check_tree(plan)
    assert plan["present_tree"] is None
    assert plan["lower_bound"] <= plan["cost"] + 1e-9


def test_links_name_agents_by_number_and_leave_out_robots_that_may_idle() -> None:
    links = [word for link in ("base-2", "2-3", "3-agent1", "2-agent2") for word in ("--link", link)]
    refused = sightline(*TWO, *ROBOTS, *links, "--search", "one-edge")
    assert "no --link joins 1 to the base station" in refused.stderr
    plan = answer(*TWO, *ROBOTS, *links, "--search", "one-edge", "--idle")
    check_tree(plan)
    assert plan["present_tree"] == ["base-2", "2-3", "3-agent1", "2-agent2"]


@pytest.mark.parametrize("movement", ["geodesic", "euclidean", "adjacency"])
def test_ways_lead_where_robots_go_and_are_as_long_as_they_cost(movement: str, tmp_path: Path) -> None:
    starts = [word for x in (12, 13, 14, 15, 16) for word in ("--robot", f"{x},36")]
    drawn = ["--picture", str(tmp_path / "p.png")] if movement == "adjacency" else []
    plan = answer(*ROOM3, *starts, "--placements", "cells", "--movement", movement, *drawn)
    free = Environment.load(plan["map"]).inflated(plan["robot_radius_m"]).polygon.buffer(1e-6)
    total = 0.0
    for robot in plan["robots"]:
        way = shapely.LineString(robot["way"])
        total += way.length
        assert robot["way"][0] == robot["from"]
        assert robot["way"][-1] == pytest.approx(robot["to"])
        assert movement == "euclidean" or shapely.covers(free, way)
    if movement == "adjacency":  # which costs from stop to stop of cells, straight
        assert total > plan["movement"]
    else:
        assert total == pytest.approx(plan["movement"])


def test_robots_that_would_stand_in_one_place_are_told() -> None:
    robots = [*ROBOTS, "--robot", "62,6", "--robot", "63,7"]
    plan = answer(*ROOM3, *robots, "--mu", "50")
    close = {
        frozenset((f"robot {i + 1}", f"robot {j + 1}"))
        for i, one in enumerate(plan["robots"])
        for j, other in enumerate(plan["robots"][:i])
        if math.dist(one["to"], other["to"]) < 0.4
    }
    assert close
    assert {frozenset(pair) for crowd in plan["crowds"] for pair in combinations(crowd, 2)} == close
    assert "Too near: robot" in sightline(*ROOM3, *robots, "--mu", "50").stdout
    assert answer(*ROOM3)["crowds"] == []
    assert answer(*ROOM3, *ROBOTS, "--robot", "10.1,36", "--idle")["crowds"] == [], "the base station has no body"


def test_relays_in_one_place_take_one_line() -> None:
    result = sightline(*ROOM3, "--vertices", "80")
    assert "and the next " in result.stdout
    assert result.stdout.count("\n") < 15


def test_many_agents_are_joined_as_the_refusal_advises() -> None:
    arguments = ["plan", "room3", "--base", "10,36", *MANY, "--agent", "70,10"]
    refused = sightline(*arguments)
    assert refused.exit_code == 2
    assert "room3.json: 26 agents and the base station on" in refused.stderr
    assert "say --method takahashi-matsuyama or --method mst" in refused.stderr
    for method in ("takahashi-matsuyama", "mst"):
        plan = answer(*arguments, "--method", method)
        check_tree(plan)
        assert not plan["relays_needed_is_least"]
        enough = answer(*arguments, "--method", method, "--robots", str(len(plan["relays"])))
        assert enough["spares"] == 0
    assert "the least is not known" in sightline(*arguments, "--method", "mst").stdout
    few = sightline(*arguments, "--method", "mst", "--robots", "1")
    assert few.exit_code == 2
    assert f"give --robots {len(plan['relays'])}" in few.stderr
    size = sightline(*arguments, "--vertices", "40")
    assert size.exit_code == 2
    assert "leave out --vertices, and say --method takahashi-matsuyama" in size.stderr
