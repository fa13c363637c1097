"""The view of a team that only listens: who is up, whether the chain holds, what is not believed."""

from __future__ import annotations

import io

import numpy as np
import pytest
from msgspec import structs
from rich.console import Console

from agents.casting import Casting
from agents.mission import Mission
from agents.shared_estimate import SharedEstimate
from launcher.observer import SILENT_AFTER_S, TeamView
from launcher.run import LISTENER
from launcher.status import describe, draw
from planning.environment import Environment
from protocol.bus import PeerAppeared, PeerVanished, Received
from protocol.election import LEASE_S
from protocol.keys import Address
from protocol.messages import (
    AnyBody,
    Authority,
    Deployment,
    Envelope,
    Intent,
    Placement,
    Point,
    Ranges,
    SharedRange,
    State,
    VoteRequest,
    Warrant,
    encode,
    kind_of,
)

# Two rooms of 4 m by 4 m beside each other; a wall with a door at the top between them.
ROOMS = Environment([(0, 0), (4, 0), (4, 3), (5, 3), (5, 0), (9, 0), (9, 4), (0, 4)], name="rooms")


def said(name: str, body: AnyBody, sequence: int = 0, incarnation: int = 0, key_of: str | None = None) -> Received:
    envelope = Envelope(sender=name, incarnation=incarnation, sequence=sequence, sent_at_s=0.0, body=body)
    return Received(Address("team", key_of or name, kind_of(body)).key, encode(envelope))


def state(position: Point) -> State:
    return State(position=position, velocity=(0.0, 0.0), mode="moving")


def intent(position: Point, goal: Point | None = None) -> Intent:
    return Intent(position=position, velocity=(0.0, 0.0), mode="moving", goal=goal)


def place_of(name: str, view: TeamView) -> Point | None:
    return next(peer.position for peer in view.status(0.0).peers if peer.name == name)


def deployment(sequence: int, epoch: int = 1) -> Deployment:
    return Deployment(
        authority=Authority(epoch=epoch, leader="base", sequence=sequence),
        warrant=Warrant(lease_s=0.8, marks=()),
        decision=sequence,
        placements=(
            Placement(robot="robot1", position=(4.5, 3.5), cell=0),
            Placement(robot="robot2", position=(1.0, 1.0), spare=True),
        ),
        edges=(("base", "robot1"), ("robot1", "agent")),
        cost=2.0,
        relays_needed=1,
        reason="the agent left",
    )


@pytest.fixture
def view(mission: Mission) -> TeamView:
    view = TeamView(mission, ROOMS)
    for entry in mission.roster:
        view.handle(PeerAppeared(entry.name), 0.0)
    return view


def test_the_chain_is_judged_by_true_line_of_sight_between_what_is_up(view: TeamView) -> None:
    view.handle(said("base", state((1.0, 1.0))), 1.0)
    view.handle(said("agent", intent((8.0, 1.0), goal=(8.0, 2.0))), 1.0)
    status = view.status(1.0)
    assert (status.up, status.links) == (2, 0)
    assert not status.agent_visible
    assert not status.chain_connected
    assert status.goal == (8.0, 2.0)

    view.handle(said("robot1", state((8.5, 2.0))), 1.0)
    status = view.status(1.0)
    assert status.agent_visible
    assert not status.chain_connected

    view.handle(said("robot2", state((4.5, 3.5))), 1.0)
    status = view.status(1.0)
    assert status.chain_connected
    assert status.links == 4

    view.handle(PeerVanished("robot2"), 1.1)
    status = view.status(1.1)
    assert not status.chain_connected
    assert [peer.mode for peer in status.peers] == ["moving", "moving", "moving", "lost"]


def test_whoever_is_silent_is_not_up_whatever_the_token_says(view: TeamView) -> None:
    view.handle(said("robot1", state((1.0, 2.0))), 0.0)
    assert view.status(SILENT_AFTER_S - 0.1).up == 1
    assert view.status(SILENT_AFTER_S + 0.1).up == 0
    view.handle(said("robot1", state((1.0, 2.5)), sequence=1), SILENT_AFTER_S + 0.2)
    assert view.status(SILENT_AFTER_S + 0.3).up == 1
    assert place_of("robot1", view) == (1.0, 2.5)


def test_late_messages_and_those_of_earlier_incarnations_change_nothing(view: TeamView) -> None:
    view.handle(said("robot1", state((2.0, 2.0)), sequence=5, incarnation=1), 0.0)
    view.handle(said("robot1", state((3.0, 3.0)), sequence=4, incarnation=1), 0.1)
    view.handle(said("robot1", state((3.0, 3.0)), sequence=9, incarnation=0), 0.1)
    assert place_of("robot1", view) == (2.0, 2.0)


