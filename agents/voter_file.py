"""The voter's file on a real disk: what :mod:`protocol.promises` makes and reads, written so that it survives.

A promise is written to a file beside it, synchronised, renamed, and the folder synchronised; only then is it on disk. A
thread does that, so that a slow disk does not keep the control loop waiting.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path
from queue import SimpleQueue
from typing import Final

from protocol.core import Persist, Written
from protocol.messages import Reign
from protocol.promises import MAXIMUM_BYTES, VoterFileFault, decode_promise

PROMISES: Final = "promises"
"""Folder of a run in which each voter keeps its file."""


class VoterFile:
    """One voter's file, ``promises/<voter>.json`` in the folder of a run.

    Args:
        run: folder of the run.
        voter: its name.
    """

    def __init__(self, run: Path, voter: str) -> None:
        self.path = run / PROMISES / f"{voter}.json"
        self._voter = voter
        self._promises: SimpleQueue[Persist] = SimpleQueue()

    def read(self, *, team: str, incarnation: int) -> Reign | None:
        """The last promise; None if there is none.

        Raises:
            VoterFileFault: the file is not one that this process may vote by, or none can be written in its place.
        """
        try:
            self.path.parent.mkdir(exist_ok=True)
            content = self.path.read_bytes() if self.path.exists() else None
        except OSError as problem:
            raise VoterFileFault(
                f"{self.path} cannot be read ({problem.strerror}); make it readable, and start {self._voter} again"
            ) from problem
        promise = decode_promise(content, file=str(self.path), team=team, voter=self._voter, incarnation=incarnation)
        try:
            _synchronise(self._partial, bytes(MAXIMUM_BYTES))
            self._partial.unlink()
        except OSError as problem:
            raise VoterFileFault(
                f"{self.path.parent} cannot be written to ({problem.strerror}), and a voter that cannot keep its "
                f"promises must not vote; make room, or the folder writable, and start {self._voter} again"
            ) from problem
        return promise

    def serve(self, written: Callable[[Written], None]) -> None:
        """Write from now on what :meth:`write` is given, and say so to ``written``, in a thread of its own."""
        threading.Thread(target=self._serve, args=(written,), name="promises", daemon=True).start()

    def write(self, promise: Persist) -> None:
        """Queue a promise. Any thread."""
        self._promises.put(promise)

    def _serve(self, written: Callable[[Written], None]) -> None:
        while True:
            promise = self._promises.get()
            failure = ""
            try:
                _synchronise(self._partial, promise.content)
                self._partial.rename(self.path)
                _synchronise_folder(self.path.parent)
            except OSError as problem:
                failure = f"{self.path}: {problem.strerror}"
            written(Written(promise.token, failure))

    @property
    def _partial(self) -> Path:
        return self.path.with_name(f".{self.path.name}")


def _synchronise(file: Path, content: bytes) -> None:
    """Write a file, and wait until it is on disk."""
    with file.open("wb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())


def _synchronise_folder(folder: Path) -> None:
    """Wait until the names in a folder are on disk."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
