"""The world of one role under test: a body, a clock, and what it says and records."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

from agents.driver import DiscDriver
from agents.records import AnyRecord, LogLine
from agents.role import Compute, Drive, Effect, Event, Persist, Publish, Record, Role, WakeAt, Woken
from protocol.messages import AnyBody, Body, Point

Kind = TypeVar("Kind", bound=Body)


class Life:
    """A role with its body, in a time of its own."""

    def __init__(self, role: Role, start: Point = (0.0, 0.0), speed_m_s: float = 1.0) -> None:
        self.role, self.driver = role, DiscDriver(start, speed_m_s)
        self.now_s = 0.0
        self.wake_at_s = 0.0
        self.said: list[tuple[float, AnyBody]] = []
        self.records: list[AnyRecord] = []
        self.jobs: list[Compute] = []
        self.promises: list[Persist] = []
        self.driver.advance(0.0)
        self.do(role.start(0.0, start))

    def do(self, effects: Iterable[Effect]) -> None:
        for effect in effects:
            match effect:
                case Publish(body):
                    self.said.append((self.now_s, body))
                case Drive(velocity, for_s):
                    self.driver.drive(velocity, for_s)
                case Record(record):
                    self.records.append(record)
                case WakeAt(time_s):
                    self.wake_at_s = time_s
                case Compute():
                    self.jobs.append(effect)
                case Persist():
                    self.promises.append(effect)

    def live_until(self, time_s: float) -> None:
        while self.wake_at_s <= time_s:
            self.now_s = max(self.now_s, self.wake_at_s)
            self.driver.advance(self.now_s)
            self.do(self.role.handle(Woken(self.driver.pose()), self.now_s))
        self.now_s = time_s
        self.driver.advance(time_s)

    def hear(self, event: Event) -> None:
        self.do(self.role.handle(event, self.now_s))

    @property
    def logs(self) -> list[LogLine]:
        return [record for record in self.records if isinstance(record, LogLine)]

    def all_said(self, kind: type[Kind]) -> list[tuple[float, Kind]]:
        """When it said what, of one kind."""
        return [(time_s, body) for time_s, body in self.said if isinstance(body, kind)]
