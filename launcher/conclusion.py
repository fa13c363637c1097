"""The end of a run: its recordings in one file, its figures in another."""

from __future__ import annotations

from msgspec import json, structs

from agents.certificate_judge import certificate_judge
from agents.mission import Mission
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
    mission, environment, trace = _read(folder)
    if not mission.announces:
        _add_verdicts(folder, mission, environment, trace)
        merge(folder.path)
    return _measure(folder, mission, environment, trace)


def measure_run(folder: RunFolder) -> Metrics:
    """Measure a run whose recordings have been merged, and write ``metrics.json``.

    Every motion that was ordered is certified once more, from the recording alone, and the rules of leading, of orders
    and of trees are held against it (:mod:`launcher.recorded_rules`).

    Raises:
        ValueError: as above.
    """
    return _measure(folder, *_read(folder))


def _read(folder: RunFolder) -> tuple[Mission, Environment, MissionTrace]:
    mission = folder.read_mission()
    environment = Environment.load(folder.path / mission.map_path)
    return mission, environment, MissionTrace.of(read_records(folder.recording), mission)


def _add_verdicts(folder: RunFolder, mission: Mission, environment: Environment, trace: MissionTrace) -> None:
    """Add to the recordings who truly saw whom: no peer could know it."""
    file = folder.path / RECORDINGS / f"{REFEREE}.rrd"
    recorder = RerunRecorder(file, team=mission.team, recording_id=folder.path.name, peer=REFEREE)
    recorder.know(mission)
    record_verdicts(trace, environment, recorder)
    recorder.close()


def _measure(folder: RunFolder, mission: Mission, environment: Environment, trace: MissionTrace) -> Metrics:
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
