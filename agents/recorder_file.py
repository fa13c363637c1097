"""A file of rerun's that is written as it comes: single values at once, columns in bulk every half second."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from agents.recorder_columns import Columns
from agents.recorder_layout import TIMELINE

APPLICATION: Final = "sightline"

FLUSH_PERIOD_S: Final = 0.5
"""Wall time. A killed process loses the tracks of about this long; decisions and log lines are not held back."""


class RecordingFile:
    """See :class:`agents.recorder.RerunRecorder` for the arguments. Entities are named as there.

    Raises:
        OSError: the file cannot be created.
    """

    def __init__(self, file: Path, *, team: str, recording_id: str, peer: str) -> None:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(b"")  # says plainly what is wrong with the place, which rerun does not
        self._stream = rr.RecordingStream(
            APPLICATION,
            recording_id=recording_id,
            batcher_config=rr.ChunkBatcherConfig(flush_tick=FLUSH_PERIOD_S),
        )
        rr.set_log_time_enabled(False, recording=self._stream)
        self._stream.set_sinks(rr.FileSink(str(file)))
        self._stream.send_recording_name(team)
        self._stream.send_property("recorded_by", rr.AnyValues(**{peer: file.name}))
        self.open = True
        """Whether anything more can be written."""
        self._rows: dict[tuple[str, Columns], list[tuple[int, Any]]] = {}
        self._flushed_at = time.monotonic()

    def set_time(self, now_ns: int) -> None:
        """When what is logged from now on happened, in mission time."""
        self._stream.set_time(TIMELINE, duration=np.timedelta64(now_ns, "ns"))

    def log(self, entity: str, *values: Any, static: bool = False) -> None:
        """Write at once."""
        self._stream.log(entity, *values, static=static)

    def open_with(self, blueprint: rrb.Blueprint) -> None:
        """Say how the recording opens."""
        self._stream.send_blueprint(blueprint, make_active=True, make_default=True)

    def gather(self, now_ns: int, entity: str, columns: Columns, value: Any) -> None:
        """Keep a row until it is written with others of its kind."""
        self._rows.setdefault((entity, columns), []).append((now_ns, value))

    def flush(self, *, now: bool) -> None:
        """Write what has been gathered, if it is time to."""
        if not now and time.monotonic() - self._flushed_at < FLUSH_PERIOD_S:
            return
        for (entity, columns), rows in self._rows.items():
            times = np.array([now_ns for now_ns, _ in rows], dtype="timedelta64[ns]")
            values = [value for _, value in rows]
            self._stream.send_columns(entity, [rr.TimeColumn(TIMELINE, duration=times)], columns(values))
        self._rows.clear()
        self._flushed_at = time.monotonic()

    def close(self) -> None:
        """Finish the file; twice does no harm."""
        if self.open:
            self.open = False
            self.flush(now=True)
            self._stream.disconnect()
