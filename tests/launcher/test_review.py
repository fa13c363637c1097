from __future__ import annotations

import math
import os
import random
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import msgspec
import numpy as np
import pytest
from PIL import Image
from rerun.chunk import RrdReader

from agents.recorder import RerunRecorder
from agents.records import AnyRecord, Connectivity, Decision, Ordered, Track
from launcher import review
from launcher.conclusion import conclude, measure_run
from launcher.report import MissionTrace
from launcher.review import RecordingFault, merge, open_viewer, read_records
from launcher.run_folder import RunFolder
from protocol.messages import MemberWay, Motion
from tests.agents import synthetic_mission as synthetic

RESTART_S, BACK_S = 5.0, 7.0
"""robot_1's process ends here, and another takes its place there."""


def record(folder: Path, name: str, incarnation: int, begin_s: float = 0.0, end_s: float = math.inf) -> None:
    """Be one process of the synthetic mission."""
    file = folder / "recordings" / f"{name}.{incarnation}.rrd"
    recorder = RerunRecorder(file, team="demo", recording_id="the-run", peer=name)
    if name == "base":
        room = synthetic.environment()
        recorder.log_map(room, [room.outer])
        recorder.log_blueprint(synthetic.mission())
    for time_s, entry in expected(name):
        if begin_s <= time_s < end_s:
            recorder.record(time_s, name, entry)
    recorder.close()


def expected(name: str) -> list[tuple[float, AnyRecord]]:
    own = list(synthetic.tracks(name))
    return own if name != "base" else sorted([*own, *synthetic.decisions()], key=lambda entry: entry[0])


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a run leaves: a file per process, two of them robot_1's."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "mission.json").write_bytes(msgspec.json.encode(synthetic.mission()))
    synthetic.environment().save(folder / "map.json")
    for name, _, _ in synthetic.ROSTER:
        if name == "robot_1":
            record(folder, name, 0, end_s=RESTART_S)
            record(folder, name, 1, begin_s=BACK_S)
        else:
            record(folder, name, 0)
    merge(folder)
    return folder


def test_the_files_of_all_processes_become_one_recording_with_its_layout(run_folder: Path) -> None:
    reader = RrdReader(run_folder / "run.rrd")
    assert [entry.recording_id for entry in reader.recordings()] == ["the-run"]
    assert len(reader.blueprints()) == 1
    assert [file.name for file in run_folder.glob("*run.rrd")] == ["run.rrd"], "nothing half-made is left"


def test_records_are_read_back_as_they_were_written(run_folder: Path) -> None:
    records = read_records(run_folder / "run.rrd")
    assert [time_s for time_s, _, _ in records] == sorted(time_s for time_s, _, _ in records)
    for name, _, _ in synthetic.ROSTER:
        mine = [(time_s, entry) for time_s, peer, entry in records if peer == name]
        wanted = [
            (time_s, entry) for time_s, entry in expected(name) if name != "robot_1" or not RESTART_S <= time_s < BACK_S
        ]
        assert len(mine) == len(wanted)
        assert [time_s for time_s, _ in mine] == pytest.approx([time_s for time_s, _ in wanted], abs=1e-9)
        for kind in (Track, Decision, Connectivity):
            assert [entry for _, entry in mine if isinstance(entry, kind)] == [
                entry for _, entry in wanted if isinstance(entry, kind)
            ]


def test_the_trace_is_the_truth_about_every_peer(run_folder: Path) -> None:
    trace = MissionTrace.of(read_records(run_folder / "run.rrd"), synthetic.mission())
    assert [trail.peer for trail in trace.trails] == [name for name, _, _ in synthetic.ROSTER]
    for trail in trace.trails:
        truth = np.array([synthetic.position(trail.peer, time_s) for time_s in trail.times_s])
        assert trail.positions == pytest.approx(truth, abs=1e-8)
    assert trace.duration_s == pytest.approx(synthetic.DURATION_S - synthetic.PERIOD_S)
    assert len(trace.decisions) == 3


