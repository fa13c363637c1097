"""Orders of every kind are judged when they are given and when they are taken, by hand-made words and times."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, cast

import pytest

from agents.auction import Auctioneer
from agents.orders import first_orders
from agents.standing_orders import StandingOrders
from agents.topology import TeamTree
from launcher.order_rules import OrderRules
from launcher.violation import Violation
from protocol.messages import Aim, Auction, Authority, Deployment, Envelope, Topology, Warrant

KINDS = {"deployment": StandingOrders, "topology": TeamTree, "auction": Auctioneer}
"""And which part of a mind takes them."""


@dataclass
class Peer:
    """What the rules see of a peer, whose clock tells the true time."""

    name: str
    true_s: float = 0.0
    leads_until_s: float | None = None
    role: object = field(default_factory=object)
    """Another one with every process."""
    latest: dict[str, Any] = field(default_factory=dict)
    """What it has taken last, by kind."""

    @property
    def now_s(self) -> float:
        return self.true_s

    @property
    def clock(self) -> object:
        return SimpleNamespace(when=lambda shown_s: shown_s)

    @property
    def allegiance(self) -> object:
        office = None if self.leads_until_s is None else "a reign"
        return SimpleNamespace(election=SimpleNamespace(office=office, lease_until_s=self.leads_until_s))

    def part(self, wanted: type[object]) -> object:
        kind = next(kind for kind, part in KINDS.items() if part is wanted)
        hand = _Hand(self, kind)
        return SimpleNamespace(held=hand) if kind == "topology" else hand


@dataclass
class _Hand:
    peer: Peer
    kind: str

    @property
    def latest(self) -> Any:
        return self.peer.latest.get(self.kind)


class Play:
    """The base station gives orders, and a robot takes some of them."""

    def __init__(self, *, keeps_disks: bool = True) -> None:
        self.rules = OrderRules(keeps_disks)
        self.base, self.robot = Peer("base", leads_until_s=1.0), Peer("robot1")

    def give(self, kind: str, sequence: int, at_s: float = 0.0, epoch: int = 1) -> Any:
        body = word(kind, epoch, sequence)
        self.base.true_s = at_s
        envelope = Envelope(sender="base", incarnation=0, sequence=0, sent_at_s=0.0, body=body)
        self.rules.hear(cast(Any, self.base), envelope)
        return body

    def take(self, kind: str, body: Any, at_s: float) -> None:
        self.robot.true_s, self.robot.latest[kind] = at_s, body
        self.rules.look(cast(Any, self.robot))


def word(kind: str, epoch: int, sequence: int) -> Deployment | Topology | Auction:
    authority, warrant = Authority(epoch=epoch, leader="base", sequence=sequence), Warrant(lease_s=9.0, marks=())
    match kind:
        case "topology":
            return Topology(authority=authority, warrant=warrant)
        case "auction":
            aims = (Aim(places=((0.0, 0.0),), shares=(1.0,), ahead_m=0.0),)
            return Auction(
                authority=authority, warrant=warrant, auction=1, center=(0.0, 0.0), aims=aims, robots=(), standing=()
            )
    orders = first_orders("base")
    return Deployment(
        authority=authority, warrant=warrant, decision=orders.decision, placements=(), edges=(), cost=0.0,
        relays_needed=0, reason="",
    )  # fmt: skip


@pytest.fixture(params=sorted(KINDS))
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_what_is_given_in_a_lease_is_taken_in_its_order_while_that_runs(kind: str) -> None:
    play = Play()
    first, second = play.give(kind, 1), play.give(kind, 2, at_s=0.5)
    play.take(kind, first, 0.9)
    play.take(kind, first, 5.0)  # nothing new
    play.take(kind, second, 1.0)


def test_nothing_is_given_without_a_lease(kind: str) -> None:
    play = Play()
    with pytest.raises(Violation, match=f"base says {kind} without one") as broken:
        play.give(kind, 1, at_s=1.0)
    assert broken.value.rule == "orders are given within a lease"


def test_what_comes_after_the_lease_is_not_taken_whatever_it_says_of_itself(kind: str) -> None:
    """It says that 9 s of the lease are left, and 1 s is."""
    play = Play()
    late = play.give(kind, 1)
    with pytest.raises(Violation, match=rf"robot1 takes {kind} \(1, 1\) 0.250 s after the lease") as broken:
        play.take(kind, late, 1.25)
    assert broken.value.rule == "no order is taken when its lease has ended"


def test_a_later_round_does_not_make_an_earlier_order_fresh(kind: str) -> None:
    play = Play(keeps_disks=False)
    first = play.give(kind, 1)
    play.base.leads_until_s = 2.0
    play.take(kind, play.give(kind, 2, at_s=0.9), 1.9)
    play.robot.latest.clear()
    play.robot.role = object()  # another process, which has taken nothing yet
    with pytest.raises(Violation, match=rf"robot1 takes {kind} \(1, 1\) 0.900 s after the lease"):
        play.take(kind, first, 1.9)


@pytest.mark.parametrize(("epoch", "sequence"), [(1, 1), (0, 5)])
def test_no_older_order_is_taken_after_a_newer_one(kind: str, epoch: int, sequence: int) -> None:
    play = Play()
    old, new = play.give(kind, sequence, epoch=epoch), play.give(kind, 2)
    play.take(kind, new, 0.1)
    with pytest.raises(Violation, match=rf"robot1 takes {kind} \({epoch}, {sequence}\) after \(1, 2\)") as broken:
        play.take(kind, old, 0.2)
    assert broken.value.rule == "no older order after a newer one"


def test_orders_of_different_kinds_may_overtake(kind: str) -> None:
    play = Play()
    for other in KINDS.keys() - {kind}:
        play.take(other, play.give(other, 7), 0.1)
    play.take(kind, play.give(kind, 1), 0.2)


def test_what_nobody_has_given_is_not_taken(kind: str) -> None:
    play = Play()
    play.give(kind, 1)
    with pytest.raises(Violation, match="which nobody gave") as broken:
        play.take(kind, word(kind, 1, 2), 0.1)
    assert broken.value.rule == "orders taken have been given"


def test_where_disks_are_lost_only_the_lease_counts(kind: str) -> None:
    play = Play(keeps_disks=False)
    old, new = play.give(kind, 1), play.give(kind, 2)
    play.take(kind, new, 0.1)
    play.take(kind, old, 0.2)
