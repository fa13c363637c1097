"""Key expressions: ``<team>/v1/<peer>/<kind>``, and ``<team>/v1/operator/<name>/<kind>`` for people and their programs.

Everything that a speaker says lies under its own prefix, so that a certificate can be tied to a key. What is for one
peer only has that peer's name behind its kind, ``<team>/v1/<peer>/<kind>/<to>``, so that the others need not carry it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache

VERSION = "v1"
OPERATOR = "operator"
"""No peer may be called so: it is the prefix of the operators."""

ALIVE = "alive"
"""Kind of a liveliness token."""

ADDRESSED_KINDS = frozenset({"vote", "range_reply"})
"""Kinds that are said to one peer. Whoever else listens to all keys hears them too."""

_NAME = re.compile(r"[a-z][a-z0-9_]{0,31}\Z")


@dataclass(frozen=True, slots=True)
class Address:
    """Who says what to whom: the meaning of a key."""

    team: str
    speaker: str
    kind: str
    operator: bool = False
    to: str = ""
    """The peer that it is for, if it is of the :data:`ADDRESSED_KINDS`; empty: all."""

    @property
    def key(self) -> str:
        """The key expression."""
        middle = f"{OPERATOR}/{self.speaker}" if self.operator else self.speaker
        return f"{self.team}/{VERSION}/{middle}/{self.kind}" + (f"/{self.to}" if self.to else "")


def is_name(text: str) -> bool:
    """Whether a text can be the name of a team, a peer or an operator."""
    return _NAME.match(text) is not None and text != OPERATOR


def everything(team: str) -> str:
    """Expression that matches all publications of a team, operators included."""
    return f"{team}/{VERSION}/**"


def tokens(team: str) -> str:
    """Expression that matches the liveliness tokens of a team's peers."""
    return f"{team}/{VERSION}/*/{ALIVE}"


@lru_cache(maxsize=1024)  # the same few keys come again and again
def parse(key: str) -> Address | None:
    """Address of a key, or None if it is not one of ours."""
    chunks = key.split("/")
    if len(chunks) == 4 and chunks[1] == VERSION and chunks[2] != OPERATOR:
        return Address(chunks[0], chunks[2], chunks[3])
    if len(chunks) == 5 and chunks[1] == VERSION and chunks[2] == OPERATOR:
        return Address(chunks[0], chunks[3], chunks[4], operator=True)
    if len(chunks) == 5 and chunks[1] == VERSION and chunks[3] in ADDRESSED_KINDS and chunks[4]:
        return Address(chunks[0], chunks[2], chunks[3], to=chunks[4])
    return None


def route(key: str) -> tuple[str, str]:
    """Kind of a key, and whom it is for (empty: all): all that is needed to pass it on. Cheap; any text has a route."""
    chunks = key.rsplit("/", 4)
    if len(chunks) == 5 and chunks[3] in ADDRESSED_KINDS and chunks[2] != OPERATOR:
        return chunks[3], chunks[4]
    return chunks[-1], ""
