"""The shared estimate on a bad network: the agent is inside every peer's set, and in the end all have the same."""

from __future__ import annotations

import pytest
from msgspec import structs

from agents.range_message import MOST_RANGES, MOST_SOURCES
from agents.role import Heard, Publish, Woken
from agents.shared_estimate import REPEATED, SharedEstimate
from launcher.fault_timetable import Clock, Cut, Delay, Duplicate, Fault, Kill, Loss, Partition, Pause
from protocol.keys import Address
from protocol.messages import (
    AnyBody,
    ConvexPiece,
    Envelope,
    HeardRanges,
    RangeBase,
    RangeDigest,
    Ranges,
    SharedRange,
    decode,
    encode,
    kind_of,
)
from tests.agents.estimate_team import VOTERS, EstimateTeam, LightCasting, make_mission

HORIZON_S = 8.0
"""Ranges are waited for so long here, lest the tests take long."""

BAD_LINKS: tuple[Fault, ...] = (
    Loss(at_s=0.0, share=0.3),
    Duplicate(at_s=0.0, share=0.3),
    Delay(at_s=0.0, least_s=0.005, mean_s=0.05, tail="exponential", overtaking=True),
)
CLOCKS: tuple[Fault, ...] = (
    Clock(at_s=0.0, who="robot1", offset_s=0.07),
    Clock(at_s=0.0, who="robot2", offset_s=-0.06),
    Clock(at_s=0.0, who="agent", offset_s=3.0),
)
WORST = "all of it, and restarts"
HARDSHIPS = {
    "a good network": (),
    "loss, duplicates and overtaking": BAD_LINKS,
    "clocks apart": CLOCKS,
    WORST: (
        *BAD_LINKS,
        *CLOCKS,
        Kill(at_s=2.0, for_s=1.5, who="robot2"),
        Kill(at_s=3.0, for_s=0.5, who="agent"),
        Pause(at_s=4.0, for_s=1.5, who="robot3"),
        Partition(at_s=6.0, for_s=2.5, group=("base", "robot1")),
    ),
}


def heard(body: AnyBody, sender: str = "robot1", incarnation: int = 0) -> Heard:
    envelope = Envelope(sender=sender, incarnation=incarnation, sequence=0, sent_at_s=0.0, body=body)
    return Heard(Address("team", sender, kind_of(body)), envelope)


def a_range(**changes: object) -> SharedRange:
    said = SharedRange(owner="robot1", start=0, number=3, time_s=5.0, anchor=(2.0, 4.0), range_m=2.83, bound_m=0.2)
    return structs.replace(said, **changes)


def sets(team: EstimateTeam) -> dict[str, object]:
    """What each peer knows at one moment, to compare exactly."""
    return {name: team.estimate(name).ranges.state_at(team.now_s).tight.snapshot() for name in VOTERS}


@pytest.mark.parametrize(("hardship", "seed"), [*((hardship, 1) for hardship in HARDSHIPS), (WORST, 2)])
def test_the_agent_is_inside_every_set_and_all_end_with_the_same(hardship: str, seed: int) -> None:
    team = EstimateTeam(seed, *HARDSHIPS[hardship], clock_bound_s=0.15)
    team.run_until(9.0)
    assert not team.escapes, f"seed {seed}: {team.escapes[:3]}"
    assert team.checks > 50
    # The faults go on; only ranging ends.
    team.silence_the_agent()
    team.run_until(16.0)
    known = sets(team)
    assert all(held == known["base"] for held in known.values()), f"seed {seed}"
    logs = [team.estimate(name).ranges for name in VOTERS]
    assert len({frozenset(log.log.heard.items()) for log in logs}) == 1, f"seed {seed}"
    assert not any(log.late for log in logs), f"seed {seed}"
    fingerprints = {log.fingerprint(12.0) for log in logs}
    assert len(fingerprints) == 1 and fingerprints != {None}


