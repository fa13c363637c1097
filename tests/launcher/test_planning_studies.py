"""Studies of planning: the thesis' tables, fits, and each study in short; figures hold what their tables do."""

from __future__ import annotations

import csv
import dataclasses
import re
from itertools import combinations, pairwise, product
from pathlib import Path

import networkx as nx
import numpy as np
import pytest
from typer.testing import CliRunner

import maps
from launcher.cli import app
from launcher.studies import complexity_runs, drawing, redeployment, redeployment_runs, scaling, weights
from launcher.studies.complexity import study_complexity
from launcher.studies.complexity_runs import line_tree, modifications, place_each, run_map
from launcher.studies.redeployment import measure, study_redeployment
from launcher.studies.redeployment_runs import (
    NothingToJoin,
    Question,
    answer_all,
    draw_tasks,
    load_ground,
)
from launcher.studies.scaling import fit_exponential, fit_power
from launcher.studies.subset_figure import count_work
from launcher.studies.thesis_tables import EXPONENTIAL_AREA, ROWS
from launcher.studies.weighed_edges import find_scale
from launcher.studies.weights import study_weights
from planning import Environment, decompose, mutual_visibility, redeploy
from planning.edge_modification import best_modification
from planning.min_plus import scaled_links

REBUILT = {("room1", "aspect"), ("room3", "aspect"), ("maze", "inflection")}
"""Whose I and N are not those of Table 1."""


def table_of(file):
    return list(csv.DictReader(file.read_text(encoding="utf-8").splitlines()))


@pytest.fixture(autouse=True)
def coarse_figures(monkeypatch):
    monkeypatch.setattr(drawing, "DOTS_PER_IN", 30)
    monkeypatch.setattr(scaling, "BUDGET_S", 0.0)


@pytest.fixture(scope="module")
def small():
    return load_ground("l457mod", "aspect")


def test_the_thesis_table_is_whole():
    """Euler's formula gives the holes of each map; with bitangents room3 has three lines through a point."""
    for row in ROWS:
        holes = len(Environment.load(maps.path(row.map)).holes)
        assert row.holes == holes - ((row.map, row.kind) == ("room3", "aspect")), row
        assert row.Lb == row.V
        assert (row.La > 0) == (row.kind == "aspect")


def test_counts_are_those_of_table_1():
    for row in ROWS:
        counts = decompose(Environment.load(maps.path(row.map)), row.kind).counts
        same = {name for name in counts if counts[name] == getattr(row, name)}
        assert same >= {"V", "r", "Lb", "Lr"}, row
        assert (same >= {"La", "I", "N"}) == ((row.map, row.kind) not in REBUILT), row


def test_fits_recover_laws():
    x = np.array([20.0, 70, 300, 900])
    fit = fit_power(x, 3e-6 * x**2.5)
    assert (fit.slope, fit.factor, fit.share) == pytest.approx((2.5, 3e-6, 1.0))
    assert fit.error == pytest.approx(0.0, abs=1e-9)
    fit = fit_exponential([3, 4, 5, 8], 2e-3 * 3.0 ** np.array([3, 4, 5, 8]))
    assert (fit.slope, fit.factor, fit.points) == pytest.approx((3.0, 2e-3, 4))
    rng = np.random.default_rng(1)
    x = np.geomspace(10, 1000, 40)
    y = x**2 * np.exp(rng.normal(0, 0.3, 40))
    fit = fit_power(x, y)
    line, covariance = np.polyfit(np.log(x), np.log(y), 1, cov=True)
    assert fit.slope == pytest.approx(line[0])
    assert fit.error == pytest.approx(np.sqrt(covariance[0, 0]), rel=0.05)
    assert abs(fit.slope - 2.0) < 4 * fit.error


