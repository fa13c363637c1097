"""What a planner of schedules says when there is none."""

from __future__ import annotations

from planning.motion_plan import Schedule


class NoSchedule(ValueError):
    """The members cannot get to the ends of their paths together, or no way was found within bounded effort.

    Attributes:
        text: one sentence with members and places.
        between: the two members that would have to part, or that are in each other's way, by name; None where no two
            can be named.
        best: what can be done all the same: a schedule that keeps the rules as far as the starts do, and brings the
            members as far along their paths as the search got.
        proven: whether the search looked at all that there is to look at: no schedule exists on its own terms (on its
            grid, say). False where it gave up.
    """

    def __init__(
        self, text: str, best: Schedule, between: tuple[str, str] | None = None, *, proven: bool = False
    ) -> None:
        super().__init__(text)
        self.text = text
        self.best = best
        self.between = between
        self.proven = proven
