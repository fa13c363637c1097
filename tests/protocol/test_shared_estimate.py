"""Debts of anti-entropy: paid once, in turns, bounded."""

from __future__ import annotations

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.shared_estimate import MOST_OWED, PAUSE_S, TURN_S, Debts

records = st.tuples(st.sampled_from(["a", "b"]), st.integers(0, 9))
sets_of_records = st.lists(records, unique=True, max_size=12)


def test_turns_are_within_their_time_and_differ_between_peers() -> None:
    dues = []
    for name in range(20):
        debts = Debts(["x"], f"{name}")
        debts.owe("x", [("a", 1)], 10.0)
        dues.append(debts.next_s)
        assert not debts.pay(10.0 - 1e-9, 5)
        assert debts.pay(debts.next_s, 5) == [("a", 1)] and debts.next_s == math.inf
    assert all(10.0 <= due <= 10.0 + TURN_S for due in dues) and len(set(dues)) == 20


@settings(max_examples=200, deadline=None)
@given(sets_of_records, sets_of_records, sets_of_records)
def test_what_somebody_has_said_is_owed_no_more(to_x: list, to_y: list, overheard: list) -> None:  # type: ignore[type-arg]
    debts = Debts(["x", "y"], "seed")
    debts.owe("x", to_x, 0.0)
    debts.owe("y", to_y, 0.0)
    debts.settle(overheard)
    paid = debts.pay(TURN_S, 100)
    assert sorted(paid) == sorted({*to_x, *to_y} - {*overheard})
    assert len(paid) == len(set(paid)), "one answer is for all"
    assert debts.next_s == math.inf


def test_a_long_answer_comes_in_parts() -> None:
    debts = Debts(["x"], "seed")
    owed = [("a", number) for number in range(10)]
    debts.owe("x", owed, 0.0)
    said, now_s = [], 0.0
    for _ in range(3):
        now_s = debts.next_s
        said.append(debts.pay(now_s, 4))
        assert debts.next_s in (now_s + PAUSE_S, math.inf)
    assert said == [owed[:4], owed[4:8], owed[8:]]


def test_the_last_digest_counts_and_asking_again_does_not_put_the_turn_off() -> None:
    debts = Debts(["x"], "seed")
    debts.owe("x", [("a", 1)], 0.0)
    due_s = debts.next_s
    debts.owe("x", [("a", 2)], due_s)
    assert debts.next_s == due_s and debts.pay(due_s, 5) == [("a", 2)]
    debts.owe("x", [("a", 3)], 1.0)
    debts.owe("x", [], 1.1)
    assert debts.next_s == math.inf and not debts.pay(9.0, 5)


def test_debts_are_bounded_and_nothing_is_owed_to_strangers() -> None:
    debts = Debts(["x"], "seed")
    debts.owe("eve", [("a", 1)], 0.0)
    assert debts.next_s == math.inf
    debts.owe("x", (("a", number) for number in range(10**5)), 0.0)
    assert len(debts.pay(TURN_S, 10**6)) == MOST_OWED
