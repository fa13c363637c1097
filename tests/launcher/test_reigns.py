"""Who led when, and how long a takeover took, read from records; rules that are broken on purpose are found."""

from __future__ import annotations

import pytest

from agents.records import AnyRecord, LogLine, Mishap, Office, Ordered
from launcher.reigns import find_reigns
from protocol.messages import MemberWay, Motion, Reign

Records = list[tuple[float, str, AnyRecord]]

VOTERS = ("base", "robot1", "robot2")


def alive(peer: str, from_s: float, until_s: float) -> Records:
    """Something said ten times a second."""
    steps = range(round(10 * from_s), round(10 * until_s) + 1)
    return [(step / 10, peer, LogLine(level="debug", text="lives")) for step in steps]


def office(
    time_s: float, peer: str, leads: int | None = None, obeys: tuple[int, str] | None = None, *, incarnation: int = 0,
    led_until_s: float | None = None, obeyed_until_s: float | None = None,
) -> tuple[float, str, AnyRecord]:  # fmt: skip
    own = None if leads is None else Reign(epoch=leads, leader=peer, incarnation=incarnation)
    other = None if obeys is None else Reign(epoch=obeys[0], leader=obeys[1], incarnation=0)
    record = Office(
        incarnation=incarnation,
        standing="leading" if leads else "following",
        leads=own,
        obeys=other,
        led_until_s=led_until_s,
        obeyed_until_s=obeyed_until_s,
    )
    return time_s, peer, record


def ordered(time_s: float, peer: str, epoch: int) -> tuple[float, str, AnyRecord]:
    way = MemberWay(member="base", radius_m=0.2, speed_m_s=0.0, waypoints=((0.0, 0.0),), stages=(0, 0))
    motion = Motion(plan=0, revision=0, first_stage=0, released=0, ways=(way,), connection="none", joined=())
    return time_s, peer, Ordered(epoch=epoch, motion=motion)


def killed_leader() -> Records:
    """The base station leads until it is killed at 5 s; robot1 is obeyed by itself at 6.0 s, and by robot2 at 6.2 s."""
    first, second = (1, "base"), (2, "robot1")
    return [
        *alive("base", 0.0, 4.9),
        *alive("base", 9.0, 12.0),
        *alive("robot1", 0.0, 12.0),
        *alive("robot2", 0.0, 12.0),
        office(1.0, "base", 1, first),
        *(office(1.1, robot, None, first) for robot in VOTERS[1:]),
        ordered(1.5, "base", 1),
        (5.0, "launcher", Mishap(kind="kill", who=("base",), text="base is killed for 4 s")),
        *(office(5.8, robot, obeyed_until_s=5.7) for robot in VOTERS[1:]),
        office(6.0, "robot1", 2, second),
        office(6.2, "robot2", None, second),
        ordered(6.5, "robot1", 2),
        office(9.5, "base", None, second, incarnation=1),
    ]


def test_a_killed_leader_led_until_its_last_record_and_the_takeover_ends_when_all_others_obey() -> None:
    reigns = find_reigns(killed_leader())
    assert [(spell.peer, spell.epoch, spell.from_s, spell.until_s) for spell in reigns.led] == [
        ("base", 1, 1.0, 4.9),
        ("robot1", 2, 6.0, 12.0),
    ]
    assert [(spell.peer, spell.epoch, spell.until_s) for spell in reigns.obeyed if spell.epoch == 1] == [
        ("base", 1, 4.9),
        ("robot1", 1, 5.7),
        ("robot2", 1, 5.7),
    ]
    (takeover,) = reigns.takeovers
    assert (takeover.at_s, takeover.before, takeover.after) == (5.0, "base", "robot1")
    assert takeover.took_s == pytest.approx(1.2)
    assert takeover.back_after_s == pytest.approx(4.0)
    assert reigns.broken == ()


