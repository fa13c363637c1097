"""How messages write numbers of things, places, and what is wrong with a value."""

from __future__ import annotations

import re

from protocol.messages import Point

_KINDS = {
    "float": "a number", "int": "a whole number", "str": 'text in quotes', "array": "a list", "object": "a table",
    "bool": "true or false", "null": "nothing",
}  # fmt: skip
_BOUNDS = {">=": "at least", ">": "more than", "<=": "at most", "<": "less than"}


def counted(number: int, noun: str) -> str:
    """A number of things, e.g. ``1 robot`` or ``2 robots``."""
    return f"{number} {noun}" + "s" * (number != 1)


def text_of(point: Point) -> str:
    """A place as scenario files have it."""
    return f"[{point[0]:g}, {point[1]:g}]"


def misfit(said: str) -> str:
    """What is wrong with a value, to follow its place in a file; empty if msgspec has ``said`` something else."""
    if kinds := re.fullmatch(r"Expected `([^`]*)`, got `(.*)`", said):
        wanted = " or ".join(_KINDS.get(kind, kind) for kind in kinds[1].split(" | ") if kind != "null")
        return f"is {_KINDS.get(kinds[2], f'a {kinds[2]}')}; it must be {wanted}"
    if bound := re.fullmatch(r"Expected `(?:int|float)(?: \| null)?` (>=|>|<=|<) (\S+)", said):
        return f"is out of range; it must be {_BOUNDS[bound[1]]} {bound[2].removesuffix('.0')}"
    if said == "Number out of range":
        return "is out of range; it must have fewer digits"
    return ""