def test_who_was_away_for_longer_than_ranges_are_kept_ends_with_the_same_set() -> None:
    """It has to be told the set that is left of them; the others' memory is bounded meanwhile."""
    away_s = HORIZON_S + 5.0
    team = EstimateTeam(
        3,
        Kill(at_s=2.0, for_s=away_s, who="robot2"),
        Loss(at_s=0.0, share=0.2),
        rate_hz=2.0,
        check_s=2.0,
        horizon_s=HORIZON_S,
    )
    team.run_until(2.0 + away_s)
    most = 2.0 * len(VOTERS) * (HORIZON_S + 2.0)
    for name in ("base", "robot1", "robot3"):
        ranges = team.estimate(name).ranges
        assert ranges.folded > 10, "nothing was folded, and the test shows nothing"
        assert len(ranges.log) <= most
    team.run_until(4.0 + away_s)
    team.silence_the_agent()
    team.run_until(10.0 + away_s)
    assert not team.escapes
    known = sets(team)
    assert all(held == known["base"] for held in known.values())
    assert team.estimate("robot2").ranges.log.heard == team.estimate("base").ranges.log.heard


def test_the_larger_part_keeps_its_base_when_a_long_partition_heals() -> None:
    apart_s = HORIZON_S + 5.0
    others = ("base", "robot1", "robot3")
    cuts = [
        Cut(at_s=2.0, for_s=apart_s, speakers=speakers, hearers=hearers)
        for speakers, hearers in ((("robot2",), others), (others, ("robot2",)))
    ]
    team = EstimateTeam(4, *cuts, rate_hz=2.0, check_s=2.0, horizon_s=HORIZON_S)
    team.run_until(1.0 + apart_s)
    alone, together = team.estimate("robot2").ranges, team.estimate("base").ranges
    assert alone.folded and together.folded > alone.folded
    team.run_until(4.0 + apart_s)
    team.silence_the_agent()
    team.run_until(12.0 + apart_s)
    assert not team.escapes
    known = sets(team)
    assert all(held == known["base"] for held in known.values())


def test_peers_record_what_they_know_at_the_same_moments() -> None:
    team = EstimateTeam(5)
    team.run_until(10.2)
    moments: dict[float, dict[str, object]] = {}
    for time_s, peer, estimate in team.estimates:
        assert estimate.compared_s <= time_s - 2.0
        moments.setdefault(estimate.compared_s, {})[peer] = estimate.fingerprint
    complete = [prints for compared_s, prints in moments.items() if compared_s > 0.0]
    assert len(complete) == 8
    for prints in complete:
        assert prints.keys() == set(VOTERS) and len(set(prints.values())) == 1
    assert len({prints["base"] for prints in complete}) == len(complete)


def fresh(name: str = "base") -> SharedEstimate:
    mission = make_mission(1)
    return SharedEstimate(mission, name, 0, LightCasting(mission).sight)


@pytest.mark.parametrize(
    "changes",
    [
        {"owner": "agent"},
        {"owner": "stranger"},
        {"time_s": 5.3},
        {"time_s": 1e300},
        {"time_s": -1e300},
        {"number": 4000},
        {"anchor": (10.5, 4.0)},
        {"range_m": 40.0},
        {"bound_m": 1e6},
    ],
)
def test_what_no_peer_can_have_measured_is_left_out(changes: dict[str, object]) -> None:
    estimate = fresh()
    wrong = a_range(**({"number": 4} | changes))
    list(estimate.handle(heard(Ranges(ranges=(a_range(), wrong))), 5.0))
    assert [record.number for record in estimate.ranges.log] == [3]
    assert estimate.contains((4.0, 6.0), 5.0) and not estimate.contains((2.0, 4.0), 5.0)


def test_sources_are_bounded() -> None:
    estimate = fresh()
    for start in range(500):
        list(estimate.handle(heard(Ranges(ranges=(a_range(start=start, number=0),))), 5.0))
    assert len(estimate.ranges.log) <= 128


def test_sources_are_bounded_whatever_one_message_says() -> None:
    estimate = fresh()
    for first in range(0, MOST_SOURCES + 20, 30):
        said = tuple(a_range(start=first + start, number=0) for start in range(30))
        list(estimate.handle(heard(Ranges(ranges=said)), 5.0))
    assert len(estimate.ranges.log.heard) == MOST_SOURCES


def test_sources_are_bounded_whatever_a_base_says() -> None:
    for count, taken in ((MOST_SOURCES, True), (MOST_SOURCES + 1, False)):
        estimate = fresh()
        base = a_base(heard=tuple(HeardRanges(owner="robot1", start=start, below=10) for start in range(count)))
        list(estimate.handle(heard(base), 4.5))
        assert (estimate.target(4.5) is not None) is taken
        assert len(estimate.ranges.log.heard) == (count if taken else 0)


