"""Election and membership as a part of a mind: what it says, records and asks for."""

from __future__ import annotations

import pytest

from agents.allegiance import Allegiance
from agents.records import LogLine, Office
from agents.role import Effect, Event, Heard, Persist, Publish, Record, Woken, Written
from agents.standing_orders import StandingOrders
from protocol.bus import PeerAppeared, PeerVanished
from protocol.election import LEASE_S
from protocol.keys import Address
from protocol.membership import Presence
from protocol.messages import (
    AnyBody,
    Authority,
    Deployment,
    Envelope,
    Heartbeat,
    LastHeard,
    Reign,
    Vote,
    VoteRequest,
    Warrant,
    kind_of,
)
from protocol.roster import Roster

ROSTER = Roster(("base", "robot1", "robot2"), ("agent",))
BASE = Reign(epoch=1, leader="base", incarnation=0)


class World:
    """One allegiance, and what it has done."""

    def __init__(self, name: str = "robot1", incarnation: int = 0, promise: Reign | None = None) -> None:
        self.part = Allegiance(
            ROSTER, team="team", name=name, incarnation=incarnation, promise=promise, seed=1, heartbeat_s=0.5, now_s=0.0
        )
        self.orders = StandingOrders(self.part)
        self.now_s = 0.0
        self.effects: list[Effect] = []
        self.kept: list[Persist] = []
        """What is on its disk."""
        self.give(Woken((0.0, 0.0)))

    def give(self, event: Event) -> None:
        kind = event.envelope.kind if isinstance(event, Heard) else ""
        for part in (self.part, self.orders):
            if not kind or kind in part.hears:
                self.effects += part.handle(event, self.now_s)
        for effect in list(self.effects):
            if isinstance(effect, Persist) and effect not in self.kept:
                self.kept.append(effect)
                self.give(Written(effect.token))

    def hear(self, sender: str, body: AnyBody, incarnation: int = 0) -> None:
        envelope = Envelope(sender=sender, incarnation=incarnation, sequence=0, sent_at_s=0.0, body=body)
        self.give(Heard(Address("team", sender, kind_of(body)), envelope))

    def live_until(self, time_s: float) -> None:
        while self.part.next_s <= time_s:
            self.now_s = max(self.now_s, self.part.next_s)
            self.give(Woken((0.0, 0.0)))
        self.now_s = time_s

    def said(self, kind: type) -> list[AnyBody]:
        return [effect.body for effect in self.effects if isinstance(effect, Publish) and isinstance(effect.body, kind)]

    @property
    def logs(self) -> list[tuple[str, str]]:
        records = [effect.record for effect in self.effects if isinstance(effect, Record)]
        return [(record.level, record.text) for record in records if isinstance(record, LogLine)]

    @property
    def offices(self) -> list[Office]:
        records = [effect.record for effect in self.effects if isinstance(effect, Record)]
        return [record for record in records if isinstance(record, Office)]

    def mark(self) -> str:
        vote = self.said(Vote)[-1]
        assert isinstance(vote, Vote)
        return vote.mark

    def follow(self, reign: Reign = BASE) -> None:
        """Promise this leader its vote, and obey it."""
        leader = reign.leader
        self.hear(leader, VoteRequest(epoch=reign.epoch, correlation="0.1"), reign.incarnation)
        self.hear(leader, VoteRequest(epoch=reign.epoch, correlation="0.2", warrant=self.warrant()), reign.incarnation)

    def warrant(self, lease_s: float = 0.8) -> Warrant:
        return Warrant(lease_s=lease_s, marks=(LastHeard(peer=self.part.name, mark=self.mark()),))

    def order(
        self, sequence: int, warrant: Warrant, leader: str = "base", epoch: int = 1, sender: str = "base"
    ) -> None:
        body = Deployment(
            authority=Authority(epoch=epoch, leader=leader, sequence=sequence), warrant=warrant, decision=1,
            placements=(), edges=(), cost=0.0, relays_needed=0, reason="test",
        )  # fmt: skip
        self.hear(sender, body)


def test_a_voter_obeys_whom_it_has_promised_and_says_so_once() -> None:
    world = World()
    world.follow()
    assert world.part.obeyed(world.now_s) == BASE
    assert [text for _, text in world.logs if "obeys" in text] == ["obeys base in epoch 1"]
    assert (world.offices[-1].obeys, world.offices[-1].leads, world.offices[-1].standing) == (BASE, None, "following")
    world.live_until(LEASE_S)
    assert world.part.obeyed(world.now_s) is None
    assert ("warning", "obeys nobody: no word in time from base") in world.logs
    assert world.offices[-1].obeys is None
    assert [text for _, text in world.logs if "obeys nobody" in text] == ["obeys nobody: no word in time from base"]


