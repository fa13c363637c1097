"""Where the bodies of a team stand, in a file that all of its processes map: the world remembers when a mind dies.

Each process writes the place of its own body; the launcher reads it when it starts another process under that name.
What others have heard of a peer would be late, and nobody hears where an independent agent is.
"""

from __future__ import annotations

import math
import mmap
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from protocol.messages import Point

BODIES: Final = "bodies"
"""Name of the file in the folder of a run."""

_PLACE: Final = struct.Struct("<dd")


class BodyPlaces:
    """Places by name.

    Args:
        file: made by the launcher.
        names: of all peers, in the order of the roster.
        create: make the file anew, with no places in it.

    Raises:
        OSError: the file cannot be made, or opened.
        ValueError: the file is not that of a team of this size.
    """

    def __init__(self, file: Path, names: Sequence[str], *, create: bool = False) -> None:
        self._index = {name: place for place, name in enumerate(names)}
        if create:
            file.write_bytes(_PLACE.pack(math.nan, math.nan) * len(names))
        with file.open("r+b") as opened:
            self._cells = mmap.mmap(opened.fileno(), 0)
        if len(self._cells) != _PLACE.size * len(names):
            raise ValueError(f"{file}: does not hold the places of {len(names)} peers; remove it")

    def put(self, name: str, place: Point) -> None:
        """Say where a body is."""
        _PLACE.pack_into(self._cells, self._index[name] * _PLACE.size, *place)

    def get(self, name: str) -> Point | None:
        """Where a body was last; None if it has never been said."""
        x, y = _PLACE.unpack_from(self._cells, self._index[name] * _PLACE.size)
        return None if math.isnan(x) else (x, y)

    def close(self) -> None:
        """Unmap the file."""
        self._cells.close()
