"""What a leader knows of the agent: the way that it announces, or the set in which it has been measured to be."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final, Protocol

from agents.collection import Collection
from agents.target_set import TargetSet
from protocol.messages import Point

DRIFT_OVER_S: Final = 2.0
"""The drift of a set is looked at over so long: from one range to the next its middle jumps to and fro."""


class Estimate(Protocol):
    """What is used of :class:`agents.shared_estimate.SharedEstimate`."""

    def target(self, now_s: float) -> TargetSet | None:
        """Where the agent may be."""


@dataclass(frozen=True, slots=True)
class AgentPlace:
    """Where the agent is, as :class:`agents.planning_job.Question` has it."""

    way: tuple[Point, ...] = ()
    target: TargetSet | None = None
    drift_m_s: Point = (0.0, 0.0)


class AgentKnowledge:
    """See the module.

    Args:
        collection: what the agent says of itself, if it announces anything.
        estimate: of an agent that announces nothing; None: it announces its way.
    """

    def __init__(self, collection: Collection, estimate: Estimate | None) -> None:
        self._collection, self._estimate = collection, estimate
        self._middles: deque[tuple[float, Point]] = deque()
        """Of the sets looked at within the last :data:`DRIFT_OVER_S`, and of the last one before; oldest first."""

    def goal(self) -> object:
        """Something that is another one when the agent announces another goal, and when it is heard first."""
        intent = self._collection.intent()
        return None if intent is None else (intent.goal,)

    def look(self, now_s: float) -> AgentPlace | None:
        """Where it is; None: it should say so, and has not."""
        if self._estimate is None:
            intent = self._collection.intent()
            return None if intent is None else AgentPlace(intent.path or (intent.position,))
        target = self._estimate.target(now_s)
        return AgentPlace() if target is None else AgentPlace((), target, self._drift_m_s(target))

    def _drift_m_s(self, target: TargetSet) -> Point:
        self._middles.append((target.time_s, target.center))
        while len(self._middles) > 1 and self._middles[1][0] <= target.time_s - DRIFT_OVER_S:
            self._middles.popleft()
        begin_s, begin = self._middles[0]
        lasts_s = target.time_s - begin_s
        if lasts_s < DRIFT_OVER_S / 2:
            return (0.0, 0.0)
        return (target.center[0] - begin[0]) / lasts_s, (target.center[1] - begin[1]) / lasts_s
