from __future__ import annotations

import io
import itertools
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from msgspec import structs
from PIL import Image
from rerun.chunk import RrdReader

from agents.map_picture import OBSTACLE, draw_map
from agents.recorder import NullRecorder, Recorder, RerunRecorder
from agents.records import Advance, AnyRecord, Connectivity, LogLine, Ordered, Planned, Track
from agents.tree_layout import lay_out
from planning.environment import Environment
from protocol.messages import MemberWay, Motion
from tests.agents import synthetic_mission as synthetic

Row = tuple[float | None, Any]


def rows(file: Path, entity: str, component: str) -> list[Row]:
    """(run_time or None where static, list of instances) of one component, by time: read without any code of ours."""
    found: list[Row] = []
    for chunk in RrdReader(file).stream().filter(content=entity, components=component):
        batch = chunk.to_record_batch()
        values = batch.column(component).to_pylist()
        if chunk.is_static:
            found += [(None, value) for value in values]
        else:
            times = batch.column("run_time").cast("int64").to_pylist()
            found += [(time_ns * 1e-9, value) for time_ns, value in zip(times, values, strict=True)]
    return sorted(found, key=lambda row: -1.0 if row[0] is None else row[0])


def everything() -> Iterator[tuple[float, str, AnyRecord]]:
    yield from ((time_s, "base", record) for time_s, record in synthetic.decisions())
    for name, _, _ in synthetic.ROSTER:
        yield from ((time_s, name, record) for time_s, record in synthetic.tracks(name))


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "deep" / "all.rrd"
    recorder = RerunRecorder(path, team="demo", recording_id="run", peer="simulation")
    room = synthetic.environment()
    recorder.log_map(room, [room.outer])
    recorder.log_blueprint(synthetic.mission())
    for time_s, peer, record in sorted(everything(), key=lambda entry: entry[0]):
        recorder.record(time_s, peer, record)
    recorder.close()
    return path


def test_the_journal_holds_every_record_exactly(file: Path) -> None:
    for name, _, _ in synthetic.ROSTER:
        expected = [(time_s, record) for time_s, peer, record in everything() if peer == name]
        found = [
            (time_s, msgspec.json.decode(text, type=AnyRecord))
            for time_s, texts in rows(file, f"/journal/{name}", "TextDocument:text")
            for text in texts
        ]
        assert [record for _, record in sorted(found, key=lambda entry: entry[0])] == [
            record for _, record in sorted(expected, key=lambda entry: entry[0])
        ]
        assert sorted(time_s for time_s, _ in found) == pytest.approx(sorted(time_s for time_s, _ in expected))


def test_the_recording_brings_its_own_layout_and_one_timeline(file: Path) -> None:
    reader = RrdReader(file)
    assert len(reader.blueprints()) == 1
    (recording,) = reader.recordings()
    assert (recording.application_id, recording.recording_id) == ("sightline", "run")
    assert {name for chunk in reader.stream() for name in chunk.timeline_names} == {"run_time"}


def test_the_recording_says_which_files_it_was_made_of(file: Path) -> None:
    assert rows(file, "/__properties/recorded_by", "simulation") == [(None, ["all.rrd"])]


def test_bodies_are_drawn_where_they_were(file: Path) -> None:
    drawn = rows(file, "/world/peers/agent/body", "Points2D:positions")
    assert len(drawn) == round(synthetic.DURATION_S / synthetic.PERIOD_S)
    for time_s, (place,) in drawn:
        assert time_s is not None
        assert place == pytest.approx(synthetic.position("agent", time_s), abs=1e-5)
    velocities = rows(file, "/world/peers/agent/body", "Arrows2D:vectors")
    assert velocities[5][1][0] == pytest.approx(synthetic.velocity("agent", 0.5), abs=1e-5)


