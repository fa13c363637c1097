"""What robots say of themselves is held against what was ordered and where they are, by hand-made plans and places."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import pytest

from launcher.order_rules import MotionRules
from launcher.violation import Violation
from protocol.messages import (
    Authority,
    Deployment,
    Envelope,
    MemberWay,
    Motion,
    Point,
    Progress,
    State,
    Warrant,
)

STAGES = 4
"""Of 1 m each."""


@dataclass
class Peer:
    """What the rules see of a peer."""

    name: str
    place: Point = (0.0, 0.0)

    def part(self, _: type[object]) -> None:
        """It has no mind."""


class Team:
    """Robots side by side that say what they are told to."""

    def __init__(self, *names: str) -> None:
        self.peers = {name: Peer(name) for name in ("base", *names)}
        self.rules = MotionRules(cast(Any, self.peers))

    def hear(self, name: str, body: Deployment | State, incarnation: int = 1) -> None:
        envelope = Envelope(sender=name, incarnation=incarnation, sequence=0, sent_at_s=0.0, body=body)
        self.rules.hear(cast(Any, self.peers[name]), envelope)

    def order(self, epoch: int, *, released: int = STAGES - 1, **starts_m: float) -> None:
        """A plan in which every member drives a metre a stage, from where it starts."""
        ways = tuple(
            MemberWay(
                member=name,
                radius_m=0.1,
                speed_m_s=1.0,
                waypoints=tuple((start_m + stage, 0.0) for stage in range(STAGES + 1)),
                stages=tuple(range(STAGES + 1)),
            )
            for name, start_m in starts_m.items()
        )
        motion = Motion(plan=0, revision=0, first_stage=0, released=released, ways=ways, connection="none")
        deployment = Deployment(
            authority=Authority(epoch=epoch, leader="base", sequence=epoch),
            warrant=Warrant(lease_s=1.0, marks=()),
            decision=1,
            placements=(),
            edges=(),
            cost=0.0,
            relays_needed=0,
            reason="",
            motion=motion,
        )
        self.hear("base", deployment)

    def stand(
        self, name: str, x_m: float, epoch: int, finished: int, *, y_m: float = 0.0, incarnation: int = 1
    ) -> None:
        """A robot says that it stands there, so far in its plan."""
        self.peers[name].place = (x_m, y_m)
        progress = Progress(epoch=epoch, plan=0, revision=0, finished=finished)
        state = State(position=(x_m, y_m), velocity=(0.0, 0.0), mode="holding", progress=progress)
        self.hear(name, state, incarnation)


@pytest.mark.parametrize("finished", [0, 1])
def test_who_goes_on_to_another_plan_has_still_finished_its_stages(finished: int) -> None:
    """One stands in the middle of stage 2, cut off; then it has to wait for the other's stage 0, and for no more."""
    team = Team("robot1", "robot2")
    team.order(1, robot1=0.0, robot2=0.0)
    team.stand("robot2", float(finished), 1, finished)
    team.order(2, robot2=float(finished))
    team.stand("robot2", float(finished), 2, 0)
    if finished:
        team.stand("robot1", 2.5, 1, 2)
        return
    with pytest.raises(Violation, match="robot1 is in stage 2, robot2 has finished 0") as broken:
        team.stand("robot1", 2.5, 1, 2)
    assert broken.value.rule == "nobody is two stages ahead"


def test_what_was_finished_in_one_plan_is_not_finished_in_the_next() -> None:
    team = Team("robot1", "robot2")
    team.order(1, robot1=0.0, robot2=0.0)
    for name in ("robot1", "robot2"):
        team.stand(name, 3.0, 1, 3)
    team.order(2, robot1=3.0, robot2=3.0)
    team.stand("robot2", 3.0, 2, 0)
    with pytest.raises(Violation, match="robot1 is in stage 2, robot2 has finished 0"):
        team.stand("robot1", 5.5, 2, 2)


@pytest.mark.parametrize(
    ("rule", "x_m", "y_m", "epoch", "finished"),
    [
        ("motions accepted were ordered", 0.0, 0.0, 2, 0),
        ("nobody goes back", 0.0, 0.0, 1, 0),
        ("everybody is on their way", 1.5, 0.1, 1, 1),
        ("everybody is on their way", 2.5, 0.0, 1, 1),
        ("nobody goes beyond what is released", 3.5, 0.0, 1, 3),
    ],
)
def test_who_is_not_where_it_may_be_is_found(rule: str, x_m: float, y_m: float, epoch: int, finished: int) -> None:
    """After it has stood at the end of stage 0; three stages of four are released."""
    team = Team("robot1")
    team.order(1, released=STAGES - 2, robot1=0.0)
    team.stand("robot1", 1.0, 1, 1)
    with pytest.raises(Violation) as broken:
        team.stand("robot1", x_m, epoch, finished, y_m=y_m)
    assert broken.value.rule == rule


def test_nobody_follows_a_motion_without_a_way_of_its_own() -> None:
    team = Team("robot1", "robot2")
    team.order(1, robot1=0.0)
    with pytest.raises(Violation) as broken:
        team.stand("robot2", 0.0, 1, 0)
    assert broken.value.rule == "motions accepted are one's own"


def test_another_process_may_begin_again() -> None:
    team = Team("robot1")
    team.order(1, robot1=0.0)
    team.stand("robot1", 2.0, 1, 2)
    team.stand("robot1", 0.0, 1, 0, incarnation=2)
