"""Studies: data sets that cannot be used, the real ones when present, and the localisation study in short."""

from __future__ import annotations

import csv
import os
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from typer.testing import CliRunner

from launcher.cli import app
from launcher.studies import drawing, localization, ranges, ranging_run
from launcher.studies.localization import BadStudy, study_localization
from launcher.studies.localization_figures import snapshot_steps, split_steps
from launcher.studies.range_data import BadData, read_range_data
from launcher.studies.range_findings import find_beacons, find_target, measure_polygons
from launcher.studies.ranging_run import CORRUPT_STEP, EXPERIMENTS, LAWS, STRAIGHT, THROUGH, run_experiment

SHARED = Path(os.environ.get("SIGHTLINE_DATA", Path(__file__).parents[3] / "shared"))
ONE, STANDING, TWO = EXPERIMENTS


def real_data(name):
    folder = SHARED / "data" / name
    if not folder.is_dir():
        pytest.skip(f"the data set {name} is not at {folder}: set SIGHTLINE_DATA")
    return read_range_data(folder)


def table_of(file):
    return list(csv.DictReader(file.read_text().splitlines()))


@pytest.fixture
def made(tmp_path):
    """A small data set with true bounds: a loop through a square of beacons, ranges 5 % long and 0.2 m off at most."""
    rng = np.random.default_rng(6)
    t = np.arange(0, 60, 0.5)
    path = np.stack([5 * np.cos(t / 9), 4 * np.sin(t / 7)], axis=1)
    beacons = {"a": (-8, -8), "b": (8, -8), "c": (8, 8), "d": (-8, 8)}
    rows = []
    for number, (time, place) in enumerate(zip(t, path, strict=True)):
        for name in list(beacons)[number % 2 :: 2]:
            distance = np.hypot(*(place - beacons[name])) + rng.uniform(-0.2, 0.2)
            rows.append(f"{time},{name},{1.05 * distance}")
    (tmp_path / "path.csv").write_text("t,x,y\n" + "\n".join(f"{a},{x},{y}" for a, (x, y) in zip(t, path, strict=True)))
    (tmp_path / "beacons.csv").write_text("beacon,x,y\n" + "\n".join(f"{n},{x},{y}" for n, (x, y) in beacons.items()))
    (tmp_path / "ranges.csv").write_text("t,beacon,range\n" + "\n".join(rows))
    return tmp_path


def test_beacons_of_a_data_set(made):
    for one in find_beacons(read_range_data(made)):
        assert one.inside
        assert one.tight_inside
        assert one.scale == pytest.approx(1 / 1.05, abs=0.02)
        assert one.solved_error_m < 0.25
        assert not one.verdict.too_small


def test_the_moving_node_of_a_data_set(made):
    # Learned offsets leave what 5 % make between the nearest and the farthest range.
    found = find_target(read_range_data(made), speed_m_s=1.2, bound_m=0.8)
    assert found.inside.all()
    assert found.rmse_m < 0.8
    assert not found.verdict.too_small
    # With too small a bound the monitor speaks up, and what it said at its worst is kept.
    assert find_target(read_range_data(made), speed_m_s=0.9, bound_m=0.03).verdict.too_small


def test_plaza():
    found = find_beacons(real_data("plaza1"), bound_m=2.0)
    assert len(found) == 4
    assert all(one.inside and one.tight_inside for one in found)
    assert np.mean([one.center_error_m for one in found]) <= 0.25
    assert max(one.tight_m2 for one in found) <= 2.0
    assert np.mean([one.solved_error_m for one in found]) <= 0.06


def test_lias():
    found = find_target(real_data("lias_fast"), speed_m_s=1.0, bound_m=0.39)
    assert found.inside.all()
    assert found.rmse_m <= 0.18