def test_metrics_follow_from_the_formulas_of_the_mission(run_folder: Path) -> None:
    """Oracle: the same shares from a fine sampling of the formulas, with robot_1 gone while its process was."""
    metrics = measure_run(RunFolder(run_folder))
    room = synthetic.environment()
    times = np.arange(0.0, metrics.duration_s, 0.02)
    visible = connected = 0
    for time_s in times:
        gone = RESTART_S <= time_s < BACK_S
        names = [name for name, _, _ in synthetic.ROSTER if not (gone and name == "robot_1")]
        sees = room.visibility_matrix(np.array([synthetic.position(name, time_s) for name in names]))
        visible += sees[-1, :-1].any()
        reach = np.linalg.matrix_power(sees.astype(int), len(names)) > 0
        connected += reach[0, -1]
    assert metrics.whole_run.agent_visible == pytest.approx(visible / len(times), abs=0.03)
    assert metrics.whole_run.chain_connected == pytest.approx(connected / len(times), abs=0.03)
    assert 0.05 < metrics.whole_run.chain_connected < 0.95, "the pillar must matter, or this tests nothing"
    assert metrics.agent_distance_m == pytest.approx(
        metrics.duration_s * synthetic.SPEED_RAD_S * synthetic.RADIUS_M, rel=0.01
    )
    assert metrics.distance_m["robot_2"] == 0.0
    assert metrics.robots_used == 2
    assert metrics.first_deployment_s == pytest.approx(1.0)
    assert [change.decision for change in metrics.topology_changes] == [2, 3]


def test_merging_twice_changes_nothing(run_folder: Path, tmp_path: Path) -> None:
    for name in ("mission.json", "map.json"):
        (tmp_path / name).write_bytes((run_folder / name).read_bytes())
    (tmp_path / "recordings").symlink_to(run_folder / "recordings")
    first, second = conclude(RunFolder(tmp_path)), conclude(RunFolder(tmp_path))
    assert first == second == measure_run(RunFolder(run_folder))


@pytest.mark.parametrize("collides", [False, True])
def test_motions_are_certified_once_more_from_the_recording(run_folder: Path, tmp_path: Path, collides: bool) -> None:
    for name in ("mission.json", "map.json"):
        (tmp_path / name).write_bytes((run_folder / name).read_bytes())
    ends = {"base": (1.0, 1.0), "robot_1": (10.0, 5.0), "robot_2": (11.0, 5.0) if not collides else (10.0, 5.5)}
    ways = tuple(
        MemberWay(
            member=name, radius_m=0.3, speed_m_s=1.0, stages=(0, 1) if name != "base" else (0, 0),
            waypoints=(end,) if name == "base" else ((end[0], 2.0), end),
        )
        for name, end in ends.items()
    )  # fmt: skip
    motion = Motion(plan=0, revision=0, first_stage=0, released=0, ways=ways, connection="none")
    recorder = RerunRecorder(tmp_path / "recordings" / "base.0.rrd", team="demo", recording_id="run", peer="base")
    recorder.record(1.5, "base", Ordered(epoch=1, motion=motion))
    recorder.close()
    failures = conclude(RunFolder(tmp_path)).failures
    assert len(failures) == collides
    for failure in failures:
        assert failure.startswith(
            "the motion ordered at 1.50 s is not certified: in stage 0 robot_1 and robot_2 can come"
        )


@pytest.mark.parametrize("seed", range(3))
def test_a_file_that_ends_in_the_middle_costs_only_its_end(run_folder: Path, tmp_path: Path, seed: int) -> None:
    (tmp_path / "recordings").mkdir()
    cut = random.Random(seed).uniform(0.0, 1.0)
    for file in (run_folder / "recordings").iterdir():
        data = file.read_bytes()
        kept = data[: int(cut * len(data))] if file.name == "agent.0.rrd" else data
        (tmp_path / "recordings" / file.name).write_bytes(kept)
    found = read_records(merge(tmp_path))
    whole = read_records(run_folder / "run.rrd")
    assert [entry for entry in found if entry[1] != "agent"] == [entry for entry in whole if entry[1] != "agent"]
    agent = [entry for entry in found if entry[1] == "agent"]
    assert agent == [entry for entry in whole if entry[1] == "agent"][: len(agent)], f"seed {seed}"


def test_a_killed_process_leaves_what_it_recorded(run_folder: Path, tmp_path: Path) -> None:
    """The process is killed without warning a second after a log line: all up to there must be on disk."""
    program = """
        import os, signal, sys, time
        from pathlib import Path
        from agents.recorder import RerunRecorder
        from agents.recorder_file import FLUSH_PERIOD_S
        from tests.agents import synthetic_mission as synthetic

        recorder = RerunRecorder(Path(sys.argv[1]), team="demo", recording_id="the-run", peer="agent")
        for time_s, record in synthetic.tracks("agent", 0.0, 3.1):
            recorder.record(time_s, "agent", record)
        time.sleep(2 * FLUSH_PERIOD_S)
        os.kill(os.getpid(), signal.SIGKILL)
    """
    file = tmp_path / "recordings" / "agent.0.rrd"
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(program), str(file)], cwd=Path(__file__).parents[2])
    assert done.returncode == -signal.SIGKILL
    found = [entry for _, _, entry in read_records(merge(tmp_path))]
    assert found == [entry for time_s, entry in synthetic.tracks("agent", 0.0, 3.1)]