def test_modifications_are_all_trees_one_edge_away():
    for tree in (line_tree(5), np.array([(0, 1), (0, 2), (0, 3), (3, 4)])):
        edges = {frozenset(edge) for edge in tree.tolist()}
        pairs = [frozenset(pair) for pair in combinations(range(5), 2)]
        near = {
            frozenset(chosen)
            for chosen in combinations(pairs, 4)
            if len(edges & set(chosen)) >= 3 and nx.is_tree(nx.Graph(map(tuple, chosen)))
        }
        found = [frozenset(frozenset(edge) for edge in some.tolist()) for some in modifications(tree)]
        assert len(found) == len(set(found))
        assert set(found) == near
    assert [len(modifications(line_tree(k))) for k in range(4, 11)] == [(k**3 - 7 * k) // 6 + 2 for k in range(4, 11)]


def test_what_is_timed_gives_the_same_answer(small):
    rng = np.random.default_rng(4)
    links, priced = scaled_links(small.weights, 3.0), 3.0 * small.weights
    move = small.distances[rng.integers(0, len(small), 5)].copy()
    line = line_tree(5)
    cost, _ = best_modification(links, move, line, list(range(5)))
    assert place_each(links, move, modifications(line), priced) == pytest.approx(cost)


def test_maps_are_measured():
    run = run_map("room1", "inflection", True, ROWS[0])
    assert (run.segments, run.counts["N"], run.name) == (48, 26, "room1 (w/o bit.)")
    cells = decompose(Environment.load(maps.path("room1")))
    seen = mutual_visibility(cells).toarray()
    assert (
        run.links == np.triu(seen, 1).sum() == np.isfinite(np.triu(run.W, 1)).sum() - np.tril(np.ones(seen.shape)).sum()
    )
    assert run.lengths[3, 7] == pytest.approx(np.linalg.norm(cells.centroids[3] - cells.centroids[7]))


@pytest.mark.timeout(180)  # some seconds on an idle machine, most of it figures
def test_the_complexity_study_in_short(tmp_path, monkeypatch):
    monkeypatch.setattr(complexity_runs, "ROWS", (*ROWS[:3], ROWS[-1]))
    monkeypatch.setattr(complexity_runs, "BEYOND", (("l457mod", "inflection", False),))
    monkeypatch.setattr(complexity_runs, "TERMINALS", (3, 4, 5))
    monkeypatch.setattr(complexity_runs, "NODES", (4, 5, 6))
    told = []
    text = study_complexity(tmp_path, tell=told.append)
    assert (tmp_path / "summary.md").read_text(encoding="utf-8") == text
    assert {int(name[3:5]) for name in (file.name for file in tmp_path.glob("fig*.png"))} == set(range(41, 51))
    rows = table_of(tmp_path / "tables.csv")
    assert [row["N"] for row in rows] == ["26", "200", "48", "65", "18"]
    assert [row["N_thesis"] for row in rows] == ["26", "197", "48", "65", ""]
    assert "| room1 (w/ bit.) | 28 | 12 | 28 | 20 | 48 (45) | 207 (205) | 200 (197) |" in text
    assert rows[-1]["visibility_s"] == "nan"
    steiner, searches = table_of(tmp_path / "steiner.csv"), table_of(tmp_path / "redeployment.csv")
    assert len(steiner) == 4 * 3
    assert all(float(row["least_s"]) <= float(row["mean_s"]) <= float(row["most_s"]) for row in steiner)
    assert len(searches) == 4 * 3 * 4
    fits = table_of(tmp_path / "fits.csv")
    (fit,) = (
        row for row in fits if (row["algorithm"], row["over"], row["at"]) == ("tree by tree", "nodes", "65")
    )  # fmt: skip
    some = [row for row in searches if row["cells"] == "65" and row["algorithm"] == "tree by tree"]
    logs = np.log([[float(row["size"]), float(row["mean_s"])] for row in some])
    assert float(fit["slope_or_base"]) == pytest.approx(np.polyfit(*logs.T, 1)[0], rel=1e-4)
    (printed,) = (row for row in fits if row["algorithm"] == "all pairs" and row["whose"] == "thesis")
    of_table = [(row.N, row.Tpv) for row in (*ROWS[:3], ROWS[-1])]
    assert float(printed["slope_or_base"]) == pytest.approx(np.polyfit(*np.log(of_table).T, 1)[0], rel=1e-4)
    assert told[-1] == "figures"


@pytest.mark.timeout(180)  # some seconds on an idle machine, most of it figures
def test_the_weights_study_in_short(tmp_path, monkeypatch):
    monkeypatch.setattr(weights, "ROWS", (ROWS[0], ROWS[-1]))
    text = study_weights(tmp_path, "l457mod", lambda _: None)
    assert (tmp_path / "summary.md").read_text(encoding="utf-8") == text
    assert {file.stem[:5] for file in tmp_path.glob("fig*.png")} == {f"fig{n}" for n in (25, 26, 27, 28, 29, 30)}
    cells = decompose(Environment.load(maps.path("l457mod")), "aspect")
    seen = mutual_visibility(cells).toarray()
    pairs = [(i, j) for i, j in product(range(len(cells)), repeat=2) if i < j and seen[i, j]]
    rows = {
        (row["map"], row["unit"], row["measure"]): row for row in table_of(tmp_path / "statistics.csv")
    }  # fmt: skip
    costs = [np.exp(-cells.areas[i]) + np.exp(-cells.areas[j]) for i, j in pairs]
    row = rows["l457mod", "metres", "exponential area"]
    assert (float(row["mean"]), float(row["deviation"])) == pytest.approx((np.mean(costs), np.std(costs)))
    assert int(row["pairs"]) == len(pairs)
    assert float(rows["l457mod", "thesis", "exponential area"]["mean"]) == pytest.approx(EXPONENTIAL_AREA[0])
    scale = float(rows["l457mod", "thesis", "distance"]["scale"])
    inverse = [1 / cells.areas[i] + 1 / cells.areas[j] for i, j in pairs]
    scaled = float(rows["l457mod", "thesis", "inverse area"]["mean"])
    assert scaled == pytest.approx(np.mean(inverse) / scale**2)
    drawn = table_of(tmp_path / "histograms.csv")
    for figure, panels in (("26", 1), ("28", 2), ("29", 6), ("30", 1)):
        bars = [row for row in drawn if row["figure"] == figure]
        assert sum(int(row["pairs"]) for row in bars) == panels * len(pairs), figure


def test_the_scale_is_the_one_asked_for():
    areas = np.array([4.0, 9.0, 1.0])
    pairs = (np.array([0, 0]), np.array([1, 2]))
    scale = find_scale(areas, pairs)
    costs = np.exp(-areas * scale**2)
    assert np.mean([costs[0] + costs[1], costs[0] + costs[2]]) == pytest.approx(EXPONENTIAL_AREA[0])


def test_random_redeployments_are_what_is_said_of_them(small):
    question = Question(5, agents=2, mu_m=2.0)
    tasks, again = (list(draw_tasks(small, question, 4, 9)) for _ in range(2))
    for one, other in zip(tasks, again, strict=True):
        np.testing.assert_array_equal(one.move, other.move)
        start = nx.Graph(one.tree.tolist())
        assert nx.is_tree(start)
        assert all(small.visible[one.before[i], one.before[j]] for i, j in one.tree)
        assert (np.isfinite(one.move[:3]).sum(axis=1) == 1).all()
        assert one.move[0, one.before[0]] == 0, "the base stays"
        np.testing.assert_array_equal(one.move[3:], small.distances[one.before[3:]])
    near = list(draw_tasks(small, Question(4, near=True), 4, 9))
    assert all(small.visible[one.before[1], np.argmin(one.move[1])] for one in near)


@pytest.mark.parametrize("idle", [False, True])
def test_searches_of_the_study_are_those_of_the_engine(small, idle):
    question = Question(5, idle=idle)
    tasks = list(draw_tasks(small, question, 8, 2))
    for one, task in zip(answer_all(small, question, 8, 2), tasks, strict=True):
        for search in ("exact", "one-edge", "fixed"):
            engine = redeploy(task.move, small.weights, question.mu_m, search, task.tree, idle=idle)
            assert one.costs[search] == pytest.approx(engine.cost)
        in_order = [one.costs[search] for search in ("exact", "one-edge, repeated", "one-edge", "fixed")]
        assert all(less <= more * (1 + 1e-9) for less, more in pairwise(in_order))


def test_a_map_that_falls_apart_is_said(small, monkeypatch):
    monkeypatch.setattr(redeployment_runs, "TRIES", 20)
    apart = np.where(np.eye(len(small), dtype=bool), 0.0, np.inf)
    blind = dataclasses.replace(small, weights=apart, visible=np.isfinite(apart))
    with pytest.raises(NothingToJoin, match="l457mod"):
        next(draw_tasks(blind, Question(4), 1, 0))


@pytest.mark.timeout(180)  # some seconds on an idle machine, most of it figures
def test_the_redeployment_study_in_short(tmp_path, monkeypatch):
    monkeypatch.setattr(redeployment, "EXAMPLE", "l457mod")
    monkeypatch.setattr(redeployment, "NODES", (4, 6))
    text = study_redeployment(tmp_path, 5, 3, (("l457mod", "aspect"),), lambda _: None)
    assert (tmp_path / "summary.md").read_text(encoding="utf-8") == text
    assert {file.name for file in tmp_path.glob("*.png")} == {"costs.png", "times.png", "example.png", "exact.png"}
    rows = table_of(tmp_path / "redeployments.csv")
    assert len(rows) == 5 * (2 + len(redeployment.VARIATIONS))
    some = [row for row in rows if row["question"] == "one agent" and row["nodes"] == "6"]
    ratios = np.array([float(row["one-edge [m]"]) / float(row["exact [m]"]) - 1 for row in some])
    (said,) = (
        row
        for row in table_of(tmp_path / "statistics.csv")
        if (row["question"], row["nodes"], row["search"]) == ("one agent", "6", "one-edge")
    )
    assert float(said["median"]) == pytest.approx(np.sort(ratios)[2], abs=1e-5)
    assert float(said["same"]) == np.mean(ratios < 1e-7)
    assert float(said["none"]) == np.mean(np.isinf(ratios))


def test_measures_of_a_search():
    @dataclasses.dataclass
    class Made:
        costs: dict[str, float]
        seconds: dict[str, float]

    dearness = [1.0, 1.0, 1.0 + 1e-12, 1.2, 1.5, 1.1, 1.0, 1.0, np.inf, 1.05]
    answers = [Made({"exact": 4.0, "fixed": 4.0 * more}, {"exact": 2.0, "fixed": 0.5}) for more in dearness]
    same, middle, high, worst, none, ratio = measure(answers, "fixed")
    assert (same, none, ratio) == (0.5, 0.1, 0.25)
    assert middle == pytest.approx(0.05)
    assert high == np.inf
    assert worst == pytest.approx(0.5)


def test_the_work_that_is_drawn():
    """k = 3: three trees; two nodes below the root, so 4 states, and 3 of them with a branch."""
    work = list(count_work(3).values())
    assert work[0] == pytest.approx(3 * 700.0**3)
    assert work[1] == pytest.approx(3 * 3 * 98_000)
    assert work[2] == pytest.approx(9 * 700 + 4 * (98_000 + 2_100))


@pytest.mark.parametrize(
    "name, options, target, expected",
    [
        ("complexity", ["--quick"], "complexity.study_complexity", {"quick": True}),
        ("weights", ["--map", "room1"], "weights.study_weights", {"shown": "room1"}),
        ("redeployment", ["--number", "7", "--seed", "3"], "redeployment.study_redeployment", {"number": 7, "seed": 3}),
    ],
)
def test_the_commands(tmp_path, monkeypatch, name, options, target, expected):
    asked = {}

    def study(folder, first, *rest, tell=None):
        asked.update(folder=folder, given=[first, *rest][: len(expected)])
        return "what came out"

    monkeypatch.setattr(f"launcher.studies.{target}", study)
    monkeypatch.setattr("launcher.kernels.warm_up", lambda *_: False)
    result = CliRunner().invoke(app, ["study", name, *options, "--output", str(tmp_path / "made")])
    assert result.exit_code == 0, result.output
    assert asked == {"folder": tmp_path / "made", "given": list(expected.values())}
    assert "what came out" in result.output
    assert (tmp_path / "made").is_dir()


def test_the_example_of_the_page_says_what_comes_out():
    """Every line of docs/planning.md's example that promises a number in its comment."""
    page = (Path(__file__).parents[2] / "docs" / "planning.md").read_text(encoding="utf-8")
    names: dict[str, object] = {}
    promised = 0
    for example in re.findall(r"```python\n(.*?)```", page, re.DOTALL):
        for line in example.splitlines():
            code, _, comment = line.partition("  # ")
            said = re.match(r"-?[\d.]+\b", comment)
            if said and "=" not in code.partition("(")[0]:
                assert eval(code, names) == pytest.approx(float(said[0]), rel=0.005), line
                promised += 1
            else:
                exec(code, names)
    assert promised >= 6
