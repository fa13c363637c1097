"""How much a mind keeps: the number of things in all containers that can be reached from it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping, Set
from functools import cache
from itertools import chain
from typing import Any, Final, TypeAlias

from agents.casting import Casting
from agents.mission import Mission
from protocol.roster import Roster

OURS: Final = ("agents.", "protocol.", "estimation.")
"""Objects of these packages are looked into; maps, arrays and the rest of the world are not the mind's."""

PLAIN: Final = frozenset({str, bytes, int, float, bool, type(None)})
"""Types in which nothing is kept."""

SHARED: Final = (Mission, Roster, Casting)
"""What all peers of a simulation have in common; of planners a mind keeps but a way to ask for them."""

Look: TypeAlias = Callable[[Any], Iterable[Any]]


def count_kept(root: object) -> int:
    """Number of things in the containers that an object keeps, each container once. O(what it keeps)."""
    ahead: list[Any] = [root]
    count, seen = 0, set[int]()
    while ahead:
        thing = ahead.pop()
        if id(thing) in seen:
            continue
        seen.add(id(thing))
        is_container, look = _how_to_look(thing.__class__)
        if is_container:
            count += len(thing)
        if look is not None:
            ahead += [other for other in look(thing) if type(other) not in PLAIN]
    return count


@cache
def _how_to_look(kind: type[Any]) -> tuple[bool, Look | None]:
    """Whether things of a type are containers, and what gives all that they keep; None: that is not looked for."""
    if issubclass(kind, Mapping):
        return True, lambda thing: chain(thing.keys(), thing.values())
    if issubclass(kind, (list, tuple, Set, deque)):
        return True, iter
    if not kind.__module__.startswith(OURS) or issubclass(kind, SHARED):
        return False, None
    if hasattr(kind, "__struct_fields__"):
        fields = kind.__struct_fields__
        return False, lambda thing: [getattr(thing, field) for field in fields]
    slots = [slot for base in kind.__mro__ for slot in getattr(base, "__slots__", ())]
    return False, lambda thing: [
        *getattr(thing, "__dict__", {}).values(),
        *(getattr(thing, slot, None) for slot in slots),
    ]