def test_a_trail_is_the_way_driven_in_pieces_that_meet(file: Path) -> None:
    pieces = [strip for _, strips in rows(file, "/world/peers/agent/trail", "LineStrips2D:strips") for strip in strips]
    for piece, following in itertools.pairwise(pieces):
        assert piece[-1] == following[0]
    length_m = sum(math.dist(a, b) for a, b in pieces)
    chord_m = 2 * synthetic.RADIUS_M * math.sin(synthetic.SPEED_RAD_S * synthetic.PERIOD_S / 2)
    assert length_m == pytest.approx(len(pieces) * chord_m, rel=1e-4)
    assert len(pieces) == round(synthetic.DURATION_S / synthetic.PERIOD_S) - 1


def test_who_stands_still_draws_no_trail(file: Path) -> None:
    assert rows(file, "/world/peers/base/trail", "LineStrips2D:strips") == []


def test_paths_and_targets_come_and_go(tmp_path: Path) -> None:
    track = Track(role="robot", position=(0.0, 0.0), velocity=(0.0, 0.0), radius_m=0.3, mode="waiting")
    driving = msgspec.structs.replace(track, mode="moving", target=(2.0, 0.0), path=((0.0, 0.0), (2.0, 0.0)))
    recorder = RerunRecorder(tmp_path / "one.rrd", team="demo", recording_id="run", peer="r")
    for time_s, record in ((0.0, track), (1.0, driving), (2.0, driving), (3.0, track)):
        recorder.record(time_s, "r", record)
    recorder.close()
    paths = rows(tmp_path / "one.rrd", "/world/peers/r/path", "LineStrips2D:strips")
    assert paths == [(0.0, []), (1.0, [[[0.0, 0.0], [2.0, 0.0]]]), (3.0, [])]
    targets = rows(tmp_path / "one.rrd", "/world/peers/r/target", "Ellipses2D:centers")
    assert targets == [(0.0, []), (1.0, [[2.0, 0.0]]), (3.0, [])]
    modes = rows(tmp_path / "one.rrd", "/mode/r", "StateChange:state")
    assert modes == [(0.0, ["waiting"]), (1.0, ["moving"]), (3.0, ["waiting"])]


def test_links_of_the_tree_are_told_apart_by_sight(file: Path) -> None:
    in_sight = dict(rows(file, "/world/chain/in_sight", "LineStrips2D:strips"))
    broken = dict(rows(file, "/world/chain/broken", "LineStrips2D:strips"))
    room = synthetic.environment()
    count = 0
    for time_s, record in synthetic.decisions():
        if isinstance(record, Connectivity):
            seen = [bool(room.line_of_sight(np.array(a), np.array(b))) for a, b in record.tree_links]
            key = min(in_sight, key=lambda other: abs((other or 0.0) - time_s))
            assert len(in_sight[key]) == sum(seen), f"at {time_s} s"
            assert len(broken[key]) == len(seen) - sum(seen), f"at {time_s} s"
            count += len(seen) - sum(seen)
    assert count > 0, "the pillar must hide somebody at some time, or this tests nothing"


def test_curves(file: Path) -> None:
    connected = rows(file, "/connected", "Scalars:scalars")
    assert all(chain == float(step % 7 != 0) for step, (_, (_, chain, _)) in enumerate(connected))
    assert [value for _, (value,) in rows(file, "/lambda2", "Scalars:scalars")][:6] == [0.0, 0.25, 0.5, 0.75, 1.0, 0.0]
    assert [value for _, (value,) in rows(file, "/planning_ms", "Scalars:scalars")] == pytest.approx([10.0, 50.0, 90.0])
    assert [values for _, values in rows(file, "/cost", "Scalars:scalars")] == [[12.0, 12.0], [13.0, 12.0]]


def test_the_tree_shows_everybody_and_the_log_the_reasons(file: Path) -> None:
    trees = rows(file, "/tree", "GraphNodes:node_ids")
    assert [set(nodes) for _, nodes in trees] == [{"base", "robot_1", "robot_2", "agent"}] * 3
    texts = [text for _, (text,) in rows(file, "/log/base", "TextLog:text")]
    reason = "robot_2 sees the agent for longer; λ2 “quoted”"
    assert texts[1] == f"base: decision 2 (new tree, 50 ms): {reason}; costs 12.0 m, the least of such chains"
    assert texts[2].endswith("; costs 13.0 m, such chains at least 12.0 m")
    assert "costs" not in texts[0]


