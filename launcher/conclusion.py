"""The end of a run: its recordings in one file, its figures in another."""

from __future__ import annotations

from msgspec import json

from launcher.report import Metrics, MissionTrace, measure
from launcher.review import merge, read_records
from launcher.run_folder import RunFolder
from planning.environment import Environment


def conclude(folder: RunFolder, duration_s: float | None = None) -> Metrics:
    """Merge the recordings of a run, measure them, and write ``metrics.json``.

    Args:
        folder: of the run, whose processes have ended.
        duration_s: mission time at which it ended; that of the last record if None.

    Raises:
        ValueError: recordings, mission or map are absent or damaged; one sentence.
    """
    merge(folder.path)
    return measure_run(folder, duration_s)


def measure_run(folder: RunFolder, duration_s: float | None = None) -> Metrics:
    """Measure a run whose recordings have been merged, and write ``metrics.json``. Raises ValueError as above."""
    mission = folder.read_mission()
    environment = Environment.load(folder.path / mission.map_path)
    trace = MissionTrace.of(read_records(folder.recording), mission, duration_s)
    metrics = measure(trace, environment)
    folder.metrics_file.write_bytes(json.format(json.encode(metrics), indent=1) + b"\n")
    return metrics