def request(epoch: int, *, in_office: bool) -> VoteRequest:
    return VoteRequest(epoch=epoch, correlation="1", warrant=Warrant(lease_s=0.8, marks=()) if in_office else None)


def test_who_leads_is_who_speaks_in_office_in_the_highest_epoch_and_not_for_long(view: TeamView) -> None:
    assert view.leader(0.0) is None
    view.handle(said("robot1", request(1, in_office=False)), 0.0)
    assert view.leader(0.0) is None
    view.handle(said("base", request(1, in_office=True)), 0.1)
    assert view.leader(0.1 + 0.9 * LEASE_S) == "base"
    assert view.leader(0.1 + LEASE_S) is None
    view.handle(said("robot1", request(2, in_office=True), sequence=1), 2.0)
    view.handle(said("base", request(1, in_office=True), sequence=1), 2.1)  # went on after a pause
    assert view.status(2.2).leader == "robot1"


def test_an_independent_agent_is_where_the_ranges_say(mission: Mission) -> None:
    mission = structs.replace(mission, announces=False)
    sight = Casting(mission, ROOMS).sight
    view = TeamView(mission, ROOMS, SharedEstimate(mission, "base", LISTENER, sight))
    view.handle(said("base", state((1.0, 1.0))), 1.0)
    status = view.status(1.0)
    assert (status.agent_visible, status.estimate) == (None, None)
    heard = tuple(
        SharedRange(owner=owner, start=0, number=0, time_s=0.9, anchor=anchor, range_m=range_m, bound_m=0.2)
        for owner, anchor, range_m in (("base", (1.0, 1.0), 1.0), ("robot1", (1.0, 2.0), 2**0.5))
    )
    for measured in heard:
        view.handle(said(measured.owner, Ranges(ranges=(measured,)), sequence=1), 1.0)
    status = view.status(1.1)
    assert status.estimate is not None
    assert np.hypot(status.estimate.center[0] - 2.0, status.estimate.center[1] - 1.0) < 1.0
    assert 0.0 < status.estimate.area_m2 < 8.0
    view.handle(said("base", deployment(1), sequence=2), 1.1)
    assert not view.status(1.1).chain_connected, "nothing has been heard of the relay"
    view.handle(said("robot1", state((1.0, 3.5)), sequence=2), 1.1)
    status = view.status(1.1)
    assert status.chain_connected
    assert ", chain to the relays connected, agent within" in describe(status, mission, 1.1), (
        "nobody knows of the agent"
    )
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(draw(status, mission, 1.1))
    assert "m² at" in console.export_text()


def test_what_is_malformed_or_under_a_foreign_key_is_counted_and_not_believed(view: TeamView) -> None:
    view.handle(Received("team/v1/robot1/state", b"{"), 0.0)
    view.handle(said("robot1", state((2.0, 2.0)), key_of="robot2"), 0.0)
    view.handle(said("stranger", state((2.0, 2.0))), 0.0)
    view.handle(Received("else/where", b""), 0.0)
    assert view.malformed == 3
    assert view.status(0.0).up == 0


def test_the_latest_authority_is_the_standing_order(view: TeamView) -> None:
    view.handle(said("base", deployment(3), sequence=0), 0.0)
    view.handle(said("base", deployment(2), sequence=1), 0.0)
    view.handle(said("base", deployment(1, epoch=2), sequence=2), 0.0)
    status = view.status(0.0)
    assert status.deployment is not None
    assert status.deployment.authority == Authority(epoch=2, leader="base", sequence=1)
    assert status.relays == 1


def test_the_display_says_it_in_a_line_and_in_a_table(view: TeamView, mission: Mission) -> None:
    view.handle(said("base", state((1.0, 1.0))), 0.0)
    view.handle(said("agent", intent((2.0, 1.0), goal=(8.0, 2.0))), 0.0)
    view.handle(said("base", deployment(1), sequence=1), 0.0)
    status = view.status(0.0)
    assert describe(status, mission, 12.34) == (
        "  12.3 s  2/4 up, base leads, chain connected, 1 relay, 1 line of sight, agent to 8.0, 2.0"
    )
    console = Console(width=100, record=True, file=io.StringIO())
    console.print(draw(status, mission, 1.0))
    text = console.export_text()
    for word in ("chain connected", "robot1", "relay", "spare", "base station", "walks to 8.0, 2.0", "the agent left"):
        assert word in text
    view.handle(PeerVanished("base"), 0.1)
    assert view.leader(0.1) == "base", "its lease runs"
    nobody = "nobody leads (0 of 3 voters up, 2 needed), chain broken"
    assert nobody in describe(view.status(0.1), mission, 0.1)
    for robot in ("robot1", "robot2"):
        view.handle(said(robot, state((1.0, 2.0))), 0.1)
    assert ", nobody leads, chain broken" in describe(view.status(0.1), mission, 0.1), "they will elect one of them"