def test_the_map_shows_where_relays_can_be_sent(tmp_path: Path) -> None:
    recorder = RerunRecorder(tmp_path / "map.rrd", team="demo", recording_id="run", peer="base")
    recorder.log_map(synthetic.environment(), placements=np.array([[1.0, 2.0], [3.0, 4.0]]))
    recorder.close()
    assert rows(tmp_path / "map.rrd", "/world/map/placements", "Points2D:positions") == [
        (None, [[1.0, 2.0], [3.0, 4.0]])
    ]


def test_the_view_mirrors_y_up_into_y_down(file: Path) -> None:
    ((_, scale),) = rows(file, "/world", "Transform3D:scale")
    assert scale == [[1.0, -1.0, 1.0]]


def test_decisions_and_log_lines_are_not_held_back(tmp_path: Path) -> None:
    """What is buffered by us is sent with them: a crash right after a warning must not lose how it came to it."""
    recorder = RerunRecorder(tmp_path / "open.rrd", team="demo", recording_id="run", peer="base")
    for time_s, record in synthetic.tracks("base", 0.0, 0.3):
        recorder.record(time_s, "base", record)
    recorder.record(0.3, "base", LogLine(level="error", text="something broke"))
    assert not recorder._file._rows
    recorder.close()


def test_closing_twice_and_recording_after_the_end_do_no_harm(tmp_path: Path) -> None:
    recorder = RerunRecorder(tmp_path / "closed.rrd", team="demo", recording_id="run", peer="base")
    recorder.record(0.0, "base", LogLine(level="info", text="first and last"))
    recorder.close()
    size = (tmp_path / "closed.rrd").stat().st_size
    recorder.close()
    recorder.record(1.0, "base", LogLine(level="info", text="too late"))
    assert (tmp_path / "closed.rrd").stat().st_size == size
    assert len(rows(tmp_path / "closed.rrd", "/journal/base", "TextDocument:text")) == 1


def test_a_file_that_cannot_be_written_is_an_error_at_once(tmp_path: Path) -> None:
    (tmp_path / "taken.rrd").mkdir()
    with pytest.raises(OSError, match=r"taken\.rrd"):
        RerunRecorder(tmp_path / "taken.rrd", team="demo", recording_id="run", peer="base")


def test_the_null_recorder_is_a_recorder() -> None:
    recorder: Recorder = NullRecorder()
    recorder.record(0.0, "base", LogLine(level="info", text="nowhere"))
    recorder.close()


def test_the_picture_shows_free_space_where_it_is(seed: int = 3) -> None:
    """Oracle: Environment.contains at random points, away from the walls by more than a pixel."""
    room = Environment(
        np.array([[-3.0, 2.0], [9.0, 2.0], [9.0, 4.0], [1.0, 5.0], [1.0, 9.5], [-3.0, 8.0]]),
        (np.array([[-2.0, 3.0], [0.0, 3.0], [-1.0, 6.0]]),),
    )
    drawn = draw_map(room, [np.array([[4.0, 2.0], [9.0, 2.0], [9.0, 4.0]])])
    pixels = np.asarray(Image.open(io.BytesIO(drawn.png)).convert("RGB"))
    points = np.random.default_rng(seed).uniform((-3.0, 2.0), (9.0, 9.5), (2000, 2))
    ends = room.walls[:, 1] - room.walls[:, 0]
    along = np.clip(((points[:, None] - room.walls[:, 0]) * ends).sum(axis=2) / (ends**2).sum(axis=1), 0.0, 1.0)[
        ..., None
    ]
    distance_m = np.linalg.norm(points[:, None] - (room.walls[:, 0] + along * ends), axis=2).min(axis=1)
    points = points[distance_m > 2 * drawn.metres_per_pixel]
    columns, lines = np.floor((points - drawn.origin) / drawn.metres_per_pixel).astype(int).T
    shown_free = (pixels[lines, columns] != np.array(OBSTACLE)).any(axis=1)
    assert (shown_free == room.contains(points)).all(), f"seed {seed}"


