"""The end of a run: its recordings in one file, its figures in another."""

from __future__ import annotations

from msgspec import json, structs

from agents.certificate_judge import certificate_judge
from agents.recorder import REFEREE, RerunRecorder
from launcher.mission_trace import MissionTrace
from launcher.referee import record_verdicts
from launcher.report import Metrics, measure
from launcher.review import merge, read_records
from launcher.run_folder import RECORDINGS, RunFolder
from planning.environment import Environment


def conclude(folder: RunFolder) -> Metrics:
    """Merge the recordings of a run, measure them, and write ``metrics.json``.

    Call it once the processes of the run have ended; the run has lasted until their last record.

    Raises:
        ValueError: recordings, mission or map are absent or damaged; one sentence.
    """
    merge(folder.path)
    _add_verdicts(folder)
    return measure_run(folder)


def _add_verdicts(folder: RunFolder) -> None:
    """Add to the recording who truly saw whom, if no peer could know."""
    mission = folder.read_mission()
    if mission.announces:
        return
    environment = Environment.load(folder.path / mission.map_path)
    trace = MissionTrace.of(read_records(folder.recording), mission)
    file = folder.path / RECORDINGS / f"{REFEREE}.rrd"
    recorder = RerunRecorder(file, team=mission.team, recording_id=folder.path.name, peer=REFEREE)
    recorder.know(mission)
    record_verdicts(trace, environment, recorder)
    recorder.close()
    merge(folder.path)


def measure_run(folder: RunFolder) -> Metrics:
    """Measure a run whose recordings have been merged, and write ``metrics.json``.

    Every motion that was ordered is certified once more, from the recording alone, and the rules of leading are held
    against it: one leader at a time, orders in office only, rising epochs, trees that span (:mod:`launcher.reigns`).

    Raises:
        ValueError: as above.
    """
    mission = folder.read_mission()
    environment = Environment.load(folder.path / mission.map_path)
    trace = MissionTrace.of(read_records(folder.recording), mission)
    metrics = measure(trace, environment)
    certify = certificate_judge(mission, environment)
    refuted = tuple(
        f"the motion ordered at {time_s:.2f} s is not certified: {fault}"
        for time_s, ordered in trace.motions
        if (fault := certify(ordered.motion))
    )
    faults = trace.reigns.broken
    metrics = structs.replace(metrics, leading_faults=faults, failures=metrics.failures + refuted + faults)
    folder.metrics_file.write_bytes(json.format(json.encode(metrics), indent=1) + b"\n")
    return metrics
