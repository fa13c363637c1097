"""What a peer that moves tells of itself: to the others, and into the recording."""

from __future__ import annotations

import math

from agents.mission import Mission
from agents.records import Track
from agents.rhythm import EARLY_S, Rhythm
from agents.role import Effect, Publish, Record
from protocol.messages import Heartbeat, Intent, RoleName, State


def silence_s(control_hz: float) -> float:
    """Who has not recorded where it is for so long was not there."""
    return max(1.0, 3.0 / control_hz)


class SelfReport:
    """Two rhythms: where the body is, at ``control_hz``, and that the mind is alive, at ``heartbeat_hz``.

    Who says where it is lives; so a heartbeat is said only if nothing has been for as long as from one to the next.

    Args:
        mission: the rates.
        role: of the peer.
        radius_m: of its body.
        now_s: when both begin.
    """

    def __init__(self, mission: Mission, role: RoleName, radius_m: float, now_s: float) -> None:
        self._role, self._radius_m = role, radius_m
        self._control_s = 1.0 / mission.control_hz
        self._control = Rhythm(self._control_s, now_s)
        self._heartbeat_s = 1.0 / mission.heartbeat_hz
        self._heartbeat = Rhythm(self._heartbeat_s, now_s)
        self._said_s = -math.inf
        """When it said last where the body is."""

    @property
    def next_s(self) -> float:
        """When something is due next."""
        return min(self._control.next_s, self._heartbeat.next_s)

    def due(self, now_s: float, body: State | Intent, *, urgent: bool = False, silent: bool = False) -> list[Effect]:
        """What is to be said and recorded now.

        Args:
            now_s: the time.
            body: what there is to say.
            urgent: it is said, but not recorded, before its time; if that comes soon, it is then recorded only.
            silent: it is recorded only.
        """
        effects: list[Effect] = []
        due = self._control.due(now_s)
        stale = now_s >= self._said_s + 0.5 * self._control_s - EARLY_S
        if (urgent or (due and stale)) and not silent:
            self._said_s = now_s
            effects.append(Publish(body))
        if due:
            track = Track(
                role=self._role,
                position=body.position,
                velocity=body.velocity,
                radius_m=self._radius_m,
                mode=body.mode,
                target=body.target if isinstance(body, State) else body.goal,
                path=body.path,
            )
            effects.append(Record(track))
        if self._heartbeat.due(now_s) and now_s >= self._said_s + self._heartbeat_s - EARLY_S:
            effects.append(Publish(Heartbeat(role=self._role, mode=body.mode)))
        return effects
