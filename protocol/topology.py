"""Trees as values: whether one joins its members, and what it takes to go from one to the next."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import TypeAlias

from protocol.messages import Edge, Tree

Links: TypeAlias = frozenset[frozenset[str]]
"""Edges, in whichever order their ends are named."""


def links_of(edges: Iterable[Edge]) -> Links:
    """Edges without regard to the order of their ends."""
    return frozenset(frozenset(edge) for edge in edges)


def find_fault(tree: Tree) -> str:
    """Why this is no tree that joins all of its members, and nobody else; empty if it is one. O(n²)."""
    for member, count in Counter(tree.members).items():
        if count > 1:
            return f"{member} is a member {count} times"
    for one, other in tree.edges:
        if one == other:
            return f"{one} is linked with itself"
        for end in (one, other):
            if end not in tree.members:
                return f"{end} has a link and is no member"
    reached = [tree.members[0]]
    for member in reached:
        for edge in tree.edges:
            if member in edge:
                other = edge[0] if edge[1] == member else edge[1]
                if other not in reached:
                    reached.append(other)
    if missing := [member for member in tree.members if member not in reached]:
        return f"{missing[0]} is not joined to {tree.members[0]}"
    if len(tree.edges) >= len(tree.members):
        return f"{len(tree.edges)} links between {len(tree.members)} members go round in a circle"
    return ""


def without(edges: Iterable[Edge], others: Iterable[Edge]) -> tuple[Edge, ...]:
    """Those edges that are not among others."""
    known = links_of(others)
    return tuple(edge for edge in edges if frozenset(edge) not in known)


def in_words(edges: Iterable[Edge]) -> str:
    """A list of links to be read."""
    return ", ".join(f"{one}\N{EN DASH}{other}" for one, other in edges) or "none"
