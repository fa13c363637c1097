"""Polygons written as well-known text (WKT, OGC 06-103r4 §7): ``POLYGON ((0 0, 4 0, 4 3, 0 0), (…))``.

A file may hold several geometries one after the other, with or without commas or semicolons between them, and each may
be tagged Z, M or ZM or start with ``SRID=…;`` as PostGIS writes it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NoReturn

Ring = list[list[float]]

_TOKEN = re.compile(r"\s*(?:([A-Za-z]+)|([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)|([(),;=]))")
_SPACE = re.compile(r"\s*")
_KIND = re.compile(
    r"(POINT|LINESTRING|LINEARRING|POLYGON|MULTIPOINT|MULTILINESTRING|MULTIPOLYGON|GEOMETRYCOLLECTION)(?:ZM|Z|M)?\b",
    re.IGNORECASE,
)
_SYSTEM = re.compile(r"SRID\s*=", re.IGNORECASE)


class BadText(ValueError):
    """Text that is no WKT; one sentence with place and remedy, without the file."""


@dataclass(frozen=True, slots=True)
class Geometries:
    """What a text holds.

    Attributes:
        polygons: each a list of rings, each ring a list of [x, y]; the outer ring first, closing points included.
        reference_systems: the numbers of the coordinate systems it names (``SRID=…``).
    """

    polygons: list[list[Ring]]
    reference_systems: list[int]


def is_well_known_text(text: str) -> bool:
    """Whether a text starts as WKT does: with the name of a geometry, or of a coordinate system."""
    start = text.lstrip()
    return bool(_KIND.match(start) or _SYSTEM.match(start))


def parse(text: str) -> Geometries:
    """All polygons in a text, those in collections too; points and lines are passed over.

    Raises:
        BadText: it is no WKT.
        RecursionError: collections in collections, some hundreds deep.

    Complexity: O(length of the text).
    """
    reader = _Reader(text)
    found = Geometries([], [])
    while reader.word is not None:
        if reader.accept("SRID"):
            reader.expect("=")
            found.reference_systems.append(int(reader.number()))
            reader.expect(";")
        found.polygons.extend(_read_geometry(reader))
        while reader.accept(",") or reader.accept(";"):
            pass
    return found


def _read_geometry(reader: _Reader) -> Iterator[list[Ring]]:
    named = _KIND.fullmatch(reader.word or "")
    if named is None:
        reader.refuse("the name of a geometry such as POLYGON")
    kind = named[1].upper()
    reader.advance()
    while any(reader.accept(tag) for tag in ("Z", "M", "ZM")):
        pass
    if reader.accept("EMPTY"):
        return
    if kind == "GEOMETRYCOLLECTION":
        for _ in reader.items():
            yield from _read_geometry(reader)
    elif kind == "MULTIPOLYGON":
        for _ in reader.items():
            if not reader.accept("EMPTY"):
                yield _read_polygon(reader)
    elif kind == "POLYGON":
        yield _read_polygon(reader)
    else:
        reader.skip_group()


def _read_polygon(reader: _Reader) -> list[Ring]:
    return [[_read_position(reader) for _ in reader.items()] for _ in reader.items()]


def _read_position(reader: _Reader) -> list[float]:
    """The point [x, y]; a height or a measure behind them is no matter of a plan."""
    position = [reader.number(), reader.number()]
    for _ in range(2):
        if reader.is_number:
            reader.number()
    return position


class _Reader:
    """The words, numbers and signs of a text, one after the other.

    Attributes:
        word: the present one; None at the end.
        is_number: whether it is a number.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._end = 0
        self.advance()

    def advance(self) -> None:
        """Go on to the next."""
        self._start = _SPACE.match(self._text, self._end).end()  # type: ignore[union-attr]
        self.word: str | None = None
        self.is_number = False
        if self._start == len(self._text):
            return
        found = _TOKEN.match(self._text, self._start)
        if found is None:
            self.refuse("a word, a number or a bracket")
        else:
            self.word, self.is_number, self._end = found[0].strip(), found[2] is not None, found.end()

    def accept(self, word: str) -> bool:
        """Whether this word is next; if so, go past it."""
        if self.word is None or self.word.upper() != word:
            return False
        self.advance()
        return True

    def expect(self, sign: str) -> None:
        """Go past this sign, or refuse."""
        if not self.accept(sign):
            self.refuse(f"'{sign}'")

    def number(self) -> float:
        """Go past a number, or refuse."""
        if not self.is_number or self.word is None:
            self.refuse("a number")
        value = float(self.word)
        self.advance()
        return value

    def items(self) -> Iterator[None]:
        """Go into a bracket, and stop at each of the items between its commas for the caller to read it."""
        self.expect("(")
        yield
        while self.accept(","):
            yield
        if not self.accept(")"):
            self.refuse("',' or ')'")

    def skip_group(self) -> None:
        """Go past a bracket and all in it."""
        self.expect("(")
        depth = 1
        while depth > 0:
            if self.word is None:
                self.refuse("')'")
            depth += (self.word == "(") - (self.word == ")")
            self.advance()

    def refuse(self, wanted: str) -> NoReturn:
        """Raise, with the place of the present word."""
        line = self._text.count("\n", 0, self._start) + 1
        column = self._start - self._text.rfind("\n", 0, self._start)
        there = self._text[self._start : self._start + 12].split("\n")[0]
        found = f"'{there}'" if there else "the end of the text"
        raise BadText(f"bad WKT at line {line}, column {column}: expected {wanted} and found {found}: correct it there")
