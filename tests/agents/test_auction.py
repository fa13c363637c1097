"""The auction: what all find together is what the leader finds alone, and an auction is bounded whatever goes wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from msgspec import structs

import maps
from agents.auction import AGAIN_S, BIDDING, DESCRIBING, OPEN_S, Auctioneer
from agents.leader import DeploymentPlanner, Plan
from agents.lot import Bids, Lot, from_auction, to_auction
from agents.planning_job import Question
from agents.records import LogLine
from agents.role import Compute, Heard, JobDone, Publish, Record, Woken
from agents.whereabouts import announce
from planning.environment import Environment
from protocol.keys import Address
from protocol.messages import (
    AnyBody,
    Auction,
    Authority,
    Bid,
    Envelope,
    Offer,
    Placement,
    Point,
    Reign,
    Warrant,
    decode,
    encode,
)
from tests.agents.sworn import Sworn

WARRANT = Warrant(lease_s=1.0, marks=())
AUTHORITY = Authority(epoch=1, leader="base", sequence=1)


@pytest.fixture(scope="module")
def planner() -> DeploymentPlanner:
    environment = Environment.load(maps.path("room1"))
    base = tuple(map(float, environment.inflated(0.3).vertices.mean(axis=0)))
    inside = environment.inflated(0.3)
    rng = np.random.default_rng(4)
    while not inside.contains([base])[0]:
        base = tuple(map(float, rng.uniform(environment.bounds[:2], environment.bounds[2:])))
    return DeploymentPlanner(environment, (base[0], base[1]), 0.2, "inflection", search="one-edge", spacing_m=2.0)


def places(planner: DeploymentPlanner, rng: np.random.Generator, number: int) -> list[Point]:
    chosen = planner.graph.positions[rng.choice(len(planner.graph), number, replace=False)]
    return [(float(x), float(y)) for x, y in chosen]


def over_the_wire(lot: Lot) -> Lot:
    auction = to_auction(lot, 3, AUTHORITY, WARRANT)
    envelope = Envelope(sender="base", incarnation=0, sequence=0, sent_at_s=0.0, body=auction)
    body = decode(encode(envelope)).body
    assert isinstance(body, Auction)
    return from_auction(body)


def test_what_all_bid_together_is_what_the_leader_finds_alone(planner: DeploymentPlanner) -> None:
    rng = np.random.default_rng(20)
    previous: Plan | None = None
    exchanged = 0
    for turn in range(9):
        stops = places(planner, rng, 6)
        way = planner.graph.geodesics.path(stops[0], stops[1])
        robots = {f"robot{n}": place for n, place in enumerate(stops[2:], 1)}
        agent = announce(way)
        alone = planner.plan(agent, robots, previous)
        lot = over_the_wire(planner.lot(agent, robots, previous))
        bids = {name: planner.bid(lot, name) for name in ("base", *robots)}
        together = planner.plan(agent, robots, previous, (), Bids(planner.lot(agent, robots, previous).aims, bids))
        exchanged += any(offer.added is not None for offers in bids.values() for offer in offers)
        assert together.edges == alone.edges, f"turn {turn}"
        assert together.placements == alone.placements, f"turn {turn}"
        assert together.total_cost_m == pytest.approx(alone.total_cost_m), f"turn {turn}"
        previous = alone if turn % 3 else None
    assert exchanged > 2


def test_a_bidder_exchanges_only_links_of_its_own(planner: DeploymentPlanner) -> None:
    rng = np.random.default_rng(21)
    met = set()
    for _ in range(12):
        stops = places(planner, rng, 5)
        robots = {f"robot{n}": place for n, place in enumerate(stops[1:], 1)}
        standing = ("robot2", "robot4")
        lot = Lot(stops[0], announce([stops[0]]).aims, robots, standing)
        own = {
            "base": set(),
            "robot2": {frozenset(("base", "robot2"))},
            "robot4": {frozenset(("robot2", "robot4")), frozenset(("robot4", "agent"))},
        }
        for bidder in ("base", *robots):
            for offer in planner.bid(lot, bidder):
                if offer.removed is not None:
                    assert frozenset(offer.removed) in own[bidder]
                    met.add(bidder)
    assert met == {"robot2", "robot4"}


def test_without_a_relay_the_link_to_the_agent_is_the_base_stations(planner: DeploymentPlanner) -> None:
    rng = np.random.default_rng(22)
    removed = set()
    for _ in range(10):
        stops = places(planner, rng, 3)
        lot = Lot(stops[0], announce([stops[0]]).aims, {"robot1": stops[1], "robot2": stops[2]}, ())
        assert not any(offer.removed for name in lot.robots for offer in planner.bid(lot, name))
        removed |= {offer.removed for offer in planner.bid(lot, "base")}
    assert {frozenset(edge) for edge in removed if edge} == {frozenset(("base", "agent"))}


def test_robots_that_say_that_they_are_in_a_wall_are_bid_for_where_they_can_be(planner: DeploymentPlanner) -> None:
    rng = np.random.default_rng(23)
    for _ in range(4):
        stops = places(planner, rng, 2)
        robots = {"robot1": stops[1], "robot2": (-1e7, 1e7)}
        lot = Lot(stops[0], announce([stops[0]]).aims, robots, ("robot2",))
        nearest = tuple(planner.graph.geodesics.nearest((-1e7, 1e7)).tolist())
        beside = Lot(lot.center, lot.aims, {**robots, "robot2": nearest}, lot.standing)
        assert [planner.bid(lot, name) for name in ("base", *robots)] == [
            planner.bid(beside, name) for name in ("base", *robots)
        ]


def test_an_offer_counts_only_if_its_chain_is_one_on_the_map(planner: DeploymentPlanner) -> None:
    rng = np.random.default_rng(24)
    judged = 0
    for _ in range(20):
        stops = places(planner, rng, 4)
        robots = {f"robot{n}": place for n, place in enumerate(stops[1:], 1)}
        lot = Lot(stops[0], announce([stops[0]]).aims, robots, ("robot1", "robot2"))
        bids = (one for name in ("base", *robots) for one in planner.bid(lot, name))
        offers = [one for one in bids if one.whole and len(one.relays) > 1]
        if not offers:
            continue
        judged += 1
        good = structs.replace(offers[0], total_cost_m=0.0)

        def won(bad: Offer, aims: Any = lot.aims, robots: Any = robots) -> bool:
            """Whether an offer that is cheaper than all is awarded."""
            return bool(planner._proposer.award(Bids(aims, {"robot1": (bad,)}), robots))

        first, *others = good.relays
        x, y = first.position
        far = next(
            (px, py)
            for px, py in planner.graph.positions.tolist()
            if not planner.graph.environment.line_of_sight(planner._base, (px, py))
        )
        assert won(good)
        for position in ((x + 0.001, y), (1e7, 1e7), far, others[0].position):
            moved = structs.replace(first, position=position)
            assert not won(structs.replace(good, relays=(moved, *others))), position
        blind = structs.replace(good, relays=good.relays[:-1])
        sees = planner.graph.environment.line_of_sight(good.relays[-2].position, lot.aims[0].places)
        assert won(blind) == bool(np.all(sees)), "the last relay sees the agent, or the chain ends before it"
        assert not won(structs.replace(good, relays=()))
    assert judged > 3


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"standing": ("robot1", "robot1")}, "twice a relay"),
        ({"standing": ("robot7",)}, "its place is not said"),
        ({"shares": (0.5, 0.5)}, "1 places and 2 shares"),
        ({"shares": (0.0,)}, "add up to 0 and not to 1"),
    ],
)
def test_lots_that_make_no_sense_are_refused(change: dict[str, Any], sentence: str) -> None:
    auction = to_auction(FakePlanner.lot_found, 9, AUTHORITY, WARRANT)
    if "shares" in change:
        change = {"aims": (structs.replace(auction.aims[0], **change),)}
    with pytest.raises(ValueError, match=sentence):
        from_auction(structs.replace(auction, **change))


class FakePlanner:
    """Finds what it is told to."""

    lot_found = Lot((1.0, 1.0), announce([(1.0, 1.0)]).aims, {"robot1": (2.0, 2.0), "robot2": (3.0, 3.0)}, ())

    def lot(self, _question: Any) -> Lot:
        return self.lot_found

    def bid(self, _lot: Lot, _bidder: str) -> tuple[Offer, ...]:
        return (offer(5.0),)


def offer(cost: float, robot: str = "robot1", aim: int = 0) -> Offer:
    return Offer(
        aim=aim, whole=True, total_cost_m=cost, cost=1.0, relays=(Placement(robot=robot, position=(2.0, 2.0)),)
    )


def question() -> Question:
    onset: Any = None
    return Question(way=((1.0, 1.0),), onset=onset, lead_s=0.0, previous=None, heading={})


def heard(sender: str, body: AnyBody) -> Heard:
    envelope = Envelope(sender=sender, incarnation=0, sequence=0, sent_at_s=0.0, body=body)
    return Heard(Address("team", sender, str(body.__struct_config__.tag)), envelope)


class Scene:
    """An auctioneer whose jobs are done at once."""

    def __init__(self, name: str, leads: bool) -> None:
        self.allegiance = Sworn(name)
        if leads:
            self.allegiance.office = Reign(epoch=1, leader=name, incarnation=0)
        self.auctioneer = Auctioneer(self.allegiance, FakePlanner(), "base")
        self.said: list[AnyBody] = []
        self.logs: list[str] = []
        self.answered: list[Bids] = []

    def carry_out(self, effects: Any, now_s: float) -> None:
        for effect in list(effects):
            match effect:
                case Publish(body):
                    self.said.append(body)
                case Record(LogLine(text=text)):
                    self.logs.append(text)
                case Compute(job=job, function=function, arguments=arguments):
                    result = function(*arguments)
                    assert job in (DESCRIBING, BIDDING)
                    self.tell(JobDone(job, result, 0.01), now_s)
        if (bids := self.auctioneer.take()) is not None:
            self.answered.append(bids)

    def tell(self, event: Any, now_s: float) -> None:
        self.carry_out(self.auctioneer.handle(event, now_s), now_s)


def test_an_auction_closes_when_all_have_bid() -> None:
    scene = Scene("base", leads=True)
    scene.carry_out(scene.auctioneer.hold(question()), 10.0)
    auctions = [body for body in scene.said if isinstance(body, Auction)]
    assert len(auctions) == 1
    for robot in ("robot1", "robot2"):
        assert not scene.answered
        scene.tell(heard(robot, Bid(epoch=1, auction=auctions[0].auction, offers=(offer(4.0),))), 10.05)
    (answer,) = scene.answered
    assert set(answer.offers) == {"base", "robot1", "robot2"}
    assert scene.auctioneer.next_s == float("-inf")
    scene.tell(Woken((0.0, 0.0)), 10.05)
    assert scene.auctioneer.next_s == float("inf") and not scene.logs


def test_what_is_missing_is_not_waited_for_and_is_said_once() -> None:
    scene = Scene("base", leads=True)
    for start_s in (10.0, 20.0):
        scene.carry_out(scene.auctioneer.hold(question()), start_s)
        number = next(body.auction for body in reversed(scene.said) if isinstance(body, Auction))
        scene.tell(heard("robot1", Bid(epoch=1, auction=number, offers=())), start_s + 0.01)
        scene.tell(heard("robot2", Bid(epoch=1, auction=number - 1, offers=(offer(1.0),))), start_s + 0.02)
        scene.tell(heard("robot2", Bid(epoch=0, auction=number, offers=(offer(1.0),))), start_s + 0.02)
        scene.tell(heard("stranger", Bid(epoch=1, auction=number, offers=(offer(1.0),))), start_s + 0.02)
        scene.tell(heard("robot2", Bid(epoch=1, auction=number, offers=(offer(1.0, robot="robot9"),))), start_s + 0.02)
        scene.tell(heard("robot2", Bid(epoch=1, auction=number, offers=(offer(1.0, aim=7),))), start_s + 0.02)
        scene.tell(Woken((0.0, 0.0)), start_s + AGAIN_S)
        scene.tell(Woken((0.0, 0.0)), start_s + OPEN_S)
    assert [set(answer.offers) for answer in scene.answered] == [{"base", "robot1"}] * 2
    assert [text for text in scene.logs if "robot2" in text] == ["auction 1 closed without the bids of robot2"]
    assert sum(isinstance(body, Auction) for body in scene.said) == 4


def test_bids_of_a_leader_that_is_deposed_are_dropped_and_nobody_is_kept_waiting() -> None:
    scene = Scene("base", leads=True)
    scene.carry_out(scene.auctioneer.hold(question()), 10.0)
    assert scene.auctioneer.busy
    scene.allegiance.office = None
    scene.auctioneer.handle(Woken((0.0, 0.0)), 10.01)
    assert scene.auctioneer.next_s == float("-inf")
    scene.tell(Woken((0.0, 0.0)), 10.01)
    assert not scene.answered and not scene.auctioneer.busy and scene.auctioneer.next_s == float("inf")


def test_a_bid_is_made_once_and_said_as_often_as_it_is_asked_for() -> None:
    scene = Scene("robot1", leads=False)
    for sequence in (1, 2, 2, 3):
        authority = Authority(epoch=4, leader="base", sequence=sequence)
        scene.tell(heard("base", to_auction(FakePlanner.lot_found, 9, authority, WARRANT)), 1.0 + sequence)
    assert scene.said == [Bid(epoch=4, auction=9, offers=(offer(5.0),))] * 3


def test_an_auction_that_makes_no_sense_is_said_to_make_none() -> None:
    lot = FakePlanner.lot_found
    scene = Scene("robot1", leads=False)
    unknown = Lot(lot.center, lot.aims, lot.robots, ("robot7",))
    scene.tell(heard("base", to_auction(unknown, 9, AUTHORITY, WARRANT)), 1.0)
    assert not scene.said and "robot7 is a relay of the chain, and its place is not said" in scene.logs[0]
