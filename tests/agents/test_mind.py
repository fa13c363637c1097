"""A mind made of parts: who is given what, when it is woken, and what one part's failure costs the others."""

from __future__ import annotations

import math
from collections.abc import Iterable

import pytest

from agents.mind import Mind
from agents.role import RETRY_S, Effect, Event, Heard, Publish, WakeAt, Woken
from protocol.bus import PeerAppeared
from protocol.keys import Address
from protocol.messages import Envelope, Heartbeat


class Puppet:
    """A part that notes what it is given."""

    def __init__(self, hears: str = "", next_s: float = math.inf) -> None:
        self.hears = frozenset(hears.split())
        self.next_s = next_s
        self.events: list[Event] = []
        self.fails = False

    def handle(self, event: Event, _now_s: float) -> Iterable[Effect]:
        self.events.append(event)
        if self.fails:
            raise ZeroDivisionError("planned")
        return (Publish(Heartbeat(role="robot", mode="moving")),)


def heard(kind_role: str = "robot") -> Heard:
    body = Heartbeat(role=kind_role, mode="moving")  # type: ignore[arg-type]
    envelope = Envelope(sender="base", incarnation=0, sequence=0, sent_at_s=0.0, body=body)
    return Heard(Address("team", "base", "heartbeat"), envelope)


def test_messages_go_to_those_that_hear_them_and_all_else_to_everybody() -> None:
    one, other = Puppet("heartbeat state"), Puppet("vote")
    mind = Mind([one, other])
    assert mind.hears == {"heartbeat", "state", "vote"}
    for event in (heard(), PeerAppeared("base"), Woken((0.0, 0.0))):
        list(mind.handle(event, 1.0))
    assert len(one.events) == 3
    assert len(other.events) == 2


def test_is_woken_when_the_first_part_wants_it_and_at_once_for_a_time_that_has_passed() -> None:
    one, other = Puppet(next_s=4.0), Puppet("heartbeat", next_s=5.0)
    mind = Mind([one, other])
    assert list(mind.handle(heard(), 2.0))[-1] == WakeAt(4.0)
    one.next_s = -math.inf
    assert list(mind.handle(heard(), 2.0))[-1] == WakeAt(2.0)


def test_a_part_that_fails_keeps_none_of_the_others_from_its_work() -> None:
    before, failing, after = Puppet(next_s=9.0), Puppet(next_s=-math.inf), Puppet(next_s=9.0)
    failing.fails = True
    effects: list[Effect] = []

    def handle() -> None:
        effects.extend(Mind([before, failing, after]).handle(Woken((0.0, 0.0)), 1.0))

    with pytest.raises(ZeroDivisionError):
        handle()
    assert len(effects) == 3
    assert effects[-1] == WakeAt(1.0 + RETRY_S), "it is not woken again and again"
    assert len(after.events) == 1
