"""A team that nobody leads any more, in virtual time: it goes back together, and is led on when somebody can.

Two of five voters are dead from early on; when the base station dies too, the two robots left are no majority.
"""

from __future__ import annotations

import numpy as np

from agents.records import LogLine
from agents.robot import SILENCE_S, Robot
from launcher.fault_timetable import Fault, Kill, Pause, Timetable
from launcher.invariants import Invariants
from planning.connectivity import connected
from protocol.messages import State
from tests.launcher.test_team_motion import Stage, office

FEWER = (Kill(at_s=4.0, who="robot3"), Kill(at_s=4.0, who="robot4"))
GROUP = ("robot1", "robot2")
LEADERLESS_S = 9.0
"""When the base station dies."""
BACK_S = LEADERLESS_S + 0.65 + 10.0
"""When its last orders have run out, and ``retreat_after_s`` has passed."""


def begin(*faults: Fault, dead: tuple[Kill, ...] = FEWER) -> Stage:
    """With all invariants looked for: also that nobody goes back out of turn, or moves otherwise without a leader."""
    stage = Stage(3, *dead, *faults)
    Invariants(stage.mission, stage.team, Timetable(faults=(*dead, *faults)))
    return stage


def body(stage: Stage, name: str) -> State:
    part = stage.team.peers[name].part(Robot)
    assert part is not None and part.state is not None
    return part.state


def places(stage: Stage) -> np.ndarray:
    return np.array([stage.team.peers[name].place for name in GROUP])


def check_network(stage: Stage) -> None:
    """Base station and robots of the group are joined by lines of sight, and apart."""
    base = stage.team.peers["base"].place
    assert connected(office().visibility_matrix(np.vstack([base, places(stage)])))
    assert np.hypot(*np.diff(places(stage), axis=0)[0]) > 0.4 - 1e-6


def run(stage: Stage, until_s: float) -> None:
    while stage.team.time.now_s < until_s:
        stage.run(min(stage.team.time.now_s + 0.1, until_s))
        check_network(stage)


def said(stage: Stage, peer: str) -> list[str]:
    return [record.text for _, name, record in stage.records if name == peer and isinstance(record, LogLine)]


def test_the_group_goes_back_to_where_its_plan_began_and_stays_a_network() -> None:
    stage = begin(Kill(at_s=LEADERLESS_S, who="base"))
    stage.run(4.76)
    check_network(stage)
    run(stage, LEADERLESS_S)
    began = {name: body(stage, name).progress for name in GROUP}
    run(stage, BACK_S - 0.1)
    held = places(stage)
    run(stage, BACK_S + 0.5)
    assert {body(stage, name).mode for name in GROUP} <= {"retreating", "holding"}
    run(stage, BACK_S + 8.0)
    assert np.hypot(*(places(stage) - held).T).min() > 1.0
    for name in GROUP:
        state, before = body(stage, name), began[name]
        assert state.progress is not None and before is not None
        assert (state.progress.plan, state.progress.retreat, state.mode) == (before.plan, 0, "holding")
        assert any("goes back together with" in text for text in said(stage, name))
    assert not [record for _, _, record in stage.records if isinstance(record, LogLine) and record.level == "error"]


def test_all_stand_while_one_of_them_is_silent() -> None:
    silent_s = BACK_S + 1.0
    stage = begin(Kill(at_s=LEADERLESS_S, who="base"), Pause(at_s=silent_s, for_s=4.0, who="robot2"))
    stage.run(silent_s + SILENCE_S + 0.5)
    stand = places(stage)
    assert body(stage, "robot1").mode == "holding"
    run(stage, silent_s + 3.9)
    assert np.array_equal(places(stage), stand)
    assert any(text.endswith("stands until robot2 would too") for text in said(stage, "robot1"))
    run(stage, silent_s + 7.0)
    assert np.hypot(*(places(stage) - stand).T).min() > 0.5


def test_a_leader_that_comes_back_begins_afresh_from_where_they_are() -> None:
    """The others died where they began: a process that begins anew has not heard where else they may be."""
    again_s = BACK_S + 1.5
    dead = tuple(Kill(at_s=0.0, who=kill.who) for kill in FEWER)
    stage = begin(Kill(at_s=LEADERLESS_S, for_s=again_s - LEADERLESS_S, who="base"), dead=dead)
    run(stage, again_s)
    back = [body(stage, name).progress for name in GROUP]
    assert all(progress is not None and progress.retreat is not None for progress in back)
    run(stage, again_s + 8.0)
    for name, before in zip(GROUP, back, strict=True):
        after = body(stage, name).progress
        assert before is not None and after is not None
        assert after.epoch > before.epoch and after.retreat is None and after.finished > 0


def test_a_robot_that_is_cut_off_alone_holds() -> None:
    stage = begin(*(Kill(at_s=LEADERLESS_S, who=who) for who in ("base", "robot2")))
    stage.run(LEADERLESS_S + 1.0)
    stands = stage.team.peers["robot1"].place
    stage.run(BACK_S + 5.0)
    assert stage.team.peers["robot1"].place == stands
    assert said(stage, "robot1")[-1].endswith("stands until robot2 would too")


def test_robots_refuse_a_way_through_one_that_the_leader_cannot_know_to_be_there() -> None:
    """The base station begins anew, and has not heard where the dead robots came to before they died."""
    again_s = BACK_S + 1.5
    stage = begin(Kill(at_s=LEADERLESS_S, for_s=again_s - LEADERLESS_S, who="base"))
    run(stage, again_s + 8.0)
    assert any("but was heard at" in text for name in GROUP for text in said(stage, name))
