"""What was computed from a map, kept on disk for the next process: named groups of arrays, npz, never pickle.

A file is found by what its arrays were computed *from*; inside it says what they were computed *by*: a digest of this
package's sources and of the libraries that do geometry. A file that is damaged, cut short, or by other sources is
computed again and replaced, so nobody ever has to clear the folder. (A zip archive, which npz is, has a checksum for
each array, but can lose whole arrays unnoticed; so its comment holds one of everything.)

Files are written beside their place and then renamed, so that readers, and writers at the same time, see the old file
or a new one, never a part. What cannot be written is simply not kept.

The folder is ``$SIGHTLINE_CACHE``, else ``$XDG_CACHE_HOME/sightline/maps``, else ``~/.cache/sightline/maps``.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import tempfile
import zlib
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

Arrays: TypeAlias = dict[str, NDArray[Any]]
Announce: TypeAlias = Callable[[str], None]

FORMAT: Final = 1
"""Rises when the same names come to mean something else."""

SEAL_BYTES: Final = 8
"""Length of the checksum."""

MOST_BYTES: Final = 1 << 30
"""All files together; those that were not used for the longest time are dropped first."""


def digest(*content: object) -> str:
    """32 hexadecimal digits that stand for arrays, by type, shape and bytes, for bytes, and for other values' text."""
    found = hashlib.blake2b(digest_size=16)
    for value in content:
        if isinstance(value, np.ndarray):
            found.update(f"{value.dtype.str}{value.shape}".encode())
            found.update(np.ascontiguousarray(value).data)
        else:
            found.update(value if isinstance(value, bytes) else f"{value!r};".encode())
    return found.hexdigest()


def fetch(part: str, key: str, compute: Callable[[], Mapping[str, NDArray[Any]]], announce: Announce) -> Arrays:
    """The arrays of a file, or if it is of no use, freshly computed ones, which are kept for the next time.

    Args:
        part: what the arrays are: a short word, the first half of the file's name.
        key: what they are computed from, by `digest`.
        compute: makes them.
        announce: is told if a file is damaged, or none can be written, which is never an error.
    """
    file = None if (folder := _folder()) is None else folder / f"{part}-{key}.npz"
    found = None if file is None else _read(file, announce)
    if found is not None:
        return found
    computed = dict(compute())
    if file is not None:
        try:
            _write(file, computed)
        except OSError as error:
            announce(f"what was computed from the map is not kept: {error}")
    return computed


def _folder() -> Path | None:
    """Where files are; None on a machine where nobody has a home."""
    if chosen := os.environ.get("SIGHTLINE_CACHE"):
        return Path(chosen)
    caches = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if not caches.is_absolute():
        try:
            caches = Path.home() / ".cache"
        except RuntimeError:
            return None
    return caches / "sightline" / "maps"


@cache
def _version() -> str:
    """What the arrays of this process are computed by."""
    sources = sorted(Path(__file__).parent.glob("*.py"))
    return digest(FORMAT, np.__version__, shapely.__version__, shapely.geos_version, *(s.read_bytes() for s in sources))


def _read(file: Path, announce: Announce) -> Arrays | None:
    """The arrays of a file that is whole and by these sources."""
    try:
        content = file.read_bytes()
    except OSError:
        return None
    try:
        if content[-SEAL_BYTES:] != _seal(memoryview(content)[:-SEAL_BYTES]):
            raise ValueError("its checksum is another")
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            if str(archive["version"]) != _version():
                return None
            found = {name: archive[name] for name in archive.files if name != "version"}
    except Exception as error:  # zip, zlib, numpy and struct have an exception of their own for each kind of damage
        announce(f"{file} is damaged ({error}): it is computed again")
        return None
    with contextlib.suppress(OSError):
        os.utime(file)  # the last time that it was used
    return found


def _write(file: Path, arrays: Arrays) -> None:
    archive = io.BytesIO()
    np.savez(archive, allow_pickle=False, version=np.array(_version()), **arrays)
    # The last two bytes of an archive are the length of the comment that follows.
    content = archive.getvalue()[:-2] + SEAL_BYTES.to_bytes(2, "little")
    file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=file.parent, suffix=".part", delete=False) as part:
        try:
            part.write(content + _seal(content))
            part.close()
            Path(part.name).replace(file)
        except BaseException:
            Path(part.name).unlink(missing_ok=True)
            raise
    _drop_oldest(file.parent)


def _seal(content: bytes | memoryview) -> bytes:
    """The comment of an archive whose other bytes are these."""
    return f"{zlib.crc32(content):0{SEAL_BYTES}x}".encode()


def _drop_oldest(folder: Path) -> None:
    """Delete the files that were not used for the longest time until the others are small enough together."""
    total = 0
    for status, file in sorted(_list_files(folder), key=lambda entry: -entry[0].st_mtime_ns):
        total += status.st_size
        if total > MOST_BYTES:
            file.unlink(missing_ok=True)


def _list_files(folder: Path) -> list[tuple[os.stat_result, Path]]:
    """Files, finished or not, that other processes have not deleted in the meantime."""
    found = []
    for file in [*folder.glob("*.npz"), *folder.glob("*.part")]:
        with contextlib.suppress(OSError):
            found.append((file.stat(), file))
    return found
