"""A recorder that opens a little after its peer has begun: records wait in memory until then.

Importing rerun costs half a second of a processor. While a team starts, all its processes would spend that at once,
before the first of them could say a word; so each does it beside its control loop, when the team stands.
"""

from __future__ import annotations

import sys
import threading
import traceback
from collections.abc import Callable
from typing import TYPE_CHECKING

from agents.records import AnyRecord

if TYPE_CHECKING:
    from agents.recorder import Recorder

PAUSE_S = 2.0
"""From the start of the peer until its recorder is opened."""

OPEN_WITHIN_S = 1.5
"""How long the end of the process waits for a recorder that is just being opened."""


class LateRecorder:
    """Passes records on to the recorder that ``open_recorder`` makes in a thread of its own.

    A recorder that cannot be opened costs the recording and not the peer: the fault goes to stderr.
    """

    def __init__(self, open_recorder: Callable[[], Recorder]) -> None:
        self._open_recorder = open_recorder
        self._lock = threading.Lock()
        self._waiting: list[tuple[float, str, AnyRecord]] = []
        self._recorder: Recorder | None = None
        self._failed = False
        self._hurry = threading.Event()
        self._thread = threading.Thread(target=self._open, name="recorder", daemon=True)
        self._thread.start()

    def record(self, time_s: float, peer: str, record: AnyRecord) -> None:
        """Keep a record, or pass it on."""
        with self._lock:
            if self._recorder is not None:
                self._recorder.record(time_s, peer, record)
            elif not self._failed:
                self._waiting.append((time_s, peer, record))

    def close(self) -> None:
        """Open at once what has not been opened, write what waits, and finish."""
        self._hurry.set()
        self._thread.join(OPEN_WITHIN_S)
        with self._lock:
            if self._recorder is not None:
                self._recorder.close()

    def _open(self) -> None:
        self._hurry.wait(PAUSE_S)
        try:
            recorder = self._open_recorder()
        except Exception:
            print("the recording cannot be opened:", file=sys.stderr)
            traceback.print_exc()
            with self._lock:
                self._failed = True
                self._waiting.clear()
            return
        with self._lock:
            for entry in self._waiting:
                recorder.record(*entry)
            self._waiting.clear()
            self._recorder = recorder
