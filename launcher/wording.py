"""How messages write numbers of things and places."""

from __future__ import annotations

from protocol.messages import Point


def counted(number: int, noun: str) -> str:
    """A number of things, e.g. ``1 robot`` or ``2 robots``."""
    return f"{number} {noun}" + "s" * (number != 1)


def text_of(point: Point) -> str:
    """A place as scenario files have it."""
    return f"[{point[0]:g}, {point[1]:g}]"
