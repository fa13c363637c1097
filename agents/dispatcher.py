"""The dispatcher of the team's motion: begins plans at a standstill, goes on with them, and begins afresh when it must.

A plan goes on for as long as all robots that are heard have accepted it. It ends when a robot is lost or heard anew,
refuses, or knows nothing of it any more. Then everybody is told to hold; when all that are heard say that they stand,
the next plan begins from there.

A robot that is lost may still go as far as was released; then it stands. Its way until there is in the way of others.
If all robots of a plan are lost, they may go back together (:mod:`agents.retreat`): so is all their way until there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from agents.movement_authority import MovementAuthority, Onset
from agents.records import Advance
from planning.foresight import distance
from protocol.messages import Authority, Motion, Point, State

if TYPE_CHECKING:
    from agents.motion_planner import Course

Floats = NDArray[np.float64]

STILL_M_S: Final = 1e-6
"""Slower than this is standing."""

HORIZON_S: Final = 0.3
"""Stages are released that begin so long after the one that the slowest robot is in."""

NEAR: Final = 1.1
"""Ways of lost robots keep so many times from others what discs that touch do."""

PATIENCE_S: Final = 2.0
"""A robot that is heard, and has not accepted a revision for so long, does not know the plan. One that has not answered
an order to hold for so long does not hear the leader."""


class Dispatcher:
    """See the module.

    Args:
        base: name of the base station.
        position: where it stands, metres, map frame.
        whereabouts: where each robot of the roster may be while nothing is heard of it.
        epoch: of the leader's authority.
        robot_radius_m: of all robots.
    """

    def __init__(
        self,
        base: str,
        position: Point,
        whereabouts: Mapping[str, Sequence[Point]],
        epoch: int,
        robot_radius_m: float,
    ) -> None:
        self._base, self._position, self._epoch = base, position, epoch
        self._radius_m = robot_radius_m
        self._authority: MovementAuthority | None = None
        self._ended: MovementAuthority | None = None
        """The last one, as long as there is no other."""
        self._heading: Mapping[str, Point] = {}
        self._adrift: set[str] = set()
        """Robots that were lost on their way in the last plan."""
        self._plan = 0
        """Number of the present plan, or of the next."""
        self._asked = False
        """Whether a motion of that plan has been asked for."""
        self._held: Authority | None = None
        """The first order to hold since the last plan ended."""
        self._held_s = 0.0
        self._heard_s: dict[str, float] = {}
        """Since when each robot that speaks has been heard without a break."""
        self._ordered: Authority | None = None
        """The first order of the present revision."""
        self._ordered_s = 0.0
        self._lost: dict[str, Floats] = {name: np.array(places).reshape(-1, 2) for name, places in whereabouts.items()}
        self._states: dict[str, State] = {}
        self.reports: list[str] = []
        """Why plans have ended; whoever reads it empties it."""
        self.forgotten = False
        """Whether a plan has ended since a robot knows nothing of it any more: the next need not wait until it is due,
        as it must where a plan is refused, and the next may be, too. Whoever reads it resets it."""
        self.news = False
        """Whether there is more to order than was ordered last."""
        self._due = False
        """Whether more may be released than was when that was looked at last."""
        self._permitted = True

    @property
    def motion(self) -> Motion | None:
        """What to order; None: to hold."""
        return None if self._authority is None else self._authority.motion

    @property
    def pressing(self) -> bool:
        """Whether somebody has yet to hear of the last order."""
        if self._authority is None:
            return bool(self._states) and not self._all_stand()
        return bool(self._authority.undecided)

    @property
    def advance(self) -> Advance | None:
        """How far the motion under way is; None if everybody holds."""
        return None if self._authority is None else self._authority.advance()

    @property
    def heading(self) -> Mapping[str, Point]:
        """Where the motion under way leads; empty if to no goals."""
        return self._heading

    @property
    def lost(self) -> dict[str, Floats]:
        """Where robots may be that are not heard, (m, 2) each, metres."""
        return {name: way for name, way in self._lost.items() if len(way)}

    def said(self, authority: Authority, now_s: float) -> bool:
        """Note under which authority what is to be ordered has been; whether it was the first order of a revision."""
        self.news = False
        if self._authority is None:
            if self._held is None:
                self._held, self._held_s = authority, now_s
        elif self._ordered is None:
            self._ordered, self._ordered_s = authority, now_s
            return True
        return False

    def hear(self, robot: str, state: State, now_s: float) -> None:
        """Learn from a robot of the roster where and how far it is."""
        before = self._states.get(robot)
        self._states[robot] = state
        if before is None:
            self._heard_s[robot] = now_s
            del self._lost[robot]
            self._adrift.discard(robot)
            self._begin_afresh("")
        elif self._authority is not None:
            self._judge(self._authority, robot, before, state, now_s)

    def lose(self, robot: str) -> None:
        """Do without a robot of the roster."""
        state = self._states.pop(robot)
        way = [state.position]
        authority = self._authority or self._ended
        if authority is not None and robot in authority.robots and _plan(state) == (self._epoch, authority.motion.plan):
            way += [place for place in authority.way(robot) if place != state.position]
            self._adrift.add(robot)
        elif _turned(state):
            way += state.path
        self._lost[robot] = np.array(way)
        self._begin_afresh("")

    def deaf(self, now_s: float) -> tuple[str, ...]:
        """Robots that have spoken for :data:`PATIENCE_S`, and have not said that they have heard the order to hold.

        That order has stood for as long: who is heard first while it does has as much time to answer as all others.
        """
        held = self._held
        if self._authority is not None or held is None:
            return ()
        return tuple(
            robot
            for robot, state in self._states.items()
            if now_s - max(self._held_s, self._heard_s[robot]) > PATIENCE_S and not has_heard(state, held)
        )

    def permit(self, permitted: bool) -> None:
        """Say whether more of the motion may be released: not before the tree that it leads to is in force."""
        self._due = self._due or permitted
        self._permitted = permitted

    def release(self) -> None:
        """Let the robots go on as far as is due."""
        if not self._permitted:
            return
        if self._authority is not None and self._due and self._authority.release(HORIZON_S):
            self.news = True
        self._due = False

    @property
    def lead_s(self) -> float:
        """How long it is until the robots are at the onset."""
        return 0.0 if self._authority is None else self._authority.lead_s()

    def onset(self) -> Onset | None:
        """Where the next motion can begin if no more is released; None: as soon as everybody stands."""
        if self._authority is not None:
            self._authority.prune()
            return self._authority.onset()
        if not self._all_stand():
            return None
        self._settle_lost()
        places = {self._base: self._position} | {name: state.position for name, state in self._states.items()}
        self._asked = True
        return Onset(self._plan, 0, 0, places)

    def take(self, course: Course) -> bool:
        """Order a motion, unless the plan that it belongs to has ended or nobody would move; whether it is taken."""
        motion, known = course.motion, self._authority
        if motion.plan != self._plan or (known is not None and known.over and not _moves(motion)):
            return False
        if known is None:
            self._authority = MovementAuthority(self._epoch, motion, list(course.option.goals))
            self._held = self._ended = None
            self._adrift.clear()
        else:
            known.revise(motion)
        self._heading = course.option.goals if course.arrives else {}
        self._ordered, self.news, self._due = None, True, True
        return True

    def _judge(self, authority: MovementAuthority, robot: str, before: State, state: State, now_s: float) -> None:
        """Take a report to account, or end the plan if it contradicts."""
        if state.progress is not None and authority.hear(robot, state.progress):
            self._due = True
        ours = (self._epoch, self._plan)
        if _plan(before) == ours and (_plan(state) != ours or _turned(state)):
            self._begin_afresh(f"{robot} does not follow plan {self._plan} any more")
            self.forgotten = True
        elif self._ordered is None or robot not in authority.undecided:
            return
        elif state.refusing and has_heard(state, self._ordered):
            revision = authority.motion.revision
            self._begin_afresh(f"{robot} refuses revision {revision} of plan {self._plan}: {state.refusing}")
        elif now_s - self._ordered_s > PATIENCE_S:
            self._begin_afresh(f"{robot} has not accepted a revision for {PATIENCE_S:g} s")

    def _begin_afresh(self, why: str) -> None:
        if why:
            self.reports.append(f"{why}: everybody holds, then a new plan begins")
        self.news = True
        if self._authority is not None:
            self._ended, self._authority, self._held = self._authority, None, None
        self._ordered, self._heading = None, {}
        self._plan += self._asked  # what is being planned is out of date
        self._asked = False

    def _settle_lost(self) -> None:
        """Where others stand no lost robot does: then it is where it was heard last, or elsewhere.

        Robots go back only if all robots of their plan do; those that are heard stand, and have forgotten it.
        """
        ended = self._ended
        if ended is not None and len(ended.robots) > 1 and self._adrift.issuperset(ended.robots):
            for name in ended.robots:
                self._lost[name] = np.vstack([self._lost[name], ended.way_back(name)])
            self._adrift.clear()
        standing = np.array([state.position for state in self._states.values()]).reshape(-1, 2)
        for name, way in self._lost.items():
            if distance(way, standing) < NEAR * 2 * self._radius_m:
                self._lost[name] = way[:1] if distance(way[:1], standing) > 2 * self._radius_m else way[:0]

    def _all_stand(self) -> bool:
        held = self._held
        return held is not None and all(_stands(state, held) for state in self._states.values())


def _moves(motion: Motion) -> bool:
    """Whether anybody that is scheduled does."""
    return any(way.scheduled and len(way.waypoints) > 1 for way in motion.ways)


def _stands(state: State, since: Authority) -> bool:
    """Whether a robot says that it stands and follows no motion, having heard a command."""
    return state.progress is None and has_heard(state, since) and math.hypot(*state.velocity) < STILL_M_S


def _plan(state: State) -> tuple[int, int] | None:
    return None if state.progress is None else (state.progress.epoch, state.progress.plan)


def _turned(state: State) -> bool:
    """Whether a robot goes back, or would."""
    return state.progress is not None and state.progress.retreat is not None


def has_heard(state: State, authority: Authority) -> bool:
    """Whether a robot says that it has heard a command, or a later one."""
    heard = state.obeying
    return heard is not None and (heard.epoch, heard.sequence) >= (authority.epoch, authority.sequence)