@pytest.mark.parametrize(
    "file, text, message",
    [
        ("path.csv", None, "no such file"),
        ("path.csv", "t,x\n1,2\n", "columns must be t,x,y, not t,x"),
        ("path.csv", "t,x,y\n1,2,3\n1,2,3\n", "times must rise"),
        ("ranges.csv", "t,beacon,range\n1,a,2\n2,z,2\n", "line 3: beacon 'z' has no line in beacons.csv"),
        ("ranges.csv", "t,beacon,range\n1,a,far\n", "line 2: range is 'far'"),
        ("ranges.csv", "t,beacon,range\n1,a\n", "line 2: 2 columns where 3 belong"),
        ("ranges.csv", "t,beacon,range\n", "no range in it"),
        ("ranges.csv", "t,beacon,range\n1e6,a,2\n", "same clock"),
        ("beacons.csv", "", "columns must be beacon,x,y"),
        ("beacons.csv", b"\xff\xfe\x00", "UTF-8"),
    ],
)
def test_bad_data_is_said_in_a_sentence(made, file, text, message):
    if text is None:
        (made / file).unlink()
    elif isinstance(text, bytes):
        (made / file).write_bytes(text)
    else:
        (made / file).write_text(text)
    with pytest.raises(BadData, match=message):
        read_range_data(made)
    result = CliRunner().invoke(app, ["study", "ranges", "--data", str(made), "--output", str(made / "out")])
    assert result.exit_code == 2
    assert "Traceback" not in result.output


def test_the_command_leaves_figure_and_tables(made):
    for find, table in (("beacons", "beacons.csv"), ("target", "target.csv")):
        out = made / find
        arguments = ["study", "ranges", "--data", str(made), "--find", find, "--output", str(out)]
        result = CliRunner().invoke(app, arguments)
        assert result.exit_code == 0, result.output
        assert (out / f"{find}.png").stat().st_size > 10_000
        assert len(table_of(out / table)) >= 4
        assert (out / "summary.txt").read_text().strip() in result.output


def test_few_ranges_that_decide_the_bound_are_told(made, monkeypatch):
    monkeypatch.setattr(drawing, "DOTS_PER_IN", 40)
    lines = (made / "ranges.csv").read_text().splitlines()
    stamp, beacon, distance = lines[40].split(",")
    lines[40] = f"{stamp},{beacon},{float(distance) + 3}"
    (made / "ranges.csv").write_text("\n".join(lines))
    told = ranges.study_beacons(made / "out", read_range_data(made), None, lambda _: None)
    others = [name for name in "abcd" if name != beacon]
    assert f"ε for {', '.join(others)} is decided by less than 1 % of the ranges" in told


def test_no_line_is_drawn_over_a_pause():
    times = np.array([0.0, 1, 2, 3, 60, 61, 62])
    drawn = ranges._with_pauses(times, np.ones((7, 2)))
    assert drawn.shape == (8, 3)
    assert np.flatnonzero(np.isnan(drawn).all(axis=1)).tolist() == [4]


def test_polygons_are_measured_like_their_points():
    rng = np.random.default_rng(2)
    square = np.array([[0.0, 0], [2, 0], [2, 1], [0, 1]])
    grid = np.stack(np.meshgrid(np.linspace(0, 2, 401), np.linspace(0, 1, 201)), axis=-1).reshape(-1, 2)
    for point in [*rng.uniform(-4, 4, (30, 2)), (1.0, 0.5), (2.0, 1.0)]:
        nearest, farthest = measure_polygons((square + 50, square), np.asarray(point))
        distances = np.hypot(*(grid - point).T)
        assert nearest == pytest.approx(distances.min(), abs=0.004)
        assert farthest == pytest.approx(np.hypot(*(np.array([52, 51]) - point)))


def test_runs_repeat_and_contain():
    for experiment, law in ((ONE, "covariance"), (STANDING, "1 step ahead"), (TWO, "thesis' gradient")):
        run, again = (run_experiment(experiment, law, 3, steps=12) for _ in range(2))
        np.testing.assert_array_equal(run.series, again.series)
        assert run["inside"].all()
        assert run["tight_inside"].all()


def test_closed_loop_finds_what_a_straight_line_leaves_ambiguous():
    closed = [run_experiment(ONE, "covariance", seed, steps=25) for seed in range(4)]
    straight = [run_experiment(ONE, STRAIGHT, seed, steps=25) for seed in range(4)]
    assert all(np.isfinite(run.resolved_at) for run in closed)
    assert not any(np.isfinite(run.resolved_at) for run in straight)


def test_a_line_through_the_target_ends_the_ambiguity_and_a_line_past_it_does_not():
    """det E rewards being near: what the thesis' fig. 14 shows depends on the line it is compared with."""
    past, through = (run_experiment(ONE, line, 2, steps=40) for line in (STRAIGHT, THROUGH))
    assert past["distance_m"].min() >= 0.9
    assert through["distance_m"].min() <= 0.2
    assert past["spread_m"][-1] > 1 > through["spread_m"][-1]
    assert through["log10_det"][-1] > past["log10_det"][-1] + 2


