"""The votes for one reign, and the lease that they make.

Every round of asking has a correlation; a vote that bears it counts from the moment *before* that round was asked. The
lease counts from the moment at which a majority has voted since: the m-th latest of the voters' last votes, where m is
the majority. Votes of different rounds add up, so that loss costs little.
"""

from __future__ import annotations

import math
from typing import Final

from protocol.messages import Reign
from protocol.roster import Roster

CAUTION: Final = 0.9
"""A leader uses this share of its lease.

Let the clocks of all peers run at 1 - d to 1 + d seconds a second. By a slow clock the leader's lease ends at most
``CAUTION * lease / (1 - d)`` after it asked; by a fast one a voter's promise runs at least ``lease / (1 + d)`` after it
heard. The first is not later than the second as long as d <= (1 - CAUTION) / (1 + CAUTION), which is 5.2 %.
"""

CLOCK_DRIFT: Final = 0.05
"""The drift that this allows for. Ordinary clocks drift by 0.01 %."""


class Ballot:
    """Asks for and counts votes. Times are of the candidate's own clock, in seconds.

    Args:
        reign: what is voted on.
        roster: says who has a vote.
        lease_s: how long a promise runs.
    """

    def __init__(self, reign: Reign, roster: Roster, lease_s: float) -> None:
        self.reign = reign
        self._roster = roster
        self._lease_s = lease_s
        self._asked_s: dict[str, float] = {}
        self._voted_s: dict[str, float] = {}

    def ask(self, correlation: str, now_s: float) -> None:
        """Remember a round that is about to be asked, and forget those that no vote can make count any more."""
        self._asked_s = {known: at_s for known, at_s in self._asked_s.items() if now_s - at_s < self._lease_s}
        self._asked_s[correlation] = now_s

    def count(self, voter: str, correlation: str) -> None:
        """Count a vote, if it answers a round that is remembered."""
        asked_s = self._asked_s.get(correlation)
        if asked_s is not None:
            self.count_from(voter, asked_s)

    def count_from(self, voter: str, time_s: float) -> None:
        """Count a vote that was given at or after this time."""
        self._voted_s[voter] = max(time_s, self._voted_s.get(voter, -math.inf))

    @property
    def asked_last_s(self) -> float:
        """When the last round was asked; minus infinity before there is one."""
        return next(reversed(self._asked_s.values()), -math.inf)

    @property
    def asked_since_s(self) -> float:
        """When the first round was asked of those that votes can still make count; infinity before there is one."""
        return next(iter(self._asked_s.values()), math.inf)

    def is_answered(self, now_s: float) -> bool:
        """Whether the last round has been answered by all who have voted within the lease."""
        asked_s = self.asked_last_s
        return all(at_s >= asked_s or at_s + self._lease_s <= now_s for at_s in self._voted_s.values())

    def is_cast_by(self, voter: str) -> bool:
        """Whether this voter has voted."""
        return voter in self._voted_s

    def wants_only(self, voter: str, now_s: float) -> bool:
        """Whether a vote of this voter, who has not voted yet, would make the leader."""
        fresh = sum(now_s < at_s + CAUTION * self._lease_s for at_s in self._voted_s.values())
        return voter not in self._voted_s and fresh + 1 >= self._roster.majority

    @property
    def held_until_s(self) -> float:
        """When the lease ends; minus infinity before there is one."""
        latest_s = sorted(self._voted_s.values(), reverse=True)
        if len(latest_s) < self._roster.majority:
            return -math.inf
        return latest_s[self._roster.majority - 1] + CAUTION * self._lease_s
