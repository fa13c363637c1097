"""Who is there, against a plain model, and in the cases that a token or a heartbeat alone gets wrong."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.bus import PeerAppeared, PeerVanished
from protocol.core import Heard, Note, Tick, WakeAt
from protocol.membership import GONE_AFTER, SILENT_AFTER, Changed, Event, Membership, Presence, Restarted
from protocol.messages import Heartbeat
from protocol.roster import Roster, RosterFault

ROSTER = Roster(("base", "robot1", "robot2"), ("agent",))
BEAT = Heartbeat(role="robot", mode="waiting")


def heard(peer: str = "robot1", incarnation: int = 0) -> Heard:
    return Heard(peer, incarnation, BEAT)


class View:
    """The base station's view; remembers what it was told."""

    def __init__(self, heartbeat_s: float = 1.0) -> None:
        self.membership = Membership(ROSTER, "base", heartbeat_s)
        self.wake_s = math.inf

    def tell(self, now_s: float, *events: Event) -> list[object]:
        told: list[object] = []
        for event in events:
            *effects, wake = self.membership.handle(event, now_s)
            assert isinstance(wake, WakeAt)
            self.wake_s = wake.time_s
            told += effects
        return told

    def wait(self) -> list[object]:
        return self.tell(self.wake_s, Tick())


def states(told: list[object]) -> list[tuple[str, Presence]]:
    return [(effect.peer, effect.presence) for effect in told if isinstance(effect, Changed)]


def test_a_peer_that_starts_ends_and_comes_late() -> None:
    view = View()
    assert view.membership.presence("robot1") is Presence.UNKNOWN
    assert view.wake_s == math.inf
    assert states(view.tell(0.0, PeerAppeared("robot1"))) == [("robot1", Presence.SILENT)], "it has yet to speak"
    assert states(view.tell(0.3, heard())) == [("robot1", Presence.PRESENT)]
    assert view.tell(1.3, heard()) == []
    assert view.tell(2.0, PeerVanished("robot1")) == [], "a message may be on its way still"
    assert view.wake_s == 2.0 + GONE_AFTER
    (gone,) = view.wait()
    assert isinstance(gone, Changed)
    assert (gone.before, gone.presence) == (Presence.PRESENT, Presence.GONE)
    assert view.membership.presence("robot1") is Presence.GONE
    assert states(view.tell(60.0, heard("robot2"), heard("agent"))) == [
        ("robot2", Presence.PRESENT),
        ("agent", Presence.PRESENT),
    ]
    assert {view.membership.presence(peer) for peer in ("base", "robot2", "agent")} == {Presence.PRESENT}


def test_a_peer_that_hangs_is_silent_until_it_goes_on_or_ends() -> None:
    view = View()
    view.tell(0.0, PeerAppeared("robot1"), heard())
    assert view.wake_s == SILENT_AFTER
    assert states(view.wait()) == [("robot1", Presence.SILENT)]
    assert view.wake_s == math.inf, "it may hang as long as it likes"
    assert states(view.tell(50.0, heard())) == [("robot1", Presence.PRESENT)]
    assert states(view.wait()) == [("robot1", Presence.SILENT)]
    assert states(view.tell(99.0, PeerVanished("robot1"))) == [("robot1", Presence.GONE)]


def test_a_peer_that_has_lost_its_token_lives_as_long_as_it_is_heard() -> None:
    view = View()
    view.tell(0.0, PeerAppeared("robot1"), heard(), PeerVanished("robot1"))
    for beat in range(1, 10):
        assert view.tell(float(beat), heard()) == []
    assert states(view.wait()) == [("robot1", Presence.GONE)]
    assert view.tell(20.0, Tick()) == []


def test_a_later_incarnation_takes_over_and_the_earlier_one_is_refused() -> None:
    view = View()
    view.tell(0.0, PeerAppeared("robot1"), heard(incarnation=3))
    told = view.tell(1.0, heard(incarnation=4))
    assert told == [Restarted("robot1", 4)]
    assert view.membership.incarnation("robot1") == 4
    view.wait()
    assert view.membership.presence("robot1") is Presence.SILENT
    assert view.tell(9.0, heard(incarnation=3)) == [], "a message that was delayed for long is no sign of life"
    told = view.tell(9.5, heard(incarnation=5))
    assert told[0] == Restarted("robot1", 5)
    assert states(told) == [("robot1", Presence.PRESENT)]


def test_who_was_asleep_does_not_take_the_others_for_silent() -> None:
    view = View()
    view.tell(0.0, PeerAppeared("robot1"), PeerAppeared("robot2"), heard("robot1"), heard("robot2"))
    assert view.tell(30.0, heard("robot1")) == [], "what robot2 said meanwhile is still to be read"
    assert view.tell(30.0, heard("robot2")) == []
    assert {view.membership.presence(peer) for peer in ("base", "robot1", "robot2")} == {Presence.PRESENT}
    assert states(view.wait()) == [("robot1", Presence.SILENT), ("robot2", Presence.SILENT)]