def test_a_leader_that_never_records_again_is_not_back_and_one_that_was_cut_off_had_not_gone() -> None:
    for_good = [entry for entry in killed_leader() if entry[1] != "base" or entry[0] < 5.0]
    cut_off = [
        (time_s, peer, Mishap(kind="partition", who=("base",), text="base is cut off") if time_s == 5.0 else record)
        if peer == "launcher" else (time_s, peer, record) for time_s, peer, record in killed_leader()
    ]  # fmt: skip
    for records in (for_good, cut_off):
        (takeover,) = find_reigns(records).takeovers
        assert (takeover.after, takeover.back_after_s) == ("robot1", None)


def test_a_peer_that_is_not_there_need_not_obey() -> None:
    records = [entry for entry in killed_leader() if entry[1] != "robot2" or (entry[0] < 5.4 and entry[0] != 6.2)]
    (takeover,) = find_reigns(records).takeovers
    assert takeover.took_s == pytest.approx(1.0)


def test_nobody_takes_over_where_others_go_on_without_orders() -> None:
    records = [entry for entry in killed_leader() if not (entry[1] == "robot2" and entry[0] == 6.2)]
    (takeover,) = find_reigns(records).takeovers
    assert (takeover.after, takeover.took_s) == (None, None)


def test_whoever_is_paused_led_until_its_lease_ran_out() -> None:
    records = [
        *alive("base", 0.0, 5.0), *alive("base", 9.0, 12.0), *alive("robot1", 0.0, 12.0),
        office(1.0, "base", 1, (1, "base")),
        (5.0, "launcher", Mishap(kind="pause", who=("base",), text="base is paused for 4 s")),
        office(6.1, "robot1", 2, (2, "robot1")),
        office(9.0, "base", None, None, led_until_s=5.8, obeyed_until_s=5.7),
        (9.0, "launcher", Mishap(kind="pause", who=("base",), text="base goes on", over=True)),
    ]  # fmt: skip
    reigns = find_reigns(records)
    assert [(spell.peer, spell.until_s) for spell in reigns.led] == [("base", 5.8), ("robot1", 12.0)]
    assert reigns.broken == ()
    assert [takeover.took_s for takeover in reigns.takeovers] == [pytest.approx(1.1)]


def test_whoever_does_not_lead_is_replaced_by_nobody() -> None:
    records = [*killed_leader(), (3.0, "launcher", Mishap(kind="kill", who=("robot2",), text="robot2 is killed"))]
    assert len(find_reigns(records).takeovers) == 1


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (office(6.4, "robot2", 3, (2, "robot1")), "robot1 and robot2 both led at 6.40 s, in epochs 2 and 3"),
        (office(6.4, "robot2", None, (3, "robot2")), "robot1 obeyed robot1 in epoch 2 while robot2 obeyed robot2"),
        (ordered(5.9, "robot1", 2), "robot1 gave orders in epoch 2 at 5.90 s, when it did not lead"),
        (ordered(6.6, "robot1", 1), "robot1 gave orders in epoch 1 at 6.60 s, when it did not lead"),
        (office(9.6, "base", None, (1, "base"), incarnation=1), "base obeyed epoch 1 at 9.60 s, after 2"),
    ],
)
def test_a_broken_rule_is_a_sentence(wrong: tuple[float, str, AnyRecord], sentence: str) -> None:
    broken = find_reigns([*killed_leader(), wrong]).broken
    assert any(text.startswith(sentence) for text in broken), broken


def test_an_epoch_that_does_not_rise_is_found() -> None:
    records = [
        *alive("base", 0.0, 3.0), *alive("robot1", 0.0, 9.0),
        office(1.0, "base", 2, (2, "base")), office(3.0, "base"), office(5.0, "robot1", 2, (2, "robot1")),
    ]  # fmt: skip
    assert find_reigns(records).broken == ("robot1 led in epoch 2 at 5.00 s, after epoch 2",)


def test_recordings_without_an_election_are_not_judged() -> None:
    assert find_reigns([ordered(1.0, "base", 1)]).broken == ()
