"""Going back the way that one has come, stage by stage, with all others of the motion or not at all.

Where a motion is certified it is so wherever in two successive stages its members are (:mod:`planning.motion_plan`),
whichever way they go. So it can be undone, under the rule of progress in a mirror:

    nobody goes back into stage n before all have gone back through stage n + 2.

Who has come farthest goes first, and no relay leaves before those beyond it have passed.

Two things have to be certain, and neither can be had without hearing the others:

- Nobody still goes forward, on the strength of what another is about to undo. So a robot *turns* before it moves: it
  says so, and from then on goes forward no more in this plan. Nobody moves before all have said it.
- Everybody is where the rule supposes. Who is not heard any more, or follows another plan, may be anywhere: then all
  stand. So do robots that were cut off one by one: they have nobody to go back with.

What is not heard only makes robots stand; a word that comes late says less than is true, as everybody only goes back.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Sequence
from itertools import groupby
from typing import Final

from agents.path_follower import ASTRAY_M, PASSED_M, STANDING, Leg, distance_off
from protocol.messages import Point, Progress

MEMORY: Final = 200
"""Stages that a robot remembers of its own way."""


class Retreat:
    """One robot's way back in one plan.

    Args:
        plan: epoch and number of the plan.
        others: all that took part in its motion, but this robot and those that never move. If these are none it stands.
        stage: it is not beyond the beginning of this stage, or in the one before.
        pieces: its ways through the stages before that one, the latest first, each from where it is, or the stage's
            end, to the stage's beginning.
        position: where it is now.
        speed_m_s: of its way back.
        silence_s: who is not heard for so long is not there.
    """

    def __init__(
        self,
        plan: tuple[int, int],
        others: Collection[str],
        *,
        stage: int,
        pieces: Sequence[Sequence[Point]],
        position: Point,
        speed_m_s: float,
        silence_s: float,
    ) -> None:
        self.stage = stage
        """What it says: it is not beyond the beginning of this stage, and never will be again in this plan."""
        self.others = tuple(sorted(others))
        """Whom it goes back with; if none it stands."""
        self._plan = plan
        self._pieces = deque(deque(piece) for piece in pieces)
        self._from = position
        """Where the straight begins that it is on."""
        self._speed_m_s = speed_m_s
        self._silence_s = silence_s
        self._heard: dict[str, tuple[int, float]] = {}
        """Of each that has turned: the stage that it is not beyond, and when it said so."""
        self._left: set[str] = set()
        """Others that have forgotten the plan. They do not come back to it."""

    @property
    def ahead(self) -> tuple[Point, ...]:
        """Waypoints of the way back, as far as it is remembered."""
        places = (place for piece in self._pieces for place in piece)
        return tuple(place for place, _ in groupby(places))

    def hear(self, member: str, progress: Progress | None, now_s: float) -> None:
        """Learn from another member's state where it is."""
        if member not in self.others:
            return
        if progress is None or (progress.epoch, progress.plan) > self._plan:
            self._left.add(member)
        elif (progress.epoch, progress.plan) == self._plan and progress.retreat is not None:
            before, _ = self._heard.get(member, (progress.retreat, now_s))
            self._heard[member] = min(before, progress.retreat), now_s

    def missing(self, now_s: float) -> tuple[str, ...]:
        """Others without whom nobody goes back: who have not turned, are not heard, or have left the plan."""
        return tuple(
            name
            for name in self.others
            if name in self._left or name not in self._heard or now_s - self._heard[name][1] > self._silence_s
        )

    def steer(self, position: Point, now_s: float) -> Leg:
        """The leg to drive from here, which does not go beyond the stage that it may be in."""
        while self._pieces and self._may_enter(self.stage - 1, now_s):
            piece = self._pieces[0]
            if not piece:
                self._pieces.popleft()
                self.stage -= 1
                continue
            distance_m = math.dist(position, piece[0])
            if distance_m >= PASSED_M:
                if distance_off(self._from, piece[0], position) > ASTRAY_M:
                    return STANDING
                scale = self._speed_m_s / distance_m
                return Leg(
                    ((piece[0][0] - position[0]) * scale, (piece[0][1] - position[1]) * scale),
                    distance_m / self._speed_m_s,
                )
            self._from = piece.popleft()
        return STANDING

    def _may_enter(self, stage: int, now_s: float) -> bool:
        return (
            len(self.others) > 0
            and not self.missing(now_s)
            and all(beginning <= stage + 2 for beginning, _ in self._heard.values())
        )