def test_strangers_are_counted_and_told_of_once() -> None:
    view = View()
    first = view.tell(0.0, heard("robot9"))
    assert isinstance(first[0], Note)
    assert "robot9 is not on the roster" in first[0].text
    assert view.tell(0.0, *(heard(f"robot{number}") for number in range(10, 1000))) == []
    assert view.membership.strangers == 991
    assert view.membership.presence("robot9") is Presence.UNKNOWN
    assert len(view.membership._known) == 3


class Model:
    """What membership is meant to be, said another way: from the whole history of a peer, at every moment anew."""

    def __init__(self) -> None:
        self.history: list[tuple[float, Event]] = []

    def presence(self, now_s: float) -> Presence:
        presence, token, incarnation, until_s = Presence.UNKNOWN, False, -1, math.inf
        for time_s, event in [*self.history, (now_s, Tick())]:
            if presence is Presence.PRESENT and time_s >= until_s:
                presence = Presence.SILENT if token else Presence.GONE
            match event:
                case PeerAppeared():
                    token = True
                    presence = Presence.PRESENT if presence is Presence.PRESENT else Presence.SILENT
                case PeerVanished():
                    token = False
                    until_s = min(until_s, time_s + GONE_AFTER)
                    presence = Presence.GONE if presence is Presence.SILENT else presence
                case Heard(_, number) if number >= incarnation:
                    incarnation = number
                    until_s = time_s + (SILENT_AFTER if token else GONE_AFTER)
                    presence = Presence.PRESENT
        return presence


@given(st.lists(st.tuples(st.integers(0, 20), st.sampled_from("avbhi")), max_size=40))
def test_any_history_of_one_peer(steps: list[tuple[int, str]]) -> None:
    view, model, now_s = View(), Model(), 0.0
    for tenths, what in steps:
        until_s = now_s + tenths / 8
        while view.wake_s <= until_s:
            now_s = view.wake_s
            view.wait()
            assert view.membership.presence("robot1") is model.presence(now_s)
        now_s = until_s
        event: Event = {  # type: ignore[assignment]
            "a": PeerAppeared("robot1"),
            "v": PeerVanished("robot1"),
            "b": Tick(),
            "h": heard(),
            "i": heard(incarnation=1),
        }[what]
        view.tell(now_s, event)
        model.history.append((now_s, event))
        assert view.membership.presence("robot1") is model.presence(now_s)


@pytest.mark.parametrize(
    ("voters", "others", "text"),
    [
        (("base", "robot1", "robot1"), ("agent",), "lists robot1 2 times"),
        (("base", "robot1"), ("base",), "lists base 2 times"),
        (("base", "Robot 1"), (), "'Robot 1' cannot be a peer's name"),
        ((), ("agent",), "no voter"),
    ],
)
def test_rosters_that_no_team_can_have(voters: tuple[str, ...], others: tuple[str, ...], text: str) -> None:
    with pytest.raises(RosterFault, match=text):
        Roster(voters, others)


@pytest.mark.parametrize(("voters", "majority"), [(1, 1), (2, 2), (3, 2), (4, 3), (5, 3), (6, 4), (9, 5)])
def test_two_majorities_always_share_a_voter(voters: int, majority: int) -> None:
    roster = Roster(tuple(f"peer{number}" for number in range(voters)), ("agent",))
    assert roster.majority == majority
    assert 2 * roster.majority > voters >= 2 * (roster.majority - 1)
    text = roster.describe_majority()
    assert f"{majority} of {voters} voters" in text
    assert ("halves" in text) is (voters % 2 == 0)


@given(
    st.lists(
        st.tuples(
            st.sampled_from((0.0, 0.1, 0.5, 1.0, 1.5, 4.0)),
            st.sampled_from((
                heard(), heard(), heard("robot2"), heard("agent"), heard("base"), heard("robot1", 1), heard("nobody"),
                PeerAppeared("robot1"), PeerVanished("robot1"), PeerVanished("robot2"), Tick(),
            )),
        ),
        max_size=40,
    )
)  # fmt: skip
def test_noting_a_peer_in_passing_is_the_same_as_handling_what_it_says(events: list[tuple[float, Event]]) -> None:
    """Two views of the same, one of which notes in passing all that it may."""
    whole, passing, now_s = Membership(ROSTER, "base", 1.0), Membership(ROSTER, "base", 1.0), 0.0
    for later_s, event in events:
        now_s += later_s
        effects = whole.handle(event, now_s)
        if isinstance(event, Heard) and passing.refresh(event.peer, event.incarnation, now_s):
            assert effects == [WakeAt(passing.due_s)]
        else:
            assert passing.handle(event, now_s) == effects
        assert [passing.presence(name) for name in ROSTER.names] == [whole.presence(name) for name in ROSTER.names]
