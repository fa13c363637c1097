"""The shell against hostile publications and failing roles."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agents.driver import DiscDriver
from agents.records import AnyRecord, LogLine
from agents.role import (
    RETRY_S,
    Compute,
    Drive,
    Effect,
    Event,
    Heard,
    JobDone,
    Persist,
    Publish,
    Record,
    WakeAt,
    Woken,
    Written,
)
from agents.shell import MAXIMUM_OPERATORS, PeerShell
from protocol.bus import PeerAppeared, PeerVanished, Received
from protocol.messages import AnyBody, Envelope, Goal, Heartbeat, Point, State, Vote, decode, encode

HEARTBEAT = Heartbeat(role="base_station", mode="waiting")


class Wire:
    """Keeps what is published."""

    def __init__(self) -> None:
        self.sent: list[tuple[str, bytes]] = []

    def publish(self, key: str, payload: bytes) -> None:
        self.sent.append((key, payload))

    def close(self) -> None:
        pass


class Puppet:
    """Does what it is told, remembers what it was told."""

    hears = frozenset({"heartbeat", "goal", "state", "vote"})

    def __init__(self) -> None:
        self.events: list[Event] = []
        self.effects: Sequence[Effect] = ()
        self.fails = False

    def start(self, now_s: float, _: Point) -> Sequence[Effect]:
        return (WakeAt(now_s + 0.1),)

    def handle(self, event: Event, _: float) -> Sequence[Effect]:
        self.events.append(event)
        if self.fails:
            raise ZeroDivisionError("planned")
        return self.effects


class Stage:
    def __init__(self) -> None:
        self.role, self.wire = Puppet(), Wire()
        self.now_s = 0.0
        self.records: list[AnyRecord] = []
        self.jobs: list[Compute] = []
        self.promises: list[Persist] = []
        self.driver = DiscDriver((0.0, 0.0), 1.0)
        self.shell = PeerShell(
            self.role, self.driver, self.wire, name="robot1", team="team", incarnation=3,
            peers=["base", "agent", "robot1"], now=lambda: self.now_s, wall_clock=lambda: 1000.0 + self.now_s,
            record=lambda _, record: self.records.append(record), execute=self.jobs.append,
            persist=self.promises.append,
        )  # fmt: skip

    @property
    def heard(self) -> list[Envelope]:
        return [event.envelope for event in self.role.events if isinstance(event, Heard)]

    def take(
        self, sequence: int, key: str = "team/v1/base/heartbeat", sender: str = "base", incarnation: int = 0,
        body: AnyBody = HEARTBEAT,
    ) -> None:  # fmt: skip
        envelope = Envelope(sender=sender, incarnation=incarnation, sequence=sequence, sent_at_s=0.0, body=body)
        self.shell.take(Received(key, encode(envelope)))


GOAL = Goal(goal=(1.0, 1.0), correlation="one")
VOTE_FOR_AGENT = Vote(candidate="agent", correlation="0.1", granted=True, mark="0.1")


@pytest.fixture
def stage() -> Stage:
    return Stage()


def test_hears_each_kind_of_each_sender_in_rising_order(stage: Stage) -> None:
    for sequence in (5, 5, 4, 6):
        stage.take(sequence)
    stage.take(1, incarnation=1)
    stage.take(7)
    assert [(envelope.incarnation, envelope.sequence) for envelope in stage.heard] == [(0, 5), (0, 6), (1, 1)]
    assert stage.shell.refused == {"stale": 3}


@pytest.mark.parametrize(
    ("key", "sender", "body", "reason"),
    [
        ("other/v1/base/heartbeat", "base", None, "foreign"),
        ("team/v2/base/heartbeat", "base", None, "foreign"),
        ("team/v1/base/more/and/heartbeat", "base", None, "foreign"),
        ("team/v1/agent/heartbeat", "base", None, "impersonated"),
        ("team/v1/intruder/heartbeat", "intruder", None, "stranger"),
        ("team/v1/base/state", "base", None, "misplaced"),
        ("team/v1/base/goal", "base", GOAL, "misplaced"),
        ("team/v1/operator/anna/heartbeat", "anna", None, "misplaced"),
        ("team/v1/operator/anna/goal", "base", GOAL, "impersonated"),
        ("team/v1/base/heartbeat/robot1", "base", None, ""),
        ("team/v1/base/vote/robot1", "base", None, "misplaced"),
        ("team/v1/base/vote/robot1", "base", VOTE_FOR_AGENT, "misplaced"),
        ("team/v1/base/vote", "base", VOTE_FOR_AGENT, "misplaced"),
        ("team/v1/base/vote/agent", "base", VOTE_FOR_AGENT, ""),
        ("team/v1/robot1/heartbeat", "robot1", None, ""),
        ("team/v1/base/deployment", "agent", None, ""),
    ],
)
def test_refuses_what_does_not_fit_its_key(
    stage: Stage, key: str, sender: str, body: AnyBody | None, reason: str
) -> None:
    stage.take(1, key, sender, body=body or HEARTBEAT)
    assert not stage.heard
    assert dict(stage.shell.refused) == ({reason: 1} if reason else {})


def test_votes_are_said_to_their_candidate_and_heard_by_it_only(stage: Stage) -> None:
    vote = Vote(candidate="robot1", correlation="0.1", granted=True, mark="0.1")
    stage.take(1, "team/v1/base/vote/robot1", body=vote)
    assert [envelope.body for envelope in stage.heard] == [vote]
    stage.role.effects = (Publish(VOTE_FOR_AGENT),)
    stage.shell.wake()
    assert [key for key, _ in stage.wire.sent] == ["team/v1/robot1/vote/agent"]


def test_operators_speak_without_being_on_the_roster(stage: Stage) -> None:
    stage.take(1, "team/v1/operator/anna/goal", "anna", body=GOAL)
    assert stage.heard[0].body == GOAL


def test_memory_of_operators_is_bounded(stage: Stage) -> None:
    for number in range(3 * MAXIMUM_OPERATORS):
        stage.take(1, f"team/v1/operator/o{number}/goal", f"o{number}", body=GOAL)
    assert len(stage.heard) == 3 * MAXIMUM_OPERATORS
    assert len(stage.shell._operators) <= MAXIMUM_OPERATORS


def test_an_operator_cannot_shadow_a_peer_of_the_same_name(stage: Stage) -> None:
    stage.take(2**40, "team/v1/operator/base/goal", "base", incarnation=2**40, body=GOAL)
    stage.take(1)
    assert [envelope.kind for envelope in stage.heard] == ["goal", "heartbeat"]


@settings(deadline=None)
@given(st.text(max_size=60), st.binary(max_size=200))
def test_any_bytes_under_any_key_are_survived(key: str, payload: bytes) -> None:
    stage = Stage()
    for place in (key, "team/v1/base/heartbeat"):
        stage.shell.take(Received(place, payload))
    assert not stage.heard
    assert stage.shell.refused.total() >= 1


def test_a_flood_of_nonsense_is_logged_once(stage: Stage) -> None:
    for _ in range(50):
        stage.shell.take(Received("team/v1/base/heartbeat", b"{"))
    assert stage.shell.refused == {"malformed": 50}
    assert len(stage.records) == 1


def test_a_role_that_fails_loses_an_event_and_not_its_life(stage: Stage) -> None:
    stage.shell.start()
    stage.role.fails = True
    stage.take(1)
    stage.now_s = 0.1
    stage.shell.wake()
    assert stage.shell.faults == 2
    assert stage.shell.wake_at_s == pytest.approx(0.1 + RETRY_S)
    assert [record.level for record in stage.records if isinstance(record, LogLine)] == ["error", "error"]
    stage.role.fails, stage.role.effects = False, (WakeAt(5.0),)
    stage.now_s = stage.shell.wake_at_s
    stage.shell.wake()
    assert stage.shell.wake_at_s == 5.0


def test_carries_out_every_effect(stage: Stage) -> None:
    stage.shell.start()
    assert stage.shell.wake_at_s == pytest.approx(0.1)
    job = Compute("planning", max, (1, 2))
    note = LogLine(level="info", text="hello")
    body = Heartbeat(role="robot", mode="moving")
    stage.role.effects = (Publish(body), Publish(body), Drive((1.0, 0.0), 2.0), Record(note), WakeAt(1.5), job)
    stage.now_s = 0.5
    stage.shell.wake()
    stage.role.effects = (WakeAt(9.0),)
    assert [key for key, _ in stage.wire.sent] == ["team/v1/robot1/heartbeat"] * 2
    envelopes = [decode(payload) for _, payload in stage.wire.sent]
    assert [(e.sender, e.incarnation, e.sequence, e.sent_at_s) for e in envelopes] == [
        ("robot1", 3, 0, 1000.5),
        ("robot1", 3, 1, 1000.5),
    ]
    assert stage.records == [note]
    assert stage.jobs == [job]
    assert stage.shell.wake_at_s == 1.5
    stage.now_s = 1.5
    stage.shell.wake()
    assert stage.role.events[-1] == Woken((1.0, 0.0))


def test_passes_on_jobs_and_the_coming_and_going_of_others(stage: Stage) -> None:
    done = JobDone("planning", 2, 0.01)
    stage.shell.finish(done)
    for event in (PeerAppeared("base"), PeerVanished("base"), PeerAppeared("robot1"), PeerAppeared("stranger")):
        stage.shell.take(event)
    assert stage.role.events == [done, PeerAppeared("base"), PeerVanished("base")]


def test_of_a_peer_started_again_nothing_said_before_counts_of_any_kind(stage: Stage) -> None:
    stage.take(1, incarnation=1)
    stage.take(9, "team/v1/base/state", body=State(position=(0.0, 0.0), velocity=(0.0, 0.0), mode="moving"))
    assert [envelope.kind for envelope in stage.heard] == ["heartbeat"]
    assert stage.shell.refused == {"stale": 1}


def test_promises_go_to_the_disk_and_what_becomes_of_them_to_the_role(stage: Stage) -> None:
    stage.role.effects = (Persist(b"promise", 4),)
    stage.take(1)
    assert stage.promises == [Persist(b"promise", 4)]
    stage.shell.written(Written(4, "no space left"))
    assert stage.role.events[-1] == Written(4, "no space left")
