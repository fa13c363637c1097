"""``sightline plan`` with robots that are somewhere already: the motion that it answers with."""

from __future__ import annotations

import json
import math
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from launcher import planned_motion
from launcher.cli import app
from launcher.standing_room import overlapping, stand_apart
from planning.certificate import certify
from planning.environment import Environment
from planning.motion import plan_motion
from planning.motion_plan import Schedule, TimedPath

TEAM = ["plan", "room3", "--base", "10,36", "--agent", "75,35", "--agent-from", "70,8", "--idle"]
TEAM += [word for place in ("20.5,33.8", "31.2,33.8", "34.8,15.2", "49.1,9") for word in ("--robot", place)]
ROW = ["plan", "room3", "--base", "10,36", "--agent", "70,10", "--placements", "cells"]
ROW += [word for x in (12, 13, 14, 15, 16) for word in ("--robot", f"{x},36")]


def sightline(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def schedule_of(facts: dict[str, Any]) -> Schedule:
    ways = facts["motion"]["schedule"]
    return Schedule(
        [way["member"] for way in ways],
        [TimedPath(way["waypoints"], way["times_s"]) for way in ways],
        [way["radius_m"] for way in ways],
        facts["motion"]["speed_m_s"],
        [way["stages"] for way in ways],
    )


def test_the_schedule_in_json_is_a_certified_one_to_the_deployment() -> None:
    result = sightline(*TEAM, "--speed", "1.5", "--json")
    assert result.exit_code == 0, result.output
    facts = json.loads(result.stdout)
    motion, schedule = facts["motion"], schedule_of(facts)
    assert motion["certified"]
    assert motion["violations"] == []
    assert schedule.members[:3] == ("base", "agent", "robot 1")
    assert {"base", "agent"} <= {*motion["joined"]}
    room3 = Environment.load(facts["map"])
    assert certify(schedule, room3, ends=motion["joined"]).valid
    starts = [facts["base"], [70.0, 8.0], *(robot["from"] for robot in facts["robots"])]
    ends = [facts["base"], *facts["agents"], *(robot["to"] or robot["from"] for robot in facts["robots"])]
    assert np.allclose(schedule.positions([0.0])[0], starts)
    assert np.allclose(schedule.positions([schedule.end_s])[0], ends)
    assert motion["duration_s"] == pytest.approx(schedule.end_s)
    assert sum(move["length_m"] for move in motion["moves"]) == pytest.approx(motion["length_m"])
    assert all(move["length_m"] <= 1.5 * (move["end_s"] - move["begin_s"]) + 1e-6 for move in motion["moves"])


def test_words_and_pictures_of_a_motion(tmp_path: Path) -> None:
    files = [tmp_path / "plan.svg", tmp_path / "pair.svg"]
    result = sightline(*TEAM, "--picture", str(files[0]), "--diagram", "agent-4", str(files[1]))
    assert result.exit_code == 0, result.output
    assert "  certified base, agent, " in result.stdout
    assert "are one network throughout, and no discs overlap, whoever is late" in result.stdout
    for name in ("agent", "robot 4"):
        assert f"  {name:9} " in result.stdout
    assert f"Diagram: {files[1]}" in result.stdout
    assert "<!-- lines of sight before -->" in files[0].read_text(encoding="utf-8")
    assert "robot 4: metres of its" in files[1].read_text(encoding="utf-8")


def test_a_team_that_has_to_part_is_told_and_ends_with_2(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(planned_motion, "plan_motion", partial(plan_motion, effort=1))
    result = sightline(*ROW, "--picture", str(tmp_path / "best.svg"))
    assert result.exit_code == 2
    assert result.stderr.startswith("sightline: ")
    assert result.stderr.count("\n") == 1
    assert " part at " in result.stderr
    assert "Motion: best effort" in result.stdout
    assert "  broken    for " in result.stdout
    assert (tmp_path / "best.svg").exists(), "the best effort"
    facts = json.loads(sightline(*ROW, "--json").stdout)["motion"]
    assert facts["way"] == "parted"
    assert not facts["certified"]
    assert facts["break_s"] > 0.0
    assert facts["between"] is not None


def test_of_a_base_that_sees_nobody_nothing_is_said_to_be_certified() -> None:
    places = ("75,35", "76,33", "70,12", "49,9", "60,6")
    robots = [word for place in places for word in ("--robot", place)]
    result = sightline("plan", "room3", "--base", "10,36", "--agent", "70,10", *robots)
    assert (
        "\n  certified no discs overlap, whoever is late; nothing of sight, as the base sees nobody before\n"
        in result.stdout
    )


def test_robots_that_are_sent_to_one_place_stand_beside_each_other() -> None:
    places = ("12,36", "31,33", "35,15", "60,6", "62,6", "63,7")
    robots = [word for place in places for word in ("--robot", place)]
    asked = ["plan", "room3", "--base", "10,36", "--agent", "70,10", *robots, "--mu", "50", "--json"]
    facts = json.loads(sightline(*asked).stdout)
    assert facts["crowds"]
    schedule = schedule_of(facts)
    ends = schedule.positions([schedule.end_s])[0]
    assert not [*overlapping(ends, schedule.radii_m)]
    sent = [facts["base"], *facts["agents"], *(robot["to"] for robot in facts["robots"])]
    assert max(math.dist(end, goal) for end, goal in zip(ends, sent, strict=True)) < 3.0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            ["--diagram", "1-9", "d.svg"],
            "--diagram: '1-9' is no pair; write A-B with two of base, agent, 1, 2, 3, 4",
        ),
        (["--diagram", "base-agent", "d.svg"], "base stays where it is; choose two of agent, "),
        (["--diagram", "1-2", "d.bmp"], "--diagram d.bmp: cannot draw '.bmp'"),
        (["--agent-from", "70,9"], "--agent-from is given 2 times for 1 agent"),
        (["--robot", "20.8,33.8"], "overlaps --robot"),
        (["--agent-from", "0,0", "--agent", "74,35"], "--agent-from [0, 0] is inside a wall"),
    ],
)
def test_motions_that_cannot_be_asked_for(options: list[str], words: str) -> None:
    result = sightline(*TEAM, *options)
    assert result.exit_code == 2, (result.output, result.exception)
    assert result.stderr.startswith("sightline: ")
    assert words in result.stderr