def test_lambda_is_kept_of_every_range():
    run = run_experiment(TWO, "covariance", 0, steps=6)
    for weights in (run.weights, run.thesis_weights):
        assert weights.shape == (6, 2)
        assert weights[0, 0] == 0, "the first range is all there is"
        assert (weights[0, 1] > 0) & (weights <= 1).all()


def test_snapshots_are_of_different_steps_and_show_the_mirror_image():
    shown = 0
    for seed in range(6):
        run = run_experiment(ONE, "thesis' gradient", seed, keep_scenes=True, steps=CORRUPT_STEP + 6)
        for steps in (snapshot_steps(run, corrupt=True), snapshot_steps(run, corrupt=False)):
            assert list(steps) == sorted(set(steps))
        two = split_steps(run)
        if two:
            shown += 1
            assert len(run.scenes[snapshot_steps(run, corrupt=True)[1]].feasible.regions) == 2
    assert shown >= 2


def test_a_corrupt_measurement_breaks_the_thesis_filter_and_not_ours():
    run = run_experiment(ONE, "covariance", 1, corrupt=True, steps=CORRUPT_STEP + 6, keep_scenes=True)
    assert run["thesis_definite"][CORRUPT_STEP - 1] == 1
    assert run["thesis_definite"][CORRUPT_STEP] == 0
    assert run.scenes[CORRUPT_STEP - 1].thesis.contains(run.target)
    assert run.scenes[CORRUPT_STEP].thesis is None
    assert run["inside"].all()
    assert run["tight_inside"][-1] == 1


def test_the_study_in_short(tmp_path, monkeypatch):
    """With cheap laws, runs no longer than the figures need, and these small and without the search for a layout."""
    some = {law: LAWS[law] for law in ("thesis' gradient", "covariance")} | {"5 steps ahead": LAWS["covariance"]}
    monkeypatch.setattr(localization, "LAWS", some)
    monkeypatch.setattr(localization, "run_experiment", partial(run_experiment, steps=CORRUPT_STEP + 6))
    # Three sets in one: other tests follow it, and most of a run's time is its.
    monkeypatch.setattr(ranging_run, "Relaxation", lambda: "reject")
    monkeypatch.setattr(drawing, "DOTS_PER_IN", 40)
    monkeypatch.setattr(drawing, "new_figure", lambda *size_in: Figure(size_in, dpi=40))
    told = []
    text = study_localization(tmp_path, 2, told.append)
    names = {file.name for file in tmp_path.iterdir()}
    for number in ("fig10", "fig12", "fig13", "fig14", "fig15", "fig16", "fig17", "fig18"):
        assert any(name.startswith(number) and name.endswith(".png") for name in names), number
    runs = table_of(tmp_path / "runs.csv")
    assert len(runs) == 2 * (3 * 4 + 2)
    assert {row["inside"] for row in runs} == {"1"}
    assert (tmp_path / "summary.md").read_text() == text
    assert "our ellipsoid | 100.0% | 100.0%" in text
    assert text.count("\n- **") == 5, "every claim of the thesis is answered"
    assert len(told) == 3 * 4 + 3
    with pytest.raises(BadStudy, match="at least 2 runs"):
        study_localization(tmp_path, 1)


def test_the_example_of_the_page_says_what_comes_out():
    """Every line of docs/estimation.md's example that promises a number or True in its comment."""
    page = (Path(__file__).parents[2] / "docs" / "estimation.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    names: dict[str, object] = {}
    promised = []
    for line in example.splitlines():
        code, _, comment = line.partition("  # ")
        said = re.match(r"(True|[\d.]+)\b", comment)
        if said and "=" not in code:
            promised.append((eval(code, names), said[1]))
        else:
            exec(code, names)
    assert len(promised) == 5
    for value, said in promised:
        assert value if said == "True" else value == pytest.approx(float(said), rel=0.02)
    grown = re.search(r"half a metre: ([\d.]+) m²", example)[1]
    assert names["f"].feasible_set().area_m2 == pytest.approx(float(grown), rel=0.02)
