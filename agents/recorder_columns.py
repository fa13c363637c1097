"""Values of several rows as rerun's columns, which in bulk cost a fifth of single ones."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeAlias

import numpy as np
import rerun as rr

from agents.records import Track
from protocol.messages import Point

Columns: TypeAlias = Callable[[list[Any]], Iterable[Any]]
"""Turns the values of several rows into rerun's columns."""


def journal_columns(texts: list[str]) -> Iterable[Any]:
    """One text per row."""
    return rr.TextDocument.columns(text=texts)  # type: ignore[no-any-return]


def body_columns(tracks: list[Track]) -> Iterable[Any]:
    """Dot, disc and arrow of a body."""
    positions = [track.position for track in tracks]
    velocities = [track.velocity for track in tracks]
    return [
        *rr.Points2D.columns(positions=positions),
        *rr.Ellipses2D.columns(centers=positions),
        *rr.Arrows2D.columns(origins=positions, vectors=velocities),
    ]


def line_columns(lines: list[tuple[Point, ...]]) -> Iterable[Any]:
    """One line per row; a line without points takes the last one away."""
    return links_columns([[line] if len(line) > 1 else [] for line in lines])


def links_columns(rows: list[Sequence[tuple[Point, ...]]]) -> Iterable[Any]:
    """Any number of lines per row."""
    strips = [line for row in rows for line in row]
    return rr.LineStrips2D.columns(strips=strips).partition([len(row) for row in rows])  # type: ignore[no-any-return]


def scalar_columns(rows: list[list[float]]) -> Iterable[Any]:
    """As many values in each row."""
    values = np.array(rows)
    return rr.Scalars.columns(scalars=values.ravel()).partition([values.shape[1]] * len(rows))  # type: ignore[no-any-return]


def places_columns(rows: list[Sequence[Point]]) -> Iterable[Any]:
    """Any number of points per row."""
    places = [place for row in rows for place in row]
    return rr.Points2D.columns(positions=places).partition([len(row) for row in rows])  # type: ignore[no-any-return]
