"""How often a leader asks: less than it did at a steady eight times a lease, and it keeps its lease better."""

from __future__ import annotations

from random import Random
from typing import NamedTuple

import pytest

from protocol import election
from protocol.core import Heard, Persist, Say, Tick, WakeAt, Written
from protocol.election import CALM_ROUND_S, ROUND_S, Election, LeadsNoMore
from protocol.messages import Reign, Vote, VoteRequest
from protocol.roster import Roster

SECONDS = 60.0


class Office(NamedTuple):
    """A while in office."""

    rounds: int
    lost: int
    """Leases."""


def lead(voters: int, seed: int, loss: float) -> Office:
    """A leader for a minute of office, whose requests and whose voters' answers are lost by chance; else at once."""
    names = ("base", *(f"robot{number}" for number in range(1, voters)))
    chance, now_s, rounds, lost = Random(f"{voters}/{seed}"), 0.0, 0, 0
    leader = Election(Roster(names), team="t", name="base", incarnation=0, promise=None, seed=seed, now_s=-2.0)
    events: list[Heard | Written | Tick] = [Tick()]
    while now_s < SECONDS:
        for effect in leader.handle(events.pop(0), now_s):
            match effect:
                case Persist(_, token):
                    events.append(Written(token))
                case LeadsNoMore():
                    lost += 1
                case Say(VoteRequest(withdrawn=False) as request):
                    rounds += request.warrant is not None
                    reign = None if request.canvass else Reign(epoch=request.epoch, leader="base", incarnation=0)
                    vote = Vote(
                        candidate="base", correlation=request.correlation, granted=True, promise=reign, mark="0.1"
                    )
                    stands = request.warrant is None
                    heard = [name for name in names[1:] if stands or chance.random() < (1.0 - loss) ** 2]
                    events += [Heard(name, 0, vote) for name in heard]
                case WakeAt(time_s) if not events:
                    now_s = max(now_s, time_s)
        events = events or [Tick()]
    return Office(rounds, lost)


@pytest.fixture
def steady(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Eight times in a lease, whatever happens; until it is undone."""
    monkeypatch.setattr(election, "CALM_ROUND_S", ROUND_S)
    monkeypatch.setattr(election, "URGENT_ROUND_S", ROUND_S)
    return monkeypatch


@pytest.mark.parametrize("voters", [3, 9])
def test_a_leader_whom_all_answer_asks_four_times_a_lease(voters: int, steady: pytest.MonkeyPatch) -> None:
    before = lead(voters, seed=0, loss=0.0)
    steady.undo()
    now = lead(voters, seed=0, loss=0.0)
    assert before == pytest.approx(Office(round(SECONDS / ROUND_S), 0), abs=4)
    assert now == pytest.approx(Office(round(SECONDS / CALM_ROUND_S), 0), abs=4)


@pytest.mark.parametrize("loss", [0.3, 0.5])
def test_no_more_leases_are_lost_than_by_asking_at_a_steady_rate(loss: float, steady: pytest.MonkeyPatch) -> None:
    teams = [(voters, seed) for voters in (3, 4, 5, 7, 9) for seed in range(3)]
    before = [lead(*team, loss=loss).lost for team in teams]
    steady.undo()
    now = [lead(*team, loss=loss).lost for team in teams]
    assert sum(now) <= sum(before), (now, before)
    assert loss < 0.5 or sum(before) > 10, "there is something to be lost"