def test_a_diagram_needs_robots() -> None:
    result = sightline(*TEAM[:6], "--diagram", "base-agent", "d.svg")
    assert result.exit_code == 2
    assert "give --robot X,Y" in result.stderr


def test_standing_apart_moves_nobody_who_has_room() -> None:
    places = np.array([(0, 0), (0.1, 0), (0.1, 0), (5, 5), (0, 0.3)], dtype=float)
    radii = np.array([0.0, 0.2, 0.2, 0.2, 0.2])
    found = stand_apart(places, [0, 4], radii, lambda _row, place, _chosen: bool(place[0] >= 0.0))
    np.testing.assert_array_equal(found[[0, 3, 4]], places[[0, 3, 4]])
    assert not [*overlapping(found, radii)]
    assert (found[:, 0] >= 0.0).all()
    assert np.linalg.norm(found - places, axis=1).max() < 1.5
    stuck = stand_apart(places, [0, 4], radii, lambda *_: False)
    np.testing.assert_array_equal(stuck, places)
    assert [*overlapping(stuck, radii)] == [(1, 2), (1, 4), (2, 4)]


def test_agents_are_as_large_as_there_is_room_for() -> None:
    agents = ["--agent", "30,45", "--agent", "30.1,45", "--agent", "30,44.5"]
    facts = json.loads(sightline("plan", "room3", "--base", "10,36", *agents, "--robot", "20,34", "--json").stdout)
    schedule = schedule_of(facts)
    assert schedule.radii_m[0] == 0.0
    assert schedule.radii_m[1:4] == pytest.approx([0.05, 0.05, 0.2])
    assert facts["motion"]["certified"]
