"""Who belongs to a team, and how many votes make a majority."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from protocol.keys import is_name


class RosterFault(ValueError):
    """A roster that no team can have; the text is one sentence that says what to change."""


@dataclass(frozen=True, slots=True)
class Roster:
    """The peers of a team, as the scenario lists them; the same for everybody, for the whole mission.

    A robot that replaces another takes over its name, with a later incarnation: the number of votes never changes.

    Raises:
        RosterFault: a name is listed twice or is none, or nobody has a vote.
    """

    voters: tuple[str, ...]
    """Base station and robots, in the order in which they are preferred as leaders: the base station first."""
    others: tuple[str, ...] = ()
    """The tracked agent, and whoever else speaks but has no vote."""

    def __post_init__(self) -> None:
        for name, count in Counter(self.names).items():
            if not is_name(name):
                raise RosterFault(
                    f"the roster's '{name}' cannot be a peer's name: use a lower-case letter, then up to 31 lower-case "
                    "letters, digits and '_'"
                )
            if count > 1:
                raise RosterFault(
                    f"the roster lists {name} {count} times: give each peer a name of its own, or it would have more "
                    "than one vote"
                )
        if not self.voters:
            raise RosterFault("the roster has no voter, so that nobody can lead: list the base station or a robot")

    @property
    def names(self) -> tuple[str, ...]:
        """All peers, voters first."""
        return self.voters + self.others

    @property
    def majority(self) -> int:
        """Votes that make a leader: more than half of the voters listed, whoever of them is there."""
        return len(self.voters) // 2 + 1

    def describe_majority(self) -> str:
        """What a majority is, in one sentence, and what that means if the team parts into halves."""
        voters = len(self.voters)
        text = f"{self.majority} of {voters} voters make a leader"
        if voters % 2:
            return f"{text}: the team goes on without any {voters - self.majority} of them"
        return (
            f"{text}: if the team parts into two halves of {voters // 2} neither has one and all hold; one voter more "
            "or less would let one part go on"
        )
