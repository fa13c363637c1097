"""A judge of motions believes nothing that it can know better, and certifies the rest."""

from __future__ import annotations

import re
from typing import Any

import pytest
from msgspec import structs

from agents.certificate_judge import Judge, certificate_judge
from agents.mission import Mission
from agents.motion_message import to_schedule
from planning.environment import Environment
from planning.motion_plan import Schedule
from protocol.messages import MemberWay, Motion, Point


@pytest.fixture
def judge(mission: Mission, corner: Environment) -> Judge:
    return certificate_judge(mission, corner)


def way(member: str, *waypoints: Point, stages: tuple[int, ...] = (0, 0, 0), **different: Any) -> MemberWay:
    given: dict[str, Any] = {"radius_m": 0.2, "speed_m_s": 1.0, "scheduled": True} | different
    return MemberWay(member=member, waypoints=waypoints, stages=stages, **given)


BASE = way("base", (1.0, 1.0))
FIRST = way("robot1", (2.0, 2.0), (4.0, 2.0), (4.0, 4.0), stages=(0, 1, 2))
SECOND = way("robot2", (2.0, 3.0), (2.0, 8.0), stages=(0, 0, 1))
AGENT = way("agent", (1.0, 2.0), (1.0, 9.0), stages=(0, 1, 1), radius_m=0.0, speed_m_s=9.0, scheduled=False)
PILLAR = Environment([(0, 0), (10, 0), (10, 10), (0, 10)], [[(3, 3), (7, 3), (7, 7), (3, 7)]], name="pillar")


def motion(*ways: MemberWay, **different: Any) -> Motion:
    given: dict[str, Any] = {
        "plan": 1,
        "revision": 2,
        "first_stage": 5,
        "released": 4,
        "connection": "team",
    } | different
    return Motion(ways=ways, **given)


def test_a_good_motion_is_certified(judge: Judge) -> None:
    assert judge(motion(BASE, FIRST, SECOND)) == ""
    assert judge(motion(BASE, FIRST, SECOND, AGENT, connection="joined", joined=("base", "robot1"))) == ""


@pytest.mark.parametrize(
    ("ways", "text"),
    [
        ((FIRST, SECOND), "base is not in the motion"),
        ((BASE, FIRST, way("robot3", (3.0, 1.0))), "robot3 is not on the roster"),
        ((BASE, structs.replace(FIRST, radius_m=0.1)), "robot1 has a radius of 0.1 m"),
        ((BASE, FIRST, way("robot2", (3.0, 1.0), radius_m=0.0, scheduled=False)), "robot2 has a radius of 0 m"),
        ((BASE, structs.replace(FIRST, speed_m_s=1.1)), "robot1 is to go 1.1 m/s, and can go 1 m/s"),
        ((way("base", (1.0, 1.1)), FIRST), r"base is not where it stands, at \(1, 1\)"),
        ((way("base", (1.0, 1.0), (2.0, 1.0), stages=(0, 1, 1)), FIRST), "base is not where it stands"),
        ((BASE, FIRST, structs.replace(AGENT, scheduled=True)), "agent waits for nobody"),
        ((BASE, FIRST, FIRST), "two ways"),
        ((BASE, way("robot1", (2.0, 2.0), stages=(0, 0))), "robot1 has 1 stages"),
        ((BASE, structs.replace(FIRST, waypoints=((2.0, 2.0), (4.0, 2.0), (4.0, 9.9)))), "nearer than 0.2 m to a wall"),
        ((BASE, FIRST, way("robot2", (3.0, 2.0))), "robot1 and robot2|robot2 and robot1"),
        ((BASE, FIRST, way("robot2", (4.0, 3.0), (8.0, 3.0), stages=(0, 0, 1))), "robot1 and robot2|robot2 and robot1"),
    ],
)
def test_what_contradicts_the_mission_or_breaks_a_rule_is_refused_in_words(
    judge: Judge, ways: tuple[MemberWay, ...], text: str
) -> None:
    assert re.search(text, judge(motion(*ways)))


def test_only_the_connection_that_is_asked_for_is_judged(mission: Mission) -> None:
    judge = certificate_judge(mission, PILLAR)
    behind = way("robot2", (9.0, 9.0))  # of the pillar, seen from the base station
    joined = motion(BASE, way("robot1", (8.5, 1.0)), behind)
    parted = motion(BASE, way("robot1", (1.0, 2.0)), behind)
    assert judge(joined) == ""
    assert "parted" in judge(parted)
    assert judge(structs.replace(parted, connection="none")) == ""
    assert judge(structs.replace(parted, connection="joined", joined=("base", "robot1"))) == ""
    assert "parted" in judge(structs.replace(parted, connection="joined", joined=("base", "robot2")))
    assert judge(structs.replace(parted, connection="joined", joined=("base",))) == ""


def test_who_is_to_be_joined_takes_part(judge: Judge) -> None:
    assert "robot9" in judge(motion(BASE, FIRST, connection="joined", joined=("base", "robot9")))
    assert "itself" in judge(motion(BASE, FIRST, connection="joined", joined=("base", "base", "robot1")))


def test_the_same_is_judged_once(mission: Mission, corner: Environment, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def count(motion: Motion) -> Schedule:
        asked.append(motion)
        return to_schedule(motion)

    monkeypatch.setattr("agents.certificate_judge.to_schedule", count)
    judge = certificate_judge(mission, corner)
    for _ in range(3):
        assert judge(motion(BASE, FIRST, SECOND)) == ""
        assert judge(motion(BASE, SECOND, FIRST)) == ""
    assert len(asked) == 2
