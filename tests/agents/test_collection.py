"""Where a robot may be whom a new leader hears no more: and where it came by, if all of its plan may have gone back."""

from __future__ import annotations

from typing import Any

import pytest

from agents.collection import Collection
from agents.role import Heard
from protocol.keys import Address
from protocol.messages import Envelope, Point, Progress, State

CORNERS: tuple[Point, ...] = ((0.0, 0.0), (2.0, 0.0), (2.0, 3.0), (5.0, 3.0))


class Attendance:
    """Says who is there."""

    def __init__(self, *there: str) -> None:
        self.there = set(there)

    def is_there(self, peer: str, _incarnation: int) -> bool:
        return peer in self.there


def state(position: Point, path: tuple[Point, ...] = (), *, plan: int = 1, retreat: int | None = None) -> State:
    progress = Progress(epoch=1, plan=plan, revision=0, finished=0, retreat=retreat)
    return State(position=position, velocity=(0.0, 0.0), mode="moving", target=None, path=path, progress=progress)


def heard(*said: tuple[str, State], there: tuple[str, ...] = ()) -> Collection:
    attendance: Any = Attendance(*there)
    collection = Collection(attendance, "agent")
    for sequence, (name, body) in enumerate(said):
        envelope = Envelope(sender=name, incarnation=0, sequence=sequence, sent_at_s=0.0, body=body)
        assert not list(collection.handle(Heard(Address("team", name, "state"), envelope), 0.0))
    return collection


ON_ITS_WAY = (
    ("robot1", state(CORNERS[0], CORNERS)),
    ("robot1", state((1.0, 0.0), ((1.0, 0.0), *CORNERS[1:]))),
    # words between are lost: it has gone round two corners
    ("robot1", state((3.0, 3.0), ((3.0, 3.0), CORNERS[3]))),
)


def test_who_may_have_gone_back_is_anywhere_on_the_way_that_it_has_come() -> None:
    places = heard(*ON_ITS_WAY).whereabouts("robot1", None)
    assert places == ((3.0, 3.0), (5.0, 3.0), (3.0, 3.0), (2.0, 3.0), (2.0, 0.0), (0.0, 0.0))


@pytest.mark.parametrize("witness", ["another robot", "the leader"])
def test_nobody_has_gone_back_while_one_of_the_plan_has_not_turned(witness: str) -> None:
    if witness == "another robot":
        places = heard(*ON_ITS_WAY, ("robot2", state((9.0, 9.0))), there=("robot2",)).whereabouts("robot1", None)
    else:
        places = heard(*ON_ITS_WAY).whereabouts("robot1", state((9.0, 9.0)))
    assert places == ((3.0, 3.0), (5.0, 3.0))


@pytest.mark.parametrize("other", [state((9.0, 9.0), plan=2), state((9.0, 9.0), retreat=0)])
def test_who_has_turned_or_follows_another_plan_is_no_witness(other: State) -> None:
    collection = heard(*ON_ITS_WAY, ("robot2", other), there=("robot2",))
    assert CORNERS[0] in collection.whereabouts("robot1", None)


def test_the_way_of_an_earlier_plan_is_forgotten() -> None:
    collection = heard(*ON_ITS_WAY, ("robot1", state((5.0, 3.0), plan=2)))
    assert collection.whereabouts("robot1", None) == ((5.0, 3.0),)


def test_nothing_is_known_of_who_was_never_heard() -> None:
    assert heard().whereabouts("robot1", None) == ()
