"""Ranging over the bus: in sight only, within the bound, and nothing else is told."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import structs

from agents.driver import DiscDriver, Ranged
from agents.mind import Mind
from agents.ranging import LATE_S, MOST_OPEN, Ranging, Transponder
from agents.role import Effect, Heard, Publish, Woken
from agents.shared_estimate import SharedEstimate
from agents.shell import PeerShell
from protocol.keys import Address
from protocol.messages import AnyBody, Envelope, Point, RangeReply, RangeRequest, Ranges, decode, kind_of
from tests.agents.estimate_team import CORNER, LightCasting, make_mission

MISSION = make_mission(1)
SPEED_M_S = MISSION.agent_speed_m_s


def heard(body: AnyBody, sender: str) -> Heard:
    envelope = Envelope(sender=sender, incarnation=0, sequence=0, sent_at_s=0.0, body=body)
    return Heard(Address("team", sender, kind_of(body)), envelope)


def said(effects: list[Effect]) -> list[AnyBody]:
    return [effect.body for effect in effects if isinstance(effect, Publish)]


def asker(name: str = "robot1") -> tuple[Ranging, SharedEstimate]:
    estimate = SharedEstimate(MISSION, name, 0, LightCasting(MISSION).sight)
    return Ranging(MISSION, name, estimate), estimate


def ask(part: Ranging, now_s: float, position: Point = (2.0, 4.0)) -> RangeRequest:
    (request,) = said(list(part.handle(Woken(position), now_s)))
    assert isinstance(request, RangeRequest) and request.position == position
    return request


coordinates = st.floats(0.3, 9.7)


@settings(max_examples=200, deadline=None)
@given(st.tuples(coordinates, coordinates), st.tuples(coordinates, coordinates), st.floats(0.0, 0.5))
def test_the_agent_answers_in_sight_and_within_its_bound(agent: Point, robot: Point, noise_m: float) -> None:
    mission = structs.replace(MISSION, ranging=structs.replace(MISSION.ranging, bound_m=0.5, noise_m=noise_m))
    radio = Transponder(mission, CORNER)
    assert not list(radio.handle(heard(RangeRequest(position=robot, correlation="1"), "robot1"), 1.0))
    assert radio.next_s == -math.inf, "it is to be woken at once"
    replies = said(list(radio.handle(Woken(agent), 1.0)))
    assert radio.next_s == math.inf
    if not CORNER.line_of_sight(agent, robot):
        assert not replies
        return
    (reply,) = replies
    assert isinstance(reply, RangeReply) and (reply.asker, reply.correlation) == ("robot1", "1")
    assert abs(reply.range_m - math.dist(agent, robot)) <= noise_m + 1e-12 <= reply.bound_m + 1e-12


def test_each_asker_is_answered_its_last_question_and_strangers_are_not() -> None:
    radio = Transponder(MISSION, CORNER)
    for number in range(100):
        for name in ("robot1", "robot2"):
            list(radio.handle(heard(RangeRequest(position=(2.0, 4.0), correlation=str(number)), name), 1.0))
    operator = heard(RangeRequest(position=(2.0, 4.0), correlation="9"), "ada")
    address = Address("team", "ada", "range_request", operator=True)
    list(radio.handle(Heard(address, operator.envelope), 1.0))
    replies = said(list(radio.handle(Woken((4.0, 4.0)), 1.0)))
    assert [(reply.asker, reply.correlation) for reply in replies if isinstance(reply, RangeReply)] == [
        ("robot1", "99"),
        ("robot2", "99"),
    ]
    assert not said(list(radio.handle(Woken((4.0, 4.0)), 1.1)))


def test_noise_is_spread_and_of_the_seed() -> None:
    def ranges() -> list[float]:
        radio, found = Transponder(MISSION, CORNER), []
        for number in range(300):
            list(radio.handle(heard(RangeRequest(position=(1.0, 1.0), correlation=str(number)), "robot1"), 1.0))
            found += [reply.range_m for reply in said(list(radio.handle(Woken((4.0, 1.0)), 1.0)))]  # type: ignore[union-attr]
        return found

    measured = ranges()
    assert ranges() == measured
    errors = [range_m - 3.0 for range_m in measured]
    noise_m = MISSION.ranging.noise_m
    assert max(errors) > 0.9 * noise_m and min(errors) < -0.9 * noise_m and abs(sum(errors)) < 300 * 0.2 * noise_m


@pytest.mark.parametrize("round_trip_s", [0.0, 0.004, 0.1, 0.29])
def test_an_answer_becomes_a_range_as_wide_as_the_agent_can_have_walked(round_trip_s: float) -> None:
    part, estimate = asker()
    request = ask(part, 5.0)
    reply = RangeReply(asker="robot1", correlation=request.correlation, range_m=2.0, bound_m=0.2)
    (shared,) = said(list(part.handle(heard(reply, "agent"), 5.0 + round_trip_s)))
    assert isinstance(shared, Ranges)
    (record,) = estimate.ranges.log
    assert (record.time_s, record.anchor, record.range_m) == (5.0 + round_trip_s, (2.0, 4.0), 2.0)
    assert record.bound_m == pytest.approx(0.2 + SPEED_M_S * round_trip_s)
    assert shared.ranges[0].bound_m == record.bound_m


@pytest.mark.parametrize(("range_m", "bound_m"), [(1e7, 0.2), (1.0, 1e7)])
def test_an_answer_that_cannot_be_is_no_range(range_m: float, bound_m: float) -> None:
    part, estimate = asker()
    request = ask(part, 5.0)
    reply = RangeReply(asker="robot1", correlation=request.correlation, range_m=range_m, bound_m=bound_m)
    assert not list(part.handle(heard(reply, "agent"), 5.01))
    assert not len(estimate.ranges.log)


def test_answers_that_are_late_doubled_or_for_others_are_left_out() -> None:
    part, estimate = asker()
    request = ask(part, 5.0)
    reply = RangeReply(asker="robot1", correlation=request.correlation, range_m=2.0, bound_m=0.2)
    wrong = (
        (structs.replace(reply, asker="robot2"), "agent"),
        (structs.replace(reply, correlation="other"), "agent"),
        (reply, "robot2"),
    )
    for body, sender in wrong:
        assert not list(part.handle(heard(body, sender), 5.01))
    assert list(part.handle(heard(reply, "agent"), 5.02))
    assert not list(part.handle(heard(reply, "agent"), 5.03)), "the same answer again is no second range"
    second = ask(part, 6.0)
    late = structs.replace(reply, correlation=second.correlation)
    assert not list(part.handle(heard(late, "agent"), 6.0 + LATE_S + 0.01))
    assert len(estimate.ranges.log) == 1


def test_open_questions_are_bounded_and_asked_at_the_rate() -> None:
    part, _ = asker()
    requests, now_s = [], 0.0
    while now_s < 10.0:
        requests += said(list(part.handle(Woken((2.0, 4.0)), now_s)))
        assert part.next_s > now_s
        now_s = part.next_s
    assert len(requests) == pytest.approx(10.0 * MISSION.ranging.rate_hz, abs=1)
    assert len({request.correlation for request in requests if isinstance(request, RangeRequest)}) == len(requests)
    assert len(part._open) == MOST_OPEN


def test_a_mind_of_an_agent_that_does_not_announce_says_only_ranges_and_that_it_lives() -> None:
    """What is said does not change when it is somewhere else, but for the ranges."""
    from agents.casting import Casting
    from tests.agents.life import Life

    casting = Casting(MISSION, CORNER)
    role, _ = casting.cast("agent")
    assert isinstance(role, Mind)
    life = Life(role, (4.0, 6.0), SPEED_M_S)
    life.live_until(2.0)
    request = RangeRequest(position=(4.5, 4.5), correlation="1")
    life.hear(heard(request, "robot3"))
    life.live_until(5.0)
    assert {kind_of(body) for _, body in life.said} == {"heartbeat", "range_reply"}
    assert [time_s for time_s, body in life.said if isinstance(body, RangeReply)] == [2.0], "answered at once"
    tracks = [record for record in life.records if hasattr(record, "position")]
    assert len(tracks) > 40, "its place goes into the recording"


def test_what_a_radio_of_the_body_measures_is_shared_too() -> None:
    class Radio(DiscDriver):
        def ranges(self) -> Sequence[Ranged]:
            return (Ranged((2.0, 4.0), 2.83, 0.25),)

    part, estimate = asker()
    heard_by_others: list[AnyBody] = []

    class Bus:
        def publish(self, key: str, payload: bytes) -> None:
            assert key.startswith("team/")
            heard_by_others.append(decode(payload).body)

        def close(self) -> None: ...

    shell = PeerShell(
        Mind([part]), Radio((2.0, 4.0), 1.0), Bus(), name="robot1", team="team", incarnation=0,
        peers=[entry.name for entry in MISSION.roster], now=lambda: 1.0, wall_clock=lambda: 1.0,
        record=lambda _, record: pytest.fail(f"{record}"), execute=pytest.fail, persist=pytest.fail,
    )  # fmt: skip
    shell.start()
    shell.wake()
    (record,) = estimate.ranges.log
    assert (record.time_s, record.anchor, record.range_m, record.bound_m) == (1.0, (2.0, 4.0), 2.83, 0.25)
    assert any(isinstance(body, Ranges) for body in heard_by_others) and not shell.faults
