"""The peers of a team compute their map once, and find what they need of it on disk from then on."""

from __future__ import annotations

import math
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

import maps
from agents.casting import Casting
from agents.leader import PlacementKind
from agents.mission import Mission, RosterEntry
from agents.whereabouts import announce
from planning.environment import Environment
from planning.geodesic import GeodesicMap
from protocol.messages import Point

ROBOTS = {"robot1": (3.0, 9.0), "robot2": (3.0, 10.0), "robot3": (3.0, 11.0)}
GOAL = (31.0, 12.5)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SIGHTLINE_CACHE", str(tmp_path / "maps"))
    return tmp_path / "maps"


@pytest.fixture
def office() -> Environment:
    return Environment.load(maps.path("office"))


@pytest.fixture
def team(mission: Mission) -> Mission:
    roster = [
        RosterEntry(name="base", role="base_station", start=(1.5, 11.0)),
        RosterEntry(name="agent", role="tracked_agent", start=(4.5, 10.5)),
        *(RosterEntry(name=name, role="robot", start=start) for name, start in ROBOTS.items()),
    ]
    return structs.replace(mission, roster=tuple(roster), agent_radius_m=0.25)


def forbid_computing(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("computed again")

    monkeypatch.setattr(Environment, "inflated", refuse)
    for module, name in (
        ("compiled_map", "decompose"),
        ("mutual_visibility", "_find_visible"),
        ("placement_graph", "choose_points"),
        ("geodesic", "_join_corners"),
        ("geodesic_table", "_find_legs"),
    ):
        monkeypatch.setattr(import_module(f"planning.{module}"), name, refuse)


@pytest.mark.parametrize("placements", ["cells", "points"])
def test_a_second_start_computes_nothing_of_the_map(
    placements: PlacementKind, folder: Path, office: Environment, team: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And plans and drives the same."""
    mission = structs.replace(team, placements=placements)
    names = [entry.name for entry in mission.roster]
    first = Casting(mission, office)
    for name in names:
        first.cast(name)
    plan = first.planner().plan(announce([GOAL]), ROBOTS, None)
    with monkeypatch.context() as patch:
        forbid_computing(patch)
        for name in names:  # each a process of its own, with nothing but the mission and the map
            Casting(mission, office).cast(name)
        assert Casting(mission, office).planner().plan(announce([GOAL]), ROBOTS, None) == plan


def test_peers_share_the_spaces_that_they_drive_in(folder: Path, office: Environment, team: Mission) -> None:
    """Two radii with the clearance of bodies, and the one that the agent finds its ways in; not one for every start."""
    for entry in team.roster[1:]:
        Casting(team, office).cast(entry.name)
    assert len(list(folder.glob("free-*.npz"))) == 3
    assert len(list(folder.glob("corners-*.npz"))) == 1


@pytest.mark.parametrize(("start", "ends_at"), [((1.0, 2.0), 4.0 - math.sqrt(0.25 - 0.04)), ((8.0, 2.0), 9.5)])
def test_a_robot_stays_in_its_own_part_of_the_map(start: Point, ends_at: float, folder: Path, mission: Mission) -> None:
    """Two rooms and a door that it does not fit through; the base station is in the left one."""
    rooms = Environment(
        [(0, 0), (4, 0), (4, 1.8), (6, 1.8), (6, 0), (10, 0), (10, 4), (6, 4), (6, 2.2), (4, 2.2), (4, 4), (0, 4)]
    )
    roster = (*mission.roster[:2], RosterEntry(name="robot1", role="robot", start=start))
    _, driver = Casting(structs.replace(mission, roster=roster, robot_radius_m=0.5), rooms).cast("robot1")
    driver.advance(0.0)
    driver.drive((1.0, 0.0), 20.0)
    driver.advance(20.0)
    assert driver.pose() == pytest.approx((ends_at, 2.0), abs=2e-3)


def test_a_folder_that_cannot_be_written_to_changes_nothing(
    office: Environment, team: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    plans = []
    for chosen in (None, "/dev/null/maps"):
        if chosen is not None:
            monkeypatch.setenv("SIGHTLINE_CACHE", chosen)
        casting = Casting(team, office)
        for name in ("agent", "robot1"):
            casting.cast(name)
        plans.append(casting.planner().plan(announce([GOAL]), ROBOTS, None))
    assert plans[0] == plans[1]


def test_paths_are_those_of_the_space_as_it_is_inflated_afresh(
    folder: Path, office: Environment, team: Mission
) -> None:
    planner = Casting(team, office).planner()
    geodesics = GeodesicMap(office.inflated(0.2, containing=(1.5, 11.0)))
    for start in ROBOTS.values():
        np.testing.assert_array_equal(planner.graph.geodesics.path(start, GOAL), geodesics.path(start, GOAL))