def a_base(**changes: object) -> RangeBase:
    said = RangeBase(
        time_s=4.0, owner="robot1", start=0, number=9, heard=(HeardRanges(owner="robot1", start=0, below=10),),
        fingerprint=7, origin=(2.0, 4.0),
        pieces=(ConvexPiece(corners=((1.0, 1.0), (3.0, 1.0), (3.0, 3.0), (1.0, 3.0)), checked_m=1.0),),
        rings=(), rejections=0,
    )  # fmt: skip
    return structs.replace(said, **changes)


def test_a_base_is_gone_on_from() -> None:
    estimate = fresh()
    list(estimate.handle(heard(a_base()), 4.5))
    target = estimate.target(4.0)
    assert target is not None and estimate.contains((4.0, 6.0), 4.0) and not estimate.contains((2.0, 4.0), 4.0)


@pytest.mark.parametrize(
    "changes",
    [
        {"owner": "agent"},
        {"time_s": 4.9},
        {"number": 10**6},
        {"origin": (1e6, 0.0)},
        {"heard": (HeardRanges(owner="robot1", start=0, below=10**9),)},
        {"heard": (HeardRanges(owner="eve", start=0, below=1),)},
        {"pieces": (ConvexPiece(corners=((1.0, 1.0), (1.0, 3.0), (3.0, 3.0)), checked_m=1.0),)},
        {"pieces": (ConvexPiece(corners=((0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0)), checked_m=1.0),)},
    ],
)
def test_a_base_that_cannot_be_is_left_out(changes: dict[str, object]) -> None:
    estimate = fresh()
    list(estimate.handle(heard(a_base(**changes)), 4.5))
    assert estimate.target(4.5) is None


def test_who_lacks_ranges_is_sent_them_by_one_of_those_that_have_them() -> None:
    """Everybody hears the first answer, and the others keep theirs to themselves."""
    having = [fresh(name) for name in ("base", "robot1", "robot3")]
    ranges = [
        a_range(owner=owner, number=number, time_s=0.25 * number)
        for number in range(25)
        for owner in ("base", "robot1")
    ]
    for estimate in having:
        for begin in (0, 25):
            list(estimate.handle(heard(Ranges(ranges=tuple(ranges[begin : begin + 25]))), 7.0))
        list(estimate.handle(heard(RangeDigest(clock_s=7.0, heard=()), "robot2"), 7.0))
    said: list[Ranges] = []
    now_s = 7.0
    while now_s < 8.0:
        speaker = min(having, key=lambda estimate: estimate._debts.next_s)
        now_s = speaker._debts.next_s
        if now_s == float("inf"):
            break
        for effect in speaker.handle(Woken((1.0, 1.0)), now_s):
            if isinstance(effect, Publish) and isinstance(effect.body, Ranges):
                said.append(effect.body)
                for estimate in having:
                    list(estimate.handle(heard(effect.body, "robot3"), now_s))
    assert [len(message.ranges) for message in said] == [MOST_RANGES, 50 - MOST_RANGES]
    assert [one for message in said for one in message.ranges] == ranges


def test_a_new_range_is_said_at_once_with_those_before_it() -> None:
    estimate = fresh()
    for number in range(5):
        (effect,) = estimate.measured((1.0, 1.0), 5.83, 0.2, 1.0 + number)
        assert isinstance(effect, Publish) and isinstance(effect.body, Ranges)
        numbers = [one.number for one in effect.body.ranges]
        assert numbers == list(range(max(0, number + 1 - REPEATED), number + 1))
        assert decode(encode(heard(effect.body, "base").envelope)).body == effect.body


def test_who_joins_late_says_what_it_has_as_soon_as_it_hears_what_others_have() -> None:
    """Its first digest was said when it was linked with nobody; the next of its rhythm is up to a second away."""
    late = fresh("robot2")
    now_s = 100.0
    list(late.handle(Woken((1.0, 1.0)), now_s))
    others = RangeDigest(clock_s=now_s, heard=(HeardRanges(owner="base", start=0, below=300),))
    nothing = RangeDigest(clock_s=now_s, heard=())
    list(late.handle(heard(nothing, "robot3"), now_s))
    assert late.next_s > now_s, "who has nothing has nothing to send"
    for sender, expected in (("base", 1), ("robot1", 0)):
        list(late.handle(heard(others, sender), now_s))
        effects = list(late.handle(Woken((1.0, 1.0)), now_s))
        digests = [e.body for e in effects if isinstance(e, Publish) and isinstance(e.body, RangeDigest)]
        assert [digest.heard for digest in digests] == [()] * expected
        assert late.next_s > now_s