@pytest.mark.parametrize(
    ("contents", "sentence"),
    [
        (None, "no recording in it"),
        ({}, "no recording in it"),
        ({"base.0.rrd": b""}, "none of its 1 files can be read"),
        ({"base.0.rrd": b"not a recording" * 100, "agent.0.rrd": b"RRF2"}, "none of its 2 files can be read"),
    ],
)
def test_folders_without_a_recording_are_told_apart(
    tmp_path: Path, contents: dict[str, bytes] | None, sentence: str
) -> None:
    if contents is not None:
        (tmp_path / "recordings").mkdir()
        for name, data in contents.items():
            (tmp_path / "recordings" / name).write_bytes(data)
    with pytest.raises(RecordingFault, match=sentence) as fault:
        merge(tmp_path)
    assert str(tmp_path) in str(fault.value)
    assert "\n" not in str(fault.value)
    assert not list(tmp_path.glob("*.rrd"))
    assert not list(tmp_path.glob(".*"))


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(RecordingFault, match="no such folder"):
        merge(tmp_path / "absent")


@pytest.mark.parametrize("length", [None, 0, 7, 5000, -1000])
def test_a_recording_that_cannot_be_read_is_one_sentence(run_folder: Path, tmp_path: Path, length: int | None) -> None:
    rrd = tmp_path / "run.rrd"
    if length is not None:
        rrd.write_bytes((run_folder / "run.rrd").read_bytes()[:length])
    with pytest.raises(RecordingFault, match=r"run\.rrd: ") as fault:
        read_records(rrd)
    assert "\n" not in str(fault.value)


def test_a_recording_of_something_else(tmp_path: Path) -> None:
    recorder = RerunRecorder(tmp_path / "run.rrd", team="others", recording_id="other", peer="base")
    recorder.log_map(synthetic.environment())
    recorder.close()
    with pytest.raises(RecordingFault, match="no record of any peer"):
        read_records(tmp_path / "run.rrd")


def test_without_a_display_a_sentence_says_how_to_look(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    assert "rerun runs/x/run.rrd" in open_viewer(Path("runs/x/run.rrd"))


def test_with_a_display_the_viewer_starts_on_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[list[str]] = []

    class Process:
        def __init__(self, command: list[str], **options: object) -> None:
            started.append(command)
            assert options["start_new_session"], "closing the terminal must not close the viewer"

    monkeypatch.setenv("DISPLAY", ":7")
    monkeypatch.setattr(subprocess, "Popen", Process)
    assert "opens" in open_viewer(Path("runs/x/run.rrd"))
    ((program, rrd),) = started
    assert os.access(program, os.X_OK)
    assert rrd == "runs/x/run.rrd"


def test_a_picture_needs_a_renderer(run_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A viewer that ends at once, as it does where it finds no graphics, becomes one sentence with the remedy."""
    viewer = tmp_path / "rerun"
    viewer.write_text("#!/bin/sh\nexit 101\n")
    viewer.chmod(0o755)
    monkeypatch.setattr(review, "_rerun", lambda: str(viewer))
    with pytest.raises(RecordingFault, match="mesa-vulkan-drivers"):
        review.draw_picture(run_folder / "run.rrd", 5.0, tmp_path / "picture.png")


def test_the_picture_is_not_mirrored_and_no_view_complains(
    run_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The base station stands one metre from the left and from the *lower* wall of a room of 20 m."""
    monkeypatch.setattr(review, "_VIEWER_SETTLE_S", 1.0)
    picture = tmp_path / "picture.png"
    try:
        review.draw_picture(run_folder / "run.rrd", 0.0, picture)
        with review._headless_viewer(run_folder / "run.rrd") as viewer:
            reports = [(view.name, report) for view in viewer.get_state().views for report in view.reports]
    except RecordingFault as fault:
        if "no renderer" not in str(fault):
            raise
        pytest.skip(str(fault))
    assert reports == []
    pixels = np.asarray(Image.open(picture).convert("RGB")).astype(int)[:, : int(0.6 * 1600)]

    def places(colour: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
        return np.nonzero((abs(pixels - np.array(colour)) < 12).all(axis=2))

    rows, columns = places((0xB9, 0xC2, 0xD0))
    wide = np.bincount(rows, minlength=len(pixels)) > 200
    top, bottom = np.nonzero(wide)[0][[0, -1]]
    left, right = columns[(rows > top) & (rows < bottom)][[0, -1]]
    rows, columns = places((0xF5, 0xB8, 0x3D))
    scale = (bottom - top) / synthetic.ROOM_M
    assert right - left == pytest.approx(bottom - top, abs=4)
    assert np.median(columns) == pytest.approx(left + scale, abs=scale)
    assert np.median(rows) == pytest.approx(bottom - scale, abs=scale)