def test_the_record_says_when_obedience_ended_however_late_this_peer_looks() -> None:
    world = World()
    world.follow()
    until_s = world.part.obeyed_until_s
    assert until_s == pytest.approx(0.72)
    world.now_s = 5.0  # it hung
    world.give(Woken((0.0, 0.0)))
    (ended,) = [office.obeyed_until_s for office in world.offices if office.obeyed_until_s is not None]
    assert ended == pytest.approx(until_s)


def test_orders_are_in_force_as_long_as_their_leader_is_obeyed() -> None:
    world = World()
    world.follow()
    assert world.orders.in_force(world.now_s) is None
    world.order(1, world.warrant())
    order = world.orders.in_force(world.now_s)
    assert order is not None
    assert order.authority.sequence == 1
    world.live_until(0.9)
    assert world.orders.in_force(world.now_s) is None
    assert world.orders.latest is order


@pytest.mark.parametrize(
    ("sender", "leader", "epoch", "why"),
    [
        ("robot2", "robot2", 1, "of a leader that it has not promised its vote"),
        ("robot2", "robot2", 9, "of a leader that it has not promised its vote"),
        ("robot2", "base", 1, "of another leader than it names"),
        ("base", "robot2", 1, "of another leader than it names"),
    ],
)
def test_orders_of_others_are_refused_and_the_log_says_why_once(sender: str, leader: str, epoch: int, why: str) -> None:
    world = World()
    world.follow()
    for sequence in range(3):
        world.order(sequence, world.warrant(), leader, epoch, sender)
    assert world.orders.latest is None
    lines = [text for _, text in world.logs if "does not take" in text]
    assert lines == [f"does not take the orders of {sender} in epoch {epoch}: they are {why}"]


def test_a_delayed_order_of_the_leader_before_is_refused() -> None:
    world = World()
    world.follow()
    late = world.warrant()
    world.live_until(2.5)
    world.follow(Reign(epoch=2, leader="robot2", incarnation=0))
    assert world.part.obeyed(world.now_s) == Reign(epoch=2, leader="robot2", incarnation=0)
    world.order(99, late)
    assert world.orders.latest is None


def test_an_order_whose_warrant_has_run_out_on_the_way_is_refused() -> None:
    world = World()
    world.follow()
    late = world.warrant()
    world.live_until(0.85)
    world.order(1, late)
    assert world.orders.latest is None


def test_a_leader_has_warrants_and_one_that_is_not_has_none() -> None:
    world = World("base")
    assert world.part.warrant(world.now_s) is None
    world.live_until(0.1)
    for voter in ("robot1", "robot2"):
        request = world.said(VoteRequest)[-1]
        assert isinstance(request, VoteRequest)
        world.hear(voter, Vote(candidate="base", correlation=request.correlation, granted=True, mark="0.1"))
        world.live_until(world.now_s + 0.01)
    request = world.said(VoteRequest)[-1]
    assert isinstance(request, VoteRequest)
    reign = Reign(epoch=request.epoch, leader="base", incarnation=0)
    world.hear(
        "robot1", Vote(candidate="base", correlation=request.correlation, granted=True, promise=reign, mark="0.2")
    )
    assert world.part.reign == reign
    assert world.part.warrant(world.now_s) is not None
    assert world.part.obeyed(world.now_s) == reign
    assert world.offices[-1].leads == reign
    world.live_until(world.now_s + LEASE_S)
    assert world.part.warrant(world.now_s) is None
    assert [office.leads for office in world.offices][-1:] == [None]
    ended = [office.led_until_s for office in world.offices if office.led_until_s is not None]
    assert len(ended) == 1
    assert ("warning", "leads no more: no majority has renewed its lease") in world.logs


def test_who_comes_goes_and_is_started_again_is_logged() -> None:
    world = World()
    beat = Heartbeat(role="robot", mode="moving")
    world.give(PeerAppeared("robot2"))
    world.hear("robot2", beat)
    assert world.part.presence("robot2") is Presence.PRESENT
    world.now_s = 0.1
    world.hear("robot2", beat, incarnation=1)
    assert world.part.is_there("robot2", 1)
    assert not world.part.is_there("robot2", 0)
    world.live_until(3.0)
    assert world.part.presence("robot2") is Presence.SILENT
    world.give(PeerVanished("robot2"))
    assert world.part.presence("robot2") is Presence.GONE
    assert [(level, text.split(":")[0]) for level, text in world.logs if "robot2" in text] == [
        ("debug", "robot2 is silent"),
        ("info", "robot2 is present"),
        ("info", "robot2 is incarnation 1 now"),
        ("warning", "robot2 is silent"),
        ("debug", "robot2 is gone"),
    ]


def test_a_process_that_is_started_again_rests_and_the_first_one_does_not() -> None:
    first, again = World(), World(incarnation=1, promise=BASE)
    for world in (first, again):
        world.hear("base", VoteRequest(epoch=2, correlation="0.1"))
    assert [len(world.kept) for world in (first, again)] == [1, 0]
