"""Trees that could not be agreed on: each is left alone for a while, for longer every time.

What has been refused once is mostly refused again a moment later, and the planner, which does not know why, wants the
same tree again. A leader that asked at once would do nothing else.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

from agents.rhythm import EARLY_S
from protocol.messages import Edge
from protocol.topology import links_of

REST_S: Final = 0.1
"""A tree that was given up is left alone for so long the first time, and for twice as long each time after."""

LONGEST_S: Final = 2.0
"""But for no longer than this: what stood in its way may be over."""

FORGOTTEN_S: Final = 10.0
"""A tree that has not been wanted for so long begins anew."""


@dataclass(slots=True)
class _Setback:
    times: int
    until_s: float
    over: bool = False
    """Whether that has been noticed."""

    def ends(self, now_s: float) -> bool:
        return now_s >= self.until_s - EARLY_S


class Setbacks:
    """See the module. A tree is known by its links, in whatever order and direction."""

    def __init__(self) -> None:
        self._setbacks: dict[frozenset[frozenset[str]], _Setback] = {}

    @property
    def next_s(self) -> float:
        """When a tree may be tried again next."""
        if not self._setbacks:
            return float("inf")
        return min((setback.until_s for setback in self._setbacks.values() if not setback.over), default=float("inf"))

    def note(self, edges: Collection[Edge], now_s: float) -> None:
        """Learn that a tree has been given up."""
        self._setbacks = {
            tree: setback for tree, setback in self._setbacks.items() if now_s < setback.until_s + FORGOTTEN_S
        }
        tree = links_of(edges)
        times = self._setbacks[tree].times + 1 if tree in self._setbacks else 1
        self._setbacks[tree] = _Setback(times, now_s + min(REST_S * 2.0 ** min(times - 1, 16), LONGEST_S))

    def may_try(self, edges: Collection[Edge], now_s: float) -> bool:
        """Whether a tree need not be left alone any more."""
        setback = self._setbacks.get(links_of(edges))
        return setback is None or setback.ends(now_s)

    def due(self, now_s: float) -> bool:
        """Whether since this was asked last there is a tree that may be tried again."""
        over = [setback for setback in self._setbacks.values() if not setback.over and setback.ends(now_s)]
        for setback in over:
            setback.over = True
        return bool(over)

    def forget(self, edges: Collection[Edge] | None = None) -> None:
        """Begin anew with a tree, or with all: they can be agreed on, or the team is another one."""
        if edges is None:
            self._setbacks.clear()
        else:
            self._setbacks.pop(links_of(edges), None)
