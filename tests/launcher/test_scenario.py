"""Faults of a scenario file, each with the sentence that names file, place and remedy; and what a good one becomes."""

from __future__ import annotations

import socket
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from agents.mission import Mission, Scripted, Wandering
from launcher.preparation import Preparation, prepare
from launcher.scenario import ScenarioFault, find_scenario, packaged, read_scenario
from planning.placement_graph import PlacementGraph

# Two rooms of 8 m by 6 m, joined by a door 1 m wide and 1 m deep at y 2.5 to 3.5.
TWO_ROOMS = """{"name": "two rooms", "units": "metres", "holes": [], "outer": [
    [0, 0], [8, 0], [8, 2.5], [9, 2.5], [9, 0], [17, 0], [17, 6], [9, 6], [9, 3.5], [8, 3.5], [8, 6], [0, 6]]}"""
GOOD = """
map = "rooms.json"
duration_s = 20
[base]
position = [1.0, 1.0]
[agent]
start = [3, 3]
behaviour = "script"
goals = [[6, 3], [12, 1]]
[robots]
count = 3
"""

CELLS = '\n[planning]\nplacements = "cells"\n'

Write = Callable[[str], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    (tmp_path / "rooms.json").write_text(TWO_ROOMS)
    write_grid(tmp_path / "grid.yaml")

    def write_scenario(text: str) -> Path:
        file = tmp_path / "trial.toml"
        file.write_text(text)
        return file

    return write_scenario


def write_grid(file: Path, wall_column: int | None = None) -> None:
    """A grid of 4 m by 4 m, cells of 0.1 m, all free or with a wall that has no door."""
    row = bytes(0 if column == wall_column else 255 for column in range(40))
    file.with_suffix(".pgm").write_bytes(b"P5 40 40 255\n" + 40 * row)
    file.write_text(
        "image: grid.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\nfree_thresh: 0.196\noccupied_thresh: 0.65\n"
    )


def silently(_: str) -> None:
    """Announce nothing."""


def prepared(file: Path) -> Preparation:
    return prepare(file, silently)


FAULTS = {
    "grid of cells": (GOOD + CELLS + "spacing_m = 1.0\n", "planning.spacing_m is given", "only points"),
    "unknown search": (GOOD + '\n[planning]\nsearch = "one_edge"\n', "planning.search", "did you mean 'one-edge'"),
    "no TOML": (GOOD + "\n[agent", "is not valid TOML", "line"),
    "no map": (GOOD.replace('map = "rooms.json"\n', ""), "map is missing", 'map = "'),
    "no base": (GOOD.replace("[base]\nposition = [1.0, 1.0]\n", ""), "base is missing", "[base]"),
    "no robots": (GOOD.replace("count = 3", ""), "neither count nor starts", "count = 4"),
    "unknown key": (GOOD.replace("start =", "strat ="), "unknown key 'strat' in [agent]", "did you mean 'start'"),
    "key in the wrong table": ("heartbeat_hz = 2\n" + GOOD, "unknown key 'heartbeat_hz'", "belongs in [rates]"),
    "unknown table": (GOOD + "\n[robotz]\n", "unknown key 'robotz'", "did you mean 'robots'"),
    "key unlike any": (GOOD + "\n[rates]\nzzz = 1\n", "unknown key 'zzz' in [rates]", "control_hz, heartbeat_hz"),
    "unknown key at the top": ("zzz = 2\n" + GOOD, "unknown key 'zzz' at the top of the file", "map, base, agent"),
    "text for a number": (GOOD.replace("[6, 3]", '[6, "3"]'), "agent.goals[0][1] is text", "must be a number"),
    "number for a place": (GOOD.replace("[6, 3]", "6"), "agent.goals[0] is a whole number", "[x, y] in metres"),
    "true for a number": (GOOD.replace("[6, 3]", "[6, true]"), "agent.goals[0][1] is true", "must be a number"),
    "one coordinate": (GOOD.replace("[3, 3]", "[3]"), "agent.start has 1 number;", "[x, y] in metres"),
    "far off": (GOOD.replace("[3, 3]", "[3, 1e300]"), "agent.start[1] is out of range", "at most 10000000"),
    "number of 400 digits": (GOOD.replace("[3, 3]", f"[3, {10**400}]"), "agent.start[1] is out of range", "digits"),
    "number of 5000 digits": (GOOD.replace("[3, 3]", f"[3, {'9' * 5000}]"), "thousands of digits", "give metres"),
    "lists 900 deep": (GOOD.replace("[3, 3]", "[" * 900 + "]" * 900), "nested too deeply", "[x, y]"),
    "lists 4000 deep": (GOOD.replace("[3, 3]", "[" * 4000), "nested too deeply", "[x, y]"),
    "tables 4000 deep": (GOOD.replace("duration_s", "a." * 4000 + "b"), "nested too deeply", "[x, y]"),
    "seed of 18 digits": (f"seed = {10**17}\n" + GOOD, "seed is out of range", "at most 9007199254740992"),
    "three coordinates": (GOOD.replace("[3, 3]", "[3, 3, 0]"), "agent.start has 3 numbers", "[x, y] in metres"),
    "fraction of a robot": (GOOD.replace("count = 3", "count = 2.5"), "robots.count is a number", "a whole number"),
    "no robot": (GOOD.replace("count = 3", "count = 0"), "robots.count is out of range", "at least 1"),
    "too many robots": (GOOD.replace("count = 3", "count = 200"), "robots.count is out of range", "at most 40"),
    "too many starts": (
        GOOD.replace("count = 3", f"starts = {[[0.5 + 0.1 * i, 2.0] for i in range(41)]}"),
        "robots.starts has 41 places",
        "at most 40 robots",
    ),
    "negative speed": (GOOD + "speed_m_s = -1\n", "robots.speed_m_s is out of range", "more than 0"),
    "not a number": (GOOD.replace("[6, 3]", "[nan, 3]"), "agent.goals[0][0] is nan", "a finite number"),
    "endless": (GOOD.replace("duration_s = 20", "duration_s = inf"), "duration_s is inf", "a finite number"),
    "misspelt choice": (GOOD.replace('"script"', '"scrpt"'), "agent.behaviour is 'scrpt'", "did you mean 'script'"),
    "unlike any choice": (GOOD.replace('"script"', '"zzz"'), "agent.behaviour is 'zzz'", "script, wander, goals"),
    "script without goals": (GOOD.replace("goals =", "#"), "'script' and there are no goals", "add goals = "),
    "goals without script": (GOOD.replace('"script"', '"wander"'), "behaviour is 'wander'", 'behaviour = "script"'),
    "name no name": ('name = "A team"\n' + GOOD, "name 'A team' cannot name a team", "use at most 32"),
    "planning without a pause": (
        GOOD + "\n[planning]\nperiod_s = 0.001\n",
        "planning.period_s is out of range",
        "at least 0.05",
    ),
    "count and starts differ": (
        GOOD + "starts = [[2, 2]]\n",
        "robots.count is 3 and robots.starts has 1 place;",
        "remove",
    ),
    "absent map": (GOOD.replace("rooms.json", "absent.json"), "no map absent.json", "give a map file or one of"),
    "map with a name too long": (GOOD.replace("rooms.json", "r" * 300), "no map rrr", "give a map file or one of"),
    "map with NUL": (GOOD.replace("rooms.json", "r\\u0000"), "no map r", "give a map file or one of"),
    "misspelt map": (GOOD.replace("rooms.json", "rom1"), "no map rom1", "did you mean 'room1'"),
    "base in a wall": (GOOD.replace("[1.0, 1.0]", "[8.5, 1]"), "base.position [8.5, 1] is inside a wall", "move it"),
    "base off the map": (GOOD.replace("[1.0, 1.0]", "[-5, 1]"), "off the map (x 0 to 17, y 0 to 6)", "move it"),
    "agent in a wall": (GOOD.replace("[3, 3]", "[8.5, 5]"), "agent.start [8.5, 5] is inside a wall", "move it"),
    "agent at a wall": (GOOD.replace("[3, 3]", "[3, 0.1]"), "agent.start [3, 0.1] is 0.10 m from a wall", "move it"),
    "goal off the map": (GOOD.replace("[12, 1]", "[12, 9]"), "agent.goals[1] [12, 9] is inside a wall", "move it"),
    "goal at a wall": (GOOD.replace("[12, 1]", "[12, 0]"), "agent.goals[1] [12, 0] is 0.00 m from a wall", "move it"),
    "goal behind a narrow door": (
        GOOD.replace("[agent]", "[agent]\nradius_m = 0.6"),
        "agent.goals[1] [12, 1] cannot be reached from agent.start [3, 3]",
        "agent.radius_m smaller",
    ),
    "robot in a wall": (
        GOOD.replace("count = 3", "starts = [[2, 2], [8.5, 1]]"),
        "robots.starts[1] [8.5, 1] is inside a wall",
        "move it",
    ),
    "robots on each other": (
        GOOD.replace("count = 3", "starts = [[2, 2], [2.3, 2]]"),
        "robots.starts[1] [2.3, 2] overlaps robots.starts[0]",
        "0.4 m apart",
    ),
    "robot on the agent": (
        GOOD.replace("count = 3", "starts = [[3.1, 3]]"),
        "robots.starts[0] [3.1, 3] overlaps agent.start",
        "0.4 m apart",
    ),
    "no room for so many": (
        GOOD.replace("count = 3", "count = 40\nradius_m = 0.49"),
        "of radius 0.49 m, and robots.count is 40",
        "robots.starts",
    ),
    "robots too wide": (GOOD + "radius_m = 5\n", "robots.radius_m = 5", "smaller"),
    "agent too wide": (
        GOOD.replace("[agent]", "[agent]\nradius_m = 9"),
        "agent.start [3, 3] is 3.00 m from a wall",
        "convert them to metres",
    ),
    "robots as wide as the map": (
        GOOD + "radius_m = 9\n",
        "robots.radius_m = 9 leaves no room",
        "the whole map is 17 m by 6 m: make the radius smaller",
    ),
    "tolerance of a polygon": (
        GOOD.replace("duration_s = 20", "map_tolerance_m = 0.1"),
        "a tolerance of 0.1 m is given, and rooms.json is no occupancy grid",
        "leave it out",
    ),
    "base outside a grid": (
        GOOD.replace("rooms.json", "grid.yaml").replace("[1.0, 1.0]", "[-20, -0.5]"),
        "base.position [-20, -0.5] is inside a wall or off the map (x 0 to 4, y 0 to 4)",
        "move it, for example to [0.",
    ),
}


@pytest.mark.parametrize("case", FAULTS)
def test_a_fault_is_one_sentence_with_file_place_and_remedy(case: str, write: Write) -> None:
    text, place, remedy = FAULTS[case]
    file = write(text)
    with pytest.raises(ScenarioFault) as caught:
        prepared(file)
    said = str(caught.value)
    assert said.startswith(str(file))
    assert place in said
    assert remedy in said
    assert "\n" not in said
    assert len(said) < len(str(file)) + 600


def test_the_tolerance_of_a_grid_is_the_scenarios(write: Write) -> None:
    text = GOOD.replace("rooms.json", "grid.yaml").replace("[[6, 3], [12, 1]]", "[[3, 2]]")
    assert "within 0.2 m" in prepare(write(text), silently).environment.source
    coarse = text.replace("duration_s = 20", "map_tolerance_m = 0.35")
    assert "within 0.35 m" in prepare(write(coarse), silently).environment.source


def test_a_base_in_a_smaller_part_of_a_grid_is_where_the_mission_is(write: Write, tmp_path: Path) -> None:
    write_grid(tmp_path / "grid.yaml", wall_column=30)
    text = GOOD.replace("rooms.json", "grid.yaml").replace("[1.0, 1.0]", "[3.5, 1]").replace("[3, 3]", "[3.5, 3]")
    text = text.replace('"script"', '"wander"').replace("goals =", "#").replace("count = 3", "count = 1")
    assert prepared(write(text)).environment.bounds == pytest.approx((3.1, 0.0, 4.0, 4.0))


def test_too_many_cells_are_said_of_the_scenario(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("agents.leader.MOST_TO_PLAN_ON", 3)
    file = write(GOOD + CELLS)
    with pytest.raises(
        ScenarioFault, match=r"inflection cells, and at most 3 .* or use placements on points"
    ) as caught:
        prepared(file)
    assert str(caught.value).startswith(f"{file}: map: ")


def test_cells_that_would_be_too_many_are_not_made(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("decomposed")

    monkeypatch.setattr("planning.compiled_map.decompose", refuse)
    text = GOOD.replace("rooms.json", "cityblocks").replace("[1.0, 1.0]", "[10, 10]").replace("[3, 3]", "[12, 10]")
    text = text.replace('"script"', '"wander"').replace("goals =", "#")
    file = write(text + CELLS + 'decomposition = "aspect"\n')
    with pytest.raises(ScenarioFault, match=r"map: 'cityblocks' has about 4\d,\d{3} aspect cells, .* use inflection"):
        prepared(file)


def test_a_grid_too_fine_is_said_of_the_scenario(write: Write) -> None:
    file = write(GOOD + "\n[planning]\nspacing_m = 0.01\n")
    with pytest.raises(ScenarioFault, match=r"planning\.spacing_m: .*make it at least"):
        prepared(file)


def test_what_the_leader_plans_on_is_chosen_in_the_scenario(write: Write) -> None:
    chosen = prepared(write(GOOD + '\n[planning]\nspacing_m = 1.5\nsearch = "exact"\n'))
    mission, graph = chosen.mission, chosen.planner.graph
    assert (mission.placements, mission.spacing_m, mission.search) == ("points", 1.5, "exact")
    assert (graph.kind, len(graph)) == ("points", len(PlacementGraph.from_points(graph.environment, 0.2, 1.5)))
    assert prepared(write(GOOD + CELLS)).planner.graph.kind == "cells"


def test_a_search_too_slow_for_the_period_is_warned_of(write: Write) -> None:
    exact = '\n[planning]\nsearch = "exact"\n'
    many = GOOD.replace("count = 3", "count = 11")
    assert [warning for warning in prepared(write(many + exact)).warnings if "with 11 robots" in warning]
    for text in (GOOD + exact, many, many + exact + "period_s = 1.0\n"):
        assert not prepared(write(text)).warnings


def test_robots_and_agent_may_stand_on_the_base(write: Write) -> None:
    text = GOOD.replace("count = 3", "starts = [[1.0, 1.0], [2, 2]]")
    assert prepared(write(text)).mission.robots[0].start == (1.0, 1.0)


def test_bounds_are_those_of_what_they_are_for() -> None:
    import msgspec

    from launcher import console
    from planning import polygon_validation
    from protocol.messages import Coordinate

    assert console.FARTHEST_M <= polygon_validation.FARTHEST_M
    for far in (console.FARTHEST_M, -console.FARTHEST_M):
        assert msgspec.convert(far, Coordinate) == far
        with pytest.raises(msgspec.ValidationError):
            msgspec.convert(1.001 * far, Coordinate)


def test_an_unreadable_scenario_says_why(tmp_path: Path) -> None:
    with pytest.raises(ScenarioFault, match="cannot be read"):
        read_scenario(tmp_path)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ScenarioFault, match="UTF-8"):
        read_scenario(binary)


def test_an_unknown_scenario_is_answered_with_the_near_one() -> None:
    with pytest.raises(ScenarioFault, match="did you mean 'office'"):
        find_scenario("offce")
    with pytest.raises(ScenarioFault, match=r"give a TOML file or one of .*office"):
        find_scenario("zzz")


def test_a_good_scenario_becomes_a_mission(write: Write) -> None:
    preparation = prepared(write(GOOD))
    mission = preparation.mission
    assert isinstance(mission, Mission)
    assert mission.team == "trial"
    assert mission.base_station.start == (1.0, 1.0)
    assert mission.tracked_agent.start == (3.0, 3.0)
    assert isinstance(mission.behaviour, Scripted)
    assert mission.behaviour.goals == ((6.0, 3.0), (12.0, 1.0))
    assert len({entry.name for entry in mission.roster}) == len(mission.roster) == 5


def test_automatic_starts_are_near_the_base_in_its_sight_and_apart(write: Write) -> None:
    text = GOOD.replace("count = 3", "count = 20").replace("[1.0, 1.0]", "[7.5, 5.5]")
    preparation = prepared(write(text))
    mission, environment = preparation.mission, preparation.environment
    starts = np.array([robot.start for robot in mission.robots])
    assert len(starts) == 20
    assert environment.line_of_sight(np.array(mission.base_station.start), starts).all()
    gaps = np.linalg.norm(starts[:, None] - starts[None], axis=2) + 10 * np.eye(len(starts))
    assert gaps.min() >= 2 * mission.robot_radius_m
    to_agent = np.linalg.norm(starts - np.array(mission.tracked_agent.start), axis=1)
    assert to_agent.min() >= mission.robot_radius_m + mission.agent_radius_m
    wall_gaps = [environment.polygon.boundary.distance(_point(start)) for start in starts]
    assert min(wall_gaps) >= mission.robot_radius_m - 1e-6


def _point(start: np.ndarray) -> object:
    import shapely

    return shapely.Point(start)


def test_too_few_robots_for_a_goal_say_how_many_it_needs(write: Write) -> None:
    # From (1, 1) the point (16, 5.5) is seen through the door, but not all of its cell from all of the base's.
    text = GOOD.replace("[12, 1]", "[16, 5.5]").replace("count = 3", "count = 1")
    with pytest.raises(ScenarioFault, match=r"agent\.goals\[1\].* needs (\d) robots.*robots\.count"):
        prepared(write(text + CELLS))
    assert prepared(write(text)).planner.relays_needed((16.0, 5.5)) == 0


def test_fewer_robots_than_another_place_needs_is_a_warning(write: Write) -> None:
    text = (
        GOOD.replace("goals = [[6, 3], [12, 1]]", "").replace('"script"', '"wander"').replace("count = 3", "count = 1")
        + CELLS
    )
    preparation = prepared(write(text))
    assert isinstance(preparation.mission.behaviour, Wandering)
    assert len(preparation.warnings) == 1
    assert "need" in preparation.warnings[0]


@pytest.mark.parametrize("name", packaged())
def test_packaged_scenarios_are_sound(name: str) -> None:
    preparation = prepared(find_scenario(name))
    assert preparation.mission.team == name


def test_a_taken_port_is_named(write: Write) -> None:
    from launcher.run import reserve_endpoints

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        file = write(GOOD + f"\n[network]\nbase_port = {port - 1}\n")
        with pytest.raises(ScenarioFault, match=rf"network\.base_port: port {port} .*choose another base_port"):
            reserve_endpoints(file, prepared(file))


def test_an_even_number_of_voters_is_told_what_a_majority_is(write: Write) -> None:
    """Base station and robots have a vote each."""
    for count, told in ((3, True), (4, False)):
        said: list[str] = []
        prepare(write(GOOD.replace("count = 3", f"count = {count}")), said.append)
        assert any(text.startswith("3 of 4 voters make a leader: if the team parts") for text in said) is told
