"""Anti-entropy: who says what again, so that everybody ends with all that anybody has said.

What is carried is opaque here: records with names. Every peer says now and then, in a *digest*, which it has. Whoever
has records that the sender lacks owes them; and since everybody hears everybody, one answer pays the debts of all. So
each waits for its turn, a random moment within :data:`TURN_S`, and says then only what it has heard nobody else say.
Digests, answers and turns may all be lost: the next digest asks again.

Everything is bounded: debts are those of the last digest of each peer, and an answer has at most so many records as its
sender gives; what is left over comes a little later. Pure; times are mission time.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from itertools import islice
from random import Random
from typing import Final, TypeAlias

Record: TypeAlias = tuple[str, int]
"""Name of a record: its source, and the source's own count."""

BASE: Final[Record] = ("", 0)
"""Stands for what is in front of all records, for who lacks some that nobody holds any more."""

TURN_S: Final = 0.2
"""Debts are paid within this, so that the first to answer spares the others the trouble."""

PAUSE_S: Final = 0.02
"""Between two parts of a long answer."""

MOST_OWED: Final = 512
"""Records owed to one peer at a time; it is told more after its next digest."""


class Debts:
    """What one peer owes the others.

    Args:
        creditors: names of the others; nothing is owed to strangers.
        seed: of the turns; a peer of its own for each peer, or all answer at once.
    """

    def __init__(self, creditors: Collection[str], seed: str) -> None:
        self._creditors = frozenset(creditors)
        self._owed: dict[str, tuple[float, dict[Record, None]]] = {}
        self._turns = Random(seed)

    @property
    def next_s(self) -> float:
        """When the next debt is due; infinite if none is."""
        return min((due_s for due_s, _ in self._owed.values()), default=math.inf)

    def owe(self, peer: str, records: Iterable[Record], now_s: float) -> None:
        """Owe a peer these and no others: it has just said what it has."""
        before = self._owed.pop(peer, None)
        owed = dict.fromkeys(islice(records, MOST_OWED))
        if owed and peer in self._creditors:
            due_s = now_s + TURN_S * self._turns.random()
            self._owed[peer] = (due_s if before is None else min(before[0], due_s), owed)

    def settle(self, records: Iterable[Record]) -> None:
        """Somebody has said these to everybody: nobody is owed them any more."""
        said = frozenset(records)
        for peer, (_, owed) in list(self._owed.items()):
            for record in said & owed.keys():
                del owed[record]
            if not owed:
                del self._owed[peer]

    def pay(self, now_s: float, most: int) -> list[Record]:
        """What is to be said now, at most so many, in the order in which it was owed; it is settled with that."""
        due = dict.fromkeys(record for due_s, owed in self._owed.values() if due_s <= now_s for record in owed)
        paid = list(due)[:most]
        self.settle(paid)
        for peer, (due_s, owed) in self._owed.items():
            if due_s <= now_s:
                self._owed[peer] = (now_s + PAUSE_S, owed)
        return paid