def test_nodes_of_a_tree_stand_in_columns_by_hops_and_never_on_each_other() -> None:
    edges = [("base", "c"), ("c", "a"), ("c", "b"), ("b", "agent"), ("x", "y")]
    places = lay_out(edges, "base", ["idle", "a"])
    assert set(places) == {"base", "a", "b", "c", "agent", "x", "y", "idle"}
    assert len(set(places.values())) == len(places)
    hops = [places[name][0] for name in ("base", "c", "b", "agent")]
    assert hops == sorted(set(hops))
    assert places["a"][0] == places["b"][0]
    lowest = max(places[name][1] for name in ("base", "a", "b", "c", "agent"))
    assert all(places[name][1] > lowest for name in ("x", "y", "idle"))


def test_a_tree_without_edges_still_shows_its_root() -> None:
    assert lay_out([], "base") == {"base": (0.0, 0.0)}


def way(member: str, *waypoints: tuple[float, float], scheduled: bool = True) -> MemberWay:
    """A stage for each piece of three, standing in the last ones."""
    last = len(waypoints) - 1
    return MemberWay(
        member=member, radius_m=0.2, speed_m_s=1.0, waypoints=waypoints, scheduled=scheduled,
        stages=(0, min(1, last), min(2, last), last),
    )  # fmt: skip


def test_a_motion_is_drawn_with_its_stages_and_how_far_everybody_is(tmp_path: Path) -> None:
    recorder = RerunRecorder(tmp_path / "motion.rrd", team="demo", recording_id="run", peer="base")
    recorder.log_blueprint(synthetic.mission())
    ways = (
        way("base", (1.0, 1.0)),
        way("robot_1", (10.0, 2.0), (11.0, 2.0), (12.0, 2.0), (13.0, 2.0)),
        way("robot_2", (2.0, 10.0), (2.0, 11.0)),
    )
    agent = way("agent", (16.0, 10.0), (16.0, 11.0), scheduled=False)
    motion = Motion(
        plan=0, revision=3, first_stage=5, released=-1, ways=ways, connection="joined", joined=("base", "robot_1")
    )
    recorder.record(1.0, "base", Ordered(epoch=0, motion=motion))
    recorder.record(
        1.1, "base", Advance(epoch=1, plan=0, revision=0, released=6, finished={"robot_1": 5, "robot_2": 6})
    )
    recorder.record(
        2.0, "base", Ordered(epoch=0, motion=structs.replace(motion, connection="team", ways=(*ways, agent)))
    )
    recorder.record(2.1, "base", Planned(planning_s=0.01, in_sight_s=4.5))
    recorder.close()
    file = tmp_path / "motion.rrd"
    drawn = rows(file, "world/motion/ways", "LineStrips2D:strips")
    assert [[len(strip) for strip in strips] for time_s, strips in drawn if time_s is not None] == [[4, 2], [4, 2]]
    ends = rows(file, "world/motion/stages", "Points2D:positions")[-1][1]
    assert {tuple(place) for place in ends} >= {(11.0, 2.0), (12.0, 2.0), (13.0, 2.0), (2.0, 11.0)}
    # Stages 5 and 6 of robot_1; robot_2 has nothing more to do in stage 6.
    (released,) = [strips for time_s, strips in rows(file, "world/motion/released", "LineStrips2D:strips") if time_s]
    assert [[tuple(place) for place in strip] for strip in released] == [[(10.0, 2.0), (11.0, 2.0), (12.0, 2.0)]]
    assert [value for _, value in rows(file, "in_hand", "Scalars:scalars")] == [[2.0, 1.0]]
    assert [value for _, value in rows(file, "certified", "Scalars:scalars")] == [[1.0], [3.0]]
    assert [value for _, value in rows(file, "in_sight_s", "Scalars:scalars")] == [[4.5]]
