"""Two-way ranging over the bus, which stands in for a radio: one part asks, one in the agent's mind answers.

The asker sends its place; the agent's process answers with the distance, wrong by no more than a bound, if it is in
line of sight, and else not at all. Nothing more is told of where it is.

*While a question and its answer travel* both may move. The asker's place is the one that it sent, wherever it has gone
since. The agent measures at some moment between the question and the answer, so that when the answer comes it is at
most v times the round trip from where it was: by so much the bound is wider, for a range stamped at that moment. What
comes after :data:`LATE_S` is worth little and is left out.

A real radio measures by itself: :meth:`agents.driver.RobotDriver.ranges` says what, and the questions find no answer.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from random import Random
from typing import Final

from agents.mission import Mission
from agents.rhythm import Rhythm
from agents.role import Effect, Event, Heard, Publish, Ranged, Woken
from agents.shared_estimate import SharedEstimate
from planning.environment import Environment
from protocol.messages import Point, RangeReply, RangeRequest

LATE_S: Final = 0.3
"""An answer that takes longer is left out."""

MOST_OPEN: Final = 8
"""Questions that an answer is waited for."""


class Ranging:
    """Asks how far the agent is, and adds what it is told to the shared estimate.

    Args:
        mission: rates, speed of the agent, who it is.
        name: of this peer.
        estimate: is told the ranges.
    """

    hears = frozenset({"range_reply"})

    def __init__(self, mission: Mission, name: str, estimate: SharedEstimate) -> None:
        self._name = name
        self._agent = mission.tracked_agent.name
        self._speed_m_s = mission.agent_speed_m_s
        self._estimate = estimate
        period_s = 1.0 / mission.ranging.rate_hz
        names = [entry.name for entry in mission.roster]
        self._asking = Rhythm(period_s, period_s * (names.index(name) / len(names) - 1.0))
        self._asked = 0
        self._open: dict[str, tuple[float, Point]] = {}

    @property
    def next_s(self) -> float:
        """When the next question is due."""
        return self._asking.next_s

    def handle(self, event: Event, now_s: float) -> Iterable[Effect]:
        """Ask when it is time; take the answers to the last questions, and what a radio of this body's own says."""
        match event:
            case Ranged(anchor, range_m, bound_m):
                return self._estimate.measured(anchor, range_m, bound_m, now_s)
            case Woken(position) if self._asking.due(now_s):
                return (self._ask(position, now_s),)
            case Heard(address, envelope) if isinstance(envelope.body, RangeReply):
                if address.speaker == self._agent and envelope.body.asker == self._name:
                    return self._take(envelope.body, now_s)
        return ()

    def _ask(self, position: Point, now_s: float) -> Effect:
        self._asked += 1
        # The time makes it another one after a restart, when the count begins anew.
        correlation = f"{self._asked}.{max(0, round(1e3 * now_s))}"
        self._open[correlation] = (now_s, position)
        if len(self._open) > MOST_OPEN:
            del self._open[next(iter(self._open))]
        return Publish(RangeRequest(position=position, correlation=correlation))

    def _take(self, reply: RangeReply, now_s: float) -> Iterable[Effect]:
        asked_s, anchor = self._open.pop(reply.correlation, (-math.inf, (0.0, 0.0)))
        round_trip_s = now_s - asked_s
        if not 0.0 <= round_trip_s <= LATE_S:
            return ()
        bound_m = reply.bound_m + self._speed_m_s * round_trip_s
        return self._estimate.measured(anchor, reply.range_m, bound_m, now_s)


class Transponder:
    """Answers questions in the agent's mind, with what its radio would measure.

    Args:
        mission: the bound and the noise, the seed of the latter, and who may ask.
        environment: the walls that block sight.
    """

    hears = frozenset({"range_request"})

    def __init__(self, mission: Mission, environment: Environment) -> None:
        self._ranging = mission.ranging
        self._environment = environment
        self._noise = Random(f"{mission.seed}/ranging")
        self._waiting: dict[str, RangeRequest] = {}
        """The last question of each peer, until the next moment at which it is known where the body is."""

    @property
    def next_s(self) -> float:
        """At once while somebody waits."""
        return -math.inf if self._waiting else math.inf

    def handle(self, event: Event, now_s: float) -> Iterator[Effect]:  # noqa: ARG002 - questions have no age here
        """Keep questions, and answer them when woken."""
        match event:
            case Woken(position):
                waiting, self._waiting = self._waiting, {}
                for asker, request in waiting.items():
                    if self._environment.line_of_sight(request.position, position):
                        yield Publish(self._reply(asker, request, position))
            case Heard(address, envelope) if isinstance(envelope.body, RangeRequest) and not address.operator:
                self._waiting[address.speaker] = envelope.body

    def _reply(self, asker: str, request: RangeRequest, position: Point) -> RangeReply:
        error_m = self._ranging.noise_m * (2.0 * self._noise.random() - 1.0)
        range_m = max(0.0, math.dist(request.position, position) + error_m)
        return RangeReply(asker=asker, correlation=request.correlation, range_m=range_m, bound_m=self._ranging.bound_m)
