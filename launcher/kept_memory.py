"""How much a mind keeps: the number of things in all containers that can be reached from it."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence, Set
from typing import Any, Final

from agents.casting import Casting
from agents.mission import Mission
from protocol.roster import Roster

OURS: Final = ("agents.", "protocol.", "estimation.")
"""Objects of these packages are looked into; maps, arrays and the rest of the world are not the mind's."""

CONTAINERS: Final = (dict, list, tuple, Set, Mapping, deque)

PLAIN: Final = frozenset({str, bytes, int, float, bool, type(None)})
"""Types in which nothing is kept."""

SHARED: Final = (Mission, Roster, Casting)
"""What all peers of a simulation have in common; of planners a mind keeps but a way to ask for them."""


def count_kept(root: object) -> int:
    """Number of things in the containers that an object keeps, each container once. O(what it keeps)."""
    count, seen, ahead = 0, set[int](), [root]
    while ahead:
        thing = ahead.pop()
        if id(thing) in seen:
            continue
        seen.add(id(thing))
        if isinstance(thing, CONTAINERS):
            count += len(thing)
        ahead += [other for other in _inside(thing) if type(other) not in PLAIN]
    return count


def _inside(thing: Any) -> Sequence[Any]:
    kind = type(thing)
    if kind is tuple or kind is list:
        return thing  # type: ignore[no-any-return]
    if isinstance(thing, Mapping):
        return [*thing.keys(), *thing.values()]
    if isinstance(thing, CONTAINERS):
        return list(thing)
    if not kind.__module__.startswith(OURS) or isinstance(thing, SHARED):
        return []
    if hasattr(kind, "__struct_fields__"):
        return [getattr(thing, field) for field in kind.__struct_fields__]
    slots = [slot for base in kind.__mro__ for slot in getattr(base, "__slots__", ())]
    return [*getattr(thing, "__dict__", {}).values(), *(getattr(thing, slot, None) for slot in slots)]
