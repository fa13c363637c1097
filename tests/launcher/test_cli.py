"""The command line in one process: answers, JSON, and faults as one sentence with exit status 2."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

import maps
from launcher.cli import app
from launcher.contacts import Overlap
from planning.environment import Environment

SQUARE = {"type": "Polygon", "coordinates": [[[-5, -5], [5, -5], [5, 5], [-5, 5], [-5, -5]]]}
SCENARIO = """
map = "room1"
duration_s = 8
seed = 3
[base]
position = [5.0, 10.0]
[agent]
start = [8.0, 10.0]
[robots]
count = 4
"""


def sightline(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def refusal(*arguments: str) -> str:
    """The one sentence with which a command refuses."""
    result = sightline(*arguments)
    assert result.exit_code == 2, (result.output, result.exception)
    assert result.stderr.startswith("sightline: ")
    assert result.stderr.count("\n") == 1
    return result.stderr.strip()


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    file = tmp_path / "trial.toml"
    file.write_text(SCENARIO)
    return file


def test_version() -> None:
    result = sightline("--version")
    assert result.exit_code == 0
    assert result.stdout.startswith("sightline 0.")


@pytest.mark.parametrize("arguments", [[], ["study"]])
def test_without_a_command_there_is_help(arguments: list[str]) -> None:
    result = sightline(*arguments)
    assert result.exit_code == 2
    assert "--help" in result.stdout
    assert result.stderr == ""


def test_map_without_a_name_lists_all_maps() -> None:
    listed = sightline("map")
    assert listed.exit_code == 0
    facts = json.loads(sightline("map", "--json").stdout)
    assert [fact["name"] for fact in facts] == maps.names()
    for name in maps.names():
        assert name in listed.stdout


def test_map_counts_as_the_decomposition_does(tmp_path: Path) -> None:
    picture = tmp_path / "room1.png"
    result = sightline("map", "room1", "--json", "--picture", str(picture))
    assert result.exit_code == 0, result.output
    facts = json.loads(result.stdout)
    assert (facts["counts"]["I"], facts["counts"]["N"]) == (49, 26)
    assert picture.read_bytes().startswith(b"\x89PNG")
    aspect = json.loads(sightline("map", "room1", "--decomposition", "aspect", "--json").stdout)
    assert (aspect["counts"]["I"], aspect["counts"]["N"]) == (207, 200)
    assert "counts     V 28" in sightline("map", "room1").stdout


def test_plan_is_a_chain_of_lines_of_sight(tmp_path: Path) -> None:
    picture = tmp_path / "plan.svg"
    arguments = ["plan", "room3", "--base", "10,36", "--agent", "70,10", "--robots", "6", "--picture", str(picture)]
    result = sightline(*arguments, "--json")
    assert result.exit_code == 0, result.output
    plan = json.loads(result.stdout)
    assert plan["relays_needed"] == len(plan["relays"]) == 6 - plan["spares"]
    stations = [plan["base"], *plan["relays"], plan["agents"][0]]
    environment = Environment.load(maps.path("room3"))
    assert all(environment.line_of_sight(tuple(here), tuple(there)) for here, there in pairwise(stations))
    assert plan["links"] == [list(link) for link in pairwise(stations)]
    assert math.isfinite(plan["cost"])
    assert "<svg" in picture.read_text()
    assert "relay 1" in sightline(*arguments).stdout


def test_plan_takes_negative_places_and_geojson(tmp_path: Path) -> None:
    file = tmp_path / "square.geojson"
    file.write_text(json.dumps(SQUARE))
    result = sightline("plan", str(file), "--base", "-3,-4", "--agent", "-4.5,4")
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("0 relays")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["map", "rom1"], ["no map rom1", "did you mean 'room1'"]),
        (["map", "room1", "--picture", "room1.bmp"], ["--picture", ".png"]),
        (["map", "room1", "--picture", "absent/room1.png"], ["--picture", "no folder absent"]),
        (["map", "room1", "--tolerance", "0.1"], ["room1.json: a tolerance of 0.1 m", "leave it out"]),
        (["map", "room1", "--tolerance", "nan"], ["--tolerance nan", "0 to 100 metres"]),
        (["plan", "room1", "--base", "5", "--agent", "8,10"], ["--base: '5' is no place", "X,Y"]),
        (["plan", "room1", "--base", "nan,1", "--agent", "8,10"], ["--base: 'nan,1' is no place"]),
        (
            ["plan", "room1", "--base", "0,0", "--agent", "8,10"],
            ["room1.json: --base [0, 0] is inside a wall", "move it"],
        ),
        (["plan", "room1", "--base", "5,10", "--agent", "0,0"], ["--agent [0, 0] is inside a wall", "move it"]),
        (["plan", "room1", "--base", "5,10", "--agent", "55,15", "--robots", "0"], ["needs", "--robots says 0"]),
        (["plan", "room1", "--base", "5,10", "--agent", "8,10", "--radius", "50"], ["--radius", "smaller"]),
        (["plan", "room1", "--base", "5,10", "--agent", "8,10", "--radius", "9"], ["--radius = 9 leaves no room"]),
        (
            ["plan", "room1", "--base", "5,10", "--agent", "8,10", "--radius", "inf"],
            ["--radius inf", "0 to 100 metres"],
        ),
        (["plan", "room1", "--base", "5,10", "--agent", "8,10", "--radius", "-1"], ["--radius -1.0", "0 to 100"]),
        (["plan", "room1", "--base", "5,10", "--agent", "8,10", "--robots", "-1"], ["--robots -1", "0 to 40"]),
        (["plan", "room1", "--base", "5,10", "--agent", "55,15", "--robots", "1"], ["needs 2 robots, and", "says 1"]),
        (["plan", "room1", "--base", "1e300,1", "--agent", "8,10"], ["--base: '1e300,1' is farther off"]),
        (["plan", "room1", "--base", "1,nan", "--agent", "8,10"], ["--base: '1,nan' is no place"]),
        (["map", "r" * 300], ["no map rrr", "give a map file"]),
        (["map", "ro\nom\x07"], [r"no map ro\nom\x07"]),
        (["run", "a" * 300], ["no scenario aaa", "give a TOML file"]),
        (["run", "office", "--duration", "inf"], ["--duration inf", "from 1 to 86400 seconds"]),
        (["demo", "--duration", "nan"], ["--duration nan", "from 1 to 86400 seconds"]),
        (["simulate", "office", "--duration", "inf"], ["--duration inf", "from 1 to 86400 seconds"]),
        (["simulate", "office", "--duration", "0.5"], ["--duration 0.5", "from 1 to 86400 seconds"]),
        (["simulate", "office", "--seeds", "0"], ["--seeds 0", "from 1 to 10000"]),
        (["simulate", "office", "--seeds", "9" * 400], ["--seeds 999", "from 1 to 10000"]),
        (["run", "offce"], ["no scenario offce", "did you mean 'office'"]),
        (["run", "office", "--name", "../up"], ["--name '../up' cannot name a run"]),
        (["simulate", "absent.toml"], ["no scenario absent.toml", "give a TOML file"]),
        (["simulate", "room1", "--record", "film.mp4"], ["--record film.mp4", ".rrd"]),
        (["goal", "-3;4"], ["X,Y: '-3;4' is no place"]),
        (["goal", "-3,4"], ["there is no run in runs/", "sightline run"]),
        (["goal", "1,1", "--run", "absent"], ["absent is no run", "mission.json"]),
        (["review", "absent"], ["absent is no run", "mission.json"]),
        (["simulate", "office", "--duration", "abc"], ["--duration 'abc' is no number", "simulate --help"]),
        (["run", "office", "--duration", "abc"], ["--duration 'abc' is no number", "run --help"]),
        (["demo", "--duration", ""], ["--duration '' is no number"]),
        (["simulate", "office", "--seeds", "2.5"], ["--seeds '2.5' is no whole number"]),
        (["map", "room1", "--radius", "wide"], ["--radius 'wide' is no number", "map --help"]),
        (["plan", "room1", "--base", "5,10", "--agent", "8,10", "--mu", "\n"], [r"--mu '\n' is no number"]),
        (["study", "localization", "--seeds", "1"], ["--seeds 1 is out of range", "from 2 to 1000"]),
        (["study", "redeployment", "--seed", "-1"], ["--seed -1 is out of range", "at least 0"]),
        (
            ["plan", "room1", "--base", "5,10", "--agent", "8,10", "--method", "best"],
            ["--method: 'best' is not one of 'exact', 'mst'", "give one of them"],
        ),
        (["plan"], ["plan needs MAP; see", "plan --help"]),
        (["plan", "room1"], ["plan needs --base X,Y; see"]),
        (["plan", "room1", "--base"], ["--base", "requires an argument; see sightline plan --help"]),
        (["plan", "room1", "room2", "--base", "5,10", "--agent", "8,10"], ["unexpected extra argument", "room2"]),
        (["map", "--rdius", "1"], ["--rdius", "did you mean --radius?"]),
        (["map", "--json=yes"], ["'--json' does not take a value; see"]),
        (["goal"], ["goal needs X,Y; see"]),
        (["plam"], ["no such command 'plam'; did you mean 'plan'?"]),
    ],
)
def test_a_refusal_is_one_sentence(
    arguments: list[str], words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    said = refusal(*arguments)
    for word in words:
        assert word in said
    assert not (tmp_path / "runs").exists()


def test_simulate_prints_figures_and_json_the_same_twice(scenario: Path, tmp_path: Path) -> None:
    once, again = (json.loads(sightline("simulate", str(scenario), "--json").stdout) for _ in range(2))
    assert once["missions"] == again["missions"]
    assert [mission["seed"] for mission in once["missions"]] == [3]
    recording = tmp_path / "simulated.rrd"
    table = sightline("simulate", str(scenario), "--seeds", "2", "--record", str(recording))
    assert table.exit_code == 0, table.output
    assert "times faster than real time" in table.stdout
    assert recording.stat().st_size > 0


@pytest.mark.parametrize("options", [[], ["--json"]])
def test_robots_that_overlap_are_a_failure(scenario: Path, options: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    collision = Overlap(peers=("robot1", "robot2"), episodes=2, seconds=0.4)
    monkeypatch.setattr("launcher.report.find_overlaps", lambda *_: iter([collision]))
    result = sightline("simulate", str(scenario), "--duration", "2", *options)
    assert result.exit_code == 1
    assert "sightline: failed with seed 3: robot1 and robot2 overlapped 2 times, 0.4 s in all" in result.stderr
    if options:
        assert json.loads(result.stdout)["missions"][0]["failures"] == [
            "robot1 and robot2 overlapped 2 times, 0.4 s in all"
        ]


def test_simulate_refuses_what_cannot_be_run(scenario: Path) -> None:
    scenario.write_text(SCENARIO.replace("[5.0, 10.0]", "[0.0, 0.0]"))
    assert f"{scenario}: base.position [0, 0] is inside a wall" in refusal("simulate", str(scenario))


@pytest.mark.parametrize("study", [["complexity"], ["weights"], ["redeployment"], ["localization"]])
def test_studies_refuse_a_folder_that_cannot_be_made_before_they_work(study: list[str], tmp_path: Path) -> None:
    file = tmp_path / "notes.txt"
    file.write_text("not a folder")
    for output in (file, file / "below"):
        said = refusal("study", *study, "--output", str(output))
        assert f"--output {output}: cannot be made a folder" in said
        assert "name one that you may write to" in said
